"""Toppling, release, the lab frame and the landing against cases done by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up import trajectory_of

from slicemodel import Bottle, Scenario, ScenarioError
from slicemodel import landing as landings
from slicemodel.observables import (
    centre_of_mass,
    centre_of_mass_at_rest,
    release_angular_velocity,
    static_toppling_angle,
    toppling_angle,
)

# One slice of 0.4 kg in a tube of 0.1 kg and 1 m, half full: its centre of mass is at (0.4 * 0.75 + 0.1 * 0.5) / 0.5.
ONE = Scenario(
    bottle=Bottle(length=1.0, radius=0.1, mass=0.1, capacity=0.8),
    water_mass=0.4,
    n_slices=1,
    omega0=2.0,
    theta0=math.pi / 2,
    duration=3.0,
    gravity=10.0,
    launch_velocity=(1.0, 10.0),
)
R_CM = 0.7


def flight(scenario=ONE, *, theta=None, t=None, v=0.0, stored=True):
    """A bottle of ice that turns as told; ``v`` is the velocity that its slice claims to have."""
    t = np.linspace(0.0, scenario.duration, 3001) if t is None else t
    theta = scenario.theta0 + scenario.omega0 * t if theta is None else theta
    kept = len(t) if stored else 0
    return trajectory_of(scenario, t, theta=theta, r=np.full((kept, 1), 0.75), v=np.full((kept, 1), v), r_cm=R_CM)


# ------------------------------------------------------------------ at rest and at release


def test_centre_of_mass_at_rest_by_hand_and_as_the_sum_over_slices():
    assert centre_of_mass_at_rest(ONE) == pytest.approx(R_CM)
    for fill in (0.03, 0.5, 1.0):
        scenario = Scenario(water_mass=fill, n_slices=7)
        assert centre_of_mass_at_rest(scenario) == pytest.approx(
            float(centre_of_mass(scenario, scenario.initial_positions())), rel=1e-14, abs=0.0
        )


def test_static_toppling_angle_is_eq_13b():
    for fill in (0.05, 0.14, 0.75):
        scenario = Scenario(water_mass=fill)
        epsilon = 0.028 / (0.028 + fill)
        printed = math.atan((0.04 / 0.28) / ((1 - epsilon) * fill / 2 + epsilon / 2))
        assert static_toppling_angle(scenario) == pytest.approx(printed, rel=1e-14, abs=0.0)
    # Without a bottle's mass a full bottle is a cylinder with its centre half way up.
    heavy = Scenario(bottle=Bottle(mass=1e-12), water_mass=1.0)
    assert static_toppling_angle(heavy) == pytest.approx(math.atan(0.04 / 0.14))


def test_release_angular_velocity_by_hand():
    assert release_angular_velocity(ONE) == pytest.approx(math.sqrt(101.0) / R_CM)
    assert release_angular_velocity(ONE, 1.4) == pytest.approx(2.0)
    for speed in (-1.0, math.nan, math.inf):
        with pytest.raises(ScenarioError, match=r"speed = .* m/s is outside \[0, inf\)"):
            release_angular_velocity(ONE, speed)


# ------------------------------------------------------------------ the lab


def test_lab_motion_starts_with_the_cap_at_the_origin_and_its_centre_falls():
    run = flight(t=np.array([0.0, 0.5, 2.0]))
    motion = landings.lab_motion(run)
    assert motion.cap[0] == pytest.approx([0.0, 0.0], abs=1e-15)
    assert motion.base[0] == pytest.approx([1.0, 0.0], abs=1e-15)  # released lying along x
    assert motion.centre[0] == pytest.approx([R_CM, 0.0], abs=1e-15)
    assert motion.centre[1] == pytest.approx([R_CM + 0.5, 5.0 - 1.25])
    assert motion.centre[2] == pytest.approx([R_CM + 2.0, 20.0 - 20.0])
    # After half a second it has turned by one radian, towards u_y.
    angle = math.pi / 2 + 1.0
    assert motion.base[1] - motion.cap[1] == pytest.approx([math.sin(angle), -math.cos(angle)])
    assert motion.base[1, 1] > motion.cap[1, 1]


def test_lab_motion_is_eq_2_for_a_bottle_of_no_mass():
    light = replace(ONE, bottle=Bottle(length=1.0, radius=0.1, mass=1e-15, capacity=0.8), theta0=0.4)
    motion = landings.lab_motion(flight(light, t=np.array([0.3, 0.7])))
    t, arm = 0.7, 1.0 - 0.5 / 2
    assert motion.centre[1] == pytest.approx(
        [1.0 * t + arm * math.sin(0.4), -5.0 * t**2 + 10.0 * t - arm * math.cos(0.4)], rel=1e-12, abs=0.0
    )


def test_bottle_is_as_long_as_it_is_and_its_centre_lies_between():
    motion = landings.lab_motion(flight())
    assert np.hypot(*(motion.base - motion.cap).T) == pytest.approx(1.0, rel=1e-12, abs=0.0)
    assert R_CM * motion.base + (1 - R_CM) * motion.cap == pytest.approx(motion.centre, abs=1e-12)


# ------------------------------------------------------------------ moments


def test_moment_by_hand():
    moment = landings.moment_at(flight(v=-0.5), 1.0)
    assert moment.theta == pytest.approx(math.pi / 2 + 2.0)
    assert moment.omega == 2.0
    assert moment.v_cm == pytest.approx(0.4 * -0.5 / 0.5)
    assert moment.toppling_angle == pytest.approx(math.atan(0.1 / 0.3))
    assert moment.toppling_angle == pytest.approx(float(toppling_angle(ONE, R_CM)))


def test_moment_refuses_what_it_cannot_know():
    with pytest.raises(ValueError, match=r"time = 3\.5 s is outside \[0, 3\] s"):
        landings.moment_at(flight(), 3.5)
    with pytest.raises(ValueError, match="time = nan"):
        landings.moment_at(flight(), math.nan)


def test_moment_of_a_run_without_velocities_differentiates_the_centre_of_mass():
    run = flight(stored=False)
    moving = replace(run, r_cm=R_CM - 0.1 * run.t**2)
    assert landings.moment_at(moving, 1.0).v_cm == pytest.approx(-0.2, abs=1e-9)
    assert landings.moment_at(run, 1.0).v_cm == 0.0


@pytest.mark.parametrize(
    ("theta0", "omega0", "goal"),
    [
        (math.pi / 2, 2.0, math.tau),
        (0.0, 4.0, math.tau),
        (7.0, 4.0, 2 * math.tau),
        (-0.5, 2.0, 0.0),
        (math.pi / 2, -2.0, 0.0),
        (0.0, -4.0, -math.tau),
    ],
)
def test_next_upright_is_the_next_whole_turn_in_the_sense_of_the_spin(theta0, omega0, goal):
    moment = landings.next_upright(flight(replace(ONE, theta0=theta0, omega0=omega0)))
    assert moment.theta == pytest.approx(goal, abs=1e-9)
    assert moment.time == pytest.approx((goal - theta0) / omega0)


def test_next_upright_is_none_if_it_does_not_turn_that_far():
    assert landings.next_upright(flight(replace(ONE, duration=1.0))) is None


# ------------------------------------------------------------------ landing


def upright_flight(tilt=0.0):
    """A bottle that does not turn: released at ``tilt``, it comes down like a stone."""
    scenario = replace(ONE, theta0=tilt)
    t = np.linspace(0.0, 3.0, 30001)
    return flight(scenario, t=t, theta=np.full_like(t, tilt))


def test_landing_time_of_an_upright_bottle_by_hand():
    # Its base starts at y = -1 and moves by 10 t - 5 t^2: level with the release again at t = 2.
    outcome = landings.landing(upright_flight(), -1.0)
    assert outcome.moment.time == pytest.approx(2.0, abs=1e-8)
    assert outcome.end == "base"
    assert outcome.moment.toppling_angle == pytest.approx(math.atan(0.1 / 0.3))
    # A table 3 m above the base at release: 10 t - 5 t^2 = 3 on the way down.
    outcome = landings.landing(upright_flight(), 2.0)
    assert outcome.moment.time == pytest.approx(1 + math.sqrt(0.4), abs=1e-8)


def test_tilted_bottle_lands_on_its_rim():
    tilt = 0.2
    outcome = landings.landing(upright_flight(tilt), -1.0)
    lowest = -math.cos(tilt) - 0.1 * math.sin(tilt)  # of the rim at release; its axis passes through O
    drop = lowest + 1.0
    assert outcome.moment.time == pytest.approx(1 + math.sqrt(1 + drop / 5.0), abs=1e-8)
    assert outcome.moment.toppling_angle == pytest.approx(math.atan(0.1 / 0.3))
    assert outcome.moment.theta == pytest.approx(tilt)


def test_bottle_upside_down_comes_down_on_its_cap():
    assert landings.landing(upright_flight(math.pi), -1.0).end == "cap"


def test_table_out_of_reach():
    assert landings.landing(upright_flight(), 5.0) is None  # never rises over it
    assert landings.landing(upright_flight(), -100.0) is None  # still above it at the end
    with pytest.raises(ValueError, match="height = nan m"):
        landings.landing(upright_flight(), math.nan)


def test_bottle_released_below_the_table_rises_over_it_first():
    # Its base starts at y = -1, 0.2 m below the table: up through it, and down at 10 t - 5 t^2 = 0.2.
    outcome = landings.landing(upright_flight(), -0.8)
    assert outcome.moment.time == pytest.approx(1 + math.sqrt(1 - 0.04), abs=1e-8)
