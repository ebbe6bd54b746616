"""The runs that the statements need beside those of the figures, and all of them as flights of one equation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from flipproof.frame.solvers import Made, Run
from flipproof.paper.cases import Case, family
from flipproof.paper.claims_cost import MANY_STEPS, many_steps_key, same_steps_key
from flipproof.paper.claims_slices import FINEST, MANY_SLICES, finest_key
from flipproof.paper.observe import Flights
from flipproof.paper.parameters import numbers, paper_steps, paper_throw
from flipproof.paper.runs import GROUP, PUBLISHED, SOLVERS, PaperRuns, scenario_of
from slicemodel import Scenario, Trajectory

EVENT_DRIVEN: Final = SOLVERS[1:]

HALVED: Final = ("filling", "long", "drag", "spin", "angle", "aspect")
"""Families flown with half the slices too; in the others their number is the subject."""

SLICES: Final = {"slices": "", "slices at 5 /s": " at 5 /s"}
"""Families in which the number of slices is the subject, and the words for their damping."""

REBOUNDS: Final = ("beta", "beta at 5 /s")

HALF_STEPS: Final = (*HALVED, *REBOUNDS, *SLICES)
"""Families that the published program flies with half its time steps too."""

LOOKED_INTO: Final = ("long", "drag", *REBOUNDS)
"""Families of which statements read more than omega and theta, so that slices are kept."""

WEIGHTLESS: Final = "eq8-weightless"
STEADY_FILLING: Final = 0.1
WEIGHTLESS_KEY: Final = f"filling {STEADY_FILLING:g}"
"""The bottle that does not slow down without weight, and the key of its flight."""

EXACT_STEP: Final = "exact-step"
"""The scheme that solves Eq. 8 as printed at the paper's number of time steps."""

HALF_WORDS: Final = ", half the slices"
HALF_STEPS_WORDS: Final = ", half the steps"

Pair = tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClaimRuns:
    """Runs of the figures, those that only the statements need, and those with half the slices or half the steps."""

    paper: PaperRuns
    further: Mapping[Pair, Made]
    halved: Mapping[Pair, Made]
    half_steps: Mapping[Pair, Made] = field(default_factory=dict)

    @classmethod
    def of(cls, paper: PaperRuns, plan: ClaimPlan, made: Mapping[Run, Made]) -> ClaimRuns:
        """Return the runs of the figures and those of the plan."""
        return cls(
            paper=paper,
            further={pair: made[run] for pair, run in plan.further.items()},
            halved={pair: made[run] for pair, run in plan.halved.items()}
            | {pair: made[run] for pair, (run, _) in plan.half_slices.items()},
            half_steps={pair: made[run] for pair, (run, _) in plan.half_steps.items()},
        )

    def flights(self, solver: str) -> Flights:
        """Return the flights of one equation, with those at half the slices and half the steps where there are any."""
        usual = {**_of(solver, self.paper.made), **_of(solver, self.further)}

        def coarse(made: Mapping[Pair, Made]) -> Flights | None:
            own = _of(solver, made)
            return _flights(solver, {**usual, **own}) if own else None

        return replace(_flights(solver, usual), halved=coarse(self.halved), half_steps=coarse(self.half_steps))

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


def plan_further() -> dict[Pair, Run]:
    """Return the runs that no figure needs: finer in slices and in time, and without weight."""
    runs: dict[Pair, Run] = {}
    for name, damping in SLICES.items():
        many = next(case for case in family(name) if case.value == MANY_SLICES)
        for solver in EVENT_DRIVEN:
            finest = finest_key(damping)
            runs[solver, finest] = _run(solver, finest, many.scenario.with_slices(FINEST))
    for filling in numbers("figure-S1-filling"):
        throw, key, same = paper_throw(filling), many_steps_key(filling), same_steps_key(filling)
        runs[PUBLISHED, key] = _run(PUBLISHED, key, throw, steps=MANY_STEPS)
        runs["eq8", same] = _run(EXACT_STEP, same, throw, steps=paper_steps())
    light = paper_throw(STEADY_FILLING)
    runs[WEIGHTLESS, WEIGHTLESS_KEY] = _run(WEIGHTLESS, WEIGHTLESS_KEY, light)
    return runs


def _run(solver: str, key: str, scenario: Scenario, steps: int | None = None, words: str = "") -> Run:
    """Return one run: of a scheme with its steps, or of an equation."""
    settings: dict[str, Any] = {} if steps is None else {"steps": steps, "store": "summary"}
    return Run(solver, scenario, settings, label=f"claims, {solver}, {key}{words}")


def plan_halved() -> dict[Pair, Run]:
    """Return the event-driven flights with half the slices of the figures'."""
    cases: dict[str, Case] = {case.key: case for name in HALVED for case in family(name)}
    runs: dict[Pair, Run] = {}
    for solver in EVENT_DRIVEN:
        for key, case in cases.items():
            usual = scenario_of(solver, case)
            if usual is not None and usual.n_slices > 1:
                half = usual.with_slices(usual.n_slices // 2)
                runs[solver, key] = _run(solver, key, half, words=HALF_WORDS)
    for filling in numbers("figure-S1-filling"):
        same, usual = same_steps_key(filling), paper_throw(filling)
        half = usual.with_slices(usual.n_slices // 2)
        runs["eq8", same] = _run(EXACT_STEP, same, half, steps=paper_steps(), words=HALF_WORDS)
    return runs


def plan_published(half: str) -> dict[Pair, tuple[Run, int]]:
    """Return the flights of the published program with half its slices or steps, and every how many points are kept.

    Parameters
    ----------
    half : "slices" or "steps"
    """
    kept = {case.key for name in LOOKED_INTO for case in family(name)}
    runs: dict[Pair, tuple[Run, int]] = {}
    for name in HALVED if half == "slices" else HALF_STEPS:
        for case in family(name):
            scenario, steps, thin = case.scenario, case.steps, case.thin
            if half == "slices":
                scenario = scenario.with_slices(max(1, scenario.n_slices // 2))
            else:
                # As many points are kept as there are, up to the rounding that keeps the last one.
                steps, thin = 1 + (case.steps - 1) // 2, 1
            settings = {"steps": steps, "store": "full" if case.key in kept else "summary"}
            words = HALF_WORDS if half == "slices" else HALF_STEPS_WORDS
            label = f"claims, {PUBLISHED}, {case.key}{words}"
            runs[PUBLISHED, case.key] = Run(PUBLISHED, scenario, settings, label), thin
    return runs


@dataclass(frozen=True, slots=True, kw_only=True)
class ClaimPlan:
    """What the statements need beside the runs of the figures, by solver and key of the case.

    Of the published program's runs with half the slices or half the steps every so many points are kept.
    """

    further: Mapping[Pair, Run]
    halved: Mapping[Pair, Run]
    half_slices: Mapping[Pair, tuple[Run, int]]
    half_steps: Mapping[Pair, tuple[Run, int]]

    @property
    def runs(self) -> list[Run]:
        """The runs that are kept whole."""
        return [*self.halved.values(), *self.further.values()]

    @property
    def groups(self) -> list[list[tuple[Run, int]]]:
        """The runs that are thinned, in groups of which a worker makes one at a time."""
        jobs = [*self.half_slices.values(), *self.half_steps.values()]
        return [jobs[k : k + GROUP] for k in range(0, len(jobs), GROUP)]


def plan_claims() -> ClaimPlan:
    """Return what the statements need beside the runs of the figures."""
    return ClaimPlan(
        further=plan_further(),
        halved=plan_halved(),
        half_slices=plan_published("slices"),
        half_steps=plan_published("steps"),
    )
