"""Where does which mistake matter? The ladder from the published program to free flight over maps of throws.

The mapped error is the difference of the plateau, the mean of omega / omega_0 over the second half of the flight: it is
what the paper reads off a flight, and an average forgives a rebound that comes a little early. The largest difference
max |d omega| / omega_0 is kept beside it; a single impact that shifts in time saturates it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from ode_reference.models import LADDER as MODELS
from reports.solvers import Made, Run
from slicemodel import Scenario, Trajectory
from slicemodel.observables import plateau
from slicemodel.trajectory import FloatArray

Axis = Literal["gamma", "step", "restitution"]
Measure = Literal["plateau", "largest"]

LADDER: Final = ("published-python", *MODELS)
"""From what was published to what is right; each differs from the next by one mistake."""

RUNGS: Final = (
    "step size",
    "sign of Eq. 9d",
    "roots of Eq. 9a",
    "drag reference",
    "gravity",
    "moving origin",
    "recoil",
)
"""The mistake between each entry of LADDER and the next."""

EXTRA: Final = ("exact-step",)
"""Held against its own equation, beside the ladder."""

SCHEMES: Final = ("published-python", "exact-step")

LABELS: Final[Mapping[Axis, str]] = {
    "gamma": "damping rate γ / ω₀ [1]",
    "step": "step ω₀ Δt [1]",
    "restitution": "restitution e [1]",
}

POINTS = 201
"""Output times of a model."""

FINE: Final = {"rtol": 1e-6, "atol": 1e-9, "rest_speed": 1e-3, "turn": 0.04}
"""Tolerances of a model on a map; ``turn`` is its longest step in radians of the bottle at release, omega_0 dt."""

COARSE: Final = {"rtol": 1e-6, "atol": 1e-9, "rest_speed": 1e-2, "turn": 0.1}
"""The same at about half the cost; moves a plateau by up to 0.006 where flights are sensitive, by 1e-4 elsewhere."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One throw of a map: row, column, scenario, and points of the grid for the schemes."""

    row: int
    column: int
    scenario: Scenario
    steps: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidityMap:
    """The ladder over a map of throws. Arrays over cells have shape (rows, columns) = (y, x).

    Parameters
    ----------
    axis : {"gamma", "step", "restitution"} - the quantity along y
    fills : (columns,) - fill fraction M_w / M_max, along x
    values : (rows,) - the quantity along y
    slices : int
    level : name -> array - plateau of every entry of LADDER and EXTRA; NaN where it could not be computed
    largest : name -> array - max |d omega| / omega_0 against free flight; of a scheme, against its own equation too
    step_error : scheme -> array - error against the scheme's own equation, by plateau
    reason : array of str - "" or why the cell, or a part of it, could not be computed
    """

    axis: Axis
    fills: FloatArray
    values: FloatArray
    slices: int
    level: Mapping[str, FloatArray]
    largest: Mapping[str, FloatArray]
    step_error: Mapping[str, FloatArray]
    reason: NDArray[np.str_]

    def error(self, name: str, measure: Measure = "plateau") -> FloatArray:
        """Return the error of an approximation against free flight as a fraction of omega_0."""
        if measure == "largest":
            return self.largest[name]
        return np.abs(self.level[name] - self.level[LADDER[-1]])

    @property
    def differences(self) -> FloatArray:
        """|plateau of a rung - plateau of the next|, shape (rungs, rows, columns)."""
        stack = np.array([self.level[name] for name in LADDER])
        return np.abs(np.diff(stack, axis=0))

    @property
    def dominant(self) -> NDArray[np.int64]:
        """Index into RUNGS of the largest difference; -1 where any of them is missing."""
        differences = self.differences
        missing = ~np.isfinite(differences).all(axis=0)
        return np.where(missing, -1, np.nan_to_num(differences, nan=-1.0).argmax(axis=0))


def vary(throw: Scenario, *, fill: float, damping: float | None = None, restitution: float | None = None) -> Scenario:
    """Return the throw at another fill fraction, cut into as many slices.

    ``damping`` is gamma / omega_0; None keeps the throw's own gamma, as the paper does when it fills the bottle.
    """
    gamma = throw.damping_rate if damping is None else damping * abs(throw.omega0)
    water = fill * throw.bottle.capacity
    return replace(
        throw,
        water_mass=water,
        drag=2.0 * gamma * water / throw.n_slices,
        restitution=throw.restitution if restitution is None else restitution,
    )


