"""A throw held to a baseline: what passes, what fails, and what is said of the rest."""

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import pytest
from made_up import action as flipproof

from flipproof.chapters.errata import chapter as errata
from flipproof.check import throw as check_module
from flipproof.check.throw import CHECKS, check, findings_of, groups, line
from flipproof.frame import pool
from flipproof.frame.findings import Finding
from flipproof.frame.solvers import RunResult
from flipproof.frame.solvers import make as really_make
from flipproof.output.summary import summary_text
from slicemodel import Scenario

THROW = Scenario(n_slices=6, drag=0.8, duration=0.2)


@pytest.fixture(scope="module")
def thresholds():
    """What the group finds on the throw, computed once."""
    return tuple(findings_of("thresholds", THROW))


@pytest.fixture
def computed(monkeypatch, thresholds):
    def known(group, throw, store, _work):
        return iter(thresholds) if group == "thresholds" else findings_of(group, throw, store)

    monkeypatch.setattr(check_module, "findings_of", known)


@pytest.fixture
def place(tmp_path, thresholds):
    """A folder with the throw and a baseline that it meets, and a function that spoils the baseline."""
    (tmp_path / "throw.toml").write_text(THROW.to_toml())
    findings = [finding.to_mapping() for finding in thresholds]
    findings.append(Finding(id="engine-x", title="x", value=1.0, unit="", kind="observation").to_mapping())
    summary = {"version": 2, "scenario": THROW.to_mapping(), "slices": 6, "size": "quick", "findings": findings}

    def spoiled(id_="", **changes):
        changed = [{**f, **changes} if f["id"] == id_ else f for f in findings]
        (tmp_path / "summary.json").write_text(summary_text({**summary, "findings": changed}))
        return tmp_path

    return spoiled


STEP = "difference-exact-step-eq8"


@pytest.mark.usefixtures("computed")
def test_a_baseline_of_the_same_throw_is_met_and_the_rest_is_named(place, capsys):
    folder = place()
    status = flipproof("check", folder / "throw.toml", "--baseline", folder, "--only", "thresholds")
    lines = capsys.readouterr().out.splitlines()
    assert status == 0
    assert all(words.startswith("PASS  ") for words in lines[:-2])
    assert {f"PASS  {STEP}", "PASS  difference-published-python-free-flight"} <= {w.partition(":")[0] for w in lines}
    formulas = sum(words.startswith("PASS  erratum-") for words in lines)
    counted = f"{len(lines) - 2 - formulas} are of this throw, {formulas} of flipproof or the paper, whatever the throw"
    assert lines[-2] == f"{len(lines) - 2} of {len(lines) - 2} checks hold; {counted}."
    assert lines[-1] == "not recomputed: 1 findings of the baseline (engine 1)"


@pytest.mark.usefixtures("computed")
@pytest.mark.parametrize(
    ("changes", "arguments", "failed"),
    [
        ({"value": 0.5}, (), True),
        ({"value": 0.5, "band": 0.25}, (), False),
        ({"value": 0.5}, ("--tolerance", "0.5"), False),
        ({}, ("--tolerance", "0"), False),
        ({"value": 0.5}, ("--tolerance", "1e-3"), True),
        ({"admissible": [None, 1e-9]}, (), True),
        ({"admissible": [None, 1e-9]}, ("--tolerance", "1"), True),
        ({"admissible": [0.0, 0.5]}, (), False),
        ({"admissible": [0.5, None]}, (), True),
        ({"value": None}, (), False),
        ({"unit": "rad"}, (), True),
    ],
    ids=str,
)
def test_a_finding_must_stay_where_the_baseline_has_it_and_in_the_interval_chosen_there(
    place, capsys, changes, arguments, failed
):
    folder = place(STEP, **changes)
    chosen = ("--baseline", folder / "summary.json", "--only", "thresholds", "--junit", folder / "junit.xml")
    assert flipproof("check", folder / "throw.toml", *chosen, *arguments) == failed
    failures = [words for words in capsys.readouterr().out.splitlines() if words.startswith("FAIL")]
    assert [words.partition(":")[0] for words in failures] == ([f"FAIL  {STEP}"] if failed else [])
    (suite,) = ElementTree.parse(folder / "junit.xml").getroot()
    assert [case.get("name") for case in suite if case.find("failure") is not None] == ([STEP] if failed else [])


@pytest.mark.usefixtures("computed")
def test_what_a_baseline_does_not_know_is_said(place, capsys):
    folder = place(STEP, value=None)
    summary = json.loads((folder / "summary.json").read_text())
    gone = summary["findings"].pop(0)["id"]
    (folder / "summary.json").write_text(json.dumps(summary))
    assert flipproof("check", folder / "throw.toml", "--baseline", folder, "--only", "thresholds") == 0
    lines = capsys.readouterr().out.splitlines()
    (words,) = (line for line in lines if line.startswith(f"PASS  {STEP}:"))
    assert words.endswith("baseline not evaluated")
    assert lines[-1] == f"not in the baseline, and not checked: {gone}"


