"""A run that explodes says so, when and why, and returns what was good."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import engine_check
from engine_check import DEFAULT_DT, pymunk_settings, watch
from engine_check.watch import BOUNDS, State
from slicemodel import observables
from slicemodel.scenario import Scenario

solve = partial(engine_check.solve, dt=DEFAULT_DT)
"""At a given step: how one is found is the subject of ``test_certificate``."""

FIFTY = Scenario().with_slices(50)


def test_ten_iterations_for_fifty_slices_diverge_with_time_and_cause():
    run = solve(FIFTY, iterations=10)
    assert run.status == "diverged"
    assert not run.ok
    assert run.message.startswith("diverged at t = 0.00")
    assert "omega mismatch" in run.message
    assert "raise iterations" in run.message
    assert 1 <= len(run.t) < 50
    assert np.max(np.abs(run.omega)) < 21


def test_an_explosion_is_seen_between_output_times():
    run = solve(FIFTY, iterations=10, times=[0.0, 0.5])
    assert run.status == "diverged"
    assert run.t.tolist() == [0.0]
    assert float(run.message.split("t = ")[1].split(" s")[0]) <= 0.011


def test_a_run_without_a_good_point_is_empty_and_says_why():
    run = solve(FIFTY, iterations=10, times=[0.5])
    assert run.status == "diverged"
    assert len(run.t) == 0
    assert run.r.shape == (0, 50)


def test_slow_failure_is_caught_although_angular_momentum_holds():
    """At 50 iterations the joints open: L is kept to 1e-12 while omega is wrong by the size of omega_0."""
    run = solve(FIFTY, iterations=50)
    assert run.status == "diverged"
    assert run.diagnostics["angular_momentum_drift"] < 1e-12
    assert run.diagnostics["omega_mismatch"] > BOUNDS["omega_mismatch"].limit


def test_creep_beyond_the_band_asks_for_a_smaller_step():
    fast = replace(Scenario(), water_mass=0.1, restitution=0.0, omega0=60.0).with_slices(5)
    run = solve(fast, dt=2e-4)
    assert run.status == "diverged"
    assert "penetration" in run.message
    assert run.message.endswith("reduce dt")


def rigid(scenario):
    """The exact state of a bottle in rigid rotation at t = 0.2 s."""
    t, omega = 0.2, scenario.omega0
    angle = scenario.theta0 + omega * t
    u = np.array([np.sin(angle), -np.cos(angle)])
    r = scenario.initial_positions()
    r_cm = float(observables.centre_of_mass(scenario, r))
    s = np.array([scenario.bottle.length / 2, *r]) - r_cm
    centre_v = np.array(scenario.launch_velocity) + np.array([0.0, -scenario.gravity * t])
    own = scenario.bottle.mass * (scenario.bottle.radius**2 / 2 + scenario.bottle.length**2 / 12)
    masses = np.array([scenario.bottle.mass, *[scenario.slice_mass] * scenario.n_slices])
    x, v = s[:, None] * u, centre_v + omega * s[:, None] * np.array([-u[1], u[0]])
    return State(t, angle, omega, x, v, masses, scenario.bottle.length / 2, own, t)


def residuals(state):
    return watch.measure(state, FIFTY, observables.initial_moment_of_inertia(FIFTY) * FIFTY.omega0)


def test_an_exact_state_has_no_residual():
    result = residuals(rigid(FIFTY))
    assert set(result) == set(BOUNDS)
    assert max(result.values()) < 1e-13
    assert watch.broken(result, 0.5) == ""


def moved(state, row, along, across):
    u = state.u_r
    x = state.x.copy()
    x[row] += along * u + across * np.array([-u[1], u[0]])
    return replace(state, x=x)


def kicked(state, row, amount):
    v = state.v.copy()
    v[row] += amount
    return replace(state, v=v)


@pytest.mark.parametrize(
    ("fault", "name"),
    [
        (lambda s: replace(s, omega=s.omega * 1.01), "omega_mismatch"),
        (lambda s: moved(s, 7, 0.0, 1e-3), "constraint_drift"),
        (lambda s: moved(s, 1, 5e-3, 0.0), "penetration"),
        (lambda s: kicked(s, 3, np.array([0.0, 0.1])), "linear_momentum_residual"),
        (lambda s: replace(s, omega=s.omega * 2.0), "angular_momentum_drift"),
        (lambda s: replace(s, omega=np.nan), "angular_momentum_drift"),
    ],
)
def test_each_fault_leaves_its_own_band(fault, name):
    result = residuals(fault(rigid(FIFTY)))
    assert not result[name] <= BOUNDS[name].limit
    assert watch.broken({**dict.fromkeys(BOUNDS, 0.0), name: result[name]}, 0.5).startswith(name.replace("_", " "))


def test_a_slice_past_the_middle_of_a_cap_has_tunnelled():
    result = residuals(moved(rigid(FIFTY), 1, 0.1, 0.0))
    assert "tunnelled" in watch.broken({**dict.fromkeys(BOUNDS, 0.0), "penetration": result["penetration"]}, 0.5)


def test_thin_caps_are_tunnelled_and_the_run_says_so(monkeypatch):
    """Why caps are thick: the engine has no swept test, and 3 m/s is 6 mm in a step of 2 ms."""
    monkeypatch.setattr(Scenario, "initial_positions", lambda _self: np.array([0.2, 0.18]))
    thin_slices = replace(Scenario(), n_slices=2, water_mass=0.005, drag=0.0, duration=0.2)
    times = np.linspace(0.0, 0.2, 21)
    assert "tunnelled" not in solve(thin_slices, dt=2e-3, times=times).message
    monkeypatch.setattr(pymunk_settings, "CAP_THICKNESS", 1e-3)
    run = solve(thin_slices, dt=2e-3, times=times)
    assert run.status == "diverged"
    assert "tunnelled" in run.message


def test_not_finite_is_a_cause():
    state = rigid(FIFTY)
    assert state.finite
    assert not replace(state, angle=np.inf).finite
    assert not kicked(state, 0, np.nan).finite
