"""Questions and answers as files, and the worked examples in other languages."""

import csv
import json
import shutil
import subprocess
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from flipproof.cli.main import main
from flipproof.foreign.certify import FAILED, IDLE, PASSED, WAITING, WEAK, certify
from flipproof.foreign.checks_laws import ask_of_vector
from flipproof.foreign.contract import Ask, Traits
from flipproof.foreign.files import Folder
from flipproof.foreign.solving import opened
from slicemodel import Scenario
from slicemodel.vectors import load_all

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "foreign"
GOOD = {"equation": "eq8", "refined_by": "steps", "order": 2.0}


def questions(folder):
    return sorted(folder.glob("[0-9]*-*"))


def answer_all(folder, solver):
    """Answer every question that has no answer, from its files alone."""
    for place in questions(folder):
        if (place / "answer.csv").is_file():
            continue
        throw = Scenario.from_mapping(json.loads((place / "scenario.json").read_text()))
        columns = [[float(x) for x in (place / f"{name}.csv").read_text().split()[1:]] for name in ("times", "start")]
        times, start = (np.array(column) for column in columns)
        effort = float((place / "effort.txt").read_text())
        found = solver(Ask(scenario=throw, times=times, start=start, effort=effort))
        n = throw.n_slices
        with (place / "answer.csv").open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["t", "theta", "omega", *(f"r_{i}" for i in range(n)), *(f"v_{i}" for i in range(n))])
            for k, t in enumerate(times):
                row = [t, found.theta[k], found.omega[k], *found.r[k], *found.v[k]]
                rows.writerow([repr(float(x)) for x in row])


def test_answers_by_files_get_a_verdict(tmp_path):
    folder = tmp_path / "answers"
    first = Folder(folder, GOOD)
    found = certify(first)
    assert first.waiting
    assert {r.verdict for r in found.results} == {WAITING, IDLE}
    assert "23 waiting, 1 not applicable (published-vectors: " in found.conclusion
    for _ in range(8):  # further questions depend on the answers
        answer_all(folder, opened("midpoint"))
        runner = Folder(folder)
        found = certify(runner)
        if not runner.waiting:
            break
    assert not runner.waiting
    assert not found.failed, found.failed[0].line
    assert {r.verdict for r in found.results} <= {PASSED, WEAK, IDLE}


def test_equal_questions_are_one_and_an_interrupted_one_is_written_anew(tmp_path, monkeypatch):
    folder = Folder(tmp_path / "answers", GOOD)
    certify(folder, ["shape", "start", "ice"])
    assert len(questions(folder.folder)) == 4
    before = {place: sorted(p.name for p in place.iterdir()) for place in questions(folder.folder)}
    monkeypatch.setattr("flipproof.foreign.files.write_ask", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        certify(folder, ["mirror"])
    monkeypatch.undo()
    assert {place: sorted(p.name for p in place.iterdir()) for place in questions(folder.folder)} == before
    certify(Folder(folder.folder), ["mirror"])
    assert len(questions(folder.folder)) == 5


def test_a_wrong_answer_names_its_file(tmp_path):
    folder = Folder(tmp_path / "answers", GOOD)
    certify(folder, ["shape"])
    (questions(folder.folder)[0] / "answer.csv").write_text("t,theta,omega\n0,0,nan\n")
    (result,) = certify(folder, ["shape"]).results
    assert result.verdict == FAILED
    assert "0001-" in result.reason


def test_a_folder_that_holds_something_else_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match="holds something else"):
        Folder(tmp_path)
    for index in ("", "[]", '{"name": "x", "order": "two"}'):
        (tmp_path / "solver.json").write_text(index)
        with pytest.raises(ValueError, match="is not readable"):
            Folder(tmp_path)


def test_what_is_said_of_a_folder_is_kept(tmp_path):
    Folder(tmp_path / "answers", GOOD)
    assert Folder(tmp_path / "answers").traits == Traits(name="answers", **GOOD)


def test_the_command_says_how_many_questions_wait(tmp_path, capsys):
    assert main(["certify", f"csv:{tmp_path / 'answers'}", "--equation", "eq8"]) == 1
    said = capsys.readouterr().out
    assert f"{len(questions(tmp_path / 'answers'))} questions wait for answer.csv" in said
    assert " of 22 checks wait" in said


@pytest.mark.skipif(shutil.which("node") is None, reason="no node")
def test_the_example_in_javascript_passes_by_its_command_and_by_files(tmp_path):
    script = EXAMPLES / "eq8.mjs"
    spec = f"cmd:node {script} {{scenario}} {{times}} {{start}} {{effort}} {{out}}"
    names = ["shape", "start", "ice", "angular-momentum", "mirror", "equation"]
    with closing(opened(spec, given={"order": 4.0})) as runner:
        found = certify(runner, names, equation="eq8")
    assert [r.verdict for r in found.results] == [PASSED] * 6
    folder = Folder(tmp_path / "answers", {"equation": "eq8", "refined_by": "dt"})
    for _ in range(3):
        found = certify(folder, names)
        subprocess.run(["node", str(script), str(folder.folder)], check=True, timeout=300)
    assert not found.failed, found.failed[0].line


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="no octave")
def test_the_papers_matlab_program_prints_its_numbers_in_octave(tmp_path):
    script = EXAMPLES / "paper.m"
    runner = opened(f"cmd:octave-cli -q {script} {{scenario}} {{times}} {{start}} {{effort}} {{out}}")
    with closing(runner):
        found = certify(runner, ["ice", "published-vectors"], equation="published-matlab")
    ice, vectors = found.results
    assert [ice.verdict, vectors.verdict] == [PASSED, PASSED]
    assert vectors.observation.facts["vectors"] < 1e-10
    folder = Folder(tmp_path / "answers", {"equation": "published-matlab", "refined_by": "dt", "order": 1.0})
    certify(folder, ["ice"])
    (one,) = questions(folder.folder)
    subprocess.run(["octave-cli", "-q", str(script), str(folder.folder)], check=True, timeout=300)
    throw = Scenario.from_toml(one / "scenario.toml")
    omega = np.genfromtxt(one / "answer.csv", delimiter=",", names=True)["omega"]
    np.testing.assert_array_equal(omega, throw.omega0)


def test_published_vectors_are_asked_for_as_far_as_they_are_held_to():
    vector = next(vector for vector in load_all() if vector.name == "matlab_default")
    assert vector.until < vector.scenario.duration
    for refined_by, effort in (("dt", vector.columns["t"][1]), ("steps", 199.0)):
        ask = ask_of_vector(vector, Traits(name="x", refined_by=refined_by))
        assert ask.times[-1] == ask.scenario.duration <= vector.until < ask.times[-1] + ask.times[1]
        assert ask.effort == pytest.approx(effort, rel=1e-12, abs=0.0)
