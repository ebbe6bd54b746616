"""The uniform column: its derivation from sums over points, its invariants, and a second solution in quadratures."""

import math
from dataclasses import replace

import numpy as np
import pytest

import ode_reference
from ode_reference.column import Column
from slicemodel import Scenario, observables

PLATEAUS = {0.25: 0.318, 0.33: 0.283, 0.40: 0.287, 0.50: 0.332, 0.75: 0.587, 1.0: 1.0}
"""omega_f / omega_0 over filling, by an independent program."""


def throw(filling, **changes):
    return replace(Scenario(), **({"water_mass": filling, "n_slices": 20, "drag": 0.0, "duration": 2.0} | changes))


def lagrangian(scenario, h, speed, omega, points=100_000):
    """Kinetic energy in the frame of C_M [J] of bottle and very many points that share the column's motion."""
    bottle = scenario.bottle
    share = (np.arange(points) + 0.5) / points
    m = scenario.water_mass / points
    r, v = bottle.length - share * h, -share * speed
    r_cm = (m * r.sum() + bottle.mass * bottle.length / 2) / scenario.total_mass
    drift = m * v.sum() / scenario.total_mass
    axial = m * ((v - drift) ** 2).sum() + bottle.mass * drift**2
    spin = m * ((r - r_cm) ** 2).sum() + bottle.mass * (
        (bottle.length / 2 - r_cm) ** 2 + bottle.radius**2 / 2 + bottle.length**2 / 12
    )
    return (axial + spin * omega**2) / 2


def by_quadrature(scenario, nodes=200):
    """Return (time, angle turned) until the front is at the cap, from energy and angular momentum alone.

    J - J_0 = x (A x + B) with x = h - h_0; x = (B/A) sinh(u)^2 makes dh / h' smooth, however small B is.
    """
    bottle, water = scenario.bottle, scenario.water_mass
    total, length, h0 = scenario.total_mass, bottle.length, scenario.fill_fraction * bottle.length
    mu = water * bottle.mass / total
    a, b = water / 12 + mu / 4, water * h0 / 6 - mu * (length - h0) / 2
    start = water * h0**2 / 12 + mu * (length - h0) ** 2 / 4
    start += bottle.mass * (bottle.radius**2 / 2 + length**2 / 12)
    mass = water / 3 - water**2 / (4 * total)
    top = math.asinh(math.sqrt((length - h0) * a / b))
    at, weights = np.polynomial.legendre.leggauss(nodes)
    u, weights = top / 2 * (at + 1), top / 2 * weights
    x = b / a * np.sinh(u) ** 2
    inertia = start + x * (a * x + b)
    slowness = 2 * np.sqrt(mass * inertia / (start * a)) / scenario.omega0
    return float(weights @ slowness), float(weights @ (slowness * start * scenario.omega0 / inertia))


@pytest.mark.parametrize("filling", [0.25, 0.5, 0.9])
def test_inertia_and_effective_mass_are_those_of_the_sums(filling):
    scenario = throw(filling)
    column = Column(scenario)
    for h, speed, omega in ((column.start, 1.3, 0.0), (0.27, 0.0, 7.0), (0.2, -2.0, 11.0)):
        formula = column.mass * speed**2 / 2 + column.inertia(h) * omega**2 / 2
        assert formula == pytest.approx(lagrangian(scenario, h, speed, omega), rel=1e-9, abs=0)


@pytest.mark.parametrize(("filling", "level"), PLATEAUS.items())
def test_the_plateau(filling, level):
    run = ode_reference.solve(throw(filling), model="column")
    assert run.ok
    assert run.omega[-1] / run.scenario.omega0 == pytest.approx(level, abs=1e-3)


@pytest.mark.parametrize("filling", [0.2395, 0.25, 0.5, 0.9])
def test_time_and_angle_to_the_cap_by_quadrature(filling):
    scenario = throw(filling)
    time, turned = by_quadrature(scenario)
    run = ode_reference.solve(scenario, model="column")
    assert run.diagnostics["stop_time"] == pytest.approx(time, rel=1e-9, abs=0)
    at_cap = ode_reference.solve(scenario, model="column", times=[time]).theta[0]
    assert at_cap - scenario.theta0 == pytest.approx(turned, rel=1e-9, abs=0)


