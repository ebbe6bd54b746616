"""The committed snapshot is what the code gives now, and one command renews it."""

import json
import re
from pathlib import Path

import jsonschema
import pytest

from flipproof.check.diff import read_summary
from flipproof.check.throw import check
from flipproof.cli import snapshot
from flipproof.cli.snapshot import KEPT, PICTURES, PLACE, main, take
from flipproof.output.summary import SUMMARY_VERSION, schema_text, summary_text
from slicemodel import Scenario

ROOT = Path(__file__).resolve().parents[2]
KEPT_FILES = {".flipproof", "summary.json", *(f"{name}.png" for name in PICTURES)}


@pytest.fixture(scope="module")
def kept():
    return json.loads((PLACE / "summary.json").read_text(encoding="utf-8"))


def test_the_snapshot_is_a_full_report_of_the_papers_throw_in_the_present_format(kept):
    jsonschema.validate(kept, json.loads(schema_text()))
    assert list(kept) == ["$schema", *KEPT]
    assert (PLACE / kept["$schema"]).resolve().is_file()
    assert (kept["version"], kept["size"]) == (SUMMARY_VERSION, "full")
    assert Scenario.from_mapping(kept["scenario"]) == Scenario()
    assert {f["verdict"] for f in kept["findings"] if f["kind"] == "regression"} == {"pass"}


def test_its_findings_are_those_that_the_code_gives_now():
    """Ice, published vectors, convergence, eight differences and the audit are computed again; none may have moved."""
    found = check(Scenario(), ("ice", "vectors", "convergence", "thresholds"), baseline=PLACE)
    assert [(finding.id, finding.value, finding.note) for finding in found.failed] == []
    assert len(found.findings) >= 45


def test_its_pictures_are_there_and_the_readme_shows_one():
    assert {path.name for path in PLACE.iterdir()} == KEPT_FILES
    for name in PICTURES:
        assert (PLACE / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    shown = re.findall(r"reports/snapshot/(\S+?)\.png", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert shown
    assert set(shown) <= set(PICTURES)


# ---------------------------------------------------------------------- the command


@pytest.fixture
def report(tmp_path, kept):
    """The folder of a full report, as far as the command reads it."""
    folder = tmp_path / "report"
    (folder / "figures").mkdir(parents=True)
    (folder / "summary.json").write_text(summary_text({**kept, "runs": [], "provenance": {}}))
    for name in PICTURES:
        (folder / "figures" / f"{name}.png").write_bytes(b"\x89PNG " + name.encode())
    return folder


def test_one_command_keeps_summary_and_pictures(report, tmp_path, kept, capsys):
    place = tmp_path / "snapshot"
    assert main(["--from", str(report), "--to", str(place)]) == 0
    assert capsys.readouterr().out == f"Snapshot: {place}\n"
    assert {path.name for path in place.iterdir()} == KEPT_FILES
    assert json.loads((place / "summary.json").read_text(encoding="utf-8")) == kept
    assert (place / "omega.png").read_bytes() == b"\x89PNG omega"
    assert read_summary(place)


def spoil(report, **changes):
    summary = json.loads((report / "summary.json").read_text(encoding="utf-8"))
    (report / "summary.json").write_text(summary_text({**summary, **changes}))


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (lambda report: spoil(report, size="quick"), "size = 'quick'"),
        (lambda report: spoil(report, version=1), "version = 1"),
        (lambda report: (report / "figures" / "omega.png").unlink(), "has no figures/omega.png"),
        (lambda report: (report / "summary.json").unlink(), "cannot be read"),
    ],
    ids=["quick", "version", "picture", "summary"],
)
def test_what_is_no_full_report_leaves_the_snapshot_as_it_was(report, tmp_path, capsys, fault, words):
    place = tmp_path / "snapshot"
    take(report, place)
    before = {path.name: path.read_bytes() for path in place.iterdir()}
    fault(report)
    assert main(["--from", str(report), "--to", str(place)]) == 2
    assert words in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in place.iterdir()} == before


def test_a_report_with_a_failed_claim_is_no_snapshot(report, tmp_path, kept):
    findings = [dict(finding) for finding in kept["findings"]]
    broken = next(finding for finding in findings if finding["kind"] == "regression")
    broken["verdict"] = "fail"
    spoil(report, findings=findings)
    with pytest.raises(ValueError, match=f"claims failed: {broken['id']}"):
        take(report, tmp_path / "snapshot")


def test_without_a_folder_it_makes_the_report_itself(report, tmp_path, monkeypatch):
    from flipproof.cli import main as cli

    asked = []

    def make(arguments):
        asked.append(arguments[:2])
        report.rename(arguments[2])
        return 0

    monkeypatch.setattr(cli, "main", make)
    assert snapshot.main(["--to", str(tmp_path / "snapshot")]) == 0
    assert asked == [["report", "--out"]]
    monkeypatch.setattr(cli, "main", lambda _: 1)
    assert snapshot.main(["--to", str(tmp_path / "snapshot")]) == 1
    assert (tmp_path / "snapshot" / "summary.json").is_file()
