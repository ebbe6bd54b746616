"""What may be thrown, what may not, and what the refusal says."""

import dataclasses
import math
import os
import pickle
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from slicemodel import Bottle, Scenario, ScenarioError
from slicemodel.scenario import not_whole, shortened

ROOT = Path(__file__).resolve().parents[2]


def test_defaults_are_the_papers_own_throw():
    scenario = Scenario()
    assert dataclasses.asdict(scenario.bottle) == {"length": 0.28, "radius": 0.04, "mass": 0.028, "capacity": 1.0}
    assert (scenario.water_mass, scenario.n_slices, scenario.drag, scenario.restitution) == (0.5, 500, 0.01, 0.5)
    assert (scenario.omega0, scenario.theta0, scenario.duration, scenario.gravity) == (20.0, math.pi / 2, 0.5, 9.81)
    assert scenario.frozen is False
    assert math.hypot(*scenario.launch_velocity) == pytest.approx(2.0, abs=0.01)


def test_is_frozen_and_keyword_only():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Scenario().drag = 1.0
    with pytest.raises(TypeError):
        Scenario(Bottle())
    with pytest.raises(TypeError):
        Bottle(0.28)


ABSURD = (5e-324, 1e-300, 1e-16, 1e16, 1e200, 1e308, math.inf)
NUMBERS = [field.name for field in dataclasses.fields(Scenario) if isinstance(field.default, float)]
LENGTHS = [field.name for field in dataclasses.fields(Bottle)]


@pytest.mark.parametrize("value", [*ABSURD, *(-value for value in ABSURD), math.nan])
def test_absurd_numbers_are_refused_by_name_or_harmless(value):
    """What is not refused is a small number beside zero, where zero is allowed, too."""
    for name in LENGTHS:
        with pytest.raises(
            ScenarioError, match=rf"^bottle\.{name} = {re.escape(repr(value))} k?[mg] is outside \[1e-15, 1e\+15\]$"
        ):
            Bottle(**{name: value})
    for name in NUMBERS:
        allowed = abs(value) < 1e-15 and (
            name == "theta0" or (value > 0 and name in ("drag", "gravity", "restitution"))
        )
        if allowed:
            Scenario(**{name: value})
        else:
            with pytest.raises(ScenarioError, match=rf"^{name} = {re.escape(repr(value))} .*\[.*\]"):
                Scenario(**{name: value})


def test_a_launch_velocity_may_come_from_a_generator():
    assert Scenario(launch_velocity=(part for part in (1, 2))).launch_velocity == (1.0, 2.0)


def test_all_problems_are_told_at_once():
    with pytest.raises(ScenarioError) as refusal:
        Scenario(water_mass=math.nan, n_slices=0, restitution=7)
    assert all(name in str(refusal.value) for name in ("water_mass", "n_slices", "restitution"))
    assert "\n" not in str(refusal.value)


def test_other_spin_and_no_gravity_are_possible():
    assert Scenario(omega0=-20.0, gravity=0.0, drag=0.0, restitution=0.0, n_slices=1).omega0 == -20.0


def test_geometry():
    scenario = Scenario(n_slices=100)
    r = scenario.initial_positions()
    assert r.shape == (100,)
    assert r[0] == scenario.r_max == 0.28 - 0.14 / 200
    assert r[-1] == pytest.approx(0.14 + 0.14 / 200, rel=1e-14, abs=0.0)
    assert scenario.r_min == pytest.approx(0.14 / 200, rel=1e-14, abs=0.0)
    assert scenario.damping_rate == pytest.approx(0.01 / (2 * 0.005))
    np.testing.assert_allclose(np.diff(r), -scenario.slice_height, rtol=1e-12)


def test_with_slices_keeps_the_damping_rate():
    scenario = Scenario().with_slices(50)
    assert scenario.n_slices == 50
    assert scenario.damping_rate == pytest.approx(5.0, rel=1e-14, abs=0.0)
    assert scenario.water_mass == 0.5
    with pytest.raises(ScenarioError, match="n_slices = 0"):
        Scenario().with_slices(0)


def test_toml_and_pickle_round_trip(tmp_path):
    scenario = Scenario(bottle=Bottle(length=0.22), theta0=1.1, launch_velocity=(1, 2), frozen=True)
    file = tmp_path / "throw.toml"
    file.write_text(scenario.to_toml(), encoding="utf-8")
    assert Scenario.from_toml(file) == pickle.loads(pickle.dumps(scenario)) == scenario


def test_the_byte_order_mark_of_a_text_editor_is_read_over(tmp_path):
    (tmp_path / "throw.toml").write_text("[scenario]\ndrag = 0.25\n", encoding="utf-8-sig")
    assert Scenario.from_toml(tmp_path / "throw.toml").drag == 0.25


