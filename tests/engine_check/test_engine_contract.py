"""What every engine of the register owes: ice that keeps turning, and the equation it names, with rests on the ends."""

from dataclasses import replace

import numpy as np
import pytest

import engine_check
import ode_reference
from engine_check import ENGINES
from slicemodel import Scenario


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


@pytest.mark.parametrize("engine", ENGINES)
def test_ice_keeps_its_angular_velocity_in_every_engine(engine):
    ice = replace(THROWS["37 impacts on both ends"], frozen=True)
    run = engine_check.solve(ice, engine=engine, times=np.linspace(0.0, ice.duration, 11), dt=1e-4)
    assert run.ok, run.message
    assert np.max(np.abs(run.omega / ice.omega0 - 1.0)) < 1e-6
