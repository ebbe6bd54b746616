"""Table, touch and outcome: what they refuse, and that a touch is the flight it was taken from."""

import math
import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from touches import touch

import slicemodel
from slicemodel import Outcome, Scenario, ScenarioError, Table, Touch
from slicemodel.landing import lab_motion

THROW = Scenario(n_slices=20, omega0=16.0)
TABLE = Table(height=-0.36)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"restitution": 1.1}, r"table.restitution = 1.1 is outside \[0, 1\]"),
        ({"restitution": -0.1}, r"table.restitution = -0.1 is outside \[0, 1\]"),
        ({"restitution": math.nan}, r"table.restitution = nan is outside \[0, 1\]"),
        ({"friction": -0.4}, r"table.friction = -0.4 is outside \[0, 1e\+15\]"),
        ({"height": math.inf}, r"table.height = inf m is outside \[-1e\+15, 1e\+15\]"),
        ({"height": "low"}, r"table.height = 'low' is not a number"),
    ],
)
def test_a_table_is_refused_by_field_and_range(changes, words):
    with pytest.raises(ScenarioError, match=words):
        Table(**({"height": 0.0} | changes))


def test_all_problems_of_a_table_are_told_at_once():
    with pytest.raises(ScenarioError, match=r"restitution = 2.*friction = -1"):
        Table(height=0.0, restitution=2, friction=-1)


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


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"theta": math.nan}, "touch.theta = nan rad"),
        ({"velocity": (math.inf, 0.0)}, "touch.velocity.x = inf m/s"),
        *(
            ({"velocity": wrong}, "touch.velocity = .* is not a pair .* of numbers in m/s")
            for wrong in ((1,), 1.0, "12", None, (1, 2, 3))
        ),
        *(
            ({name: wrong}, rf"touch.{name} = .* is not an array of numbers")
            for name in ("r", "v")
            for wrong in ("abcd", ["a"] * 20, [[1.0], [1.0, 2.0]], {})
        ),
        ({"velocity": (1,), "v": "abcd"}, "touch.velocity = .*; touch.v = "),
        ({"r": np.zeros(3)}, r"touch.r has shape \(3,\), not \(20,\)"),
        ({"v": np.full(20, math.nan)}, r"touch.v\[0\] = .*nan.* is not finite"),
        ({"r": np.full(20, 0.3)}, r"touch.r\[0\] = 0.3 m is outside \[0, 0.28\]"),
        (
            {"scenario": replace(THROW, gravity=0.0)},
            r"touch.scenario.gravity = 0.0 m/s\^2 is outside \[1e-15, 1e\+15\]",
        ),
        ({"scenario": replace(THROW, frozen=True), "v": np.ones(20)}, "touch.v is not 0 everywhere"),
    ],
)
def test_a_touch_is_refused_by_field_and_range(changes, words):
    with pytest.raises(ScenarioError, match=words):
        good(**changes)


def test_a_touch_cannot_be_changed():
    start = good()
    with pytest.raises(FrozenInstanceError):
        start.theta = 0.0
    with pytest.raises(ValueError, match="read-only"):
        start.r[0] = 0.0
    assert start.tilt == pytest.approx(0.1)
    assert good(theta=0.1 - 4 * math.pi).tilt == pytest.approx(0.1, abs=1e-12)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"outcome": "standing"}, "outcome = 'standing' is unknown"),
        ({"outcome": "undecided", "reason": ""}, "reason is empty"),
        ({"margin": 0.0}, "margin = 0.0 at 0.2 s does not certify"),
        ({"certified": None}, "does not certify"),
        ({"margin": math.nan}, "does not certify"),
    ],
)
def test_an_outcome_needs_its_certificate(changes, words):
    fields = {"outcome": "upright", "certified": 0.2, "margin": 0.1, "solver": "x", "method": "y"}
    with pytest.raises(ValueError, match=words):
        Outcome(**(fields | changes))


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
