"""The flight that ends in a touch, against the rods' own program; the turn over no table; which tables are reached."""

import math
from dataclasses import replace

import numpy as np
import pytest
import rods_by_events
from touches import touch

import ode_reference
from slicemodel import Scenario, Table

THROW = Scenario(n_slices=4, water_mass=0.4, drag=1.0, restitution=0.5, omega0=15.0, duration=0.8)
TABLE = Table(height=-0.36)


def test_it_ends_where_the_rods_touch():
    """Two programs for one set of equations; before orders of impacts compete they agree to the interpolation."""
    one = ode_reference.fly(THROW, TABLE, dt=5e-5)
    other = touch(rods_by_events.solve(THROW, times=np.linspace(0.0, 0.8, 8001)), TABLE)
    assert one.time == pytest.approx(other.time, abs=2e-4)
    assert one.theta == pytest.approx(other.theta, abs=5e-3)
    assert one.omega == pytest.approx(other.omega, abs=5e-2)
    assert one.velocity == pytest.approx(other.velocity, abs=1e-2)
    np.testing.assert_allclose(one.r, other.r, atol=1e-3)


@pytest.mark.slow
def test_rods_that_meet_in_strong_drag_touch_where_the_rods_do():
    throw = replace(THROW, drag=10.0)
    one = ode_reference.fly(throw, TABLE, dt=5e-5)
    other = touch(rods_by_events.solve(throw, times=np.linspace(0.0, 0.55, 5501)), TABLE)
    assert one.time == pytest.approx(other.time, abs=1e-6)
    assert one.theta == pytest.approx(other.theta, abs=1e-5)
    assert one.omega == pytest.approx(other.omega, abs=1e-4)


@pytest.mark.parametrize("drag", [50.0, 500.0, 1300.0])
def test_drag_that_stops_the_water_within_a_step_is_followed(drag):
    """Two slices that part and never meet fly as free flight has them, which is solved elsewhere without steps.

    With 500 kg/s steps of 0.2 ms are unstable: the bottle came down before its peak, faster than anything falls.
    """
    throw = replace(THROW, n_slices=2, water_mass=0.8, drag=drag)
    one = ode_reference.fly(throw, TABLE)
    flight = ode_reference.solve(throw, "free-flight", times=[0.0, one.time])
    assert one.theta == pytest.approx(flight.theta[-1], abs=1e-6)
    assert one.omega == pytest.approx(flight.omega[-1], abs=1e-5)
    _, theta, _ = ode_reference.turn(replace(throw, duration=one.time), one.time)
    assert theta[-1] == pytest.approx(one.theta, abs=1e-8)


def test_ice_flies_a_parabola_and_turns_evenly():
    ice = replace(THROW, frozen=True, drag=0.0)
    one = ode_reference.fly(ice, TABLE)
    assert one.omega == pytest.approx(ice.omega0, rel=1e-12, abs=0)
    assert one.theta == pytest.approx(ice.theta0 + ice.omega0 * one.time, rel=1e-9, abs=0)
    flight = ode_reference.solve(ice, times=np.linspace(0.0, 0.8, 8001))
    assert one.time == pytest.approx(touch(flight, TABLE).time, abs=1e-6)


def test_angular_momentum_and_drift_are_kept_on_the_way():
    one = ode_reference.fly(THROW, TABLE, dt=5e-5)
    bottle, m = THROW.bottle, THROW.slice_mass

    def spin(r, omega):
        centre = (m * r.sum() + bottle.mass * bottle.length / 2) / THROW.total_mass
        own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12 + (bottle.length / 2 - centre) ** 2)
        return (own + m * ((r - centre) ** 2).sum()) * omega

    assert spin(one.r, one.omega) == pytest.approx(spin(THROW.initial_positions(), THROW.omega0), rel=1e-4, abs=0)
    drift = m * one.v.sum() / THROW.total_mass
    centre = (m * one.r.sum() + bottle.mass * bottle.length / 2) / THROW.total_mass
    arm = (centre - bottle.length / 2) * one.omega
    axis, across = (math.sin(one.theta), -math.cos(one.theta)), (math.cos(one.theta), math.sin(one.theta))
    speeds = [v + drift * a + arm * c for v, a, c in zip(one.velocity, axis, across, strict=True)]
    expected = (THROW.launch_velocity[0], THROW.launch_velocity[1] - THROW.gravity * one.time)
    assert speeds == pytest.approx(expected, abs=1e-3)


