"""What a step of finite length costs, taken apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from flipproof.chapters.finite_step.study import WAYS, StepCost, Way, study_finite_step, way_run
from flipproof.frame.chapter import Ask, Chapter, Claims, Finding, Run, Study, attempt
from flipproof.frame.throws import FINER, finer

MODEL_BAND: Final = 1e-9
"""Fraction of omega_0 by which an equation without recoil may be off on the throws of a report."""


@dataclass(frozen=True, slots=True)
class StepCosts:
    """What each way costs at the report's slices; the same at ``FINER`` times as many, nothing if a run is missing."""

    costs: tuple[StepCost, ...]
    more: tuple[StepCost, ...]
    slices: int
    finer_slices: int

    @property
    def rows(self) -> list[tuple[StepCost, StepCost | None]]:
        """Each cost beside the same at more slices."""
        return list(zip(self.costs, self.more or (None,) * len(self.costs), strict=True))


def study(ask: Ask) -> Study[StepCosts]:
    """Hold every way to take a step against its equation, at the report's slices and at more."""
    pairs = {way: (way_run(way, ask.throw, ask.steps), Run(way.model, ask.throw, {}, way.model)) for way in WAYS}
    more = {way: (finer(run), finer(truth)) for way, (run, truth) in pairs.items()}
    flights = yield [run for both in (*pairs.values(), *more.values()) for run in both]

    def cost(of: dict[Way, tuple[Run, Run]]) -> tuple[StepCost, ...]:
        return study_finite_step({way: (flights[run].whole, flights[truth].whole) for way, (run, truth) in of.items()})

    return StepCosts(cost(pairs), attempt(cost, more).found or (), ask.throw.n_slices, FINER * ask.throw.n_slices)


def claims(found: StepCosts) -> Claims:
    """Yield what every way costs."""
    for cost in found.costs:
        yield claim_finite_step(cost)


def claim_finite_step(cost: StepCost) -> Finding:
    """What one way to take a step of finite length costs, against the equation that it converges to."""
    before = "no slice strikes an end" if math.isnan(cost.start) else f"{cost.start:.2g} of ω₀ before the first impact"
    return Finding(
        id=f"finite-step-{cost.way.name}",
        title=f"{cost.way.words}: largest difference in ω from {cost.way.model}",
        value=cost.flight,
        unit="of ω₀",
        kind="observation",
        band=MODEL_BAND,
        note=f"{cost.steps} steps; {before}",
    )


CHAPTER: Final = Chapter(
    name="finite-step",
    title="What a step of finite length costs, taken apart",
    study=study,
    claims=claims,
    template=Path(__file__).with_name("part.html.j2"),
)
