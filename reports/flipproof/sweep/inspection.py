"""What is wrong with a sweep's file: asked before anything is written to it."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

from flipproof.sweep.design import Plan
from flipproof.sweep.errors import SweepError
from flipproof.sweep.schema import APPLICATION, SCHEMA, columns, intact
from slicemodel.scenario import shortened


def inspect(file: Path, design: Plan, code: str, patience: float) -> None:
    """Read a sweep's file through and refuse it unless every row is as it was written, of this design and this code.

    A SweepError names the file and what is wrong with it; if another program holds the file for more than ``patience``
    seconds, that is an sqlite3.Error.
    """
    try:
        if file.is_dir():
            raise SweepError(f"{file} is a folder, where a sweep keeps its rows in a file; name another --out")
        if file.exists() and not file.is_file():
            raise SweepError(f"{file} is a pipe or a device, not a file; name another --out")
        with file.open("rb") as opened:
            beginning = opened.read(16)
    except OSError as error:
        raise SweepError(
            f"{file} cannot be read ({error.strerror or error}), so that it is not known what it holds; it is as it was"
        ) from None
    if not beginning:
        wrong = "it is empty (0 bytes)"
    elif beginning != b"SQLite format 3\0":
        wrong = "it does not begin as an SQLite file does"
    else:
        try:
            # Read-only: closing the last connection that may write would change the file.
            with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True, timeout=patience)) as rows:
                wrong = _wrong(file, rows, design, code)
        except sqlite3.Error as error:
            if result_code(error) in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
                raise
            wrong = str(error)
        except UnicodeDecodeError:  # raised in place of SQLite's error, which quotes what it cannot read
            wrong = "its schema is no text"
    if wrong:
        raise damage(file, wrong)


def damage(file: Path, wrong: str) -> SweepError:
    """Return the error that says what is wrong with a file."""
    advice = "name another --out to make its rows again; docs/sweeps.md says how sqlite3 copies those that can be read"
    return SweepError(f"{file} is damaged ({shortened(wrong, 120)}); {advice}")


def is_damage(error: Exception) -> bool:
    """Return whether SQLite says by an error that its file is damaged, and not that it cannot write there."""
    return result_code(error) in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def result_code(error: Exception) -> int:
    """Return SQLite's primary result code of an error."""
    return int(getattr(error, "sqlite_errorcode", 0)) & 0xFF


def _wrong(file: Path, connection: sqlite3.Connection, design: Plan, code: str) -> str:
    """Return what is damaged, or nothing; raise if the file is whole and something else than this sweep."""
    connection.text_factory = lambda text: text.decode("utf-8", "surrogateescape")
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    there = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    missing = sorted({"schema_version", "design", "versions", "points"} - there)
    if missing and application != APPLICATION and there:
        raise SweepError(f"{file} is a database, but no sweep; name another --out")
    if missing:
        return f"its table {missing[0]} is missing"
    (problem,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    if problem != "ok":
        return f"SQLite finds: {problem.replace('*** in database main ***', '')}"
    schemas = [version for (version,) in connection.execute("SELECT version FROM schema_version")]
    if len(schemas) != 1:
        return f"its table schema_version has {len(schemas)} rows instead of 1"
    if schemas[0] != SCHEMA:
        began = connection.execute("SELECT code FROM design").fetchone() or ("another version",)
        raise SweepError(
            f"{file} has schema {schemas[0]}; this flipproof reads schema {SCHEMA}: go on with the flipproof that "
            f"began it ({began[0]}), or name another --out"
        )
    if application != APPLICATION:
        return f"its application id is {application} instead of {APPLICATION}"
    return _wrong_design(file, connection, design, code) or _wrong_rows(connection, design)


def _wrong_design(file: Path, connection: sqlite3.Connection, design: Plan, code: str) -> str:
    found = connection.execute("SELECT code, size, facts, source, checksum FROM design").fetchall()
    if len(found) != 1:
        return f"its table design has {len(found)} rows instead of 1"
    if not intact(found[0], ("TEXT", "INTEGER", "TEXT", "TEXT", "TEXT")):
        return "its design does not match its checksum"
    began, _, facts, *_ = found[0]
    there, here = json.loads(facts), json.loads(json.dumps(design.facts()))
    difference = _difference({**there, "contents": None}, {**here, "contents": None})
    if difference:
        raise SweepError(f"{file.parent} holds another design ({difference}); name another --out")
    if began != code:
        raise SweepError(
            f"{file.parent} was begun by flipproof {began}, this is {code}; go on with that one, or name another "
            "--out: one sweep, one code"
        )
    for solver, content in here.get("contents", {}).items():
        if content != there.get("contents", {}).get(solver):
            raise SweepError(
                f"{file.parent} was begun with other code of {solver}; go on with the files as they were, or name "
                "another --out: one sweep, one code"
            )
    return ""


def _wrong_rows(connection: sqlite3.Connection, design: Plan) -> str:
    types, names = list(columns(design).values()), list(columns(design))
    known = {number: (facts, sum_) for number, facts, sum_ in connection.execute("SELECT * FROM versions")}
    for number, cells in known.items():
        if not intact(cells, ("TEXT", "TEXT")):
            return f"row {number} of its table versions does not match its checksum"
    place, total, first, broken = names.index("versions"), 0, None, 0
    for row in connection.execute(f"SELECT {', '.join(names)} FROM points"):
        total += 1
        if not 0 <= row[0] < design.size:
            return f"it has a row with the number {row[0]}, outside [0, {design.size - 1}]"
        if not intact(row, types):
            first, broken = row[0] if first is None else first, broken + 1
        elif row[place] not in known:
            return f"row {row[0]} refers to row {row[place]} of its table versions, which is missing"
    if broken:
        return f"{broken} of its {total} rows do not match their checksums, the first has the number {first}"
    # Versions are written with the rows that refer to them.
    return "its table points is empty, though rows were written" if known and not total else ""


def _difference(there: Any, here: Any, name: str = "") -> str:
    """Return the first thing in which two designs differ, or nothing."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in {**there, **here}:
            found = _difference(there.get(key), here.get(key), f"{name}.{key}" if name else key)
            if found:
                return found
        return ""
    if there == here:
        return ""
    one, other = (shortened(json.dumps(value), 40) for value in (there, here))
    return f"{name} is {one} there and {other} here"
