"""The tables of a sweep's file, and the checksum by which a row that was damaged is known.

A row's checksum is the CRC-32 of its other cells as SQLite gives them back, so that a byte that changed on the disk is
seen, and so that a row can be trusted wherever in a damaged file it is found.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

from flipproof.sweep.axes import column
from flipproof.sweep.design import Plan
from flipproof.sweep.work import CURVES, OUTCOMES

SCHEMA: Final = 2
"""Rises with every change of the tables: 2 brought the checksums."""

APPLICATION: Final = 0x464C4950
"""SQLite's ``application_id`` of a sweep's file ("FLIP")."""

PAGE: Final = 4096
"""Bytes of a page of the file."""

FILE: Final = "sweep.sqlite"

SHARED: Final = """
CREATE TABLE schema_version (version INTEGER NOT NULL);
CREATE TABLE design (
    code TEXT NOT NULL,     -- version and fingerprint of the code that makes the points
    size INTEGER NOT NULL,  -- points of the whole design
    facts TEXT NOT NULL,    -- JSON: what tells this design from another
    source TEXT NOT NULL,   -- the file as it was given
    checksum TEXT NOT NULL  -- CRC-32 of the other cells
);
CREATE TABLE versions (
    id INTEGER PRIMARY KEY,
    facts TEXT NOT NULL UNIQUE,  -- JSON: versions and machine of a worker
    checksum TEXT NOT NULL       -- CRC-32 of the facts
);
"""


def _points(design: Plan) -> Iterator[tuple[str, str, str, str]]:
    """Yield name, SQLite type, rules and meaning of every column of the table of points, one for each swept field."""
    yield "number", "INTEGER", " PRIMARY KEY", "place in the design, from 0"
    yield "key", "TEXT", " NOT NULL UNIQUE", "SHA-256 of parameters and code"
    for axis in design.axes:
        yield column(axis.name), "REAL" if axis.kind == "real" else "INTEGER", " NOT NULL", "value of a swept field"
    yield "solver", "TEXT", " NOT NULL", "its name, or land"
    yield "settings", "TEXT", " NOT NULL", "JSON"
    for name, kind in design.readings.items():
        yield name, kind, f" CHECK (typeof({name}) IN ('{kind.lower()}', 'null'))", "what the point gave, in SI"
    statuses = ", ".join(f"'{status}'" for status in OUTCOMES)
    yield "status", "TEXT", f" NOT NULL CHECK (status IN ({statuses}))", "what became of the point"
    yield "message", "TEXT", " NOT NULL", "the solver's own"
    yield "reason", "TEXT", " NOT NULL", "why a number is NULL"
    yield "seconds", "REAL", " NOT NULL", "what the point took [s]"
    yield "trajectory", "TEXT", "", "file of the flight, if it was kept"
    if design.curves:
        yield "curves", "BLOB", "", f"float64, little-endian: {', '.join(CURVES)}"
    yield "versions", "INTEGER", " NOT NULL REFERENCES versions (id)", "what made the row"
    yield "parameters", "TEXT", " NOT NULL", "JSON: enough to make this row again alone"
    yield "checksum", "TEXT", " NOT NULL", "CRC-32 of the other cells"


def points_table(design: Plan) -> str:
    """Return the statements that make the table of points."""
    lines = "".join(f"    {name} {kind}{rules},  -- {meaning}\n" for name, kind, rules, meaning in _points(design))
    known = " AND ".join(f"{name} IS NOT NULL" for name in design.readings)
    return f"""
CREATE TABLE points (
{lines}    CHECK (reason <> '' OR ({known}))
);
CREATE INDEX points_by_solver ON points (solver, status);
"""


def columns(design: Plan) -> dict[str, str]:
    """Return the columns of the table of points, in order, and the SQLite type of each."""
    return {name: kind for name, kind, *_ in _points(design)}


# SQLite keeps a negative zero as zero, and a real number without a fraction as an integer.
AS_STORED: Final[Mapping[str, Callable[[Any], Any]]] = MappingProxyType(
    {"REAL": lambda cell: float(cell) + 0.0, "INTEGER": int, "TEXT": str, "BLOB": bytes}
)


def as_stored(cells: Sequence[Any], types: Sequence[str]) -> tuple[Any, ...]:
    """Return cells as SQLite gives them back from columns of these types.

    A cell that is not of its type raises ValueError, TypeError or OverflowError.
    """
    return tuple(None if cell is None else AS_STORED[kind](cell) for cell, kind in zip(cells, types, strict=True))


def checksum(cells: Sequence[Any], types: Sequence[str]) -> str:
    """Return the CRC-32 of cells of these types as eight hexadecimal digits; raise as ``as_stored``."""
    stored = [zlib.crc32(cell) if isinstance(cell, bytes) else cell for cell in as_stored(cells, types)]
    return f"{zlib.crc32(ascii(stored).encode()):08x}"


def intact(cells: Sequence[Any], types: Sequence[str]) -> bool:
    """Return whether cells, the last of which is the checksum of the others, are what was written."""
    try:
        return bool(checksum(cells[:-1], types[:-1]) == cells[-1])
    except (ValueError, TypeError, OverflowError):
        return False
