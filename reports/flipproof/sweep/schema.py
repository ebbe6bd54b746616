"""The tables of a sweep's file, and the checksum by which a row that was damaged is known.

A row's checksum is the CRC-32 of its other cells as SQLite gives them back, so that a byte that changed on the disk is
seen, and so that a row can be trusted wherever in a damaged file it is found.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
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

TYPES: Final = MappingProxyType({"real": "REAL", "whole": "INTEGER", "truth": "INTEGER"})

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


def points_table(design: Plan) -> str:
    """Return the statements that make the table of points, with a column for every swept field."""
    swept = "".join(f"    {column(axis.name)} {TYPES[axis.kind]} NOT NULL,\n" for axis in design.axes)
    readings = "".join(
        f"    {name} {kind} CHECK (typeof({name}) IN ('{kind.lower()}', 'null')),\n"
        for name, kind in design.readings.items()
    )
    known = " AND ".join(f"{name} IS NOT NULL" for name in design.readings)
    statuses = ", ".join(f"'{status}'" for status in OUTCOMES)
    curves = f"    curves BLOB,  -- float64, little-endian: {', '.join(CURVES)}\n" if design.curves else ""
    return f"""
CREATE TABLE points (
    number INTEGER PRIMARY KEY,  -- place in the design, from 0
    key TEXT NOT NULL UNIQUE,    -- SHA-256 of parameters and code
{swept}    solver TEXT NOT NULL,
    settings TEXT NOT NULL,      -- JSON
{readings}    status TEXT NOT NULL CHECK (status IN ({statuses})),
    message TEXT NOT NULL,
    reason TEXT NOT NULL,        -- why a number is NULL
    seconds REAL NOT NULL,
    trajectory TEXT,             -- file of the flight, if it was kept
{curves}    versions INTEGER NOT NULL REFERENCES versions (id),
    parameters TEXT NOT NULL,    -- JSON: enough to make this row again alone
    checksum TEXT NOT NULL,      -- CRC-32 of the other cells
    CHECK (reason <> '' OR ({known}))
);
CREATE INDEX points_by_solver ON points (solver, status);
"""


def columns(design: Plan) -> tuple[str, ...]:
    """Return the columns of the table of points, in order."""
    swept = (column(axis.name) for axis in design.axes)
    kept = ("trajectory", "curves") if design.curves else ("trajectory",)
    told = ("status", "message", "reason", "seconds", *kept, "versions", "parameters", "checksum")
    return ("number", "key", *swept, "solver", "settings", *design.readings, *told)


def kinds(design: Plan) -> tuple[str, ...]:
    """Return the SQLite type of every column of the table of points."""
    types = {column(axis.name): TYPES[axis.kind] for axis in design.axes}
    types |= {**design.readings, "seconds": "REAL", "curves": "BLOB"}
    types |= dict.fromkeys(("number", "versions"), "INTEGER")
    return tuple(types.get(name, "TEXT") for name in columns(design))


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
