"""A sweep's file, and its points by number.

::

    [scenario] and [bottle]     the throw that every point begins from, as in a scenario file; both optional

    [sweep]
    design = "grid"             every combination; or "latin-hypercube"
    samples = 200               points of a Latin hypercube for each solver
    seed = 1                    its seed (default 0)
    trajectories = false        true: keep every flight as NPZ
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

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from flipproof.sweep.axes import DAMPING, FILL, Axis, Choices, Range, Value, read_axes
from flipproof.sweep.entries import Entry, as_json, read_entries
from flipproof.sweep.errors import SweepError, refuse, refuse_unknown
from slicemodel.scenario import Bottle, Scenario, ScenarioError, not_whole, read_toml
from slicemodel.trajectory import FloatArray

if TYPE_CHECKING:
    from flipproof.landing.design import Throws

MOST_POINTS: Final = 1_000_000
"""Points of a sweep at the most, all solvers together: a minute of bookkeeping, 100 MB of memory, 620 MB of rows."""

GRID: Final = "grid"
LATIN: Final = "latin-hypercube"
FLIGHT: Final = MappingProxyType(
    dict.fromkeys(("plateau", "omega_end", "theta_end", "r_cm_end", "t_end"), "REAL") | {"impacts": "INTEGER"}
)
"""What a row holds of a flight -> its SQLite type."""


@dataclass(frozen=True)
class Point:
    """One throw by one solver; without slots, whose pickling by ``dataclass`` takes three times as long.

    Parameters
    ----------
    number : int - place in the design, from 0
    values : values of the swept fields, in the order of the axes
    throw : {"bottle": {...}, "scenario": {...}} - every field, possible or not
    settings : mapping - what the solver is called with
    content : str - fingerprint of somebody else's solver; empty for flipproof's own
    """

    number: int
    values: tuple[Value, ...]
    throw: Mapping[str, Mapping[str, Any]]
    solver: str
    settings: Mapping[str, Any]
    content: str = ""

    def scenario(self) -> Scenario:
        """Return the throw; raise ScenarioError if no bottle can be thrown so."""
        fields = dict(self.throw["scenario"])
        return Scenario(
            bottle=Bottle(**self.throw["bottle"]), **fields | {"launch_velocity": tuple(fields["launch_velocity"])}
        )

    def parameters(self) -> dict[str, Any]:
        """Return all that makes this point; ``from_parameters`` reads it back to the last bit."""
        content = {"content": self.content} if self.content else {}
        return {**self.throw, "solver": self.solver, "settings": self.settings, **content}

    def key(self, code: str) -> str:
        """Return the key of this point as made by the code."""
        return key_of(as_json(self.parameters()), code)


def key_of(text: str, code: str) -> str:
    """Return the SHA-256 of a point's parameters as JSON, and of the code that makes the point."""
    return hashlib.sha256(f"{code}\n{text}".encode()).hexdigest()


def from_parameters(text: str) -> Point:
    """Return the point that a row's ``parameters`` describe, so that it can be made again alone."""
    stated = json.loads(text)
    throw = {"bottle": stated["bottle"], "scenario": stated["scenario"]}
    return Point(0, (), throw, stated["solver"], stated["settings"], stated.get("content", ""))


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Every point of a sweep, made when asked for: solver by solver, in each the last field running fastest.

    Parameters
    ----------
    text : str - the file it was read from
    base : {"bottle": {...}, "scenario": {...}} - the throw that the swept fields change
    shares : (samples, axes) or None - places in a Latin hypercube, in [0, 1); None for a grid
    curves : int - points of the curves that every row keeps; 0: none
    """

    text: str
    base: Mapping[str, Mapping[str, Any]]
    axes: tuple[Axis, ...]
    entries: tuple[Entry, ...]
    shares: FloatArray | None
    seed: int | None
    trajectories: bool
    curves: int

    readings = FLIGHT

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

    @property
    def lines(self) -> tuple[range, ...]:
        """Numbers of the points of each solver: a worker that has compiled a solver gets more of it."""
        return tuple(range(k * self.throws, (k + 1) * self.throws) for k in range(len(self.entries)))

    def point(self, number: int) -> Point:
        """Return the point of that number in [0, size)."""
        which, place = divmod(number, self.throws)
        entry, values = self.entries[which], self._values(place)
        return Point(number, values, self._throw(values), entry.name, entry.settings, entry.content)

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

    def facts(self) -> dict[str, Any]:
        """Return what tells this design from another; comments and spelling do not."""
        contents = {entry.name: entry.content for entry in self.entries if entry.content}
        return {
            **self.base,
            "design": GRID if self.shares is None else LATIN,
            "samples": None if self.shares is None else len(self.shares),
            "seed": self.seed,
            "trajectories": self.trajectories,
            **({"curves": self.curves} if self.curves else {}),
            "fields": {axis.name: axis.facts() for axis in self.axes},
            "order of fields": [axis.name for axis in self.axes],
            "solvers": [{"name": entry.name, **entry.settings} for entry in self.entries],
            **({"contents": contents} if contents else {}),
        }


Plan: TypeAlias = "Design | Throws"
"""What a store and the loop of a sweep work on: a design of flights, or one of landings."""


def read_design(path: Path) -> Design:
    """Read a sweep's file; a SweepError names file, table, key, value, and what is admissible or nearest."""
    try:
        document, text = read_toml(path, 2**25)  # a million values with all their digits
    except ScenarioError as error:
        raise SweepError(str(error)) from None
    return design_of(document, str(path), text)


