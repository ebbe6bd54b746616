"""A sweep from its design to its summary, and its rows as one CSV or Parquet file: what the command line does.

In that file a missing number is an empty cell (CSV) or a null (Parquet), and the column ``reason`` says why. CSV
writes floats so that they read back to the last bit. The full parameters of a row and its curves stay in the store,
under its key.
"""

from __future__ import annotations

import csv
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any, Final

from flipproof.sweep.design import Plan, read_design
from flipproof.sweep.entries import try_entries
from flipproof.sweep.errors import SweepError
from flipproof.sweep.files import whole_file
from flipproof.sweep.run import Progress, dask_workers, local_workers, run_sweep
from flipproof.sweep.schema import FILE, columns
from flipproof.sweep.store import Store
from flipproof.sweep.work import OUTCOMES, code_identity

Begin = Callable[[int, int], Progress]
"""Called once with points there and points of the design, when the work begins; returns what follows it."""

LEFT_OUT: Final = ("parameters", "versions", "curves", "checksum")


def sweep(file: Path, out: Path, begin: Begin, **how: Any) -> str:
    """Make every point of the design in ``file`` that has no row in ``out``, as ``fill`` does; return its one line."""
    design = read_design(file)
    if not (out / FILE).exists():
        # Before the folder knows the design, so that the mended file may have the same folder.
        try_entries(design.entries)
    return fill(design, out, begin, lambda _, summary: summary, **how)


def fill(design: Plan, out: Path, begin: Begin, end: Callable[[Store, str], str], **how: Any) -> str:
    """Make every point of ``design`` that has no row in ``out``; return lines that tell what is there.

    If the file, the folder, the workers or the disk will not do, a SweepError says so; what was stored is kept.

    Parameters
    ----------
    end : callable (complete store, line that tells what is there) -> lines to return
    how : ``jobs``, ``dask`` and ``export_to`` of ``completed``
    """
    with completed(design, out, begin, **how) as (store, summary):
        return end(store, summary)


@contextmanager
def completed(
    design: Plan,
    out: Path,
    begin: Begin,
    *,
    jobs: int | None = None,
    dask: str | None = None,
    export_to: Path | None = None,
) -> Iterator[tuple[Store, str]]:
    """Give the store in ``out`` when every point of ``design`` has a row, and a line that tells what is there.

    Parameters
    ----------
    jobs : int or None - worker processes of this machine; None: one per core
    dask : str or None - address of a Dask scheduler whose workers take their place
    export_to : path or None - file to write all rows to when they are complete
    """
    began = time.perf_counter()
    if export_to:
        check_export(export_to, out)
    with Store(out, design, code_identity()) as store:
        there = sum(store.done())
        progress = begin(there, design.size)
        made = design.size - there
        if made:
            with local_workers(jobs) if dask is None else dask_workers(dask) as workers:
                run_sweep(store, workers, progress)
        if export_to:
            export(store, export_to)
        seconds, counts = time.perf_counter() - began, store.counts()
        kinds = ", ".join(f"{counts[status]} {status}" for status in OUTCOMES if status in counts)
        rate = f"; {made} made in {seconds:.1f} s ({made / seconds:.0f} per second)" if made else ""
        known = f"; {there} were there" if there else ""
        yield store, f"{design.size} points in {store.file}: {kinds}{rate}{known}"


def check_export(path: Path, out: Path) -> None:
    """Refuse, before the sweep begins, a file that could not be written after it; the sweep's folder may hold it."""
    if path.suffix not in (".csv", ".parquet"):
        raise SweepError(f"--export {path}: the ending {path.suffix!r} is neither .csv nor .parquet")
    parent = path.resolve().parent
    if path.is_dir() or not (parent.is_dir() or parent == out.resolve()):
        raise SweepError(f"--export {path}: {'is a folder' if path.is_dir() else 'its folder does not exist'}")
    if path.suffix == ".parquet":
        _pyarrow(path)


def export(store: Store, path: Path) -> None:
    """Write all rows of a store to ``path``; what was there stays until the new file is whole."""
    types = {name: kind for name, kind in columns(store.design).items() if name not in LEFT_OUT}
    try:
        rows = store.connection.execute(f"SELECT {', '.join(types)} FROM points ORDER BY number")
        with whole_file(path.resolve()) as part:
            if path.suffix == ".csv":
                with part.open("w", encoding="utf-8", newline="") as file:
                    csv.writer(file, lineterminator="\n").writerows(chain([types], rows))
            else:
                _write_parquet(part, types, rows)
    except OSError as error:
        words = f"{path} cannot be written ({error.strerror or error}); the rows are in {store.file}"
        raise SweepError(words) from None


def _write_parquet(path: Path, types: dict[str, str], rows: sqlite3.Cursor) -> None:
    pyarrow = _pyarrow(path)
    parquet = import_module("pyarrow.parquet")
    of_kind = {"REAL": pyarrow.float64(), "INTEGER": pyarrow.int64(), "TEXT": pyarrow.string()}
    schema = pyarrow.schema([(name, of_kind[kind]) for name, kind in types.items()])
    with parquet.ParquetWriter(path, schema) as writer:
        while chunk := rows.fetchmany(10_000):
            writer.write_table(pyarrow.table(list(map(list, zip(*chunk, strict=True))), schema=schema))


def _pyarrow(path: Path) -> Any:
    try:
        return import_module("pyarrow")
    except ModuleNotFoundError:
        raise SweepError(f"--export {path} needs pyarrow: install flipproof with its extra 'parquet'") from None
