"""The commands track and export, the files they write, and the examples."""

import argparse
import csv
import importlib.util
import json
import math
import shutil
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flipproof.cli.film import add_film
from flipproof.film.tracker.bench import Request, measure
from flipproof.film.tracker.page import COLUMNS
from flipproof.film.tracker.reader import read_track_table
from slicemodel import Scenario

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "tracker"
TRACKED = sorted(path.name for path in EXAMPLES.iterdir() if path.suffix in (".txt", ".csv"))
BOTH = ("--cap", "cap", "--base", "base", "--length-unit", "m")


def run(*arguments):
    """Run a command as ``flipproof`` would; return its exit status."""
    parser = argparse.ArgumentParser(prog="flipproof")
    add_film(parser.add_subparsers(required=True))
    options = parser.parse_args([str(argument) for argument in arguments])
    return options.action(options)


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
    """Text and every number but the last printed digit, which another processor may round otherwise."""
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
                assert values == pytest.approx(other.tracks[track].columns[column], rel=2e-3, abs=2e-6, nan_ok=True), (
                    name
                )
        assert stored.read_bytes()[:40] == content[:40]


def test_examples_say_that_they_are_synthetic():
    words = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    assert "synthetic" in words
    for name in TRACKED:
        assert f"`{name}`" in words


@pytest.mark.parametrize("name", [name for name in TRACKED if not name.startswith(("single", "data", "ice"))])
def test_every_dialect_holds_the_same_throw(name):
    one = measure(Request(files=(EXAMPLES / name,), cap="cap", base="base", length_unit="m", length=0.28))
    throw = measure(Request(files=(EXAMPLES / "tab_unformatted.txt",), cap="cap", base="base", length_unit="m"))
    assert one.flight.release == pytest.approx(throw.flight.release, abs=1e-6)
    assert one.omega0 == pytest.approx(throw.omega0, abs=0.1)
    assert one.mean == pytest.approx(throw.mean, abs=0.002)
    assert one.warnings == ()
    assert np.nanmax(np.abs(one.spin.theta - throw.spin.theta)) < 2e-3


def test_the_truth_is_found_in_the_example(make):
    found = measure(Request(files=(EXAMPLES / "tab.txt",), cap="cap", base="base", length_unit="m", length=0.28))
    assert abs(found.flight.release - 0.1) <= 1.01 / 240
    assert abs(found.flight.landing - 0.1 - make.THROW.duration) <= 2.01 / 240
    assert abs(found.omega0 - make.THROW.omega0) < 3 * found.omega0_deviation
    assert found.axis.g == pytest.approx(9.81, abs=4 * found.axis.sd_g)
    assert (found.axis.v0x, found.axis.v0y) == pytest.approx(make.THROW.launch_velocity, abs=0.01)
    known = found.r_cm[~np.isnan(found.r_cm)]
    assert known[0] == pytest.approx(0.23, abs=0.005)
    assert known.min() < 0.18


def test_ice_keeps_its_angular_velocity_and_its_centre(make):
    found = measure(
        Request(files=(EXAMPLES / "ice.txt",), cap="cap", base="base", ice_top="ice top", length_unit="m", length=0.28)
    )
    assert found.mean == pytest.approx(1.0, abs=0.02)
    assert abs(found.omega0 - make.ICE_THROW.omega0) < 3 * found.omega0_deviation
    assert found.track is not None
    assert found.track.g == pytest.approx(9.81, rel=0.03, abs=0.0)
    assert np.nanstd(found.r_cm) < 1.5e-3
    assert any("nearer to the base" in note for note in found.notes)


