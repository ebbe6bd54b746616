"""The page's words: the answer, its numbers, the bars of the waterfall, and failures where they belong."""

import re

import pytest
from made_up import command, page_of, spoiled

from flipproof import build
from flipproof.chapters.solvers import FLIGHTS
from flipproof.chapters.waterfall.study import program_run
from flipproof.frame.flights import Flights
from flipproof.frame.gather import Gathered, Stages
from flipproof.page.pdf import VARIABLE, PrintError, find_browser, print_page, require_browser
from flipproof.page.render import read_assets, unbroken


def section_of(page, name):
    """Return a section without its links to the glossary."""
    section = re.search(rf'<section id="{name}"[^>]*>.*?</section>', page, re.S).group()
    return re.sub(r'<a class="term"[^>]*>(.*?)</a>', r"\1", section)


def test_a_failed_solver_and_a_failed_study_stand_where_their_results_would(gathered, report):
    lost = (gathered.ask.solvers["pymunk"], program_run(gathered.ask.throw, gathered.ask.steps))
    broken = spoiled(gathered, lost, "SetupError: the world is <not> the one that was meant", ("flights", "waterfall"))
    page = page_of(broken, report.exhibits[0].drawn)
    flights = section_of(page, "flights")
    row = re.search(r"<tr><th[^>]*>pymunk</th>.*?</tr>", flights, re.S).group()
    assert "✗ failed" in row
    assert "SetupError: the world is &lt;not&gt; the one that was meant" in row
    assert "trajectories/pymunk/" not in page
    assert "solvers failed on this throw" in section_of(page, "answer")
    assert "the world is &lt;not&gt;" in section_of(page, "assumptions")
    assert 'id="shares"' not in page


def test_the_flights_of_a_sound_report_are_all_marked_ok(report):
    flights = section_of(report.html, "flights")
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


def test_without_a_browser_printing_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setenv(VARIABLE, "/nowhere/chromium")
    assert find_browser() is None
    with pytest.raises(PrintError, match="/nowhere/chromium is not a program"):
        require_browser()
    monkeypatch.delenv(VARIABLE)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("flipproof.page.pdf.BROWSERS", ("chromium",))
    with pytest.raises(PrintError, match="--pdf needs Chromium, Chrome or Edge"):
        require_browser()


BROKEN = "#!/bin/sh\necho first >&2\nprintf 'broken in /tmp/\\374\\n' >&2\nexit 3\n"
"""A browser that prints nothing and says so in an encoding that is not the locale's."""


@pytest.fixture
def broken_browser(monkeypatch, tmp_path):
    program = tmp_path / "browser"
    program.write_text(BROKEN)
    program.chmod(0o755)
    monkeypatch.setenv(VARIABLE, str(program))


@pytest.mark.usefixtures("broken_browser")
def test_a_browser_that_prints_nothing_is_an_error_of_one_line(tmp_path):
    with pytest.raises(PrintError, match=r"printed nothing \(exit status 3: broken in /tmp/\ufffd\)") as caught:
        print_page(tmp_path / "page.html", tmp_path / "page.pdf")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "page.pdf").exists()


@pytest.mark.usefixtures("broken_browser")
@pytest.mark.parametrize("error", [None, OSError(28, "No space left on device")])
def test_a_report_that_cannot_be_printed_is_kept(monkeypatch, capsys, tmp_path, error):
    def gather_nothing(ask, *_, **__):
        return Gathered(ask=ask, parts=(), outcomes={}, flights=Flights({}), stages=Stages())

    def print_half(_, target):
        target.write_bytes(b"%PDF")
        raise error

    monkeypatch.setattr(build, "gather_report", gather_nothing)
    made = build.Report(findings=(), exhibits=(), html="<p>whole</p>", summary={}, tables={})
    monkeypatch.setattr(build, "build", lambda *_, **__: made)
    if error:
        monkeypatch.setattr("flipproof.page.pdf.print_page", print_half)
    folder = tmp_path / "latest"
    status, printed, said = command(capsys, "report", "--pdf", "--no-cache", "--jobs", 1, "--out", folder)
    assert status == 2
    assert "regression claims hold." in printed
    assert said.startswith("flipproof: error: the report is complete but for report.pdf: ")
    assert said.count("\n") == 1
    assert (folder / "index.html").read_text() == "<p>whole</p>"
    assert not (folder / "report.pdf").exists()
    assert command(capsys, "report", "--no-cache", "--jobs", 1, "--out", folder)[0] == 0
