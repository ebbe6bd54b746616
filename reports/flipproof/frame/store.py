"""What was made, by its key, in one SQLite file: rows of sweeps, and runs of reports.

::

    shared   id, facts        JSON: what many entries have in common: solver, settings, code, versions, the base throw
    made     key              16 bytes: all that was asked, and the code that made it
             shared           the row of ``shared`` that belongs to it
             asked            JSON: what was asked for beside that
             answer           what came of it: JSON (a sweep), or a packed value (``packing``, a report)
             used             when it was made or last read [ms since 1970], 0 in a sweep
             checksum         CRC-32 of the other columns but ``used``

Any number of programs may read and write the file at once. An entry that does not agree with its checksum is dropped,
so that it is made again. A file that SQLite finds damaged is renamed, and what can still be read of it is copied to a
new one.

- ``journal_mode = WAL``: readers see the last transaction while a program writes the next.
- ``synchronous = NORMAL``: a killed program loses nothing that it committed; a power failure may lose the last
  transactions, whose entries are then made again, but never breaks the file.
"""

from __future__ import annotations

import json
import os
import sqlite3
import stat
import sys
import threading
import time
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, closing, suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

BUSY: Final = 30.0
"""Seconds to wait for another program that writes."""

TABLES: Final = (
    "CREATE TABLE IF NOT EXISTS shared (id INTEGER PRIMARY KEY, facts TEXT NOT NULL UNIQUE)",
    "CREATE TABLE IF NOT EXISTS made (key BLOB PRIMARY KEY, shared INTEGER NOT NULL REFERENCES shared (id), "
    "asked TEXT NOT NULL, answer NOT NULL, used INTEGER NOT NULL, checksum INTEGER NOT NULL)",
)
OBJECTS: Final = {(statement.split()[5], statement.replace(" IF NOT EXISTS", "")) for statement in TABLES}
"""Name and statement of all that the file's schema holds, but indices that SQLite makes by itself."""

