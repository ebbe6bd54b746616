"""The runs behind the paper's figures and claims: planned without repeats, made in a pool, looked up by case."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from flipproof.frame.pool import Progress, make_all
from flipproof.frame.solvers import Made, Run, make
from flipproof.paper.cases import Case, all_cases, family
from flipproof.paper.costs import Cost, measure_event_driven, measure_published
from flipproof.paper.parameters import paper_steps, paper_throw
from slicemodel import Scenario, Trajectory

PUBLISHED: Final = "published-python"
SOLVERS: Final = (PUBLISHED, "eq8", "free-flight")

RTOL: Final = 1e-7
"""Relative tolerance of the event-driven runs; nowhere near the longest step, which is what limits them."""

STEP_ANGLE: Final = 0.04
"""Longest step times omega_0 [rad]: twice the reference's own, at a fifth less cost."""

BANDS: Final[Mapping[str, float]] = MappingProxyType({"eq8": 1e-7, "free-flight": 3e-3})
"""How far omega / omega_0 may move when tolerance, longest step or rest speed are cut, by event-driven solver; with
recoil the order of the impacts decides it. What more slices would change comes on top (``PaperSize.slices``)."""


GROUP: Final = 12
"""Runs of the published program that a worker holds at a time: all of them would take it 800 MB."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperSize:
    """How finely the event-driven solvers cut the water; the published program always has the paper's own slices.

    Parameters
    ----------
    name : str
    slices : int
        Slices of an event-driven run at the most, where their number is not the subject.
    most_slices : int
        The same where it is; throws with more are flown by the published program only.
    slice_error : mapping solver -> float
        Largest distance of omega / omega_0 from that of 200 slices, measured on ten of the throws.
    """

    name: str
    slices: int
    most_slices: int
    slice_error: Mapping[str, float]


FULL: Final = PaperSize(name="full", slices=100, most_slices=100, slice_error={"eq8": 0.02, "free-flight": 0.01})
REPORT: Final = PaperSize(name="report", slices=30, most_slices=100, slice_error={"eq8": 0.07, "free-flight": 0.02})


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperRuns:
    """Every run of the paper's figures.

    Parameters
    ----------
    size : PaperSize
    made : mapping (solver, key of a case) -> Made
        Without the pairs that are not planned at this size.
    costs : tuple of Cost
        Of every solver over numbers of slices and steps; empty if they were not asked for.
    """

    size: PaperSize
    made: Mapping[tuple[str, str], Made]
    costs: tuple[Cost, ...]

    def trajectory(self, solver: str, key: str) -> Trajectory | None:
        """Return the trajectory of a case, or None if it was not planned or failed."""
        made = self.made.get((solver, key))
        return None if made is None else made.trajectory

    def members(self, solver: str, name: str) -> list[tuple[Case, Trajectory]]:
        """Return the cases of a family that this solver has flown, with their trajectories."""
        found = ((case, self.trajectory(solver, case.key)) for case in family(name))
        return [(case, run) for case, run in found if run is not None]

    def failures(self) -> list[str]:
        """Return solver, case and reason of every run that gave no trajectory."""
        return [
            f"{solver}, {key}: {made.reason}" for (solver, key), made in self.made.items() if made.trajectory is None
        ]


def scenario_of(solver: str, case: Case, size: PaperSize) -> Scenario | None:
    """Return the throw of a case as this solver flies it, the damping rate unchanged; None if it is not flown."""
    own = case.scenario
    if solver == PUBLISHED:
        return own
    if case.slices_vary:
        return own if own.n_slices <= size.most_slices else None
    if case.steps < paper_steps() and own != paper_throw():
        return None  # output times do not change the steps of these solvers: one throw shows that
    return own.with_slices(min(size.slices, own.n_slices))


def plan_paper(size: PaperSize, keys: Iterable[str] | None = None) -> list[Run]:
    """Return every run that the figures need, one for each case and solver, the slowest solver first.

    Parameters
    ----------
    size : PaperSize
    keys : keys of cases, optional
        Only these.
    """
    return [planned.run for planned in _planned(size, keys)]


@dataclass(frozen=True, slots=True)
class _Planned:
    solver: str
    case: Case
    run: Run

    @property
    def pair(self) -> tuple[str, str]:
        return self.solver, self.case.key


def _planned(size: PaperSize, keys: Iterable[str] | None) -> Iterator[_Planned]:
    cases = all_cases()
    wanted = set(cases if keys is None else keys)
    for solver in reversed(SOLVERS):
        for key, case in cases.items():
            scenario = scenario_of(solver, case, size) if key in wanted else None
            if scenario is not None:
                run = Run(f"paper, {solver}, {key}", solver, scenario, _settings(solver, case))
                yield _Planned(solver, case, run)


def _settings(solver: str, case: Case) -> dict[str, Any]:
    if solver == PUBLISHED:
        return {"steps": case.steps, "store": "full" if case.whole else "summary"}
    points = 1 + (case.steps - 1) // case.thin
    times = {} if points == paper_steps() else {"times": np.linspace(0.0, case.scenario.duration, points)}
    step = min(STEP_ANGLE / abs(case.scenario.omega0), case.scenario.duration)
    return {"method": "DOP853", "rtol": RTOL, "atol": 1e-10, "max_step": step, **times}


def gather_paper(
    pool: Executor, size: PaperSize, progress: Progress, keys: Iterable[str] | None = None, *, costs: bool = True
) -> PaperRuns:
    """Make the runs in a pool.

    Parameters
    ----------
    pool : executor of worker processes
    size : PaperSize
    progress : callable (made, planned, tag)
    keys : keys of cases, optional
        Only these.
    costs : bool
        Whether to measure what runs cost too, after everything else.
    """
    planned = list(_planned(size, keys))
    published = [each for each in planned if each.solver == PUBLISHED]
    others = [each.run for each in planned if each.solver != PUBLISHED]
    jobs = [(each.run, each.case.thin) for each in published]
    thinned = [pool.submit(make_thinned, jobs[k : k + GROUP]) for k in range(0, len(jobs), GROUP)]
    made = make_all(pool, others, lambda done, _, tag: progress(done, len(planned), tag))
    made |= {each.run.tag: each for group in thinned for each in group.result()}
    progress(len(planned), len(planned), PUBLISHED)
    return PaperRuns(
        size=size,
        made={
            each.pair: made[each.run.tag] if each.case.whole else _without_slices(made[each.run.tag])
            for each in planned
        },
        costs=_measure_costs(pool) if costs else (),
    )


def _measure_costs(pool: Executor) -> tuple[Cost, ...]:
    settings = _settings(SOLVERS[-1], family("filling")[0])
    pending = [pool.submit(measure_event_driven, solver, settings) for solver in SOLVERS if solver != PUBLISHED]
    pending.insert(0, pool.submit(measure_published, PUBLISHED))
    return tuple(cost for future in pending for cost in future.result())


def make_thinned(runs: Iterable[tuple[Run, int]]) -> list[Made]:
    """Make runs one after the other and keep every so many of their points."""
    return [_thinned(make(run), every) for run, every in runs]


def _thinned(made: Made, every: int) -> Made:
    run = made.trajectory
    if run is None or every == 1:
        return made
    kept = {name: getattr(run, name)[::every].copy() for name in ("t", "theta", "omega", "r", "v", "r_cm", "inertia")}
    return replace(made, trajectory=replace(run, **kept))


def _without_slices(made: Made) -> Made:
    """Drop what nobody looks at: slices at every time are nearly all of a run's memory."""
    run = made.trajectory
    if run is None:
        return made
    none = np.empty((0, run.scenario.n_slices))
    return replace(made, trajectory=replace(run, r=none, v=none))
