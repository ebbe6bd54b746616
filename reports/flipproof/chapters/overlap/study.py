"""What overlapping slices cost: the plateau over the fill fraction, with slices that share their place and without.

The paper expects a full bottle to behave like ice, since nothing in it can move, and finds that its own does not: its
slices may share their place. The same engine with the same slices, once letting them pass and once not, leaves that one
assumption between two curves; the reference (which lets them pass) says how far the engine is to be trusted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from flipproof.chapters.maps.study import vary
from flipproof.frame.solvers import Made, Run
from ode_reference.solver import COLUMN
from slicemodel import Scenario
from slicemodel.observables import plateau
from slicemodel.trajectory import FloatArray

ICE: Final = 1.0
"""omega / omega_0 of a bottle in which nothing moves."""

PASS, EXCLUDE, CHECK = "pymunk, slices overlap", "pymunk, slices exclude each other", "free-flight, slices overlap"
COARSER: Final = f"{EXCLUDE}, coarser"


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlap:
    """The plateau of every solver over the fill fraction. Arrays have shape (F,).

    Parameters
    ----------
    fills : array - fill fractions M_w / M_max
    slices : int
    restitution : float - at the ends and between slices
    level : name -> array
        Mean of omega / omega_0 over the second half, for PASS, EXCLUDE, CHECK and COLUMN, which is water as one
        stretching column (``ode_reference.column``); NaN where the run failed.
    reason : name -> F strings - "" or why the run cannot be used
    band : array - twice what halving the step changed for EXCLUDE
    """

    fills: FloatArray
    slices: int
    restitution: float
    level: Mapping[str, FloatArray]
    reason: Mapping[str, Sequence[str]]
    band: FloatArray

    @property
    def cost_to_column(self) -> FloatArray:
        """What overlap changes between exact equations: slices that overlap in free flight minus the column."""
        return self.level[CHECK] - self.level[COLUMN]

    def missing_from_ice(self, name: str) -> float:
        """Return by how much a curve misses ice where the bottle is full; NaN if it was not run there."""
        full = np.flatnonzero(np.isclose(self.fills, 1.0))
        return float(ICE - self.level[name][full[0]]) if full.size else float("nan")


def plan_overlap(throw: Scenario, fills: Sequence[float], slices: int, dt: float) -> dict[str, list[Run]]:
    """Return the runs of every curve, one for each fill fraction; gamma of the throw is unchanged.

    ``dt`` is the coarser step of the engine [s]; slices that exclude each other are thrown at half of it, too.
    """
    cut = throw.with_slices(slices)
    times = np.linspace(0.0, throw.duration, 201)
    kinds: dict[str, tuple[str, dict[str, Any]]] = {
        EXCLUDE: ("pymunk", {"slices": "exclude", "dt": dt / 2}),
        COARSER: ("pymunk", {"slices": "exclude", "dt": dt}),
        PASS: ("pymunk", {"dt": dt}),
        CHECK: ("free-flight", {}),
        COLUMN: (COLUMN, {}),
    }
    return {
        name: [
            Run(solver, vary(cut, fill=fill), settings | {"times": times}, f"overlap, {name}, fill {fill:g}")
            for fill in fills
        ]
        for name, (solver, settings) in kinds.items()
    }


def study_overlap(fills: Sequence[float], runs: Mapping[str, Sequence[Run]], made: Mapping[Run, Made]) -> Overlap:
    """Read the runs that ``plan_overlap`` planned over these fill fractions."""
    read = {name: [_plateau(made[run]) for run in curve] for name, curve in runs.items()}
    level = {name: np.array([found for found, _ in curve]) for name, curve in read.items()}
    throw = runs[PASS][0].scenario
    names = (PASS, EXCLUDE, CHECK, COLUMN)
    return Overlap(
        fills=np.asarray(fills),
        slices=throw.n_slices,
        restitution=throw.restitution,
        level={name: level[name] for name in names},
        reason={name: [reason for _, reason in read[name]] for name in names},
        band=2.0 * np.abs(level[EXCLUDE] - level[COARSER]),
    )


def _plateau(made: Made) -> tuple[float, str]:
    """Return the plateau of a run, or NaN and why it cannot be used."""
    flight = made.trajectory
    if flight is None:
        return np.nan, made.reason
    if not flight.ok:
        return np.nan, f"{flight.status}: {flight.message}"
    return plateau(flight.t, flight.omega, flight.scenario.omega0), ""
