"""The tube: early passes, wrong fails."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up import trajectory_of

from flipproof.chapters.alignment.tube import hold_against_tube, study_tube, tube_around
from slicemodel import Scenario, Trajectory

T = np.linspace(0.0, 0.5, 501)


def sawtooth(t, early=0.0):
    return ((t + early) * 10) % 1.0


def hold(values, t=T, dt=0.003, dy=0.01, reference=None):
    return hold_against_tube(T, sawtooth(T) if reference is None else reference, t, values, dt=dt, dy=dy)


def run(values, t=T, n=2, method="made-up") -> Trajectory:
    r = np.stack([np.zeros(len(t)), values], axis=1)
    return trajectory_of(Scenario(n_slices=n), t, method=method, omega=values, r=r)


def test_an_early_bounce_passes_where_a_pointwise_comparison_fails():
    early = sawtooth(T, early=0.0025)
    assert np.abs(early - sawtooth(T)).max() > 0.9
    tube = hold(early)
    assert tube.inside
    assert tube.share == pytest.approx(1.0)
    assert tube.largest == 0.0


def test_a_bounce_too_early_fails():
    tube = hold(sawtooth(T, early=0.006))
    assert not tube.inside
    assert tube.first_exit == pytest.approx(0.0, abs=0.001)
    assert tube.largest > 0.5


def test_a_wrong_level_fails():
    flat = np.ones(501)
    tube = hold(np.where(T < 0.2, 1.0, 1.05), reference=flat, dt=0.05)
    assert not tube.inside
    # Between 0.199 and 0.2 s the level rises by 0.05, and by 0.01 after a fifth of that.
    assert tube.first_exit == pytest.approx(0.1992, abs=1e-6)
    assert tube.largest == pytest.approx(0.04)
    # The step of the grid in which it leaves counts half.
    assert tube.share == pytest.approx(0.399, abs=1e-6)
    assert hold(flat + 0.0099, reference=flat).inside
    assert not hold(flat - 0.0101, reference=flat).inside


@pytest.mark.parametrize("spoil", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_none_fails(spoil):
    values = sawtooth(T)
    values[300] = spoil
    tube = hold(values)
    assert not tube.inside
    assert tube.first_exit == pytest.approx(0.3, abs=0.002)
    assert tube.largest == math.inf


def test_a_run_that_ends_early_is_outside_from_there():
    tube = hold(sawtooth(T[:201]), t=T[:201])
    assert tube.first_exit == pytest.approx(0.2)
    assert tube.share == pytest.approx(0.4, abs=0.01)
    assert tube.ended == pytest.approx(0.2)
    assert tube.largest == 0.0
    assert "ends at 200.0 ms" in tube.words


def test_other_times_do_not_matter_and_what_the_reference_does_not_reach_is_not_judged():
    t = np.linspace(0.0, 0.7, 4321)
    values = np.where(t <= 0.501, np.interp(t, T, sawtooth(T)), 99.0)
    assert hold(values, t=t, dy=1e-9).inside


def test_an_excursion_between_the_points_of_the_reference_is_seen():
    t = np.array([0.0, 0.1005, 0.1006, 0.1007, 0.5])
    assert not hold(np.array([1.0, 1.0, 2.0, 1.0, 1.0]), t=t, reference=np.ones(501)).inside


@given(st.lists(st.floats(-5, 5), min_size=2, max_size=12), st.floats(0.001, 3.0), st.floats(0.0, 1.0))
def test_the_bounds_are_those_of_a_dense_search(values, dt, dy):
    times, values = np.arange(len(values), dtype=float), np.array(values)
    at = np.linspace(0.0, times[-1], 23)
    lower, upper = tube_around(times, values, at, dt, dy)
    for k, moment in enumerate(at):
        near = np.linspace(max(moment - dt, 0.0), min(moment + dt, times[-1]), 2001)
        dense = np.interp(near, times, values)
        assert lower[k] == pytest.approx(dense.min() - dy, abs=0.1)
        assert upper[k] == pytest.approx(dense.max() + dy, abs=0.1)
        assert lower[k] <= dense.min() - dy + 1e-12
        assert upper[k] >= dense.max() + dy - 1e-12


def test_no_tolerance_holds_only_the_curve_itself():
    assert hold(sawtooth(T), dt=0.0, dy=0.0).inside
    assert not hold(sawtooth(T) + 1e-9, dt=0.0, dy=0.0).inside


def test_runs_are_compared_by_signal():
    first, second = run(np.full(501, 20.0)), run(np.full(501, 20.3), method="other")
    assert not study_tube(first, second, dt=0.001, dy=0.2).inside
    assert study_tube(first, second, dt=0.001, dy=0.2, signal="theta").inside
    assert study_tube(first, second, dt=0.001, dy=0.2, signal="r", of_slice=0).inside
    assert not study_tube(first, second, dt=0.001, dy=0.2, signal="r", of_slice=1).inside


def test_impossible_questions_are_refused():
    one = run(np.ones(501))
    with pytest.raises(ValueError, match="known: omega"):
        study_tube(one, one, dt=0.1, dy=0.1, signal="speed")
    with pytest.raises(ValueError, match=r"outside \[0, 1\]"):
        study_tube(one, one, dt=0.1, dy=0.1, signal="r", of_slice=2)
    for dt, dy in ((-1.0, 1.0), (1.0, -1.0), (math.nan, 1.0)):
        with pytest.raises(ValueError, match="must not be negative"):
            study_tube(one, one, dt=dt, dy=dy)
