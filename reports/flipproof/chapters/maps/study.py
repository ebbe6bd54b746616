"""Where does which assumption matter? The ladder from the published program to free flight over maps of throws.

The mapped error is the difference of the plateau, the mean of omega / omega_0 over the second half of the flight: it is
what the paper reads off a flight, and an average forgives a rebound that comes a little early. The largest difference
max |d omega| / omega_0 is kept beside it; a single impact that shifts in time saturates it.

An assumption's number on a map is its fair share, the mean over all orders of mending (``waterfall.fair_share``): every
combination of assumptions is flown in every cell.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from flipproof.chapters.solvers import SCHEMES
from flipproof.chapters.waterfall.study import NAMES, canonical, fair_share
from flipproof.frame.solvers import Made, Run, make
from flipproof.frame.twins import band, twins
from ode_reference.models import LADDER as MODELS
from ode_reference.models import MODELS as EQUATIONS
from ode_reference.switches import Switches
from slicemodel import Scenario
from slicemodel.observables import plateau
from slicemodel.scenario import shortened
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

SETS: Final = {
    switches: next(
        (name for name in MODELS if canonical(EQUATIONS[name].switches) == canonical(switches)),
        canonical(switches).name,
    )
    for switches in Switches.every()
}
"""Every set of assumptions mended -> the model that flies it, a rung of the ladder where there is one."""

COLUMN: Final = "column"
"""Water that cannot overlap. It has no switches of the ladder: what it changes is no fair share."""

EXTRA: Final = ("exact-step", COLUMN)
"""Beside the ladder: a scheme held against its own equation, and the column against free flight."""

SOLVERS: Final = tuple(dict.fromkeys((*LADDER, *EXTRA, *SETS.values())))
"""What flies every cell: two schemes, 40 models and the column."""

LABELS: Final[Mapping[Axis, str]] = {
    "gamma": "damping rate γ / ω₀ [1]",
    "step": "step ω₀ Δt [1]",
    "restitution": "restitution e [1]",
}

POINTS = 201
"""Output times of a model."""

CURVE = 101
"""Equal times at which two runs are compared."""

FILLS: Final = (0.05, 1.0)

RANGES: Final[Mapping[Axis, tuple[float, float]]] = {
    "gamma": (0.02, 1.0),
    "step": (0.002, 0.2),
    "restitution": (0.0, 1.0),
}
"""Ends of a map's axes; "gamma" and "step" are spaced in equal ratios."""

CHUNK: Final = 200
"""Runs of a map that a worker makes at a time; it returns their readings alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One throw of a map: row, column, scenario, and points of the grid for the schemes."""

    row: int
    column: int
    scenario: Scenario
    steps: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """What a map needs of one run: plateau and omega at ``CURVE`` equal times [rad/s]; or, in a word, why not."""

    level: float = np.nan
    omega: FloatArray | None = None
    problem: str = ""


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
    shares : array, shape (rungs, rows, columns)
        Fair share of every rung in the plateau, signed; they add up from the published program to free flight.
    band : array or None
        By how much twins move the plateau of free flight, the most sensitive equation; None if they were not flown.
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
    shares: FloatArray
    band: FloatArray | None = None

    def error(self, name: str, measure: Measure = "plateau") -> FloatArray:
        """Return the error of an approximation against free flight as a fraction of omega_0."""
        if measure == "largest":
            return self.largest[name]
        return np.abs(self.level[name] - self.level[LADDER[-1]])

    @property
    def overlap(self) -> FloatArray:
        """What overlap changes: plateau of free flight, whose slices overlap, minus that of the column."""
        return self.level[LADDER[-1]] - self.level[COLUMN]

    @property
    def dominant(self) -> NDArray[np.int64]:
        """Index into RUNGS of the largest fair share; -1 where any is missing."""
        missing = ~np.isfinite(self.shares).all(axis=0)
        return np.where(missing, -1, np.nan_to_num(np.abs(self.shares), nan=-1.0).argmax(axis=0))


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