def test_track_writes_a_folder(tmp_path, capsys):
    out = tmp_path / "out"
    assert run("track", EXAMPLES / "ice.txt", *BOTH, "--ice-top", "ice top", "--length", 0.28, "--out", out) == 0
    printed = capsys.readouterr().out
    for words in ("185 frames at 240/s, 181 with cap and base, 4 interpolated", "release  t = 0.1", "omega_0", "g = "):
        assert words in printed
    names = {path.name for path in out.iterdir()}
    figures = {f"{name}.{kind}" for name in ("tracks", "spin", "normalised", "axis") for kind in ("svg", "png")}
    assert names == figures | {".flipproof", "track.csv", "summary.json", "index.html"}
    numbers = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert numbers["omega0"]["value"] == pytest.approx(20, abs=0.5)
    assert numbers["frames"]["interpolated"] == 4
    assert "stays on one parabola" in numbers["release"]["how"]
    with (out / "track.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(COLUMNS)
    assert len(rows) == 185
    assert [row["interpolated"] for row in rows].count("1") == 4
    assert sum(row["in_flight"] == "1" for row in rows) == pytest.approx(132, abs=2)
    omega = [float(row["omega"]) for row in rows if row["in_flight"] == "1"]
    assert np.mean(omega) == pytest.approx(20, abs=0.1)
    for name in figures:
        assert (out / name).stat().st_size > 5_000
        if name.endswith("svg"):
            ElementTree.parse(out / name)
    page = (out / "index.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 4
    assert "src=" not in page
    assert "Look at this first" not in page
    run("track", EXAMPLES / "ice.txt", *BOTH, "--length", 0.3, "--out", out)
    assert "Look at this first" in (out / "index.html").read_text(encoding="utf-8")


def test_two_files_of_one_clip(capsys):
    assert run("track", EXAMPLES / "single_cap.txt", EXAMPLES / "single_base.txt", *BOTH) == 0
    assert "231 with cap and base" in capsys.readouterr().out


REFUSED = {
    "centre of mass outside": ((*BOTH, "--r-cm", "50"), r"r_cm = 50 m is outside \(0, 0.28\], the distance"),
    "no unit": (("--cap", "cap", "--base", "base"), "does not state the unit of x and y; .* --length-unit m, cm, mm"),
    "unknown unit": ((*BOTH[:5], "inch"), "length_unit = 'inch' is unknown; known: m, cm, mm"),
    "unknown track": (("--cap", "cop", *BOTH[2:]), "track 'cop' is unknown; did you mean 'cap'"),
    "no angle unit": ((*BOTH, "--angle-track", "cap"), "needs its unit: --angle-unit deg or rad"),
    "no angle": ((*BOTH, "--angle-track", "cap", "--angle-unit", "deg"), "track 'cap' has no column theta"),
    "window": ((*BOTH, "--window", "8"), "window = 8 is not an odd number"),
    "length": ((*BOTH, "--length", "-1"), r"length = -1 m is outside \(0, 100\)"),
    "r_cm": ((*BOTH, "--length", "0.28", "--r-cm", "0.3"), r"r_cm = 0.3 m is outside \(0, 0.28\]"),
    "order": ((*BOTH, "--release", "0.5", "--landing", "0.4"), "landing = 0.4 s does not follow release = 0.5 s"),
    "table": ((*BOTH, "--table-height", "-5"), "never comes down to it"),
}


@pytest.mark.parametrize(("arguments", "words"), REFUSED.values(), ids=REFUSED)
def test_refusals_of_track(arguments, words):
    with pytest.raises(ValueError, match=words) as refusal:
        run("track", EXAMPLES / "tab.txt", *arguments)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(("unit", "shown"), [("mm", "0.00981"), ("cm", "0.0981")])
def test_a_wrong_unit_is_said_by_gravity(unit, shown):
    found = measure(Request(files=(EXAMPLES / "tab.txt",), cap="cap", base="base", length_unit=unit))
    assert any(f"g = {shown}" in warning for warning in found.warnings)
    assert abs(found.flight.release - 0.1) <= 2.01 / 240


@pytest.mark.parametrize("length_error", [0.9, 0.97, 1.03, 1.1])
@pytest.mark.parametrize("name", ["tab.txt", "ice.txt"])
def test_a_wrong_scale_does_not_move_the_flight(tmp_path, name, length_error):
    scaled = rewritten(tmp_path, name, lambda t, *cells: (t, *(length_error * cell for cell in cells)))
    whole = measure(Request(files=(EXAMPLES / name,), cap="cap", base="base", length_unit="m"))
    found = measure(scaled)
    assert abs(found.flight.release - whole.flight.release) * 240 <= 2.01
    assert abs(found.flight.landing - whole.flight.landing) * 240 <= 2.01
    assert any("what it should be" in warning for warning in found.warnings)
    assert any("instead of 9.81" in warning for warning in found.warnings)


def rewritten(folder, name, change):
    """Return an example whose rows (t, cap, base) went through ``change``."""
    lines = (EXAMPLES / name).read_text(encoding="utf-8").splitlines()
    for k, line in enumerate(lines[3:], start=3):
        numbers = [float(cell) if cell else math.nan for cell in line.split("\t")]
        lines[k] = "\t".join("" if math.isnan(value) else f"{value:.6f}" for value in change(*numbers))
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return Request(files=(path,), cap="cap", base="base", length_unit="m", length=0.28)


def test_slow_motion_is_said_and_mended(tmp_path):
    slow = rewritten(tmp_path, "tab.txt", lambda t, *rest: (8 * t, *rest))
    (warning,) = measure(slow).warnings
    assert "if the scale is right, the times are 8 times too long" in warning
    found = measure(replace(slow, frame_rate=240.0))
    assert found.warnings == ()
    assert found.omega0 == pytest.approx(24, abs=0.5)
    assert found.flight.release == pytest.approx(0.1, abs=0.005)
    with pytest.raises(ValueError, match=r"frame_rate = 0 1/s is outside \[1, 1e6\]"):
        replace(slow, frame_rate=0.0)


def test_y_downwards_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"g = -9\.\d+ m/s\^2: y points down"):
        measure(rewritten(tmp_path, "tab.txt", lambda t, x, y, *rest: (t, x, -y, rest[0], -rest[1])))


def test_exchanged_ends_are_said(tmp_path):
    exchanged = rewritten(tmp_path, "tab.txt", lambda t, x, y, *rest: (t, *rest, x, y))
    (warning,) = measure(exchanged).warnings
    assert "0.19 of the length from the cap" in warning
    assert "are cap and base exchanged?" in warning


def test_track_touches_no_foreign_folder(tmp_path):
    (tmp_path / "letter.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(ValueError, match=r"holds letter\.txt and not flipproof's own marker"):
        run("track", EXAMPLES / "tab.txt", *BOTH, "--out", tmp_path)


def test_damaged_examples_never_break_the_analysis(tmp_path):
    """Bytes of an example changed at random: a number, or one line that says why not."""
    content = (EXAMPLES / "tab.txt").read_bytes()
    outcomes = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        damaged = bytearray(content)
        for place in rng.integers(60, len(damaged), int(rng.integers(1, 4))):
            damaged[place] = int(rng.choice(list(b"0123456789.E-\t")))
        path = tmp_path / "damaged.txt"
        path.write_bytes(damaged)
        message, found = "", None
        try:
            found = measure(Request(files=(path,), cap="cap", base="base", length_unit="m"))
        except ValueError as error:
            message = str(error)
        outcomes.append(found is not None)
        assert "\n" not in message
        assert found is None or math.isfinite(found.omega0)
    assert set(outcomes) == {True, False}


def exported(tmp_path, *arguments):
    path = tmp_path / "flight.txt"
    throw = tmp_path / "throw.toml"
    throw.write_text(Scenario(water_mass=0.33, n_slices=20, drag=0.0165).to_toml(), encoding="utf-8")
    assert run("export", throw, "--solver", "exact-step", "--format", "tracker", "--out", path, *arguments) == 0
    return path


def test_export_lays_cap_base_and_centre_over_the_video(tmp_path):
    path = exported(tmp_path, "--speed", 2, "--launch-angle", 70, "--frame-rate", 120)
    header, *rows = path.read_text(encoding="utf-8").splitlines()
    assert header == "t\txcap\tycap\txbase\tybase\txcm\tycm"
    values = np.array([[float(cell) for cell in row.split("\t")] for row in rows])
    t, cap, base, centre = values[:, 0], values[:, 1:3], values[:, 3:5], values[:, 5:7]
    assert np.diff(t) == pytest.approx(1 / 120, abs=2e-9)
    assert len(t) == 61
    assert np.hypot(*(base - cap).T) == pytest.approx(0.28, abs=3e-9)
    velocity = 2 * np.array([math.cos(math.radians(70)), math.sin(math.radians(70))])
    fall = np.outer(t * t, [0.0, -9.81 / 2])
    assert np.abs(centre - centre[0] - np.outer(t, velocity) - fall).max() < 1e-8
    assert cap[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    # The centre of mass lies on the axis and moves along it as the water does.
    (x, y), (x_cm, y_cm) = (base - cap).T, (centre - cap).T
    assert np.abs(x * y_cm - y * x_cm).max() < 1e-8
    place = np.hypot(x_cm, y_cm) / 0.28
    assert place[0] == pytest.approx(0.8092, abs=1e-3)
    assert place.min() < 0.7


def test_export_and_back(tmp_path):
    """What is exported is read again as the throw it was, its release angle and angular velocity included."""
    path = exported(tmp_path, "--start", 1.5, "--origin", "0.2,1.1", "--length-unit", "cm", "--delimiter", "semicolon")
    found = measure(Request(files=(path,), cap="cap", base="base", centre="cm", length_unit="cm", length=0.28))
    assert found.omega0 == pytest.approx(20, abs=0.15)
    assert found.spin.theta[0] == pytest.approx(math.pi / 2, abs=1e-6)
    assert found.spin.t[0] == 1.5
    assert found.track is not None
    assert (found.track.v0x, found.track.v0y, found.track.g) == pytest.approx((0.5, 1.94, 9.81), abs=1e-5)
    assert found.spin.cap[0] == pytest.approx([20, 110], abs=1e-6)


def test_export_stops_on_the_table(tmp_path, capsys):
    path = exported(tmp_path, "--height", -0.3)
    assert "lands at t = 0.4" in capsys.readouterr().err
    rows = path.read_text(encoding="utf-8").splitlines()
    assert 0.35 < float(rows[-1].split("\t")[0]) < 0.5
    with pytest.raises(ValueError, match=r"height = -9 m: the bottle does not come down on such a table within 0\.5 s"):
        exported(tmp_path, "--height", -9)


def test_export_to_standard_output(capsys):
    assert run("export", "--solver", "exact-step", "--slices", 5, "--frame-rate", 10) == 0
    assert len(capsys.readouterr().out.splitlines()) == 7


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--frame-rate", "0"), r"frame_rate = 0.0 1/s is outside \[1, 100000\]"),
        (("--speed", "-2"), r"speed = -2 m/s is outside \[0, inf\)"),
        (("--length-unit", "inch"), "length_unit = 'inch' is unknown"),
        (("--out", "/none/where.txt"), "the folder /none does not exist"),
        (("--out", str(EXAMPLES)), "is a folder; name a file"),
    ],
)
def test_refusals_of_export(arguments, words, monkeypatch):
    monkeypatch.setattr("flipproof.frame.solvers.solve", lambda *_: pytest.fail("solved before the refusal"))
    with pytest.raises(ValueError, match=words):
        run("export", "--solver", "exact-step", "--slices", 5, *arguments)


def test_a_duration_of_too_many_frames_is_named(tmp_path):
    (tmp_path / "long.toml").write_text("[scenario]\nduration = 1e15\n")
    with pytest.raises(ValueError, match=r"duration = 1e\+15 s at 240 frames/s .* up to 4166.67 s"):
        run("export", tmp_path / "long.toml", "--solver", "exact-step")


@pytest.mark.parametrize("solver", ["eq8", "midpoint"])
def test_omega_of_an_export_is_the_scenarios_within_its_deviation(tmp_path, solver):
    """No noise: what is left is the water, which moves before the frames that tell omega end."""
    run("export", "--solver", solver, "--slices", 50, "--out", tmp_path / "overlay.txt")
    found = measure(Request(files=(tmp_path / "overlay.txt",), cap="cap", base="base", length_unit="m"))
    assert abs(found.omega0 - Scenario().omega0) < 2 * found.omega0_deviation
    assert found.omega0_deviation < 0.02 * found.omega0


@pytest.mark.parametrize(
    "arguments", [("--speed", "fast"), ("--origin", "1;2"), ("--origin", "1,x"), ("--speed", "nan")]
)
def test_arguments_that_are_no_numbers(arguments, capsys):
    with pytest.raises(SystemExit) as exit_status:
        run("export", "--solver", "exact-step", *arguments)
    assert exit_status.value.code == 2
    assert "is not" in capsys.readouterr().err


def test_a_file_that_is_a_link(tmp_path):
    shutil.copy(EXAMPLES / "tab.txt", tmp_path / "real.txt")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real.txt")
    assert read_track_table(tmp_path / "link.txt").tracks.keys() == {"cap", "base"}
