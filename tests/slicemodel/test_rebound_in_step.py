"""Hits located inside the step by the closed form, against a dense sampling of the same closed form and by hand."""

import math

import numpy as np
import pytest

import slicemodel
from slicemodel import Bottle, Scenario
from slicemodel.kernel import closed_form, moved, step_map
from slicemodel.kernel.rebound import Step, Watched, step
from slicemodel.schemes import SCHEMES

IN_STEP = ["roots-corrected", "exact-step", "midpoint"]


def heavy(**changes) -> Scenario:
    """A tube so heavy that nothing the slices do can change omega or r_CM."""
    values = {"bottle": Bottle(mass=1e12), "gravity": 0.0, "omega0": 10.0, "n_slices": 2, "water_mass": 0.1}
    return Scenario(**(values | changes))


def flight_time(scenario: Scenario) -> float:
    """When slice 1 of a heavy tube first reaches the base, from rest: a scalar root found by bisection."""
    gamma, omega = scenario.damping_rate, abs(scenario.omega0)
    up, down = -gamma + math.hypot(gamma, omega), -gamma - math.hypot(gamma, omega)
    x0 = scenario.initial_positions()[1] - scenario.bottle.length / 2
    wall = scenario.r_max - scenario.bottle.length / 2
    low, high = 0.0, 1.0
    for _ in range(200):
        t = (low + high) / 2
        x = x0 * (up * math.exp(down * t) - down * math.exp(up * t)) / (up - down)
        low, high = (low, t) if x > wall else (t, high)
    return low


@pytest.mark.parametrize("scheme", IN_STEP)
@pytest.mark.parametrize("drag", [0.0, 0.4])
@pytest.mark.parametrize("steps", [2, 7])
def test_the_first_hit_is_exact_for_any_step(scheme, drag, steps):
    scenario = heavy(drag=drag, duration=0.2)
    expected = flight_time(scenario)
    assert 0.01 < expected < 0.2
    run = slicemodel.solve(scenario, scheme, steps, rebound="in-step")
    first = run.impacts[0]
    assert (first.slice, first.end) == (1, "base")
    assert first.time == pytest.approx(expected, abs=1e-12)
    assert first.speed_after == pytest.approx(0.5 * first.speed_before)


@pytest.mark.parametrize("scheme", IN_STEP)
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_many_hits_in_one_step_equal_many_steps(scheme, restitution):
    """In a heavy tube one step of any size is exact, however often a slice bounces inside it."""
    scenario = heavy(drag=0.2, duration=0.3, restitution=restitution, water_mass=0.2)
    one = slicemodel.solve(scenario, scheme, 2, rebound="in-step")
    many = slicemodel.solve(scenario, scheme, 3001, rebound="in-step")
    assert len(one.impacts) >= (1 if restitution == 0.0 else 2)
    np.testing.assert_allclose(one.r[-1], many.r[-1], atol=1e-9)
    np.testing.assert_allclose(one.v[-1], many.v[-1], atol=1e-7)
    fast = one.impacts.speed_before > 1e-3
    np.testing.assert_allclose(one.impacts.time[fast], many.impacts.time[many.impacts.speed_before > 1e-3], atol=1e-9)


@pytest.mark.parametrize("gamma", [0.0, 5.0, 40.0])
def test_a_slice_turns_where_its_velocity_vanishes(gamma):
    form = SCHEMES["exact-step"].form
    constants = SCHEMES["exact-step"].constants(Scenario())._replace(gamma=gamma, gamma_position=gamma)
    turn = closed_form.turning_time(gamma, 10.0, -0.25, 0.9)
    assert 0.0 < turn < 0.1
    assert moved(step_map(form, constants, 10.0, 0.0, turn), -0.25, 0.9)[1] == pytest.approx(0.0, abs=1e-13)
    assert closed_form.turning_time(gamma, 10.0, 0.25, 0.9) == math.inf


def test_a_dip_through_the_end_and_back_within_one_step_is_found():
    form = SCHEMES["exact-step"].form._replace(in_step=True)
    scenario = heavy(duration=0.05, drag=0.0)
    constants = SCHEMES["exact-step"].constants(scenario)
    # The centre lies beyond the base, so that the slice is thrown back: it would turn 2 mm behind the wall.
    reach, centre, y, omega = 0.13, 0.36, 0.11, 10.0
    x = y - centre
    v = math.sqrt(omega**2 * (x**2 - (reach + 0.002 - centre) ** 2))
    turn = closed_form.turning_time(constants.gamma, omega, x, v)
    way = step_map(form, constants, omega, centre, 2 * turn)
    assert moved(step_map(form, constants, omega, centre, turn), y, v)[0] > reach
    assert moved(way, y, v)[0] < reach
    log = np.empty((4, 4))
    watched = Watched(np.array([5]), np.array([y]), np.array([v]), np.empty(1), np.empty(1))
    one = Step(way, reach, omega, centre, 2 * turn, 1.0 + 2 * turn)
    *_, count = step(form, constants, one, watched, 1, False, log, 0)
    new, speed = watched.y[0], watched.v[0]
    assert count == 1
    assert tuple(log[0, 1:3]) == (5.0, 1.0)
    assert 1.0 < log[0, 0] < 1.0 + turn
    # Energy of the closed form without drag: v^2 - omega^2 x^2 is constant, so the speed at the wall is known.
    assert log[0, 3] ** 2 == pytest.approx(v**2 - omega**2 * x**2 + omega**2 * (reach - centre) ** 2, rel=1e-9, abs=0.0)
    assert new < reach
    assert speed < 0.0


