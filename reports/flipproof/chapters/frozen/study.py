"""The constants that are none: what it costs to freeze omega, theta, r_CM and v_CM over an exact step, and when.

One step moves every slice by the exact solution of r'' = A(omega, theta, r_CM, v_CM; r, r') with the four in front held
at their values at the start. Over the step they change; to first order the velocity misses, per step and slice,

    dt (A(..., q at mid-step, ...) - A(..., q as used, ...))      for each frozen quantity q separately     [m/s]

with q at mid-step the mean of its values at the two ends, computed from the slices themselves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from slicemodel import Trajectory
from slicemodel.observables import centre_of_mass, centre_of_mass_velocity, moment_of_inertia
from slicemodel.trajectory import FloatArray

QUANTITIES: Final = ("omega", "theta", "r_cm", "v_cm")


@dataclass(frozen=True, slots=True, kw_only=True)
class Frozen:
    """What one flight pays for its frozen coefficients. Curves per step have shape (P - 1,), at the start of the step.

    Parameters
    ----------
    scheme, model : str - the scheme, and the equation it is held against
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

    scheme: str
    model: str
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

    Raises
    ------
    ValueError
        If the two have different times.
    """
    if len(run.t) != len(reference.t) or not np.allclose(run.t, reference.t, rtol=0.0, atol=1e-12):
        raise ValueError("the reference must be computed at the times of the run")
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
        scheme=run.method,
        model=reference.method,
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
