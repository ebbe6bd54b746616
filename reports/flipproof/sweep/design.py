"""A sweep's file, and its points by number.

::

    [scenario] and [bottle]     the throw that every point begins from, as in a scenario file; both optional

    [sweep]
    design = "grid"             every combination; or "latin-hypercube"
    samples = 200               points of a Latin hypercube for each solver
    seed = 1                    its seed (default 0)
    curves = 101                keep omega, theta, r_CM and v_CM at so many equal times in the row (default 0: none)

    [sweep.fields]
    fill_fraction = [0.25, 0.5, 0.75]
    bottle.length = {from = 0.2, to = 0.3, count = 5}
    damping_rate = {from = 0.1, to = 100.0, count = 4, scale = "log"}

    [[solvers]]
    name = "eq8"
    rest_speed = 1e-6

A field is set as it stands: sweeping ``n_slices`` alone leaves the drag of a slice, so that alpha/2m changes with it.
``damping_rate`` (alpha/2m) holds that, and ``fill_fraction`` sets the water from the capacity; one value is a list too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from flipproof.sweep.axes import DAMPING, FILL, Axis, Choices, Range, Value, read_axes
from flipproof.sweep.entries import Entry, read_entries
from flipproof.sweep.errors import SweepError, refuse, refuse_unknown
from flipproof.sweep.work import FLIGHTS, Point
from slicemodel.scenario import Scenario, ScenarioError, not_whole, read_toml, stray_key
from slicemodel.trajectory import FloatArray

MAX_POINTS: Final = 1_000_000
"""Points of a sweep at the most, all solvers together: a minute of bookkeeping, 100 MB of memory, 250 MB of rows."""

GRID: Final = "grid"
LATIN: Final = "latin-hypercube"


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Every point of a sweep, made when asked for: solver by solver, in each the last field running fastest.

    Parameters
    ----------
    base : {"bottle": {...}, "scenario": {...}} - the throw that the swept fields change
    shares : (samples, axes) or None - places in a Latin hypercube, in [0, 1); None for a grid
    curves : int - points of the curves that every row keeps; 0: none
    """

    base: Mapping[str, Mapping[str, Any]]
    axes: tuple[Axis, ...]
    entries: tuple[Entry, ...]
    shares: FloatArray | None
    curves: int

    @property
    def throws(self) -> int:
        """Throws of every solver."""
        if self.shares is not None:
            return len(self.shares)
        return math.prod(len(axis.values) for axis in self.axes if isinstance(axis, Choices))

    @property
    def size(self) -> int:
        """Points of all solvers."""
        return self.throws * len(self.entries)

    def points(self) -> Iterator[Point]:
        """Yield every point, possible or not."""
        options = {"curves": self.curves} if self.curves else {}
        for entry in self.entries:
            for values in self.values():
                yield Point(entry.name, self._throw(values), entry.settings, FLIGHTS, options, entry.content)

    def swept(self) -> Iterator[dict[str, Value]]:
        """Yield the values of the swept fields of every point, by their names."""
        names = [axis.name for axis in self.axes]
        for _ in self.entries:
            yield from (dict(zip(names, values, strict=True)) for values in self.values())

    def values(self) -> Iterator[tuple[Value, ...]]:
        """Yield the values of the swept fields of every throw, in the order of the axes."""
        return map(self._values, range(self.throws))

    def _values(self, place: int) -> tuple[Value, ...]:
        if self.shares is not None:
            return tuple(axis.at(float(share)) for axis, share in zip(self.axes, self.shares[place], strict=True))
        values: list[Value] = []
        for axis in reversed(self.axes):
            assert isinstance(axis, Choices)
            place, k = divmod(place, len(axis.values))
            values.append(axis.values[k])
        return tuple(reversed(values))

    def _throw(self, values: tuple[Value, ...]) -> dict[str, dict[str, Any]]:
        bottle, scenario = dict(self.base["bottle"]), dict(self.base["scenario"])
        scenario["launch_velocity"] = list(scenario["launch_velocity"])
        given = {axis.name: value for axis, value in zip(self.axes, values, strict=True)}
        for name, value in given.items():
            table, _, inner = name.partition(".")
            if table == "bottle":
                bottle[inner] = value
            elif inner:
                scenario[table]["xy".index(inner)] = value
            elif name not in (FILL, DAMPING):
                scenario[name] = value
        if FILL in given:
            scenario["water_mass"] = given[FILL] * bottle["capacity"]
        if DAMPING in given:
            slices = scenario["n_slices"]
            # A throw without slices is refused for that, not for its drag.
            scenario["drag"] = 2.0 * given[DAMPING] * scenario["water_mass"] / slices if slices else 0.0
        return {"bottle": bottle, "scenario": scenario}


def read_design(path: Path) -> Design:
    """Read a sweep's file; a SweepError names file, table, key, value, and what is admissible or nearest."""
    try:
        document, _ = read_toml(path, 2**25)  # a million values with all their digits
    except ScenarioError as error:
        raise SweepError(str(error)) from None
    return design_of(document, str(path))


