"""Slow runs and calls kept from one report to the next, in one SQLite file in the user's cache folder.

A run is looked up by all that decides its numbers: solver, scenario and settings, the versions of Python and of the
packages that compute, and the sources of the package that makes it and of what that imports. A call of a worker, such
as the flights of a map or the drawing of a figure, is looked up by function, arguments, versions and all sources.
Whatever of these changes, it is made again. The processor is not among them: another one changes last digits, which no
verdict rests on. After a source was changed while the store is open, nothing is kept: a worker may have read the
changed program, and the keys are those of the one before.

An entry carries a checksum over key and content; one that does not agree with it is made again and replaced. Several
programs may read and write at once. Where the file cannot be used, runs are made as if there were none.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import sqlite3
import stat
import sys
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Executor, Future
from contextlib import AbstractContextManager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from flipproof.frame.keys import fingerprint, key_of, key_of_call, sources_written
from flipproof.frame.solvers import Made, Run

WORDS: Final = "from the store"
"""Name of the store's line in the provenance."""

BUSY: Final = 10.0
"""Seconds to wait for another program that writes."""

TABLE: Final = """
CREATE TABLE IF NOT EXISTS kept (
    key TEXT PRIMARY KEY,    -- SHA-256 of all that decides what is kept
    checksum TEXT NOT NULL,  -- SHA-256 of key and content
    used TEXT NOT NULL,      -- when it was made or last read
    size INTEGER NOT NULL,   -- bytes of the content
    content BLOB NOT NULL    -- what was kept, and when it was made
)
"""
EVICT: Final = """
DELETE FROM kept WHERE key IN (
    SELECT key FROM (
        SELECT key, sum(size) OVER (ORDER BY CASE WHEN used > ? THEN '' ELSE used END DESC, key) AS together FROM kept
    ) WHERE together > ?
)
"""
"""What is dated in the future, by a clock that was wrong, goes first."""

UNUSABLE: Final = (OSError, sqlite3.Error, UnicodeDecodeError)
"""What opening or reading the file raises; UnicodeDecodeError when SQLite quotes a damaged schema."""


