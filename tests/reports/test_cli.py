"""The command line as people meet it: help, results, and one line for every mistake."""

import argparse
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from made_up import command as run
from made_up import refused

from flipproof.cli import main as cli
from flipproof.cli.arguments import output, refuse_overwriting
from flipproof.cli.main import _print_report
from flipproof.cli.screens import commands_of
from flipproof.frame.chapter import Absent
from flipproof.frame.findings import Band, observed


def test_eight_commands_stand_on_the_first_screen_and_every_other_on_the_second(capsys):
    status, first, _ = run(capsys, "--help")
    assert status == 0
    listed = re.findall(r"^  (\w+) {2,}[A-Z]", first, re.MULTILINE)
    assert listed == ["report", "compare", "check", "simulate", "sweep", "certify", "track", "fit"]
    assert len(first.splitlines()) <= 20
    assert run(capsys, "help") == (0, first, "")
    assert run(capsys) == (2, first, "")
    status, second, _ = run(capsys, "more")
    assert status == 0
    others = re.findall(r"^  ([a-z]\w+) {2,}[A-Z]", second, re.MULTILINE)
    assert set(listed) | set(others) | {"more"} == set(commands_of(cli.parser()))
    assert not set(listed) & set(others)
    assert "exit status" in second


def test_help_of_a_command_has_two_ways(capsys):
    for command in commands_of(cli.parser()):
        status, out, _ = run(capsys, command, "--help")
        assert status == 0
        assert f"usage: flipproof {command}" in out
        assert run(capsys, "help", command) == (0, out, "")


def test_simulate_writes_csv(capsys, tmp_path):
    status, out, err = run(capsys, "simulate", "--solver", "exact-step", "--slices", "3", "--steps", "10")
    assert (status, err.count("\n")) == (0, 1)
    assert err.startswith("flipproof: exact-step: the step is coarse")
    assert out.splitlines()[0] == "t,theta,omega,r_cm,inertia,r_0,r_1,r_2,v_0,v_1,v_2"
    assert len(out.splitlines()) == 11
    file = tmp_path / "a.csv"
    status, out, _ = run(capsys, "simulate", "--solver", "eq8", "--slices", "3", "--out", str(file))
    assert (status, out) == (0, "")
    assert len(file.read_text().splitlines()) == 1001


def test_simulate_says_when_a_run_is_not_whole(capsys):
    status, out, err = run(capsys, "simulate", "--solver", "published-matlab", "--slices", "20")
    assert status == 1
    assert out.startswith("t,theta,omega")
    assert "published-matlab: " in err
    assert "left the bottle at t = " in err


def test_compare_solvers_and_files(capsys, tmp_path):
    status, out, _ = run(capsys, "compare", "published-python", "eq8", "--slices", "5")
    assert status == 0
    assert re.search(r"^omega: largest difference \d", out, re.MULTILINE)
    assert "first more than 1% of omega_0 apart: " in out
    file = tmp_path / "a.csv"
    run(capsys, "simulate", "--slices", "5", "--out", str(file))
    status, out, _ = run(capsys, "compare", str(file), "exact-step", "--slices", "5")
    assert status == 0
    assert "apart: never" in out
    assert re.search(r"^omega: largest difference (0|\S+e-1\d) of omega_0", out, re.MULTILINE)


def test_models_lists_everything_with_reasons(capsys):
    status, out, _ = run(capsys, "models")
    assert status == 0
    for name in ("published-python", "exact-step", "published-limit", "eq8", "pymunk"):
        assert re.search(rf"^  {name}$", out, re.MULTILINE)


def test_no_command_writes_over_what_it_reads(capsys, tmp_path):
    throw, curve, mine = tmp_path / "throw.toml", tmp_path / "curve.csv", tmp_path / "mine.py"
    throw.write_text("[scenario]\nn_slices = 3\n")
    curve.write_text("t,omega\n0,20\n0.1,10\n")
    mine.write_text("def solve(ask): ...\n")
    link = tmp_path / "link.csv"
    link.symlink_to(curve)
    report = tmp_path / "report"
    report.mkdir()
    (report / "summary.json").write_text("{}")
    before = [file.read_text() for file in (throw, curve, mine)]
    for option, arguments in (
        ("--out", ("simulate", throw, "--out", throw)),
        ("--out", ("simulate", "--solver", f"{mine}:solve", "--out", mine)),
        ("--json", ("compare", curve, "eq8", "--json", link)),
        ("--json", ("check", throw, "--only", "ice", "--json", throw)),
        ("--out", ("export", throw, "--solver", "eq8", "--out", throw)),
        ("--json", ("diff", report, report, "--json", report / "summary.json")),
        ("--json", ("check", throw, "--baseline", report, "--json", report / "summary.json")),
    ):
        refused(capsys, (f"error: {option} ", " is a file that this command reads; name another"), *arguments)
    assert [file.read_text() for file in (throw, curve, mine)] == before
    assert (report / "summary.json").read_text() == "{}"


