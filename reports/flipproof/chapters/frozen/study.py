"""The constants that are none: what it costs to freeze omega, theta, r_CM and v_CM over a step, and when.

One step moves every slice by the exact solution of r'' = A(omega, theta, r_CM, v_CM; r, r') with the four in front held
at their values at the start. Over the step they change; to first order the velocity misses, per step and slice,

    dt (A(..., q at mid-step, ...) - A(..., q as used, ...))      for each frozen quantity q separately     [m/s]

with q at mid-step the mean of its values at the two ends, computed from the slices themselves. For a program that lags
a step behind (``published-python``) the value used is the one it used, so that the lag is part of the defect.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flipproof.chapters.differences.study import first_crossing
from flipproof.chapters.solvers import LIMITS
from flipproof.frame.solvers import Run
from slicemodel import Scenario, Trajectory
from slicemodel.observables import centre_of_mass, centre_of_mass_velocity, moment_of_inertia
from slicemodel.trajectory import FloatArray

FREEZING: Final = ("published-python", "signs-corrected", "roots-corrected", "exact-step")
"""Schemes that freeze their coefficients at the start of the step."""

QUANTITIES: Final = ("omega", "theta", "r_cm", "v_cm")

BEFORE_IMPACT = 0.9
"""Share of the time to the first impact over which frozen coefficients are the only error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frozen:
    """What one flight pays for its frozen coefficients. Curves per step have shape (P - 1,), at the start of the step.

    Parameters
    ----------
    scheme, model : str - the scheme, and the equation it is held against
    t : (P - 1,) [s]; dt : float [s]
    change_omega : |d omega| / omega; change_theta : |d theta| [rad]; change_r_cm : |d r_CM| / L
    damping : gamma / omega, what Eq. 9a takes to be small
    defect : quantity -> (P - 1,) [m/s]
        Rms over the slices that do not hit an end in that step of what freezing the quantity misses; NaN if all do.
    peak : quantity -> (time [s], defect [m/s])
    dominant : (P - 1,) of int - index into QUANTITIES of the largest defect
    share : quantity -> fraction of the steps in which its defect is the largest
    cumulative, velocity_error : (P - 1,) [m/s]
        After each step, rms over the slices that have hit an end in neither run so far, NaN once there is none: the
        defects added up with their signs, and the difference in r' from the reference.
    omega_error : (P - 1,) - |omega - omega of the reference| / omega_0, rebounds included
    first_impact : float or None [s] - in the reference
    explained : float or None
        velocity_error / cumulative shortly before the first impact; 1 if defects, added up, are the whole error.
    parting_time : float or None - when omega_error passes 1 % [s]
    """

    scheme: str
    model: str
    t: FloatArray
    dt: float
    change_omega: FloatArray
    change_theta: FloatArray
    change_r_cm: FloatArray
    damping: FloatArray
    defect: Mapping[str, FloatArray]
    peak: Mapping[str, tuple[float, float]]
    dominant: FloatArray
    share: Mapping[str, float]
    cumulative: FloatArray
    velocity_error: FloatArray
    omega_error: FloatArray
    first_impact: float | None
    explained: float | None
    parting_time: float | None


def plan_frozen(throw: Scenario, scheme: str, steps: int) -> list[Run]:
    """Return the scheme's run, stored in full, and its equation on the same times."""
    times = np.linspace(0.0, throw.duration, steps)
    return [
        Run(scheme, throw, {"steps": steps, "store": "full"}, label=f"frozen, {scheme}, {steps} points"),
        Run(LIMITS[scheme], throw, {"times": times}, label=f"frozen, {LIMITS[scheme]}, {steps} points"),
    ]


