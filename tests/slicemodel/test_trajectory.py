"""The one result object: shapes, honesty, immutability."""

import pickle

import numpy as np
import pytest

import slicemodel
from slicemodel import Impacts, Scenario, Trajectory
from slicemodel.trajectory import output_times

SCENARIO = Scenario(n_slices=2)


def fields(**changes):
    values = {
        "scenario": SCENARIO,
        "solver": "slicemodel",
        "method": "by-hand",
        "t": [0.0, 0.1],
        "theta": [1.0, 3.0],
        "omega": [20.0, 20.0],
        "r": np.full((2, 2), 0.1),
        "v": np.zeros((2, 2)),
        "r_cm": [0.1, 0.1],
        "inertia": [1.0, 1.0],
    }
    return values | changes


def test_arrays_cannot_be_written():
    trajectory = Trajectory(**fields())
    for name in ("t", "theta", "omega", "r", "v", "r_cm", "inertia"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(trajectory, name)[0] = 1.0
    with pytest.raises(TypeError):
        trajectory.settings["dt"] = 1.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"omega": [20.0, np.nan]}, "omega holds values that are not finite"),
        ({"r": np.full((2, 2), np.inf)}, "r holds values"),
        ({"theta": [1.0]}, "theta has shape"),
        ({"r": np.zeros((2, 3))}, "r has shape"),
        ({"t": [0.0, 0.0]}, "t does not increase"),
        ({"status": "fine"}, "status = 'fine'"),
    ],
)
def test_nothing_dishonest_can_be_built(changes, words):
    with pytest.raises(ValueError, match=words):
        Trajectory(**fields(**changes))


def test_pickles_with_everything():
    trajectory = slicemodel.solve(Scenario(n_slices=5), steps=50)
    copy = pickle.loads(pickle.dumps(trajectory))
    np.testing.assert_array_equal(copy.r, trajectory.r)
    np.testing.assert_array_equal(copy.impacts.time, trajectory.impacts.time)
    assert copy.settings == trajectory.settings
    assert copy.scenario == trajectory.scenario
    with pytest.raises(ValueError, match="read-only"):
        copy.r[0, 0] = 1.0


def test_impacts_of_unequal_length_are_refused():
    with pytest.raises(ValueError, match="one length"):
        Impacts(time=[0.1], slice=[0, 1], end=[1], speed_before=[1.0], speed_after=[0.5])


def test_default_times_are_a_thousand_with_both_ends():
    times = output_times(SCENARIO, None)
    assert (len(times), times[0], times[-1]) == (1000, 0.0, 0.5)


@pytest.mark.parametrize(
    ("times", "words"),
    [
        ([], "non-empty"),
        ([[0.1]], "one-dimensional"),
        ([0.1, 0.1], r"times\[1\] = .*0\.1"),
        ([0.0, 0.6], r"outside \[0, 0\.5\]"),
        ([np.nan], "outside"),
        ([-0.1], "outside"),
    ],
)
def test_bad_times_are_named(times, words):
    with pytest.raises(ValueError, match=words):
        output_times(SCENARIO, times)
