"""The tube: early passes, wrong fails."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up import trajectory_of

from flipproof.chapters.alignment.chapter import study_tube
from flipproof.curves import tube as tubes
from flipproof.curves.tube import tube_around
from slicemodel import Scenario

T = np.linspace(0.0, 0.5, 501)


def sawtooth(t, early=0.0):
    return ((t + early) * 10) % 1.0


def hold(values, t=T, dt=0.003, dy=0.01, reference=None):
    return tubes.hold(T, sawtooth(T) if reference is None else reference, t, values, dt=dt, dy=dy)


def test_an_early_bounce_passes_where_a_pointwise_comparison_fails():
    early = sawtooth(T, early=0.0025)
    assert np.abs(early - sawtooth(T)).max() > 0.9
    tube = hold(early)
    assert tube.first_exit is None
    assert tube.share == pytest.approx(1.0)
    assert tube.largest == 0.0


def test_a_bounce_too_early_fails():
    tube = hold(sawtooth(T, early=0.006))
    assert tube.first_exit is not None
    assert tube.first_exit == pytest.approx(0.0, abs=0.001)
    assert tube.largest > 0.5


def test_a_wrong_level_fails():
    flat = np.ones(501)
    tube = hold(np.where(T < 0.2, 1.0, 1.05), reference=flat, dt=0.05)
    assert tube.first_exit is not None
    # Between 0.199 and 0.2 s the level rises by 0.05, and by 0.01 after a fifth of that.
    assert tube.first_exit == pytest.approx(0.1992, abs=1e-6)
    assert tube.largest == pytest.approx(0.04)
    # The step of the grid in which it leaves counts half.
    assert tube.share == pytest.approx(0.399, abs=1e-6)
    assert hold(flat + 0.0099, reference=flat).first_exit is None
    assert hold(flat - 0.0101, reference=flat).first_exit is not None


def test_a_run_that_ends_early_is_outside_from_there():
    tube = hold(sawtooth(T[:201]), t=T[:201])
    assert tube.first_exit == pytest.approx(0.2)
    assert tube.share == pytest.approx(0.4, abs=0.01)
    assert tube.largest == 0.0
    whole, short = (trajectory_of(Scenario(n_slices=2), t, omega=sawtooth(t)) for t in (T, T[:201]))
    assert "ends at 200.0 ms" in study_tube(whole, short)[1]


def test_other_times_do_not_matter_and_what_the_reference_does_not_reach_is_not_judged():
    t = np.linspace(0.0, 0.7, 4321)
    values = np.where(t <= 0.501, np.interp(t, T, sawtooth(T)), 99.0)
    assert hold(values, t=t, dy=1e-9).first_exit is None


def test_an_excursion_between_the_points_of_the_reference_is_seen():
    t = np.array([0.0, 0.1005, 0.1006, 0.1007, 0.5])
    assert hold(np.array([1.0, 1.0, 2.0, 1.0, 1.0]), t=t, reference=np.ones(501)).first_exit is not None


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
    assert hold(sawtooth(T), dt=0.0, dy=0.0).first_exit is None
    assert hold(sawtooth(T) + 1e-9, dt=0.0, dy=0.0).first_exit is not None
