"""The run in pymunk as a whole: its residuals, steps, sensitivity, reading; its rebounds, rests and their creep."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from engine_worlds import energy

import engine_check
from engine_check import DEFAULT_DT, pymunk_settings
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


# ---------------------------------------------------------------------- rebounds are the engine's own

ONE = replace(Scenario(), n_slices=1, water_mass=0.1, drag=0.0, duration=0.1)


@pytest.mark.parametrize("end", [1.0, -1.0], ids=["base", "cap"])
@pytest.mark.parametrize("restitution", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_a_single_slice_leaves_with_e_times_its_speed(restitution, end):
    world = build(replace(ONE, restitution=restitution, gravity=0.0), PymunkKnobs(), 50, "rigid")
    tube, ball = world.tube, world.slices[0]
    tube.position, tube.angle, tube.velocity, tube.angular_velocity = (0.0, 0.0), 0.0, (0.0, 0.0), 0.0
    ball.position, ball.velocity = (0.0, 0.0), (0.0, -end * 2.0)
    speeds = []
    while len(speeds) < 2000:
        world.space.step(1e-4)
        speeds.append(-end * (ball.velocity.y - tube.velocity.y))
    # Before the impact 2 m/s; the slice then crosses no other end within the 0.2 s of the test unless e = 1.
    out = next(speed for speed in speeds if abs(speed - 2.0) > 1e-9)
    assert -out / speeds[0] == pytest.approx(restitution, abs=1e-12)


def test_a_pair_follows_the_simultaneous_impact_law():
    """Event-driven, 7.4761 at 0.3 s; impacts taken in turn, the fastest first, give 3.3151."""
    pair = replace(Scenario(), n_slices=2, drag=0.0, duration=0.3)
    omega = solve(pair, dt=1e-5, iterations=200, times=[0.3]).omega[-1]
    assert omega == pytest.approx(7.4757, abs=3e-4)
    finer = solve(pair, dt=5e-6, iterations=200, times=[0.3]).omega[-1]
    assert abs(2 * finer - omega - 7.4761) < 2e-4


def test_elastic_rebounds_without_drag_keep_the_energy_at_order_two():
    elastic = replace(Scenario(), n_slices=5, restitution=1.0, drag=0.0)
    losses = []
    for dt in (2e-4, 1e-4, 5e-5):
        run = solve(elastic, dt=dt, times=np.linspace(0.0, 0.5, 101))
        assert run.ok
        kept = energy(run)
        # The median: at an output time that is an impact, r' is a mean over the jump.
        losses.append(np.median(np.abs(kept[50:] / kept[0] - 1.0)))
    orders = np.log2(np.array(losses[:-1]) / losses[1:])
    assert np.all(np.abs(orders - 2.0) < 0.3), (losses, orders)
    assert losses[1] < 3e-5


def test_energy_never_grows_with_drag_and_inelastic_rebounds():
    run = solve(Scenario().with_slices(10), times=np.linspace(0.0, 0.5, 101))
    kept = energy(run)
    assert np.all(np.diff(kept) <= 1e-3 * kept[0])
    assert kept[-1] < 0.5 * kept[0]


def test_slices_without_restitution_stick_to_the_ends():
    """Two slices: the impact on the cap pulls the base along, so the other one stays at rest, too."""
    pair = replace(Scenario(), n_slices=2, drag=0.0, restitution=0.0)
    run = solve(pair, times=np.linspace(0.0, 0.5, 501))
    at_cap = run.r[:, 1] <= pair.r_min
    landed = int(at_cap.argmax())
    assert 0 < landed < 400
    assert at_cap[landed:].all()
    assert np.all(run.r[:, 0] >= pair.r_max - 1e-12)
    assert np.max(np.abs(run.v[landed + 1 :])) < 1e-2


@pytest.mark.parametrize("restitution", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_a_resting_slice_creeps_as_derived(restitution):
    """(1 - e) / (2 (1 + e)) omega^2 (r - L/2) dt: order 1, and none at e = 1."""
    times = np.linspace(0.0, 0.1, 11)
    for dt in (1e-4, 5e-5):
        run = solve(replace(ONE, restitution=restitution), dt=dt, times=times)
        push = run.omega[1:] ** 2 * (run.r[1:, 0] - 0.14)
        creep = (1 - restitution) / (2 * (1 + restitution)) * dt * np.trapezoid(push, run.t[1:])
        assert run.r[-1, 0] - run.r[1, 0] == pytest.approx(creep, rel=1e-4, abs=2e-9)


def test_position_correction_trades_angular_momentum_for_depth(monkeypatch):
    """Why COLLISION_BIAS is 1: any correction moves bodies but not their velocities."""
    heavy = replace(Scenario(), water_mass=0.1, restitution=0.0).with_slices(10)
    times = np.linspace(0.0, 0.5, 51)
    ours = solve(heavy, times=times)
    monkeypatch.setattr(pymunk_settings, "COLLISION_BIAS", 0.9**60)
    corrected = solve(heavy, times=times)
    assert ours.diagnostics["angular_momentum_drift"] < 1e-11
    assert corrected.diagnostics["angular_momentum_drift"] > 1e-3
    assert corrected.diagnostics["penetration"] < ours.diagnostics["penetration"]
