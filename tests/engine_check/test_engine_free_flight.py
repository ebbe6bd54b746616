"""Before any rebound the engine must converge to free flight, integrated here and nowhere else.

A tube (mass M_b) and N slices (m) turn about their common centre with angular momentum L. In the frame of
the centre of mass there is no gravity, and no axial torque. With the resting slices joined to the tube as
one body of mass M_c, centre r_c:

    r_i'' = omega^2 (r_i - r_c) - (alpha/m) r_i' - (alpha/M_c) sum_j r_j',    omega = L / J(r)

Observed orders are bounded on both sides.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import engine_check
from engine_check import DEFAULT_DT
from slicemodel.scenario import Scenario

solve = partial(engine_check.solve, dt=DEFAULT_DT)
"""At a given step: how one is found is the subject of ``test_certificate``."""

STEPS = (4e-4, 2e-4, 1e-4, 5e-5)
PAIR = replace(Scenario(), n_slices=2, drag=0.0, duration=0.06)


def free_flight(scenario, free, resting, times):
    """Return theta, omega, r and r' of the free slices at ``times``."""
    bottle, m = scenario.bottle, scenario.slice_mass
    resting = np.asarray(resting, dtype=float)
    body_mass = bottle.mass + m * len(resting)
    body_centre = (bottle.mass * bottle.length / 2 + m * resting.sum()) / body_mass
    own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    n = len(free)

    def inertia(r):
        places = np.array([bottle.length / 2, *resting, *r])
        masses = np.array([bottle.mass, *[m] * (len(resting) + n)])
        centre = masses @ places / masses.sum()
        return own + masses @ (places - centre) ** 2

    momentum = inertia(free) * scenario.omega0

    def slope(_, y):
        r, v = y[:n], y[n : 2 * n]
        omega = momentum / inertia(r)
        push = omega**2 * (r - body_centre) - scenario.drag * (v / m + v.sum() / body_mass)
        return np.array([*v, *push, omega])

    start = np.array([*free, *np.zeros(n), scenario.theta0])
    run = solve_ivp(slope, (0.0, times[-1]), start, t_eval=times, rtol=1e-12, atol=1e-14, method="DOP853")
    assert run.success
    r = run.y[:n].T
    omega = np.array([momentum / inertia(row) for row in r])
    return {"theta": run.y[-1], "omega": omega, "r": r, "v": run.y[n : 2 * n].T}


def errors(runs, reference, slices):
    results = {}
    for name, exact in reference.items():
        values = [getattr(run, name) for run in runs]
        if name in "rv":
            values = [value[:, slices] for value in values]
        results[name] = np.array([np.max(np.abs(value - exact)) for value in values])
    return results


def assert_order(error, order, within):
    observed = np.log2(error[:-1] / error[1:])
    assert np.all(np.abs(observed - order) < within), (error, observed)


@pytest.fixture
def afloat(monkeypatch):
    """Three slices in mid-tube, touching no end: nothing but joints and, if asked for, drag."""
    monkeypatch.setattr(Scenario, "initial_positions", lambda _self: np.array([0.19, 0.16, 0.11]))
    return replace(Scenario(), n_slices=3, drag=0.0, duration=0.04)


# Every interval is a whole number of every step, so that halving dt halves the step.
TIMES = np.linspace(0.0, 0.04, 11)


def test_three_free_slices_at_order_two(afloat):
    """Proves the half-step start and the centring of omega and r' in time."""
    reference = free_flight(afloat, afloat.initial_positions(), [], TIMES)
    runs = [solve(afloat, dt=dt, times=TIMES) for dt in STEPS]
    assert all(run.ok for run in runs)
    for name, error in errors(runs, reference, slice(None)).items():
        assert_order(error, 2, 0.1)
        assert error[-1] < {"theta": 1e-6, "omega": 1e-5, "r": 1e-7, "v": 1e-5}[name]


def test_three_free_slices_with_drag_at_order_one(afloat):
    sticky = replace(afloat, drag=1.5)
    reference = free_flight(sticky, sticky.initial_positions(), [], TIMES)
    runs = [solve(sticky, dt=dt, times=TIMES) for dt in STEPS]
    for error in errors(runs, reference, slice(None)).values():
        assert_order(error, 1, 0.15)


@pytest.mark.parametrize(
    ("restitution", "drag", "order", "within"),
    [(1.0, 0.0, 2, 0.1), (0.5, 0.0, 1, 0.15), (0.5, 2.5, 1, 0.15)],
)
def test_a_pair_with_one_slice_resting_on_the_base(restitution, drag, order, within):
    """Order 2 only if e = 1: below that the resting slice creeps into the base at order 1."""
    scenario = replace(PAIR, restitution=restitution, drag=drag)
    times = np.linspace(0.0, 0.06, 16)
    resting, free = scenario.initial_positions()
    reference = free_flight(scenario, [free], [resting], times)
    runs = [solve(scenario, dt=dt, times=times) for dt in STEPS]
    result = errors(runs, reference, slice(1, 2))
    for name in ("theta", "omega"):
        assert_order(result[name], order, within)
    assert result["omega"][-1] < (1e-5 if order == 2 else 1e-2)


def test_the_centre_of_mass_flies_a_parabola(afloat):
    """Velocities start half a step ahead; without it p would be off by M g dt/2."""
    run = solve(afloat, times=TIMES)
    assert run.diagnostics["linear_momentum_residual"] < 1e-12
    assert run.diagnostics["angular_momentum_drift"] < 1e-12


# ---------------------------------------------------------------------- welded ice: how far it drifts

ICE = replace(Scenario().with_slices(50), frozen=True)


def test_welded_ice_stays_within_its_printed_drift_at_the_default_step():
    run = solve(ICE, ice="welded", times=np.linspace(0.0, 0.5, 101))
    assert run.ok
    assert run.settings["ice"] == "welded"
    # Measured 2.8e-6 at dt = 1e-4 s; the band is its order of magnitude.
    assert 1e-7 < run.diagnostics["ice_omega_drift"] < 1e-5
    assert run.diagnostics["ice_omega_drift"] == pytest.approx(np.max(np.abs(run.omega / ICE.omega0 - 1.0)))
    assert run.diagnostics["constraint_drift"] < 1e-8


def test_the_drift_of_welded_ice_falls_at_its_printed_order():
    ice = replace(ICE.with_slices(10), duration=0.2)
    steps = (4e-4, 2e-4, 1e-4, 5e-5)
    runs = [solve(ice, ice="welded", dt=dt, times=np.linspace(0.0, 0.2, 51)) for dt in steps]
    for name in ("ice_omega_drift", "ice_slice_drift"):
        drift = np.array([run.diagnostics[name] for run in runs])
        orders = np.log2(drift[:-1] / drift[1:])
        printed = runs[0].diagnostics["weld_order"]
        assert np.all(np.abs(orders - printed) < 0.1), (name, drift, orders)


def test_joint_correction_at_its_default_costs_an_order():
    """Why error_bias is 0: with the engine's default the weld opens a hundred times wider."""
    ice = replace(ICE.with_slices(10), duration=0.1)
    ours, default = (
        solve(ice, ice="welded", times=[0.0, 0.1], **knobs).diagnostics["ice_slice_drift"]
        for knobs in ({}, {"error_bias": 0.9**60})
    )
    assert default > 100 * ours
