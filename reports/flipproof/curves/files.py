"""Curves from elsewhere: CSV, Parquet, NPZ and NetCDF files, and objects of pandas and xarray, with any columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from slicemodel.scenario import shortened, unknown_name
from slicemodel.trajectory import FloatArray

TIMES: Final = ("t", "time", "Time", "t_s")
"""Columns that may hold the time; the first that is there does."""

SUFFIXES: Final = (".csv", ".parquet", ".npz", ".nc")


@dataclass(frozen=True, slots=True)
class Curves:
    """Columns over time.

    Parameters
    ----------
    label : name for messages
    t : (P,) - times, P >= 2, never decreasing; two values at one time are those before and after an event
    columns : (P,) each, finite
    t_events : times of the events, if they are known; None: jumps are looked for
    """

    label: str
    t: FloatArray
    columns: Mapping[str, FloatArray]
    t_events: FloatArray | None = None


def curves(
    label: str,
    table: Mapping[str, Any],
    columns: Sequence[str] | None = None,
    t_events: Any = None,
) -> Curves:
    """Return the columns of a table as curves.

    Parameters
    ----------
    columns : names of those to compare; None: all columns of real numbers as long as that of the time

    Raises
    ------
    ValueError
        in one line with column and row (from 1, the header not counted), for what is missing, not a real number, not
        finite, too short, or goes back in time
    """
    names = [str(name) for name in table]
    time = next((name for name in TIMES if name in names), None)
    if time is None:
        raise ValueError(
            f"{label}: has no column {' or '.join(TIMES[:2])}; it has {shortened(', '.join(names), 80) or 'none'}"
        )
    for name in columns or ():
        if name not in names:
            raise ValueError(f"{label}: {unknown_name('column', name, names)}")
    t = _numbers(label, time, table[time])
    if len(t) < 2:
        raise ValueError(f"{label}: column {time!r} has {len(t)} rows; at least 2 are needed")
    decreasing = np.flatnonzero(np.diff(t) < 0.0)
    if len(decreasing):
        k = int(decreasing[0])
        raise ValueError(
            f"{label}: row {k + 2}, column {time!r}: {t[k + 1]:g} follows {t[k]:g}; times must not decrease"
        )
    if columns is None:
        columns = [name for name in names if name not in (time, "t_events") and np.shape(table[name]) == t.shape]
    arrays = {name: _numbers(label, name, table[name]) for name in columns}
    for name, values in arrays.items():
        if len(values) != len(t):
            raise ValueError(f"{label}: column {name!r} has {len(values)} rows, {time!r} has {len(t)}")
    if not arrays:
        others = ", ".join(f"{name!r} {np.shape(table[name])}" for name in names if name not in (time, "t_events"))
        shapes = f" {t.shape}, but {shortened(others, 80)}" if others else ""
        if any(np.ndim(table[name]) > 1 for name in names):
            shapes += "; save the rows of an array as columns of their own,"
        raise ValueError(f"{label}: has no column beside {time!r}{shapes} to compare")
    events = None if t_events is None else np.sort(_numbers(label, "t_events", t_events))
    return Curves(label, t, arrays, events)


def _numbers(label: str, name: str, values: Any) -> FloatArray:
    """Return a column as floats; an empty cell, NaN, an infinity or a word raises ValueError with its row."""
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind == "c":
        raise ValueError(f"{label}: column {name!r} is not one column of real numbers, but {array.dtype} {array.shape}")
    try:
        numbers = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.array([_number(label, name, row, value) for row, value in enumerate(array, start=1)])
    invalid = np.flatnonzero(~np.isfinite(numbers))
    if len(invalid):
        raise ValueError(f"{label}: row {invalid[0] + 1}, column {name!r}: {numbers[invalid[0]]} is not finite")
    return numbers


def _number(label: str, name: str, row: int, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        problem = "is empty" if not str(value).strip() else f"{shortened(repr(str(value)), 40)} is not a number"
        raise ValueError(f"{label}: row {row}, column {name!r}: {problem}") from None


def read(path: Path | str, columns: Sequence[str] | None = None) -> Curves:
    """Read a CSV, Parquet, NPZ or NetCDF file as ``curves`` does; an array ``t_events`` of an NPZ file is its events.

    Raises ValueError, naming the file and what is wrong with it; Parquet needs pandas, NetCDF xarray.
    """
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise ValueError(f"{path}: the name must end in {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise ValueError(f"{path}: is no file")
    if path.suffix == ".csv":
        from flipproof.output.tables import other_separator, read_cells

        names, rows = read_cells(path)
        if hint := other_separator(names):
            raise ValueError(f"{path}: {hint}")
        cells = list(zip(*(row for _, row in rows), strict=True)) or [()] * len(names)
        return curves(str(path), dict(zip(names, cells, strict=True)), columns)
    try:
        table = _binary(path)
    except ImportError as error:
        raise ValueError(f"{path}: reading {path.suffix} needs {error.name or 'a package'}, which is missing") from None
    except Exception as error:  # every library has its own errors for a file that is not what its name says
        raise ValueError(f"{path}: cannot be read as {path.suffix} ({shortened(str(error), 120)})") from None
    return curves(str(path), table, columns, table.get("t_events"))


def _binary(path: Path) -> dict[str, Any]:
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as arrays:
            return dict(arrays)
    if path.suffix == ".parquet":
        import pandas

        return {str(name): values.to_numpy() for name, values in pandas.read_parquet(path).items()}
    import xarray

    with xarray.open_dataset(path, decode_times=False) as dataset:
        return {str(name): values.to_numpy() for name, values in dataset.variables.items()}