def cells(throw: Scenario, axis: Axis, fills: Sequence[float], values: Sequence[float], steps: int) -> list[Cell]:
    """Return the throws of a map, row by row; ``steps`` is the grid where the map does not say another."""
    found = []
    for row, value in enumerate(values):
        for column, fill in enumerate(fills):
            scenario = vary(
                throw,
                fill=fill,
                damping=value if axis == "gamma" else None,
                restitution=value if axis == "restitution" else None,
            )
            turn = abs(throw.omega0) * throw.duration
            points = max(2, round(turn / value) + 1) if axis == "step" else steps
            found.append(Cell(row=row, column=column, scenario=scenario, steps=points))
    return found


def plan_map(
    throw: Scenario,
    axis: Axis,
    fills: Sequence[float],
    values: Sequence[float],
    *,
    steps: int = 1000,
    tolerances: Mapping[str, float] = FINE,
) -> list[Run]:
    """Return the runs of one map; tags are unique within and across maps of different axes.

    A model does not know a step: along "step" it runs once per fill fraction.
    """
    longest = min(tolerances["turn"] / abs(throw.omega0), throw.duration)
    usual: dict[str, Any] = {name: value for name, value in tolerances.items() if name != "turn"}
    usual |= {"max_step": longest, "times": np.linspace(0.0, throw.duration, POINTS)}
    runs = []
    for cell in cells(throw, axis, fills, values, steps):
        for name in (*LADDER, *EXTRA):
            if axis == "step" and cell.row > 0 and name not in SCHEMES:
                continue
            settings = {"steps": cell.steps, "store": "summary"} if name in SCHEMES else usual
            runs.append(Run(_tag(axis, cell, name), name, cell.scenario, settings))
    return runs


def _tag(axis: Axis, cell: Cell, name: str) -> str:
    row = 0 if axis == "step" and name not in SCHEMES else cell.row
    return f"map {axis}, row {row}, column {cell.column}, {name}"


def study_map(
    throw: Scenario,
    axis: Axis,
    fills: Sequence[float],
    values: Sequence[float],
    made: Mapping[str, Made],
    *,
    steps: int = 1000,
) -> ValidityMap:
    """Read the runs that ``plan_map`` planned with the same arguments; ``made`` maps tags to what became of them."""
    shape = (len(values), len(fills))
    names = (*LADDER, *EXTRA)
    level = {name: np.full(shape, np.nan) for name in names}
    largest = {name: np.full(shape, np.nan) for name in names}
    step_error = {name: np.full(shape, np.nan) for name in SCHEMES}
    reason = np.full(shape, "", dtype="<U80")
    for cell in cells(throw, axis, fills, values, steps):
        at = (cell.row, cell.column)
        flights: dict[str, Trajectory] = {}
        problems = []
        for name in names:
            outcome = made.get(_tag(axis, cell, name))
            problem = _problem(outcome)
            if outcome is not None and outcome.trajectory is not None and not problem:
                flights[name] = outcome.trajectory
                level[name][at] = _plateau(outcome.trajectory)
            else:
                problems.append(f"{name}: {problem}")
        truth = flights.get(LADDER[-1])
        for name, flight in flights.items():
            if truth is not None:
                largest[name][at] = _largest(flight, truth)
        for scheme, model in (("published-python", "published-limit"), ("exact-step", "eq8")):
            step_error[scheme][at] = abs(level[scheme][at] - level[model][at])
        reason[at] = "; ".join(problems)[:80]
    return ValidityMap(
        axis=axis,
        fills=np.asarray(fills, dtype=np.float64),
        values=np.asarray(values, dtype=np.float64),
        slices=throw.n_slices,
        level=level,
        largest=largest,
        step_error=step_error,
        reason=reason,
    )


def _problem(outcome: Made | None) -> str:
    """Return the reason code of a run that cannot be used, or nothing."""
    if outcome is None:
        return "not run"
    if outcome.trajectory is None:
        return outcome.reason.partition(":")[0] or "failed"
    return "" if outcome.trajectory.ok else outcome.trajectory.status


def _plateau(flight: Trajectory) -> float:
    return plateau(flight.t, flight.omega, flight.scenario.omega0)


def _largest(flight: Trajectory, truth: Trajectory) -> float:
    """Return max |d omega| / omega_0 at the times of the coarser of the two."""
    few, many = (flight, truth) if len(flight.t) < len(truth.t) else (truth, flight)
    other = np.interp(few.t, many.t, many.omega)
    return float(np.abs(few.omega - other).max() / abs(flight.scenario.omega0))
