"""The runs behind the paper's figures and claims: planned without repeats, made in a pool, looked up by case."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from flipproof.frame.flights import Call, Flights
from flipproof.frame.solvers import Made, Run, make
from flipproof.paper.cases import Case, all_cases, family
from flipproof.paper.costs import Cost, measure_event_driven, measure_published
from flipproof.paper.parameters import paper_steps, paper_throw
from slicemodel import Scenario, Trajectory

PUBLISHED: Final = "published-python"
SOLVERS: Final = (PUBLISHED, "eq8", "free-flight")

BANDS: Final[Mapping[str, float]] = MappingProxyType({"eq8": 1e-7, "free-flight": 3e-3})
"""How far omega / omega_0 may move when the rest speed is cut tenfold, or the release changed in the eleventh digit, by
event-driven solver; with recoil the order of the impacts decides it."""

GROUP: Final = 12
"""Runs that a worker holds at a time: all of them would take it gigabytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperRuns:
    """Every run of the paper's figures.

    Parameters
    ----------
    made : mapping (solver, key of a case) -> Made
        Without the pairs that are not planned.
    costs : tuple of Cost
        Of every solver over numbers of slices and steps; empty if they were not asked for.
    """

    made: Mapping[tuple[str, str], Made]
    costs: tuple[Cost, ...]

    @classmethod
    def of(cls, flights: Flights, figures: Iterable[Call], costs: Iterable[Call] = ()) -> PaperRuns:
        """Return what became of ``figure_calls`` and ``cost_calls``."""
        made = {pair: made for call in figures for pair, made in flights.answer(call).items()}
        return cls(made=made, costs=tuple(cost for call in costs for cost in flights.answer(call)))

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


def scenario_of(solver: str, case: Case) -> Scenario | None:
    """Return the throw of a case as this solver flies it; None if it is not flown."""
    if solver != PUBLISHED and not case.slices_vary and case.steps < paper_steps() and case.scenario != paper_throw():
        return None  # output times do not change these solvers: one throw shows that
    return case.scenario


def plan_groups(keys: Iterable[str] | None = None) -> list[list[Planned]]:
    """Return every run that the figures need, in groups of which a worker makes one at a time."""
    planned = list(_planned(keys))
    return [planned[k : k + GROUP] for k in range(0, len(planned), GROUP)]


@dataclass(frozen=True, slots=True)
class Planned:
    """A run of the figures, with the case that it is of."""

    solver: str
    case: Case
    run: Run

    @property
    def pair(self) -> tuple[str, str]:
        """The solver and the key of its case."""
        return self.solver, self.case.key


def _planned(keys: Iterable[str] | None) -> Iterator[Planned]:
    cases = all_cases()
    wanted = set(cases if keys is None else keys)
    for solver in reversed(SOLVERS):
        for key, case in cases.items():
            scenario = scenario_of(solver, case) if key in wanted else None
            if scenario is not None:
                run = Run(solver, scenario, _settings(solver, case), label=f"paper, {solver}, {key}")
                yield Planned(solver, case, run)


def _settings(solver: str, case: Case) -> dict[str, Any]:
    if solver == PUBLISHED:
        return {"steps": case.steps, "store": "full" if case.whole else "summary"}
    points = 1 + (case.steps - 1) // case.thin
    return {} if points == paper_steps() else {"times": np.linspace(0.0, case.scenario.duration, points)}


def figure_calls(keys: Iterable[str] | None = None) -> list[Call]:
    """Return the calls that make the runs of the figures; of the cases with these keys only, if any are given."""
    return [Call(make_group, (group,), f"the paper's figures, {group[-1].case.key}") for group in plan_groups(keys)]


def cost_calls() -> list[Call]:
    """Return the calls that measure what runs cost."""
    published = Call(measure_published, (PUBLISHED,), "the cost of the published program", timed=True)
    others = (solver for solver in SOLVERS if solver != PUBLISHED)
    return [published, *(Call(measure_event_driven, (name,), f"the cost of {name}", timed=True) for name in others)]


def make_group(group: Iterable[Planned]) -> dict[tuple[str, str], Made]:
    """Make runs one after the other and keep of each what is looked at."""
    found = {}
    for each in group:
        made = _thinned(make(each.run), each.case.thin if each.solver == PUBLISHED else 1)
        found[each.pair] = made if each.case.whole else _without_slices(made)
    return found


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