BESIDE: Final = {
    "-journal": (b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7", bytes(8)),
    "-wal": (b"\x37\x7f\x06\x82", b"\x37\x7f\x06\x83"),
    "-shm": (b"",),
}
"""Files that SQLite keeps beside a database, and how each begins unless it is empty."""

APPLICATION: Final = 0x464C4950
"""SQLite's ``application_id`` of the file ("FLIP")."""

SCHEMA: Final = 3
"""SQLite's ``user_version`` of the file; rises with every change of the tables."""

EVICT: Final = """
DELETE FROM made WHERE key IN (
    SELECT key FROM (
        SELECT key, sum(length(answer)) OVER (ORDER BY CASE WHEN used > ? THEN 0 ELSE used END DESC, rowid DESC) AS size
        FROM made
    ) WHERE size > ?
)
"""
"""What is dated in the future, by a clock that was wrong, goes first."""

UNUSABLE: Final = (OSError, sqlite3.Error, UnicodeDecodeError)
"""What opening, reading or writing the file raises; UnicodeDecodeError when SQLite quotes a damaged schema."""

json_of = json.JSONEncoder(sort_keys=True, separators=(",", ":")).encode


class Entry(NamedTuple):
    """What is kept under a key.

    Parameters
    ----------
    key : bytes, 16
    shared : mapping - what many entries have in common
    asked : str - JSON
    answer : str or bytes
    """

    key: bytes
    shared: Mapping[str, Any]
    asked: str
    answer: str | bytes


class Store(AbstractContextManager["Store"]):
    """Entries by their keys. Use as a context manager; threads may share it.

    Parameters
    ----------
    path : Path - the file; it is begun if it is not there
    say : callable or None
        Gets a line if a damaged file was renamed. None: the file is not read through, and damage is raised.

    Raises
    ------
    OSError
        If the file or its folder cannot be used, is no regular file, or is another user's.
    sqlite3.Error
        If it is a database of something else, or another program holds it too long.
    """

    def __init__(self, path: Path, say: Callable[[str], object] | None = None) -> None:
        self.path = path
        self._lock = threading.RLock()
        self._ids: dict[str, int] = {}
        self._facts: dict[int, bytes] = {}
        self._mappings: dict[int, Mapping[str, Any]] = {}
        check_own(path)
        try:
            self._rows = _connect(path, through=say is not None)
        except UNUSABLE as error:
            if say is None or not is_damage(error):
                raise
            aside = _set_aside(path)
            self._rows = _connect(path)
            kept = self._copy(aside)
            say(f"{path} was damaged ({error}); it is {aside.name} now, and {kept} entries of it were kept")

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._rows.close()

    def get(self, keys: Sequence[bytes]) -> dict[bytes, tuple[Mapping[str, Any], bytes]]:
        """Return shared facts and answer of those of at most 32 000 keys that have one; damaged ones are dropped."""
        query = f"SELECT key, shared, asked, answer, checksum FROM made WHERE key IN ({','.join('?' * len(keys))})"
        with self._lock:
            rows = self._rows.execute(query, keys).fetchall()
            if not {shared for _, shared, *_ in rows} <= self._facts.keys():
                self._facts = dict(self._rows.execute("SELECT id, facts FROM shared"))
                self._mappings.clear()
            whole = {row[0]: (self._read(row[1]), row[3]) for row in rows if _whole(self._facts, *row)}
            if len(whole) < len(rows):
                damaged = [(row[0],) for row in rows if row[0] not in whole]
                self._rows.executemany("DELETE FROM made WHERE key = ?", damaged)
        return whole

    def put(self, entries: Iterable[Entry], *, dated: bool = False) -> None:
        """Write entries in one transaction; of two under one key the later stays. ``dated``: note when."""
        with self._lock:
            now = _now() if dated else 0
            self._rows.execute("BEGIN IMMEDIATE")
            try:
                rows, last, facts = [], None, ""
                for key, shared, asked, answer in entries:
                    if shared is not last:  # many in turn have the same
                        last, facts = shared, json_of(shared)
                    rows.append((key, self._id(facts), asked, answer, now, _checksum(facts, key, asked, answer)))
                self._rows.executemany("INSERT OR REPLACE INTO made VALUES (?, ?, ?, ?, ?, ?)", rows)
                self._rows.execute("COMMIT")
            except BaseException:
                self._ids.clear()
                if self._rows.in_transaction:  # SQLite has rolled back by itself after some errors
                    self._rows.execute("ROLLBACK")
                raise

    def _read(self, number: int) -> Mapping[str, Any]:
        """Return shared facts, read from JSON once."""
        if number not in self._mappings:
            self._mappings[number] = json.loads(self._facts[number])
        return self._mappings[number]

    def touch(self, key: bytes) -> None:
        """Note that an entry was read now."""
        with self._lock:
            self._rows.execute("UPDATE made SET used = ? WHERE key = ?", (_now(), key))

    def evict(self, limit: int) -> None:
        """Drop what was used longest ago until all answers together have at most ``limit`` bytes."""
        with self._lock:
            self._rows.execute(EVICT, (_now(), limit))

    def shared(self) -> list[dict[str, Any]]:
        """Return what entries have in common, each once."""
        records: list[dict[str, Any]] = []
        with self._lock:
            for (facts,) in self._rows.execute("SELECT facts FROM shared ORDER BY id"):
                with suppress(ValueError):  # damaged: its entries do not agree with their checksums, and are made again
                    records.append(json.loads(facts))
        return [facts for facts in records if isinstance(facts, dict)]

    def patience(self, seconds: float) -> None:
        """Wait so long for another program that writes, from now on."""
        self._rows.execute(f"PRAGMA busy_timeout = {int(1000 * seconds)}")

    def _id(self, facts: str) -> int:
        """Return the number of shared facts, which are written if they are new."""
        if facts not in self._ids:
            self._rows.execute("INSERT OR IGNORE INTO shared (facts) VALUES (?)", (facts,))
            ((number,),) = self._rows.execute("SELECT id FROM shared WHERE facts = ?", (facts,)).fetchall()
            self._ids[facts] = int(number)
        return self._ids[facts]

    def _copy(self, aside: Path) -> int:
        """Copy what is whole in a damaged file, up to the first page that cannot be read; return how much that is."""
        entries: list[Entry] = []
        with suppress(*UNUSABLE, ValueError), closing(sqlite3.connect(aside)) as old:
            old.text_factory = bytes
            facts = dict(old.execute("SELECT id, facts FROM shared NOT INDEXED"))
            columns = "key, shared, asked, answer, checksum, typeof(answer)"
            for *row, kind in old.execute(f"SELECT {columns} FROM made NOT INDEXED"):
                if _whole(facts, *row):
                    key, shared, asked, answer, _ = row
                    decoded = answer.decode() if kind == b"text" else answer
                    entries.append(Entry(key, json.loads(facts[shared]), asked.decode(), decoded))
        self.put(entries)
        return len(entries)


def check_own(path: Path) -> None:
    """Make the folder of a store, or refuse, by an OSError, a file or folder that another user may have written."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    if os.path.lexists(path) and not stat.S_ISREG(path.lstat().st_mode):
        raise OSError("it is not a regular file")
    for end, starts in BESIDE.items():
        beside = path.with_name(path.name + end)
        if not os.path.lexists(beside):
            continue
        if not stat.S_ISREG(beside.lstat().st_mode):
            raise OSError(f"{beside.name} beside it is not a regular file")
        with suppress(FileNotFoundError), beside.open("rb") as file:  # another program may have ended just now
            if (begins := file.read(8)) and not begins.startswith(starts):
                raise OSError(f"{beside.name} beside it is not a file of SQLite's; move it away")
    if sys.platform != "win32" and path.exists() and path.stat().st_uid != os.geteuid():
        raise OSError("it belongs to another user")
    check_private(path.parent)


def check_private(folder: Path, writers: int = stat.S_IWOTH) -> None:
    """Refuse, by an OSError, a folder of another user, and one that other users, of these ``writers``, may write.

    A sticky bit does not help: it keeps files from being replaced, but not from being laid beside them.
    """
    facts = folder.stat()
    if sys.platform != "win32" and facts.st_uid != os.geteuid():
        raise OSError(f"{folder} belongs to another user; name a folder of your own")
    if sys.platform != "win32" and facts.st_mode & writers:
        raise OSError(f"{folder} may be written by other users; run chmod go-w on it, or name another folder")


def is_damage(error: Exception) -> bool:
    """Return whether the file is damaged. SQLITE_ERROR: a statement that is right does not fit the schema there."""
    damage = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR)
    return isinstance(error, UnicodeDecodeError) or has_code(error, *damage)


def has_code(error: Exception, *codes: int) -> bool:
    """Return whether an error is one of SQLite's primary codes, whatever its extended code adds."""
    return int(getattr(error, "sqlite_errorcode", 0)) & 0xFF in codes


def _connect(path: Path, through: bool = False) -> sqlite3.Connection:
    """Open or begin the file; ``through``: read all of it, so that damage is seen now."""
    rows = sqlite3.connect(path, timeout=BUSY, isolation_level=None, check_same_thread=False)
    try:
        rows.text_factory = bytes  # a damaged text may be no UTF-8
        ((problem,),) = rows.execute("PRAGMA integrity_check(1)").fetchall() if through else ((b"ok",),)
        if problem != b"ok":
            raise _damage(problem.decode(errors="replace").replace("*** in database main ***", "").strip())
        schema_rows = rows.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL").fetchall()
        tables = {(name.decode(), sql.decode()) for name, sql in schema_rows}
        ((application,),) = rows.execute("PRAGMA application_id").fetchall()
        ((schema,),) = rows.execute("PRAGMA user_version").fetchall()
        matches = (application, schema) == (APPLICATION, SCHEMA), tables == OBJECTS
        if tables and matches != (True, True):
            if any(matches):
                raise _damage("its schema is not that of a store")
            error = sqlite3.DatabaseError("it is a database of something else or of another version of flipproof")
            error.sqlite_errorcode = sqlite3.SQLITE_MISUSE
            raise error
        _write_ahead(rows)
        rows.execute("PRAGMA synchronous = NORMAL")
        if not tables:
            rows.execute("BEGIN IMMEDIATE")
            for statement in (f"PRAGMA application_id = {APPLICATION}", f"PRAGMA user_version = {SCHEMA}", *TABLES):
                rows.execute(statement)
            rows.execute("COMMIT")
    except BaseException:
        rows.close()
        raise
    return rows


def _damage(words: str) -> sqlite3.DatabaseError:
    error = sqlite3.DatabaseError(words)
    error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
    return error


def _write_ahead(rows: sqlite3.Connection) -> None:
    """Let readers go on while one program writes. Of two that begin a file at once SQLite refuses one right away."""
    until = time.monotonic() + BUSY
    while True:
        try:
            rows.execute("PRAGMA journal_mode = WAL").fetchall()
        except sqlite3.OperationalError as error:
            if not has_code(error, sqlite3.SQLITE_BUSY) or time.monotonic() > until:
                raise
            time.sleep(0.01)
        else:
            return


def _set_aside(path: Path) -> Path:
    """Rename a file with its log, which would otherwise be read into the new one; return the name it has now."""
    aside = path.with_name(f"{path.stem}-damaged-{time.time_ns()}{path.suffix}")
    for end in ("-shm", "-wal", ""):
        with suppress(FileNotFoundError):
            path.with_name(path.name + end).rename(aside.with_name(aside.name + end))
    return aside


def _now() -> int:
    return time.time_ns() // 1_000_000


def _checksum(facts: str | bytes, key: bytes, asked: str | bytes, answer: str | bytes) -> int:
    total = zlib.crc32(key)
    for cell in (facts, asked, answer):
        total = zlib.crc32(cell.encode() if isinstance(cell, str) else cell, total)
    return total


def _whole(facts: Mapping[int, bytes], key: Any, shared: Any, asked: Any, answer: Any, checksum: Any) -> bool:
    """Return whether the cells of an entry, as SQLite gives them back, are those that were written."""
    cells = (key, facts.get(shared), asked, answer)
    if all(isinstance(cell, bytes) for cell in cells):
        return bool(checksum == _checksum(facts[shared], key, asked, answer))
    return False
