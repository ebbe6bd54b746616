"""What ``required_steps`` refuses; that it keeps its promise stands in the cross-validation."""

import pytest

from slicemodel import Scenario, required_steps

SMALL = Scenario().with_slices(5)


def test_a_tolerance_out_of_reach_is_said_so(monkeypatch):
    monkeypatch.setattr("slicemodel.step_advice.MAX_STEPS", 256)
    with pytest.raises(ValueError, match=r"more than 256 steps of exact-step .* second order is .midpoint."):
        required_steps(SMALL, 1e-9)


def test_ice_needs_the_fewest():
    assert required_steps(Scenario(n_slices=3, frozen=True), 1e-6) == 65


def test_the_worst_error_times_one_and_a_half_must_meet_the_tolerance_in_two_octaves(monkeypatch):
    """Of errors 7 tolerances / octave the eighth would do without that margin; the first octave that has it is 16."""
    monkeypatch.setattr("slicemodel.step_advice._worst_of_octave", lambda *ask: 7e-3 / ask[-1])
    assert required_steps(SMALL, 1e-3) == 16 * 64 + 1


def test_where_rounding_grows_one_octave_must_do_or_it_is_blamed(monkeypatch):
    errors = {octave: 1 / octave if octave <= 2048 else 1e-3 * octave for octave in (2**k for k in range(20))}
    monkeypatch.setattr("slicemodel.step_advice._worst_of_octave", lambda *ask: errors[ask[-1]])
    assert required_steps(SMALL, 1.6 / 2048) == 2048 * 64 + 1
    with pytest.raises(ValueError, match=r"error is 0\.00049 at 131072 steps, and rounding hides it on finer grids"):
        required_steps(SMALL, 1.4 / 2048)


def test_second_order_needs_fewer():
    assert required_steps(SMALL, 1e-3, "midpoint") * 4 <= required_steps(SMALL, 1e-3, "exact-step")