# ---------------------------------------------------------------------- without a table, and out of its reach

WATER = Scenario(n_slices=8, water_mass=0.4, drag=0.2, duration=1.5)


def test_without_a_table_the_flight_is_the_same_until_the_touch():
    throw = replace(WATER, omega0=24.0, duration=0.5)
    t, theta, rim = ode_reference.turn(throw, 1e-3)
    assert (t[0], t[-1]) == (0.0, 0.5)
    assert theta[0] == throw.theta0
    assert rim[0] == pytest.approx(-throw.bottle.radius, abs=1e-12)
    touch = ode_reference.fly(replace(throw, duration=1.0), Table(height=float(rim[-1])))
    assert touch.time == pytest.approx(0.5, abs=1e-8)
    assert touch.theta == pytest.approx(theta[-1], abs=1e-6)


def test_ice_turns_as_its_angular_velocity_says():
    ice = replace(WATER, frozen=True, omega0=9.0, duration=0.4)
    _, theta, rim = ode_reference.turn(ice, 0.1)
    assert theta[-1] == pytest.approx(ice.theta0 + 9.0 * 0.4, abs=1e-12)
    assert rim[-1] < rim[0]


def test_a_table_beside_the_thrower_is_reached_from_above_or_refused():
    """Ice that is over the table when its centre of mass is highest lands on it; a table above that is missed."""
    ice = replace(WATER, frozen=True, omega0=20.0)
    touch = ode_reference.fly(ice, Table(height=0.07), dt=2e-5)
    speed = ice.launch_velocity[1] - ice.gravity * touch.time
    assert touch.time > ice.launch_velocity[1] / ice.gravity
    assert speed < 0.0
    # C_M is where the parabola is, and the lowest rim is on the table.
    half, radius = ice.bottle.length / 2, ice.bottle.radius
    reach = half * abs(math.cos(touch.theta)) + radius * abs(math.sin(touch.theta))
    arm = (ice.bottle.mass * half + ice.slice_mass * touch.r.sum()) / ice.total_mass - half
    centre = 0.07 + reach - arm * math.cos(touch.theta)
    start = -(half + arm) * math.cos(ice.theta0)
    parabola = start + ice.launch_velocity[1] * touch.time - ice.gravity * touch.time**2 / 2
    assert centre == pytest.approx(parabola, abs=1e-8)
    with pytest.raises(ValueError, match=r"table\.height = 0\.5 m is not reached from above"):
        ode_reference.fly(ice, Table(height=0.5))
    with pytest.raises(ValueError, match=r"table\.height = -9 m is not reached within duration = 1\.5 s"):
        ode_reference.fly(ice, Table(height=-9.0))
    with pytest.raises(ValueError, match=r"table\.height = 0\.07 m is not reached from above"):
        ode_reference.fly(replace(ice, launch_velocity=(0.5, -1.0)), Table(height=0.07))


def test_drag_that_no_step_follows_is_refused_unless_nothing_moves():
    strong = replace(WATER, drag=400.0)
    words = r"drag = 400 kg/s is outside \[0, 327\]"
    with pytest.raises(ValueError, match=words):
        ode_reference.fly(strong, TABLE)
    with pytest.raises(ValueError, match=words):
        ode_reference.turn(strong, 0.1)
    assert ode_reference.fly(replace(strong, frozen=True), TABLE).omega == pytest.approx(WATER.omega0, rel=1e-12, abs=0)
