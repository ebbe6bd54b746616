"""Two reports compared: nothing between two runs of the same program, and a seeded fault by the findings it moves."""

import copy
import dataclasses
import json
from types import MappingProxyType

import pytest
from made_up import action as flipproof

from flipproof.build import ask_of
from flipproof.chapters import parts
from flipproof.chapters.horizon.chapter import Reach
from flipproof.chapters.overlap.chapter import Amount
from flipproof.chapters.stability.chapter import Layout
from flipproof.check.diff import Change, change_of, compare_summaries, read_summary, scenario_changes, within
from flipproof.frame import pool, solvers
from flipproof.frame.findings import Band, Finding
from flipproof.frame.gather import evaluate, gather
from flipproof.frame.provenance import provenance
from flipproof.output.summary import summarise, summary_text
from flipproof.page.verdict import verdict
from slicemodel import Scenario, schemes
from slicemodel import solver as slice_solver

THROW = Scenario(water_mass=0.5, n_slices=6, drag=0.8, duration=0.3)
WORK = {
    "step-size": 4,
    "slices": (3, 6),
    "waterfall": 2,
    "exact-cases": (),
    "stability": Layout(panels=((18.0, 10),), dt=(2e-3, 2e-4), iterations=(10, 90), duration=0.1, budget=2e6),
    "horizon": Reach(solvers=("pymunk",), sizes=(1e-9,), seeds=(1,), slices=3),
    "overlap": Amount(fills=(1.0,), slices=3, dt=4e-4, brim_dt=1e-4),
}
"""As small as a report can be that makes all kinds of claims."""


