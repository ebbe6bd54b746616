"""Rods that cannot overlap, event by event, and the closed form at e = 0: two derivations that share no line."""

import math
from dataclasses import replace

import numpy as np
import pytest
import rod_stacks
import rods_by_events as by_events

from ode_reference import solve
from slicemodel import observables
from slicemodel.scenario import Bottle, Scenario

ROUND_OFF = 1e-11
"""Admissible difference of two exact solutions, fraction of omega_0, L and 1 rad; measured 1e-13 at rtol 1e-10."""

INELASTIC = replace(Scenario(), drag=0.0, restitution=0.0)
TIMES = np.linspace(0.0, 0.5, 26)

CASES = [(1, 0.5), (2, 0.5), (2, 0.9), (3, 0.5), (4, 0.7), (5, 0.5), (8, 0.6), (10, 0.3)]


def energy(run):
    """Energy in the frame of C_M [J]: rotation, rods along the axis, recoil of the tube."""
    scenario = run.scenario
    recoil = scenario.slice_mass * run.v.sum(axis=1) / scenario.total_mass
    axial = scenario.slice_mass * ((run.v - recoil[:, None]) ** 2).sum(axis=1) + scenario.bottle.mass * recoil**2
    return (run.inertia * run.omega**2 + axial) / 2


@pytest.fixture
def meeting(monkeypatch):
    """Two rods off the base of a heavy bottle: both fly to it, the first comes back and meets the second."""
    monkeypatch.setattr(Scenario, "initial_positions", lambda _self: np.array([0.24, 0.18]))
    return Scenario(bottle=Bottle(mass=0.5), water_mass=0.2, n_slices=2, drag=0.0, restitution=1.0, duration=0.3)


# ---------------------------------------------------------------------- the closed form


@pytest.mark.parametrize(("n", "water_mass"), CASES)
def test_the_closed_form_and_the_event_driven_run_agree(n, water_mass):
    scenario = replace(INELASTIC, n_slices=n, water_mass=water_mass)
    theta, omega, r = rod_stacks.solve(scenario).at(TIMES)
    run = by_events.solve(scenario, times=TIMES)
    assert np.max(np.abs(run.omega - omega)) < ROUND_OFF * scenario.omega0
    assert np.max(np.abs(run.r - r)) < ROUND_OFF * scenario.bottle.length
    assert np.max(np.abs(run.theta - theta)) < ROUND_OFF


@pytest.mark.parametrize(("n", "water_mass"), CASES)
def test_inelastic_rods_split_at_the_centre_of_mass(n, water_mass):
    scenario = replace(INELASTIC, n_slices=n, water_mass=water_mass, duration=5.0)
    exact = rod_stacks.solve(scenario)
    beyond = exact.starts > 0
    assert exact.stages[-1].base == beyond.sum()
    assert exact.stages[-1].cap == n - beyond.sum()
    for _, rod, end in exact.landings:
        assert (end > 0) == beyond[rod]


def test_the_closed_form_keeps_angular_momentum_and_its_places_make_its_inertia():
    scenario = replace(INELASTIC, n_slices=5)
    _, omega, r = rod_stacks.solve(scenario).at(TIMES)
    inertia = observables.moment_of_inertia(scenario, r)
    np.testing.assert_allclose(inertia * omega, inertia[0] * scenario.omega0, rtol=1e-13)
    assert np.all(np.diff(-r, axis=1) >= scenario.slice_height * (1 - 1e-12))


def test_one_of_two_rods_is_a_two_body_problem():
    """Energy of the relative motion with the reduced mass: the landing time by a sum that knows no C(t)."""
    scenario = replace(INELASTIC, n_slices=2)
    bottle, m = scenario.bottle, scenario.slice_mass
    base, start = scenario.initial_positions()
    body = bottle.mass + m
    centre = (bottle.mass * bottle.length / 2 + m * base) / body
    reduced = m * body / (m + body)
    own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    own += bottle.mass * (bottle.length / 2 - centre) ** 2 + m * (base - centre) ** 2
    q0, q1 = centre - start, centre - scenario.r_min
    momentum = (own + reduced * q0**2) * scenario.omega0
    s = (np.arange(200_000) + 0.5) / 200_000 * math.sqrt(q1 - q0)
    q = q0 + s * s
    # q'^2 = (L^2 / reduced) (1/J_0 - 1/J), J - J_0 = reduced (q - q0) (q + q0)
    slowness = 2 / (momentum * np.sqrt((q + q0) / ((own + reduced * q0**2) * (own + reduced * q**2))))
    expected = slowness.sum() * math.sqrt(q1 - q0) / 200_000
    assert rod_stacks.solve(scenario).landings[0][0] == pytest.approx(expected, rel=1e-9, abs=0.0)


