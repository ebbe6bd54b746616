"""Where does which assumption matter? The ladder from the published program to free flight over maps of throws.

The mapped error is the difference of the plateau, the mean of omega / omega_0 over the second half of the flight: it is
what the paper reads off a flight, and an average forgives a rebound that comes a little early. The largest difference
max |d omega| / omega_0 is kept beside it; a single impact that shifts in time saturates it.

An assumption's number on a map is its fair share, the mean over all orders of changing (``frame.shapley``): every
combination of assumptions is flown in every cell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from flipproof.chapters.solvers import FREE, LIMITS, SCHEMES
from flipproof.chapters.waterfall.study import STEP, mended
from flipproof.frame.equations import NAMES, canonical
from flipproof.frame.shapley import fair_shares
from flipproof.frame.solvers import Run, RunResult, make
from flipproof.frame.twins import band, twins
from ode_reference.models import LADDER as MODELS
from ode_reference.models import MODELS as EQUATIONS
from ode_reference.solver import RODS
from ode_reference.switches import Switches
from slicemodel import Scenario
from slicemodel.scenario import shortened
from slicemodel.trajectory import FloatArray

Axis = Literal["gamma", "step", "restitution"]

LADDER: Final = ("published-python", *MODELS)
"""From what was published to what is right; each differs from the next by one mistake."""

RUNGS: Final = (STEP, *NAMES.values())
"""The mistake between each entry of LADDER and the next, named as in the waterfall."""

SETS: Final = {
    switches: next(
        (name for name in MODELS if canonical(EQUATIONS[name].switches) == canonical(switches)),
        canonical(switches).name,
    )
    for switches in Switches.every()
}
"""Every set of assumptions mended -> the model that flies it, a rung of the ladder where there is one."""

EXTRA: Final = ("exact-step", RODS)
"""Beside the ladder: a scheme held against its own equation, and rods, water that cannot overlap.

