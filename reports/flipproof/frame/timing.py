"""Runs made for their cost: processor time of the run alone, the least of several, on a solver that is warm.

A report makes its runs in a pool on a machine that does other things too: wall time would measure those. Processor
time of this process does not, but still grows when the caches are shared; the least of several runs is closest to what
the run needs. Compiling, importing and reading caches belong to the first run of a solver in a process, and are not
what a step costs: each batch first makes a short flight with every solver in it, which is thrown away.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flipproof.frame.solvers import Missing, Run, RunResult, find, make, solve
from slicemodel import Scenario, Trajectory
from slicemodel.scenario import MIN_VALUE
from slicemodel.trajectory import FloatArray

SAME_TIME: Final = 1e-9
"""Share of the duration by which two times may differ and be the same."""


def solve_timed(name: str, scenario: Scenario, **settings: Any) -> tuple[Trajectory, float]:
    """Run the named solver; return its flight and the wall time it took [s], without compiling ``ode_reference``."""
    if find(name).package == "ode_reference":
        solve(name, _begun(scenario), **settings)
    began = time.perf_counter()
    flight = solve(name, scenario, **settings)
    return flight, time.perf_counter() - began


def make_timed(runs: Sequence[tuple[Run, FloatArray]]) -> list[RunResult]:
    """Make runs one after the other; ``seconds`` is processor time, trajectories are kept at the given times only."""
    for run in {_kind(run): run for run, _ in runs}.values():
        make(_short(run))
    return [_timed_result(run, times) for run, times in runs]


def at_times(t: FloatArray, times: FloatArray) -> NDArray[np.int64]:
    """Return the indices at which ``t`` holds ``times``.

    One that is not there raises Missing: an interpolation would have an error of its own.
    """
    slack = SAME_TIME * times[-1]
    at: NDArray[np.int64] = np.minimum(np.searchsorted(t, times - slack), len(t) - 1)
    missing = times[~(np.abs(t[at] - times) <= slack)]
    if len(missing):
        raise Missing(f"the run holds no point at t = {missing[0]:.9g} s; its grid does not share the common times")
    return at


def batches(runs: list[tuple[Run, FloatArray]]) -> Iterator[list[tuple[Run, FloatArray]]]:
    """Yield jobs, the slice model's first: one for all of it, so that its loop is compiled in one worker only."""
    compiled: list[tuple[Run, FloatArray]] = []
    groups: dict[tuple[Any, ...], list[tuple[Run, FloatArray]]] = {}
    for run, times in runs:
        scheme = find(run.solver).package == "slicemodel"
        (compiled if scheme else groups.setdefault(_kind(run), [])).append((run, times))
    if compiled:
        yield compiled
    for group in groups.values():
        yield from (group[k : k + 12] for k in range(0, len(group), 12))


def _kind(run: Run) -> tuple[Any, ...]:
    """Return solver and settings that load code of their own."""
    return run.solver, run.settings.get("method")


def _begun(scenario: Scenario) -> Scenario:
    """Return the first fiftieth of a throw, or all of one that is as short as throws may be."""
    return replace(scenario, duration=max(MIN_VALUE, 0.02 * scenario.duration))


def _short(run: Run) -> Run:
    """Return the first fiftieth of a flight, which warms its solver up."""
    scenario = _begun(run.scenario)
    settings = {name: value for name, value in run.settings.items() if name not in ("times", "max_step")}
    short_settings: dict[str, Any] = {"steps": 16} if "steps" in settings else {"times": [scenario.duration]}
    return replace(run, scenario=scenario, settings=settings | short_settings)


def _timed_result(run: Run, times: FloatArray) -> RunResult:
    """Make a run three times at the most; one of 0.01 s, repeated or not, outlasts what disturbs it."""
    spent: list[float] = []
    while len(spent) < 3 and sum(spent) <= 0.01:
        began = time.process_time()
        result = make(run)
        spent.append(time.process_time() - began)
    thinned = None if result.trajectory is None else sampled(result.trajectory, times)
    return replace(result, trajectory=thinned, seconds=min(spent))


def sampled(trajectory: Trajectory, times: FloatArray) -> Trajectory:
    """Return the run at those of the times that it reached, without slices and impacts, with all it says of itself."""
    reached = times[times <= trajectory.t[-1] * (1 + SAME_TIME)]
    at = at_times(trajectory.t, reached)
    none = np.empty((0, trajectory.scenario.n_slices))
    return replace(
        trajectory,
        t=trajectory.t[at],
        theta=trajectory.theta[at],
        omega=trajectory.omega[at],
        r=none,
        v=none,
        r_cm=trajectory.r_cm[at],
        inertia=trajectory.inertia[at],
        impacts=None,
    )
