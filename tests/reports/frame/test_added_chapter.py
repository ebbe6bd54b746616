"""A chapter that somebody adds: one module, one line, and it stands in report, summary, JUnit and check."""

import json
import xml.etree.ElementTree as ElementTree
from importlib import resources

import pytest

from flipproof import chapters
from flipproof.build import ask_of, build, gather_report, write
from flipproof.check.throw import check, groups
from flipproof.frame.pool import SerialExecutor
from flipproof.frame.provenance import provenance
from slicemodel import Scenario

HOWTO = resources.files("flipproof").joinpath("..", "..", "docs", "howto.md")


@pytest.fixture
def turns(tmp_path, monkeypatch):
    """The chapter of ``docs/howto.md``, in a folder of its own."""
    text = HOWTO.read_text(encoding="utf-8").split("## A chapter", 1)[1]
    (tmp_path / "added").mkdir()
    (tmp_path / "added" / "turns_chapter.py").write_text(
        text.split("```python", 1)[1].split("```", 1)[0], encoding="utf-8"
    )
    monkeypatch.syspath_prepend(tmp_path)
    line = ("turns", "Turns", "How far the bottle turns.", ("added.turns_chapter",))
    ice = next(part for part in chapters.CONTENTS if part[0] == "ice")
    monkeypatch.setattr(chapters, "CONTENTS", (ice, line))


@pytest.mark.usefixtures("turns")
def test_an_added_chapter_stands_in_report_summary_and_junit(tmp_path):
    report = build(
        gather_report(ask_of(Scenario(n_slices=3), "quick"), pool=SerialExecutor()), provenance("flipproof report")
    )
    folder = tmp_path / "out"
    folder.mkdir()
    write(report, folder)
    page = (folder / "evidence.html").read_text(encoding="utf-8")
    assert '<section id="turns" class="fold">' in page
    assert '<figure id="figure-turns">' in page
    assert (folder / "figures" / "turns.svg").exists()
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    (finding,) = [finding for finding in summary["findings"] if finding["id"] == "turns"]
    assert finding["verdict"] == "pass"
    assert "turns" in {figure["section"] for figure in summary["figures"]}
    cases = ElementTree.parse(folder / "junit.xml").getroot()[0].iter("testcase")
    assert "turns" in {case.get("name") for case in cases}


@pytest.mark.usefixtures("turns")
def test_an_added_chapter_can_be_checked():
    assert tuple(groups())[-2:] == ("turns", "thresholds")
    said = []
    assert not check(Scenario(n_slices=3), ("turns",), say=said.append).failed
    assert said[0].startswith("PASS  turns: 0.79")