def summary_of_a_run(make=solvers.make):
    """Return the summary of a small report; ``make`` makes its runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pool, "make", make)
        reference = dataclasses.replace(Scenario().with_slices(5), duration=0.3)
        ask = dataclasses.replace(ask_of(THROW, "quick", certified=()), reference=reference)
        # In this process: a fault that is seeded here is seeded for all.
        found = gather(parts(), ask, pool.SerialExecutor(), work=WORK)
        made = summarise(found, evaluate(found), provenance("flipproof report"), verdict(found))
    return json.loads(summary_text(made))


def key_of(run):
    return run.solver, run.scenario, repr(sorted(run.settings.items()))


@pytest.fixture(scope="module")
def made():
    """Every run of the sound report."""
    return {}


@pytest.fixture(scope="module")
def sound(made):
    def make(run):
        made[key_of(run)] = solvers.make(run)
        return made[key_of(run)]

    return summary_of_a_run(make)


def written(folder, summary):
    folder.mkdir()
    (folder / "summary.json").write_text(summary_text(summary), encoding="utf-8", errors="backslashreplace")
    return folder


# ---------------------------------------------------------------------- real runs


def test_two_runs_of_one_throw_do_not_differ(sound, tmp_path, capsys):
    again = summary_of_a_run()
    assert len(sound["findings"]) > 70
    old, new = written(tmp_path / "old", sound), written(tmp_path / "new", again)
    assert flipproof("diff", old, new) == 0
    assert capsys.readouterr().out.endswith("findings compared: no difference\n")


def test_the_sign_fault_of_eq_9d_is_named_by_the_findings_it_moves(sound, made, tmp_path, capsys, monkeypatch):
    """The sinh term of the exact step gets back the plus sign with which the paper prints Eq. 9d."""
    exact = schemes.SCHEMES["exact-step"]
    assert exact.form.sinh_sign == -1.0
    wrong = dataclasses.replace(exact, form=exact.form._replace(sinh_sign=+1.0))
    monkeypatch.setattr(slice_solver, "SCHEMES", MappingProxyType({**schemes.SCHEMES, "exact-step": wrong}))

    def make(run):
        """Only the slice model has the fault: what other packages run is what it was."""
        known = made.get(key_of(run))
        if known is None or solvers.find(run.solver).package == "slicemodel":
            return solvers.make(run)
        return dataclasses.replace(known, run=run)

    faulty = summary_of_a_run(make)
    assert flipproof("diff", written(tmp_path / "old", sound), written(tmp_path / "new", faulty)) == 1
    out = capsys.readouterr().out
    changes = {change.id: change for change in compare_summaries(sound, faulty).changes}
    assert all(f"  {name}: " in out for name in changes)
    assert changes["difference-exact-step-eq8"].kind == "moved"
    assert changes["order-exact-step-before-the-first-impact"].words.startswith("pass → fail")
    assert "order-exact-step-across-impacts" in changes
    # The audit measures the drag of the paper by the exact step; parts of the cost of a finite step are its own.
    others = {name for name in changes if "exact-step" not in name}
    assert others == {"erratum-eq8-drag", "finite-step-exact", "finite-step-held-located"}


# ---------------------------------------------------------------------- what counts as a difference


def finding(**changes):
    usual = {"id": "x", "title": "x", "value": 1.0, "unit": "m", "kind": "observation", "band": 0.1}
    given = {**usual, **changes}
    return Finding(**given | {"band": Band.of(given["band"], "twins")}).to_mapping()


WITH_A_BAND = [
    ({}, None),
    ({"value": 1.19}, None),
    ({"value": 1.21}, "moved"),
    ({"value": 0.79}, "moved"),
    ({"value": 1.3, "band": 0.25}, None),
    ({"value": 1.3, "band": None}, "moved"),
    ({"value": 1.2 + 2e-6}, "moved"),
    ({"value": 1.2 + 5e-7}, None),
    ({"value": float("nan")}, "moved"),
    ({"value": float("inf")}, "moved"),
    ({"band": float("nan"), "value": 1.09}, None),
    ({"value": None}, "verdict"),
    ({"unit": "km"}, "moved"),
    ({"title": "says something else"}, "words"),
    ({"note": "took 3 s"}, None),
    ({"kind": "regression", "admissible": (0.0, 2.0)}, "verdict"),
]
WITHOUT_A_BAND = [
    ({"value": 1.3}, "bandless"),
    ({"value": 1.0 + 2e-6}, "bandless"),
    ({"value": 1.0 + 5e-7}, None),
    ({"value": 1.3, "band": float("nan")}, "bandless"),
    ({"value": 1.3, "band": 0.1}, "moved"),
    ({"value": float("nan")}, "moved"),
    ({"value": float("inf")}, "moved"),
    ({"value": None}, "verdict"),
    ({"value": 1.3, "unit": "km"}, "moved"),
    ({"value": 1.3, "title": "says something else"}, "words"),
    ({"value": 3.0, "kind": "regression", "admissible": (0.0, 2.0)}, "verdict"),
]
HELD = {"band": None, "kind": "regression", "admissible": (0.0, 2.0)}


@pytest.mark.parametrize(
    ("old", "changes", "kind"),
    [
        *(({}, *each) for each in WITH_A_BAND),
        *(({"band": None}, *each) for each in WITHOUT_A_BAND),
        (HELD, {"value": 1.9}, "bandless"),
        (HELD, {"value": 2.1}, "verdict"),
    ],
    ids=str,
)
def test_a_finding_differs_beyond_its_bands_and_is_not_comparable_without_one(old, changes, kind):
    change = change_of(finding(**old), finding(**{**old, **changes}))
    assert (None if change is None else change.kind) == kind


def test_a_value_that_vanished_has_moved():
    assert change_of(finding(), {**finding(), "value": None}).words == "1 m → –"


def test_the_tolerance_is_added_to_every_band():
    assert change_of(finding(), finding(value=1.25), 0.06) is None
    assert change_of(finding(), finding(value=1.25), 0.04).kind == "moved"
    assert change_of(finding(band=None), finding(value=1.05, band=None), 0.06) is None
    assert change_of(finding(), finding(value=1.2 + 5e-7), 0.0).kind == "moved"


def test_what_is_not_comparable_is_said_and_does_not_count(sound, tmp_path, capsys):
    other = copy.deepcopy(sound)
    bandless = next(f for f in other["findings"] if f["band"] is None and isinstance(f["value"], float))
    bandless["value"] = bandless["value"] + 1e-3 * max(1.0, abs(bandless["value"]))
    old, new = written(tmp_path / "old", sound), written(tmp_path / "new", other)
    assert flipproof("diff", old, new) == 0
    out = capsys.readouterr().out
    assert "are not comparable: they moved, state no band, and are not counted as differences (1):" in out
    assert f"  {bandless['id']}: " in out
    assert out.endswith("findings compared: no difference, 1 not comparable\n")
    assert flipproof("diff", old, new, "--tolerance", "1e300") == 0
    assert "not comparable" not in capsys.readouterr().out


def test_every_erratum_has_a_band(sound):
    errata = [finding for finding in sound["findings"] if finding["id"].startswith("erratum-")]
    assert len(errata) > 10
    assert all(0 <= finding["band"] <= 2e-6 * abs(finding["value"]) for finding in errata)


def test_a_file_that_cannot_be_written_is_refused_first(sound, tmp_path):
    old = written(tmp_path / "old", sound)
    with pytest.raises(ValueError, match=r"--json .* is a folder; name a file"):
        flipproof("diff", old, old, "--json", tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        (1.0, 1.0 + 5e-10, True),
        (1.0, 1.0 + 5e-9, False),
        (1e6, 1e6 + 1e-4, True),
        (1e6, 1e6 + 1e-2, False),
        (2e-16, 9e-15, True),
        (0.0, 2e-12, False),
        (float("nan"), float("nan"), True),
        (float("inf"), float("inf"), True),
        (float("inf"), float("-inf"), False),
        (1.0, float("nan"), False),
    ],
)
def test_without_a_band_only_round_off_is_no_change(old, new, same):
    assert within(old, new, 0.0) is same
    assert within(new, old, 0.0) is same


def test_what_was_made_differently_is_said_first(sound, tmp_path, capsys):
    other = copy.deepcopy(sound)
    other["scenario"]["scenario"]["water_mass"] = 0.3
    other["slices"], other["size"] = 50, "full"
    other["provenance"]["numpy"] = "9.9"
    other["findings"] = other["findings"][1:]
    other["findings"][3]["id"] = "brand-new"
    old, new = written(tmp_path / "old", sound), written(tmp_path / "new", other)
    assert flipproof("diff", old, new / "summary.json") == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[:3] == [
        "DIFFERENT throw: water_mass = 0.5 → 0.3",
        "DIFFERENT slices: 6 → 50",
        "DIFFERENT size of the report: quick → full",
    ]
    assert lines[3].startswith("note: numpy: ")
    assert "are gone (2):" in lines
    assert "are new (1):" in lines
    assert compare_summaries(sound, other).changes[-1].id == "brand-new"
    assert lines[-1].endswith("findings compared: no difference; 2 are gone; 1 is new")
    other["findings"][0]["verdict"] = "fail"
    assert compare_summaries(sound, other).conclusion.endswith("findings compared: 1 differs; 2 are gone; 1 is new")


def test_another_version_alone_is_no_difference(sound):
    other = {**sound, "version": 1, "flipproof": "9.9"}
    found = compare_summaries(sound, other)
    assert found.same
    assert found.circumstances[:1] == ("version of the format: 2 → 1",)


def test_scenarios_are_compared_field_by_field():
    old, new = Scenario().to_mapping(), Scenario(omega0=21.0).to_mapping()
    new["bottle"] = {**new["bottle"], "mass": 0.03}
    assert scenario_changes(old, new) == ["bottle.mass = 0.028 → 0.03", "omega0 = 20.0 → 21.0"]
    assert scenario_changes(old, old) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is not JSON"),
        ("[1]", "has no findings"),
        ("{}", "has no findings"),
        ('{"findings": [], "version": 99, "scenario": {}}', "version = 99"),
        ('{"findings": [], "version": 2}', "has no scenario"),
        ('{"findings": [1], "version": 2, "scenario": {}}', "not a list of objects"),
        ('{"findings": [{"id": "x"}], "version": 2, "scenario": {}}', "'x' has no title"),
    ],
)
def test_what_is_no_summary_is_refused_in_one_line(tmp_path, text, words):
    file = tmp_path / "summary.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=words) as caught:
        read_summary(tmp_path)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"value": "much"}, "value = 'much'"),
        ({"value": True}, "value = True"),
        ({"value": 10**400}, "value = 1000"),
        ({"band": [1]}, "band = "),
        ({"band": -0.1}, "band = -0.1, must be at least 0"),
        ({"admissible": [0]}, "admissible = "),
        ({"id": 7}, "which is no text"),
    ],
)
def test_a_finding_that_cannot_be_read_is_named(tmp_path, sound, change, words):
    broken = {**sound, "findings": [*sound["findings"], {**finding(), **change}]}
    with pytest.raises(ValueError, match=words):
        read_summary(written(tmp_path / "report", broken))


def test_a_missing_folder_and_a_repeated_id_are_refused(tmp_path, sound):
    with pytest.raises(ValueError, match="cannot be read"):
        read_summary(tmp_path / "nowhere")
    twice = {**sound, "findings": [finding(), finding()]}
    with pytest.raises(ValueError, match="share the id 'x'"):
        read_summary(written(tmp_path / "report", twice))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "regression"}, "observation → regression"),
        ({"admissible": [None, 1e-5]}, "threshold none → ≤ 1e-05"),
    ],
)
def test_another_kind_or_threshold_is_a_difference(changes, words):
    assert change_of(finding(), {**finding(), **changes}) == Change(kind="words", id="x", words=words)


def test_a_change_is_worded_with_its_size_and_its_band():
    assert change_of(finding(), finding(value=1.5)) == Change(
        kind="moved", id="x", words="1 m → 1.5 m, moved by +0.5, bands and tolerance allow 0.2"
    )
