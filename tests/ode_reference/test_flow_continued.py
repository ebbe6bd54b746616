"""A flight carried on from a state of another method goes where that method goes."""

from dataclasses import replace

import numpy as np
import pytest

import ode_reference
from flipproof.foreign.contract import begun
from slicemodel import Scenario

THROW = replace(Scenario(), duration=0.3).with_slices(6)
TIMES = np.linspace(0.0, THROW.duration, 121)


@pytest.mark.arithmetic
@pytest.mark.parametrize("model", ["published-limit", "eq8", "accelerating-origin", "free-flight"])
def test_a_flight_carried_on_from_the_states_of_solve_ivp_goes_on_as_that_does(model):
    witness = ode_reference.solve(THROW, model, TIMES, method="DOP853", rtol=1e-12, rest_speed=1e-5)
    assert len(witness.impacts.time) > 3
    for k in range(0, len(TIMES) - 20):
        span = TIMES[k + 20] - TIMES[k]
        places = np.clip(witness.r[k], THROW.r_min, THROW.r_max)
        state = begun(THROW, places, theta0=witness.theta[k], omega0=witness.omega[k], duration=span)
        carried = ode_reference.solve(state, model, [span], speeds=witness.v[k], rest_speed=1e-5)
        assert carried.theta[-1] == pytest.approx(witness.theta[k + 20], abs=1e-8)
        assert carried.omega[-1] == pytest.approx(witness.omega[k + 20], abs=1e-8)
        assert carried.r[-1] == pytest.approx(witness.r[k + 20], abs=1e-9)
        assert carried.v[-1] == pytest.approx(witness.v[k + 20], abs=1e-7)


def test_a_slice_that_leaves_an_end_at_release_is_no_impact():
    r = np.array([THROW.r_max, THROW.r_min, 0.1, 0.1, 0.1, 0.1])
    state = begun(THROW, r, duration=1e-3)
    leaving = ode_reference.solve(state, "eq8", [1e-3], speeds=[-1.0, 1.0, 0, 0, 0, 0])
    assert not len(leaving.impacts.time)
    assert leaving.r[-1][:2] == pytest.approx([THROW.r_max - 1e-3, THROW.r_min + 1e-3], abs=1e-4)
    striking = ode_reference.solve(state, "eq8", [1e-3], speeds=[1.0, -1.0, 0, 0, 0, 0])
    assert striking.impacts.slice.tolist() == [0, 1]
    assert striking.impacts.time.tolist() == [0.0, 0.0]
