"""The page's words: the answer, its numbers, the bars of the waterfall, and failures where they belong."""

import re
from types import SimpleNamespace

import pytest
from made_up import spoiled

from flipproof.chapters.solvers import FLIGHTS
from flipproof.chapters.waterfall.study import program_run
from flipproof.frame.gather import tell
from flipproof.output.provenance import provenance
from flipproof.page.pdf import VARIABLE, PrintError, find_browser, print_page, require_browser
from flipproof.page.render import read_assets, render, unbroken
from flipproof.page.verdict import strips

pytestmark = pytest.mark.xdist_group("evidence")


def waterfall(start, end, *shares):
    bars = tuple(SimpleNamespace(name=f"part {k}", average=value) for k, value in enumerate(shares))
    return SimpleNamespace(start=start, end=end, bars=bars)


def test_bars_of_the_waterfall_join_and_fill_the_drawing():
    made = strips(waterfall(0.3, 0.2, -0.1, +0.3, -0.3))
    edges = [(round(strip.left, 6), round(strip.left + strip.width, 6)) for strip in made]
    assert edges == [(0, 60), (40, 60), (40, 100), (40, 100), (0, 40)]
    assert [strip.kind for strip in made] == ["whole", "down", "up", "down", "whole"]
    assert [strip.text for strip in made] == ["0.300", "−0.100", "+0.300", "−0.300", "0.200"]


def test_bars_below_zero_stay_inside_and_values_that_are_not_finite_draw_nothing():
    made = strips(waterfall(-0.1, 0.3, 0.4))
    assert all(strip.left >= 0 and strip.left + strip.width <= 100 + 1e-9 for strip in made)
    assert strips(waterfall(float("nan"), 0.2, 0.1)) == ()
    assert all(strip.width == 0 for strip in strips(waterfall(0.0, 0.0, 0.0)))


def section_of(page, name):
    return re.search(rf'<section id="{name}">.*?</section>', page, re.S).group()


def test_a_failed_solver_and_a_failed_study_stand_where_their_results_would(gathered):
    lost = (gathered.ask.solvers["pymunk"], program_run(gathered.ask.throw, gathered.ask.steps))
    broken = spoiled(gathered, lost, "SetupError: the world is <not> the one that was meant", ("flights", "waterfall"))
    page = render(broken, tell(broken), provenance("flipproof report"))
    flights = section_of(page, "flights")
    row = re.search(r"<tr><th[^>]*>pymunk</th>.*?</tr>", flights, re.S).group()
    assert "✗ failed" in row
    assert "SetupError: the world is &lt;not&gt; the one that was meant" in row
    assert "trajectories/pymunk/" not in page
    assert "solvers failed on this throw" in section_of(page, "verdict")
    assert "the world is &lt;not&gt;" in section_of(page, "assumptions")
    assert 'class="strips"' not in page


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


def test_a_browser_that_prints_nothing_is_an_error_of_one_line(monkeypatch, tmp_path):
    program = tmp_path / "browser"
    program.write_text("#!/bin/sh\necho first >&2\necho broken beyond repair >&2\nexit 3\n")
    program.chmod(0o755)
    monkeypatch.setenv(VARIABLE, str(program))
    with pytest.raises(PrintError, match=r"printed nothing \(exit status 3: broken beyond repair\)") as caught:
        print_page(tmp_path / "page.html", tmp_path / "page.pdf")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "page.pdf").exists()
