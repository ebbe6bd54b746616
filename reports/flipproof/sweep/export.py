"""The rows of a sweep as one CSV or Parquet file, in the order of the design.

A missing number is an empty cell (CSV) or a null (Parquet), and the column ``reason`` says why. CSV writes floats so
that they read back to the last bit. The full parameters of a row and its curves stay in the store, under its key.
"""

from __future__ import annotations

import csv
import sqlite3
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any, Final

from flipproof.sweep.errors import SweepError
from flipproof.sweep.files import whole_file
from flipproof.sweep.schema import columns, kinds
from flipproof.sweep.store import Store

LEFT_OUT: Final = ("parameters", "versions", "curves", "checksum")


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
    design = store.design
    types = {n: kind for n, kind in zip(columns(design), kinds(design), strict=True) if n not in LEFT_OUT}
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
