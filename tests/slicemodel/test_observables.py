"""Observables against cases done by hand."""

import math

import numpy as np
import pytest

from slicemodel import Bottle, Impacts, Scenario, observables

# Two slices of 0.2 kg in a tube of 0.1 kg and 1 m: everything by hand.
TWO = Scenario(bottle=Bottle(length=1.0, radius=0.1, mass=0.1, capacity=0.8), water_mass=0.4, n_slices=2)


def test_centre_of_mass_and_inertia_by_hand():
    r = np.array([0.9, 0.3])
    assert observables.centre_of_mass(TWO, r) == pytest.approx((0.2 * 0.9 + 0.2 * 0.3 + 0.1 * 0.5) / 0.5)
    r_cm = 0.58
    by_hand = 0.2 * (0.9 - r_cm) ** 2 + 0.2 * (0.3 - r_cm) ** 2
    by_hand += 0.1 * (0.1**2 / 2 + 1 / 12 + (0.5 - r_cm) ** 2)
    assert observables.moment_of_inertia(TWO, r) == pytest.approx(by_hand)


def test_they_work_over_time():
    r = np.array([[0.9, 0.3], [0.8, 0.2], [0.5, 0.5]])
    assert observables.centre_of_mass(TWO, r).shape == (3,)
    assert observables.moment_of_inertia(TWO, r).shape == (3,)
    assert observables.centre_of_mass(TWO, r)[2] == pytest.approx(0.5)


def test_velocity_of_the_centre_of_mass_by_hand():
    assert observables.centre_of_mass_velocity(TWO, [1.0, -0.5]) == pytest.approx(0.2 * 0.5 / 0.5)


def test_toppling_angle_by_hand():
    assert observables.toppling_angle(TWO, 0.9) == pytest.approx(math.pi / 4)
    assert observables.toppling_angle(TWO, [0.9, 0.8])[1] == pytest.approx(math.atan(0.5))


def test_static_toppling_angle_peaks_at_45_degrees_near_a_seventh_full():
    fills = np.linspace(0.02, 1.0, 99)
    angles = []
    for fill in fills:
        scenario = Scenario(water_mass=fill, n_slices=1)
        angles.append(math.degrees(observables.toppling_angle(scenario, observables.centre_of_mass(
            scenario, scenario.initial_positions()))))  # fmt: skip
    best = int(np.argmax(angles))
    assert fills[best] == pytest.approx(0.14, abs=0.01)
    assert angles[best] == pytest.approx(45.2, abs=0.3)


def test_plateau_by_hand():
    t = np.array([0.0, 1.0, 2.0])
    assert observables.plateau(t, np.array([20.0, 10.0, 6.0]), 20.0) == pytest.approx(0.4)
    assert observables.plateau(t, np.full(3, 20.0), 20.0) == pytest.approx(1.0)
    # The middle need not be a grid point.
    assert observables.plateau(np.array([0.0, 3.0, 4.0]), np.array([0.0, 3.0, 4.0]), 1.0) == pytest.approx(3.0)
    # Nor need the flight start at t = 0.
    late = observables.plateau(np.array([5.0, 8.0, 9.0]), np.array([0.0, 3.0, 4.0]), 1.0)
    assert late == pytest.approx(3.0)


@pytest.mark.parametrize(("left", "counted"), [(1.9e-3, 0), (2.1e-3, 1)])
def test_a_graze_comes_back_slower_than_the_rest_speed_having_left_at_twice_that(left, counted):
    """Slice 0 comes back at half the rest speed from a contact that it had left at ``left``; slice 1 is fast."""
    impacts = Impacts(
        time=[0.1, 0.2, 0.3], slice=[0, 1, 0], end=[1, 1, -1],
        speed_before=[4e-3, 2.0, 0.5e-3], speed_after=[left, 1.0, 0.0],
    )  # fmt: skip
    assert observables.grazes(impacts, 1e-3) == counted
