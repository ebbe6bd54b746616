"""The runs that the statements need beside those of the figures, and all of them as flights of one equation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from flipproof.frame.flights import Call
from flipproof.frame.flights import Flights as Answers
from flipproof.frame.solvers import Made, Run
from flipproof.paper.cases import family
from flipproof.paper.claims_cost import MANY_STEPS, many_steps_key, same_steps_key
from flipproof.paper.claims_slices import FINEST, MANY_SLICES, finest_key
from flipproof.paper.observe import Flights
from flipproof.paper.parameters import numbers, paper_steps, paper_throw
from flipproof.paper.runs import PUBLISHED, SOLVERS, Pair, Planned, group_calls, scenario_of
from slicemodel import Scenario, Trajectory

HALVED: Final = ("filling", "long", "drag", "spin", "angle", "aspect")
"""Families flown with half the slices too; in the others their number is the subject."""

SLICES: Final = {"slices": "", "slices at 5 /s": " at 5 /s"}
"""Families in which the number of slices is the subject, and the words for their damping."""

REBOUNDS: Final = ("beta", "beta at 5 /s")

WEIGHTLESS: Final = "eq8-weightless"
STEADY_FILLING: Final = 0.1
WEIGHTLESS_KEY: Final = f"filling {STEADY_FILLING:g}"
"""The bottle that does not slow down without weight, and the key of its flight."""

Half = Literal["", "slices", "steps"]
HALVES: Final[tuple[Half, ...]] = ("slices", "steps")
"""What a run has half as many of as those of the figures: "" for nothing."""


@dataclass(frozen=True, slots=True)
class ClaimRuns:
    """All runs that statements read, those of the figures among them, by what is halved, solver and key."""

    made: Mapping[Half, Mapping[Pair, Made]]

    def flights(self, solver: str) -> Flights:
        """Return the flights of one equation, with those at half the slices and half the steps where there are any."""

        def of(half: Half) -> dict[str, Made]:
            return {key: each for (name, key), each in self.made.get(half, {}).items() if name == solver}

        def flights(made: Mapping[str, Made]) -> Flights:
            runs = {key: each.trajectory for key, each in made.items() if each.trajectory is not None}
            reasons = {key: each.reason for key, each in made.items() if each.trajectory is None}
            return Flights(solver=solver, runs=runs, reasons=reasons)

        usual = of("")
        halved, half_steps = (flights(usual | own) if (own := of(half)) else None for half in HALVES)
        return replace(flights(usual), halved=halved, half_steps=half_steps)

    def trajectory(self, solver: str, key: str) -> Trajectory | None:
        """Return one trajectory, or None if it was not planned or failed."""
        made = self.made[""].get((solver, key))
        return None if made is None else made.trajectory


@dataclass(frozen=True, slots=True)
class ClaimPlan:
    """What the statements need beside the runs of the figures: runs that are kept whole, and calls that thin theirs."""

    runs: Mapping[Half, Mapping[Pair, Run]]
    calls: Mapping[Half, list[Call]]

    @property
    def requests(self) -> list[Run | Call]:
        """What is to be made."""
        return [
            *(call for calls in self.calls.values() for call in calls),
            *(run for runs in self.runs.values() for run in runs.values()),
        ]

    def made(self, answers: Answers, figures: Mapping[Pair, Made]) -> ClaimRuns:
        """Return what became of it, with the runs of the figures."""
        made: dict[Half, dict[Pair, Made]] = {"": dict(figures), "slices": {}, "steps": {}}
        for half, runs in self.runs.items():
            made[half] |= {pair: answers[run] for pair, run in runs.items()}
        for half, calls in self.calls.items():
            for call in calls:
                made[half] |= answers.answer(call)
        return ClaimRuns(made)


def plan_claims() -> ClaimPlan:
    """Return what the statements need beside the runs of the figures."""
    return ClaimPlan(
        runs={"slices": plan_halved(), "": plan_further()},
        calls={half: group_calls(plan_published(half), "the paper's statements") for half in HALVES},
    )


def _run(solver: str, key: str, scenario: Scenario, steps: int | None = None, half: Half = "") -> Run:
    """Return one run: of a scheme with its steps, or of an equation."""
    settings: dict[str, Any] = {} if steps is None else {"steps": steps, "store": "summary"}
    return Run(solver, scenario, settings, f"claims, {solver}, {key}{f', half the {half}' if half else ''}")


def _halved(scenario: Scenario) -> Scenario:
    return scenario.with_slices(max(1, scenario.n_slices // 2))


def plan_further() -> dict[Pair, Run]:
    """Return the runs that no figure needs: finer in slices and in time, and without weight."""
    runs: dict[Pair, Run] = {}
    for name, damping in SLICES.items():
        many = next(case for case in family(name) if case.value == MANY_SLICES)
        for solver in SOLVERS[1:]:
            finest = finest_key(damping)
            runs[solver, finest] = _run(solver, finest, many.scenario.with_slices(FINEST))
    for filling in numbers("figure-S1-filling"):
        key = many_steps_key(filling)
        runs[PUBLISHED, key] = _run(PUBLISHED, key, paper_throw(filling), steps=MANY_STEPS)
        runs |= _same_steps(filling)
    runs[WEIGHTLESS, WEIGHTLESS_KEY] = _run(WEIGHTLESS, WEIGHTLESS_KEY, paper_throw(STEADY_FILLING))
    return runs


def _same_steps(filling: float, half: Half = "") -> dict[Pair, Run]:
    """Return the run of the scheme that solves Eq. 8 as printed at the paper's number of time steps."""
    key, throw = same_steps_key(filling), paper_throw(filling)
    scenario = _halved(throw) if half else throw
    return {("eq8", key): _run("exact-step", key, scenario, steps=paper_steps(), half=half)}


def plan_halved() -> dict[Pair, Run]:
    """Return the event-driven flights with half the slices of the figures'."""
    cases = {case.key: case for name in HALVED for case in family(name)}
    runs: dict[Pair, Run] = {}
    for solver in SOLVERS[1:]:
        for key, case in cases.items():
            usual = scenario_of(solver, case)
            if usual is not None and usual.n_slices > 1:
                runs[solver, key] = _run(solver, key, _halved(usual), half="slices")
    for filling in numbers("figure-S1-filling"):
        runs |= _same_steps(filling, half="slices")
    return runs


def plan_published(half: Half) -> list[Planned]:
    """Return the flights of the published program with half its "slices" or "steps".

    Slices are kept where statements read more than omega and theta.
    """
    kept = {case.key for name in ("long", "drag", *REBOUNDS) for case in family(name)}
    planned = {}
    for name in HALVED if half == "slices" else (*HALVED, *REBOUNDS, *SLICES):
        for case in family(name):
            scenario, steps, thin = _halved(case.scenario), case.steps, case.thin
            if half == "steps":
                # As many points are kept as there are, up to the rounding that keeps the last one.
                scenario, steps, thin = case.scenario, 1 + (case.steps - 1) // 2, 1
            run = _run(PUBLISHED, case.key, scenario, steps, half)
            run = replace(run, settings={**run.settings, "store": "full" if case.key in kept else "summary"})
            planned[case.key] = Planned((PUBLISHED, case.key), run, thin)
    return list(planned.values())
