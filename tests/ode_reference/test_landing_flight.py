"""The flight that ends in a touch, against the rods' own program, and what it refuses."""

import math
from dataclasses import replace

import numpy as np
import pytest
import rods_by_events

import ode_reference
from slicemodel import Scenario, Table, touch

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


@pytest.mark.parametrize(
    ("height", "words"),
    [
        (0.2, r"table.height = 0.2 m is not reached from above: the bottle is not over it at release, nor when"),
        (-50.0, r"table.height = -50 m is not reached within duration = 0.8 s"),
    ],
)
def test_a_table_out_of_reach_is_refused(height, words):
    with pytest.raises(ValueError, match=words):
        ode_reference.fly(THROW, Table(height=height))
