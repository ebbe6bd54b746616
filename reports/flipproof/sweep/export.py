"""The rows of a sweep as one CSV or Parquet file, in the order of the design.

A missing number is an empty cell (CSV) or a null (Parquet), and the column ``reason`` says why. CSV writes floats so
that they read back to the last bit. The full parameters of a row and its curves stay in the store, under its key.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from flipproof.sweep.errors import SweepError
from flipproof.sweep.files import whole_file
from flipproof.sweep.schema import columns
from flipproof.sweep.store import Store

LEFT_OUT: Final = ("parameters", "versions", "curves", "checksum")
Rows = list[tuple[Any, ...]]


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
    names = [name for name in columns(store.design) if name not in LEFT_OUT]
    try:
        rows = store.connection.execute(f"SELECT {', '.join(names)} FROM points ORDER BY number")
        chunks: Iterator[Rows] = iter(lambda: rows.fetchmany(10_000), [])
        with whole_file(path.resolve()) as part:
            if path.suffix == ".csv":
                _write_csv(part, names, chunks)
            else:
                types = {name: kind for _, name, kind, *_ in store.connection.execute("PRAGMA table_info(points)")}
                _write_parquet(part, {name: types[name] for name in names}, chunks)
    except OSError as error:
        words = f"{path} cannot be written ({error.strerror or error}); the rows are in {store.file}"
        raise SweepError(words) from None


def _write_csv(path: Path, names: list[str], chunks: Iterator[Rows]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        for chunk in chunks:
            writer.writerows(chunk)


def _write_parquet(path: Path, types: dict[str, str], chunks: Iterator[Rows]) -> None:
    pyarrow = _pyarrow(path)
    parquet = import_module("pyarrow.parquet")
    kinds = {"REAL": pyarrow.float64(), "INTEGER": pyarrow.int64(), "TEXT": pyarrow.string()}
    schema = pyarrow.schema([(name, kinds[kind]) for name, kind in types.items()])
    with parquet.ParquetWriter(path, schema) as writer:
        for chunk in chunks:
            writer.write_table(pyarrow.table(list(map(list, zip(*chunk, strict=True))), schema=schema))


def _pyarrow(path: Path) -> Any:
    try:
        return import_module("pyarrow")
    except ModuleNotFoundError:
        raise SweepError(f"--export {path} needs pyarrow: install flipproof with its extra 'parquet'") from None
