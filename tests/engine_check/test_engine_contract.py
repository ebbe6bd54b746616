"""What every engine of the register owes: the equation it names, its symmetries, ice that keeps turning, its set-up."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from engine_worlds import THROW

import engine_check
import ode_reference
from engine_check import ENGINES
from slicemodel import Scenario, observables


def throw(slices, filling, damping, omega0, duration):
    cut = Scenario(water_mass=filling, omega0=omega0, duration=duration).with_slices(slices)
    return replace(cut, drag=damping * cut.slice_mass)


THROWS = {
    "37 impacts on both ends": throw(6, 0.5, 3.0, 20.0, 0.4),
    "slices that rest and are let go": throw(3, 0.7, 1.0, 6.0, 1.5),
}


def away(one, other):
    return np.max(np.abs(one.omega - other.omega)) / one.scenario.omega0


@pytest.mark.parametrize("name", THROWS)
@pytest.mark.parametrize("engine", ENGINES)
def test_an_engine_solves_the_equation_that_it_names(engine, name):
    """An answer at the next step of 0.1 ms is off by 2e-4 of omega_0, restitution a fifth too low by 8e-3 or more."""
    case, times = THROWS[name], np.linspace(0.0, THROWS[name].duration, 41)
    truth = ode_reference.solve(case, ENGINES[engine].model, times)
    run = engine_check.solve(case, engine=engine, times=times, dt=1e-4)
    assert run.ok, run.message
    assert away(run, truth) < 2e-3
    other = ode_reference.solve(replace(case, restitution=0.8 * case.restitution), ENGINES[engine].model, times)
    assert away(truth, other) > 6e-3


ROOT = Path(__file__).resolve().parents[2]
TEN = replace(Scenario().with_slices(10), duration=0.2)
ELASTIC = replace(Scenario().with_slices(5), restitution=1.0, drag=0.0)
"""Two throws with a hundred impacts of which no last digit decides the order."""


@pytest.fixture(params=ENGINES)
def fly(request):
    """Return how an engine flies a throw at a given step: how one is found is the subject of ``test_certificate``."""

    def flown(scenario, times=None, dt=1e-4):
        run = engine_check.solve(scenario, engine=request.param, times=times, dt=dt)
        assert run.ok, run.message
        assert (run.solver, run.method) == ("engine_check", request.param)
        return run

    return flown


@pytest.mark.parametrize("scenario", [TEN, ELASTIC], ids=["usual", "elastic"])
def test_gravity_and_launch_do_not_touch_omega(fly, scenario):
    """1e-9 is what round-off may become through the rebounds (measured 3e-12)."""
    plain = fly(scenario)
    for change in ({"gravity": 0.0}, {"launch_velocity": (-3.0, 0.2), "gravity": 1.6}):
        assert np.max(np.abs(fly(replace(scenario, **change)).omega / plain.omega - 1.0)) < 1e-9


@pytest.mark.parametrize("scenario", [TEN, ELASTIC], ids=["usual", "elastic"])
def test_the_mirror_throw_is_the_mirror_image(fly, scenario):
    run, mirror = fly(scenario), fly(replace(scenario, omega0=-scenario.omega0, theta0=-scenario.theta0))
    np.testing.assert_allclose(mirror.omega, -run.omega, rtol=1e-9)
    np.testing.assert_allclose(mirror.theta, -run.theta, rtol=1e-9)
    np.testing.assert_allclose(mirror.r, run.r, rtol=1e-9)


@pytest.mark.arithmetic
def test_its_bulk_quantities_are_those_of_the_shared_definitions(fly):
    run = fly(TEN)
    within = 1e-9 if run.method == "pymunk" else 1e-12
    np.testing.assert_allclose(run.r_cm, observables.centre_of_mass(TEN, run.r), rtol=within)
    np.testing.assert_allclose(run.inertia, observables.moment_of_inertia(TEN, run.r), rtol=within)


def test_it_starts_as_the_scenario_says(fly):
    run = fly(THROW)
    assert (run.t[0], run.theta[0], run.omega[0]) == (0.0, THROW.theta0, THROW.omega0)
    np.testing.assert_allclose(run.r[0], THROW.initial_positions(), atol=1e-15)
    np.testing.assert_allclose(run.v[0], 0.0, atol=1e-14)


def test_output_times_need_not_start_at_release(fly):
    late, full = fly(TEN, [0.05, 0.1]), fly(TEN, [0.0, 0.05, 0.1])
    assert late.t.tolist() == [0.05, 0.1]
    assert np.array_equal(late.omega, full.omega[1:])


def test_only_the_release_takes_no_step_and_returns_the_read_back(fly):
    run = fly(THROW, [0.0])
    assert run.omega.tolist() == [THROW.omega0]
    assert run.diagnostics["steps"] == 0
    assert run.diagnostics["setup"]["drag.least"] == 0.23


def test_a_run_is_reproducible_to_the_last_bit(fly):
    first, second = fly(TEN), fly(TEN)
    for name in ("theta", "omega", "r", "v", "r_cm", "inertia"):
        assert np.array_equal(getattr(first, name), getattr(second, name))
    if first.impacts is not None:
        assert np.array_equal(first.impacts.time, second.impacts.time)
    code = (
        "from dataclasses import replace; from engine_check import solve; from slicemodel.scenario import Scenario;"
        f"run = solve(replace(Scenario().with_slices(10), duration=0.2), engine={first.method!r}, dt=1e-4);"
        "print(run.omega[-1].hex())"
    )
    other = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True)
    assert other.stdout.strip() == first.omega[-1].hex()


def test_ice_turns_uniformly_to_round_off(fly):
    ice = replace(Scenario().with_slices(50), frozen=True)
    run = fly(ice)
    assert np.max(np.abs(run.omega / ice.omega0 - 1.0)) <= 1e-12
    assert run.diagnostics["ice_omega_drift"] <= 1e-12
    np.testing.assert_allclose(run.theta, ice.theta0 + ice.omega0 * run.t, rtol=1e-11)
    np.testing.assert_allclose(run.inertia, run.inertia[0], rtol=1e-14)
    assert np.all(run.r == ice.initial_positions())
    assert np.all(run.v == 0.0)
    assert run.impacts is None or len(run.impacts) == 0
