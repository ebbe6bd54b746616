"""What the public verbs take, and what they say of it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from engine_check import DEFAULT_DT, ENGINES, PymunkKnobs, solve
from engine_check.pymunk_settings import FIXED, enough_iterations
from slicemodel.scenario import Scenario

THROW = replace(Scenario(), n_slices=2, duration=0.01)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("change", [{"omega0": 1e-9}, {"launch_velocity": (1e9, 0.0)}])
def test_a_launch_in_whose_round_off_the_spin_is_lost_is_refused(engine, change):
    with pytest.raises(ValueError, match=r"launch_velocity = .* m/s is outside \[0, .*\] m/s, 5000 \|omega0\| L"):
        solve(replace(THROW, **change), engine=engine, dt=1e-3)
    slow = replace(THROW, omega0=math.hypot(*THROW.launch_velocity) / THROW.bottle.length / 4999.0)
    assert solve(slow, engine=engine, dt=1e-3).ok


def test_dt_may_exceed_the_flight():
    short = solve(replace(THROW, duration=5e-5), times=[0.0, 5e-5], dt=DEFAULT_DT)
    assert short.ok
    assert short.settings["step"] == pytest.approx(5e-5)


def test_iterations_of_numpy_are_stated_as_a_plain_number():
    settings = solve(THROW, dt=DEFAULT_DT, iterations=np.int64(30)).settings
    assert type(settings["iterations"]) is int
    assert settings["iterations"] == 30


def test_iterations_grow_with_mass_ratio_and_slices_and_are_stated():
    assert enough_iterations(Scenario().with_slices(50)) == 127
    assert enough_iterations(replace(Scenario(), water_mass=1.0).with_slices(50)) == 253
    assert solve(THROW, dt=DEFAULT_DT).settings["iterations"] == enough_iterations(THROW) == 50


def test_settings_hold_what_is_fixed_every_knob_and_the_versions():
    settings = solve(THROW, dt=DEFAULT_DT, error_bias=1e-6).settings
    assert {*FIXED, *PymunkKnobs().to_mapping()} <= set(settings)
    assert settings["error_bias"] == 1e-6
    assert settings["pymunk_version"].startswith("7.")
    assert settings["chipmunk_version"]
    assert settings["reads"] == "batch"
