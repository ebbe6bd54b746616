"""Observables against cases done by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slicemodel import Bottle, Impacts, Scenario, observables
from slicemodel.observables import PLATEAU_POINTS, plateau_of_points, plateau_of_width

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


# ---------------------------------------------------------------------- the plateau, by points and by width


def valley(points: int) -> tuple[np.ndarray, np.ndarray]:
    """|t - 0.6| + 0.2 over one second: the mean over a window of width w around the bottom is 0.2 + w / 4."""
    t = np.linspace(0.0, 1.0, points)
    return t, np.abs(t - 0.6) + 0.2


def test_the_papers_average_takes_as_many_points_on_either_side():
    t = np.arange(7.0)
    result = plateau_of_points(t, np.array([20.0, 12.0, 6.0, 2.0, 4.0, 8.0, 10.0]), 20.0, points=3)
    assert result.level == pytest.approx((6.0 + 2.0 + 4.0) / 3 / 20.0)
    assert (result.begin, result.end) == (2.0, 4.0)
    assert PLATEAU_POINTS >= 20


def test_at_an_end_of_the_flight_the_window_moves_inwards():
    t = np.arange(5.0)
    falling = plateau_of_points(t, np.array([5.0, 4.0, 3.0, 2.0, 1.0]), 1.0, points=3)
    assert (falling.level, falling.begin, falling.end) == (2.0, 2.0, 4.0)
    rising = plateau_of_points(t, np.array([1.0, 2.0, 3.0, 4.0, 5.0]), 1.0, points=3)
    assert (rising.level, rising.begin, rising.end) == (2.0, 0.0, 2.0)
    with pytest.raises(ValueError, match=r"points = 6 is not a whole number in \[1, 5\]"):
        plateau_of_points(t, t + 1.0, 1.0, points=6)


def test_its_level_depends_on_the_grid_and_the_other_does_not():
    by_points = [plateau_of_points(*valley(n), 1.0).level for n in (101, 1001)]
    # 21 points of a spacing of 10 ms, then of 1 ms: mean |k| over -10..10 is 110/21 spacings.
    assert by_points[0] == pytest.approx(0.2 + 0.01 * 110 / 21)
    assert by_points[1] == pytest.approx(0.2 + 0.001 * 110 / 21)
    by_width = [plateau_of_width(*valley(n), 1.0, 0.1) for n in (11, 101, 1001)]
    for result in by_width[1:]:
        assert result.level == pytest.approx(0.2 + 0.1 / 4)
        assert (result.begin, result.end) == (pytest.approx(0.55), pytest.approx(0.65))
    assert by_width[0].level == pytest.approx(0.225)


def test_the_window_may_be_wider_than_a_spacing_and_as_wide_as_the_flight():
    t = np.array([0.0, 0.5, 2.0])
    omega = np.array([4.0, 1.0, 4.0])
    assert plateau_of_width(t, omega, 2.0, 2.0).level == pytest.approx((1.25 + 3.75) / 2.0 / 2.0)
    # Of width 1 the edges stand at equal omega: left by a, right by 3a of the bottom, a = 1/4.
    result = plateau_of_width(t, omega, 2.0, 1.0)
    assert result.begin == pytest.approx(0.25)
    assert result.level == pytest.approx(1.75 / 2.0)
    for width in (0.0, -1.0, 2.1, float("nan")):
        with pytest.raises(ValueError, match=r"width = .* s is outside \(0, 2\] s"):
            plateau_of_width(t, omega, 2.0, width)


def test_it_takes_the_lower_mean_and_not_the_lower_point():
    t = np.linspace(0.0, 10.0, 1001)
    omega = np.ones_like(t)
    omega[200] = 0.0  # one point, of no duration
    omega[700:801] = 0.9
    assert plateau_of_points(t, omega, 1.0, points=21).begin == pytest.approx(1.9)
    assert plateau_of_width(t, omega, 1.0, 1.0).begin == pytest.approx(7.0, abs=0.01)


@settings(deadline=None, derandomize=True, max_examples=60)
@given(
    values=st.lists(st.floats(0.0, 10.0), min_size=3, max_size=12),
    share=st.floats(0.05, 1.0),
)
def test_no_window_of_that_width_has_a_lower_mean(values, share):
    t = np.cumsum(1.0 + 0.3 * np.sin(np.arange(len(values))))
    width = share * (t[-1] - t[0])
    result = plateau_of_width(t, values, 1.0, width)
    assert result.begin >= t[0] - 1e-12
    assert result.end <= t[-1] + 1e-9
    fine = np.union1d(np.linspace(t[0], t[-1], 4001), t)
    curve = np.interp(fine, t, values)
    area = np.concatenate(([0.0], np.cumsum(np.diff(fine) * (curve[1:] + curve[:-1]) / 2)))
    starts = np.linspace(t[0], t[-1] - width, 400)
    means = (np.interp(starts + width, fine, area) - np.interp(starts, fine, area)) / width
    # Between points of the fine grid its integral is a chord, high or low by at most this much.
    chord = 10.0 * (fine[1] - fine[0]) / width
    assert result.level <= means.min() + chord
    assert result.level >= means.min() - 0.1


@settings(deadline=None, derandomize=True, max_examples=60)
@given(
    values=st.lists(st.floats(0.0, 10.0), min_size=4, max_size=12),
    moved=st.lists(st.floats(-0.01, 0.01), min_size=12, max_size=12),
)
def test_it_moves_by_no_more_than_the_curve_does(values, moved):
    t = np.arange(float(len(values)))
    change = np.array(moved[: len(values)])
    levels = [plateau_of_width(t, np.array(values) + d, 1.0, 0.7).level for d in (0.0, change)]
    assert abs(levels[1] - levels[0]) <= np.abs(change).max() + 1e-12
