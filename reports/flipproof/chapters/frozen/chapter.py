"""What holding the coefficients constant over a step costs, step by step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from flipproof.chapters.frozen.figure import figure_frozen
from flipproof.chapters.frozen.study import QUANTITIES, Frozen, study_frozen
from flipproof.frame.chapter import Ask, Chapter, Exhibit, Run, Study
from flipproof.output.columns import TIME, columns_csv


def study(ask: Ask) -> Study[Frozen]:
    """Store every slice of a flight by the exact step, and hold it against Eq. 8."""
    settings = {"steps": ask.steps, "store": "full"}
    run = Run("exact-step", ask.throw, settings, f"frozen, exact-step, {ask.steps} points")
    reference = Run("eq8", ask.throw, {}, "eq8")
    flights = yield [run, reference]
    return study_frozen(flights[run].flight, flights[reference].flight)


def figures(found: Frozen) -> Iterator[Exhibit]:
    """Yield changes, defects and what they add up to."""
    words = {"omega": "omega", "theta": "theta", "r_cm": "r_CM", "v_cm": "v_CM"}
    shares = ", ".join(f"{words[name]} {found.share[name]:.0%}" for name in QUANTITIES)
    peaks = ", ".join(
        f"{words[name]} {peak:.1e} m/s at {time * 1e3:.0f} ms"
        for name, (time, peak) in found.peak.items()
        if found.defect[name].any()
    )
    explained = " Before the first impact the error of the velocity is {:.2f} of what they add up to."
    d_omega, d_theta, d_r_cm, damping = found.changes
    yield Exhibit(
        name="frozen",
        title="What holding the coefficients constant costs, step by step",
        caption="Top: how much each quantity that is held constant changes within a step. Middle: the velocity that "
        "holding it constant misses in that step, with a marker at the largest value of each; v_CM jumps at every "
        "impact, so that a band shows the range of what holding it misses. Bottom: the missed velocities added up, "
        "beside the error of the velocity and of ω that they lead to."
        + ("" if found.explained is None else explained.format(found.explained)),
        alt=f"Curves over time for {found.scheme} at a step of {found.dt * 1e3:.2g} ms. Share of the steps in which "
        f"freezing costs most: {shares}. Largest velocity missed in one step: {peaks or 'none'}. Largest error of "
        f"omega over omega_0 against {found.model}: {found.omega_error.max():.2g}.",
        maker=figure_frozen,
        data=(found,),
        table=columns_csv(
            {
                TIME: found.t,
                "|d omega|/omega per step [1]": d_omega,
                "|d theta| per step [rad]": d_theta,
                "|d r_CM|/L per step [1]": d_r_cm,
                "gamma/omega [1]": damping,
                **{f"defect of a frozen {quantity} per step [m/s]": found.defect[quantity] for quantity in QUANTITIES},
                "defects added up to the end of the step [m/s]": found.cumulative,
                "error of r' there [m/s]": found.velocity_error,
                "error of omega/omega_0 there [1]": found.omega_error,
            }
        ),
    )


CHAPTER: Final = Chapter(name="frozen", title="ω held constant over a step", study=study, figures=figures)