@pytest.mark.parametrize(
    ("spec", "files"),
    [
        ("mine.py:solve", ["mine.py", "helper.py"]),
        ("mine:solve", ["mine.py", "helper.py"]),
        ("parts.mine:solve", ["parts/__init__.py", "parts/mine.py"]),
        ("cmd:node mine.py --table=helper.py {out}", ["mine.py", "helper.py"]),
        (f"cmd:node {300 * 'x'} mine.py {{out}}", ["mine.py"]),
    ],
)
@pytest.mark.parametrize("command", [["certify", "SPEC", "--json"], ["simulate", "--solver", "SPEC", "--out"]])
def test_no_command_writes_over_a_solver_however_it_is_named(capsys, monkeypatch, tmp_path, spec, files, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "parts").mkdir()
    for name in ("mine.py", "helper.py", "parts/__init__.py", "parts/mine.py"):
        Path(name).write_text("import helper\n")
    for file in files:
        words = f"flipproof: error: {command[-1]} {file} is a file that this command reads; name another"
        refused(capsys, words, *[spec if word == "SPEC" else word for word in command], file)
        assert Path(file).read_text() == "import helper\n"


def test_two_options_do_not_write_one_file(capsys, tmp_path):
    file, link = tmp_path / "both", tmp_path / "link"
    link.symlink_to(file)
    compared = ["compare", "eq8", "free-flight", "--slices", "3", "--tolerance", "1"]
    for other in (file, link, tmp_path / "." / "both"):
        words = f"--junit {other} is the file of --json, too; name another"
        refused(capsys, words, *compared, "--json", file, "--junit", other)
        assert not file.exists()
    assert run(capsys, *compared, "--json", os.devnull, "--junit", os.devnull)[0] == 0


@pytest.mark.skipif(sys.platform == "win32", reason="needs a shell that closes and feeds descriptors")
def test_closed_output_a_full_disk_a_removed_folder_and_a_pipe(tmp_path):
    def shell(command):
        flipproof = f"{shlex.quote(sys.executable)} -m flipproof"
        ran = subprocess.run(
            ["bash", "-c", command.replace("flipproof", flipproof)],
            cwd=tmp_path,
            env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"},
            capture_output=True,
            text=True,
        )
        return ran.returncode, ran.stdout, ran.stderr

    (tmp_path / "throw.toml").write_text("[scenario]\nn_slices = 3\n")
    assert shell("flipproof simulate throw.toml --steps 5000 >&-") == (0, "", "")
    if Path("/dev/full").exists():
        status, _, err = shell("flipproof simulate throw.toml --steps 5000 > /dev/full")
        assert (status, err.count("\n")) == (2, 1)
        assert "standard output or a file cannot be read or written (No space left on device)" in err
    status, _, err = shell("mkdir gone && cd gone && rmdir ../gone && flipproof simulate ../throw.toml --out x.csv")
    assert (status, err) == (2, "flipproof: error: the current folder has been removed; go to another\n")
    one = "<(flipproof simulate throw.toml --solver eq8)"
    status, out, err = shell(f"flipproof compare {one} {one}")
    assert (status, err) == (0, "")
    assert "apart: never" in out


def test_an_option_that_a_command_writes_spares_what_it_reads(tmp_path):
    """Whatever it is called: its type says that it is written."""
    throw = tmp_path / "throw.toml"
    throw.write_text("[scenario]\n", encoding="utf-8")
    command = argparse.ArgumentParser()
    command.add_argument("scenario")
    command.add_argument("--count", type=output)
    with pytest.raises(ValueError, match=r"--count .* is a file that this command reads"):
        refuse_overwriting(command.parse_args([str(throw), "--count", str(throw)]), command)


def test_every_option_that_names_what_is_written_has_the_type_of_one():
    words = re.compile(r"\b(write|draw|folder to|folder for|folder;|folder \()")
    for name, command in commands_of(cli.parser()).items():
        for action in command._actions:
            if isinstance(action.type, type) and issubclass(action.type, Path):
                assert not words.search(action.help or ""), f"{name} {action.option_strings}"


def test_the_end_of_a_report_names_vague_numbers_and_chapters_that_could_not_be_made(capsys):
    findings = [
        observed("difference-a-b", "a against b", 0.2, "of ω₀", band=Band(0.41, "twins")),
        observed("difference-c-d", "c against d", 0.2, "of ω₀", band=Band(1e-3, "twins")),
        observed("difference-e-f", "e against f", 0.0, "of ω₀", band=Band(0.3, "twins")),
        observed("difference-g-h", "g against h", 0.0, "of ω₀", band=Band(1e-9, "twins")),
        Absent("chapter-waterfall", "What each assumption costs", "stalled", "observation").finding,
        observed("paper-x", "a statement that is not judged", None),
    ]
    _print_report(SimpleNamespace(findings=findings, failed=(), summary={}), Path("r"), 1.0)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:6] == [
        "   20.000%  a against b (numerical uncertainty 41%)",
        "   20.000%  c against d",
        "    0.000%  e against f (numerical uncertainty 30%)",
        "    0.000%  g against h",
        "Could not be made, for reasons in the evidence: What each assumption costs",
    ]
