"""The turn of a bottle over no table, and which tables are reached."""

import math
from dataclasses import replace

import pytest

import ode_reference
from slicemodel import Scenario, Table

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


@pytest.mark.parametrize("every", [0.0, -1.0, math.nan, 3.0])
def test_a_spacing_out_of_range_is_refused(every):
    with pytest.raises(ValueError, match="every = "):
        ode_reference.turn(replace(WATER, duration=0.1), every)
