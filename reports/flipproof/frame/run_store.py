"""Slow runs and calls kept from one report to the next, in one ``Store`` in the user's cache folder.

A run is looked up by all that decides its numbers: solver, scenario and settings, the versions of Python and of the
packages that compute, and the sources of the package that makes it and of what that imports. A call of a worker, such
as the flights of a map or the drawing of a figure, is looked up by function, arguments, versions and all sources.
Whatever of these changes, it is made again. The processor is not among them: another one changes last digits, which no
verdict rests on. Sources that were changed after this program imported them are not what it runs: then nothing is
looked up. After a source was changed while the store is open, nothing is kept: a worker may have read the changed
program, and the keys are those of the one before.

What is kept is JSON and arrays (``packing``), never a pickle. A damaged file is thrown away; where the file cannot be
used, runs are made as if there were none.
"""

from __future__ import annotations

import json
import math
import os
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

from flipproof.frame.keys import changed_since_import, fingerprint, key_of, key_of_call, sources_written, versions_of
from flipproof.frame.packing import pack, unpack
from flipproof.frame.solvers import Run, RunResult
from flipproof.frame.store import UNUSABLE, Entry, Store, check_private, has_code, is_damage
from slicemodel import Trajectory

NAME: Final = "runs-2.sqlite"
"""Name of the file in the cache folder; the number rises with every change of the tables."""

WORDS: Final = "from the store"
"""Name of the store's line in the provenance."""

BYTES_A_SECOND: Final = 4e6
"""Bytes that an entry may have for each second that it took to make: what is larger is made again instead."""

COMPRESSED: Final = 5.0
"""Times that an entry becomes smaller at best. What would be too large even then is not compressed to see: flights
with all their slices take longer to compress than to make."""


class RunStore(AbstractContextManager["RunStore"]):
    """Runs by what decides them. Use as a context manager; ``RunStore(None)`` keeps nothing and finds nothing.

    Parameters
    ----------
    place : Path or None - the file; ``default_place()`` unless somebody wants another
    slow : float - seconds of a run from which it is kept, a faster one is as soon made as read; 0: all of any size
    limit : int - bytes of all entries together; those used longest ago go first
    say : callable - gets a line if a damaged file was thrown away
    """

    def __init__(
        self,
        place: Path | None,
        *,
        slow: float = 0.05,
        limit: int = 90_000_000,
        say: Callable[[str], object] = lambda _: None,
    ) -> None:
        self.place, self.slow, self.limit, self._say = place, slow, limit, say
        self.asked, self.calls = 0, 0
        self.run_hits: list[str] = []
        self.call_hits: list[str] = []
        self._lock = threading.RLock()
        self._store: Store | None = None
        self._added = 0
        self._writable = True
        self._problem = "" if place else "not asked for"
        if place is None:
            return
        if changed := changed_since_import():
            self._problem = f"{changed} was changed after this program had read it; start the program again"
            return
        self._sources = sources_written()
        fingerprint.cache_clear()  # a source may have been changed since the store before this one
        self._use(self._open)

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            if self._added:
                self._evict()
            if self._store is not None:
                self._store.close()
            self._store = None

    def find(self, run: Run) -> RunResult | None:
        """Return the run as it was kept; None if it was not, or not by this code, or what was kept is damaged."""
        self.asked += 1
        kept = self._get(key_of(run), self.run_hits) if self._store is not None else None
        if kept is None:
            return None
        trajectory, seconds = kept[0]
        return RunResult(run, trajectory, seconds) if isinstance(trajectory, Trajectory) else None

    def keep(self, result: RunResult) -> None:
        """Keep a run that was slow and ended in a trajectory."""
        if self._store is not None and result.trajectory is not None and result.seconds >= self.slow:
            run = result.run
            content = packed((result.trajectory, result.seconds), result.seconds, self.slow)
            self._put(key_of(run), {"solver": run.solver}, run.scenario.to_mapping(), content)

    def remembering(self, pool: Executor) -> Executor:
        """Return the pool as one that finds the answers of its calls in this store, and keeps them there."""
        return _Remembering(pool, self) if self._store is not None else pool

    def find_call(self, key: bytes | None) -> tuple[Any] | None:
        """Return the answer of a call as it was kept, alone in a tuple, or None."""
        self.calls += 1
        return self._get(key, self.call_hits)

    def keep_call(self, key: bytes | None, name: str, content: bytes | None) -> None:
        """Keep the packed answer of a call by the name of its function."""
        self._put(key, {"call": name}, {}, content)

    def facts(self) -> dict[str, str]:
        """Return how much of what was asked for came from the store and when it was made, for the provenance."""
        if self._store is None and not self.run_hits + self.call_hits:
            return {WORDS: f"none: {self._problem}"}
        runs = f"{len(self.run_hits)} of {self.asked} runs"
        calls = f"{len(self.call_hits)} of {self.calls} maps and audits" if self.calls else ""
        when = sorted(self.run_hits + self.call_hits)
        dates = f"made {when[0]} UTC" + (f" to {when[-1]} UTC" if when[-1] != when[0] else "") if when else ""
        return {WORDS: ", ".join(part for part in (runs, calls, dates) if part)}

    def whereabouts(self) -> str:
        """Return where the file lies and how large it is, or why there is none."""
        if self.place is None or self._problem or not self.place.is_file():
            return f"none: {self._problem}"
        files = (self.place.with_name(self.place.name + end) for end in ("", "-wal"))
        size = sum(file.stat().st_size for file in files if file.is_file())
        return f"{self.place} ({size / 1e6:.0f} MB; runs are made again if it is deleted)"

    def _get(self, key: bytes | None, dates: list[str]) -> tuple[Any] | None:
        """Return what was kept under a key, alone in a tuple, or None; note in ``dates`` when it was made."""
        if key is None:
            return None
        kept = self._use(lambda store: store.get([key]).get(key))
        if kept is None:
            return None
        try:
            value, date = unpack(kept[1])
        except Exception:  # written by another program: a class may refuse it in any way
            return None
        self._change(lambda store: store.touch(key))
        dates.append(str(date))
        return (value,)

    def _put(self, key: bytes | None, shared: Mapping[str, Any], question: object, content: bytes | None) -> None:
        if key is None or content is None or len(content) > self.limit or not self._same_program():
            return
        entry = Entry(key, {**shared, "versions": versions_of()}, json.dumps(question), content)
        self._change(lambda store: store.put([entry], dated=True))
        self._added += len(content)
        if self._added > self.limit / 20:  # to look for what was used longest ago takes longer than to write
            self._evict()

    def _evict(self) -> None:
        self._added = 0
        self._change(lambda store: store.evict(self.limit))

    def _same_program(self) -> bool:
        """Return whether no source has been changed since the store was opened."""
        with suppress(OSError):  # a file that goes away meanwhile
            return sources_written() == self._sources
        return False

    def _open(self, _: object) -> None:
        assert self.place is not None
        folder = self.place.parent
        if folder.is_dir():
            check_private(folder, stat.S_IWGRP | stat.S_IWOTH)
        self._store = Store(self.place)
        if self.place.name == NAME:
            for old in folder.glob("runs-1.sqlite*"):  # of version 0.2.0, up to 1 GB
                old.unlink(missing_ok=True)

    def _change(self, change: Callable[[Store], object]) -> None:
        """Change the file; after a change that it does not take, such as on a full disk, it is only read."""
        if self._writable:
            self._use(change, changing=True)

    def _use(self, action: Callable[[Any], Any], changing: bool = False) -> Any:
        """Return what an action on the store returns, or None; go on without the file where it cannot be used.

        What another program keeps waiting is given up alone. A damaged file is thrown away.
        """
        with self._lock:
            if self._store is None and action != self._open:
                return None
            try:
                return action(self._store)
            except UNUSABLE as error:
                if has_code(error, sqlite3.SQLITE_BUSY) and self._store is not None:
                    self._store.patience(0.0)  # it was waited for once, which is long
                elif is_damage(error):
                    self._throw_away(error)
                elif changing:
                    self._writable = False
                else:
                    self.close()
                    self._problem = f"{self.place} cannot be used ({error})"
                return None

    def _throw_away(self, error: Exception) -> None:
        """Remove a damaged file and begin another."""
        assert self.place is not None
        self.close()
        self._say(f"{self.place} was damaged ({error}): it was thrown away, and runs are made again")
        try:
            for end in ("", "-wal", "-shm"):
                self.place.with_name(self.place.name + end).unlink(missing_ok=True)
            self._open(None)
        except UNUSABLE as second_error:
            self._problem = f"{self.place} cannot be used ({second_error})"


