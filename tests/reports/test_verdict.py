"""The numbers of the verdict: what each is, that every sentence follows from them, and that the README shows them."""

import html
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import pytest

from flipproof.chapters.differences.chapter import BY_ENGINE, EQ8_FREE, FORMULAS, PROGRAM_EQ8, TOTAL, Differences
from flipproof.chapters.differences.study import percent
from flipproof.chapters.finite_step.chapter import EVERYTHING, HELD, LOCATED, WAYS
from flipproof.chapters.waterfall.study import STEP
from flipproof.cli.snapshot import BEGIN, END, PLACE, README, front_page, write_front_page
from flipproof.frame.equations import NAMES
from flipproof.frame.solvers import FINER
from flipproof.page.verdict import Headline, Measure, _pairs, answer, headlines, lead, lines, story

INSTEAD = "For slices, use free flight; for water, half full or more, rods (slices without overlap) are the best guess."

PAIRS = {"whole": TOTAL, "program-eq8": PROGRAM_EQ8, "formulas": FORMULAS, "eq8-free": EQ8_FREE, "engine": BY_ENGINE}


@pytest.fixture(scope="module")
def kept():
    return json.loads((PLACE / "summary.json").read_text(encoding="utf-8"))


def of(summary):
    return {mapping["id"]: Headline.from_mapping(mapping) for mapping in summary["headlines"]}


def made_up(id_="whole", value=0.13, **changes):
    headline = Headline(id=id_, what="gravity in Eq. 8", measure="largest", value=value, slices=50)
    return replace(headline, **changes)


# ---------------------------------------------------------------------- each number is what its name says


def check_against_the_rest(summary):
    """Every headline is computed a second time from the summary's own differences and findings."""
    found = of(summary)
    differences = {d["name"]: d for d in summary["differences"]}
    findings = {f["id"]: f for f in summary["findings"]}
    for id_, name in PAIRS.items():
        difference = differences[name]
        assert found[id_].value == difference["largest"]
        assert found[id_].slices == difference["slices"] == summary["slices"]
        finer = difference["finer"] or {"slices": None, "largest": None}
        assert (found[id_].finer_slices, found[id_].finer) == (finer["slices"], finer["largest"])
        tag = f"difference-{difference['first']}-{difference['second']}".replace(" ", "-")
        assert findings[tag]["value"] == found[id_].value
    rungs = [d for d in summary["differences"] if d["name"] == found["pair"].what]
    assert [d["largest"] for d in rungs] == [found["pair"].value]
    assert findings[f"finite-step-{EVERYTHING}"]["value"] == found["step"].value
    assert findings[f"finite-step-{LOCATED}"]["value"] == found["held"].value
    shares = [h for h in found.values() if re.fullmatch(r"share(-\d)?", h.id)]
    assert len(shares) == 6
    assert [abs(h.value) for h in shares] == sorted((abs(h.value) for h in shares), reverse=True)
    assert all(h.low <= h.value <= h.high for h in shares)
    plateau = findings["waterfall-plateau"]
    step = plateau["value"] - sum(h.value for h in shares)
    assert abs(step) <= 0.01  # what is left is the share of the step
    assert f"{found['share'].what}, {found['share'].value:+.3g}" in plateau["note"]


def test_the_snapshots_numbers_are_those_of_its_differences_and_findings(kept):
    check_against_the_rest(kept)


def test_a_fresh_reports_numbers_are_those_of_its_differences_and_findings(report, gathered):
    check_against_the_rest(report.summary)
    found = {headline.id: headline for headline in headlines(gathered)}
    assert found == of(report.summary)
    waterfall = gathered.result("waterfall")[0]
    bars = {bar.name: bar for bar in waterfall.bars if bar.name != STEP}
    best = max(bars.values(), key=lambda bar: abs(bar.average))
    share = found["share"]
    assert (share.what, share.value, share.low, share.high) == (best.name, best.average, best.low, best.high)
    assert (share.slices, share.finer, share.finer_slices) == (
        waterfall.slices, best.finer, FINER * waterfall.slices,
    )  # fmt: skip


@pytest.mark.parametrize("id_", ["whole", "program-eq8", "formulas", "eq8-free", "pair", "share", "held", "step"])
def test_every_number_stands_at_two_numbers_of_slices(kept, id_):
    headline = of(kept)[id_]
    assert headline.finer_slices == FINER * headline.slices
    assert math.isfinite(headline.finer)


# ---------------------------------------------------------------------- lead and front page follow from them


def test_the_lead_is_made_of_the_headlines(kept, report):
    for summary in (kept, report.summary):
        assert summary["lead"] == lead(list(of(summary).values()))


