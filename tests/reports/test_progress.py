"""Progress: the time left in words, one bar over a report's stages, and one line when functions are compiled."""

import os
import pty
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from flipproof.cli.progress import COSTS, Line, ReportProgress, time_left
from flipproof.frame.compiling import WORDS

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("share", "seconds", "words"),
    [
        (0.0, 100.0, ""),
        (0.04, 100.0, ""),
        (0.5, 2.0, ""),
        (1.0, 60.0, ""),
        (0.2, 10.0, "about 40 s left"),
        (0.99, 10.0, "about 5 s left"),
        (0.1, 60.0, "about 9 min left"),
        (0.05, 3600.0, "about 19 h left"),
    ],
)
def test_the_time_left_is_in_words_or_not_told(share, seconds, words):
    assert time_left(share, seconds) == words


def test_a_line_shows_no_number_that_it_does_not_know():
    line = Line("fit", hidden=True)
    assert line.text(0.4) == "fit [--------------------]   0%  0 s"
    line.show(0.5, "eq8")
    assert line.text(20.0) == "fit [##########----------]  50%  20 s, about 20 s left, eq8"


def test_what_was_there_before_says_nothing_of_the_time_that_is_left():
    line = Line("sweep", hidden=True)
    line.show(0.75, "3 of 4 points", before=0.5)
    assert line.text(20.0) == "sweep [###############-----]  75%  20 s, about 20 s left, 3 of 4 points"
    line.show(1.0, "", before=1.0)
    assert line.text(20.0) == "sweep [####################] 100%  20 s"


def test_stages_weigh_what_they_cost(monkeypatch):
    monkeypatch.setitem(COSTS, "full", {"runs, wave 1": 30.0, "figures": 10.0})
    shares = []
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with ReportProgress("full") as progress:
        for stage in ("runs, wave 1", "studies", "figures"):
            progress.begin(stage)
            for made in (1, 2):
                progress.show(made, 2)
                shares.append(progress._line._share)
    assert shares == pytest.approx([0.375, 0.75, 0.75, 0.75, 0.875, 1.0])


def test_without_a_terminal_a_stage_is_one_line(monkeypatch, capsys):
    monkeypatch.setitem(COSTS, "full", {"runs, wave 1": 30.0, "figures": 10.0})
    with ReportProgress("full") as progress:
        for stage in ("runs, wave 1", "studies", "figures"):
            progress.begin(stage)
            progress.show(1, 2, "pymunk")
    assert re.sub(r"\d+ s", "0 s", capsys.readouterr().err) == (
        "flipproof: 0 s: runs, wave 1\nflipproof: 0 s: figures\n"
    )


def on_a_terminal(command, **settings):
    """Run a program whose standard error is a terminal; return what it wrote there."""
    near, far = pty.openpty()
    process = subprocess.Popen(command, cwd=ROOT, stderr=far, **settings)
    os.close(far)
    shown = b""
    with suppress(OSError):  # the end of a terminal that nobody holds open
        while more := os.read(near, 10_000):
            shown += more
    os.close(near)
    assert process.wait() == 0
    return shown.decode()


LOOPS = """
from slicemodel.compiled import kept_on_disk


@kept_on_disk()
def twice(x):
    return 2.0 * x


@kept_on_disk()
def thrice(x):
    return 3.0 * x
"""
PROGRAM = """
import sys

import loops

from flipproof.cli import foreign
from flipproof.cli.main import main

foreign.command_models = lambda _: loops.twice(1.0) + loops.thrice(1.0) != 5.0
sys.exit(main(["models"]))
"""
"""A command of two small loops."""


@pytest.mark.parametrize("real", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["small", "simulate"])
def test_compiling_is_told_once_and_only_when_it_happens(tmp_path, real):
    """With a cache of numba's that is empty, then with the one that this leaves."""
    folder = tmp_path / "program"
    folder.mkdir()
    (folder / "loops.py").write_text(LOOPS, encoding="utf-8")
    (folder / "program.py").write_text(PROGRAM, encoding="utf-8")
    command = [sys.executable, str(folder / "program.py")]
    if real:
        command = [sys.executable, "-m", "flipproof", "simulate", "--slices", "2", "--out", str(tmp_path / "a.csv")]
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": path}
    assert [on_a_terminal(command, env=environment).count(WORDS) for _ in range(2)] == [1, 0]


def test_a_bar_moves_on_a_terminal_and_leaves_nothing_behind():
    code = (
        "import time; from flipproof.cli.progress import progress_bar\n"
        "with progress_bar('drawing', 'frame') as step:\n"
        "    time.sleep(1.2); step(1, 4); time.sleep(2.0)"
    )
    drawn = on_a_terminal([sys.executable, "-c", code]).split("\r\x1b[K")
    assert len(drawn) >= 4
    assert "25%" in drawn[-2]
    assert "1 of 4 frames" in drawn[-2]
    assert drawn[-1] == ""
