"""The plateau of every equation over the filling, beside what three fluids gave in the same bottle."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Final

import numpy as np

from flipproof.chapters.maps.study import vary
from flipproof.figures.spoken import SPOKEN
from flipproof.frame.chapter import Ask, Run, RunResult, Study
from ode_reference.solver import COLUMN, RODS
from slicemodel.trajectory import FloatArray

FILLS: Final = (0.05, 0.1, 0.15, 0.2, 0.25, 0.33, 0.4, 0.5, 0.6, 0.75, 0.9, 1.0)
"""Fillings of the curves; those of the fluids are among them."""

OWN_CELLS: Final = 16
"""Cells across of the coarsest grid whose plateaus count."""

DISCS: Final = "rods as discs, no drag"
"""Rods with the inertia of discs and without drag, as the fluids have none."""

EQUATIONS: Final[Mapping[str, str]] = {
    "published-python": "Its errors partly cancel: nothing damps, weight pushes the water, slices overlap.",
    "eq8": "Weight pushes its water along a bottle that falls, and slices overlap.",
    "free-flight": "Right for slices; but slices pass through each other, and water does not: from three quarters full "
    "on nothing here is farther off.",
    COLUMN: "No part of it may leave the base before all of it stretches, so that it starts late or not at all.",
    RODS: "Nothing holds its water together (no suction), so that it parts too early; nothing swirls; it has no "
    "inertia of its own.",
    DISCS: "The same with inertia of its own, and without the drag that the paper chose.",
}
"""Equation -> why it misses water."""


def name_of(equation: str) -> str:
    """Return an equation's name in sentences."""
    return SPOKEN.get(equation, equation)


@cache
def fluids() -> Mapping[str, Any]:
    """Return what was recorded of the fluids."""
    return _read("fluids.json")


@cache
def own_fluid() -> Mapping[str, Any]:
    """Return the flights of ``benchmarks/grid_water.py`` that ``benchmarks/ideal_water.py`` recorded."""
    return _read("own_fluid.json")


def _read(name: str) -> Mapping[str, Any]:
    text = resources.files("flipproof.chapters.water").joinpath(name).read_text(encoding="utf-8")
    content: Mapping[str, Any] = json.loads(text)
    return content


def own_flights(*, start: str | None = None, suction: bool | None = None) -> list[Mapping[str, Any]]:
    """Return the flights of our own fluid on its two finest grids, those asked for."""
    return [
        flight
        for flight in own_fluid()["flights"]
        if flight["cells"] >= OWN_CELLS and start in (None, flight["start"]) and suction in (None, flight["suction"])
    ]


def recorded_band() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the fillings of the recorded fluids, and the lowest and the highest plateau of any there, shape (F,)."""
    recorded = fluids()
    levels = np.array([fluid["plateau"] for fluid in recorded["fluids"]], dtype=float)
    return np.array(recorded["fillings"]), np.nanmin(levels, axis=0), np.nanmax(levels, axis=0)


def own_band() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the same fillings and edges of our own fluid, with suction and without; NaN where it was not thrown."""
    fills = np.array(fluids()["fillings"])
    flights = own_flights(start="spinning")
    levels = [[flight["plateau"] for flight in flights if flight["filling"] == fill] or [np.nan] for fill in fills]
    return fills, np.array([min(level) for level in levels]), np.array([max(level) for level in levels])


def fluid_band() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the fillings of the fluids, and the lowest and the highest plateau of any fluid there, shape (F,)."""
    fills, *recorded = recorded_band()
    _, *ideal = own_band()
    return fills, np.fmin(recorded[0], ideal[0]), np.fmax(recorded[1], ideal[1])


def start_band() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return two fillings, and the lowest and the highest plateau there of any start of the water in two fluids."""
    starts = fluids()["starts"]
    levels = np.array(list(starts["plateau"].values()), dtype=float)
    ours = np.array([[f["plateau"] for f in own_flights() if f["filling"] == fill] for fill in starts["fillings"]]).T
    levels = np.concatenate([levels, ours])
    return np.array(starts["fillings"]), levels.min(axis=0), levels.max(axis=0)


def late_fluid() -> Mapping[float, Mapping[str, Any]]:
    """Return by filling, from a quarter on, the flight of our own fluid with suction on its finest grid."""
    flights = own_flights(start="spinning", suction=True)
    finest = max(flight["cells"] for flight in flights)
    return {f["filling"]: f for f in flights if f["cells"] == finest and f["filling"] >= 0.25}