def map_axes(axis: Axis, columns: int, rows: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return fill fractions and values of a map of that many cells over the whole of its axes."""
    spaced: Callable[..., Any] = np.linspace if axis == "restitution" else np.geomspace
    return tuple(np.linspace(*FILLS, columns).tolist()), tuple(spaced(*RANGES[axis], rows).tolist())


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
    points: int | None = POINTS,
    banded: bool = False,
) -> list[Run]:
    """Return the runs of one map.

    A model does not know a step: along "step" it runs once per fill fraction, and so does the column along
    "restitution", which it does not know. ``points`` are its output times; None:
    its own. ``banded`` gives free flight its twins.
    """
    usual = _usual(throw, points)
    runs = []
    for cell in cells(throw, axis, fills, values, steps):
        for name in SOLVERS:
            if cell.row > 0 and (name == COLUMN if axis == "restitution" else axis == "step" and name not in SCHEMES):
                continue
            run = _run(axis, cell, name, usual)
            runs += [run, *(twins(run) if banded and name == LADDER[-1] else ())]
    return runs


def _usual(throw: Scenario, points: int | None) -> dict[str, Any]:
    return {} if points is None else {"times": np.linspace(0.0, throw.duration, points)}


def _run(axis: Axis, cell: Cell, name: str, usual: Mapping[str, Any]) -> Run:
    """Return the run that a cell has of a solver; ``usual`` are the settings of a model."""
    settings = {"steps": cell.steps, "store": "summary"} if name in SCHEMES else usual
    scenario = cell.scenario
    if name == COLUMN and axis == "restitution":
        scenario = replace(scenario, restitution=RANGES[axis][0])
    return Run(name, scenario, settings, f"map {axis}, row {cell.row}, column {cell.column}, {name}")


def make_readings(runs: Sequence[Run]) -> list[Reading]:
    """Make runs one after the other and return what a map needs of each."""
    return [read_flight(make(run)) for run in runs]


def study_readings(
    throw: Scenario,
    axis: Axis,
    fills: Sequence[float],
    values: Sequence[float],
    readings: Mapping[Run, Reading],
    *,
    steps: int = 1000,
    points: int | None = POINTS,
) -> ValidityMap:
    """Make the map of what was read off the runs of ``plan_map``, planned with the same arguments."""
    shape = (len(values), len(fills))
    level = {name: np.full(shape, np.nan) for name in SOLVERS}
    largest = {name: np.full(shape, np.nan) for name in SOLVERS}
    step_error = {name: np.full(shape, np.nan) for name in SCHEMES}
    reason = np.full(shape, "", dtype="<U80")
    planned = cells(throw, axis, fills, values, steps)
    usual = _usual(throw, points)
    for cell in planned:
        at = (cell.row, cell.column)
        found = {name: readings.get(_run(axis, cell, name, usual), Reading(problem="not run")) for name in SOLVERS}
        problems = [f"{name}: {reading.problem}" for name, reading in found.items() if reading.problem]
        truth = found[LADDER[-1]].omega
        for name, reading in found.items():
            level[name][at] = reading.level
            if truth is not None and reading.omega is not None:
                largest[name][at] = np.abs(reading.omega - truth).max() / abs(throw.omega0)
        for scheme, model in (("published-python", "published-limit"), ("exact-step", "eq8")):
            step_error[scheme][at] = abs(level[scheme][at] - level[model][at])
        reason[at] = shortened("; ".join(problems), 80)
    return ValidityMap(
        axis=axis,
        fills=np.asarray(fills, dtype=np.float64),
        values=np.asarray(values, dtype=np.float64),
        slices=throw.n_slices,
        level={name: level[name] for name in (*LADDER, *EXTRA)},
        largest={name: largest[name] for name in (*LADDER, *EXTRA)},
        step_error=step_error,
        reason=reason,
        shares=_shares(level),
        band=_band({(c.row, c.column): _run(axis, c, LADDER[-1], usual) for c in planned}, readings),
    )


def _band(free: Mapping[tuple[int, int], Run], readings: Mapping[Run, Reading]) -> FloatArray | None:
    """Return the band of free flight in every cell; None if its twins were not flown."""
    if not all(twin in readings for run in free.values() for twin in twins(run)):
        return None
    levels = {run: reading.level for run, reading in readings.items()}
    found = np.full((1 + max(row for row, _ in free), 1 + max(column for _, column in free)), np.nan)
    for at, run in free.items():
        found[at] = band(run, levels)
    return found


def _shares(level: Mapping[str, FloatArray]) -> FloatArray:
    """Return the fair share of every rung, the step size first; together they lead from program to free flight."""
    of_sets = {switches: level[name] for switches, name in SETS.items()}
    return np.array([level[LADDER[1]] - level[LADDER[0]], *(fair_share(name, of_sets) for name in NAMES)])


def read_flight(made: Made) -> Reading:
    """Return what a map needs of one run."""
    flight = made.trajectory
    if flight is None:
        return Reading(problem=word(made.reason))
    if not flight.ok:
        return Reading(problem=flight.status)
    times = np.linspace(0.0, flight.scenario.duration, CURVE)
    return Reading(
        level=plateau(flight.t, flight.omega, flight.scenario.omega0), omega=np.interp(times, flight.t, flight.omega)
    )


def word(reason: str) -> str:
    """Return the reason code that leads a failure's reason."""
    return reason.partition(":")[0] or "failed"
