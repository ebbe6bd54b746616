"""What a solver is asked, what it says of itself, and what counts as an answer."""

import math
from fractions import Fraction

import numpy as np
import pytest

from flipproof.foreign.checking import THROW, effort_of, times_of
from flipproof.foreign.contract import AnswerError, Ask, Traits, answer_of, solve_of, traits_of, trajectory_of
from flipproof.output.tables import Curve, trajectory_csv
from slicemodel import Scenario, Trajectory, solve
from slicemodel.observables import centre_of_mass, moment_of_inertia

ASK = Ask.of(THROW, times_of(THROW, 5), 0.01)
CURVE = {"t": ASK.times, "theta": ASK.times, "omega": 1.0 + ASK.times}
R = np.tile(ASK.start, (5, 1))


def test_an_ask_starts_at_rest_in_the_water_and_cannot_be_written():
    np.testing.assert_array_equal(ASK.start, THROW.initial_positions())
    assert ASK.effort == 0.01
    with pytest.raises(ValueError, match="read-only"):
        ASK.times[0] = 1.0


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"name": ""}, "name = '' is not a line of text"),
        ({"name": "a\nb"}, "is not a line of text"),
        ({"name": "a" * 101}, "has more than 100 characters"),
        ({"name": 5}, "name = 5"),
        ({"equation": "eq9"}, "equation = 'eq9'"),
        ({"equation": "switches:12"}, "switches"),
        ({"refined_by": "patience"}, "refined_by = 'patience'"),
        ({"precision": "float16"}, "precision = 'float16'"),
        ({"order": 0}, r"order = 0 is not a number in \(0, 40\]"),
        ({"order": math.nan}, "order = nan"),
        ({"order": True}, "order = True"),
        ({"order": "4"}, "order = '4'"),
        ({"timeout": -1.0}, r"timeout = -1.0 is not a number of seconds in \(0, 86400\]"),
        ({"expected_failures": ["ice"]}, r"expected_failures = \['ice'\]"),
        ({"expected_failures": {"ice": 1}}, "expected_failures = "),
    ],
)
def test_what_a_solver_says_wrongly_of_itself_is_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        Traits(**{"name": "mine", **wrong})


def test_a_function_and_an_object_have_traits():
    def plain(ask):
        return ask

    class Thing:
        name, equation, refined_by, order, precision = "thing", "eq8", "steps", 2, "float32"

        def solve(self, ask):
            return ask

    assert traits_of(plain, "file.py:plain") == Traits(name="file.py:plain")
    found = traits_of(Thing(), "x")
    assert (found.name, found.equation, found.order, found.epsilon) == ("thing", "eq8", 2, 2.0**-23)
    assert solve_of(plain)(3) == solve_of(Thing())(3) == 3
    with pytest.raises(ValueError, match="neither callable nor has a method solve"):
        traits_of(object(), "x")


def test_effort_follows_what_refines():
    def of(refined_by, level):
        return effort_of(Traits(name="x", refined_by=refined_by), THROW, level)

    assert of("dt", 1) == pytest.approx(of("dt", 0) / 2, abs=1e-18)
    assert of("steps", 1) == 2 * of("steps", 0) == 1920
    assert of("rtol", 1) == pytest.approx(1e-7, abs=1e-20)
    assert of("rtol", 20) == 1e-13
    assert of(None, 3) is None


def test_mappings_objects_and_trajectories_are_answers():
    class Given:
        t, theta, omega = ASK.times, ASK.times, 1.0 + ASK.times

    assert answer_of(ASK, CURVE).given == answer_of(ASK, Given()).given == ("t", "theta", "omega")
    run = solve(THROW, scheme="midpoint", steps=5)
    found = answer_of(ASK, run)
    np.testing.assert_array_equal(found.r, run.r)
    np.testing.assert_allclose(found.inertia, run.inertia, rtol=1e-14)


def test_centre_and_inertia_follow_from_positions():
    found = answer_of(ASK, CURVE | {"r": R})
    assert found.given == ("t", "theta", "omega", "r")
    np.testing.assert_array_equal(found.r_cm, centre_of_mass(THROW, R))
    np.testing.assert_array_equal(found.inertia, moment_of_inertia(THROW, R))


