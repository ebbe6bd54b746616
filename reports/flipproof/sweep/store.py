"""A sweep's rows in one SQLite file, and its flights in a folder beside it. One program writes; anyone may read.

::

    DIR/sweep.sqlite          schema_version, design, versions, points
    DIR/trajectories/3f/...   one NPZ for each kept flight, named by its point's key
    DIR/.flipproof            says that the folder is flipproof's own
    DIR/sweep.lock            held by the program that writes; it ends with that program, however it dies

A number that is not known is NULL, and the row's ``reason`` says why: SQLite has no NaN, and the schema refuses a row
with a missing number and no reason. Floats come back to the last bit, but for the sign of a negative zero. A flight is
in its place before its row is written. Every row carries a checksum, and the whole file is read through before a
sweep goes on with it (``inspection``).

- ``journal_mode = WAL``: readers see the last transaction while this program writes the next.
- ``synchronous = NORMAL``: a killed program loses nothing that it committed; a power failure may lose the last
  transactions, whose points are then made again, but never breaks the file. FULL would wait for the disk at each.
- busy timeout 10 s: a reader or a backup that holds the file for a moment must not end a sweep.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from flipproof.output.folder import MARKER, OutputError, check_own, marker_text, sole_writer
from flipproof.sweep.design import Plan, key_of
from flipproof.sweep.entries import as_json
from flipproof.sweep.errors import SweepError
from flipproof.sweep.files import TEMPORARY, whole_file, write_whole
from flipproof.sweep.inspection import damage, inspect, is_damage, result_code
from flipproof.sweep.schema import APPLICATION, FILE, PAGE, SCHEMA, SHARED, checksum, columns, points_table
from flipproof.sweep.work import CURVES, Outcome, Returned
from slicemodel.trajectory import FloatArray

if TYPE_CHECKING:
    from flipproof.landing.work import Landed

LOCK: Final = "sweep.lock"
KIND: Final = "sweep"
BUSY: Final = 10.0
"""Seconds to wait for somebody who holds the file."""


class Store(ExitStack):
    """The rows of one design in a folder. Use as a context manager; the folder is locked until it ends."""

    def __init__(self, folder: Path, design: Plan, code: str) -> None:
        """Open or begin the store.

        A SweepError refuses a folder that holds something else, another design, rows of other code or another schema,
        whose file is damaged, to which another program is writing, or that cannot be written.
        """
        self.folder, self.design, self.code = folder, design, code
        self._columns = columns(design)
        self._marks = ", ".join("?" * len(self._columns))
        super().__init__()
        try:
            with self._plainly():
                if folder.is_dir():
                    parts = (entry.name for entry in folder.iterdir() if entry.name.endswith(TEMPORARY))
                    check_own(folder, KIND, ignored=(LOCK, *parts))
                elif folder.exists():
                    raise SweepError(f"{folder} is a file; --out names a folder")
                folder.mkdir(parents=True, exist_ok=True)
                self.enter_context(sole_writer(folder / LOCK, folder))
                if not (folder / MARKER).exists():
                    write_whole(folder / MARKER, marker_text(KIND).encode())
                self.fresh = not os.path.lexists(self.file)
                if self.fresh:
                    self._begin()
                else:
                    inspect(self.file, design, code, BUSY)
                connection = sqlite3.connect(self.file, timeout=BUSY, isolation_level=None)
                self.connection = self.enter_context(closing(connection))
                self.connection.execute("PRAGMA journal_mode = WAL").fetchall()
                self.connection.execute("PRAGMA synchronous = NORMAL")
                for part in folder.rglob(f"*{TEMPORARY}"):  # what a killed program left half-written
                    part.unlink(missing_ok=True)
        except BaseException:
            self.close()
            raise

    @property
    def file(self) -> Path:
        """The SQLite file."""
        return self.folder / FILE

    def done(self) -> bytearray:
        """Return one byte for each point of the design: 1 if its row is there, and its flight if flights are kept."""
        found = bytearray(self.design.size)
        with self._plainly():
            for number, trajectory in self.connection.execute("SELECT number, trajectory FROM points"):
                found[number] = trajectory is None or (self.folder / trajectory).is_file()
        return found

    def counts(self) -> dict[str, int]:
        """Return the number of rows by status, the most frequent first."""
        query = "SELECT status, count(*) FROM points GROUP BY status ORDER BY count(*) DESC, status"
        with self._plainly():
            return dict(self.connection.execute(query).fetchall())

    def add(self, returned: Sequence[Returned]) -> None:
        """Write the points of some batches in one transaction, their flights first; what was there before stays."""
        with self._plainly():
            flights = {o.number: self._keep(o) for batch in returned for o in batch.outcomes if o.arrays is not None}
            with _transaction(self.connection):
                for batch in returned:
                    versions = self._versions(json.dumps(dict(batch.versions), sort_keys=True))
                    rows = (self._row(outcome, flights.get(outcome.number), versions) for outcome in batch.outcomes)
                    # A row whose flight was deleted has been made again.
                    gone = ((outcome.number,) for outcome in batch.outcomes)
                    self.connection.executemany("DELETE FROM points WHERE number = ?", gone)
                    self.connection.executemany(f"INSERT INTO points VALUES ({self._marks})", rows)

    def _begin(self) -> None:
        """Make the file with its tables; it gets its name when it is whole, so that no kill leaves half of it."""
        with whole_file(self.file) as part, closing(sqlite3.connect(part, isolation_level=None)) as connection:
            connection.execute(f"PRAGMA page_size = {PAGE}")
            connection.execute("PRAGMA journal_mode = MEMORY").fetchall()
            with _transaction(connection):
                connection.execute(f"PRAGMA application_id = {APPLICATION}")
                for statement in (SHARED + points_table(self.design)).split(";\n"):
                    connection.execute(statement)
                connection.execute("INSERT INTO schema_version VALUES (?)", (SCHEMA,))
                facts = (self.code, self.design.size, json.dumps(self.design.facts()), self.design.text)
                row = (*facts, checksum(facts, ("TEXT", "INTEGER", "TEXT", "TEXT")))
                connection.execute("INSERT INTO design VALUES (?, ?, ?, ?, ?)", row)

    def _versions(self, facts: str) -> int:
        row = (facts, checksum((facts,), ("TEXT",)))
        self.connection.execute("INSERT OR IGNORE INTO versions (facts, checksum) VALUES (?, ?)", row)
        (number,) = self.connection.execute("SELECT id FROM versions WHERE facts = ?", (facts,)).fetchone()
        return int(number)

    def _row(self, outcome: Outcome | Landed, flight: str | None, versions: int) -> tuple[Any, ...]:
        point = self.design.point(outcome.number)
        parameters = as_json(point.parameters())
        curves = None if outcome.curves is None else outcome.curves.astype("<f8").tobytes()
        return self._signed((
            outcome.number, key_of(parameters, self.code), *point.values, point.solver, as_json(point.settings),
            *(getattr(outcome, name) for name in self.design.readings), outcome.status, outcome.message, outcome.reason,
            outcome.seconds, flight, *([curves] if self.design.curves else []), versions, parameters,
        ))  # fmt: skip

    def _signed(self, cells: Sequence[Any]) -> tuple[Any, ...]:
        """Return cells with their checksum; cells that the tables refuse, and will say so, get none."""
        try:
            return (*cells, checksum(cells, list(self._columns.values())[:-1]))
        except (ValueError, TypeError, OverflowError):
            return (*cells, "")

    @contextmanager
    def _plainly(self) -> Iterator[None]:
        """Turn what a disk or SQLite refuses into one line."""
        try:
            yield
        except OutputError as error:
            raise SweepError(str(error)) from None
        except sqlite3.IntegrityError as error:
            words = "two points of the design are the same throw" if "points.key" in str(error) else "a row is refused"
            raise SweepError(f"{self.folder}: {words} ({error})") from None
        except (OSError, sqlite3.Error) as error:
            if is_damage(error):
                raise damage(self.file, str(error)) from None
            words = getattr(error, "strerror", None) or str(error)
            # What SQLite refuses before it has changed anything.
            safe = sqlite3.SQLITE_FULL, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_PERM
            kept = "what was stored is read through when the same command goes on from there"
            if isinstance(error, OSError) or result_code(error) in safe:
                kept = "the points stored so far are safe, the same command goes on from there"
            raise SweepError(f"{self.folder} cannot be written ({words}); {kept}") from None

    def _keep(self, outcome: Outcome) -> str:
        """Write the flight of a point and return its file's name from the folder."""
        key = self.design.point(outcome.number).key(self.code)
        name = f"trajectories/{key[:2]}/{key}.npz"
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as part, part.open("wb") as file:
            assert outcome.arrays is not None
            np.savez(file, **dict(outcome.arrays))  # type: ignore[arg-type]
        return name


def read_curves(blob: bytes) -> FloatArray:
    """Return the curves of a row, shape (4, P), in the order of ``CURVES``."""
    return np.frombuffer(blob, dtype="<f8").reshape(len(CURVES), -1)


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
