"""The suite as files, and the worked examples in other languages."""

import csv
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from flipproof.chapters.vectors.published import load_all
from flipproof.foreign import files
from flipproof.foreign.certify import FAILED, IDLE, PASSED, certify
from flipproof.foreign.checks_basic import ask_of_vector
from flipproof.foreign.contract import Ask, Traits
from flipproof.foreign.files import Kit
from flipproof.foreign.specs import opened
from slicemodel import Scenario

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "foreign"
GOOD = Traits(name="by hand", equation="eq8", refined_by="steps", order=2.0)


def answer_all(folder, solver):
    """Answer every ask of a kit that has no answer, from its files alone."""
    for place in sorted((folder / "asks").iterdir()):
        if (place / "answer.csv").is_file():
            continue
        throw = Scenario.from_toml(place / "scenario.toml")
        assert Scenario.from_mapping(json.loads((place / "scenario.json").read_text())) == throw
        times = [float(x) for x in (place / "times.csv").read_text().split()[1:]]
        ask = Ask.of(throw, np.array(times), float((place / "effort.txt").read_text()))
        assert [float(x) for x in (place / "start.csv").read_text().split()[1:]] == list(ask.start)
        found = solver(ask)
        n = throw.n_slices
        with (place / "answer.csv").open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["t", "theta", "omega", *(f"r_{i}" for i in range(n)), *(f"v_{i}" for i in range(n))])
            for k, t in enumerate(times):
                row = [t, found.theta[k], found.omega[k], *found.r[k], *found.v[k]]
                rows.writerow([repr(float(x)) for x in row])


def test_answers_by_files_get_the_same_verdicts(tmp_path):
    kit = Kit.made(tmp_path / "kit", GOOD)
    first, waiting = Kit(kit.folder).grade()
    assert waiting
    assert "is not there yet" in first.conclusion
    asked = len(list((kit.folder / "asks").iterdir()))
    for _ in range(5):  # the search for a floor asks again, depending on the answers
        answer_all(kit.folder, opened("midpoint"))
        found, waiting = Kit(kit.folder).grade()
        if not waiting:
            break
    assert not waiting
    assert len(list((kit.folder / "asks").iterdir())) - asked <= 5
    assert not found.failed
    assert {r.verdict for r in found.results} == {PASSED, IDLE}


@pytest.mark.parametrize("broken", ["write_ask", "write_whole"])
def test_a_kit_that_was_interrupted_goes_on(tmp_path, monkeypatch, broken):
    """Killed while an ask or the index is written: the next run writes both, and keeps no answer to another ask."""
    whole, made = getattr(files, broken), []

    def dies_in_the_middle(*arguments):
        made.append(arguments)
        if len(made) == 4:
            raise KeyboardInterrupt
        return whole(*arguments)

    monkeypatch.setattr(files, broken, dies_in_the_middle)
    with pytest.raises(KeyboardInterrupt):
        Kit.made(tmp_path / "kit", GOOD)
    monkeypatch.undo()
    kit = Kit(tmp_path / "kit")
    last = sorted((kit.folder / "asks").iterdir())[-1]
    assert last.name == f"{len(kit.asks) + 1:04d}"
    (last / "answer.csv").write_text("t,theta,omega\n")
    _, waiting = kit.grade()
    expected = Kit.made(tmp_path / "other", GOOD)
    assert kit.asks == Kit(kit.folder).asks == expected.asks
    assert waiting == len(kit.asks)
    for place in (expected.folder / "asks").iterdir():
        other = kit.folder / "asks" / place.name
        assert {p.name: p.read_text() for p in place.iterdir()} == {p.name: p.read_text() for p in other.iterdir()}


def test_a_wrong_answer_names_its_file(tmp_path):
    kit = Kit.made(tmp_path / "kit", GOOD)
    (kit.folder / "asks" / "0001" / "answer.csv").write_text("t,theta,omega\n0,0,nan\n")
    found, _ = kit.grade()
    assert "shape" in [result.check for result in found.failed]


@pytest.mark.parametrize(
    ("index", "said"),
    [
        ("", "is not readable"),
        ("[]", "is not readable"),
        ('{"kit": 9, "solver": {"name": "x"}, "asks": []}', "format 9, must be 1"),
    ],
)
def test_a_folder_that_is_no_kit_is_refused(tmp_path, index, said):
    with pytest.raises(ValueError, match="is no kit"):
        Kit(tmp_path)
    (tmp_path / "kit.json").write_text(index)
    with pytest.raises(ValueError, match=said):
        Kit(tmp_path)
    with pytest.raises(ValueError, match="is not empty; name a new folder"):
        Kit.made(tmp_path, GOOD)


@pytest.mark.skipif(shutil.which("node") is None, reason="no node")
def test_the_example_in_javascript_passes_by_its_command_and_by_a_kit(tmp_path):
    script = EXAMPLES / "eq8.mjs"
    runner = opened(f"cmd:node {script} {{scenario}} {{times}} {{start}} {{effort}} {{out}}")
    found = certify(runner, ["shape", "start", "ice", "angular-momentum", "mirror", "equation"], equation="eq8")
    assert [r.verdict for r in found.results] == [PASSED] * 6
    kit = Kit.made(tmp_path / "kit", Traits(name="eq8.mjs", equation="eq8", refined_by="dt"))
    waiting = 1
    while waiting:
        subprocess.run(["node", str(script), str(kit.folder)], check=True, timeout=300)
        graded, waiting = Kit(kit.folder).grade()
    assert not graded.failed, graded.failed[0].line


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="no octave")
def test_the_papers_matlab_program_prints_its_numbers_in_octave(tmp_path):
    script = EXAMPLES / "paper.m"
    runner = opened(f"cmd:octave-cli -q {script} {{scenario}} {{times}} {{start}} {{effort}} {{out}}")
    found = certify(runner, ["ice", "restitution", "published-vectors"], equation="published-matlab")
    ice, restitution, vectors = found.results
    assert [ice.verdict, vectors.verdict] == [PASSED, PASSED]
    assert vectors.found.facts["vectors"] < 1e-10
    assert restitution.verdict == FAILED  # slices that have passed an end stay outside
    kit = Kit.made(tmp_path / "kit", Traits(name="paper.m", equation="published-matlab", refined_by="dt", order=1.0))
    one = next(place for place in sorted((kit.folder / "asks").iterdir()) if "frozen = true" in
               (place / "scenario.toml").read_text())  # fmt: skip
    for place in (kit.folder / "asks").iterdir():
        if place != one:
            shutil.rmtree(place)
    subprocess.run(["octave-cli", "-q", str(script), str(kit.folder)], check=True, timeout=300)
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
