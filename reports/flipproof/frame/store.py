"""Slow runs kept from one report to the next, in one SQLite file in the user's cache folder.

A run is looked up by all that decides its numbers: solver, scenario and settings, the versions of Python and of the
packages that compute, and the sources of the package that makes it and of what that imports. Whatever of these changes,
the run is made again. The processor is not among them: another one changes last digits, which no verdict rests on.

An entry carries a checksum over key and content; one that does not agree with it is made again and replaced. Several
programs may read and write at once. Where the file cannot be used, runs are made as if there were none.
"""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import platform
import sqlite3
import sys
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, Final

import numpy as np

from flipproof.frame.solvers import Made, Run, find, make
from flipproof.frame.sources import fingerprint
from flipproof.output.provenance import version_of
from slicemodel import Trajectory

FILE: Final = "runs-1.sqlite"
"""Its number rises with every change of the table."""

SOURCES: Final = MappingProxyType(
    {
        "slicemodel": ("slicemodel", "flipproof.frame.solvers"),
        "ode_reference": ("ode_reference", "slicemodel", "flipproof.frame.solvers"),
        "engine_check": ("engine_check", "slicemodel", "flipproof.frame.solvers"),
    }
)
"""Package -> the sources that its runs are made by. Somebody else's solver is not among them and never kept."""

PACKAGES: Final = ("flipproof", "numpy", "scipy", "numba", "pymunk", "mujoco-core")

SLOW: Final = 0.05
"""Seconds of a run from which it is kept: a faster one is as soon made as read."""

LIMIT: Final = 2**30
"""Bytes of all entries together; those used longest ago go first."""

BUSY: Final = 10.0
"""Seconds to wait for another program that writes."""

TABLE: Final = """
CREATE TABLE IF NOT EXISTS runs (
    key TEXT PRIMARY KEY,    -- SHA-256 of all that decides the numbers of the run
    checksum TEXT NOT NULL,  -- SHA-256 of key and content
    used TEXT NOT NULL,      -- when it was made or last read
    size INTEGER NOT NULL,   -- bytes of the content
    content BLOB NOT NULL    -- the trajectory, the seconds that it took, and when it was made
)
"""
EVICT: Final = """
DELETE FROM runs WHERE key IN (
    SELECT key FROM (SELECT key, sum(size) OVER (ORDER BY used DESC, key) AS together FROM runs) WHERE together > ?
)
"""