def test_empty_file_is_the_default_throw(tmp_path):
    (tmp_path / "empty.toml").touch()
    assert Scenario.from_toml(str(tmp_path / "empty.toml")) == Scenario()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[scenario]\nwater_mas = 1", ["[scenario] key 'water_mas'", "did you mean 'water_mass'?"]),
        ("[bottle]\nlenght = 1", ["[bottle] key 'lenght'", "did you mean 'length'?"]),
        ("[botle]\nlength = 1", ["table 'botle'", "did you mean 'bottle'?"]),
        ("[engine]\nx = 1", ["table 'engine'", "known: scenario, bottle"]),
        ("water_mass = 0.3", ["key 'water_mass' stands outside of a table", "such as [scenario]"]),
        ("scenario = 3", ["scenario = 3 is not a table"]),
        ("[bottle]\nradius = -1", ["[bottle] radius = -1.0 m"]),
        ("[scenario]\nrestitution = 2", ["[scenario] restitution = 2.0", "[0, 1]"]),
        ("[scenario]\nduration = nan", ["[scenario] duration = nan s"]),
        ("[scenario\n", ["not valid TOML"]),
        ("x = " + "[" * 5000, ["nested too deeply"]),
        ("[scenario]\nn_slices = " + "9" * 5000, ["not valid TOML"]),
        ("[scenario]\ndrag = '" + "9" * 200_000 + "'", ["[scenario] drag = '999", " ... 999", "is not a number"]),
        ("[scenario]\n" + "x" * 200_000 + " = 1", ["[scenario] key 'xxx", " ... xxx"]),
        ("x = [" + "1," * 60_000 + "]", ["key 'x'"]),
        ("# " + "x" * 300_000, ["is larger than 256 KiB"]),
    ],
)
def test_toml_errors_name_file_table_and_key(tmp_path, text, words):
    file = tmp_path / "throw.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError) as refusal:
        Scenario.from_toml(file)
    for word in [str(file), *words]:
        assert word in str(refusal.value)
    assert len(str(refusal.value)) < len(str(file)) + 300


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ScenarioError, match=r"nowhere\.toml: cannot be read"):
        Scenario.from_toml(tmp_path / "nowhere.toml")
    with pytest.raises(ScenarioError, match="cannot be read"):
        Scenario.from_toml(tmp_path)


@pytest.mark.parametrize("place", ["/dev/zero", "/dev/full", "pipe"])
def test_a_device_or_a_pipe_is_refused_at_once(tmp_path, place):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ScenarioError, match="is a device, a pipe or a socket, not a file"):
        Scenario.from_toml(tmp_path / place)


def test_what_a_shell_feeds_is_read():
    code = "from slicemodel import Scenario; print(Scenario.from_toml('/dev/stdin').drag)"
    told = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, input=b"[scenario]\ndrag = 0.25\n", capture_output=True, check=True
    )
    assert told.stdout == b"0.25\n"


@pytest.mark.parametrize("theta0", [85, 85.0, -360.0])
def test_an_angle_at_release_in_degrees_is_asked_about(tmp_path, theta0):
    file = tmp_path / "throw.toml"
    file.write_text(f"[scenario]\ntheta0 = {theta0!r}\n", encoding="utf-8")
    asked = f"theta0 = {float(theta0)!r} rad is outside.*radians.*are {math.radians(theta0):.6g} rad"
    for make in (lambda: Scenario.from_toml(file), lambda: Scenario(theta0=theta0)):
        with pytest.raises(ScenarioError, match=asked):
            make()


@pytest.mark.parametrize("theta0", [7.0, -4 * math.pi])
def test_two_turns_are_an_angle_at_release(theta0):
    assert Scenario(theta0=theta0).theta0 == theta0


@pytest.mark.parametrize("theta0", [10**400, "85", True, math.nan])
def test_what_is_no_angle_is_not_asked_about_degrees(theta0):
    with pytest.raises(ScenarioError, match="theta0") as refused:
        Scenario(theta0=theta0)
    assert "degrees" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "most", "short"),
    [
        ("one two three", 13, "one two three"),
        ("one two three", 12, "one two ..."),
        ("one two three", 8, "one ..."),
        ("one\n  two\tthree", 99, "one two three"),
        ("well-known words", 15, "well-known ..."),
        ("x" * 99, 10, "xxxxxxx..."),
        ("one " + "x" * 99, 10, "one ..."),
    ],
)
def test_a_text_is_cut_between_words(text, most, short):
    assert shortened(text, most) == short
    assert len(shortened(text, most)) <= most


@pytest.mark.parametrize(
    ("value", "good"), [(1, False), (2, True), (9, True), (10, False), (2.0, False), (True, False)]
)
def test_the_ends_of_a_range_of_whole_numbers_belong_to_it(value, good):
    words = not_whole("points", value, 2, 9)
    assert words == ("" if good else f"points = {value} is not a whole number in [2, 9]")
