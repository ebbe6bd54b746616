"""The rows of a sweep as one table: CSV, or through ``xarray`` netCDF.

A missing number is an empty cell (CSV) or NaN (netCDF), and the column ``reason`` says why. Floats read back to the
last bit. Curves stay in the store.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np

from flipproof.frame.store import Store, json_of
from flipproof.output.files import whole_file
from flipproof.sweep.errors import SweepError
from flipproof.sweep.loop import rows_of
from flipproof.sweep.work import CURVES, Point

ENDINGS: Final = (".csv", ".nc")


def check_export(path: Path, out: Path) -> None:
    """Refuse, before the sweep begins, a file that could not be written after it; the sweep's folder may hold it."""
    if path.suffix not in ENDINGS:
        raise SweepError(f"--export {path}: the ending {path.suffix!r} is neither {' nor '.join(ENDINGS)}")
    parent = path.resolve().parent
    if path.is_dir() or not (parent.is_dir() or parent == out.resolve()):
        raise SweepError(f"--export {path}: {'is a folder' if path.is_dir() else 'its folder does not exist'}")
    if path.suffix == ".nc":
        _xarray()


def export(store: Store, points: Iterable[Point], swept: Iterable[Mapping[str, Any]] | None, path: Path) -> None:
    """Write the rows of points to ``path``; what was there stays until the new file is whole.

    ``swept`` are the values that lead each row, by name; None: every field of the throw.
    """
    with whole_file(path.resolve()) as part:
        if path.suffix == ".csv":
            with part.open("w", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows(table(store, points, swept))
        else:
            dataset(store, points, swept).to_netcdf(part, engine="scipy")


def table(
    store: Store, points: Iterable[Point], swept: Iterable[Mapping[str, Any]] | None = None
) -> Iterator[list[Any]]:
    """Yield the names of columns, then swept values, solver, settings and what came of it, point by point."""
    points = list(points)
    fields_of = map(_fields, points) if swept is None else swept
    for number, (point, fields, row) in enumerate(zip(points, fields_of, rows_of(store, points), strict=True)):
        assert row is not None
        scalars = {name: value for name, value in row.items() if name not in CURVES}
        if number == 0:
            yield [*fields, "solver", "settings", *scalars]
        yield [*fields.values(), point.solver, json_of(point.settings), *scalars.values()]


def _fields(point: Point) -> dict[str, Any]:
    fields = {f"bottle.{name}": value for name, value in point.throw["bottle"].items()}
    for name, value in point.throw["scenario"].items():
        fields |= {f"{name}.x": value[0], f"{name}.y": value[1]} if isinstance(value, list) else {name: value}
    return fields


def dataset(store: Store, points: Iterable[Point], swept: Iterable[Mapping[str, Any]] | None = None) -> Any:
    """Return the table as an ``xarray.Dataset`` over ``point``: one variable a column, missing numbers NaN."""
    header, *rows = table(store, points, swept)
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    variables = {}
    for name, cells in columns.items():
        words = any(isinstance(cell, str) for cell in cells)
        variables[name] = ("point", np.array(cells, dtype=str if words else float))
    return _xarray().Dataset(variables)


def _xarray() -> Any:
    try:
        return import_module("xarray")
    except ModuleNotFoundError:
        raise SweepError("--export FILE.nc needs xarray: install flipproof with its extra 'xarray'") from None
