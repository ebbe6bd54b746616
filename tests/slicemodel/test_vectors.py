"""The published programs, reproduced over the whole run and not only at its end."""

import numpy as np
import pytest

import slicemodel
from slicemodel import vectors

VECTORS = {vector.name: vector for vector in vectors.load_all()}
PYTHON = [name for name in VECTORS if name.startswith("python")]
# Where the two agree to round-off, and the only thing between us and zero is the order of additions.
PYTHON_TOLERANCE = 1e-10
MATLAB_TOLERANCE = 1e-8


def run(vector: vectors.Vector) -> slicemodel.Trajectory:
    return slicemodel.solve(vector.scenario, vector.scheme, vector.steps)


@pytest.mark.parametrize("name", PYTHON)
def test_published_python_prints_the_published_numbers(name):
    vector = VECTORS[name]
    trajectory = run(vector)
    assert trajectory.status == "ok"
    deviations = vectors.deviations(vector, trajectory)
    assert set(deviations) == {"t", "theta", "omega", "r_cm", "inertia", "r_first", "r_middle", "r_last"}
    assert max(deviations.values()) <= PYTHON_TOLERANCE, deviations


@pytest.mark.parametrize("name", ["matlab_default", "matlab_no_drag"])
def test_published_matlab_prints_the_published_numbers(name):
    vector = VECTORS[name]
    deviations = vectors.deviations(vector, run(vector))
    assert {"theta", "omega", "r_cm", "r_first", "r_middle", "r_last", "r_min", "r_max"} <= set(deviations)
    assert max(deviations.values()) <= MATLAB_TOLERANCE, deviations


def test_published_matlab_default_overflows_where_the_program_does():
    vector = VECTORS["matlab_default"]
    trajectory = run(vector)
    finite = np.isfinite(vector.columns["omega"])
    assert trajectory.status == "overflow"
    assert len(trajectory.t) == int(np.argmin(finite)) == 302
    assert np.isfinite(trajectory.r).all()
    assert trajectory.message.startswith("slice 0 left the bottle at t = 0.025025 s")
    assert "after t = 0.301301 s" in trajectory.message


def test_published_matlab_without_drag_reports_the_escape():
    vector = VECTORS["matlab_no_drag"]
    trajectory = run(vector)
    outside = (vector.columns["r_min"] < 0) | (vector.columns["r_max"] > vector.scenario.bottle.length)
    first = vector.columns["t"][int(np.argmax(outside))]
    assert trajectory.status == "escaped"
    assert len(trajectory.t) == vector.steps
    assert trajectory.message == f"slice 97 left the bottle at t = {first:.6g} s"


def test_a_wrong_number_in_a_vector_is_noticed():
    vector = VECTORS["python_ten_slices_sticky"]
    trajectory = run(vector)
    columns = dict(vector.columns)
    columns["omega"] = columns["omega"].copy()
    columns["omega"][500] *= 1 + 1e-9
    spoiled = vectors.Vector(
        name="spoiled",
        scenario=vector.scenario,
        scheme=vector.scheme,
        middle_slice=vector.middle_slice,
        until=vector.until,
        columns=columns,
    )
    assert vectors.deviations(spoiled, trajectory)["omega"] > PYTHON_TOLERANCE


def test_nan_is_never_a_small_deviation():
    assert not vectors.relative_deviation(np.array([1.0, np.nan]), np.array([1.0, 1.0])) <= 1.0
    assert not vectors.relative_deviation(np.array([1e-20]), np.array([0.0])) <= 1.0
    assert vectors.relative_deviation(np.array([0.0]), np.array([0.0])) == 0.0