Rods have no switches of the ladder: what they change is no fair share.
"""

SOLVERS: Final = tuple(dict.fromkeys((*LADDER, *EXTRA, *SETS.values())))
"""What flies every cell: two schemes, 40 models and rods."""

LABELS: Final[Mapping[Axis, str]] = {
    "gamma": "damping rate γ / ω₀ [1]",
    "step": "step ω₀ Δt [1]",
    "restitution": "restitution e [1]",
}

SLICES: Final = 50
"""Slices of every bottle on a map."""

POINTS: Final = 201
"""Output times of a model."""

NEGLIGIBLE: Final = 1e-4
"""Fair share, fraction of omega_0, below which none is named: what is left is round-off, or no matter."""

CURVE: Final = 101
"""Equal times at which two runs are compared."""


ROUGHLY: Final = {"rtol": 1e-9, "atol": 1e-11}
"""Tolerances of rods on a map: omega to 1e-9 omega_0, in half the time."""


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
    step_error : scheme -> array - error against the scheme's own equation, by plateau
    reason : array of str - "" or why the cell, or a part of it, could not be computed
    shares : array, shape (rungs, rows, columns)
        Fair share of every rung in the plateau, signed; they add up from the published program to free flight.
    thrown : (fill fraction, quantity along y) of the throw that the map varies
    band : array or None
        By how much twins move the plateau of free flight, the most sensitive equation; None if they were not flown.
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
    thrown: tuple[float, float]
    band: FloatArray | None = None

    @property
    def error(self) -> FloatArray:
        """Error of the published program against free flight in the plateau, fraction of omega_0."""
        return np.abs(self.level[LADDER[0]] - self.level[FREE])

    @property
    def overlap(self) -> FloatArray:
        """What overlap changes: plateau of free flight, whose slices overlap, minus that of rods."""
        return self.level[FREE] - self.level[RODS]

    @property
    def missing(self) -> NDArray[np.bool_]:
        """Whether any fair share is missing in a cell."""
        return np.asarray(~np.isfinite(self.shares).all(axis=0))

    @property
    def dominant(self) -> NDArray[np.int64]:
        """Index into RUNGS of the largest fair share; -1 where none is.

        None is where a share is missing, all are below ``NEGLIGIBLE``, or the next is nearer than free flight's band.
        """
        sizes = np.nan_to_num(np.abs(self.shares), nan=0.0)
        *_, second, first = np.sort(sizes, axis=0)
        unsure = first < NEGLIGIBLE
        if self.band is not None:
            unsure |= ~(first - second >= self.band)
        return np.where(self.missing | unsure, -1, sizes.argmax(axis=0))


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
    """Return fill fractions and values of a map of that many cells; "gamma" and "step" are spaced in equal ratios."""
    ends = {"gamma": (0.02, 1.0), "step": (0.002, 0.2), "restitution": (0.0, 1.0)}[axis]
    spaced: Callable[..., Any] = np.linspace if axis == "restitution" else np.geomspace
    return tuple(np.linspace(0.05, 1.0, columns).tolist()), tuple(spaced(*ends, rows).tolist())


def cells(
    throw: Scenario,
    axis: Axis,
    fills: Sequence[float],
    values: Sequence[float],
    steps: int = 1000,
    points: int | None = POINTS,
) -> Iterator[tuple[tuple[int, int], dict[str, Run]]]:
    """Yield row and column of every cell of a map, row by row, and the run that it has of every solver.

    A model does not know a step, nor rods the restitution: along that axis their runs of a fill fraction are one.
    ``steps`` is the grid of a scheme where the map does not say another, ``points`` are the output times of a model;
    None: its own.
    """
    usual = {} if points is None else {"times": np.linspace(0.0, throw.duration, points)}
    for (row, value), (column, fill) in product(enumerate(values), enumerate(fills)):
        damping, restitution = (value if axis == name else None for name in ("gamma", "restitution"))
        scenario = vary(throw, fill=fill, damping=damping, restitution=restitution)
        turn = abs(throw.omega0) * throw.duration
        scheme = {"steps": max(2, round(turn / value) + 1) if axis == "step" else steps, "store": "summary"}
        runs = {}
        for name in SOLVERS:
            thrown = replace(scenario, restitution=0.0) if name == RODS and axis == "restitution" else scenario
            label = f"map {axis}, row {row}, column {column}, {name}"
            settings = scheme if name in SCHEMES else usual | (ROUGHLY if name == RODS else {})
            runs[name] = Run(name, thrown, settings, label)
        yield (row, column), runs


def plan_map(
    throw: Scenario, axis: Axis, fills: Sequence[float], values: Sequence[float], *, banded: bool = False, **how: Any
) -> list[Run]:
    """Return the runs of one map, equal ones once; ``how`` as of ``cells``; ``banded`` gives free flight its twins."""
    runs: dict[Run, None] = {}
    for _, by_name in cells(throw, axis, fills, values, **how):
        for name, run in by_name.items():
            runs |= dict.fromkeys((run, *(twins(run) if banded and name == FREE else ())))
    return list(runs)


def make_readings(runs: Sequence[Run]) -> list[Reading]:
    """Make runs one after the other and return what a map needs of each."""
    return [read_flight(make(run)) for run in runs]


def study_readings(
    throw: Scenario,
    axis: Axis,
    fills: Sequence[float],
    values: Sequence[float],
    readings: Mapping[Run, Reading],
    **how: Any,
) -> ValidityMap:
    """Make the map of what was read off the runs of ``plan_map``, planned with the same arguments."""
    shape = (len(values), len(fills))
    level, largest = ({name: np.full(shape, np.nan) for name in SOLVERS} for _ in range(2))
    reason = np.full(shape, "", dtype="<U80")
    free: list[Run] = []
    for at, runs in cells(throw, axis, fills, values, **how):
        free.append(runs[FREE])
        cell = {name: readings.get(run, Reading(problem="not run")) for name, run in runs.items()}
        truth = cell[FREE].omega
        for name, reading in cell.items():
            level[name][at] = reading.level
            if truth is not None and reading.omega is not None:
                largest[name][at] = np.abs(reading.omega - truth).max() / abs(throw.omega0)
        problems = (f"{name}: {reading.problem}" for name, reading in cell.items() if reading.problem)
        reason[at] = shortened("; ".join(problems), 80)
    levels = {run: reading.level for run, reading in readings.items()}
    banded = all(member in levels for run in free for member in (run, *twins(run)))
    of_sets = {switches: level[name] for switches, name in SETS.items()}
    return ValidityMap(
        axis=axis,
        fills=np.asarray(fills, dtype=np.float64),
        values=np.asarray(values, dtype=np.float64),
        slices=throw.n_slices,
        level={name: level[name] for name in (*LADDER, *EXTRA)},
        largest={name: largest[name] for name in (*LADDER, *EXTRA)},
        step_error={scheme: np.abs(level[scheme] - level[LIMITS[scheme]]) for scheme in SCHEMES},
        reason=reason,
        shares=np.array(
            [level[LADDER[1]] - level[LADDER[0]], *fair_shares(NAMES, lambda names: of_sets[mended(names)]).values()]
        ),
        band=np.array([band(run, levels) for run in free]).reshape(shape) if banded else None,
        thrown=place_of(throw, axis, how.get("steps", 1000)),
    )


def place_of(throw: Scenario, axis: Axis, steps: int) -> tuple[float, float]:
    """Return the place of a throw, flown by schemes in ``steps`` points, on a map."""
    turn = abs(throw.omega0)
    values = {
        "gamma": throw.damping_rate / turn,
        "step": turn * throw.duration / (steps - 1),
        "restitution": throw.restitution,
    }
    return throw.fill_fraction, values[axis]


def read_flight(result: RunResult) -> Reading:
    """Return what a map needs of one run."""
    if result.problem:
        return Reading(problem=word(result.problem))
    flight = result.flight
    times = np.linspace(0.0, flight.scenario.duration, CURVE)
    return Reading(level=result.plateau, omega=np.interp(times, flight.t, flight.omega))


def word(reason: str) -> str:
    """Return the reason code that leads a failure's reason."""
    return reason.partition(":")[0] or "failed"
