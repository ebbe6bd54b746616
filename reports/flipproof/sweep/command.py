"""A sweep from its design to its summary: what the command line does."""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from flipproof.frame.processes import cores, processes
from flipproof.frame.store import Store, has_code
from flipproof.output.files import TEMPORARY, write_whole
from flipproof.output.folder import MARKER, OutputError, check_own, marker_text
from flipproof.sweep.design import read_design
from flipproof.sweep.entries import try_entries
from flipproof.sweep.errors import SweepError
from flipproof.sweep.export import check_export, export
from flipproof.sweep.loop import IN_FLIGHT, Progress, executor_of, fill, rows_of
from flipproof.sweep.work import OUTCOMES, Point, code_identity, versions
from slicemodel.scenario import shortened

FILE: Final = "sweep.sqlite"
"""Name of the store in a sweep's folder."""

KIND: Final = "sweep"

NO_FLIGHT: Final = frozenset(("failed", "impossible", "worker-died"))
"""Statuses of points that say in their reason why nothing was thrown."""

Begin = Callable[[int], Progress]
"""Called once with the points of the design, when the work begins; returns what follows it."""


def sweep(file: Path, out: Path, begin: Begin, **how: Any) -> str:
    """Make every point of the design in ``file`` that has no row in ``out``, as ``completed`` does; return its line."""
    design = read_design(file)
    if not (out / FILE).exists():
        # Before the folder knows the design, so that the mended file may have the same folder.
        try_entries(design.entries)
    with completed(design.points, design.size, out, begin, swept=design.swept, **how) as (_, summary):
        return summary


@contextmanager
def completed(
    points: Callable[[], Iterable[Point]],
    size: int,
    out: Path,
    begin: Begin,
    *,
    say: Callable[[str], object] = lambda _: None,
    jobs: int | None = None,
    executor: str | None = None,
    export_to: Path | None = None,
    swept: Callable[[], Iterable[Mapping[str, Any]]] | None = None,
) -> Iterator[tuple[Store, str]]:
    """Give the store in ``out`` when every point has a row, and a line that tells what is there.

    Parameters
    ----------
    points : callable - yields all ``size`` points, each time in the same order
    say : callable - gets a line if the file was damaged, or holds rows by other code or made under other versions
    jobs : int or None - worker processes of this machine; None: one per core
    executor : str or None - who does the work in their place, "MODULE:FACTORY" or "MODULE:FACTORY@ARGUMENT"
    export_to : path or None - file to write all rows to when they are complete
    swept : callable or None - yields what leads each row there; None: every field of the throw

    Raises
    ------
    SweepError
        If the folder, the workers or the disk will not do, or no point has a flight; what was stored is kept.
    """
    began = time.perf_counter()
    if export_to:
        check_export(export_to, out)
    with _opened(out, say) as store:
        opened, progress = store.path.stat(), begin(size)
        with processes(jobs) if executor is None else executor_of(executor) as workers:
            in_flight = 2 * (jobs or cores()) if executor is None else IN_FLIGHT
            with _plainly(out):
                counts, new_count = fill(store, points(), workers, in_flight, progress)
        if export_to:
            with _plainly(out):
                export(store, points(), swept and swept(), export_to)
        if not (store.path.exists() and os.path.samestat(opened, store.path.stat())):
            raise SweepError(
                f"{store.path} was moved or replaced while the sweep went on, and rows may be in no file; run it again "
                "where the folder is now"
            )
        seconds = time.perf_counter() - began
        kinds = ", ".join(f"{counts[status]} {status}" for status in OUTCOMES if status in counts)
        rate = f"; {new_count} made in {seconds:.1f} s ({new_count / seconds:.0f} per second)" if new_count else ""
        stored = f"; {size - new_count} were there" if new_count < size else ""
        failure = _first_failure(store, points) if counts.keys() & NO_FLIGHT else ""
        if counts and counts.keys() <= NO_FLIGHT:
            raise SweepError(f"none of {size} points in {store.path} has a flight ({kinds}); the first: {failure}")
        failure = failure and f"\nthe first without a flight: {failure}"
        yield store, f"{size} points in {store.path}: {kinds}{rate}{stored}{failure}"


def _first_failure(store: Store, points: Callable[[], Iterable[Point]]) -> str:
    """Return why the first point in the order of the design that has no flight has none."""
    reasons = (str(row["reason"]) for row in rows_of(store, points()) if row and row["status"] in NO_FLIGHT)
    return shortened(next(reasons, ""), 200)


@contextmanager
def _opened(out: Path, say: Callable[[str], object]) -> Iterator[Store]:
    """Make or check the folder and give its store; say what of it was made by other code or other versions."""
    own_folder(out, KIND)
    try:
        store = Store(out / FILE, say=say)
    except (OSError, sqlite3.Error) as error:
        words = getattr(error, "strerror", None) or str(error)
        raise SweepError(f"{out / FILE} cannot be used ({words}); it is as it was") from None
    with store:
        _say_what_differs(store, say)
        yield store


def own_folder(out: Path, kind: str) -> None:
    """Make a folder and mark it as one of this ``kind``, or refuse, by a SweepError, one that holds anything else."""
    try:
        if out.exists() and not out.is_dir():
            raise SweepError(f"{out} is a file; --out names a folder")
        out.mkdir(parents=True, exist_ok=True)
        check_own(out, kind, ignored=[entry.name for entry in out.iterdir() if entry.name.endswith(TEMPORARY)])
        if not (out / MARKER).exists():
            write_whole(out / MARKER, marker_text(kind).encode())
    except OutputError as error:
        raise SweepError(str(error)) from None
    except OSError as error:
        raise SweepError(f"{out} cannot be written ({error.strerror or error})") from None


def _say_what_differs(store: Store, say: Callable[[str], object]) -> None:
    code, current = code_identity(), versions()
    codes = sorted({str(facts.get("code")) for facts in store.shared()} - {code})
    if codes:
        say(f"{store.path} holds rows by flipproof {', '.join(codes)} too; this is {code} and takes none of them")
    there = [facts.get("versions", {}) for facts in store.shared() if facts.get("code") == code]
    for name, version in current.items():
        stored = sorted(
            {str(row_versions[name]) for row_versions in there if row_versions.get(name, version) != version}
        )
        if stored:
            say(f"{store.path} holds rows made under {name} {', '.join(stored)}; this is {version}, and they are kept")


@contextmanager
def _plainly(out: Path) -> Iterator[None]:
    """Turn what a disk or SQLite refuses into one line."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        words = getattr(error, "strerror", None) or str(error)
        if has_code(error, sqlite3.SQLITE_FULL) or isinstance(error, OSError):
            words += ", is the disk full?" if os.path.lexists(out / FILE) and "full" not in words else ""
        kept = "the points stored so far are safe, the same command goes on from there"
        raise SweepError(f"{out} cannot be written ({words}); {kept}") from None