def test_every_percentage_of_lead_and_front_page_is_a_headline(kept, report):
    """1 % is the limit that the answer is held against; nothing else may stand there."""
    for summary in (kept, report.summary):
        found = of(summary).values()
        numbers = {n for headline in found for n in (headline.value, headline.finer, headline.band) if n is not None}
        allowed = {"1 %", *(percent(number) for number in numbers)}
        shown = []
        for text in (summary["lead"], front_page(summary)):
            shown += re.findall(r"[+−]?\d[\d.e+-]* %", " ".join(text.split()))
        assert len(shown) > 15
        assert {number for number in shown if number not in allowed} == set()


def test_the_story_shows_the_same_answer(report):
    text = html.unescape(report.pages["index.html"])
    assert f'<p class="answer">{answer(list(of(report.summary).values()))}</p>' in text


def test_the_readme_says_what_the_snapshot_found(kept):
    """``python -m flipproof.cli.snapshot`` writes both."""
    _, _, rest = README.read_text(encoding="utf-8").partition(BEGIN)
    assert rest.partition(END)[0].strip() == front_page(kept).strip()


def test_numbers_that_go_with_the_snapshot_stand_nowhere_else_in_the_readme():
    """The figure of the exact solution has a line of its own."""
    readme = re.sub(r"<!-- exact:.*?<!-- end of exact -->", "", README.read_text(encoding="utf-8"), flags=re.DOTALL)
    before, _, rest = readme.partition(BEGIN)
    assert not re.search(r"\d %\s+of omega_0", before + rest.partition(END)[2])


def test_the_front_page_is_written_between_its_marks_and_nowhere_else(kept, tmp_path):
    readme = tmp_path / "README.md"
    readme.write_text(f"above\n{BEGIN}\nold\n{END}\nbelow\n", encoding="utf-8")
    write_front_page(kept, readme)
    assert readme.read_text(encoding="utf-8") == f"above\n{BEGIN}\n{front_page(kept)}{END}\nbelow\n"
    readme.write_text("no marks", encoding="utf-8")
    with pytest.raises(ValueError, match="has no <!-- findings"):
        write_front_page(kept, readme)
    with pytest.raises(ValueError, match="cannot be read"):
        write_front_page(kept, Path(tmp_path / "nowhere.md"))


def test_headlines_come_back_from_json():
    for headline in (made_up(), made_up(value=math.inf, finer=0.1, finer_slices=100, low=-0.1, high=0.2, time=0.3)):
        mapping = json.loads(json.dumps({**headline.to_mapping(), "value": str(headline.value)}))
        assert Headline.from_mapping(mapping) == headline
    assert set(get_args(Measure)) == {"largest", "share"}


# ---------------------------------------------------------------------- sentences


def test_five_lines_say_what_the_numbers_say():
    said = dict(
        lines(
            [
                made_up(value=0.13, finer=0.12, finer_slices=100),
                made_up("program-eq8", 0.42),
                made_up("eq8-free", 0.55, note="up to t = 500 ms, where free flight ended"),
                made_up("step", 0.005, note="1000 steps"),
                made_up("held", 0.01),
                made_up("engine", 0.0011, band=0.0098),
            ]
        )
    )
    assert said == {
        "May ω, θ, r_CM and v_CM be held constant over a step?": "Yes: up to 1 %, with rebounds at their own times.",
        "Are 1000 steps enough?": "Yes: up to 0.5 % off what shorter steps approach.",
        "Does the program solve Eq. 8?": "No: up to 42 % off, but only 13 % (N = 100: 12 %) off free flight.",
        "Is Eq. 8 free flight?": "No: up to 55 % apart up to t = 500 ms, where free flight ended.",
        "Does a physics engine agree with free flight?": "Yes, as far as they can tell: up to 0.11 % off, by "
        "pymunk (numerical uncertainty of the two runs: 0.98 %).",
    }


@pytest.mark.parametrize(("whole", "eq8"), [(0.5, 0.42), (0.001, 0.008)], ids=["farther", "both near"])
def test_a_program_that_is_not_nearer_to_free_flight_is_not_said_to_be(whole, eq8):
    words = lead([made_up(value=whole), made_up("program-eq8", eq8)])
    assert "Does the program solve Eq. 8?" in words
    assert "but only" not in words


def test_nothing_is_said_of_ice_or_of_nothing():
    assert list(lines([])) == list(lines([made_up(value=0.0), made_up("pair", 1e-9)])) == []
    assert lead([]).startswith("No verdict")


