"""Ensembles whose width is known."""

import math

import numpy as np
import pytest
from made_up import trajectory_of

from flipproof.curves.ensemble import Ensemble, difference
from slicemodel import Scenario, Trajectory

T = np.linspace(0.0, 0.5, 1001)
THROW = Scenario(n_slices=1)


def flight(change, *, points=None, status="ok", t=T) -> Trajectory:
    """Return a run with omega = omega_0 (1 + change)."""
    omega = 20.0 * (1.0 + np.broadcast_to(change, t.shape)[:points])
    return trajectory_of(THROW, t[:points], omega=omega, status=status)


def ensemble(*members):
    return Ensemble.of(members, 1e-3)


def test_the_width_is_that_of_all_members_and_has_its_horizon():
    growing = 1e-6 * np.exp(40 * np.minimum(T, 0.2))
    found = ensemble(flight(0.0), flight(growing), flight(-growing))
    assert found.width == pytest.approx(2 * growing, rel=1e-6, abs=0.0)
    assert found.change == pytest.approx(growing, rel=1e-6, abs=0.0)
    assert found.horizon == pytest.approx(math.log(1e-3 / 2e-6) / 40, abs=1e-4)
    assert found.largest == found.width[-1] == pytest.approx(2e-6 * math.exp(8))


def test_members_on_the_same_side_do_not_widen_the_ensemble_twice():
    assert ensemble(flight(0.0), flight(1e-4), flight(5e-5)).largest == pytest.approx(1e-4)


def test_an_ensemble_that_stays_together_has_no_horizon():
    found = ensemble(flight(0.0), flight(0.0))
    assert (found.horizon, found.largest, found.ended) == (None, 0.0, None)


def test_a_member_that_ends_is_a_horizon_and_not_a_cut():
    found = ensemble(flight(0.0), flight(1e-6, points=101, status="diverged"))
    assert len(found.t) == len(T)
    assert found.horizon == found.ended == pytest.approx(T[100])
    assert np.isinf(found.width[101:]).all()
    assert np.isinf(found.change[101:]).all()
    assert np.isinf(found.largest)
    both = ensemble(*(flight(0.0, points=101, status="diverged") for _ in range(2)))
    assert both.ended == pytest.approx(T[100])


def test_a_difference_is_taken_at_the_times_of_the_first_that_both_have():
    other = np.linspace(0.0, 0.3, 31)
    t, signed = difference(flight(0.0), flight(-other, t=other))
    assert t[-1] == pytest.approx(0.3)
    assert signed == pytest.approx(-t)
