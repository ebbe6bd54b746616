"""The words of both pages: failures where they belong, and the end of a report."""

import re
from dataclasses import replace

from made_up import command, page_of, spoiled

from flipproof import build
from flipproof.chapters.solvers import FLIGHTS
from flipproof.frame.flights import Flights, Outcome
from flipproof.frame.gather import Gathered, Stages
from flipproof.page.render import read_assets, unbroken


def section_of(page, name):
    """Return a section without its links to the glossary."""
    section = re.search(rf'<section id="{name}"[^>]*>.*?</section>', page, re.S).group()
    return re.sub(r'<a class="term"[^>]*>(.*?)</a>', r"\1", section)


def test_a_failed_solver_and_a_failed_study_stand_where_their_results_would(gathered, report):
    reason = "SetupError: the world is <not> the one that was meant"
    broken = spoiled(gathered, [gathered.ask.solvers["pymunk"]], reason, ["flights"])
    broken = replace(broken, outcomes={**broken.outcomes, "waterfall": Outcome(None, reason)})
    pages = page_of(broken, report.exhibits[0].drawn)
    story, page = pages["index.html"], pages["evidence.html"]
    flights = section_of(page, "flights")
    row = re.search(r"<tr><th[^>]*>pymunk</th>.*?</tr>", flights, re.S).group()
    assert "✗ failed" in row
    assert "SetupError: the world is &lt;not&gt; the one that was meant" in row
    assert "trajectories/pymunk/" not in page
    assert "solvers failed on this throw" in section_of(story, "answer")
    assert "the world is &lt;not&gt;" in section_of(page, "assumptions")
    assert 'id="shares"' not in story


def test_the_flights_of_a_sound_report_are_all_marked_ok(report):
    flights = section_of(report.pages["evidence.html"], "flights")
    assert [name for name in FLIGHTS if f">{name}</th>" not in flights] == []
    assert "✗ failed" not in flights


def test_numbers_stay_with_what_belongs_to_them():
    assert unbroken("at t = 50.3 ms, 13 % of it") == "at t~=~50.3~ms, 13~% of it".replace("~", "\N{NO-BREAK SPACE}")


def test_scripts_and_styles_cannot_end_early():
    assets = read_assets()
    assert {"report.css", "report.js"} <= set(assets)
    for name, text in assets.items():
        assert "</script" not in text.lower(), name
        assert "</style" not in text.lower(), name


def test_a_report_ends_with_its_verdict_and_opens_if_asked(monkeypatch, capsys, tmp_path, report):
    def gather_nothing(ask, *_, **__):
        return Gathered(ask=ask, parts=(), outcomes={}, flights=Flights({}), stages=Stages())

    opened = []
    monkeypatch.setattr(build, "gather_report", gather_nothing)
    monkeypatch.setattr(build, "build", lambda *_, **__: report)
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    folder = tmp_path / "latest"
    status, printed, _ = command(capsys, "report", "--open", "--no-cache", "--jobs", 1, "--out", folder)
    assert status == 0
    assert opened == [(folder / "index.html").as_uri()]
    claims, _, verdict, where = printed.splitlines()[-4:]
    assert claims.endswith(" regression claims hold.")
    assert verdict.startswith("Not as it stands: ")
    assert where == f"Open {opened[0]}"