@pytest.mark.parametrize("drag", [0.0, 0.05])
@pytest.mark.parametrize("filling", [0.25, 0.5, 0.9])
def test_energy_and_angular_momentum(filling, drag):
    run = ode_reference.solve(throw(filling, drag=drag), model="column")
    scenario = run.scenario
    assert run.diagnostics["energy_residual"] < 1e-10
    assert (run.diagnostics["lost_to_drag"] > 0.0) == (drag > 0.0)
    np.testing.assert_allclose(run.inertia * run.omega, run.inertia[0] * scenario.omega0, rtol=1e-13)
    spin = run.inertia * run.omega**2 / 2
    lost = run.diagnostics["lost_at_stop"] + run.diagnostics["lost_to_drag"]
    assert spin[0] - spin[-1] == pytest.approx(lost, rel=1e-9, abs=0)


def test_it_spreads_beyond_the_threshold_and_not_below():
    bottle = Scenario().bottle

    def excess(filling):
        return filling / (1 - filling) - 3 * bottle.mass / (filling * bottle.capacity + bottle.mass)

    low, high = 0.1, 0.5
    while high - low > 1e-9:
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) < 0 else (low, middle)
    assert low == pytest.approx(0.239, abs=1e-3)
    below = ode_reference.solve(throw(low - 1e-6), model="column")
    beyond = ode_reference.solve(throw(high + 1e-6), model="column")
    assert not below.diagnostics["spreads"]
    assert np.ptp(below.omega) == 0.0
    assert beyond.diagnostics["spreads"]
    assert beyond.diagnostics["stop_time"] is not None


def test_the_reported_parts_fit_the_observables():
    run = ode_reference.solve(throw(0.5, n_slices=200), model="column")
    h = run.scenario.bottle.length - run.r[:, -1] + run.scenario.bottle.length - run.r[:, 0]
    points = observables.moment_of_inertia(run.scenario, run.r)
    own = run.scenario.water_mass * h**2 / (12 * 200**2)
    np.testing.assert_allclose(points + own, run.inertia, rtol=1e-13)
    np.testing.assert_allclose(observables.centre_of_mass(run.scenario, run.r), run.r_cm, rtol=1e-13)
    np.testing.assert_allclose(run.r[0], run.scenario.initial_positions(), rtol=1e-14)
    late = np.gradient(run.r, run.t, axis=0)[5:-5] - run.v[5:-5]
    assert np.median(np.abs(late)) < 1e-3


@pytest.mark.parametrize("model", ["column", "rods"])
@pytest.mark.parametrize("changes", [{"water_mass": 1.0}, {"frozen": True}, {"water_mass": 0.1}])
def test_what_does_not_spread_turns_like_ice(model, changes):
    run = ode_reference.solve(throw(0.5, **{"n_slices": 7} | changes), model)
    within = 1e-14 if model == "rods" else 1e-13
    np.testing.assert_allclose(run.omega, run.scenario.omega0, rtol=1e-14)
    np.testing.assert_allclose(run.theta, run.scenario.theta0 + run.scenario.omega0 * run.t, rtol=within)
    assert np.ptp(run.omega) == np.ptp(run.r, axis=0).max() == 0.0
    np.testing.assert_allclose(run.r[0], run.scenario.initial_positions(), rtol=1e-13)


@pytest.mark.parametrize("model", ["column", "rods"])
def test_it_turns_backwards_alike_and_knows_no_restitution(model):
    forth = ode_reference.solve(throw(0.5, theta0=0.4, drag=0.01), model)
    back = ode_reference.solve(throw(0.5, theta0=-0.4, omega0=-20.0, drag=0.01, restitution=0.9), model)
    np.testing.assert_allclose(back.theta, -forth.theta, rtol=1e-13)
    np.testing.assert_allclose(back.r, forth.r, rtol=1e-13)