# ---------------------------------------------------------------------- the event-driven run


def test_two_rods_that_never_meet_are_two_slices():
    """In the paper's throw neither can tell rods from slices that overlap: the two programs share no equation."""
    scenario = Scenario().with_slices(2)
    run = by_events.solve(scenario, times=TIMES, rest_speed=1e-3)
    slices = solve(scenario, "free-flight", times=TIMES, rest_speed=1e-3)
    assert run.diagnostics["rod_impacts"] == 0
    assert len(run.impacts) > 10
    assert np.max(np.abs(run.omega - slices.omega)) < 1e-9 * scenario.omega0
    assert np.max(np.abs(run.r - slices.r)) < 1e-7 * scenario.bottle.length
    for mine, other in zip(list(run.impacts)[:5], list(slices.impacts)[:5], strict=True):
        assert (mine.slice, mine.end) == (other.slice, other.end)
        expected = (other.time, other.speed_before, other.speed_after)
        assert (mine.time, mine.speed_before, mine.speed_after) == pytest.approx(expected, rel=1e-7, abs=0.0)


def test_elastic_rods_without_drag_keep_energy_through_their_impacts(meeting):
    run = by_events.solve(meeting, times=np.linspace(0.0, 0.3, 61))
    assert run.diagnostics["rod_impacts"] >= 2
    np.testing.assert_allclose(energy(run), energy(run)[0], rtol=1e-9)
    assert run.diagnostics["largest_momentum"] < 1e-12
    assert run.diagnostics["largest_overlap"] < 1e-12


@pytest.mark.parametrize("between", [0.0, 0.25, 0.5, 0.75, 1.0])
def test_two_rods_part_with_their_own_restitution(meeting, between):
    tube = by_events.Tube(meeting, between)
    touching = np.array([False, True, False])
    u = np.array([-0.7, 0.9, 0.1])
    w = tube.gaps_of @ u
    after = u + tube.pushed(tube.thrust(-(1 + tube.restitution) * w, touching))
    assert (tube.gaps_of @ after)[1] == pytest.approx(between * 1.6, abs=1e-13)
    assert tube.mass @ after == pytest.approx(tube.mass @ u, abs=1e-14)
    assert after[2] == u[2]
    run = by_events.solve(replace(meeting, restitution=0.8), between, times=[0.3])
    assert run.diagnostics["rod_impacts"] > 0


def test_impulses_solve_the_complementarity_problem():
    """p >= 0, w+ + e w >= 0, and one of them zero: 200 random impacts of five rods on all gaps but one."""
    tube = by_events.Tube(replace(Scenario(), restitution=0.7).with_slices(5), 0.4)
    rng = np.random.default_rng(1)
    for _ in range(200):
        touching = np.ones(6, dtype=bool)
        touching[rng.integers(6)] = False
        w = tube.gaps_of @ rng.normal(size=6)
        p = tube.thrust(-(1 + tube.restitution) * w, touching)
        rest = (w + tube.coupling @ p + tube.restitution * w)[touching]
        assert np.all(p >= 0)
        assert np.all(rest > -1e-10)
        assert np.max(np.abs(p[touching] * rest)) < 1e-10


@pytest.mark.parametrize(("n", "water_mass", "restitution"), [(2, 0.9, 0.5), (3, 0.5, 0.5), (5, 0.7, 0.5)])
def test_the_rest_speed_does_not_matter(n, water_mass, restitution):
    scenario = replace(Scenario(), water_mass=water_mass, restitution=restitution).with_slices(n)
    fine, coarse = (by_events.solve(scenario, times=TIMES, rest_speed=speed) for speed in (1e-5, 1e-3))
    assert fine.diagnostics["events"] > coarse.diagnostics["events"]
    assert np.max(np.abs(fine.omega - coarse.omega)) < 1e-6 * scenario.omega0


def test_energy_never_grows_and_drag_takes_some(meeting):
    run = by_events.solve(replace(meeting, restitution=0.6, drag=0.2), 0.3, times=np.linspace(0.0, 0.3, 301))
    values = energy(run)
    assert np.all(np.diff(values) <= 1e-12)
    assert values[-1] < 0.98 * values[0]
