"""A sweep's rows in one SQLite file, and its flights in a folder beside it. One program writes; anyone may read.

::

    DIR/sweep.sqlite          schema_version, design, versions, points
    DIR/trajectories/3f/...   one NPZ for each kept flight, named by its point's key
    DIR/.flipproof            says that the folder is flipproof's own
    DIR/sweep.lock            held by the program that writes; it ends with that program, however it dies

A number that is not known is NULL, and the row's ``reason`` says why: SQLite has no NaN, and the schema refuses a row
with a missing number and no reason. Floats come back to the last bit, but for the sign of a negative zero. A flight is
in its place before its row is written.

- ``journal_mode = WAL``: readers see the last transaction while this program writes the next.
- ``synchronous = NORMAL``: a killed program loses nothing that it committed; a power failure may lose the last
  transactions, whose points are then made again, but never breaks the file. FULL would wait for the disk at each.
- busy timeout 10 s: a reader or a backup that holds the file for a moment must not end a sweep.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np

from reports.ownership import MARKER, OutputError, check_own, marker_text, sole_writer
from reports.sweep.axes import column
from reports.sweep.design import Design
from reports.sweep.entries import settings_text
from reports.sweep.errors import SweepError
from reports.sweep.files import TEMPORARY, sweep_away_parts, whole_file, write_whole
from reports.sweep.work import CURVES, OUTCOMES, Outcome, Returned
from slicemodel.trajectory import FloatArray

SCHEMA: Final = 1
FILE: Final = "sweep.sqlite"
LOCK: Final = "sweep.lock"
KIND: Final = "sweep"
FLIGHTS: Final = "trajectories"
BUSY: Final = 10.0
"""Seconds to wait for somebody who holds the file."""

NUMBERS: Final = ("plateau", "omega_end", "theta_end", "r_cm_end", "t_end")
TYPES: Final = {"real": "REAL", "whole": "INTEGER", "truth": "INTEGER"}

SHARED: Final = """
CREATE TABLE schema_version (version INTEGER NOT NULL);
CREATE TABLE design (
    code TEXT NOT NULL,     -- version and fingerprint of the code that makes the points
    size INTEGER NOT NULL,  -- points of the whole design
    facts TEXT NOT NULL,    -- JSON: what tells this design from another
    source TEXT NOT NULL    -- the file as it was given
);
CREATE TABLE versions (
    id INTEGER PRIMARY KEY,
    facts TEXT NOT NULL UNIQUE  -- JSON: versions and machine of a worker
);
"""


def points_table(design: Design) -> str:
    """Return the statements that make the table of points, with a column for every swept field."""
    swept = "".join(f"    {column(axis.name)} {TYPES[axis.kind]} NOT NULL,\n" for axis in design.axes)
    numbers = "".join(f"    {name} REAL CHECK (typeof({name}) IN ('real', 'null')),\n" for name in NUMBERS)
    known = " AND ".join(f"{name} IS NOT NULL" for name in (*NUMBERS, "impacts"))
    statuses = ", ".join(f"'{status}'" for status in OUTCOMES)
    curves = f"    curves BLOB,  -- float64, little-endian: {', '.join(CURVES)}\n" if design.curves else ""
    return f"""