class RunStore(AbstractContextManager["RunStore"]):
    """Runs by what decides them. Use as a context manager; ``RunStore(None)`` keeps nothing and finds nothing.

    Parameters
    ----------
    place : Path or None - the file; ``default_place()`` unless somebody wants another
    slow : float - seconds of a run from which it is kept, a faster one is as soon made as read; 0: all of any size
    limit : int - bytes of all entries together; those used longest ago go first
    """

    def __init__(self, place: Path | None, *, slow: float = 0.05, limit: int = 2**30) -> None:
        self.place, self.slow, self.limit = place, slow, limit
        self.asked, self.calls = 0, 0
        self.found: list[str] = []
        self.found_calls: list[str] = []
        self._lock = threading.RLock()
        self._rows: sqlite3.Connection | None = None
        self._writable = True
        self._problem = "not asked for"
        if place is not None:
            self._sources = sources_written()
            fingerprint.cache_clear()  # a source may have been changed since the store before this one
            self._open(place)

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            if self._rows is not None:
                self._rows.close()
            self._rows = None

    def find(self, run: Run) -> Made | None:
        """Return the run as it was kept; None if it was not, or not by this code, or what was kept is damaged."""
        self.asked += 1
        kept = self._get(key_of(run), self.found) if self._rows is not None else None
        return None if kept is None else Made(run, *kept[0])

    def keep(self, made: Made) -> None:
        """Keep a run that was slow and ended in a trajectory."""
        if self._rows is not None and made.trajectory is not None and made.seconds >= self.slow:
            self._put(key_of(made.run), (made.trajectory, made.seconds), made.seconds)

    def remembering(self, pool: Executor) -> Executor:
        """Return the pool as one that finds the answers of its calls in this store, and keeps them there."""
        return _Remembering(pool, self) if self._rows is not None else pool

    def find_call(self, key: str | None) -> tuple[Any] | None:
        """Return the answer of a call as it was kept, alone in a tuple, or None."""
        self.calls += 1
        return self._get(key, self.found_calls)

    def keep_call(self, key: str | None, answer: object, seconds: float) -> None:
        """Keep the answer of a call that was slow."""
        if seconds >= self.slow:
            self._put(key, answer, seconds)

    def facts(self) -> dict[str, str]:
        """Return how much of what was asked for came from the store and when it was made, for the provenance."""
        if self._rows is None and not self.found + self.found_calls:
            return {WORDS: f"none: {self._problem}"}
        runs = f"{len(self.found)} of {self.asked} runs"
        calls = f"{len(self.found_calls)} of {self.calls} maps and audits" if self.calls else ""
        when = sorted(self.found + self.found_calls)
        made = f"made {when[0]} UTC" + (f" to {when[-1]} UTC" if when[-1] != when[0] else "") if when else ""
        return {WORDS: ", ".join(part for part in (runs, calls, made) if part)}

    def _get(self, key: str | None, found: list[str]) -> tuple[Any] | None:
        """Return what was kept under a key, alone in a tuple, or None; note in ``found`` when it was made."""
        with self._lock:
            if self._rows is None or key is None:
                return None
            try:
                row = self._rows.execute("SELECT checksum, content FROM kept WHERE key = ?", (key,)).fetchone()
            except UNUSABLE as error:
                if not _is(error, sqlite3.SQLITE_BUSY):
                    self._give_up(error)
                return None
            if row is None:
                return None
            entry = _read(key, *row)
            if entry is None:
                self._write("DELETE FROM kept WHERE key = ?", (key,))
                return None
            self._write("UPDATE kept SET used = ? WHERE key = ?", (_now(), key))
            value, made = entry
            found.append(made)
            return (value,)

    def _put(self, key: str | None, value: object, seconds: float) -> None:
        """Keep a value that took so long; not what cannot be pickled, or is made about as fast as it would be read.

        What is kept is read some ten times as fast as 3e7 bytes in a second.
        """
        if key is None:
            return
        try:
            content = pickle.dumps((value, _now("%Y-%m-%d %H:%M")), protocol=pickle.HIGHEST_PROTOCOL)
        except Exception:  # whatever a class raises that cannot be pickled
            return
        worth = self.slow == 0.0 or len(content) <= 3e7 * seconds
        if worth and len(content) <= self.limit and self._same_program():
            with self._lock:
                row = (key, _checksum(key, content), _now(), len(content), content)
                self._write("INSERT OR REPLACE INTO kept VALUES (?, ?, ?, ?, ?)", row)
                self._write(EVICT, (_now(), self.limit))

    def _same_program(self) -> bool:
        """Return whether no source has been changed since the store was opened."""
        with suppress(OSError):  # a file that goes away meanwhile
            return sources_written() == self._sources
        return False

    def _write(self, statement: str, values: tuple[Any, ...]) -> None:
        """Change the file; after a change that it does not take, such as on a full disk, it is only read.

        A change that another program keeps waiting is given up alone.
        """
        if self._rows is None or not self._writable:
            return
        try:
            self._rows.execute(statement, values)
        except UNUSABLE as error:
            if _is(error, sqlite3.SQLITE_BUSY):
                self._rows.execute("PRAGMA busy_timeout = 0")  # it was waited for once, which is long
                return
            self._writable = False
            if _is_damage(error):
                self._give_up(error)

    def _open(self, place: Path) -> None:
        try:
            place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            _check_own(place)
            self._rows = _connect(place)
        except UNUSABLE as error:
            self._give_up(error)
            if _is_damage(error):
                # What is damaged was thrown away just now: begin anew.
                with suppress(*UNUSABLE):
                    self._rows = _connect(place)

    def _give_up(self, error: Exception) -> None:
        """Go on without the file; throw it away if it is damaged."""
        self.close()
        assert self.place is not None
        self._problem = f"{self.place} cannot be used ({error})"
        if _is_damage(error):
            with suppress(OSError):
                for end in ("", "-wal", "-shm"):
                    self.place.with_name(self.place.name + end).unlink(missing_ok=True)


