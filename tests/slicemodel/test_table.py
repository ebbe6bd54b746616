"""Table, touch and outcome: they cannot be changed, and a touch is the flight it was taken from."""

import math
import pickle
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from touches import touch

import slicemodel
from slicemodel import Outcome, Scenario, ScenarioError, Table, Touch
from slicemodel.landing import lab_motion

THROW = Scenario(n_slices=20, omega0=16.0)
TABLE = Table(height=-0.36)


def test_all_problems_are_told_at_once():
    with pytest.raises(ScenarioError, match=r"restitution = 2.*friction = -1"):
        Table(height=0.0, restitution=2, friction=-1)
    with pytest.raises(ScenarioError, match=r"touch\.velocity = .*; touch\.v = "):
        good(velocity=(1,), v="abcd")


def good(**changes):
    return Touch(
        **(
            {
                "scenario": THROW,
                "theta": 0.1,
                "omega": 5.0,
                "velocity": (0.5, -2.0),
                "r": THROW.initial_positions(),
                "v": np.zeros(20),
            }
            | changes
        )
    )


def test_a_touch_cannot_be_changed():
    start = good()
    with pytest.raises(FrozenInstanceError):
        start.theta = 0.0
    with pytest.raises(ValueError, match="read-only"):
        start.r[0] = 0.0
    assert start.tilt == pytest.approx(0.1)
    assert good(theta=0.1 - 4 * math.pi).tilt == pytest.approx(0.1, abs=1e-12)


def test_an_outcome_can_be_sent_home():
    one = Outcome(outcome="cap", certified=0.2, margin=0.1, solver="x", method="y", settings={"dt": 1.0})
    other = pickle.loads(pickle.dumps(one))
    assert (other.outcome, other.margin, dict(other.settings)) == ("cap", 0.1, {"dt": 1.0})
    assert other.decided


def test_the_touch_is_where_a_corner_meets_the_table():
    flight = slicemodel.solve(THROW, steps=4000)
    start = touch(flight, TABLE)
    motion = lab_motion(flight)
    rim = THROW.bottle.radius * np.abs(np.sin(flight.theta))
    lowest = np.minimum(motion.base[:, 1], motion.cap[:, 1]) - rim
    k = int(np.flatnonzero(lowest <= TABLE.height)[0])
    assert flight.t[k - 1] <= start.time <= flight.t[k]
    for name in ("theta", "omega"):
        assert sorted(getattr(flight, name)[k - 1 : k + 1]) == pytest.approx([getattr(start, name)] * 2, abs=0.02)
    middle = (motion.base + motion.cap) / 2
    slope = (middle[k + 1] - middle[k - 2]) / (flight.t[k + 1] - flight.t[k - 2])
    assert start.velocity == pytest.approx(slope, abs=5e-3)
    assert np.all(np.abs(start.r - flight.r[k]) < 1e-2)
