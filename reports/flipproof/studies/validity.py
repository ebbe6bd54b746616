"""Where does which assumption matter? The ladder from the published program to free flight over maps of throws.

The mapped error is the difference of the plateau, the mean of omega / omega_0 over the second half of the flight: it is
what the paper reads off a flight, and an average forgives a rebound that comes a little early. The largest difference
max |d omega| / omega_0 is kept beside it; a single impact that shifts in time saturates it.

An assumption's number on a map is its fair share, the mean over all orders of mending (``waterfall.fair_share``): every
combination of assumptions is flown in every cell.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from flipproof.frame.processes import WorkerDiedError
from flipproof.frame.solvers import Made, Run, make
from flipproof.frame.twins import KINDS, band, twin_tag, twins
from flipproof.studies.waterfall import NAMES, canonical, fair_share
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

EXTRA: Final = ("exact-step",)
"""Held against its own equation, beside the ladder."""

SCHEMES: Final = ("published-python", "exact-step")

SOLVERS: Final = tuple(dict.fromkeys((*LADDER, *EXTRA, *SETS.values())))
"""What flies every cell: two schemes and 40 models."""

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
    """Return the runs of one map; tags are unique within and across maps of different axes.

    A model does not know a step: along "step" it runs once per fill fraction. ``points`` are its output times; None:
    its own. ``banded`` gives free flight its twins.
    """
    usual: dict[str, Any] = {} if points is None else {"times": np.linspace(0.0, throw.duration, points)}
    runs = []
    for cell in cells(throw, axis, fills, values, steps):
        for name in SOLVERS:
            if axis == "step" and cell.row > 0 and name not in SCHEMES:
                continue
            settings = {"steps": cell.steps, "store": "summary"} if name in SCHEMES else usual
            run = Run(tag(axis, cell, name), name, cell.scenario, settings)
            runs += [run, *(twins(run) if banded and name == LADDER[-1] else ())]
    return runs


def tag(axis: Axis, cell: Cell, name: str) -> str:
    """Return the tag of the run that a cell has of a solver; along "step" the rows share those of a model."""
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
    readings = {name: _read(one) for name, one in made.items()}
    return study_readings(throw, axis, fills, values, readings, steps=steps)


def gather_map(
    pool: Executor, throw: Scenario, axis: Axis, fills: Sequence[float], values: Sequence[float], *, steps: int = 1000
) -> Callable[[], ValidityMap]:
    """Have workers fly every set of assumptions on every cell; return what waits for them and makes the map."""
    runs = plan_map(throw, axis, fills, values, steps=steps, banded=True)
    pending = [pool.submit(make_readings, runs[k : k + CHUNK]) for k in range(0, len(runs), CHUNK)]

    def gathered() -> ValidityMap:
        readings: dict[str, Reading] = {}
        for chunk in pending:
            # Cells of a chunk whose worker died stay "not run".
            with contextlib.suppress(WorkerDiedError):
                readings |= chunk.result()
        return study_readings(throw, axis, fills, values, readings, steps=steps)

    return gathered


def make_readings(runs: Sequence[Run]) -> dict[str, Reading]:
    """Make runs one after the other and return what a map needs of each, by its tag."""
    return {run.tag: _read(make(run)) for run in runs}


def study_readings(
    throw: Scenario,
    axis: Axis,
    fills: Sequence[float],
    values: Sequence[float],
    readings: Mapping[str, Reading],
    *,
    steps: int = 1000,
) -> ValidityMap:
    """Make the map of what was read off the runs of ``plan_map``; ``readings`` maps their tags."""
    shape = (len(values), len(fills))
    level = {name: np.full(shape, np.nan) for name in SOLVERS}
    largest = {name: np.full(shape, np.nan) for name in SOLVERS}
    step_error = {name: np.full(shape, np.nan) for name in SCHEMES}
    reason = np.full(shape, "", dtype="<U80")
    planned = cells(throw, axis, fills, values, steps)
    for cell in planned:
        at = (cell.row, cell.column)
        found = {name: readings.get(tag(axis, cell, name), Reading(problem="not run")) for name in SOLVERS}
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
        band=_band(axis, planned, readings),
    )


def _band(axis: Axis, planned: Sequence[Cell], readings: Mapping[str, Reading]) -> FloatArray | None:
    tags = {(cell.row, cell.column): tag(axis, cell, LADDER[-1]) for cell in planned}
    levels = {name: reading.level for name, reading in readings.items()}
    if not all(twin_tag(name, kind) in levels for name in tags.values() for kind in KINDS):
        return None
    found = np.full((1 + max(row for row, _ in tags), 1 + max(column for _, column in tags)), np.nan)
    for at, name in tags.items():
        found[at] = band(name, levels)
    return found


def _shares(level: Mapping[str, FloatArray]) -> FloatArray:
    """Return the fair share of every rung, the step size first; together they lead from program to free flight."""
    of_sets = {switches: level[name] for switches, name in SETS.items()}
    return np.array([level[LADDER[1]] - level[LADDER[0]], *(fair_share(name, of_sets) for name in NAMES)])


def _read(made: Made) -> Reading:
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