@pytest.mark.parametrize("scheme", IN_STEP)
def test_slices_stay_inside_and_resting_ones_rest(scheme):
    scenario = Scenario().with_slices(30)
    run = slicemodel.solve(scenario, scheme, 200, rebound="in-step")
    assert run.settings["rebound"] == "in-step"
    assert run.r.min() >= scenario.r_min - 1e-15
    assert run.r.max() <= scenario.r_max + 1e-15
    early = run.t < 0.02
    assert (run.r[early, 0] == scenario.r_max).all()
    assert not run.v[early, 0].any()
    assert np.all(np.diff(run.impacts.time) >= 0)


@pytest.mark.parametrize("restitution", [0.5, 1.0])
def test_a_predicted_step_knows_its_rebounds_to_second_order_and_moves_nothing(restitution):
    form = SCHEMES["midpoint"].form
    constants = SCHEMES["midpoint"].constants(Scenario())._replace(restitution=restitution)
    reach, omega, centre, errors = 0.1, 10.0, 0.02, []
    for dt in (1e-3, 5e-4):
        # It hits the base in the middle of the step.
        watched = Watched(np.array([0]), np.array([reach - 0.25 * dt]), np.array([0.5]), np.empty(1), np.empty(1))
        one = Step(step_map(form, constants, omega, centre, dt), reach, omega, centre, dt, dt)
        before = watched.y[0], watched.v[0]
        first, second, _, count = step(form, constants, one, watched, 1, True, np.empty((4, 4)), 0)
        assert (watched.y[0], watched.v[0]) == before
        assert (second, count) == (first * first, 0)
        made = step(form, constants, one, watched, 1, False, np.empty((4, 4)), 0)
        assert made[3] == 1
        errors.append(abs(first - made[0]))
    assert errors[0] < 1e-5
    assert errors[1] < 0.3 * errors[0]


@pytest.mark.parametrize("keeps_position", [True, False])
def test_a_step_that_is_predicted_on_the_grid_moves_and_lists_nothing(keeps_position):
    """It says where the step would leave a slice that is past the base: where it was, or outside."""
    form = SCHEMES["midpoint"].form._replace(in_step=False, keeps_position=keeps_position)
    constants = SCHEMES["midpoint"].constants(Scenario())
    watched = Watched(np.array([0]), np.array([0.0999]), np.array([0.5]), np.empty(1), np.empty(1))
    one = Step(step_map(form, constants, 10.0, 0.02, 1e-3), 0.1, 10.0, 0.02, 1e-3, 1e-3)
    log = np.zeros((4, 4))
    first, second, _, count = step(form, constants, one, watched, 1, True, log, 0)
    assert (watched.y[0], watched.v[0], count, log.any()) == (0.0999, 0.5, 0, False)
    made = step(form, constants, one, watched, 1, False, log, 0)
    assert made[3] == 1
    assert (first, second) == made[:2]
    assert (first == 0.0999) == keeps_position


@pytest.mark.parametrize("scheme", IN_STEP)
@pytest.mark.parametrize("slices", [5, 6, 8, 10, 50])
def test_a_slice_that_is_put_on_the_cap_does_not_strike_it(scheme, slices):
    """The last slice of a full bottle lies on the cap; the sum that says where may round to either side of it."""
    scenario = Scenario(water_mass=1.0, n_slices=slices)
    run = slicemodel.solve(scenario, scheme, 1000, rebound="in-step")
    assert run.impacts.time[0] > 1e-3
    assert run.impacts.speed_before[0] > 1e-3
    assert (run.r[1:, -1] == scenario.r_min).sum() > 10


def test_defaults_of_rebound():
    assert slicemodel.solve(Scenario(n_slices=2), "midpoint").settings["rebound"] == "in-step"
    assert slicemodel.solve(Scenario(n_slices=2), "exact-step").settings["rebound"] == "grid"
    assert slicemodel.solve(Scenario(n_slices=2), "midpoint", rebound="grid").settings["rebound"] == "grid"
