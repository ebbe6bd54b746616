"""The example exports, and ``export``."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
from made_up import action as run

import ode_reference
from flipproof.film.clip import read_film
from flipproof.film.tracker.reader import read_track_table
from slicemodel import Scenario

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "tracker"
TRACKED = sorted(path.name for path in EXAMPLES.iterdir() if path.suffix in (".txt", ".csv"))


@pytest.fixture(scope="module")
def make():
    spec = importlib.util.spec_from_file_location("tracker_examples", EXAMPLES / "make.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def made(make):
    return make.files()


def test_examples_are_what_the_code_prints(made, tmp_path):
    """Text and every position but the last printed digit, which another processor may round otherwise.

    Thirty-three slices in free flight amplify a rounding error.
    """
    assert sorted(made) == TRACKED
    for name, content in made.items():
        stored = EXAMPLES / name
        fresh = tmp_path / name
        fresh.write_bytes(content)
        one, other = read_track_table(stored), read_track_table(fresh)
        assert one.dialects == other.dialects
        assert one.t == pytest.approx(other.t, abs=1e-9)
        assert list(one.tracks) == list(other.tracks)
        for track in one.tracks:
            for column, values in one.tracks[track].columns.items():
                if column.startswith("v"):
                    continue
                assert values == pytest.approx(other.tracks[track].columns[column], rel=2e-3, abs=2e-5, nan_ok=True), (
                    name
                )
        assert stored.read_bytes()[:40] == content[:40]


def test_velocities_of_an_example_are_differences_of_its_positions():
    """To the last printed digit of the positions, 1e-4 m, over the time between neighbours."""
    table, between = read_track_table(EXAMPLES / "older_headings.txt"), 2 / 240
    for track in table.tracks.values():
        for axis in "xy":
            slopes = (track.columns[axis][2:] - track.columns[axis][:-2]) / between
            there = np.isfinite(slopes)
            assert there.sum() > 100
            assert np.all(np.abs(track.columns[f"v{axis}"][1:-1] - slopes)[there] < 1.2e-4 / between)
            assert np.any(np.abs(slopes[there]) > 1.0)


def test_examples_say_that_they_are_synthetic():
    words = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    assert "synthetic" in words
    for name in TRACKED:
        assert f"`{name}`" in words


@pytest.mark.parametrize("name", [name for name in TRACKED if not name.startswith(("single", "data", "ice"))])
def test_every_dialect_holds_the_same_points(name):
    one, throw = (read_film([EXAMPLES / n], cap="cap", base="base", length_unit="m") for n in (name, "tab.txt"))
    assert one.t == pytest.approx(throw.t, abs=1e-4)
    assert one.values == pytest.approx(throw.values, abs=1e-4, nan_ok=True)


def test_two_files_of_one_clip():
    paths = [EXAMPLES / "single_cap.txt", EXAMPLES / "single_base.txt"]
    one, whole = (read_film(p, cap="cap", base="base", length_unit="m") for p in (paths, [EXAMPLES / "tab.txt"]))
    assert one.values == pytest.approx(whole.values, abs=1e-4, nan_ok=True)


def exported(tmp_path, *arguments):
    path = tmp_path / "flight.txt"
    throw = tmp_path / "throw.toml"
    throw.write_text(Scenario(water_mass=0.33, n_slices=20, drag=0.0165).to_toml(), encoding="utf-8")
    assert run("export", throw, "--solver", "exact-step", "--format", "tracker", "--out", path, *arguments) == 0
    return path


def test_export_lays_cap_base_and_centre_over_the_video(tmp_path):
    path = exported(tmp_path, "--frame-rate", 120)
    header, *rows = path.read_text(encoding="utf-8").splitlines()
    assert header == "t\txcap\tycap\txbase\tybase\txcm\tycm"
    values = np.array([[float(cell) for cell in row.split("\t")] for row in rows])
    t, cap, base, centre = values[:, 0], values[:, 1:3], values[:, 3:5], values[:, 5:7]
    assert np.diff(t) == pytest.approx(1 / 120, abs=2e-9)
    assert len(t) == 61
    assert np.hypot(*(base - cap).T) == pytest.approx(0.28, abs=3e-9)
    velocity = Scenario().launch_velocity
    fall = np.outer(t * t, [0.0, -9.81 / 2])
    assert np.abs(centre - centre[0] - np.outer(t, velocity) - fall).max() < 1e-8
    assert cap[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    # The centre of mass lies on the axis and moves along it as the water does.
    (x, y), (x_cm, y_cm) = (base - cap).T, (centre - cap).T
    assert np.abs(x * y_cm - y * x_cm).max() < 1e-8
    place = np.hypot(x_cm, y_cm) / 0.28
    assert place[0] == pytest.approx(0.8092, abs=1e-3)
    assert place.min() < 0.7


def test_frames_of_an_equation_are_solved_and_not_interpolated(tmp_path):
    path, throw = tmp_path / "flight.txt", Scenario().with_slices(5)
    assert run("export", "--solver", "free-flight", "--slices", 5, "--frame-rate", 240, "--out", path) == 0
    rows = np.loadtxt(path, skiprows=1)
    flight = ode_reference.solve(throw, "free-flight", rows[:, 0].round(9).clip(0.0, throw.duration))
    axis = (rows[:, 3:5] - rows[:, 1:3]) / throw.bottle.length
    assert np.abs(axis[:, 0] * np.cos(flight.theta) + axis[:, 1] * np.sin(flight.theta)).max() < 1e-7


def test_export_and_back(tmp_path):
    path = exported(tmp_path, "--start", 1.5, "--origin", "0.2,1.1")
    film = read_film([path], cap="cap", base="base", length_unit="m")
    assert film.t[0] == 1.5
    assert film.angle[0] == pytest.approx(math.pi / 2, abs=1e-6)
    assert film.values[0, 0] == pytest.approx([0.2, 1.1], abs=1e-6)


def test_export_stops_on_the_table(tmp_path, capsys):
    path = exported(tmp_path, "--height", -0.3, "--start", 1.5)
    words = capsys.readouterr().err
    assert "touches the table at t = 1.9" in words  # the video's time
    rows = path.read_text(encoding="utf-8").splitlines()
    last, touch = float(rows[-1].split("\t")[0]), float(words.partition("t = ")[2].split()[0])
    assert last <= touch < last + 0.05
    with pytest.raises(ValueError, match=r"height = -9 m: the bottle does not come down on such a table within 0\.5 s"):
        exported(tmp_path, "--height", -9)


def test_export_to_standard_output(capsys):
    assert run("export", "--solver", "exact-step", "--slices", 5, "--frame-rate", 10) == 0
    assert len(capsys.readouterr().out.splitlines()) == 7
