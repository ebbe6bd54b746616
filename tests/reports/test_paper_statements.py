"""Readings and judgements: what a verdict, a margin and a band are, and how they are printed."""

import math
from dataclasses import replace

import pytest

from flipproof.paper.statements import Judgement, Reading, Statement
from flipproof.paper.verdicts import CLAIMS


@pytest.mark.parametrize(
    ("value", "band", "low", "verdict"),
    [
        (0.05, 0.0, -math.inf, "holds"),
        (0.1, 0.0, -math.inf, "holds"),
        (0.11, 0.0, -math.inf, "fails"),
        (0.09, 0.005, -math.inf, "holds"),
        (0.099, 0.005, -math.inf, "cannot be decided"),
        (0.101, 0.005, -math.inf, "cannot be decided"),
        (0.106, 0.005, -math.inf, "fails"),
        (math.nan, 0.0, -math.inf, "cannot be decided"),
        (0.0, math.nan, -math.inf, "cannot be decided"),
        (0.0, math.inf, -math.inf, "cannot be decided"),
        (0.03, 0.01, 0.05, "fails"),
        (0.07, 0.01, 0.05, "holds"),
        (0.12, 0.01, 0.05, "fails"),
    ],
)
def test_a_reading_is_undecided_only_where_its_band_reaches_the_threshold(value, band, low, verdict):
    reading = Reading(name="x", value=value, unit="m", admissible=(low, 0.1), band=band)
    assert reading.verdict == verdict
    assert Judgement(solver="s", readings=(reading,)).verdict == verdict


@pytest.mark.parametrize(
    ("value", "band", "text"),
    [
        (0.12345, 0.0, "0.123"),
        (0.12345, 0.004, "0.123 ± 0.004"),
        (0.12345, 0.03, "0.12 ± 0.03"),
        (0.0705, 1e-7, "0.0705"),
        (-9.95e-6, 0.003, "0.000 ± 0.003"),
        (-0.62, 0.02, "−0.62 ± 0.02"),
        (-2.3, 0.0, "−2.3"),
        (123.4, 20.0, "123 ± 20"),
        (0.0, 0.0, "0"),
        (math.nan, 0.1, "–"),
        (1.5, math.nan, "1.5"),
    ],
)
def test_a_number_shows_what_its_band_leaves_of_it(value, band, text):
    assert Reading(name="x", value=value, unit="", admissible=(0.0, 1.0), band=band).value_text == text


def test_a_judgement_fails_with_its_first_failing_reading_and_holds_with_all():
    good, open_, bad = (
        Reading(name=n, value=v, unit="", admissible=(0.0, 1.0), band=0.1)
        for n, v in (("good", 0.5), ("open", 1.05), ("bad", 2.0))
    )
    assert Judgement(solver="s", readings=(good, good)).verdict == "holds"
    assert Judgement(solver="s", readings=(good, open_)).verdict == "cannot be decided"
    assert Judgement(solver="s", readings=(good, open_)).deciding is open_
    judgement = Judgement(solver="s", readings=(good, open_, bad))
    assert (judgement.verdict, judgement.deciding) == ("fails", bad)
    assert bad.threshold_text == "0 to 1"
    assert "needed 0 to 1" in bad.words
    nothing = Judgement(solver="s", aside="no flight")
    assert nothing.verdict == "cannot be decided"
    assert nothing.deciding is None
    assert nothing.words == "no flight"


@pytest.mark.parametrize(
    ("value", "band", "admissible", "margin", "marginal"),
    [
        (0.0497, 0.0, (-math.inf, 0.05), 0.0003, True),  # within a tenth of the threshold
        (0.0449, 0.0, (-math.inf, 0.05), 0.0051, False),
        (0.0552, 0.0, (-math.inf, 0.05), -0.0052, False),
        (0.0549, 0.0, (-math.inf, 0.05), -0.0049, True),
        (0.04, 0.006, (-math.inf, 0.05), 0.01, True),  # within a tenth and its band
        (0.12, 0.0, (0.1, math.inf), 0.02, False),
        (0.109, 0.0, (0.1, math.inf), 0.009, True),
        (1.97, 0.0, (1.8, 2.2), 0.17, False),  # of an interval, half the width is its size
        (2.19, 0.0, (1.8, 2.2), 0.01, True),
        (2.17, 0.0, (1.8, 2.2), 0.03, False),
        (1.0, 0.0, (1.8, 2.2), -0.8, False),
        (0.001, 0.0, (0.0, math.inf), 0.001, False),  # a comparison has no size, only its band
        (0.001, 0.002, (0.0, math.inf), 0.001, True),
        (0.0, 0.0, (-math.inf, 0.0), 0.0, False),
        (math.nan, 0.0, (0.0, 1.0), math.nan, False),
        (0.0, math.nan, (0.0, 1.0), 0.0, False),
    ],
)
def test_a_number_is_marginal_where_its_band_or_a_tenth_reaches_the_threshold(
    value, band, admissible, margin, marginal
):
    reading = Reading(name="x", value=value, unit="m", admissible=admissible, band=band)
    assert reading.margin == pytest.approx(margin, nan_ok=True)
    assert reading.marginal is marginal
    assert ("marginal" in reading.words) is marginal
    assert reading.to_mapping()["marginal"] is marginal
    if reading.verdict == "cannot be decided" and math.isfinite(value + band):
        assert reading.marginal


