"""What overlapping slices cost: the plateau over the fill fraction, with slices that share their place and without.

The paper expects a full bottle to behave like ice, since nothing in it can move, and finds that its own does not: its
slices may share their place. The same engine with the same slices, once letting them pass and once not, leaves that one
assumption between two curves; the reference (which lets them pass) says how far the engine is to be trusted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from flipproof.chapters.maps.study import vary
from flipproof.frame.solvers import Made, Run
from slicemodel import Scenario
from slicemodel.observables import plateau
from slicemodel.trajectory import FloatArray

FILLS: Final = tuple(round(0.1 * k, 1) for k in range(1, 11))
"""Fill fractions M_w / M_max of the full study."""

ICE: Final = 1.0
"""omega / omega_0 of a bottle in which nothing moves."""

SLICES: Final = 10
"""Slices of every run; with 5, 10 and 20 that exclude each other the half-full bottle keeps 0.227, 0.227, 0.228."""

DT: Final = 1e-4
"""Coarser step of the engine [s]; slices that exclude each other are thrown at half of it, too."""

POINTS: Final = 201
"""Output times of a run."""

ENGINE: Final = "pymunk"
REFERENCE: Final = "free-flight"

PASS, EXCLUDE, CHECK = (
    f"{ENGINE}, slices overlap",
    f"{ENGINE}, slices exclude each other",
    f"{REFERENCE}, slices overlap",
)
COARSER: Final = f"{EXCLUDE}, coarser"


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """The plateau of one solver over the fill fraction.

    Parameters
    ----------
    name : str - PASS, EXCLUDE or CHECK
    level : (F,) - mean of omega / omega_0 over the second half; NaN where the run failed
    band : (F,) - twice what halving the step changed; NaN where that was not measured
    reason : F strings - "" or why the run cannot be used
    """

    name: str
    level: FloatArray
    band: FloatArray
    reason: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlap:
    """The curves over ``fills``, shape (F,), by name; slices and the restitution between two of them as run."""

    fills: FloatArray
    slices: int
    restitution: float
    curves: Mapping[str, Curve]

    @property
    def cost(self) -> FloatArray:
        """Return what overlap changes: plateau of slices that pass minus plateau of slices that do not, shape (F,)."""
        return self.curves[PASS].level - self.curves[EXCLUDE].level

    @property
    def check(self) -> FloatArray:
        """Return |engine - reference| of slices that overlap, shape (F,)."""
        return np.abs(self.curves[PASS].level - self.curves[CHECK].level)

    def missing_from_ice(self, name: str) -> float:
        """Return by how much a curve misses ice where the bottle is full; NaN if it was not run there."""
        full = np.flatnonzero(np.isclose(self.fills, 1.0))
        return float(ICE - self.curves[name].level[full[0]]) if full.size else float("nan")


def plan_overlap(throw: Scenario, fills: Sequence[float] = FILLS, *, slices: int = SLICES, dt: float = DT) -> list[Run]:
    """Return the runs: four for each fill fraction, gamma of the throw unchanged."""
    return [run for runs in _plan(throw, fills, slices, dt).values() for run in runs]


def _plan(throw: Scenario, fills: Sequence[float], slices: int, dt: float) -> dict[str, list[Run]]:
    """Return the runs of every curve, one for each fill fraction."""
    cut = throw.with_slices(slices)
    times = np.linspace(0.0, throw.duration, POINTS)
    kinds: dict[str, tuple[str, dict[str, Any]]] = {
        EXCLUDE: (ENGINE, {"slices": "exclude", "dt": dt / 2}),
        COARSER: (ENGINE, {"slices": "exclude", "dt": dt}),
        PASS: (ENGINE, {"dt": dt}),
        CHECK: (REFERENCE, {}),
    }
    return {
        name: [
            Run(solver, vary(cut, fill=fill), settings | {"times": times}, f"overlap, {name}, fill {fill:g}")
            for fill in fills
        ]
        for name, (solver, settings) in kinds.items()
    }


def study_overlap(
    throw: Scenario,
    made: Mapping[Run, Made],
    fills: Sequence[float] = FILLS,
    *,
    slices: int = SLICES,
    dt: float = DT,
) -> Overlap:
    """Read the runs that ``plan_overlap`` planned with the same arguments."""
    curves = {name: _curve(name, runs, made) for name, runs in _plan(throw, fills, slices, dt).items()}
    halved = replace(curves[EXCLUDE], band=2.0 * np.abs(curves[EXCLUDE].level - curves[COARSER].level))
    return Overlap(
        fills=np.asarray(fills, dtype=np.float64),
        slices=slices,
        restitution=throw.restitution,
        curves={PASS: curves[PASS], EXCLUDE: halved, CHECK: curves[CHECK]},
    )


def _curve(name: str, runs: Sequence[Run], made: Mapping[Run, Made]) -> Curve:
    level, reasons = np.full(len(runs), np.nan), []
    for k, run in enumerate(runs):
        outcome = made.get(run)
        reason = _problem(outcome)
        reasons.append(reason)
        if not reason and outcome is not None:
            flight = outcome.flight
            level[k] = plateau(flight.t, flight.omega, flight.scenario.omega0)
    return Curve(name=name, level=level, band=np.full(len(runs), np.nan), reason=tuple(reasons))


def _problem(outcome: Made | None) -> str:
    """Return why a run cannot be used, or nothing."""
    if outcome is None:
        return "not run"
    if outcome.trajectory is None:
        return outcome.reason or "failed"
    return "" if outcome.trajectory.ok else f"{outcome.trajectory.status}: {outcome.trajectory.message}"
