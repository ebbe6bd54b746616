"""Consoles of every kind, interrupts at any time, and errors of flipproof's own: one line and the right status."""

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from made_up import command

from flipproof.cli import console
from flipproof.cli import main as cli
from flipproof.cli.console import readable, speak_plainly

ROOT = Path(__file__).resolve().parents[2]
SNAPSHOT = ROOT / "reports" / "snapshot" / "summary.json"


def flipproof(place, *arguments, encoding="ascii", **settings):
    return subprocess.run(
        [sys.executable, "-m", "flipproof", *map(str, arguments)],
        cwd=place, env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": encoding}, capture_output=True,
        text=True, encoding="utf-8", errors="replace", timeout=300, check=False, **settings,
    )  # fmt: skip


def test_every_letter_of_ours_has_an_ascii_form(monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    speak_plainly()
    text = "ω₀ ≤ 5 rad/s → θ̃ · é \udcff 漢 M\u0303 − 2 ± 1 °"
    sys.stdout.write(text)
    sys.stdout.flush()
    shown = sys.stdout.buffer.getvalue().decode("ascii").strip()
    assert shown == "omega0 <= 5 rad/s -> theta * e ? ? M - 2 +- 1  deg"


def test_no_letter_of_the_sources_becomes_a_question_mark():
    letters = set()
    for room in ("slicemodel", "ode_reference", "engine_check", "reports"):
        for file in (ROOT / room).rglob("*.py"):
            letters |= {letter for letter in file.read_text(encoding="utf-8") if not letter.isascii()}
    unknown = {letter for letter in letters if console._plain(letter) == "?"}
    assert unknown <= {"\ufffd"}


COMMANDS = pytest.mark.parametrize(
    ("status", "arguments"),
    [
        (0, ["--help"]),
        (0, ["models"]),
        (0, ["diff", SNAPSHOT, SNAPSHOT]),
        (1, ["diff", SNAPSHOT, "changed.json"]),
        (0, ["check", "throw.toml", "--only", "ice"]),
        (2, ["check", "≤.toml"]),
        (0, ["compare", "exact-step", "midpoint", "--slices", "3"]),
        (0, ["simulate", "--solver", "exact-step", "--slices", "3", "--steps", "5"]),
    ],
    ids=lambda value: str(value[0]) if isinstance(value, list) else str(value),
)


@pytest.fixture
def place(tmp_path):
    """Return a folder with a throw, and the snapshot's summary with every claim failed."""
    (tmp_path / "throw.toml").write_text("[scenario]\nn_slices = 4\n", encoding="utf-8")
    text = SNAPSHOT.read_text(encoding="utf-8").replace('"verdict": "pass"', '"verdict": "fail"')
    (tmp_path / "changed.json").write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("status", "arguments"), [(1, ["diff", SNAPSHOT, "changed.json"]), (2, ["check", "≤.toml"])], ids=["out", "error"]
)
def test_a_program_ends_with_its_own_status_on_a_poor_console(place, status, arguments):
    told = flipproof(place, *arguments, encoding="ascii")
    assert told.returncode == status, told.stderr
    assert "Traceback" not in told.stderr


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
@COMMANDS
def test_every_command_does_so_on_such_a_console(place, monkeypatch, status, arguments, encoding):
    """In this process: what ends a program on such a console is what it writes."""
    monkeypatch.chdir(place)
    streams = {name: io.TextIOWrapper(io.BytesIO(), encoding=encoding) for name in ("stdout", "stderr")}
    for name, stream in streams.items():
        monkeypatch.setattr(sys, name, stream)
    try:
        ended = cli.main([str(argument) for argument in arguments])
    except SystemExit as left:
        ended = left.code
    for stream in streams.values():
        stream.flush()
    said = streams["stderr"].buffer.getvalue().decode(encoding)
    assert ended == status, said
    assert "Traceback" not in said