class RunStore:
    """Runs by what decides them. Use as a context manager; ``RunStore(None)`` keeps nothing and finds nothing.

    Parameters
    ----------
    place : Path or None
        The file; ``default_place()`` unless somebody wants another.
    slow : float - seconds of a run from which it is kept
    limit : int - bytes of all entries together
    """

    def __init__(self, place: Path | None, *, slow: float = SLOW, limit: int = LIMIT) -> None:
        self.place, self.slow, self.limit = place, slow, limit
        self.asked = 0
        self.found: list[str] = []
        self._rows: sqlite3.Connection | None = None
        self._writable = True
        self._problem = "not asked for"
        if place is not None:
            self._open(place)

    def __enter__(self) -> RunStore:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        if self._rows is not None:
            self._rows.close()
        self._rows = None

    def make(self, run: Run) -> Made:
        """Return the run as it was kept; else make it, and keep it if it was slow."""
        made = self.find(run)
        if made is None:
            made = make(run)
            self.keep(made)
        return made

    def find(self, run: Run) -> Made | None:
        """Return the run as it was kept; None if it was not, or not by this code, or what was kept is damaged."""
        self.asked += 1
        if self._rows is None or (key := key_of(run)) is None:
            return None
        try:
            row = self._rows.execute("SELECT checksum, content FROM runs WHERE key = ?", (key,)).fetchone()
            entry = None if row is None else _read(key, *row)
        except sqlite3.Error as error:
            self._give_up(error)
            return None
        if row is None:
            return None
        if entry is None:
            self._write("DELETE FROM runs WHERE key = ?", (key,))
            return None
        self._write("UPDATE runs SET used = ? WHERE key = ?", (_now(), key))
        trajectory, seconds, made = entry
        self.found.append(made)
        return Made(run, trajectory, seconds)

    def keep(self, made: Made) -> None:
        """Keep a run that was slow and ended in a trajectory."""
        if self._rows is None or made.trajectory is None or made.seconds < self.slow:
            return
        key = key_of(made.run)
        content = pickle.dumps((made.trajectory, made.seconds, _now()), protocol=pickle.HIGHEST_PROTOCOL)
        if key is None or len(content) > self.limit:
            return
        row = (key, _checksum(key, content), _now(), len(content), content)
        self._write("INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?, ?)", row)
        self._write(EVICT, (self.limit,))

    def facts(self) -> dict[str, str]:
        """Return how many of the runs asked for came from the store and when they were made, for the provenance."""
        if not self.found:
            words = f"none of {self.asked}" if self._rows is not None else f"none: {self._problem}"
        else:
            first, last = min(self.found)[:16], max(self.found)[:16]
            words = f"{len(self.found)} of {self.asked}, made {first} UTC"
            words += f" to {last} UTC" if last != first else ""
        return {"runs from the store": words}

    def _open(self, place: Path) -> None:
        try:
            place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            self._rows = _connect(place)
        except sqlite3.DatabaseError as error:
            self._give_up(error)
            if _is_damage(error):
                # What is damaged was thrown away just now: begin anew.
                with suppress(OSError, sqlite3.Error):
                    self._rows = _connect(place)
        except (OSError, sqlite3.Error) as error:
            self._give_up(error)

    def _write(self, statement: str, values: tuple[Any, ...]) -> None:
        """Change the file; after a change that it does not take, such as on a full disk, it is only read."""
        if self._rows is None or not self._writable:
            return
        try:
            self._rows.execute(statement, values)
        except sqlite3.Error as error:
            self._writable = False
            if _is_damage(error):
                self._give_up(error)

    def _give_up(self, error: Exception) -> None:
        """Go on without the file; throw it away if it is damaged."""
        self.close()
        assert self.place is not None
        self._problem = f"{self.place} cannot be used ({error})"
        if _is_damage(error):
            with suppress(OSError):
                for end in ("", "-wal", "-shm"):
                    self.place.with_name(self.place.name + end).unlink(missing_ok=True)


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
    return home / "flipproof" / FILE


def key_of(run: Run) -> str | None:
    """Return the SHA-256 of all that decides a run; None for a run that cannot be kept."""
    sources = SOURCES.get(find(run.solver).package)
    if sources is None:
        return None
    facts = {
        "solver": run.solver,
        "scenario": run.scenario.to_mapping(),
        "settings": dict(run.settings),
        "versions": {"Python": platform.python_version(), **{name: version_of(name) for name in PACKAGES}},
        "code": fingerprint(*sources),
    }
    try:
        text = json.dumps(facts, sort_keys=True, default=_plain)
    except (TypeError, ValueError):
        return None
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: object) -> Any:
    """Return a setting that JSON has no word for as one that it has, floats to the last bit."""
    if isinstance(value, np.ndarray | np.generic):
        return [str(value.dtype), value.tolist()]
    raise TypeError(f"{type(value).__name__} has no key")


def _connect(place: Path) -> sqlite3.Connection:
    rows = sqlite3.connect(place, timeout=BUSY, isolation_level=None)
    try:
        rows.execute("PRAGMA journal_mode = WAL").fetchall()
        rows.execute("PRAGMA synchronous = NORMAL")
        rows.execute(TABLE)
    except BaseException:
        rows.close()
        raise
    return rows


def _read(key: str, checksum: object, content: object) -> tuple[Trajectory, float, str] | None:
    """Return what an entry holds: trajectory, seconds, and when it was made; None if it is damaged."""
    if not isinstance(content, bytes) or checksum != _checksum(key, content):
        return None
    try:
        trajectory, seconds, made = pickle.loads(content)
    except Exception:  # a class of another form: anything may come of it
        return None
    return trajectory, seconds, made


def _checksum(key: str, content: bytes) -> str:
    return hashlib.sha256(key.encode() + content).hexdigest()


def _now() -> str:
    return datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S.%f")


def _is_damage(error: Exception) -> bool:
    return int(getattr(error, "sqlite_errorcode", 0)) & 0xFF in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