CREATE TABLE points (
    number INTEGER PRIMARY KEY,  -- place in the design, from 0
    key TEXT NOT NULL UNIQUE,    -- SHA-256 of parameters and code
{swept}    solver TEXT NOT NULL,
    settings TEXT NOT NULL,      -- JSON
{numbers}    impacts INTEGER CHECK (typeof(impacts) IN ('integer', 'null')),
    status TEXT NOT NULL CHECK (status IN ({statuses})),
    message TEXT NOT NULL,
    reason TEXT NOT NULL,        -- why a number is NULL
    seconds REAL NOT NULL,
    trajectory TEXT,             -- file of the flight, if it was kept
{curves}    versions INTEGER NOT NULL REFERENCES versions (id),
    parameters TEXT NOT NULL,    -- JSON: enough to make this row again alone
    CHECK (reason <> '' OR ({known}))
);
CREATE INDEX points_by_solver ON points (solver, status);
"""


class Store:
    """The rows of one design in a folder. Use as a context manager; the folder is locked until it ends."""

    def __init__(self, folder: Path, design: Design, code: str) -> None:
        """Open or begin the store.

        Raises
        ------
        SweepError
            If the folder holds something else, another design, rows of other code or a newer schema, if another
            program is writing to it, or if it cannot be written.
        """
        self.folder, self.design, self.code = folder, design, code
        self._lock = ExitStack()
        self._rows: sqlite3.Connection | None = None
        with _plainly(folder):
            _check_folder(folder)
            folder.mkdir(parents=True, exist_ok=True)
        try:
            with _plainly(folder):
                self._lock.enter_context(sole_writer(folder / LOCK, folder))
                if not (folder / MARKER).exists():
                    write_whole(folder / MARKER, marker_text(KIND).encode())
                self._rows = sqlite3.connect(folder / FILE, timeout=BUSY, isolation_level=None)
                self._rows.execute("PRAGMA journal_mode = WAL").fetchall()
                self._rows.execute("PRAGMA synchronous = NORMAL")
                self.fresh = not _tables(self._rows)
                if self.fresh:
                    self._begin()
                else:
                    self._check()
                sweep_away_parts(folder)
        except BaseException:
            self.close()
            raise

    @property
    def file(self) -> Path:
        """The SQLite file."""
        return self.folder / FILE

    @property
    def connection(self) -> sqlite3.Connection:
        """The connection that writes."""
        assert self._rows is not None
        return self._rows

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file and let go of the folder."""
        if self._rows is not None:
            self._rows.close()
        self._rows = None
        self._lock.close()

    def done(self) -> bytearray:
        """Return one byte for each point of the design: 1 if its row is there, and its flight if flights are kept."""
        found = bytearray(self.design.size)
        with _plainly(self.folder):
            for number, trajectory in self.connection.execute("SELECT number, trajectory FROM points"):
                found[number] = trajectory is None or (self.folder / trajectory).is_file()
        return found

    def counts(self) -> dict[str, int]:
        """Return the number of rows by status, the most frequent first."""
        query = "SELECT status, count(*) FROM points GROUP BY status ORDER BY count(*) DESC, status"
        with _plainly(self.folder):
            return dict(self.connection.execute(query).fetchall())

    def add(self, returned: Sequence[Returned]) -> None:
        """Write the points of some batches in one transaction, their flights first.

        Raises
        ------
        SweepError
            If the disk is full or the file cannot be written; what was there before is there still.
        """
        with _plainly(self.folder):
            flights = {o.number: self._keep(o) for batch in returned for o in batch.outcomes if o.arrays is not None}
            with _transaction(self.connection):
                for batch in returned:
                    versions = self._versions(batch)
                    rows = (self._row(outcome, flights.get(outcome.number), versions) for outcome in batch.outcomes)
                    # A row whose flight was deleted has been made again.
                    gone = ((outcome.number,) for outcome in batch.outcomes)
                    self.connection.executemany("DELETE FROM points WHERE number = ?", gone)
                    marks = ", ".join("?" * len(columns(self.design)))
                    self.connection.executemany(f"INSERT INTO points VALUES ({marks})", rows)

    def _begin(self) -> None:
        with _transaction(self.connection):
            for statement in (SHARED + points_table(self.design)).split(";\n"):
                self.connection.execute(statement)
            self.connection.execute("INSERT INTO schema_version VALUES (?)", (SCHEMA,))
            facts = json.dumps(self.design.facts())
            self.connection.execute(
                "INSERT INTO design VALUES (?, ?, ?, ?)", (self.code, self.design.size, facts, self.design.text)
            )

    def _check(self) -> None:
        if not {"schema_version", "design", "points"} <= _tables(self.connection):
            raise SweepError(f"{self.file} is a database, but no sweep; name another --out")
        (schema,) = self.connection.execute("SELECT version FROM schema_version").fetchone()
        if schema != SCHEMA:
            raise SweepError(f"{self.file} has schema {schema}; this flipproof reads schema {SCHEMA}")
        code, facts = self.connection.execute("SELECT code, facts FROM design").fetchone()
        difference = _difference(json.loads(facts), json.loads(json.dumps(self.design.facts())))
        if difference:
            raise SweepError(f"{self.folder} holds another design ({difference}); name another --out")
        if code != self.code:
            raise SweepError(
                f"{self.folder} was begun by flipproof {code}, this is {self.code}; go on with that one, or name "
                "another --out: one sweep, one code"
            )

    def _versions(self, batch: Returned) -> int:
        facts = json.dumps(dict(batch.versions), sort_keys=True)
        self.connection.execute("INSERT OR IGNORE INTO versions (facts) VALUES (?)", (facts,))
        (number,) = self.connection.execute("SELECT id FROM versions WHERE facts = ?", (facts,)).fetchone()
        return int(number)

    def _row(self, outcome: Outcome, flight: str | None, versions: int) -> tuple[Any, ...]:
        point = self.design.point(outcome.number)
        return (
            outcome.number,
            point.key(self.code),
            *point.values,
            point.solver,
            settings_text(point.settings),
            *(getattr(outcome, name) for name in NUMBERS),
            outcome.impacts,
            outcome.status,
            outcome.message,
            outcome.reason,
            outcome.seconds,
            flight,
            *([_bytes(outcome.curves)] if self.design.curves else []),
            versions,
            json.dumps(point.parameters()),
        )

    def _keep(self, outcome: Outcome) -> str:
        """Write the flight of a point and return its file's name from the folder."""
        key = self.design.point(outcome.number).key(self.code)
        name = f"{FLIGHTS}/{key[:2]}/{key}.npz"
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as part, part.open("wb") as file:
            assert outcome.arrays is not None
            np.savez(file, **dict(outcome.arrays))  # type: ignore[arg-type]
        return name