@pytest.mark.parametrize("weight", [True, False])
@pytest.mark.parametrize("formulas", [0.42, 0.01, None])
@pytest.mark.parametrize("equation", [0.55, 0.01, math.nan])
@pytest.mark.parametrize("step", [0.02, 0.01, math.nan])
def test_the_answer_names_each_of_three_faults_and_no_other(step, equation, formulas, weight):
    found = [made_up("step", step), made_up("eq8-free", equation)]
    found += [made_up("formulas", formulas)] if formulas else []
    words = answer([*found, made_up("pair", 0.55, what="gravity in Eq. 8" if weight else "no recoil in impacts")])
    free, short, solved = equation <= 0.01, step <= 0.01, (formulas or 0.0) <= 0.01
    assert ("is free flight within 1 %" in words) is free
    assert ("gravity slide water" in words) is (weight and not free)
    assert ("is not free flight" in words) is not (weight or free)
    assert ("time step alone moves ω" in words) is not short
    assert ("by up to 2 % of ω₀" in words) is (step == 0.02)
    assert ("than can be computed" in words) is math.isnan(step)
    assert ("solves another equation" in words or "its formulas are not Eq. 8" in words) is not solved
    assert ("steps are short enough" in words) is (short and solved)
    assert words.startswith("Not as it stands") is (short and not (free and solved))
    assert words.endswith(INSTEAD) is not free


def test_only_a_rung_from_eq8_to_free_flight_can_be_what_moves_eq8_most():
    sizes = dict(zip(NAMES.values(), (0.1, 0.2, 0.93, 0.91, 0.05, 0.01), strict=True))
    fields = {"slices": 5, "finer": None, "band": None, "largest_time": 0.1, "first": "a", "second": "b"}
    pairs = tuple(SimpleNamespace(name=name, largest=size, **fields) for name, size in sizes.items())
    (pair,) = _pairs(Differences(pairs=pairs, ended="", missing={}))
    assert (pair.id, pair.what) == ("pair", "gravity in Eq. 8")


@pytest.mark.parametrize(
    ("value", "finer", "said"),
    [
        (0.0, 0.04, " But cut into 100 slices Eq. 8 and free flight differ by up to 4 %."),
        (0.3, 0.003, "differ by only up to 0.3 %."),
        (0.3, 0.2, ""),
    ],
)
def test_more_slices_that_turn_an_answer_round_are_in_it(value, finer, said):
    numbers = [made_up("step", 0.001, finer=0.002, finer_slices=100), made_up("whole", 0.2)]
    words = answer([*numbers, made_up("eq8-free", value, finer=finer, finer_slices=100)])
    assert words.endswith(said)
    assert ("But cut into 100 slices" in words) is bool(said)


@pytest.mark.parametrize(
    ("share", "words"),
    [(0.01, "1 %"), (0.010265, "1.03 %"), (0.0100001, "1.00001 %"), (0.0096, "0.96 %"), (-0.0101, "-1.01 %")],
)
def test_a_number_beyond_the_limit_is_not_printed_as_the_limit(share, words):
    assert percent(share) == words


def test_a_weight_that_moves_nothing_moves_nothing_most():
    still = {"id": "pair", "what": "gravity in Eq. 8", "value": 0.0, "measure": "largest"}
    assert not story({"headlines": [still]}).weight_first
    assert not story({"headlines": [still | {"value": "nan"}]}).weight_first
    for value in (0.1, "inf"):
        assert story({"headlines": [still | {"value": value}]}).weight_first


@pytest.mark.parametrize(("finer", "coarse"), [(0.03, True), (0.2, False), (0.7, True), (None, False)])
def test_a_card_tells_of_more_slices_where_they_halve_or_double_its_number(finer, coarse):
    one = {"id": "eq8-free", "value": 0.3, "finer": finer, "finer_slices": 4, "measure": "largest"}
    (layer,) = story({"headlines": [one]}).layers
    assert layer.coarse is coarse


def test_the_answer_needs_step_and_equation():
    assert answer([made_up("step", 0.005)]).startswith("No verdict")
    assert answer([]).startswith("No verdict")
    ice = [made_up(id_, 1e-13) for id_ in ("step", "eq8-free", "whole", "pair")]
    assert answer(ice).startswith("This throw tells nothing apart")


# ---------------------------------------------------------------------- the finite step


def test_a_step_is_taken_apart_by_changing_one_thing_at_a_time(gathered):
    costs = {cost.way.name: cost for cost in gathered.result("finite-step").costs}
    assert list(costs) == [way.name for way in WAYS]
    # Without the lag the start costs far less; with the lag alone it is most of what the program loses.
    assert 0.0 < 5 * costs[HELD].start < costs[EVERYTHING].start
    # Where nothing strikes an end, where rebounds are answered makes no difference but that of slices at rest.
    assert costs[LOCATED].start == pytest.approx(costs["exact"].start, rel=0.2, abs=0.0)
    # Mending either of two errors is not enough: both are of first order. Mending both is.
    assert costs["neither"].flight < min(costs["waiting"].flight, costs[LOCATED].flight) / 10


def test_what_is_called_everything_is_the_difference_of_the_program_from_its_own_equation(gathered):
    found = {headline.id: headline for headline in headlines(gathered)}
    step = next(
        d
        for d in gathered.result("differences").pairs
        if d.first == "published-python" and d.second == "published-limit"
    )
    assert found["step"].value == pytest.approx(step.largest, rel=1e-12, abs=0.0)