def test_margins_are_printed_with_sign_and_unit():
    def text(value, low=-math.inf, high=0.05):
        return Reading(name="x", value=value, unit="m", admissible=(low, high)).margin_text

    assert text(0.0497) == "margin +0.0003 m, marginal"
    assert text(0.2) == "margin −0.15 m"
    assert text(150.0, high=0.0) == "margin −150 m"
    assert text(0.0, high=0.0) == "margin 0 m"
    assert text(math.nan) == "no margin"
    assert Reading(name="x", value=0.0497, unit="m", admissible=(-math.inf, 0.05)).margin_number == "+0.0003"
    assert Reading(name="x", value=math.nan, unit="m", admissible=(-math.inf, 0.05)).margin_number == "–"


def test_a_statement_holds_as_clearly_as_its_most_marginal_number_and_fails_as_its_clearest():
    clear, near, off, far = (
        Reading(name=n, value=v, unit="", admissible=(-math.inf, 1.0))
        for n, v in (("clear", 0.5), ("near", 0.95), ("off", 1.05), ("far", 2.0))
    )
    assert Judgement(solver="s", readings=(clear, near)).deciding is near
    assert Judgement(solver="s", readings=(clear, near)).marginal
    assert not Judgement(solver="s", readings=(clear, clear)).marginal
    assert Judgement(solver="s", readings=(off, far)).deciding is far
    assert not Judgement(solver="s", readings=(off, far, near)).marginal
    assert Judgement(solver="s", readings=(clear, off)).marginal


def test_a_limit_that_the_paper_admits_is_neither_success_nor_failure():
    inside, outside = (
        Judgement(solver=s, readings=(Reading(name="x", value=v, unit="", admissible=(-math.inf, 0.8)),))
        for s, v in (("a", 0.4), ("b", 0.95))
    )
    limit = Statement(
        id="x", place="section 1", says="A.", means="B.", throw="any", why="C.", read=iter, kind="admitted limit",
        judgements=(inside, outside),
    )  # fmt: skip
    claimed = replace(limit, kind="claim")
    assert [limit.word(each) for each in limit.judgements] == ["has this limit", "is free of it"]
    assert [limit.colour(each) for each in limit.judgements] == ["soft", "soft"]
    assert {limit.sign(each) for each in limit.judgements} == {"•"}
    assert [claimed.word(each) for each in claimed.judgements] == ["holds", "fails"]
    assert [claimed.colour(each) for each in claimed.judgements] == ["pass", "fail"]
    assert [claimed.sign(each) for each in claimed.judgements] == ["✓", "✗"]
    assert limit.to_mapping()["kind"] == "admitted limit"
    assert "has this limit" in next(limit.findings()).title
    assert {each.id for each in CLAIMS if each.kind == "admitted limit"} == {
        "full-slows", "tenth-slows", "low-filling-change"
    }  # fmt: skip


def test_every_statement_says_where_it_stands_what_is_measured_on_which_throw_and_why_so():
    for each in CLAIMS:
        assert all((each.place, each.says, each.means, each.throw, each.why)), each.id
        assert each.place.startswith("section"), each.id
        assert each.says.endswith("."), each.id
        assert each.means.endswith("."), each.id
        assert not each.judges or each.silent, each.id
    assert len({each.id for each in CLAIMS}) == len(CLAIMS)


def test_findings_of_statements_cannot_fail_a_report():
    bad = Judgement(solver="s", readings=(Reading(name="x", value=2.0, unit="m", admissible=(0.0, 1.0)),))
    statement = Statement(
        id="a", place="section 1", says="A.", means="B.", throw="any", why="C.", read=iter, kind="claim",
        judgements=(bad, Judgement(solver="t")),
    )  # fmt: skip
    first, second = statement.findings()
    assert (first.kind, first.failed, first.value) == ("observation", False, 2.0)
    assert second.value is None
    mapping = statement.to_mapping()["judgements"][0]
    assert mapping["verdict"] == "fails"
    assert mapping["readings"][0]["admissible"] == [0.0, 1.0]
