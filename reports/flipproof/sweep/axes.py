"""What a sweep can vary: every field of a scenario and its bottle, and two quantities made of them.

A swept field is an axis: either choices, named one by one or spaced over a range, or a range that a Latin hypercube
cuts into equal shares.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any, Final, Literal

from flipproof.sweep.errors import SweepError, refuse, refuse_unknown
from slicemodel.scenario import Bottle, Scenario, not_whole, shortened

Kind = Literal["real", "whole", "truth"]
Value = float | int | bool

MAX_VALUES: Final = 1_000_000
"""Values of one axis at the most."""

FILL: Final = "fill_fraction"
"""M_w / M_max: sets ``water_mass``."""

DAMPING: Final = "damping_rate"
"""gamma = alpha / 2m [1/s]: sets ``drag``, after water and slices are known."""

INSTEAD: Final = MappingProxyType({FILL: "water_mass", DAMPING: "drag"})
"""Derived quantity -> the field that it sets."""


def _kinds() -> Mapping[str, Kind]:
    kinds: dict[str, Kind] = {f"bottle.{field.name}": "real" for field in fields(Bottle)}
    of_type: dict[type, Kind] = {bool: "truth", int: "whole", float: "real"}
    for field in fields(Scenario):
        value = getattr(Scenario(), field.name)
        if isinstance(value, tuple):
            kinds |= {f"{field.name}.{axis}": "real" for axis in "xy"}
        elif type(value) in of_type:
            kinds[field.name] = of_type[type(value)]
    return MappingProxyType(kinds | dict.fromkeys(INSTEAD, "real"))


KINDS: Final = _kinds()
"""Every field that a sweep can vary, and whether its values are real, whole or truth values."""


@dataclass(frozen=True, slots=True)
class Choices:
    """An axis of values named one by one."""

    name: str
    kind: Kind
    values: tuple[Value, ...]

    def at(self, share: float) -> Value:
        """Return the value at ``share`` in [0, 1): every value has an equal part of it."""
        return self.values[int(share * len(self.values))]


@dataclass(frozen=True, slots=True)
class Range:
    """An axis of all values from ``low`` to ``high``, spaced evenly or, if ``log``, in equal ratios."""

    name: str
    kind: Kind
    low: float
    high: float
    log: bool

    def at(self, share: float) -> Value:
        """Return the value at ``share`` in [0, 1], the ends exactly; whole numbers are rounded to the nearest."""
        if share in (0.0, 1.0):
            value = self.high if share else self.low
        elif self.log:
            value = math.exp(math.log(self.low) + (math.log(self.high) - math.log(self.low)) * share)
        else:
            value = self.low + (self.high - self.low) * share
        value = min(max(value, self.low), self.high)
        return round(value) if self.kind == "whole" else value


Axis = Choices | Range


def read_axes(table: Mapping[str, Any], where: str, *, grid: bool) -> tuple[Axis, ...]:
    """Read ``[sweep.fields]``, a mistake in which is named after ``where``; in a grid every axis becomes choices."""
    entries: dict[str, Any] = {}
    for name, given in table.items():
        # TOML reads bottle.length without quotes as a table in a table.
        inner = isinstance(given, Mapping) and any(kind.startswith(f"{name}.") for kind in KINDS)
        entries |= {f"{name}.{key}": value for key, value in given.items()} if inner else {name: given}
    if not entries:
        raise SweepError(f"{where} is empty; name at least one field, such as fill_fraction = [0.25, 0.5]")
    refuse_unknown(f"{where} key", entries, KINDS)
    for quantity, name in INSTEAD.items():
        if quantity in entries and name in entries:
            raise SweepError(f"{where}: {quantity} and {name} set the same thing; remove one of them")
    return tuple(_axis(name, given, f"{where} {name}", grid) for name, given in entries.items())


def _axis(name: str, given: object, where: str, grid: bool) -> Axis:
    kind = KINDS[name]
    if isinstance(given, list):
        return _distinct(Choices(name, kind, tuple(_value(value, kind, where) for value in given)), where)
    if not isinstance(given, Mapping) or kind == "truth":
        example = "[false, true]" if kind == "truth" else "[...] or {from = ..., to = ..., count = ...}"
        raise SweepError(f"{where} = {shortened(repr(given), 60)} is not a list of values; write {example}")
    keys = ("from", "to", "count", "scale") if grid else ("from", "to", "scale")
    if "count" in given and not grid:
        raise SweepError(f"{where}: count belongs to a grid; in a Latin hypercube [sweep] samples counts them all")
    refuse_unknown(f"{where} key", given, keys)
    missing = [key for key in keys[:-1] if key not in given]
    if missing:
        raise SweepError(f"{where} lacks {' and '.join(missing)}")
    low, high = (_value(given[key], kind, f"{where} {key}") for key in ("from", "to"))
    if not low < high:
        raise SweepError(f"{where}: from = {low!r} is not below to = {high!r}")
    scale = given.get("scale", "linear")
    refuse_unknown(f"{where} scale =", [scale], ("linear", "log"))
    if scale == "log" and not low > 0:
        raise SweepError(f"{where}: from = {low!r} is outside (0, inf), as scale = 'log' needs")
    axis = Range(name, kind, float(low), float(high), scale == "log")
    if not grid:
        return axis
    refuse(not_whole(f"{where} count", given["count"], 2, MAX_VALUES))
    last = given["count"] - 1
    return _distinct(Choices(name, kind, tuple(axis.at(k / last) for k in range(last + 1))), where)


def _value(given: object, kind: Kind, where: str) -> Value:
    if isinstance(given, bool):
        if kind == "truth":
            return given
    elif kind == "whole" and isinstance(given, int) and abs(given) < 2**63:  # it must have a place in the store
        return given
    elif kind == "real" and isinstance(given, int | float) and abs(given) <= sys.float_info.max:
        return float(given)
    words = {"truth": "true or false", "whole": "a whole number", "real": "a finite number"}[kind]
    raise SweepError(f"{where} = {shortened(repr(given), 60)} is not {words}")


def _distinct(axis: Choices, where: str) -> Choices:
    if not axis.values:
        raise SweepError(f"{where} = [] holds no value")
    if len(axis.values) > MAX_VALUES:
        raise SweepError(f"{where} holds {len(axis.values)} values, more than {MAX_VALUES}")
    seen: set[Value] = set()
    for value in axis.values:
        if value in seen:
            raise SweepError(f"{where} takes the value {value!r} twice")
        seen.add(value)
    return axis
