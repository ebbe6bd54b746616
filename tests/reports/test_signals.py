"""Signals end a command whatever it is doing, and what it started ends with it."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from made_up import alive, command, refused, wait_for

from flipproof.cli import signals

ROOT = Path(__file__).resolve().parents[2]
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc, and asks the kernel for a parent-death signal")
HOURS = "[scenario]\nduration = 2e4\nrestitution = 1.0\nn_slices = 20000\n"
"""A throw that keeps compiled code busy for hours."""


@contextmanager
def flipproof(place, *arguments, **settings):
    command = [sys.executable, "-m", "flipproof", *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=place, env=environment, **streams, **settings) as process:
        try:
            yield process
        finally:
            process.kill()


def processor_seconds(process):
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@LINUX
@pytest.mark.parametrize(
    "number",
    [signal.SIGINT, *(pytest.param(each, marks=pytest.mark.slow) for each in (signal.SIGTERM, signal.SIGHUP))],
)
def test_a_signal_ends_what_compiled_code_would_do_for_hours(capsys, tmp_path, number):
    command(capsys, "simulate", "--solver", "eq8", "--slices", 3, "--out", tmp_path / "short.csv")  # compiles
    (tmp_path / "throw.toml").write_text(HOURS, encoding="utf-8")
    answered = {"preexec_fn": lambda: signal.signal(number, signal.SIG_DFL)}  # whoever runs the tests may ignore it
    with flipproof(tmp_path, "simulate", "throw.toml", "--solver", "eq8", "--out", "out.csv", **answered) as process:
        wait_for(lambda: processor_seconds(process) > 2.5)
        process.send_signal(number)
        _, said = process.communicate(timeout=300)
    assert (process.returncode, said) == (130, "flipproof: interrupted; nothing was overwritten\n")
    assert not (tmp_path / "out.csv").exists()


@LINUX
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_every_signal_ends_a_command(capsys, monkeypatch, number):
    """In this process; how a program ends is told by the one above."""

    def interrupted(_):
        signal.raise_signal(number)
        return 0

    before = {each: signal.signal(each, lambda *_: None) for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    monkeypatch.setattr("flipproof.cli.foreign.command_models", interrupted)
    monkeypatch.setattr(signals, "SIGNALS", signals._handled())
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    try:
        assert command(capsys, "models") == (130, "", "flipproof: interrupted; nothing was overwritten\n")
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


@LINUX
def test_a_hangup_that_is_ignored_stays_ignored(tmp_path):
    ignore = {"preexec_fn": lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN)}
    with flipproof(tmp_path, "simulate", "--solver", "eq8", "--slices", "3", "--out", "out.csv", **ignore) as process:
        for _ in range(10):
            process.send_signal(signal.SIGHUP)
            time.sleep(0.1)
        _, said = process.communicate(timeout=300)
    assert (process.returncode, said) == (0, "")


@pytest.mark.parametrize("solver", ["exact-step", "eq8", "column"])
def test_an_answer_that_does_not_fit_is_refused_before_it_is_begun(capsys, tmp_path, solver):
    words = "flipproof: error: n_slices = 1000000 at 1000 output times need 14.9 GiB (admissible: "
    refused(capsys, words, "simulate", "--solver", solver, "--slices", 1_000_000, "--out", tmp_path / "out.csv")


PROGRAM = """
import os, time
from pathlib import Path
Path("pids").write_text(str(os.getpid()))
time.sleep(600)
"""
GUEST = """
import ctypes, os, subprocess, sys
from pathlib import Path

def solve(*_):
    other = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    Path("pids").write_text(f"{os.getpid()} {other.pid}")
    ctypes.PyDLL(None).sleep(600)  # no other thread runs meanwhile
"""


@LINUX
@pytest.mark.parametrize(
    ("text", "spec"),
    [
        (PROGRAM, f"cmd:{sys.executable} guest.py {{out}}"),
        (GUEST, "guest.py:solve"),
    ],
    ids=["command", "guest that holds the interpreter and has a child"],
)
def test_what_a_killed_command_started_ends_too(tmp_path, text, spec):
    (tmp_path / "guest.py").write_text(text, encoding="utf-8")
    pids = tmp_path / "pids"
    with flipproof(tmp_path, "simulate", "--solver", spec, "--slices", "3", "--out", "out.csv") as process:
        wait_for(lambda: pids.exists() and pids.read_text())
        started = [int(pid) for pid in pids.read_text().split()]
        assert all(alive(pid) for pid in started)
        process.kill()
        process.wait()
    wait_for(lambda: not any(alive(pid) for pid in started))