def test_impacts_come_as_rows_columns_or_mappings():
    row = {"time": 0.1, "slice": 0, "end": -1, "speed_before": 1.0, "speed_after": 0.5}
    forms = [[tuple(row.values())], [row], {name: [value] for name, value in row.items()}]
    for form in forms:
        (impact,) = answer_of(ASK, CURVE | {"impacts": form}).impacts
        assert (impact.end, impact.speed_after) == ("cap", 0.5)
    (impact,) = answer_of(ASK, CURVE | {"impacts": [(0.1, 0, -1, -1.0, 0.5)]}).impacts  # velocities
    assert (impact.speed_before, impact.speed_after) == (1.0, 0.5)
    assert len(answer_of(ASK, CURVE | {"impacts": []}).impacts) == 0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((pair for pair in CURVE.items()), "t and theta and omega missing .a generator came."),
        (lambda: CURVE, "t and theta and omega missing .a function came."),
        ({"t": ASK.times, "theta": ASK.times}, "omega missing; t, theta and omega are needed"),
        (CURVE | {"omega": np.ones(4)}, r"omega has shape \(4,\), not \(5,\)"),
        (CURVE | {"omega": np.ones((5, 1))}, r"omega has shape \(5, 1\), not \(5,\)"),
        (CURVE | {"omega": np.float64(20.0)}, r"omega has shape \(\), not \(5,\)"),
        (CURVE | {"omega": 20.0}, "omega is a float, not an array of numbers"),
        (CURVE | {"omega": []}, r"omega has shape \(0,\), not \(5,\)"),
        (CURVE | {"omega": np.broadcast_to(20.0, 10**9)}, r"omega has shape \(1000000000,\), not \(5,\)"),
        (CURVE | {"theta": [0.0, 1.0, 2.0, 3.0, math.inf]}, r"theta\[4\] = inf is not finite"),
        (CURVE | {"theta": "abc"}, "theta = 'abc' is not an array of numbers"),
        (CURVE | {"omega": np.ones(5) + 0j}, "omega holds complex numbers; real numbers are needed"),
        (CURVE | {"omega": ["20.0"] * 5}, "omega holds text; real numbers are needed"),
        (CURVE | {"omega": [Fraction(20)] * 5}, "omega holds objects; real numbers are needed"),
        (CURVE | {"omega": np.ones(5, dtype=bool)}, "omega holds truth values; real numbers are needed"),
        (CURVE | {"omega": [[1.0], [1.0, 2.0], [1.0], [1.0], [1.0]]}, "omega is no array of numbers .ValueError"),
        (CURVE | {"t": ASK.times * 1.01}, "asked was .* s; answer at the times asked"),
        (CURVE | {"r": np.ones((5, 3))}, r"r has shape \(5, 3\), not \(5, 4\)"),
        (
            CURVE | {"impacts": {"time": [0.1], "slice": [0], "speed_before": [1.0], "speed_after": [0.5]}},
            "impacts: end missing",
        ),
        (CURVE | {"impacts": [(0.1, 9, 1, 1.0, 0.5)]}, r"impacts.slice leaves \[0, 3\]"),
    ],
)
def test_what_is_no_answer_is_refused_in_one_line(given, said):
    with pytest.raises(AnswerError, match=said) as caught:
        answer_of(ASK, given)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(
    ("impacts", "said"),
    [
        (5, "impacts are no rows"),
        ([(0.1, 0, 1)], "impacts are no rows"),
        ([(0.1, 0, 2, 1.0, 0.5)], "impacts.end holds other numbers"),
        ([(0.1, -1, 1, 1.0, 0.5)], "impacts.slice leaves"),
        ([(0.1, 0, 1, 1.0, 0.5), (0.2, 0.5, 1, 1.0, 0.5)], r"impacts.slice\[1\] = 0.5 is not a whole number in \[0, "),
        ([(math.nan, 0, 1, 1.0, 0.5)], r"impacts.time\[0\] = nan is not finite"),
    ],
)
def test_impacts_that_are_none_are_refused(impacts, said):
    with pytest.raises(AnswerError, match=said):
        answer_of(ASK, CURVE | {"impacts": impacts})


@pytest.mark.parametrize("name", ["t", "omega", "r"])
def test_masked_values_are_no_numbers(name):
    given = CURVE | {"r": np.tile(ASK.start, (len(ASK.times), 1))}
    masked = np.ma.array(given[name], mask=False)
    assert np.array_equal(getattr(answer_of(ASK, given | {name: masked}), name), given[name])
    masked[1] = np.ma.masked
    with pytest.raises(AnswerError, match=rf"{name}\[1(, 0)?\] is masked; a number is needed"):
        answer_of(ASK, given | {name: masked})


def test_a_run_that_broke_off_is_no_answer():
    broken = solve(Scenario(), scheme="published-matlab", steps=1000)
    with pytest.raises(AnswerError, match="status = 'overflow': slice 5 left the bottle"):
        answer_of(Ask.of(Scenario(), broken.t), broken)


def test_times_that_are_taken_for_those_asked_are_those_asked():
    """A program that prints nine digits answers at the times asked; one that answers elsewhere is refused."""
    ask = Ask.of(THROW, THROW.duration * np.sqrt(np.linspace(0.0, 1.0, 50)))
    printed = np.array([float(f"{t:.9f}") for t in ask.times])
    assert (printed != ask.times).sum() > 40
    curve = {"t": printed, "theta": ask.times, "omega": 1.0 + ask.times}
    np.testing.assert_array_equal(answer_of(ask, curve).t, ask.times)
    with pytest.raises(AnswerError, match="answer at the times asked"):
        answer_of(ask, curve | {"t": ask.times + 1.1e-6 * THROW.duration})


def test_a_trajectory_of_an_answer():
    made = trajectory_of(ASK, answer_of(ASK, CURVE | {"r": R, "v": 0 * R}), "mine")
    assert isinstance(made, Trajectory)
    assert (made.label, made.diagnostics["not_given"]) == ("mine", [])
    implied = trajectory_of(ASK, answer_of(ASK, CURVE | {"r_cm": ASK.times}), "mine")
    assert implied.diagnostics["not_given"] == ["inertia"]
    np.testing.assert_allclose(implied.inertia * implied.omega, implied.inertia[0] * implied.omega[0], rtol=1e-14)
    bare = trajectory_of(ASK, answer_of(ASK, CURVE | {"omega": 0 * ASK.times}), "mine")
    assert bare.diagnostics["not_given"] == ["r_cm", "inertia"]
    assert trajectory_csv(bare).splitlines()[0] == "t,theta,omega"
    assert set(Curve.of(bare).series) == {"omega", "theta"}
