"""The stepper of the package against SciPy's class of the same method."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import DOP853

from ode_reference.models import LADDER, MODELS
from ode_reference.motion import Motion, Throw
from ode_reference.steppers import DormandPrince
from slicemodel.scenario import Scenario

SCENARIO = Scenario(n_slices=9, drag=0.5)


def begin(model):
    motion = Motion(Throw.of(SCENARIO), MODELS[model], np.arange(9) == 0)
    rng = np.random.default_rng(2)
    v = rng.normal(0, 0.5, 9)
    v[0] = 0.0
    y = np.concatenate([[0.3], SCENARIO.initial_positions(), v])
    return motion, y


def both(model, rtol, max_step):
    motion, y = begin(model)
    ours = DormandPrince(motion, 0.2, rtol=rtol, atol=1e-12, max_step=max_step)
    ours.start(motion.at(0.0, y))
    return ours, DOP853(motion, 0.0, y, 0.2, first_step=max_step, max_step=max_step, rtol=rtol, atol=1e-12)


@pytest.mark.parametrize("model", LADDER)
def test_equal_steps_and_their_dense_output_are_those_of_scipy(model):
    ours, theirs = both(model, 1e-2, 0.0125)
    while theirs.status == "running":
        theirs.step()
        end = ours.step()
        assert end.t == pytest.approx(theirs.t, rel=1e-14, abs=0.0)
        np.testing.assert_allclose(end.y, theirs.y, rtol=0, atol=1e-12)
        path, other = ours.dense_output(), theirs.dense_output()
        times = np.linspace(theirs.t_old, theirs.t, 7)
        np.testing.assert_allclose(path(times), other(times), rtol=0, atol=1e-12)
        one = path.state(times[3])[[1 + 4, 1 + 9 + 4]]
        np.testing.assert_allclose(path.of_slice(times[3], 4), one, rtol=4e-16, atol=1e-16)
    assert end.t == 0.2


@pytest.mark.parametrize("model", LADDER)
@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
def test_step_lengths_are_chosen_as_by_scipy(model, rtol):
    ours, theirs = both(model, rtol, 0.1)
    lengths = []
    while theirs.status == "running":
        theirs.step()
        # An estimate of the error is a difference: round-off shows in it, and moves the length in the eighth digit.
        assert ours.step().t == pytest.approx(theirs.t, rel=1e-5, abs=0.0)
        lengths.append(theirs.t - theirs.t_old)
    assert len(lengths) >= 3
    assert min(lengths) < 0.09


def test_a_step_that_cannot_be_made_says_so():
    motion, y = begin("eq8")
    y[3] = np.nan
    stepper = DormandPrince(motion, 0.2, rtol=1e-8, atol=1e-12, max_step=0.05)
    stepper.start(motion.at(0.1, y))
    assert stepper.step() == "Required step size is less than spacing between numbers."
