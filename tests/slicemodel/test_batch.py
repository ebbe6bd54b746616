"""Many throws at once equal one at a time, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest

import slicemodel
from slicemodel import Bottle, Scenario, solve_batch
from slicemodel.schemes import SCHEMES

RAGGED = [
    Scenario(n_slices=1),
    Scenario(n_slices=40, drag=0.1, water_mass=0.9),
    Scenario(n_slices=8, omega0=-12.0, duration=0.3),
    Scenario(n_slices=13, bottle=Bottle(length=0.2), frozen=True),
    Scenario(n_slices=100, restitution=1.0, theta0=0.2),
] * 5


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("jobs", [1, 3])
def test_is_solve_to_the_last_bit(scheme, jobs):
    batch = solve_batch(RAGGED, scheme, 150, jobs=jobs)
    assert len(batch) == len(RAGGED)
    assert batch.theta.shape == batch.omega.shape == batch.r_cm.shape == batch.inertia.shape == (len(RAGGED), 150)
    for i, (scenario, one) in enumerate(zip(RAGGED, batch, strict=True)):
        alone = slicemodel.solve(scenario, scheme, 150, "summary")
        for name in ("t", "theta", "omega", "r_cm", "inertia", "r", "v"):
            np.testing.assert_array_equal(getattr(one, name), getattr(alone, name))
        np.testing.assert_array_equal(batch.omega[i, : len(alone.t)], alone.omega)
        assert (one.status, one.message, one.settings) == (alone.status, alone.message, alone.settings)
        assert one.diagnostics["rebounds"] == len(alone.impacts)
        assert one.scenario is scenario
        assert one.impacts is None


def test_rebounds_in_the_step_too():
    batch = solve_batch(RAGGED, steps=60, rebound="in-step")
    alone = slicemodel.solve(RAGGED[4], steps=60, store="summary", rebound="in-step")
    np.testing.assert_array_equal(batch.omega[4], alone.omega)
    assert batch[4].settings["rebound"] == "in-step"


def test_a_throw_that_overflows_ends_in_nan_and_spoils_no_other():
    throws = [Scenario(n_slices=3), Scenario(n_slices=3, omega0=1e15, duration=1.0), Scenario(n_slices=4)]
    batch = solve_batch(throws, steps=10)
    assert [one.status for one in batch] == ["ok", "overflow", "ok"]
    points = len(batch[1].t)
    assert 1 <= points < 10
    assert np.isfinite(batch.theta[1, :points]).all()
    for name in ("theta", "omega", "r_cm", "inertia"):
        assert np.isnan(getattr(batch, name)[1, points:]).all()
        assert np.isfinite(getattr(batch, name)[[0, 2]]).all()


def test_results_cannot_be_written():
    batch = solve_batch([Scenario(n_slices=2)], steps=3)
    for name in ("theta", "omega", "r_cm", "inertia"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(batch, name)[0, 0] = 1.0
    assert repr(batch) == "Batch of 1 throws: exact-step, 3 points"
    assert batch[-1].scenario is batch.scenarios[0]
    with pytest.raises(IndexError):
        batch[1]


def test_any_iterable_of_scenarios_will_do():
    throws = (Scenario(n_slices=n) for n in (1, 2, 3))
    assert [one.scenario.n_slices for one in solve_batch(throws, steps=5)] == [1, 2, 3]


def test_a_fault_in_one_throw_reaches_the_caller(monkeypatch):
    def broken(*_):
        raise RuntimeError("a fault in a thread")

    monkeypatch.setattr("slicemodel.batch.advance", broken)
    with pytest.raises(RuntimeError, match="a fault in a thread"):
        solve_batch([replace(Scenario(), n_slices=2)] * 4, jobs=2)
