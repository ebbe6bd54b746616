"""Trajectories as CSV files: one row per time, SI units, a header that says what each column is."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray

COLUMNS = ("t", "theta", "omega", "r_cm", "inertia")


def trajectory_csv(trajectory: Trajectory) -> str:
    """Return the run as CSV text: t, theta, omega, r_cm, inertia, then r_i and v_i of every slice if they are stored.

    Slices count from 0. Numbers have 15 significant digits.
    """
    columns = [getattr(trajectory, name) for name in COLUMNS]
    names = list(COLUMNS)
    if len(trajectory.r) == len(trajectory.t):
        slices = range(trajectory.scenario.n_slices)
        names += [f"r_{i}" for i in slices] + [f"v_{i}" for i in slices]
        columns += [*trajectory.r.T, *trajectory.v.T]
    text = io.StringIO()
    np.savetxt(text, np.column_stack(columns), delimiter=",", header=",".join(names), comments="", fmt="%.15g")
    return text.getvalue()


@dataclass(frozen=True, slots=True)
class Curve:
    """What a CSV file must hold to be compared: t [s], theta [rad], omega [rad/s], r_cm [m], each of shape (P,)."""

    label: str
    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    r_cm: FloatArray

    @classmethod
    def of(cls, trajectory: Trajectory) -> Curve:
        """Return the curve of a run."""
        return cls(trajectory.label, trajectory.t, trajectory.theta, trajectory.omega, trajectory.r_cm)


def read_curve(path: Path) -> Curve:
    """Read a CSV file with at least the columns t, theta, omega and r_cm, in any order.

    Raises
    ------
    ValueError
        Naming file, line and column of what is missing, not a number, not finite, or not increasing in time.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if not lines:
        raise ValueError(f"{path}: is empty")
    names = [name.strip() for name in lines[0].split(",")]
    wanted = ("t", "theta", "omega", "r_cm")
    missing = [name for name in wanted if name not in names]
    if missing:
        raise ValueError(f"{path}: line 1 has no column {', '.join(missing)}; it has {', '.join(names)[:80]}")
    places = [names.index(name) for name in wanted]
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        cells = line.split(",")
        if not line.strip():
            continue
        if len(cells) != len(names):
            raise ValueError(f"{path}: line {number} has {len(cells)} cells, the header has {len(names)}")
        rows.append([number_of(path, number, name, cells[place]) for name, place in zip(wanted, places, strict=True)])
    if len(rows) < 2:
        raise ValueError(f"{path}: has {len(rows)} rows of numbers; at least 2 are needed")
    table = np.array(rows)
    if not np.all(np.diff(table[:, 0]) > 0):
        raise ValueError(f"{path}: t does not increase")
    return Curve(path.name, *table.T)


def number_of(path: Path, line: int, column: str, cell: str) -> float:
    """Return a cell's number.

    Raises
    ------
    ValueError
        If it is none, or not finite; the message names file, line and column.
    """
    try:
        value = float(cell)
    except ValueError:
        raise ValueError(f"{path}: line {line}, column {column}: {cell.strip()!r} is not a number") from None
    if not np.isfinite(value):
        raise ValueError(f"{path}: line {line}, column {column}: {cell.strip()} is not finite")
    return value