@pytest.mark.usefixtures("computed")
def test_a_finding_that_moved_a_little_is_shown_with_the_digits_that_tell_it(place, capsys, thresholds):
    (value,) = (finding.value for finding in thresholds if finding.id == STEP)
    folder = place(STEP, value=value * (1 + 1e-4))
    chosen = ("--baseline", folder, "--only", "thresholds", "--junit", folder / "junit.xml", "--tolerance", "0")
    assert flipproof("check", folder / "throw.toml", *chosen) == 1
    assert "moved by -" in capsys.readouterr().out
    (suite,) = ElementTree.parse(folder / "junit.xml").getroot()
    (message,) = (case.find("failure").get("message") for case in suite if case.find("failure") is not None)
    numbers, _, rest = message.partition("; ")
    shown, low = float(numbers.split()[0]), float(numbers.partition("threshold ")[2].split()[0])
    assert shown < low
    assert rest.startswith("baseline ")


def test_without_a_baseline_ice_vectors_convergence_and_reference_are_checked(place, capsys):
    folder = place()
    assert flipproof("check", folder / "throw.toml") == 0
    lines = capsys.readouterr().out.splitlines()
    names = {words.split()[1].partition("-")[0] for words in lines[:-1]}
    assert names == {"ice", "vectors", "order", "reference"}
    assert lines[-1] == "19 of 19 checks hold; 6 are of this throw, 13 of flipproof or the paper, whatever the throw."


def test_a_threshold_of_the_baseline_holds_for_the_other_groups_too(tmp_path):
    ice = Finding(id="ice-exact-step", title="x", value=7.0, unit="of ω₀", kind="regression", admissible=(-2.0, -1.0))
    summary = {"version": 2, "scenario": THROW.to_mapping(), "slices": 6, "findings": [ice.to_mapping()]}
    (tmp_path / "summary.json").write_text(summary_text(summary))
    said = []
    found = check(THROW, ("ice",), baseline=tmp_path, say=said.append)
    assert [finding.id for finding in found.failed] == ["ice-exact-step"]
    assert said[1] == "FAIL  ice-exact-step: 0 of ω₀; threshold -2 to -1"
    assert found.left_out == ()


def test_a_solver_that_fails_is_a_failed_check_with_its_reason(monkeypatch):
    def broken(run):
        if run.solver == "eq8":
            return RunResult(run, None, 0.0, "RuntimeError: no\nluck")
        return really_make(run)

    monkeypatch.setattr(pool, "make", broken)
    said = []
    found = check(THROW, ("ice", "convergence"), say=said.append)
    assert [finding.id for finding in found.failed] == [
        "ice-eq8", "order-exact-step-before-the-first-impact", "order-exact-step-across-impacts",
    ]  # fmt: skip
    assert "FAIL  ice-eq8: not evaluated: ice, eq8: RuntimeError: no luck" in said
    assert all("\n" not in words for words in said)


def test_a_difference_without_one_of_its_runs_is_not_evaluated(monkeypatch, place):
    def broken(run):
        return RunResult(run, None, 0.0, "RuntimeError: no luck")

    monkeypatch.setattr(pool, "make", broken)
    monkeypatch.setattr(errata, "study_errata", lambda _: {})
    found = check(THROW, ("thresholds",), baseline=place())
    assert len(found.failed) == len(found.findings) > 5
    assert all("no luck" in finding.note for finding in found.failed)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"scenario": Scenario(omega0=3.0).to_mapping()}, "is of another throw: .*omega0 = 3.0 → 20.0"),
        ({"slices": 0}, "slices = 0"),
        ({"slices": "many"}, "slices = 'many'"),
        ({"version": 3}, "version = 3"),
    ],
    ids=["throw", "zero slices", "slices", "version"],
)
def test_a_baseline_that_cannot_serve_is_refused_in_one_line(place, change, words):
    folder = place()
    summary = json.loads((folder / "summary.json").read_text())
    (folder / "summary.json").write_text(json.dumps(summary | change))
    with pytest.raises(ValueError, match=words) as caught:
        flipproof("check", folder / "throw.toml", "--baseline", folder)
    assert "\n" not in str(caught.value)


def test_every_group_has_its_check():
    assert tuple(groups()) == tuple(CHECKS)


def test_a_value_that_is_not_a_number_fails():
    finding = Finding(id="x", title="x", value=float("nan"), unit="m", kind="regression", admissible=(0.0, 1.0))
    assert line(finding, "threshold ≤ 1") == "FAIL  x: nan m; threshold ≤ 1"
    assert line(replace(finding, value=0.5), "threshold ≤ 1") == "PASS  x: 0.5 m; threshold ≤ 1"
