"""Rebounds are the engine's own: restitution, sticking, energy, the simultaneous law, creep of a rest."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import engine_check
from engine_check import DEFAULT_DT
from engine_check.pymunk_settings import PymunkKnobs
from engine_check.pymunk_world import build
from slicemodel.scenario import Scenario

solve = partial(engine_check.solve, dt=DEFAULT_DT)
"""At a given step: how one is found is the subject of ``test_certificate``."""

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
    """Event-driven, simultaneous law: 7.4761 at 0.3 s; the sequential law gives 3.3151."""
    pair = replace(Scenario(), n_slices=2, drag=0.0, duration=0.3)
    omega = solve(pair, dt=1e-5, iterations=200, times=[0.3]).omega[-1]
    assert omega == pytest.approx(7.4757, abs=3e-4)
    finer = solve(pair, dt=5e-6, iterations=200, times=[0.3]).omega[-1]
    assert abs(2 * finer - omega - 7.4761) < 2e-4


def axial_energy(run):
    """Energy in the frame of the centre of mass [J]: rotation, slices along the axis, recoil of the tube."""
    scenario = run.scenario
    recoil = scenario.slice_mass * run.v.sum(axis=1) / scenario.total_mass
    axial = scenario.slice_mass * ((run.v - recoil[:, None]) ** 2).sum(axis=1) + scenario.bottle.mass * recoil**2
    return (run.inertia * run.omega**2 + axial) / 2


def test_elastic_rebounds_without_drag_keep_the_energy_at_order_two():
    elastic = replace(Scenario(), n_slices=5, restitution=1.0, drag=0.0)
    losses = []
    for dt in (2e-4, 1e-4, 5e-5):
        run = solve(elastic, dt=dt, times=np.linspace(0.0, 0.5, 101))
        assert run.ok
        energy = axial_energy(run)
        # The median: at an output time that is an impact, r' is a mean over the jump.
        losses.append(np.median(np.abs(energy[50:] / energy[0] - 1.0)))
    orders = np.log2(np.array(losses[:-1]) / losses[1:])
    assert np.all(np.abs(orders - 2.0) < 0.3), (losses, orders)
    assert losses[1] < 3e-5


def test_energy_never_grows_with_drag_and_inelastic_rebounds():
    run = solve(Scenario().with_slices(10), times=np.linspace(0.0, 0.5, 101))
    energy = axial_energy(run)
    assert np.all(np.diff(energy) <= 1e-3 * energy[0])
    assert energy[-1] < 0.5 * energy[0]


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


def test_position_correction_trades_angular_momentum_for_depth():
    """Why collision_bias is 1: any correction moves bodies but not their velocities."""
    heavy = replace(Scenario(), water_mass=0.1, restitution=0.0).with_slices(10)
    times = np.linspace(0.0, 0.5, 51)
    ours, corrected = (solve(heavy, times=times, **knobs) for knobs in ({}, {"collision_bias": 0.9**60}))
    assert ours.diagnostics["angular_momentum_drift"] < 1e-11
    assert corrected.diagnostics["angular_momentum_drift"] > 1e-3
    assert corrected.diagnostics["penetration"] < ours.diagnostics["penetration"]