class _Remembering(Executor):
    """A pool whose calls are looked for in a store first; what an exception ends is not kept."""

    def __init__(self, pool: Executor, store: RunStore) -> None:
        self._pool, self._store = pool, store

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return the answer as it was kept, or call ``fn`` in a worker and keep it."""
        key = key_of_call(fn, args, kwargs)
        known = self._store.find_call(key)
        answer: Future[Any] = Future()
        if known is not None:
            answer.set_result(known[0])
            return answer
        answer.set_running_or_notify_cancel()

        def keep(done: Future[Any]) -> None:
            error = CancelledError() if done.cancelled() else done.exception()
            if error is not None:
                answer.set_exception(error)
            else:
                found, seconds = done.result()
                answer.set_result(found)
                self._store.keep_call(key, found, seconds)

        self._pool.submit(_timed, fn, args, kwargs).add_done_callback(keep)
        return answer


def _timed(fn: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> tuple[Any, float]:
    """Return the answer of a call, and the seconds that it took."""
    began = time.perf_counter()
    answer = fn(*args, **kwargs)
    return answer, time.perf_counter() - began


def default_place() -> Path | None:
    """Return the file of this user, in XDG_CACHE_HOME, or where the system keeps caches; None without a home."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    try:
        if Path(given).is_absolute():
            home = Path(given)
        elif sys.platform == "win32":
            home = Path(os.environ.get("LOCALAPPDATA") or Path.home())
        else:
            home = Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    except RuntimeError:
        return None
    return home / "flipproof" / "runs-1.sqlite"  # the number rises with every change of the table


def _check_own(place: Path) -> None:
    """Refuse, by an OSError, a store that another user may have written: what it holds is unpickled."""
    folder = place.parent.stat()
    if place.exists() and not place.is_file():
        raise OSError("not a regular file")
    if sys.platform == "win32":
        return
    if folder.st_uid != os.geteuid() or (place.exists() and place.stat().st_uid != os.geteuid()):
        raise OSError("it belongs to another user")
    if folder.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise OSError("its folder may be written by other users")


def _connect(place: Path) -> sqlite3.Connection:
    rows = sqlite3.connect(place, timeout=BUSY, isolation_level=None, check_same_thread=False)
    try:
        _write_ahead(rows)
        rows.execute("PRAGMA synchronous = NORMAL")
        rows.execute(TABLE)
    except BaseException:
        rows.close()
        raise
    return rows


def _write_ahead(rows: sqlite3.Connection) -> None:
    """Let readers go on while one program writes. Of two that begin a file at once SQLite refuses one right away."""
    until = time.monotonic() + BUSY
    while True:
        try:
            rows.execute("PRAGMA journal_mode = WAL").fetchall()
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode != sqlite3.SQLITE_BUSY or time.monotonic() > until:
                raise
            time.sleep(0.01)
        else:
            return


def _read(key: str, checksum: object, content: object) -> tuple[Any, str] | None:
    """Return what an entry holds and when it was made; None if it is damaged."""
    with suppress(Exception):  # a class of another form: anything may come of it
        if isinstance(content, bytes) and checksum == _checksum(key, content):
            value, made = pickle.loads(content)
            return value, made
    return None


def _checksum(key: str, content: bytes) -> str:
    return hashlib.sha256(key.encode() + content).hexdigest()


def _now(form: str = "%Y-%m-%d %H:%M:%S.%f") -> str:
    return datetime.now(UTC).strftime(form)


def _is_damage(error: Exception) -> bool:
    """Return whether the file is damaged. SQLITE_ERROR: a statement that is right does not fit the schema there."""
    damage = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR)
    return isinstance(error, UnicodeDecodeError) or _is(error, *damage)


def _is(error: Exception, *codes: int) -> bool:
    """Return whether an error is one of SQLite's primary codes, whatever its extended code adds."""
    return int(getattr(error, "sqlite_errorcode", 0)) & 0xFF in codes