def test_an_error_of_flipproofs_own_has_its_own_status(monkeypatch, capsys):
    def broken(_):
        raise ZeroDivisionError("float division by zero")

    monkeypatch.setattr("flipproof.cli.foreign.command_models", broken)
    assert cli.main(["models"]) == 3
    assert capsys.readouterr().err == (
        "flipproof: error: ZeroDivisionError: float division by zero (an error in flipproof itself; "
        "set FLIPPROOF_TRACEBACK=1 to see where)\n"
    )
    monkeypatch.setenv("FLIPPROOF_TRACEBACK", "1")
    assert cli.main(["models"]) == 3
    assert "Traceback" in capsys.readouterr().err


def test_a_missing_engine_is_not_flipproofs_error(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.delitem(sys.modules, "engine_check.engine_mujoco", raising=False)
    assert cli.main(["simulate", "--solver", "mujoco", "--slices", "2"]) == 2
    assert capsys.readouterr().err == (
        'flipproof: error: engine = "mujoco" needs MuJoCo: pip install "flipproof[mujoco]"\n'
    )


def test_an_error_message_is_never_endless():
    assert readable("a\n b  c") == "a b c"
    assert readable("\x1b[31m\u202ered") == r"\x1b[31m\u202ered"
    long = readable("x = " + "9" * 10_000 + " is outside [0, 1]")
    assert len(long) < 400
    assert long.endswith(" is outside [0, 1]")
    assert len(readable("word " * 10_000)) < 2100


def test_what_is_echoed_is_cut(capsys):
    for arguments in (["simulate", "--steps", "9" * 5000 + "x"], ["simulate", "--solver", "z" * 50_000]):
        status, _, said = command(capsys, *arguments)
        assert status == 2
        assert said.startswith("flipproof: error: ")
        assert len(said) < 1500


def test_an_endless_scenario_ends_at_once(tmp_path):
    """One process makes all commands, since one that reads on would never come back."""
    os.mkfifo(tmp_path / "pipe")
    with (tmp_path / "large.toml").open("wb") as file:
        file.truncate(40 * 2**20)
    commands = [["simulate", "large.toml"]]
    for endless in ("/dev/zero", "pipe"):
        track = ["track", endless, "--cap", "cap", "--base", "base", "--length-unit", "m"]
        commands += [["simulate", endless], ["sweep", endless, "--out", "sweep"], ["fit", endless], track]
    code = "import json, sys; from flipproof.cli.main import main; print([main(c) for c in json.loads(sys.argv[1])])"
    told = subprocess.run(
        [sys.executable, "-c", code, json.dumps(commands)],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=300,
        check=False,
    )  # fmt: skip
    assert told.stdout == f"{[2] * len(commands)}\n"
    for (_, endless, *_), line in zip(commands, told.stderr.splitlines(), strict=True):
        assert endless in line
    assert not (tmp_path / "sweep").exists()


@pytest.mark.parametrize("module", ["flipproof.cli.main", "flipproof.cli.start"])
def test_an_interrupt_while_the_program_loads_is_one_line(tmp_path, module):
    """Python itself must have started: what it says before the program's first statement is its own."""
    run = "from flipproof.cli import signals, start; signals.guard(); print('here', flush=True); start.entry()"
    start = ["-c", run] if module == "flipproof.cli.start" else ["-X", "importtime", "-m", module]
    for wait in (0.0, 0.05, 0.2, 0.5, 1.0):
        process = subprocess.Popen(
            [sys.executable, *start, "simulate", "--solver", "eq8", "--slices", "3", "--out", "out.csv"],
            cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True,
        )  # fmt: skip
        if module == "flipproof.cli.start":
            assert process.stdout.readline() == "here\n"
        else:
            while "argparse" not in process.stderr.readline():  # imported after the guard
                assert process.poll() is None
        time.sleep(wait)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=300)
        said = [line for line in err.splitlines() if not line.startswith("import time:")]
        assert (process.returncode, said) in (
            (130, ["flipproof: interrupted; nothing was overwritten"]),
            (0, []),
        )
