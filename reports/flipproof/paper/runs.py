"""The runs behind the paper's figures and statements, looked up by name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final, Literal

import numpy as np

from flipproof.frame.flights import Call, Flights
from flipproof.frame.solvers import Run, RunResult, make
from flipproof.paper import observe
from flipproof.paper.cases import ICE, Case, all_cases, family, numbers, paper_steps, paper_throw
from ode_reference.models import LADDER
from ode_reference.solver import WATERS
from slicemodel import Scenario, Trajectory

PUBLISHED: Final = "published-python"
SOLVERS: Final = (PUBLISHED, "eq8", "free-flight")

CONTESTANTS: Final = (*SOLVERS, *(model for model in LADDER if model not in SOLVERS), *WATERS)
"""What is held against the bottles really thrown: the published program and every registered model."""

BANDS: Final[Mapping[str, float]] = MappingProxyType({"eq8": 1e-7, "free-flight": 3e-3})
"""How far omega / omega_0 may move when the rest speed is cut tenfold, or the release changed in the eleventh digit, by
event-driven solver; with recoil the order of the impacts decides it."""

MANY_STEPS: Final = 10_000
MANY_SLICES: Final = 100.0

HALVED: Final = ("filling", "long", "drag", "spin", "angle", "aspect")
"""Families flown with half the slices too; in the others their number is the subject."""

DAMPINGS: Final = ("", " at 5 /s")
"""What the names of families end in: at the drag of the caption of Fig. 5, and at the damping of all later figures."""

WEIGHTLESS: Final = "eq8-weightless"
STEADY_FILLING: Final = 0.1
WEIGHTLESS_KEY: Final = f"filling {STEADY_FILLING:g}"
"""The bottle that does not slow down without weight, and the key of its flight."""

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
    """Every planned run of the paper's figures and statements by its name."""

    results: Mapping[Name, RunResult]

    @classmethod
    def of(cls, answers: Flights, calls: Iterable[Call], planned: Iterable[Planned] = ()) -> PaperRuns:
        """Return what became of ``group_calls`` and of runs that are not grouped."""
        results = {plan.name: answers[plan.run] for plan in planned if not plan.grouped}
        results |= {name: result for call in calls for name, result in answers.answer(call).items()}
        return cls(results=results)

    def flights(self, solver: str) -> observe.CaseFlights:
        """Return the flights of one equation, with those at half the slices and half the steps where there are any."""

        def of(wanted: Half) -> dict[str, RunResult]:
            return {key: result for (by, key, half), result in self.results.items() if by == solver and half == wanted}

        usual = of("")
        halved, half_steps = (
            observe.CaseFlights(solver=solver, results=usual | half_results) if (half_results := of(half)) else None
            for half in HALVES
        )
        return observe.CaseFlights(solver=solver, results=usual, halved=halved, half_steps=half_steps)

    def trajectory(self, solver: str, key: str) -> Trajectory | None:
        """Return the trajectory of a case, or None if it was not planned or failed."""
        result = self.results.get((solver, key, ""))
        return None if result is None else result.trajectory

    def members(self, solver: str, name: str) -> list[tuple[Case, Trajectory]]:
        """Return the cases of a family that this solver has flown, with their trajectories."""
        flown = ((case, self.trajectory(solver, case.key)) for case in family(name))
        return [(case, run) for case, run in flown if run is not None]

    def failures(self) -> list[str]:
        """Return solver, case and reason of every run that gave no trajectory."""
        return [
            f"{solver}, {key}: {result.reason}"
            for (solver, key, _), result in self.results.items()
            if result.trajectory is None
        ]


def flies(solver: str, case: Case) -> bool:
    """Return whether a solver flies a case: where it chooses its steps, one throw shows what fewer output times do."""
    return solver == PUBLISHED or case.slices_vary or case.steps >= paper_steps() or case.scenario == paper_throw()


def plan_figures(keys: Iterable[str] | None = None) -> list[Planned]:
    """Return every run that the figures need; of the cases with these keys only, if any are given."""
    cases = all_cases()
    wanted = cases if keys is None else {key: case for key, case in cases.items() if key in set(keys)}
    return [
        Planned(
            (solver, key, ""),
            Run(solver, case.scenario, _settings(solver, case), label=f"paper, {solver}, {key}"),
            thin=case.thin if solver == PUBLISHED else 1,
            whole=case.whole,
        )
        for solver in reversed(SOLVERS)
        for key, case in wanted.items()
        if flies(solver, case)
    ]


def _settings(solver: str, case: Case) -> dict[str, Any]:
    if solver == PUBLISHED:
        return {"steps": case.steps, "store": "full" if case.whole else "summary"}
    points = 1 + (case.steps - 1) // case.thin
    return {} if points == paper_steps() else {"times": np.linspace(0.0, case.scenario.duration, points)}


def group_calls(planned: Iterable[Planned], words: str) -> list[Call]:
    """Return the calls that make the runs that are grouped, of each group a worker one at a time."""
    grouped = [plan for plan in planned if plan.grouped]
    # All at once would take a worker gigabytes.
    groups = (grouped[k : k + 12] for k in range(0, len(grouped), 12))
    return [Call(make_group, (group,), f"{words}, {group[-1].name[1]}") for group in groups]


