"""What a step of finite length costs, taken apart: coefficients held over the step, a lag, rebounds that wait.

Before the first impact nothing waits, so that there a scheme without lag shows what holding the coefficients costs and
nothing else. Each number is max |omega - omega of the scheme's own equation| / omega_0 at one number of steps. Across
impacts the parts do not add up: they may cancel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from flipproof.chapters.solvers import LIMITS
from flipproof.frame.chapter import Ask, Band, Chapter, Claims, Run, Study, attempt, observed, results_of
from flipproof.frame.solvers import finer
from flipproof.frame.twins import omega_band_call
from slicemodel import Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """One way to take a step: scheme, its settings, and in words what is finite about it."""

    name: str
    scheme: str
    settings: Mapping[str, Any]
    words: str

    @property
    def model(self) -> str:
        """The equation that the scheme converges to."""
        return LIMITS[self.scheme]


EVERYTHING, HELD, LOCATED = "everything", "held", "held-located"
WAIT, LOCATE = "rebounds wait for the grid", "rebounds located inside the step"
PUBLISHED: Final = "published-python"
WAYS: Final = (
    Way(EVERYTHING, PUBLISHED, {}, f"the published program: coefficients held, J and r_CM a step behind, {WAIT}"),
    Way(HELD, PUBLISHED, {"lagged": False}, f"the published program without its lag: coefficients held, {WAIT}"),
    Way("exact", "exact-step", {}, f"exact step: coefficients held, {WAIT}"),
    Way(LOCATED, "exact-step", {"rebound": "in-step"}, f"exact step: coefficients held, {LOCATE}"),
    Way("waiting", "midpoint", {"rebound": "grid"}, f"midpoint: coefficients at mid-step, {WAIT}"),
    Way("neither", "midpoint", {}, f"midpoint: coefficients at mid-step, {LOCATE}"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCost:
    """What one way costs: the largest error of omega before the first impact and over the flight [omega_0].

    ``start`` is NaN if no slice ever strikes an end; ``band`` is that of its equation [omega_0], None if unknown.
    """

    way: Way
    steps: int
    start: float
    first_impact: float | None
    flight: float
    band: float | None = None


class StepCosts(NamedTuple):
    """What each way costs at the report's slices; the same at ``FINER`` times as many, nothing if a run is missing."""

    costs: tuple[StepCost, ...]
    more: tuple[StepCost, ...]
    slices: int


def study(ask: Ask) -> Study[StepCosts]:
    """Hold every way to take a step against its equation, at the report's slices and at more."""
    pairs = {}
    for way in WAYS:
        settings = {"steps": ask.steps, "store": "summary", **way.settings}
        run = Run(way.scheme, ask.throw, settings, f"finite step, {way.name}")
        pairs[way] = run, Run(way.model, ask.throw, {}, way.model)
    more = {way: (finer(run), finer(truth)) for way, (run, truth) in pairs.items()}
    calls = {truth: omega_band_call(truth) for _, truth in pairs.values()}
    flights = yield [*(run for both in (*pairs.values(), *more.values()) for run in both), *calls.values()]
    bands = results_of({truth: attempt(flights.answer, call) for truth, call in calls.items()})

    def costs(of: dict[Way, tuple[Run, Run]]) -> tuple[StepCost, ...]:
        pairs = ((cost_of(way, flights[run].whole, flights[truth].whole), truth) for way, (run, truth) in of.items())
        return tuple(replace(cost, band=float(bands[truth][-1]) if truth in bands else None) for cost, truth in pairs)

    return StepCosts(costs(pairs), attempt(costs, more).result or (), ask.throw.n_slices)


def cost_of(way: Way, run: Trajectory, reference: Trajectory) -> StepCost:
    """Hold a run against its equation."""
    error = np.abs(run.omega - np.interp(run.t, reference.t, reference.omega)) / abs(run.scenario.omega0)
    impacts = reference.impacts
    first = float(impacts.time[0]) if impacts is not None and len(impacts) else None
    before = error[run.t < first] if first is not None else np.array([])
    start = float(before.max()) if len(before) else math.nan
    return StepCost(way=way, steps=len(run.t), start=start, first_impact=first, flight=float(error.max()))


def claims(results: StepCosts) -> Claims:
    """Yield what every way costs, against the equation that it converges to; its band is that of the equation."""
    for cost in results.costs:
        start = f"{cost.start:.2g} of ω₀ before the first impact"
        note = f"{cost.steps} steps; {'no slice strikes an end' if math.isnan(cost.start) else start}"
        title = f"{cost.way.words}: largest difference in ω from {cost.way.model}"
        yield observed(
            f"finite-step-{cost.way.name}", title, cost.flight, "of ω₀", note, band=Band.of(cost.band, "twins")
        )


CHAPTER: Final = Chapter("finite-step", "What a step of finite length costs, taken apart", study, claims)