@dataclass(frozen=True, slots=True, kw_only=True)
class Water:
    """Every equation over the filling. Arrays have shape (F,), in the order of ``FILLS``.

    Parameters
    ----------
    slices : of the equations that have any
    level : equation -> plateau of omega / omega_0; NaN where a run failed
    early : equation -> time to 0.75 omega_0 [s]; NaN where it is not reached
    apart : equation -> filling -> r.m.s. difference in omega(t) from our own fluid with suction, in omega_0
    own_inertia : equation -> by how much the inertia of discs moves the plateau of the half-full bottle
    """

    slices: int
    level: Mapping[str, FloatArray]
    early: Mapping[str, FloatArray]
    apart: Mapping[str, Mapping[float, float]]
    own_inertia: Mapping[str, float]

    def at(self, equation: str, filling: float) -> float:
        """Return a plateau at one of ``FILLS``."""
        return float(self.level[equation][FILLS.index(filling)])

    def miss(self, equation: str, filling: float) -> float:
        """Return how far a plateau lies outside the fluids' band [omega_0]: below it negative, inside 0."""
        fills, low, high = fluid_band()
        k, value = int(np.flatnonzero(fills == filling)[0]), self.at(equation, filling)
        return value - float(np.clip(value, low[k], high[k]))

    def distance(self, equation: str) -> float:
        """Return the r.m.s. of ``miss`` over the fillings from a quarter on, below which the fluids disagree."""
        return float(np.sqrt(np.mean([self.miss(equation, filling) ** 2 for filling in fluids()["fillings"][1:]])))

    def time(self, equation: str, filling: float) -> float:
        """Return the time to 0.75 omega_0 at one of ``FILLS`` [s]."""
        return float(self.early[equation][FILLS.index(filling)])


def study(ask: Ask) -> Study[Water]:
    """Throw the paper's own bottle, in which the fluids were thrown, at every filling by every equation."""
    cut = ask.reference
    runs = {(equation, filling): _run(equation, filling, ask) for equation in EQUATIONS for filling in FILLS}
    half = {
        (equation, counted): Run(
            equation, cut, {"times": _times(ask), "own_inertia": counted}, f"water, {equation}, own inertia {counted}"
        )
        for equation in ("free-flight", RODS)
        for counted in (False, True)
    }
    flights = yield [*runs.values(), *half.values()]
    flown = {equation: [flights[runs[equation, fill]] for fill in FILLS] for equation in EQUATIONS}
    level = {equation: np.array([result.plateau for result in results]) for equation, results in flown.items()}
    early = {equation: np.array([_early(result) for result in results]) for equation, results in flown.items()}
    apart = {
        equation: {
            fill: _apart(flights[runs[equation, fill]], flight["omega"]) for fill, flight in late_fluid().items()
        }
        for equation in EQUATIONS
    }
    inertia_change = {name: flights[half[name, True]].plateau - flights[half[name, False]].plateau for name, _ in half}
    return Water(slices=cut.n_slices, level=level, early=early, apart=apart, own_inertia=inertia_change)


def _times(ask: Ask) -> FloatArray:
    return np.linspace(0.0, ask.reference.duration, 501)


def _run(equation: str, filling: float, ask: Ask) -> Run:
    throw, label = vary(ask.reference, fill=filling), f"water, {equation}, filling {filling:g}"
    if equation == DISCS:
        return Run(
            RODS, vary(ask.reference, fill=filling, damping=0.0), {"times": _times(ask), "own_inertia": True}, label
        )
    if equation == "published-python":
        return Run(equation, throw, {"steps": ask.steps, "store": "summary"}, label)
    return Run(equation, throw, {"times": _times(ask)}, label)


def _early(result: RunResult) -> float:
    if result.problem:
        return math.nan
    run = result.flight
    below = np.flatnonzero(run.omega / run.scenario.omega0 < 0.75)
    return float(run.t[below[0]]) if below.size else float("nan")


def _apart(result: RunResult, curve: list[float]) -> float:
    if result.problem:
        return math.nan
    run = result.flight
    times = np.linspace(0.0, run.scenario.duration, len(curve))
    omega = np.interp(times, run.t, run.omega) / run.scenario.omega0
    return float(np.sqrt(np.mean((omega - np.array(curve)) ** 2)))
