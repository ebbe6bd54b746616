"""The published programs' printed numbers, and how far a run of ours is from them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, Trajectory


@dataclass(frozen=True, slots=True)
class Vector:
    """A run of a published program: throw, the scheme that must reproduce it, what was printed (column -> values)."""

    name: str
    scenario: Scenario
    scheme: str
    middle_slice: int
    until: float
    columns: Mapping[str, FloatArray]

    @property
    def steps(self) -> int:
        """Points of the published grid."""
        return len(self.columns["t"])


def folder() -> Path:
    """Return where the vectors are: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parent
    for place in (package / "published", package.parent / "tests" / "vectors"):
        if place.is_dir():
            return place
    raise FileNotFoundError(
        f"the published vectors are neither in {package / 'published'} nor in a checkout's tests/vectors"
    )


def load_all() -> tuple[Vector, ...]:
    """Return every published vector, the Python program's first."""
    vectors = []
    for entry in json.loads((folder() / "python_vectors.json").read_text(encoding="utf-8")):
        named = {"n_slices": "n_slices", "water_mass": "water_mass", "drag": "alpha", "omega0": "omega_0"}
        named |= {"theta0": "theta_0", "duration": "t_max"}
        throw = Scenario(restitution=-entry["beta"], **{name: entry[printed] for name, printed in named.items()})
        vectors.append(_vector(entry["file"], "published-python", throw, throw.n_slices // 2, throw.duration))
    # MATLAB counts slices from 1. Its default run is compared up to 0.2 s: its slices are thrown out to infinity later.
    default, no_drag = Scenario(n_slices=500, drag=0.01, duration=1.0), Scenario(n_slices=100, drag=0.0, duration=0.3)
    vectors.append(_vector("matlab_default.csv", "published-matlab", default, 249, 0.2))
    vectors.append(_vector("matlab_no_drag.csv", "published-matlab", no_drag, 49, 0.3))
    return tuple(vectors)


def _vector(file: str, scheme: str, scenario: Scenario, middle_slice: int, until: float) -> Vector:
    with (folder() / file).open(encoding="utf-8") as lines:
        header = lines.readline().strip().split(",")
        columns = dict(zip(header, np.loadtxt(lines, delimiter=",").T, strict=True))
    return Vector(file.removesuffix(".csv"), scenario, scheme, middle_slice, until, columns)


def deviations(vector: Vector, trajectory: Trajectory) -> dict[str, float]:
    """Largest relative deviation from every printed column over all t <= ``vector.until``.

    A column that is zero at a point must be zero there. A run that ends too early deviates by infinity.
    """
    points = int(np.searchsorted(vector.columns["t"], vector.until, side="right"))
    if len(trajectory.t) < points:
        return {"t": float("inf")}
    ours = {name: getattr(trajectory, name) for name in ("t", "theta", "omega", "r_cm", "inertia")} | {
        "r_first": trajectory.r[:, 0],
        "r_middle": trajectory.r[:, vector.middle_slice],
        "r_last": trajectory.r[:, -1],
        "r_min": trajectory.r.min(axis=1),
        "r_max": trajectory.r.max(axis=1),
    }
    compared = (name for name in vector.columns if name in ours)
    return {name: relative_deviation(ours[name][:points], vector.columns[name][:points]) for name in compared}


def relative_deviation(values: FloatArray, expected: FloatArray) -> float:
    """Return max |values - expected| / |expected|, 0 where both are 0; NaN anywhere gives NaN."""
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.abs(values - expected) / np.abs(expected)
    return float(np.where((values == 0.0) & (expected == 0.0), 0.0, relative).max())
