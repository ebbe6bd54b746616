"""The film: frames, files that are whole or not there, and the command."""

import argparse
import sys

import matplotlib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up import trajectory_of
from PIL import Image

from flipproof.animate import (
    HOLD,
    FilmError,
    check_target,
    draw_frames,
    film_of,
    frame_durations,
    outline,
    plan_film,
    slice_corners,
    write_film,
)
from flipproof.cli.animate import add_animate, chosen_solvers
from flipproof.output.motion import FLOWN
from slicemodel import Scenario

THROW = Scenario().with_slices(4)


def flown(name="eq8", end=THROW.duration, turning=True):
    t = np.linspace(0.0, end, 50)
    r = np.tile(THROW.initial_positions(), (50, 1))
    theta = THROW.theta0 + (9.0 * t if turning else 0.0)
    return trajectory_of(THROW, t, method=name, theta=theta, omega=9.0, r=r, r_cm=0.2)


def film(frames=3, runs=None, fps=25):
    return film_of(runs or [flown()], np.linspace(0.0, THROW.duration, frames), fps=fps, slow=9.6)


def command(*arguments):
    parser = argparse.ArgumentParser()
    add_animate(parser.add_subparsers(required=True))
    options = parser.parse_args(["animate", *arguments])
    return options.action(options)


@given(count=st.integers(1, 400), fps=st.integers(1, 50))
@settings(deadline=None, derandomize=True, max_examples=60)
def test_the_frames_of_a_gif_keep_the_pace_in_whole_hundredths(count, fps):
    stays = frame_durations(count, fps)
    assert len(stays) == count
    assert all(stay % 10 == 0 and stay >= 20 for stay in stays)
    assert sum(stays) - 1000 * HOLD == pytest.approx(1000 * count / fps, abs=5.0)
    assert max(stays[:-1], default=20) - min(stays[:-1], default=20) <= 10


def test_slow_motion_and_pace_make_the_number_of_frames():
    times = plan_film(THROW, 9.6, 25)
    assert len(times) == 121
    assert (times[0], times[-1]) == (0.0, THROW.duration)
    assert np.diff(times) == pytest.approx(1 / 240)
    assert len(plan_film(THROW, 1e-6, 25)) == 2


@pytest.mark.parametrize(
    ("slow", "fps", "words"),
    [
        (0.0, 25, r"--slow 0 is outside \(0, inf\)"),
        (float("nan"), 25, r"--slow nan is outside"),
        (float("inf"), 25, r"--slow inf is outside"),
        (9.6, 51, r"--fps 51 is outside \[1, 50\]"),
        (1e308, 25, r"at most 3000"),
        (1000.0, 25, r"--slow 1000 at --fps 25 makes 1.25e\+04 frames \(admissible: at most 3000\)"),
    ],
)
def test_a_film_that_cannot_be_is_refused(slow, fps, words):
    with pytest.raises(FilmError, match=words):
        plan_film(THROW, slow, fps)


def test_a_target_that_will_not_do_is_refused_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    for path, words in (
        (tmp_path / "a.avi", r"a\.avi: the name ends in \.avi \(admissible: \.gif, \.mp4\)"),
        (tmp_path / "gif", r"ends in nothing"),
        (tmp_path / "no" / "a.gif", r"the folder .* does not exist"),
        (tmp_path / "a.mp4", r"MP4 needs the program ffmpeg, .* install it, or name a \.gif"),
    ):
        with pytest.raises(FilmError, match=words):
            check_target(path)
    (tmp_path / "b.gif").mkdir()
    with pytest.raises(FilmError, match="is a folder; name a file"):
        check_target(tmp_path / "b.gif")


def test_bottle_and_slices_are_drawn_along_the_axis_from_cap_to_base():
    cap, along = np.array([1.0, 2.0]), np.array([0.6, -0.8])
    length, radius = THROW.bottle.length, THROW.bottle.radius
    points = outline(THROW, cap, along) - cap
    down, aside = points @ along, points @ np.array([0.8, 0.6])
    assert down.max() == pytest.approx(length)
    assert np.abs(aside).max() == pytest.approx(radius)
    assert down.min() == pytest.approx(-0.25 * radius), "the small cap stands before the tube"
    corners = slice_corners(THROW, THROW.initial_positions(), cap, along) - cap
    heights = (corners @ along).max(axis=1) - (corners @ along).min(axis=1)
    assert (corners @ along).max() == pytest.approx(length), "the first slice touches the base"
    assert heights == pytest.approx(THROW.slice_height)
    assert (corners @ along).mean(axis=1) == pytest.approx(THROW.initial_positions())


