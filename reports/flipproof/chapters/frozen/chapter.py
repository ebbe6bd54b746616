"""The constants that are none: what it costs to freeze omega, theta, r_CM and v_CM over an exact step, and when.

One step moves every slice by the exact solution of r'' = A(omega, theta, r_CM, v_CM; r, r') with the four in front held
at their values at the start. Over the step they change; to first order the velocity misses, per step and slice,

    dt (A(..., q at mid-step, ...) - A(..., q as used, ...))      for each frozen quantity q separately     [m/s]

with q at mid-step the mean of its values at the two ends, computed from the slices themselves.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flipproof.figures.style import ASSUMPTIONS, MARKERS, new_figure, styled
from flipproof.frame.chapter import Ask, Chapter, Exhibit, Run, Study
from flipproof.frame.columns import TIME, columns_csv
from slicemodel import Trajectory
from slicemodel.observables import centre_of_mass, centre_of_mass_velocity, moment_of_inertia
from slicemodel.trajectory import FloatArray

QUANTITIES: Final = ("omega", "theta", "r_cm", "v_cm")


@dataclass(frozen=True, slots=True, kw_only=True)
class Frozen:
    """What one flight pays for its frozen coefficients. Curves per step have shape (P - 1,), at the start of the step.

    Parameters
    ----------
    t : (P - 1,) [s]; dt : float [s]
    changes : |d omega| / omega; |d theta| [rad]; |d r_CM| / L; and gamma / omega, what Eq. 9a takes to be small
    defect : quantity -> (P - 1,) [m/s]
        Rms over the slices that do not hit an end in that step of what freezing the quantity misses; NaN if all do.
    peak : quantity -> (time [s], defect [m/s])
    share : quantity -> fraction of the steps in which its defect is the largest
    cumulative, velocity_error : (P - 1,) [m/s]
        After each step, rms over the slices that have hit an end in neither run so far, NaN once there is none: the
        defects added up with their signs, and the difference in r' from the reference.
    omega_error : (P - 1,) - |omega - omega of the reference| / omega_0, rebounds included
    first_impact : float or None [s] - in the reference
    explained : float or None
        velocity_error / cumulative shortly before the first impact; 1 if defects, added up, are the whole error.
    """

    t: FloatArray
    dt: float
    changes: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
    defect: Mapping[str, FloatArray]
    peak: Mapping[str, tuple[float, float]]
    share: Mapping[str, float]
    cumulative: FloatArray
    velocity_error: FloatArray
    omega_error: FloatArray
    first_impact: float | None
    explained: float | None


def study_frozen(run: Trajectory, reference: Trajectory) -> Frozen:
    """Measure what the frozen coefficients of a run of the exact step, stored in full, cost.

    The reference is Eq. 8 at the times of the run.
    """
    scenario, dt, t = run.scenario, float(run.t[1] - run.t[0]), run.t[:-1]
    inertia = moment_of_inertia(scenario, run.r)
    v_cm = centre_of_mass_velocity(scenario, run.v)
    values = {"omega": run.omega, "theta": run.theta, "r_cm": run.r_cm, "v_cm": v_cm}
    used = {q: value[:-1] for q, value in values.items()}
    values |= {"omega": inertia[0] * scenario.omega0 / inertia, "r_cm": centre_of_mass(scenario, run.r)}
    middle = {q: 0.5 * (value[:-1] + value[1:]) for q, value in values.items()}
    was = _acceleration(run, used)
    signed = {q: dt * (_acceleration(run, used | {q: middle[q]}) - was) for q in QUANTITIES}
    struck = _struck(run)
    untouched = ~np.logical_or.accumulate(struck | _struck(reference), axis=0)
    defect = {q: _rms(missed, ~struck) for q, missed in signed.items()}
    dominant = np.nan_to_num(np.array([defect[q] for q in QUANTITIES])).argmax(axis=0)
    cumulative = _rms(np.cumsum(sum(signed.values(), np.zeros_like(was)), axis=0), untouched)
    velocity_error = _rms(run.v[1:] - reference.v[1:], untouched)
    impacts = reference.impacts
    first = float(impacts.time[0]) if impacts is not None and len(impacts) else None
    k = 0 if first is None else int(np.searchsorted(run.t[1:], 0.9 * first)) - 1
    return Frozen(
        t=t,
        dt=dt,
        changes=(
            np.abs(np.diff(run.omega) / run.omega[:-1]),
            np.abs(np.diff(run.theta)),
            np.abs(np.diff(run.r_cm)) / scenario.bottle.length,
            scenario.damping_rate / np.abs(run.omega[:-1]),
        ),
        defect=defect,
        peak={q: (float(t[np.nanargmax(missed)]), float(np.nanmax(missed))) for q, missed in defect.items()},
        share={q: float(np.mean(dominant == k)) for k, q in enumerate(QUANTITIES)},
        cumulative=cumulative,
        velocity_error=velocity_error,
        omega_error=np.abs(run.omega[1:] - reference.omega[1:]) / abs(scenario.omega0),
        first_impact=first,
        explained=float(velocity_error[k] / cumulative[k]) if k >= 1 and cumulative[k] > 0 else None,
    )


def _acceleration(run: Trajectory, q: Mapping[str, FloatArray]) -> FloatArray:
    """Return r'' of the equation that a step solves with the coefficients ``q`` held, shape (P - 1, N) [m/s^2]."""
    gamma, spring = run.scenario.damping_rate, q["omega"] ** 2
    common = -spring * q["r_cm"] + run.scenario.gravity * np.cos(q["theta"]) + 2.0 * gamma * q["v_cm"]
    return np.asarray(spring[:, np.newaxis] * run.r[:-1] - 2.0 * gamma * run.v[:-1] + common[:, np.newaxis])


def _struck(run: Trajectory) -> NDArray[np.bool_]:
    """Return which slices hit an end in which step, shape (P - 1, N); a slice at rest on one hits it all the time."""
    struck = np.zeros((len(run.t) - 1, run.scenario.n_slices), dtype=bool)
    if run.impacts is not None and len(run.impacts):
        step = np.searchsorted(run.t, run.impacts.time, side="left") - 1
        struck[np.maximum(step, 0), run.impacts.slice] = True
    return struck


def _rms(values: FloatArray, counted: NDArray[np.bool_]) -> FloatArray:
    """Return the root mean square over the slices that count; NaN where none does."""
    number = counted.sum(axis=1)
    total = np.where(counted, values**2, 0.0).sum(axis=1)
    return np.where(number > 0, np.sqrt(total / np.maximum(number, 1)), np.nan)


def study(ask: Ask) -> Study[Frozen]:
    """Store every slice of a flight by the exact step, and hold it against Eq. 8."""
    settings = {"steps": ask.steps, "store": "full"}
    run = Run("exact-step", ask.throw, settings, f"frozen, exact-step, {ask.steps} points")
    reference = Run("eq8", ask.throw, {}, "eq8")
    flights = yield [run, reference]
    return study_frozen(flights[run].flight, flights[reference].flight)


def figures(results: Frozen) -> Iterator[Exhibit]:
    """Yield changes, defects and what they add up to."""
    words = dict(zip(QUANTITIES, ("omega", "theta", "r_CM", "v_CM"), strict=True))
    shares = ", ".join(f"{words[name]} {results.share[name]:.0%}" for name in QUANTITIES)
    peaks = ", ".join(
        f"{words[name]} {peak:.1e} m/s at {time * 1e3:.0f} ms"
        for name, (time, peak) in results.peak.items()
        if results.defect[name].any()
    )
    explained = " Before the first impact the error of the velocity is {:.2f} of what they add up to."
    changes = ("|d omega|/omega per step [1]", "|d theta| per step [rad]", "|d r_CM|/L per step [1]", "gamma/omega [1]")
    yield Exhibit(
        name="frozen",
        title="What holding the coefficients constant costs, step by step",
        caption="Top: how much each quantity that is held constant changes within a step. Middle: the velocity "
        "missed in that step because the quantity is held constant, with a marker at the largest value of each; v_CM "
        "jumps at every impact, so a band shows the range for it. Bottom: the sum of the missed velocities, "
        "and the errors of the velocity and of ω."
        + ("" if results.explained is None else explained.format(results.explained)),
        alt=f"Curves over time for exact-step at a step of {results.dt * 1e3:.2g} ms. Share of the steps in which "
        f"freezing costs most: {shares}. Largest velocity missed in one step: {peaks or 'none'}. Largest error of "
        f"omega over omega_0 against eq8: {results.omega_error.max():.2g}.",
        maker=figure_frozen,
        data=(results,),
        table=columns_csv(
            {
                TIME: results.t,
                **dict(zip(changes, results.changes, strict=True)),
                **{f"defect of a frozen {name} per step [m/s]": results.defect[name] for name in QUANTITIES},
                "defects added up to the end of the step [m/s]": results.cumulative,
                "error of r' there [m/s]": results.velocity_error,
                "error of omega/omega_0 there [1]": results.omega_error,
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
    labels = ("|Δω| / ω", "|Δθ| [rad]", "|Δr_CM| / L", "γ / ω, not a change")
    looks = [*((colours[quantity], "-") for quantity in QUANTITIES[:3]), ("#000000", ":")]
    for values, words, (colour, dash) in zip(study.changes, labels, looks, strict=True):
        changes.semilogy(study.t, _shown(values), color=colour, linewidth=1.2, linestyle=dash, label=words)
    changes.set_title(f"change in one step of {study.dt * 1e3:.2g} ms, exact-step", fontsize=10, loc="left")
    changes.set_ylabel("change per step [1]")
    for k, quantity in reversed(tuple(enumerate(QUANTITIES))):
        values = study.defect[quantity]
        if not values.any():
            continue
        time, peak = study.peak[quantity]
        label = f"{coefficients[quantity]}: largest in {100 * study.share[quantity]:.0f} % of the steps"
        colour = colours[quantity]
        if quantity == "v_cm":  # jumps at every impact: its range within a window leaves the others to be seen
            t, low, high = envelope(study.t, values)
            label += f" (range within {1e3 * (t[1] - t[0]):.2g} ms)"
            defects.fill_between(t, low, high, color=colour, alpha=0.35, linewidth=0.0, step="mid", label=label)
        else:
            defects.semilogy(study.t, _shown(values), color=colour, linewidth=1.4, label=label)
        defects.plot(time, peak, MARKERS[k], color=colour, markeredgecolor="white", markersize=8)
    defects.set_yscale("log")
    defects.set_title("velocity missed in one step because a coefficient is held constant", fontsize=10, loc="left")
    defects.set_ylabel("rms over slices [m/s]")
    end = study.t + study.dt
    for values, colour, width, dash, words in (
        (study.velocity_error, "#56B4E9", 1.5, "-", "error of r' against eq8 [m/s]"),
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
    low, high = (np.array([pick(finite) if len(finite) else np.nan for finite in kept]) for pick in (np.min, np.max))
    return np.array([t[window].mean() for window in windows]), low, high


def _shown(values: FloatArray) -> FloatArray:
    """Return values for a logarithmic axis: zeros leave a gap."""
    return np.where(values > 0, values, np.nan)


CHAPTER: Final = Chapter("frozen", "ω held constant over a step", study, figures=figures, ice=False)
