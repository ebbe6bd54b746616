"""The contract of ``solve``: shapes, times, settings, statuses."""

from __future__ import annotations

import re

import numpy as np
import pytest

import ode_reference.witness
from ode_reference import METHODS, MODELS, solve
from slicemodel import observables
from slicemodel.scenario import Bottle, Scenario
from slicemodel.trajectory import Trajectory

SMALL = Scenario(n_slices=7, drag=0.7, duration=0.3)


@pytest.mark.parametrize("method", ["taylor", *METHODS])
@pytest.mark.parametrize("model", MODELS)
def test_every_model_and_method_returns_a_full_trajectory(model, method):
    flight = solve(SMALL, model, method=method)
    assert isinstance(flight, Trajectory)
    assert (flight.solver, flight.method, flight.status) == ("ode_reference", model, "ok")
    assert flight.scenario is SMALL
    assert flight.t.shape == flight.theta.shape == flight.omega.shape == (1000,)
    assert flight.r.shape == flight.v.shape == (1000, 7)
    assert (flight.t[0], flight.t[-1]) == (0.0, 0.3)
    assert flight.theta[0] == SMALL.theta0
    np.testing.assert_array_equal(flight.r[0], SMALL.initial_positions())
    np.testing.assert_array_equal(flight.v[0], 0.0)
    assert flight.omega[0] == pytest.approx(SMALL.omega0, rel=1e-15, abs=0.0)
    np.testing.assert_allclose(flight.r_cm, observables.centre_of_mass(SMALL, flight.r), rtol=1e-14)
    np.testing.assert_allclose(flight.inertia, observables.moment_of_inertia(SMALL, flight.r), rtol=1e-13)
    # theta is the integral of omega: by Simpson's rule, which the kinks of omega at impacts limit
    third = (flight.t[2] - flight.t[0]) / 6
    integral = third * (flight.omega[:-2:2] + 4 * flight.omega[1:-1:2] + flight.omega[2::2]).sum()
    assert flight.theta[998] - flight.theta[0] == pytest.approx(integral, abs=1e-5)
    assert flight.diagnostics["impacts"] == len(flight.impacts) > 0


def test_settings_repeat_the_run_bit_for_bit():
    first = solve(SMALL, "published-limit", method="DOP853", rtol=1e-8, rest_speed=1e-4)
    again = solve(SMALL, **first.settings)
    np.testing.assert_array_equal(first.r, again.r)
    np.testing.assert_array_equal(first.omega, again.omega)
    assert dict(first.settings) == dict(again.settings)
    assert first.settings["max_step"] == 1.0 / 20


@pytest.mark.parametrize("times", [[0.0], [0.3], [0.1], [0.0, 0.3], [1e-9, 0.123456, 0.3]])
def test_output_at_arbitrary_times_equals_the_full_run(times):
    dense = solve(SMALL, times=sorted({*times, *np.linspace(0, 0.3, 50)}))
    flight = solve(SMALL, times=times)
    np.testing.assert_array_equal(flight.t, times)
    pick = np.searchsorted(dense.t, times)
    np.testing.assert_array_equal(flight.r, dense.r[pick])


def test_state_at_the_time_of_an_impact_is_the_one_before_it():
    hit = next(iter(solve(SMALL).impacts))
    flight = solve(SMALL, times=[hit.time, hit.time + 1e-12])
    assert abs(flight.v[0, hit.slice]) == pytest.approx(hit.speed_before, rel=1e-12, abs=0.0)
    assert abs(flight.v[1, hit.slice]) == pytest.approx(hit.speed_after, rel=1e-6, abs=0.0)
    assert flight.v[0, hit.slice] * flight.v[1, hit.slice] < 0


def test_mirrored_spin_and_angle_give_the_mirrored_motion():
    scenario = Scenario(n_slices=7, drag=0.7, duration=0.3, omega0=-20.0, theta0=-SMALL.theta0)
    result, mirrored = solve(SMALL), solve(scenario)
    np.testing.assert_allclose(mirrored.r, result.r, rtol=0, atol=1e-14)
    np.testing.assert_allclose(mirrored.omega, -result.omega, rtol=1e-13)


@pytest.mark.parametrize("model", MODELS)
def test_a_slice_as_long_as_the_bottle_cannot_move(model):
    flight = solve(Scenario(n_slices=1, water_mass=1.0, drag=0.1), model)
    assert flight.ok
    assert np.ptp(flight.r) == 0.0
    assert np.ptp(flight.omega) == 0.0


@pytest.mark.parametrize("watch", [500, pytest.param(5000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("method", ["taylor", "DOP853"])
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    "scenario",
    [
        Scenario(n_slices=5, omega0=1e15),
        Scenario(n_slices=5, drag=1e15),
        Scenario(n_slices=5, gravity=1e15),
        Scenario(n_slices=5, bottle=Bottle(length=1e15)),
        Scenario(n_slices=5, omega0=1e-15),
        Scenario(n_slices=5, duration=1e-15),
    ],
    ids=["omega0", "drag", "gravity", "length", "slow", "short"],
)
def test_extreme_scenarios_end_with_a_status_and_finite_numbers(model, scenario, method, watch, monkeypatch):
    monkeypatch.setattr(ode_reference.witness, "WATCH", watch)
    times = np.linspace(0, 1, 5) * scenario.duration if scenario.duration > 1e-9 else None
    flight = solve(scenario, model, times, method=method)
    assert flight.status in ("ok", "overflow", "stalled")
    assert flight.ok or ("t = " in flight.message and model in flight.message)


@pytest.mark.parametrize("method", ["taylor", *METHODS])
def test_overflow_is_named_and_nothing_is_returned_beyond_it(method):
    scenario = Scenario(n_slices=5)
    object.__setattr__(scenario, "omega0", 1e160)  # no scenario admits it
    flight = solve(scenario, method=method)
    assert flight.status == "overflow"
    assert len(flight.t) == 0
    assert "omega0 = 1e+160 rad/s" in flight.message


def test_a_run_in_which_time_stops_passing_is_stalled(monkeypatch):
    monkeypatch.setattr(ode_reference.witness, "WATCH", 200)
    monkeypatch.setattr(ode_reference.witness, "MIN_ADVANCE", 0.1)
    flight = solve(SMALL, method="DOP853")
    assert flight.status == "stalled"
    assert re.search(r"time hardly passes after \d+ evaluations at t = 0\.\d+ s", flight.message)
    assert "slices of the last impacts: " in flight.message
    assert 0 < len(flight.t) < 1000
    assert flight.t[-1] < 0.3
