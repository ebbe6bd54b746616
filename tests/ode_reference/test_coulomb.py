"""Coulomb's cone at one corner of the bottle, by hand."""

import pytest

from ode_reference.landing.impulses import coulomb


@pytest.mark.parametrize(
    ("slip", "friction", "along"),
    [(0.3, 0.4, -0.3), (-0.3, 0.4, 0.3), (0.6, 0.4, -0.4), (-0.6, 0.4, 0.4), (0.6, 0.0, 0.0), (0.0, 0.4, 0.0)],
)
def test_a_corner_sticks_inside_the_cone_and_slips_on_it(slip, friction, along):
    """A point of unit mass that has to gain 1 m/s upwards: friction stops its slip, or takes what the cone allows."""
    assert coulomb(1.0, slip, 1.0, 0.0, 1.0, friction) == pytest.approx((1.0, along), abs=1e-15)


@pytest.mark.parametrize("slip", [-2.0, -0.2, 0.1, 2.0])
def test_a_lever_couples_rise_and_slip(slip):
    """What is asked for comes about: the rise is met, and a corner that still slips is braked with all of the cone."""
    nn, nt, tt, friction, demand = 2.0, 0.7, 3.0, 0.4, 0.5
    normal, along = coulomb(demand, slip, nn, nt, tt, friction)
    assert nn * normal + nt * along == pytest.approx(demand)
    left = slip + nt * normal + tt * along
    assert abs(along) <= friction * normal * (1 + 1e-15)
    assert left == pytest.approx(0.0, abs=1e-15) or along * left == pytest.approx(-friction * normal * abs(left))


def test_a_corner_that_rises_fast_enough_is_left_alone():
    assert coulomb(0.0, 5.0, 1.0, 0.0, 1.0, 0.4) == coulomb(-1.0, 5.0, 1.0, 0.0, 1.0, 0.4) == (0.0, 0.0)