def make_group(group: Iterable[Planned]) -> dict[Name, RunResult]:
    """Make runs one after the other and keep of each what is looked at."""
    return {plan.name: _kept(make(plan.run), plan) for plan in group}


def _kept(result: RunResult, planned: Planned) -> RunResult:
    """Return a run with what is kept of it: slices at every time are nearly all of its memory."""
    run = result.trajectory
    if run is None:
        return result
    if planned.thin > 1:
        names = ("t", "theta", "omega", "r", "v", "r_cm", "inertia")
        run = replace(run, **{name: getattr(run, name)[:: planned.thin].copy() for name in names})
    # No figure and no statement looks at velocities of slices.
    none = np.empty((0, run.scenario.n_slices))
    return replace(result, trajectory=replace(run, v=none, r=run.r if planned.whole else none))


# ---------------------------------------------------------------------- what statements need beside the figures


MANY_STEPS_KEY: Final = "filling {:g}, P " + str(MANY_STEPS)
"""Key of the published program's flight with ``MANY_STEPS`` steps, at a filling."""

SAME_STEPS_KEY: Final = "filling {:g}, exact-step"
"""Key of the flight by the exact step of Eq. 8 with as many steps as the paper makes, at a filling."""


def plan_claims() -> list[Planned]:
    """Return the runs of all statements: those that are not grouped, and those of the published program."""
    published = (plan for half in HALVES for plan in plan_published(half))
    return [*plan_halved(), *plan_further(), *plan_contest(), *published]


def _planned(solver: str, key: str, scenario: Scenario, half: Half = "", *, by: str = "", **settings: Any) -> Planned:
    """Return the run of an equation, made by the scheme ``by`` if there is one."""
    label = f"claims, {by or solver}, {key}" + (f", half the {half}" if half else "")
    return Planned((solver, key, half), Run(by or solver, scenario, settings, label), grouped=False)


def _halved(scenario: Scenario) -> Scenario:
    return scenario.with_slices(max(1, scenario.n_slices // 2))


def _same_steps(filling: float, half: Half = "") -> Planned:
    """Return the run of the scheme that solves Eq. 8 as printed at the paper's number of time steps."""
    throw = _halved(paper_throw(filling)) if half else paper_throw(filling)
    key = SAME_STEPS_KEY.format(filling)
    return _planned("eq8", key, throw, half, by="exact-step", steps=paper_steps(), store="summary")


def plan_further() -> Iterator[Planned]:
    """Yield the runs that no figure needs: finer in time, and without weight."""
    for filling in numbers("figure-S1-filling"):
        key = MANY_STEPS_KEY.format(filling)
        yield _planned(PUBLISHED, key, paper_throw(filling), steps=MANY_STEPS, store="summary")
        yield _same_steps(filling)
    yield _planned(WEIGHTLESS, WEIGHTLESS_KEY, paper_throw(STEADY_FILLING))


def plan_contest() -> Iterator[Planned]:
    """Yield the flights of all other contestants, at which no statement but those about the experiment looks."""
    cases = {case.key: case.scenario for case in family("filling")} | {ICE: all_cases()[ICE].scenario}
    for solver in CONTESTANTS[len(SOLVERS) :]:
        for key, scenario in cases.items():
            halves: tuple[Half, ...] = (
                ("",) if solver in WATERS or scenario.n_slices == 1 or key == ICE else ("", "slices")
            )
            for half in halves:
                planned = _planned(solver, key, _halved(scenario) if half else scenario, half)
                yield replace(planned, whole=False, grouped=True)


def plan_halved() -> Iterator[Planned]:
    """Yield the event-driven flights with half the slices of the figures'."""
    cases = {case.key: case for name in HALVED for case in family(name)}
    for solver in SOLVERS[1:]:
        for key, case in cases.items():
            if flies(solver, case) and case.scenario.n_slices > 1:
                yield _planned(solver, key, _halved(case.scenario), "slices")
    for filling in numbers("figure-S1-filling"):
        yield _same_steps(filling, "slices")


def plan_published(half: Half) -> Iterator[Planned]:
    """Yield the published program's flights with half its "slices" or "steps".

    Places of slices are stored only where a statement reads them.
    """
    rebounds, slices = ([f"{name}{damping}" for damping in DAMPINGS] for name in ("beta", "slices"))
    whole = {case.key for name in ("long", "drag", *rebounds) for case in family(name)}
    families = HALVED if half == "slices" else (*HALVED, *rebounds, *slices)
    for key, case in {case.key: case for name in families for case in family(name)}.items():
        scenario, steps, thin = _halved(case.scenario), case.steps, case.thin
        if half == "steps":
            # As many points are kept as there are, up to the rounding that keeps the last one.
            scenario, steps, thin = case.scenario, 1 + (case.steps - 1) // 2, 1
        store = "full" if key in whole else "summary"
        planned = _planned(PUBLISHED, key, scenario, half, steps=steps, store=store)
        yield replace(planned, thin=thin, grouped=True)
