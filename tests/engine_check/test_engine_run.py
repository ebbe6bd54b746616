"""The run in pymunk as a whole: its residuals, steps, sensitivity, reading."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import engine_check
from engine_check import DEFAULT_DT
from engine_check.pymunk_settings import PymunkKnobs
from engine_check.pymunk_world import BatchReader, build, read_single
from slicemodel.scenario import Scenario

solve = partial(engine_check.solve, dt=DEFAULT_DT)
"""At a given step: how one is found is the subject of ``test_certificate``."""

FIFTY = Scenario().with_slices(50)
TEN = replace(Scenario().with_slices(10), duration=0.1)


@pytest.fixture(scope="module")
def default_run():
    return solve(FIFTY)


def test_the_default_run_is_complete(default_run):
    run = default_run
    assert run.ok
    assert run.message == ""
    assert (run.solver, run.method) == ("engine_check", "pymunk")
    assert run.impacts is None
    assert run.t.shape == (1000,)
    assert run.r.shape == run.v.shape == (1000, 50)
    assert run.settings["iterations"] == 127
    assert run.diagnostics["angular_momentum_drift"] < 1e-11
    assert run.diagnostics["linear_momentum_residual"] < 1e-12
    assert run.diagnostics["constraint_drift"] < 1e-6
    assert run.diagnostics["omega_mismatch"] < 1e-4
    assert run.diagnostics["penetration"] < 1e-3


def test_theta_is_unwrapped_and_is_the_integral_of_omega(default_run):
    run = default_run
    turned = np.concatenate([[0.0], np.cumsum(np.diff(run.t) * (run.omega[1:] + run.omega[:-1]) / 2)])
    np.testing.assert_allclose(run.theta - run.theta[0], turned, atol=1e-4)


def test_v_is_the_rate_of_r(default_run):
    """In the median: at impacts, which the recoil of the light tube hands on to all slices, v jumps."""
    run = default_run
    gap = np.abs(np.diff(run.r, axis=0) / np.diff(run.t)[:, None] - (run.v[1:] + run.v[:-1]) / 2)
    assert np.median(gap) < 1e-3


def test_the_sign_of_theta_carries_the_base_ahead():
    """A bottle upright at theta = 0 that turns counter-clockwise moves its base to +x."""
    scenario = replace(TEN, theta0=0.0, gravity=0.0, launch_velocity=(0.0, 0.0))
    world = build(scenario, PymunkKnobs(), 50, "rigid")
    first = world.slices[0]
    assert first.position.y < world.tube.position.y
    assert first.velocity.x - world.tube.velocity.x == pytest.approx(20.0 * (scenario.r_max - 0.14))


def test_dt_is_an_upper_bound_and_the_step_is_stated():
    run = solve(TEN, dt=3e-4, times=[0.0, 0.001, 0.1])
    assert run.settings["step"] == pytest.approx(0.099 / 330)
    assert run.settings["step_least"] == pytest.approx(0.00025)
    assert run.settings["dt"] == 3e-4
    assert run.diagnostics["steps"] == 334
    assert run.diagnostics["linear_momentum_residual"] < 1e-12
    whole = solve(TEN, dt=1e-4, times=[0.1])
    assert whole.diagnostics["steps"] == 1000


def test_batch_reads_equal_single_reads():
    world = build(TEN, PymunkKnobs(), 50, "rigid")
    reader = BatchReader(world)
    assert reader.how == "batch"
    for _ in range(50):
        world.space.step(1e-4)
        assert np.array_equal(reader.read(), read_single(world))


@pytest.mark.parametrize("fault", [AttributeError("gone"), ValueError("other shape")])
def test_a_broken_batch_module_falls_back_to_single_reads(monkeypatch, fault):
    def refuse(*_):
        raise fault

    with monkeypatch.context() as patch:
        patch.setattr("pymunk.batch.get_space_bodies", refuse)
        run = solve(TEN, times=[0.0, 0.1])
    assert run.settings["reads"] == "single"
    assert np.array_equal(run.omega, solve(TEN, times=[0.0, 0.1]).omega)


def test_more_iterations_change_nothing_and_half_the_step_little():
    """Of omega after most impacts: 1e-6 for twice the iterations, 1e-3 omega_0 for half the step."""
    times = np.linspace(0.0, 0.25, 251)
    base, iterated, refined = (
        solve(replace(FIFTY, duration=0.25), times=times, **change)
        for change in ({}, {"iterations": 254}, {"dt": 5e-5})
    )
    assert abs(iterated.omega[-1] - base.omega[-1]) < 1e-5
    assert np.max(np.abs(iterated.omega - base.omega)) < 1e-4
    assert abs(refined.omega[-1] - base.omega[-1]) < 1e-3 * FIFTY.omega0


@pytest.mark.slow
@pytest.mark.parametrize(("n", "water_mass"), [(10, 0.5), (20, 0.9), (100, 0.5), (50, 1.0), (50, 0.1)])
def test_the_default_iterations_suffice(n, water_mass):
    scenario = replace(Scenario(), water_mass=water_mass).with_slices(n)
    times = np.linspace(0.0, 0.5, 101)
    run = solve(scenario, times=times)
    more = solve(scenario, times=times, iterations=2 * run.settings["iterations"])
    assert run.ok
    assert abs(more.omega[-1] - run.omega[-1]) < 1e-4 * scenario.omega0


@pytest.mark.slow
def test_the_default_step_is_trustworthy_against_a_finer_one():
    times = np.linspace(0.0, 0.5, 501)
    runs = [solve(FIFTY, dt=dt, times=times) for dt in (1e-4, 5e-5, 2.5e-5)]
    assert all(run.ok for run in runs)
    for run in runs[:-1]:
        assert np.max(np.abs(run.omega - runs[-1].omega)) < 5e-3 * FIFTY.omega0