def packed(value: object, seconds: float, slow: float) -> bytes | None:
    """Return a value packed with the present time, or None for what is not worth keeping or cannot be packed.

    Worth keeping is what took ``slow`` seconds, and no more bytes than ``BYTES_A_SECOND`` allows.
    """
    if seconds < slow:
        return None
    allowed = BYTES_A_SECOND * seconds if slow > 0.0 else math.inf
    try:
        content = pack((value, f"{datetime.now(UTC):%Y-%m-%d %H:%M}"), COMPRESSED * allowed)
    except (TypeError, ValueError, RecursionError):
        return None
    return content if len(content) <= allowed else None


class _Remembering(Executor):
    """A pool whose calls are looked for in a store first; what an exception ends is not kept."""

    def __init__(self, pool: Executor, store: RunStore) -> None:
        self._pool, self._store = pool, store

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return the answer as it was kept, or call ``fn`` in a worker and keep it."""
        key = key_of_call(fn, args, kwargs)
        kept = self._store.find_call(key)
        answer: Future[Any] = Future()
        if kept is not None:
            answer.set_result(kept[0])
            return answer
        answer.set_running_or_notify_cancel()

        def keep(future: Future[Any]) -> None:
            error = CancelledError() if future.cancelled() else future.exception()
            if error is not None:
                answer.set_exception(error)
            else:
                value, content = future.result()
                answer.set_result(value)
                self._store.keep_call(key, f"{fn.__module__}.{fn.__qualname__}", content)

        self._pool.submit(_timed, fn, args, kwargs, self._store.slow).add_done_callback(keep)
        return answer


def _timed(fn: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any], slow: float) -> Any:
    """Return the answer of a call, and the same packed if it is worth keeping."""
    began = time.perf_counter()
    answer = fn(*args, **kwargs)
    return answer, packed(answer, time.perf_counter() - began, slow)


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
    return home / "flipproof" / NAME