def design_of(document: Mapping[str, Any], source: str, text: str = "") -> Design:
    """Build a design from what its file holds; errors name ``source``."""
    refuse_unknown(f"{source}: table", document, ("scenario", "bottle", "sweep", "solvers"))
    table = document.get("sweep")
    if not isinstance(table, Mapping):
        raise SweepError(f'{source}: has no table [sweep]; write at least [sweep] design = "grid"')
    where = f"{source}: [sweep]"
    refuse_unknown(f"{where} key", table, ("design", "samples", "seed", "trajectories", "curves", "fields"))
    kind = table.get("design")
    refuse_unknown(f"{where} design =", [kind], (GRID, LATIN))
    trajectories = table.get("trajectories", False)
    if not isinstance(trajectories, bool):
        raise SweepError(f"{where} trajectories = {trajectories!r} is neither true nor false")
    curves = table.get("curves", 0)
    problem = not_whole(f"{where} curves", curves, 2, 10_000) if curves != 0 or isinstance(curves, bool) else ""
    refuse(problem and f"{problem}, or 0 for none")
    fields = table.get("fields")
    if not isinstance(fields, Mapping):
        raise SweepError(f"{source}: has no table [sweep.fields]; it names the fields to vary")
    axes = read_axes(fields, f"{source}: [sweep.fields]", grid=kind == GRID)
    entries = read_entries(document.get("solvers"), source)
    shares, seed = _shares(table, where, axes, grid=kind == GRID)
    design = Design(
        text=text,
        base=_base(document, source, axes),
        axes=axes,
        entries=entries,
        shares=shares,
        seed=seed,
        trajectories=trajectories,
        curves=int(curves),
    )
    if design.size > MOST_POINTS:
        raise SweepError(
            f"{source}: {design.throws} throws by {len(entries)} solvers make {design.size} points, more than "
            f"{MOST_POINTS}; take fewer values, or a Latin hypercube"
        )
    return design


def _shares(
    table: Mapping[str, Any], where: str, axes: tuple[Axis, ...], *, grid: bool
) -> tuple[FloatArray | None, int | None]:
    """Return places and seed of a Latin hypercube, None and None for a grid."""
    if grid:
        for key in ("samples", "seed"):
            if key in table:
                raise SweepError(f'{where} {key} = {table[key]!r} belongs to design = "{LATIN}", not to a grid')
        return None, None
    samples: Any = table.get("samples")
    seed = table.get("seed", 0)
    refuse(not_whole(f"{where} samples", samples, 1, MOST_POINTS) or not_whole(f"{where} seed", seed, 0, 2**63 - 1))
    if not any(isinstance(axis, Range) and axis.kind == "real" for axis in axes):
        raise SweepError(
            f'{where} design = "{LATIN}" needs a field {{from = ..., to = ...}} of real numbers in [sweep.fields]; '
            "without one its throws would repeat themselves: take a grid"
        )
    return latin_shares(samples, len(axes), seed), seed


def _base(document: Mapping[str, Any], source: str, axes: tuple[Axis, ...]) -> Mapping[str, Mapping[str, Any]]:
    tables = {name: document[name] for name in ("scenario", "bottle") if name in document}
    scenario, bottle = tables.get("scenario", {}), tables.get("bottle", {})
    capacity = bottle.get("capacity", 1.0) if isinstance(bottle, Mapping) else 1.0
    swept = {axis.name for axis in axes} & {FILL, "water_mass"}
    if swept and isinstance(capacity, int | float) and isinstance(scenario, Mapping):
        # The water is set by every point; the base's own must not be what is refused.
        tables["scenario"] = {**scenario, "water_mass": capacity / 2}
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