def study_frozen(run: Trajectory, reference: Trajectory) -> Frozen:
    """Look the frozen coefficients of one run in the eye.

    Raises
    ------
    ValueError
        If the scheme does not freeze at the start of the step, the run is a summary, or the two have different times.
    """
    if run.method not in FREEZING:
        raise ValueError(
            f"scheme = {run.method!r} does not freeze at the start of a step; known: {', '.join(FREEZING)}"
        )
    if len(run.r) == 0:
        raise ValueError("the run holds no slices; make it with store = 'full'")
    if len(run.t) != len(reference.t) or not np.allclose(run.t, reference.t, rtol=0.0, atol=1e-12):
        raise ValueError("the reference must be computed at the times of the run")
    scenario, dt = run.scenario, float(run.t[1] - run.t[0])
    used, middle = _coefficients(run)
    r, v = run.r[:-1], run.v[:-1]
    was = _acceleration(run, used, r, v)
    struck = _struck(run)
    untouched = ~np.logical_or.accumulate(struck | _struck(reference), axis=0)
    signed = {q: dt * (_acceleration(run, used | {q: middle[q]}, r, v) - was) for q in QUANTITIES}
    defect = {q: _rms(values, ~struck) for q, values in signed.items()}
    together = np.nan_to_num(np.array([defect[q] for q in QUANTITIES]))
    dominant = together.argmax(axis=0)
    cumulative = _rms(np.cumsum(sum(signed.values(), np.zeros_like(r)), axis=0), untouched)
    velocity_error = _rms(run.v[1:] - reference.v[1:], untouched)
    omega_error = np.abs(run.omega[1:] - reference.omega[1:]) / abs(scenario.omega0)
    impacts = reference.impacts
    first = float(impacts.time[0]) if impacts is not None and len(impacts) else None
    t = run.t[:-1]
    return Frozen(
        scheme=run.method,
        model=reference.method,
        t=t,
        dt=dt,
        change_omega=np.abs(np.diff(run.omega) / run.omega[:-1]),
        change_theta=np.abs(np.diff(run.theta)),
        change_r_cm=np.abs(np.diff(run.r_cm)) / scenario.bottle.length,
        damping=scenario.damping_rate / np.abs(run.omega[:-1]),
        defect=defect,
        peak={q: (float(t[np.nanargmax(values)]), float(np.nanmax(values))) for q, values in defect.items()},
        dominant=dominant.astype(np.float64),
        share={q: float(np.mean(dominant == k)) for k, q in enumerate(QUANTITIES)},
        cumulative=cumulative,
        velocity_error=velocity_error,
        omega_error=omega_error,
        first_impact=first,
        explained=_explained(run.t[1:], cumulative, velocity_error, first),
        parting_time=first_crossing(run.t[1:], omega_error, 0.01),
    )


def _coefficients(run: Trajectory) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return the four quantities as the scheme used them in each step, and their true means over it, shape (P - 1,)."""
    scenario = run.scenario
    inertia = moment_of_inertia(scenario, run.r)
    true = {
        "omega": inertia[0] * scenario.omega0 / inertia,
        "theta": run.theta,
        "r_cm": centre_of_mass(scenario, run.r),
        "v_cm": centre_of_mass_velocity(scenario, run.v),
    }
    used = {"omega": run.omega, "theta": run.theta, "r_cm": run.r_cm, "v_cm": true["v_cm"]}
    return (
        {q: values[:-1] for q, values in used.items()},
        {q: 0.5 * (values[:-1] + values[1:]) for q, values in true.items()},
    )


def _acceleration(run: Trajectory, q: Mapping[str, FloatArray], r: FloatArray, v: FloatArray) -> FloatArray:
    """Return r'' of the equation that a step solves with the coefficients ``q`` held, shape (P - 1, N) [m/s^2]."""
    scenario = run.scenario
    gamma = scenario.damping_rate
    exact_roots = run.method in ("roots-corrected", "exact-step")
    square = q["omega"] ** 2
    spring = square if exact_roots else square - gamma**2
    common = -spring * q["r_cm"] + spring / square * scenario.gravity * np.cos(q["theta"])
    if run.method == "exact-step":
        common = common + 2.0 * gamma * q["v_cm"]
    damped = 0.0 if run.method == "published-python" else 2.0 * gamma
    return np.asarray(spring[:, np.newaxis] * r - damped * v + common[:, np.newaxis])


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


def _explained(t: FloatArray, cumulative: FloatArray, error: FloatArray, first: float | None) -> float | None:
    if first is None:
        return None
    k = int(np.searchsorted(t, BEFORE_IMPACT * first)) - 1
    return float(error[k] / cumulative[k]) if k >= 1 and cumulative[k] > 0 else None