def columns(design: Design) -> tuple[str, ...]:
    """Return the columns of the table of points, in order."""
    swept = (column(axis.name) for axis in design.axes)
    kept = ("trajectory", "curves") if design.curves else ("trajectory",)
    told = ("status", "message", "reason", "seconds", *kept, "versions", "parameters")
    return ("number", "key", *swept, "solver", "settings", *NUMBERS, "impacts", *told)


def read_curves(blob: bytes) -> dict[str, FloatArray]:
    """Return the curves of a row by name, each of shape (P,)."""
    return dict(zip(CURVES, np.frombuffer(blob, dtype="<f8").reshape(len(CURVES), -1), strict=True))


def _bytes(curves: FloatArray | None) -> bytes | None:
    return None if curves is None else curves.astype("<f8").tobytes()


def _tables(connection: sqlite3.Connection) -> set[str]:
    return {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}


def _check_folder(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise SweepError(f"{folder} is a file; --out names a folder")
    if folder.exists():
        parts = (entry.name for entry in folder.iterdir() if entry.name.endswith(TEMPORARY))
        check_own(folder, KIND, ignored=(LOCK, *parts))


@contextmanager
def _transaction(connection: sqlite3.Connection) -> Iterator[None]:
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        # SQLite has rolled back by itself after some errors, such as a full disk.
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise


@contextmanager
def _plainly(folder: Path) -> Iterator[None]:
    """Turn what a disk or SQLite refuses into one line."""
    try:
        yield
    except OutputError as error:
        raise SweepError(str(error)) from None
    except sqlite3.IntegrityError as error:
        words = "two points of the design are the same throw" if "points.key" in str(error) else "a row is refused"
        raise SweepError(f"{folder}: {words} ({error})") from None
    except (OSError, sqlite3.Error) as error:
        words = getattr(error, "strerror", None) or str(error)
        raise SweepError(
            f"{folder} cannot be written ({words}); the points stored so far are safe, "
            "the same command goes on from there"
        ) from None


def _difference(there: Any, here: Any, name: str = "") -> str:
    """Return the first thing in which two designs differ, or nothing."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in {**there, **here}:
            found = _difference(there.get(key), here.get(key), f"{name}.{key}" if name else key)
            if found:
                return found
        return ""
    return "" if there == here else f"{name} is {_short(there)} there and {_short(here)} here"


def _short(value: object) -> str:
    shown = json.dumps(value)
    return shown if len(shown) <= 40 else shown[:37] + "..."