def test_frames_move_where_the_bottle_turns_and_have_even_sides():
    first, second, third = draw_frames(film(3, [flown(), flown("free-flight", end=0.3)]))
    assert first.dtype == np.uint8
    assert first.shape == second.shape == third.shape
    assert first.shape[0] % 2 == first.shape[1] % 2 == 0
    upper = slice(30, first.shape[0] // 2)
    assert (first[upper] != second[upper]).any()
    assert (second[upper] != third[upper]).any()


def test_a_users_settings_of_matplotlib_change_no_frame():
    (own,) = draw_frames(film(1))
    with matplotlib.rc_context({"font.family": "monospace", "text.hinting": "none", "xtick.labelsize": 20.0}):
        (again,) = draw_frames(film(1))
    assert np.array_equal(own, again)


def test_a_gif_holds_every_frame_and_its_background_is_white(tmp_path):
    steps = []
    target = tmp_path / "a.gif"
    write_film(film(4, [flown(name) for name in FLOWN], fps=30), target, lambda *drawn: steps.append(drawn))
    assert steps == [(1, 4), (2, 4), (3, 4), (4, 4)]
    with Image.open(target) as picture:
        assert picture.n_frames == 4
        stays = []
        for k in range(4):
            picture.seek(k)
            stays.append(picture.info["duration"])
            assert picture.convert("RGB").getpixel((1, 1)) == (255, 255, 255)
    assert stays == [30, 40, 30, 1030]
    assert [file.name for file in tmp_path.iterdir()] == ["a.gif"]


def test_an_interrupted_film_leaves_the_old_one_and_nothing_else(tmp_path):
    target = tmp_path / "a.gif"
    target.write_bytes(b"the old film")

    def stop(drawn, _total):
        if drawn == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_film(film(3), target, stop)
    assert target.read_bytes() == b"the old film"
    assert [file.name for file in tmp_path.iterdir()] == ["a.gif"]


def encoder(folder, monkeypatch, body):
    """Put a program of the encoder's name on the PATH."""
    folder.mkdir()
    program = folder / "ffmpeg"
    program.write_text(f"#!{sys.executable}\nimport sys\n{body}\n", encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))


def test_an_mp4_is_what_the_encoder_makes_of_every_frame(tmp_path, monkeypatch):
    encoder(
        tmp_path / "bin",
        monkeypatch,
        "data = sys.stdin.buffer.read()\nopen(sys.argv[-1], 'w').write(' '.join([str(len(data)), *sys.argv[1:]]))",
    )
    target = tmp_path / "a.mp4"
    write_film(film(3), target, lambda *_: None)
    size, *arguments = target.read_text(encoding="utf-8").split()
    width, height = map(int, arguments[arguments.index("-s") + 1].split("x"))
    assert int(size) == 3 * width * height * 3
    assert arguments[arguments.index("-r") + 1] == "25"
    assert arguments[-2] == "mp4"
    assert not list(tmp_path.glob("*part"))


@pytest.mark.parametrize("reads", ["", "sys.stdin.buffer.read()"])
def test_an_encoder_that_fails_is_one_line_and_leaves_the_old_film(tmp_path, monkeypatch, reads):
    target = tmp_path / "a.mp4"
    target.write_bytes(b"the old film")
    half = "open(sys.argv[-1], 'w').write('half')"
    encoder(tmp_path / "bin", monkeypatch, f"{reads}\n{half}\nsys.exit('no such\\ncodec')")
    with pytest.raises(FilmError, match="ffmpeg failed with exit status 1: no such codec"):
        write_film(film(3), target, lambda *_: None)
    assert target.read_bytes() == b"the old film"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mp4", "bin"]


def test_the_command_throws_and_writes(tmp_path, capsys):
    out = tmp_path / "a.gif"
    assert command("--solvers", "eq8, free-flight", "--slices", "3", "--slow", "0.2", "--out", str(out)) == 0
    assert "a.gif: 4 frames, 2 bottles, 0.1 s (0.2 times slower)" in capsys.readouterr().out
    with Image.open(out) as picture:
        assert picture.n_frames == 4


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ("eq9", "solver 'eq9' is unknown; did you mean 'eq8'"),
        ("eq8,eq8", "eq8 is there twice"),
        ("eq8,", "solver '' is unknown"),
        (
            "eq8,exact-step,midpoint,pymunk,free-flight,signs-limit,eq8-wall",
            r"7 bottles do not fit \(admissible: at most 6\)",
        ),
    ],
)
def test_solvers_that_cannot_stand_side_by_side_are_refused(names, words):
    with pytest.raises(ValueError, match=words):
        chosen_solvers(names, ())
