"""What holding the coefficients constant over a step costs, step by step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from flipproof.chapters.frozen.study import QUANTITIES, Frozen, study_frozen
from flipproof.figures.style import ASSUMPTIONS, MARKERS, new_figure, styled
from flipproof.frame.chapter import Ask, Chapter, Exhibit, Run, Study
from flipproof.output.columns import TIME, columns_csv
from slicemodel.trajectory import FloatArray


def study(ask: Ask) -> Study[Frozen]:
    """Store every slice of a flight by the exact step, and hold it against Eq. 8."""
    settings = {"steps": ask.steps, "store": "full"}
    run = Run("exact-step", ask.throw, settings, f"frozen, exact-step, {ask.steps} points")
    reference = Run("eq8", ask.throw, {}, "eq8")
    flights = yield [run, reference]
    return study_frozen(flights[run].flight, flights[reference].flight)


def figures(found: Frozen) -> Iterator[Exhibit]:
    """Yield changes, defects and what they add up to."""
    words = dict(zip(QUANTITIES, ("omega", "theta", "r_CM", "v_CM"), strict=True))
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


@styled
def figure_frozen(study: Frozen) -> Figure:
    """Draw how every coefficient changes in a step, the defect that holding it causes, and what becomes of them."""
    coefficients = dict(zip(QUANTITIES, ("ω", "θ (gravity)", "r_CM", "v_CM (drag)"), strict=True))
    colours = dict(zip(QUANTITIES, ("#D55E00", "#0072B2", "#009E73", "#CC79A7"), strict=True))
    figure, panels = new_figure(3, size=(8.0, 8.6), sharex=True)
    changes, defects, errors = panels
    d_omega, d_theta, d_r_cm, damping = study.changes
    for words, values, colour, dash in (
        ("|Δω| / ω", d_omega, colours["omega"], "-"),
        ("|Δθ| [rad]", d_theta, colours["theta"], "-"),
        ("|Δr_CM| / L", d_r_cm, colours["r_cm"], "-"),
        ("γ / ω, not a change", damping, "#000000", ":"),
    ):
        changes.semilogy(study.t, _shown(values), color=colour, linewidth=1.2, linestyle=dash, label=words)
    changes.set_title(f"change in one step of {study.dt * 1e3:.2g} ms, {study.scheme}", fontsize=10, loc="left")
    changes.set_ylabel("change per step [1]")
    for k, quantity in reversed(tuple(enumerate(QUANTITIES))):
        values = study.defect[quantity]
        if not values.any():
            continue
        time, peak = study.peak[quantity]
        label = f"{coefficients[quantity]}: largest in {100 * study.share[quantity]:.0f} % of the steps"
        colour = colours[quantity]
        if quantity == "v_cm":  # jumps at every impact: its range within a window leaves the others to be seen
            t, least, most = envelope(study.t, values)
            label += f" (range within {1e3 * (t[1] - t[0]):.2g} ms)"
            defects.fill_between(t, least, most, color=colour, alpha=0.35, linewidth=0.0, step="mid", label=label)
        else:
            defects.semilogy(study.t, _shown(values), color=colour, linewidth=1.4, label=label)
        defects.plot(time, peak, MARKERS[k], color=colour, markeredgecolor="white", markersize=8)
    defects.set_yscale("log")
    defects.set_title("velocity missed in one step because a coefficient is held constant", fontsize=10, loc="left")
    defects.set_ylabel("rms over slices [m/s]")
    end = study.t + study.dt
    for values, colour, width, dash, words in (
        (study.velocity_error, "#56B4E9", 1.5, "-", f"error of r' against {study.model} [m/s]"),
        (study.cumulative, "#444444", 1.0, "-", "missed velocities added up [m/s]"),
        (study.omega_error, "#D55E00", 1.5, "--", "error of ω / ω₀ [1]"),
    ):
        errors.semilogy(end, _shown(values), color=colour, linewidth=width, linestyle=dash, label=words)
    if study.first_impact is not None:
        errors.axvline(study.first_impact, color=ASSUMPTIONS[4], linewidth=1.0, linestyle=":", label="first impact")
    errors.set_title("missed velocities added up, over slices that have not hit an end yet", fontsize=10, loc="left")
    errors.set(ylabel="error [m/s], [1]", xlabel="time t [s]")
    for axes in panels:
        axes.margins(x=0.01)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.3 if axes is errors else -0.06), ncols=2, fontsize=8.5)
    return figure


def envelope(t: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the least and the largest positive value in each of 100 windows, and its middle, shape (W,).

    A window without any has NaN.
    """
    windows = np.array_split(np.arange(len(t)), min(100, len(t)))
    shown = _shown(values)
    kept = [shown[window][np.isfinite(shown[window])] for window in windows]
    least, most = (np.array([pick(each) if len(each) else np.nan for each in kept]) for pick in (np.min, np.max))
    return np.array([t[window].mean() for window in windows]), least, most


def _shown(values: FloatArray) -> FloatArray:
    """Return values for a logarithmic axis: zeros leave a gap."""
    return np.where(values > 0, values, np.nan)


CHAPTER: Final = Chapter(name="frozen", title="ω held constant over a step", study=study, figures=figures)
