"""Trajectories as CSV files: one row per time, SI units, a header that says what each column is."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from flipproof.frame.columns import Series
from slicemodel import Trajectory
from slicemodel.scenario import UnsuitableFileError, read_text, shortened
from slicemodel.trajectory import FloatArray

Rows = list[tuple[int, list[str]]]


def trajectory_csv(trajectory: Trajectory) -> str:
    """Return the run as CSV text: t, theta, omega, r_cm, inertia, then r_i and v_i of every slice if they are stored.

    Slices count from 0. Numbers have 15 significant digits. What a solver did not give is left out.
    """
    quantities = ("t", "theta", "omega", "r_cm", "inertia")
    names = [name for name in quantities if name not in trajectory.diagnostics.get("not_given", ())]
    columns = [getattr(trajectory, name) for name in names]
    if len(trajectory.r) == len(trajectory.t):
        slices = range(trajectory.scenario.n_slices)
        names += [f"r_{i}" for i in slices] + [f"v_{i}" for i in slices]
        columns += [*trajectory.r.T, *trajectory.v.T]
    text = io.StringIO()
    np.savetxt(text, np.column_stack(columns), delimiter=",", header=",".join(names), comments="", fmt="%.15g")
    return text.getvalue()


QUANTITIES: Final = ("omega", "theta", "r_cm")
"""What curves are compared in: angular velocity [rad/s], angle [rad], centre of mass from the cap [m]."""

IN_FLIGHT: Final = ("in_flight", "t_over_T")
"""Columns by which a measured track says which rows are the flight, and when it began."""


@dataclass(frozen=True, slots=True)
class Curve:
    """What is compared: by quantity its times [s] and values, each of shape (P,), P >= 2; times do not decrease.

    Two values at one time are those before and after an event. ``notes`` say what was done to read the curve.
    """

    label: str
    series: Series
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, trajectory: Trajectory) -> Curve:
        """Return the curve of a run, without what its solver did not give."""
        given = [name for name in QUANTITIES if name not in trajectory.diagnostics.get("not_given", ())]
        return cls(trajectory.label, {name: (trajectory.t, getattr(trajectory, name)) for name in given})


def read_curve(path: Path) -> Curve:
    """Read a CSV file with a column t and at least one of omega, theta and r_cm; empty cells are left out.

    Of a measured track (the columns ``in_flight`` and ``t_over_T`` of ``flipproof track``) the rows in flight are
    taken, and the times are counted from the release, as those of a solver are. Raises ValueError, naming file, line
    and column of what is missing, not a number, not finite, or goes back in time.
    """
    names, rows = read_cells(path)
    quantities = [name for name in QUANTITIES if name in names]
    if "t" not in names or not quantities:
        missing = "t" if "t" not in names else f"of {', '.join(QUANTITIES)}"
        raise ValueError(f"{path}: the header has no column {missing}; it has {shortened(', '.join(names), 80)}")
    notes: tuple[str, ...] = ()
    release = 0.0
    if {*IN_FLIGHT} <= {*names}:
        rows, release = _flight_in(path, names, rows)
        notes = (f"{path}: rows in flight, times from the release at {release:.6g} s",)
    elif ignored := [name for name in names if name not in ("t", *quantities)]:
        columns = f"{shortened(', '.join(ignored), 80)} {'is' if len(ignored) == 1 else 'are'}"
        notes = (f"{path}: {columns} not compared; --columns compares any",)
    series: dict[str, tuple[FloatArray, FloatArray]] = {}
    for name in quantities:
        t, values = _series(path, names, rows, name)
        if len(t) >= 2:
            series[name] = t - release, values
    if not series:
        raise ValueError(f"{path}: has fewer than 2 rows with t and one of {', '.join(quantities)}")
    return Curve(str(path), series, notes)


def _series(path: Path, names: list[str], rows: Rows, name: str) -> tuple[FloatArray, FloatArray]:
    """Return times and values of the rows in which both cells are filled."""
    places = names.index("t"), names.index(name)
    filled = [(line, cells) for line, cells in rows if all(cells[place].strip() for place in places)]
    t, values = numbers_in(path, names, filled, ("t", name)).T
    back = np.flatnonzero(np.diff(t) < 0)
    if len(back):
        k = int(back[0]) + 1
        raise ValueError(f"{path}: line {filled[k][0]}: t = {t[k]:g} s follows t = {t[k - 1]:g} s")
    return t, values


def _flight_in(path: Path, names: list[str], rows: Rows) -> tuple[Rows, float]:
    """Return the rows in flight of a measured track and its release [s], where t / T is 0.

    Raises ValueError if fewer than 2 rows are in flight.
    """
    rows = [(line, cells) for line, cells in rows if cells[names.index(IN_FLIGHT[0])].strip() == "1"]
    t, share = _series(path, names, rows, IN_FLIGHT[1])
    if len(t) < 2 or not share[-1] > share[0]:
        raise ValueError(f"{path}: fewer than 2 rows are in flight (columns {' and '.join(IN_FLIGHT)})")
    return rows, float(t[0] - share[0] * (t[-1] - t[0]) / (share[-1] - share[0]))


SEPARATORS: Final = {";": "semicolons", "\t": "tabs"}
"""What other programs separate columns by."""


def other_separator(names: list[str]) -> str:
    """Return that columns are separated otherwise, if a header of one name says so; else nothing."""
    found = next((name for mark, name in SEPARATORS.items() if len(names) == 1 and mark in names[0]), "")
    return found and f"it has {found}: separate columns by commas, and write 0.5, not 0,5"


DECIMAL_COMMA: Final = "a decimal comma? numbers need points"
"""What may be wrong with a table in which numbers fall apart."""


def read_cells(path: Path, max_bytes: int = 2**26) -> tuple[list[str], Rows]:
    """Return the names of a table's columns, and line number and cells of every row that is not blank.

    Raises ValueError if the file cannot be read, is larger than ``max_bytes``, is empty, names a column twice, or has a
    row of another length.
    """
    try:
        lines = read_text(path, max_bytes).splitlines()
    except UnsuitableFileError as error:
        raise ValueError(f"{path}: {error}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    # Lines that begin with # tell people what the table is.
    numbered = [(n, line) for n, line in enumerate(lines, start=1) if line.strip() and not line.startswith("#")]
    if not numbered:
        raise ValueError(f"{path}: is empty")
    names = [name.strip() for name in _split(numbered[0][1])]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{path}: line {numbered[0][0]} names the column {twice!r} twice")
    rows = [(n, _split(line)) for n, line in numbered[1:]]
    for n, cells in rows:
        if len(cells) != len(names):
            hint = other_separator(names) or (DECIMAL_COMMA if len(cells) == 2 * len(names) else "")
            words = f" ({hint})" if hint else ""
            raise ValueError(f"{path}: line {n} has {len(cells)} cells, the header has {len(names)}{words}")
    return names, rows


def _split(line: str) -> list[str]:
    """Return the cells of a line; a quoted one may hold commas, as names of Modelica do."""
    return next(csv.reader([line], skipinitialspace=True)) if '"' in line else line.split(",")


def numbers_in(path: Path, names: Sequence[str], rows: Rows, wanted: Sequence[str]) -> FloatArray:
    """Return some columns of a table, shape (rows, columns), NaN where a cell is empty; refuse as ``number_of``."""
    places = [(name, names.index(name)) for name in wanted]
    numbers = [
        [number_of(path, line, name, cells[k]) if cells[k].strip() else np.nan for name, k in places]
        for line, cells in rows
    ]
    return np.array(numbers, dtype=np.float64).reshape(-1, len(places))


def number_of(path: Path, line: int, column: str, cell: str) -> float:
    """Return a cell's number; if it is none, or not finite, raises ValueError, naming file, line and column."""
    try:
        value = float(cell)
    except ValueError:
        hint = f"; {DECIMAL_COMMA}" if "," in cell else ""
        raise ValueError(f"{path}: line {line}, column {column}: {cell.strip()!r} is not a number{hint}") from None
    if not np.isfinite(value):
        raise ValueError(f"{path}: line {line}, column {column}: {cell.strip()} is not finite")
    return value
