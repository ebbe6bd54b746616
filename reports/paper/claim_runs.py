"""The runs that the statements need beside those of the figures, and all of them as flights of one equation."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any, Final

from reports.paper.cases import Case, family
from reports.paper.claims_cost import MANY_STEPS, many_steps_key, same_steps_key
from reports.paper.claims_model import FINEST, MANY_SLICES, finest_key
from reports.paper.observe import Flights
from reports.paper.parameters import numbers, paper_steps, paper_throw
from reports.paper.runs import PUBLISHED, RTOL, SOLVERS, STEP_ANGLE, PaperRuns, PaperSize, scenario_of
from reports.pool import Progress, make_all
from reports.solvers import Made, Run
from slicemodel import Scenario, Trajectory

EVENT_DRIVEN: Final = SOLVERS[1:]

HALVED: Final = ("filling", "long", "drag", "spin", "angle", "aspect")
"""Families flown with half the slices too; in the others their number is the subject."""

SLICES: Final = ("slices", "slices at 5 /s")
"""Families in which the number of slices is the subject."""

WEIGHTLESS: Final = "eq8-weightless"
STEADY_FILLING: Final = 0.1
WEIGHTLESS_KEY: Final = f"filling {STEADY_FILLING:g}"
"""The bottle that does not slow down without weight, and the key of its flight."""

EXACT_STEP: Final = "exact-step"
"""The scheme that solves Eq. 8 as printed at the paper's number of time steps."""

ATOL: Final = 1e-10

HALF_WORDS: Final = ", half the slices"

Pair = tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClaimRuns:
    """Runs of the figures, those that only the statements need, and those with half the slices."""

    paper: PaperRuns
    further: Mapping[Pair, Made]
    halved: Mapping[Pair, Made]

    def flights(self, solver: str) -> Flights:
        """Return the flights of one equation, with those at half the slices where there are any."""
        usual = {**_of(solver, self.paper.made), **_of(solver, self.further)}
        halved = _of(solver, self.halved)
        coarse = _flights(solver, {**usual, **halved}) if halved else None
        return replace(_flights(solver, usual), halved=coarse)

    def trajectory(self, solver: str, key: str) -> Trajectory | None:
        """Return one trajectory, or None if it was not planned or failed."""
        made = self.further.get((solver, key)) or self.paper.made.get((solver, key))
        return None if made is None else made.trajectory


def _of(solver: str, made: Mapping[Pair, Made]) -> dict[str, Made]:
    return {key: outcome for (name, key), outcome in made.items() if name == solver}


def _flights(solver: str, made: Mapping[str, Made]) -> Flights:
    return Flights(
        solver=solver,
        runs={key: outcome.trajectory for key, outcome in made.items() if outcome.trajectory is not None},
        reasons={key: outcome.reason for key, outcome in made.items() if outcome.trajectory is None},
    )


def plan_further(size: PaperSize) -> dict[Pair, Run]:
    """Return the runs that no figure needs: finer in slices and in time, and without weight."""
    runs: dict[Pair, Run] = {}
    for name in SLICES:
        many = next(case for case in family(name) if case.value == MANY_SLICES)
        for solver in EVENT_DRIVEN:
            finest = finest_key(name.removeprefix("slices"))
            runs[solver, finest] = _run(solver, finest, many.scenario.with_slices(FINEST))
            if scenario_of(solver, many, size) is None:
                runs[solver, many.key] = _run(solver, many.key, many.scenario)
    for filling in numbers("figure-S1-filling"):
        throw, key, same = paper_throw(filling), many_steps_key(filling), same_steps_key(filling)
        runs[PUBLISHED, key] = _run(PUBLISHED, key, throw, steps=MANY_STEPS)
        runs["eq8", same] = _run(EXACT_STEP, same, _cut(throw, size), steps=paper_steps())
    light = paper_throw(STEADY_FILLING)
    runs[WEIGHTLESS, WEIGHTLESS_KEY] = _run(WEIGHTLESS, WEIGHTLESS_KEY, _cut(light, size))
    return runs


def _run(solver: str, key: str, scenario: Scenario, steps: int | None = None, words: str = "") -> Run:
    """Return one run: of a scheme with its steps, of an equation with the tolerances of the figures."""
    settings: dict[str, Any] = {"steps": steps, "store": "summary"}
    if steps is None:
        longest = min(STEP_ANGLE / abs(scenario.omega0), scenario.duration)
        settings = {"method": "DOP853", "rtol": RTOL, "atol": ATOL, "max_step": longest}
    return Run(f"claims, {solver}, {key}{words}", solver, scenario, settings)


def _cut(throw: Scenario, size: PaperSize) -> Scenario:
    return throw.with_slices(min(size.slices, throw.n_slices))


def plan_halved(size: PaperSize) -> dict[Pair, Run]:
    """Return the event-driven flights with half the slices of the figures'."""
    cases: dict[str, Case] = {case.key: case for name in HALVED for case in family(name)}
    runs: dict[Pair, Run] = {}
    for solver in EVENT_DRIVEN:
        for key, case in cases.items():
            usual = scenario_of(solver, case, size)
            if usual is not None and usual.n_slices > 1:
                half = usual.with_slices(usual.n_slices // 2)
                runs[solver, key] = _run(solver, key, half, words=HALF_WORDS)
    for filling in numbers("figure-S1-filling"):
        same, usual = same_steps_key(filling), _cut(paper_throw(filling), size)
        half = usual.with_slices(usual.n_slices // 2)
        runs["eq8", same] = _run(EXACT_STEP, same, half, steps=paper_steps(), words=HALF_WORDS)
    return runs


def gather_claims(pool: Executor, paper: PaperRuns, progress: Progress) -> ClaimRuns:
    """Make what the statements need beside the runs of the figures, at the size of those, in the same pool."""
    further, halved = plan_further(paper.size), plan_halved(paper.size)
    made = make_all(pool, [*halved.values(), *further.values()], progress)
    return ClaimRuns(
        paper=paper,
        further={pair: made[run.tag] for pair, run in further.items()},
        halved={pair: made[run.tag] for pair, run in halved.items()},
    )
