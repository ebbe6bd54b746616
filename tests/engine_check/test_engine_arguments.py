"""What the public verbs refuse, and what they say."""

import math
from dataclasses import replace

import numpy as np
import pytest

from engine_check import DEFAULT_DT, ENGINES, PymunkKnobs, certify, solve
from engine_check.pymunk_settings import FIXED, enough_iterations
from slicemodel.scenario import Bottle, Scenario

THROW = replace(Scenario(), n_slices=2, duration=0.01)
MUJOCO = {"engine": "mujoco", "dt": 1e-4}
EXCLUDE = {"slices": "exclude", "dt": DEFAULT_DT}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"scenario": None}, r"scenario = None is not a slicemodel\.Scenario"),
        ({"engine": ["x"]}, r"engine = \['x'\] is unknown; known: pymunk"),
        ({"engine": "pymonk"}, r"engine = 'pymonk' is unknown; did you mean 'pymunk'\?"),
        ({"engine": "xyz"}, "known: pymunk"),
        ({"slices": "exclud"}, r"slices = 'exclud' is unknown; did you mean 'exclude'\?"),
        ({"ice": "weld"}, r"ice = 'weld' is unknown; did you mean 'welded'\?"),
        *(
            ({"dt": dt}, r"dt = .* s is outside \(1e-11, inf\) s")
            for dt in (0.0, -1e-4, math.nan, math.inf, 1e-12, 10**400)
        ),
        *(({"dt": dt}, r"dt = .* is not a number") for dt in ("1e-4", True)),
        *(
            ({"iterations": iterations}, r"iterations = .* is not a whole number in \[1, 1000000\]")
            for iterations in (0, -1, 1.5, math.nan, True, "10", 10**7)
        ),
        ({"dt": 1e-12, "times": [0.005]}, r"dt = 1e-12 s is outside \(5e-12, inf\) s"),
        ({"times": [0.0, 0.02]}, "outside"),
        ({"times": [0.005, 0.005]}, "increase"),
        ({"times": []}, "non-empty"),
        ({"times": [math.nan]}, "outside"),
        ({"eror_bias": 0.1}, r"knob = 'eror_bias' is unknown; did you mean 'error_bias'\?"),
        *(({"error_bias": wrong}, r"error_bias = .* is outside \[0, 1\]") for wrong in (-1.0, 1.5, math.nan)),
        ({"grid_offset": 0.6}, r"grid_offset = 0\.6 is outside \[0, 0\.5\]"),
        *(
            ({knob: "a"}, rf"{knob} = 'a' is not a number \(admissible: \[0, ")
            for knob in ("error_bias", "grid_offset")
        ),
        *(({"shuffle": wrong}, r"shuffle = .* is not a whole number in \[") for wrong in (1.5, True, "a", -1)),
        ({"slice_restitution": 0.3}, r"slice_restitution = 0\.3 has no effect where slices = 'overlap'"),
        *(
            (EXCLUDE | {"slice_restitution": wrong}, r"slice_restitution = .* is outside \[0, 1\]")
            for wrong in (-0.1, 1.1, math.nan)
        ),
        (MUJOCO | {"rest_fligth": 1.0}, r"knob = 'rest_fligth' is unknown; did you mean 'rest_flight'\?"),
        (MUJOCO | {"rest_flight": 0.0}, r"rest_flight = 0.0 is outside \(0, 1000\]"),
        (MUJOCO | {"rest_flight": math.nan}, r"rest_flight = nan is outside \(0, 1000\]"),
        (MUJOCO | {"rest_flight": "a"}, r"rest_flight = 'a' is not a number \(admissible: \(0, 1000\]\)"),
        (MUJOCO | {"iterations": 100}, "iterations = 100 has no meaning for engine = 'mujoco'"),
        (MUJOCO | {"slices": "exclude"}, "has no slices = 'exclude'"),
    ],
)
def test_an_argument_is_refused_by_name_value_and_range(arguments, words):
    with pytest.raises(ValueError, match=words):
        solve(**{"scenario": THROW} | arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        *(({"tolerance": wrong}, r"tolerance = .* \(0, 1\)") for wrong in (0.0, 1.0, -1e-3, math.nan, "1e-3", True)),
        ({"scenario": None}, r"scenario = None is not a slicemodel\.Scenario"),
        *(({"levels": wrong}, r"levels = .* is not a whole number in \[1, 20\]") for wrong in (0, 21, 1.5)),
    ],
)
def test_an_argument_of_a_certificate_is_refused_by_name_and_range(arguments, words):
    with pytest.raises(ValueError, match=words):
        certify(**{"scenario": THROW} | arguments)


@pytest.mark.parametrize(
    ("engine", "change", "words"),
    [
        ("pymunk", {"n_slices": 5001}, r"n_slices = 5001 is outside \[1, 5000\] for an engine"),
        ("mujoco", {"bottle": Bottle(mass=1e-15)}, r"bottle\.mass \[kg\] = 1e-15 is outside \(1e-15, inf\), the range"),
        ("mujoco", {"bottle": Bottle(radius=1e-9)}, r"bottle\.mass \* bottle\.radius\^2 \[kg m\^2\] = 2\.8e-20 is out"),
        ("mujoco", {"water_mass": 1e-15}, r"water_mass / n_slices \[kg\] = .* is outside \(1e-15, inf\)"),
        ("mujoco", {"bottle": Bottle(radius=1e9)}, r"bottle\.length / bottle\.radius = 2\.8e-10 is outside \(1e-06, i"),
    ],
)
def test_a_throw_that_an_engine_cannot_hold_is_refused_by_name(engine, change, words):
    with pytest.raises(ValueError, match=words):
        solve(replace(THROW, **change), engine=engine, dt=1e-4)


def test_welded_ice_is_refused_by_mujoco():
    with pytest.raises(ValueError, match=r"has no ice = 'welded' \(it has: rigid\)"):
        solve(replace(THROW, frozen=True), **MUJOCO, ice="welded")


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