def design_of(document: Mapping[str, Any], source: str) -> Design:
    """Build a design from what its file holds; errors name ``source``."""
    tables = ("scenario", "bottle", "sweep", "solvers")
    problem = stray_key(document, tables)
    refuse(problem and f"{source}: {problem}")
    refuse_unknown(f"{source}: table", document, tables)
    table = document.get("sweep")
    if not isinstance(table, Mapping):
        raise SweepError(f'{source}: has no table [sweep]; write at least [sweep] design = "grid"')
    where = f"{source}: [sweep]"
    refuse_unknown(f"{where} key", table, ("design", "samples", "seed", "curves", "fields"))
    kind = table.get("design")
    refuse_unknown(f"{where} design =", [kind], (GRID, LATIN))
    curves = table.get("curves", 0)
    problem = not_whole(f"{where} curves", curves, 2, 10_000) if curves != 0 or isinstance(curves, bool) else ""
    refuse(problem and f"{problem}, or 0 for none")
    fields = table.get("fields")
    if not isinstance(fields, Mapping):
        raise SweepError(f"{source}: has no table [sweep.fields]; it names the fields to vary")
    axes = read_axes(fields, f"{source}: [sweep.fields]", grid=kind == GRID)
    entries = read_entries(document.get("solvers"), source)
    shares = _shares(table, where, axes, grid=kind == GRID)
    design = Design(
        base=_base(document, source, axes),
        axes=axes,
        entries=entries,
        shares=shares,
        curves=int(curves),
    )
    if design.size > MAX_POINTS:
        raise SweepError(
            f"{source}: {design.throws} throws by {len(entries)} solvers make {design.size} points, more than "
            f"{MAX_POINTS}; take fewer values, or a Latin hypercube"
        )
    return design


def _shares(table: Mapping[str, Any], where: str, axes: tuple[Axis, ...], *, grid: bool) -> FloatArray | None:
    """Return the places of a Latin hypercube, None for a grid."""
    if grid:
        for key in ("samples", "seed"):
            if key in table:
                raise SweepError(f'{where} {key} = {table[key]!r} belongs to design = "{LATIN}", not to a grid')
        return None
    if "samples" not in table:
        raise SweepError(f"{where} lacks samples: how many throws the Latin hypercube has")
    samples: Any = table["samples"]
    seed = table.get("seed", 0)
    refuse(not_whole(f"{where} samples", samples, 1, MAX_POINTS) or not_whole(f"{where} seed", seed, 0, 2**63 - 1))
    if not any(isinstance(axis, Range) and axis.kind == "real" for axis in axes):
        raise SweepError(
            f'{where} design = "{LATIN}" needs a field {{from = ..., to = ...}} of real numbers in [sweep.fields]; '
            "without one its throws would repeat themselves: take a grid"
        )
    return latin_shares(samples, len(axes), seed)


def _base(document: Mapping[str, Any], source: str, axes: tuple[Axis, ...]) -> Mapping[str, Mapping[str, Any]]:
    tables = {name: document[name] for name in ("scenario", "bottle") if name in document}
    scenario, bottle = tables.get("scenario", {}), tables.get("bottle", {})
    capacity = bottle.get("capacity", 1.0) if isinstance(bottle, Mapping) else 1.0
    swept = {axis.name for axis in axes} & {FILL, "water_mass"}
    if swept and isinstance(capacity, int | float) and isinstance(scenario, Mapping):
        # The water is set by every point; the base's own must not be what is refused.
        tables["scenario"] = {**scenario, "water_mass": capacity / 2}
    elif "bottle.capacity" in {axis.name for axis in axes} and isinstance(bottle, Mapping):
        # So is the capacity; whether the water fits is said of every point.
        water = scenario.get("water_mass", 0.5) if isinstance(scenario, Mapping) else 0.5
        if isinstance(water, int | float) and isinstance(capacity, int | float) and water > capacity > 0:
            tables["bottle"] = {**bottle, "capacity": water}
    try:
        return Scenario.from_mapping(tables, source=source).to_mapping()
    except ScenarioError as error:
        raise SweepError(str(error)) from None


def latin_shares(samples: int, axes: int, seed: int) -> FloatArray:
    """Return a Latin hypercube: shape (samples, axes), in every column one number in each of ``samples`` equal parts.

    It is made of the raw bits of PCG64, which NumPy promises to keep, and not of its distributions, which it does not:
    a sweep begun under one version of NumPy goes on under another.
    """
    bits = np.random.PCG64(np.random.SeedSequence(seed))
    shares = np.empty((samples, axes))
    for axis in range(axes):
        part = np.argsort(bits.random_raw(samples), kind="stable")
        within = (bits.random_raw(samples) >> np.uint64(11)) * 2.0**-53
        shares[:, axis] = (part + within) / samples
    return np.minimum(shares, np.nextafter(1.0, 0.0))
