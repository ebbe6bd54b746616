"""What the public verb refuses, and what it says."""

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import engine_check
from engine_check import DEFAULT_DT, ENGINES, PymunkKnobs, solve
from engine_check.pymunk_settings import enough_iterations
from slicemodel.scenario import Scenario

ROOT = Path(__file__).resolve().parents[2]
THROW = replace(Scenario(), n_slices=2, duration=0.01)


def test_an_unknown_engine_is_named_with_the_nearest():
    with pytest.raises(ValueError, match=r"engine = 'pymonk' is unknown; did you mean 'pymunk'\?"):
        solve(THROW, engine="pymonk")


def test_an_engine_unlike_any_lists_all():
    with pytest.raises(ValueError, match="known: pymunk"):
        solve(THROW, engine="xyz")


def test_an_unknown_world_is_named_with_the_nearest():
    with pytest.raises(ValueError, match=r"slices = 'exclud' is unknown; did you mean 'exclude'\?"):
        solve(THROW, slices="exclud")


def test_dt_is_an_upper_bound_and_may_exceed_the_flight():
    short = solve(replace(THROW, duration=5e-5), times=[0.0, 5e-5], dt=DEFAULT_DT)
    assert short.status == "ok"
    assert short.settings["step"] == pytest.approx(5e-5)


def test_more_slices_than_an_engine_can_hold_are_refused():
    with pytest.raises(ValueError, match=r"n_slices = 5001 is outside \[1, 5000\] for an engine"):
        solve(replace(THROW, n_slices=5001))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("change", [{"omega0": 1e-9}, {"launch_velocity": (1e9, 0.0)}])
def test_a_launch_in_whose_round_off_the_spin_is_lost_is_refused(engine, change):
    with pytest.raises(ValueError, match=r"launch_velocity = .* m/s is outside \[0, .*\] m/s, 5000 \|omega0\| L"):
        solve(replace(THROW, **change), engine=engine, dt=1e-3)
    slow = replace(THROW, omega0=math.hypot(*THROW.launch_velocity) / THROW.bottle.length / 4999.0)
    assert solve(slow, engine=engine, dt=1e-3).ok


@pytest.mark.parametrize("dt", [0.0, -1e-4, math.nan, math.inf])
def test_dt_out_of_range_is_named_with_the_range(dt):
    with pytest.raises(ValueError, match=r"dt = .* s is outside \(0, inf\) s"):
        solve(THROW, dt=dt)


@pytest.mark.parametrize("dt", ["1e-4", True])
def test_dt_must_be_a_number(dt):
    with pytest.raises(ValueError, match=r"dt = .* is not a number"):
        solve(THROW, dt=dt)


@pytest.mark.parametrize("iterations", [0, -1, 1.5, math.nan, True, "10", 10**7])
def test_iterations_out_of_range_are_named_with_the_range(iterations):
    with pytest.raises(ValueError, match=r"iterations = .* is not a whole number in \[1, 1000000\]"):
        solve(THROW, iterations=iterations)


@pytest.mark.parametrize(
    ("times", "words"),
    [([0.0, 0.02], "outside"), ([0.005, 0.005], "increase"), ([], "non-empty"), ([math.nan], "outside")],
)
def test_times_are_checked(times, words):
    with pytest.raises(ValueError, match=words):
        solve(THROW, times=times)


def test_an_unknown_ice_model_is_named_with_the_nearest():
    with pytest.raises(ValueError, match=r"ice = 'weld' is unknown; did you mean 'welded'\?"):
        solve(THROW, ice="weld")


def test_an_unknown_knob_is_named_with_the_nearest():
    with pytest.raises(ValueError, match=r"knob = 'colision_slop' is unknown; did you mean 'collision_slop'\?"):
        solve(THROW, colision_slop=0.1)


@pytest.mark.parametrize(
    ("knob", "value"), [("collision_bias", 1.5), ("collision_slop", -1.0), ("error_bias", math.nan), ("damping", 2.0)]
)
def test_a_knob_out_of_range_is_named_with_the_range(knob, value):
    with pytest.raises(ValueError, match=rf"{knob} = .* is outside \[0"):
        solve(THROW, **{knob: value})


def test_iterations_grow_with_mass_ratio_and_slices_and_are_stated():
    assert enough_iterations(Scenario().with_slices(50)) == 127
    assert enough_iterations(replace(Scenario(), water_mass=1.0).with_slices(50)) == 253
    assert enough_iterations(replace(Scenario(), n_slices=2)) == 50
    assert solve(THROW, dt=DEFAULT_DT).settings["iterations"] == 50
    assert solve(THROW, iterations=60).settings["iterations"] == 60


def test_settings_hold_every_knob_and_the_versions():
    settings = solve(THROW, dt=DEFAULT_DT, collision_slop=1e-6).settings
    assert set(PymunkKnobs().to_mapping()) <= set(settings)
    assert settings["collision_slop"] == 1e-6
    assert settings["pymunk_version"].startswith("7.")
    assert settings["chipmunk_version"]
    assert settings["reads"] == "batch"


def test_the_defaults_are_those_whose_reasons_are_written_down():
    assert PymunkKnobs().to_mapping() == {
        "collision_bias": 1.0,
        "collision_slop": 0.0,
        "collision_persistence": 1,
        "error_bias": 0.0,
        "damping": 1.0,
        "friction": 0.0,
        "cap_thickness": 0.5,
        "groove_reach": 1.0,
        "anchor_distance": 10.0,
        "slice_restitution": None,
        "shuffle": 0,
        "grid_offset": 0.0,
    }


def test_importing_the_package_loads_no_engine():
    code = "import sys, engine_check; sys.exit(any(name in sys.modules for name in ('pymunk', 'numpy')))"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0
    code = "import sys; from engine_check import solve, PymunkKnobs; sys.exit('pymunk' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


def test_an_unknown_export_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'resolve'"):
        _ = engine_check.resolve


def test_every_registered_engine_runs():
    for engine in ENGINES:
        assert np.all(np.isfinite(solve(THROW, engine=engine, dt=DEFAULT_DT).omega))
