"""The runs that the statements need beside those of the figures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

from flipproof.frame.solvers import Run
from flipproof.paper.cases import family
from flipproof.paper.claims_cost import MANY_STEPS, many_steps_key, same_steps_key
from flipproof.paper.claims_slices import FINEST, MANY_SLICES, finest_key
from flipproof.paper.parameters import numbers, paper_steps, paper_throw
from flipproof.paper.runs import HALVES, PUBLISHED, SOLVERS, Half, Planned, scenario_of
from slicemodel import Scenario

HALVED: Final = ("filling", "long", "drag", "spin", "angle", "aspect")
"""Families flown with half the slices too; in the others their number is the subject."""

SLICES: Final = {"slices": "", "slices at 5 /s": " at 5 /s"}
"""Families in which the number of slices is the subject, and the words for their damping."""

REBOUNDS: Final = ("beta", "beta at 5 /s")

WEIGHTLESS: Final = "eq8-weightless"
STEADY_FILLING: Final = 0.1
WEIGHTLESS_KEY: Final = f"filling {STEADY_FILLING:g}"
"""The bottle that does not slow down without weight, and the key of its flight."""


def plan_claims() -> list[Planned]:
    """Return the runs of all statements: those that are not grouped, and those of the published program."""
    return [*plan_halved(), *plan_further(), *(each for half in HALVES for each in plan_published(half))]


def _planned(solver: str, key: str, scenario: Scenario, half: Half = "", *, by: str = "", **settings: Any) -> Planned:
    """Return the run of an equation, made by the scheme ``by`` if there is one."""
    label = f"claims, {by or solver}, {key}" + (f", half the {half}" if half else "")
    return Planned((solver, key, half), Run(by or solver, scenario, settings, label), grouped=False)


def _halved(scenario: Scenario) -> Scenario:
    return scenario.with_slices(max(1, scenario.n_slices // 2))


def _same_steps(filling: float, half: Half = "") -> Planned:
    """Return the run of the scheme that solves Eq. 8 as printed at the paper's number of time steps."""
    throw = _halved(paper_throw(filling)) if half else paper_throw(filling)
    key = same_steps_key(filling)
    return _planned("eq8", key, throw, half, by="exact-step", steps=paper_steps(), store="summary")


def plan_further() -> Iterator[Planned]:
    """Yield the runs that no figure needs: finer in slices and in time, and without weight."""
    for name, damping in SLICES.items():
        many = next(case for case in family(name) if case.value == MANY_SLICES)
        for solver in SOLVERS[1:]:
            yield _planned(solver, finest_key(damping), many.scenario.with_slices(FINEST))
    for filling in numbers("figure-S1-filling"):
        key = many_steps_key(filling)
        yield _planned(PUBLISHED, key, paper_throw(filling), steps=MANY_STEPS, store="summary")
        yield _same_steps(filling)
    yield _planned(WEIGHTLESS, WEIGHTLESS_KEY, paper_throw(STEADY_FILLING))


def plan_halved() -> Iterator[Planned]:
    """Yield the event-driven flights with half the slices of the figures'."""
    cases = {case.key: case for name in HALVED for case in family(name)}
    for solver in SOLVERS[1:]:
        for key, case in cases.items():
            usual = scenario_of(solver, case)
            if usual is not None and usual.n_slices > 1:
                yield _planned(solver, key, _halved(usual), "slices")
    for filling in numbers("figure-S1-filling"):
        yield _same_steps(filling, "slices")


def plan_published(half: Half) -> Iterator[Planned]:
    """Yield the flights of the published program with half its "slices" or "steps".

    Slices are kept where statements read more than omega and theta.
    """
    whole = {case.key for name in ("long", "drag", *REBOUNDS) for case in family(name)}
    families = HALVED if half == "slices" else (*HALVED, *REBOUNDS, *SLICES)
    for key, case in {case.key: case for name in families for case in family(name)}.items():
        scenario, steps, thin = _halved(case.scenario), case.steps, case.thin
        if half == "steps":
            # As many points are kept as there are, up to the rounding that keeps the last one.
            scenario, steps, thin = case.scenario, 1 + (case.steps - 1) // 2, 1
        store = "full" if key in whole else "summary"
        planned = _planned(PUBLISHED, key, scenario, half, steps=steps, store=store)
        yield replace(planned, thin=thin, grouped=True)
