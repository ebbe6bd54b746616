"""How the error of a scheme falls with its step, against the equation it really solves.

A rebound waits for the grid, so the error at one step size depends on where in its step each impact falls. Single runs
then scatter by more than a factor of two, and an order read off them is luck. Each step size is therefore an ensemble
of grids: every member has other impact phases, and their mean error has an order. All grids of a study share a set of
times, and errors are taken there: an interpolation would have an error of its own, larger than that of a good scheme.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flipproof.frame.solvers import Run
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray

PHASES = 8
"""Members of the ensemble at each step size."""

ROUND_OFF = 1e-13
"""Errors below this fraction of omega_0 are not the step's."""

LEAST_COMMON = 8
"""Common times, less one, that a run and its reference must share at the least."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepSize:
    """Error against step size, one row per level and one column per phase.

    ``dt`` and ``error`` have shape (levels, phases); error is max |omega - omega_reference| / omega_0 over the flight.
    ``order`` is the slope of log mean error against log mean dt with its standard error; NaN if any error is not
    finite or if the errors are at round-off.
    """

    scheme: str
    model: str
    dt: FloatArray
    error: FloatArray
    order: float
    order_error: float
    refined: bool

    @property
    def exact(self) -> bool:
        """True if every error is at round-off: nothing depends on the step (ice, or a tube that nothing moves)."""
        return bool(np.all(self.error < ROUND_OFF))

    @property
    def mean_dt(self) -> FloatArray:
        """Geometric mean step of every level [s]."""
        return np.asarray(np.exp(np.log(self.dt).mean(axis=1)))

    @property
    def mean_error(self) -> FloatArray:
        """Root-mean-square error of every level."""
        return np.asarray(np.sqrt((self.error**2).mean(axis=1)))


def plan_step_size(scenario: Scenario, scheme: str, base: int, multiple: int, count: int) -> list[list[Run]]:
    """Return the runs of every level: PHASES multiples of ``base`` steps from ``multiple`` on, doubled at each level.

    All their grids share ``base + 1`` times.
    """
    return [
        [
            Run(scheme, scenario, {"steps": steps + 1, "store": "summary"}, f"{scheme}, {steps} steps")
            for steps in (base * (multiple + phase) * 2**level for phase in range(PHASES))
        ]
        for level in range(count)
    ]


def study_step_size(reference: Trajectory, runs: Sequence[Sequence[Trajectory]]) -> StepSize:
    """Measure the observed order of a scheme against its limit equation; arguments and errors as of ``errors_of``."""
    dt, error = errors_of(reference, runs)
    order, order_error = observed_order(dt, error)
    # Refinement is proven only if every level is better than the one before it.
    mean = np.sqrt((error**2).mean(axis=1))
    return StepSize(
        scheme=runs[0][0].method,
        model=reference.method,
        dt=dt,
        error=error,
        order=order,
        order_error=order_error,
        refined=bool(np.all(np.isfinite(mean)) and np.all(np.diff(mean) < 0)),
    )


def errors_of(reference: Trajectory, runs: Sequence[Sequence[Trajectory]]) -> tuple[FloatArray, FloatArray]:
    """Return step [s] and max |omega - omega_reference| / omega_0 of every run, shape (levels, members).

    The error is NaN where a run is not complete. The reference is on uniform times, the runs are as ``plan_step_size``
    plans them; one that shares fewer than LEAST_COMMON intervals with the reference raises a ValueError.
    """

    def error(run: Trajectory) -> float:
        if not (run.ok and reference.ok):
            return math.nan
        fine, coarse = len(run.t) - 1, len(reference.t) - 1
        common = math.gcd(fine, coarse)
        if common < LEAST_COMMON:
            raise ValueError(f"{fine} steps and {coarse} reference intervals share only {common} intervals")
        difference = run.omega[:: fine // common] - reference.omega[:: coarse // common]
        return float(np.abs(difference).max() / abs(reference.scenario.omega0))

    dt = np.array([[run.settings["dt"] for run in level] for level in runs])
    return dt, np.array([[error(run) for run in level] for level in runs])


def observed_order(dt: FloatArray, error: FloatArray) -> tuple[float, float]:
    """Fit log(rms error) = p log(dt) + c over the levels; return p and its standard error.

    NaN for both if an error is not finite, or if errors reach ROUND_OFF, where an order means nothing.
    """
    if not np.all(np.isfinite(error)) or error.min() < ROUND_OFF or len(dt) < 3:
        return math.nan, math.nan
    x = np.log(dt).mean(axis=1)
    y = 0.5 * np.log((error**2).mean(axis=1))
    x = x - x.mean()
    slope = float((x @ y) / (x @ x))
    residual = y - y.mean() - slope * x
    variance = float(residual @ residual) / (len(x) - 2)
    return slope, float(np.sqrt(variance / (x @ x)))


def before_first_impact(scenario: Scenario, reference: Trajectory) -> Scenario | None:
    """Return the throw cut off at 0.9 of the time of the first impact, or None if no slice ever strikes an end.

    A slice that rests on an end from the start does not strike it.
    """
    assert reference.impacts is not None
    if len(reference.impacts) == 0:
        return None
    return replace(scenario, duration=0.9 * float(reference.impacts.time[0]))
