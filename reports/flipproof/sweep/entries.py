"""The solvers of a sweep, each with its settings, checked before the first point is made."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final

from flipproof.foreign.specs import content_of
from flipproof.frame.solvers import Solver, find, solve
from flipproof.sweep.errors import SweepError, refuse_unknown
from slicemodel.scenario import Scenario

PER_THROW: Final = {"times": "; [sweep] curves = 101 keeps omega(t) at 101 equal times", "speeds": ""}
"""Settings that suit a throw of one duration, or of one number of slices, and what to write in their place."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One ``[[solvers]]`` table: the solver's name, the settings it is called with, and where it stands in the file.

    ``content`` is the fingerprint of somebody else's solver, which may change under its name; empty for flipproof's.
    """

    name: str
    settings: Mapping[str, Any]
    where: str
    content: str = ""


def read_entries(tables: object, source: str) -> tuple[Entry, ...]:
    """Read the list of ``[[solvers]]``; a mistake is named with the number of its table, the solver and the key.

    A scheme's ``store`` is "summary" unless the file says "full": no observable needs the slices.
    """
    if not isinstance(tables, list) or not tables or not all(isinstance(table, Mapping) for table in tables):
        raise SweepError(f'{source}: has no [[solvers]]; write one table for each, such as [[solvers]] name = "eq8"')
    entries: list[Entry] = []
    for number, table in enumerate(tables, start=1):
        entry = _entry(dict(table), f"{source}: [[solvers]] {number}")
        if any((entry.name, entry.settings) == (earlier.name, earlier.settings) for earlier in entries):
            raise SweepError(f"{entry.where} is there twice with the same settings")
        entries.append(entry)
    return tuple(entries)


def _entry(table: dict[str, Any], where: str) -> Entry:
    name = table.pop("name", None)
    if name is None:
        raise SweepError(f"{where} lacks a name; 'flipproof models' lists solvers")
    if not isinstance(name, str):
        raise SweepError(f"{where} name = {name!r} is not a solver's name; 'flipproof models' lists them")
    try:
        solver = find(name)
        content = content_of(name)
    except ValueError as error:
        raise SweepError(f"{where}: {error}") from None
    where = f"{where} ({name})"
    settings, open_ended = _settings_of(solver)
    for key, instead in PER_THROW.items():
        if key in table:
            raise SweepError(f"{where} {key} belongs to one throw, not to a sweep{instead}")
    if not open_ended:
        refuse_unknown(f"{where} key", table, settings)
    for key, value in table.items():
        if not _plain(value):
            raise SweepError(f"{where} {key} = {value!r} is not a finite number, a word, true, false or a list of them")
    if solver.package == "slicemodel":
        table = {"store": "summary", **table}
    return Entry(name, table, where, content)


def _settings_of(solver: Solver) -> tuple[list[str], bool]:
    """Return the names of a solver's settings, and whether it takes others that only it can check."""
    parameters = inspect.signature(import_module(solver.package).solve).parameters.values()
    named = [p.name for p in parameters if p.kind is not p.VAR_KEYWORD and p.name not in ("scenario", solver.keyword)]
    return named, any(p.kind is p.VAR_KEYWORD for p in parameters)


def _plain(value: object) -> bool:
    if isinstance(value, list):
        return all(_plain(item) and not isinstance(item, list) for item in value)
    return isinstance(value, str | int) or (isinstance(value, float) and math.isfinite(value))


def try_entries(entries: tuple[Entry, ...]) -> None:
    """Throw one slice for a microsecond with every solver, so that a setting out of range is one line and not a sweep.

    That line, a SweepError, has the solver's own words.
    """
    for entry in entries:
        settings = dict(entry.settings)
        if isinstance(settings.get("steps"), int) and settings["steps"] > 2:  # the grid is only counted here
            settings["steps"] = 2
        try:
            solve(entry.name, Scenario(n_slices=1, duration=1e-6), **settings)
        except Exception as error:
            kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
            raise SweepError(f"{entry.where}: {kind}{error}") from None
