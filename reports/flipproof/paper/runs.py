"""The runs behind the paper's figures and statements: planned without repeats, made in a pool, looked up by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final, Literal

import numpy as np

from flipproof.frame.flights import Call, Flights
from flipproof.frame.solvers import Made, Run, make
from flipproof.paper import observe
from flipproof.paper.cases import Case, all_cases, family
from flipproof.paper.costs import Cost, measure_event_driven, measure_published
from flipproof.paper.parameters import paper_steps, paper_throw
from slicemodel import Scenario, Trajectory

PUBLISHED: Final = "published-python"
SOLVERS: Final = (PUBLISHED, "eq8", "free-flight")

BANDS: Final[Mapping[str, float]] = MappingProxyType({"eq8": 1e-7, "free-flight": 3e-3})
"""How far omega / omega_0 may move when the rest speed is cut tenfold, or the release changed in the eleventh digit, by
event-driven solver; with recoil the order of the impacts decides it."""

Half = Literal["", "slices", "steps"]
HALVES: Final[tuple[Half, ...]] = ("slices", "steps")
"""What a run has half as many of as that of the figures: "" for nothing."""

Name = tuple[str, str, Half]
"""A solver, the key of a case, and what is halved."""


@dataclass(frozen=True, slots=True)
class Planned:
    """A run, the name by which it is looked up, and what is kept of it: every how many points, and slices if whole.

    One that is not ``grouped`` is made by itself and kept as it is.
    """

    name: Name
    run: Run
    thin: int = 1
    whole: bool = True
    grouped: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperRuns:
    """Every run of the paper's figures, and those that statements need beside them.

    Parameters
    ----------
    made : mapping name -> Made
        Without the runs that are not planned.
    costs : tuple of Cost
        Of every solver over numbers of slices and steps; empty if they were not asked for.
    """

    made: Mapping[Name, Made]
    costs: tuple[Cost, ...] = ()

    @classmethod
    def of(
        cls, answers: Flights, calls: Iterable[Call], planned: Iterable[Planned] = (), costs: Iterable[Call] = ()
    ) -> PaperRuns:
        """Return what became of ``group_calls``, of runs that are not grouped, and of ``cost_calls``."""
        made = {each.name: answers[each.run] for each in planned if not each.grouped}
        made |= {name: made for call in calls for name, made in answers.answer(call).items()}
        return cls(made=made, costs=tuple(cost for call in costs for cost in answers.answer(call)))

    def flights(self, solver: str) -> observe.Flights:
        """Return the flights of one equation, with those at half the slices and half the steps where there are any."""

        def of(wanted: Half) -> dict[str, Made]:
            return {key: each for (by, key, half), each in self.made.items() if by == solver and half == wanted}

        def flights(made: Mapping[str, Made]) -> observe.Flights:
            runs = {key: each.trajectory for key, each in made.items() if each.trajectory is not None}
            reasons = {key: each.reason for key, each in made.items() if each.trajectory is None}
            return observe.Flights(solver=solver, runs=runs, reasons=reasons)

        usual = of("")
        halved, half_steps = (flights(usual | own) if (own := of(half)) else None for half in HALVES)
        return replace(flights(usual), halved=halved, half_steps=half_steps)

    def trajectory(self, solver: str, key: str) -> Trajectory | None:
        """Return the trajectory of a case, or None if it was not planned or failed."""
        made = self.made.get((solver, key, ""))
        return None if made is None else made.trajectory

    def members(self, solver: str, name: str) -> list[tuple[Case, Trajectory]]:
        """Return the cases of a family that this solver has flown, with their trajectories."""
        found = ((case, self.trajectory(solver, case.key)) for case in family(name))
        return [(case, run) for case, run in found if run is not None]

    def failures(self) -> list[str]:
        """Return solver, case and reason of every run that gave no trajectory."""
        return [
            f"{solver}, {key}: {made.reason}" for (solver, key, _), made in self.made.items() if made.trajectory is None
        ]


def scenario_of(solver: str, case: Case) -> Scenario | None:
    """Return the throw of a case as this solver flies it; None if it is not flown."""
    if solver != PUBLISHED and not case.slices_vary and case.steps < paper_steps() and case.scenario != paper_throw():
        return None  # output times do not change these solvers: one throw shows that
    return case.scenario


def plan_figures(keys: Iterable[str] | None = None) -> list[Planned]:
    """Return every run that the figures need; of the cases with these keys only, if any are given."""
    cases = all_cases()
    wanted = set(cases if keys is None else keys)
    planned = []
    for solver in reversed(SOLVERS):
        for key, case in cases.items():
            scenario = scenario_of(solver, case) if key in wanted else None
            if scenario is not None:
                run = Run(solver, scenario, _settings(solver, case), label=f"paper, {solver}, {key}")
                thin = case.thin if solver == PUBLISHED else 1
                planned.append(Planned((solver, key, ""), run, thin, case.whole))
    return planned


def _settings(solver: str, case: Case) -> dict[str, Any]:
    if solver == PUBLISHED:
        return {"steps": case.steps, "store": "full" if case.whole else "summary"}
    points = 1 + (case.steps - 1) // case.thin
    return {} if points == paper_steps() else {"times": np.linspace(0.0, case.scenario.duration, points)}


def group_calls(planned: Iterable[Planned], words: str) -> list[Call]:
    """Return the calls that make the runs that are grouped, of each group a worker one at a time."""
    grouped = [each for each in planned if each.grouped]
    # All at once would take a worker gigabytes.
    groups = (grouped[k : k + 12] for k in range(0, len(grouped), 12))
    return [Call(make_group, (group,), f"{words}, {group[-1].name[1]}") for group in groups]


def cost_calls() -> list[Call]:
    """Return the calls that measure what runs cost."""
    published = Call(measure_published, (PUBLISHED,), "the cost of the published program", timed=True)
    others = (solver for solver in SOLVERS if solver != PUBLISHED)
    return [published, *(Call(measure_event_driven, (name,), f"the cost of {name}", timed=True) for name in others)]


def make_group(group: Iterable[Planned]) -> dict[Name, Made]:
    """Make runs one after the other and keep of each what is looked at."""
    return {each.name: _kept(make(each.run), each) for each in group}


def _kept(made: Made, planned: Planned) -> Made:
    """Return a run with what is kept of it: slices at every time are nearly all of its memory."""
    run = made.trajectory
    if run is None:
        return made
    if planned.thin > 1:
        names = ("t", "theta", "omega", "r", "v", "r_cm", "inertia")
        run = replace(run, **{name: getattr(run, name)[:: planned.thin].copy() for name in names})
    if not planned.whole:
        none = np.empty((0, run.scenario.n_slices))
        run = replace(run, r=none, v=none)
    return replace(made, trajectory=run)
