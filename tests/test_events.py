"""The frozen problems with events: files as their checksums say, made again within their bands, scored by adapters."""

import hashlib
import json
import math
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

EVENTS = Path(__file__).resolve().parent.parent / "examples" / "events"
sys.path.insert(0, str(EVENTS))

import make  # noqa: E402
import score  # noqa: E402
import work_precision  # noqa: E402

PROBLEMS = {problem["name"]: problem for problem in score.load()}
SOLVE = score.adapter(EVENTS / "scipy_ivp.py")


def test_the_files_are_those_of_the_checksums_and_say_the_same():
    for line in (EVENTS / "SHA256SUMS").read_text().splitlines():
        digest, name = line.split()
        assert hashlib.sha256((EVENTS / name).read_bytes()).hexdigest() == digest
    with np.load(EVENTS / "problems.npz") as arrays:
        for name, problem in PROBLEMS.items():
            for key in ("t", "omega", "omega_band", "r", "until"):
                assert np.array_equal(arrays[f"{name}/{key}"], problem[key])
            for key, values in problem["impacts"].items():
                assert np.array_equal(arrays[f"{name}/impact_{key}"], values)
    assert list(PROBLEMS) == list(make.PROBLEMS)
    assert len(PROBLEMS) == 20


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_problem_made_again_is_the_frozen_one_within_its_bands(name):
    frozen, made = PROBLEMS[name], make.problem(name)
    assert {key: made[key] for key in ("beads", "until", "duration", "what")} == {
        key: frozen[key] for key in ("beads", "until", "duration", "what")
    }
    for problem in (frozen, made):
        assert problem["omega_band"][-1] <= 1e-6 * abs(frozen["omega"][0])
    assert np.all(np.abs(np.subtract(made["omega"], frozen["omega"])) <= frozen["omega_band"][-1])
    theirs = frozen["impacts"]
    rows = list(zip(*(made["impacts"][key] for key in score.ROW), strict=True))
    result = score.score({**frozen, "impacts": theirs}, lambda _: (rows, made["omega"]))
    assert result.matched == result.impacts == result.answered
    assert result.time <= max([1e-12, *theirs["time_band"]])


@pytest.mark.parametrize("name", PROBLEMS)
def test_solve_ivp_finds_every_impact_and_no_other(name):
    result = score.score(PROBLEMS[name], SOLVE, 1e-12)
    assert result.matched == result.impacts == result.answered
    assert result.time < 1e-7
    assert result.omega < 1e-6


@pytest.mark.parametrize("name", ["simultaneous-7", "grazing-3", "zeno-1", "resting-3", "chaotic-1"])
def test_heyoka_finds_every_impact_within_a_picosecond_or_two(name):
    pytest.importorskip("heyoka")
    result = score.score(PROBLEMS[name], score.adapter(EVENTS / "heyoka_taylor.py"), 1e-15)
    assert result.matched == result.impacts == result.answered
    assert result.time < 1e-11


@pytest.mark.parametrize(
    ("name", "whole"), [("simultaneous-7", True), ("resting-3", True), ("zeno-1", True), ("grazing-1", False)]
)
def test_diffrax_finds_simultaneous_hits_and_misses_a_faint_one(name, whole):
    pytest.importorskip("diffrax")
    result = score.score(PROBLEMS[name], score.adapter(EVENTS / "diffrax_event.py"), 1e-13)
    assert (result.matched == result.impacts == result.answered) is whole
    assert result.time < 1e-8


@pytest.mark.parametrize("name", ["grazing-1", "grazing-3"])
def test_a_solver_that_looks_only_between_steps_misses_the_faint_hit(name):
    result = score.score(PROBLEMS[name], partial(SOLVE, turns=False), 1e-13)
    assert result.matched < result.impacts


def test_answers_that_are_wrong_lose_their_points():
    problem = PROBLEMS["hit-2"]
    rows, omega = SOLVE(problem, 1e-10)
    late = [(t + 2e-6, *rest) for t, *rest in rows]
    turned = [(t, bead, -end, *speeds) for t, bead, end, *speeds in rows]
    assert score.score(problem, lambda _: (late, omega)).matched == 0
    assert score.score(problem, lambda _: (turned, omega)).matched == 0
    assert score.score(problem, lambda _: (rows[1:], omega)).matched < len(rows)
    assert score.score(problem, lambda _: (rows, np.array(omega) * (1 + 1e-3))).omega > 1e-4


@pytest.mark.parametrize("column", [0, 3, 4])
@pytest.mark.parametrize("change", [math.nan, math.inf, 2e-4])
def test_no_time_and_no_speed_but_the_right_one_is_scored(column, change):
    rows, omega = SOLVE(PROBLEMS["hit-2"], 1e-10)
    changed = [(*row[:column], row[column] + change, *row[column + 1 :]) for row in rows]
    assert score.score(PROBLEMS["hit-2"], lambda _: (changed, omega)).matched == 0


def test_swapped_speeds_lose_their_points_and_a_rest_has_speed_0():
    rows, omega = SOLVE(PROBLEMS["zeno-2"], 1e-10)
    assert score.score(PROBLEMS["zeno-2"], lambda _: (rows, omega)).speed < 1e-8
    assert rows[-1][4] == 0
    swapped = [(*row[:3], row[4], row[3]) for row in rows]
    assert score.score(PROBLEMS["zeno-2"], lambda _: (swapped, omega)).matched == 0


@pytest.mark.parametrize(
    ("field", "cut"),
    [
        ("omega", lambda rows, omega: (rows, omega[:-1])),
        ("omega", lambda rows, omega: (rows, omega[0])),
        ("an impact", lambda rows, omega: ([row[:3] for row in rows], omega)),
    ],
)
def test_a_field_of_a_wrong_length_is_named(field, cut):
    rows, omega = SOLVE(PROBLEMS["hit-2"], 1e-6)
    with pytest.raises(score.AnswerError, match=f"hit-2: {field} has"):
        score.score(PROBLEMS["hit-2"], lambda _: cut(rows, omega))


def test_the_score_refuses_an_unknown_problem_and_a_short_answer_in_one_line(tmp_path):
    short = tmp_path / "short.py"
    short.write_text("def solve(problem, tolerance):\n    return [], [1.0]\n", encoding="utf-8")
    for adapter, problem, word in ((EVENTS / "scipy_ivp.py", "hitt-1", "chaotic-3"), (short, "hit-1", "omega")):
        command = [sys.executable, str(EVENTS / "score.py"), str(adapter), "--problem", problem]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 1
        assert done.stderr.count("\n") == 1
        assert word in done.stderr


def test_the_figure_of_the_page_can_be_made():
    svg = work_precision.picture(("hit-1", "grazing-3"), ("DOP853", "RK45"), (1e-7, 1e-10))
    for text in ("hit-1", "grazing-3", "DOP853", "RK45", "processor time"):
        assert text in svg
    assert work_precision.FIGURE.is_file()
    assert set(work_precision.SHOWN) <= set(PROBLEMS)


def test_the_table_of_the_page_is_that_of_the_files():
    page = (EVENTS.parent.parent / "docs" / "events.md").read_text(encoding="utf-8")
    version = json.loads((EVENTS / "problems.json").read_text(encoding="utf-8"))["version"]
    assert f"Version {version}" in page
    for name, problem in PROBLEMS.items():
        (line,) = (line for line in page.splitlines() if line.startswith(f"| {name} |"))
        assert line.split(" | ")[1] == problem["what"]
        assert line.split(" | ")[4] == str(len(problem["impacts"]["time"]))
