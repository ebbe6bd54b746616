"""The story: every number of it stands in summary.json, and no other number does; the words link to the glossary."""

import html
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up import page_of

from flipproof.build import ask_of
from flipproof.chapters import chapters_named
from flipproof.chapters.agreement.chapter import UP_TO
from flipproof.chapters.maps.study import RUNGS, Reading, plan_map, study_readings
from flipproof.figures.style import Drawing
from flipproof.frame.equations import NAMES
from flipproof.frame.flights import Flights, Outcome
from flipproof.frame.gather import Gathered, Stages
from flipproof.page.glossary import TERMS, anchor, linked
from flipproof.page.live import sliders
from flipproof.page.parts import STORY
from flipproof.page.verdict import CHANGES, EXPERIMENTS, Summary, story
from slicemodel import Scenario

SOLVERS = ("published-python", "eq8", "free-flight")
KEPT = Path(__file__).parents[2] / "reports" / "snapshot" / "summary.json"
NAMED = re.compile(
    r"Eqs?\. \d+[a-z]?|\(9[ad]\)|Fig\. \d\w*|1000 (?:<em>)?time steps|r_CM|M_w|≤ 10⁻⁶ %|Up to 1 % counts as small"
    r"|1000 steps|numerical error below 0\.001 %|arXiv:2407\.20627"
)
"""Digits that are names: of equations and figures, of the published program's steps, and limits that we set."""


def screens(page):
    """Return the sections of the story as HTML."""
    wanted = [name for name in STORY if f'<section id="{name}"' in page]
    return {
        name: re.search(rf'<section id="{name}" class="screen[^"]*">(.*?)</section>', page, re.S).group(1)
        for name in wanted
    }


def looked_up(summary, place):
    found = summary
    for key in place.split("/"):
        if isinstance(found, list):
            (found,) = [entry for entry in found if key in (entry.get("id"), entry.get("name"))]
        else:
            found = found[key]
    return found


def again(summary, source):
    """Compute the value of a source a second time, by other code than the page's."""
    words = source.split()
    if words[0] == "length":
        return len(looked_up(summary, words[1]))
    if words[0] == "count":
        place, field, wanted = words[1], words[2], words[3]
        total = 0
        for entry in looked_up(summary, place):
            value = looked_up(entry, field)
            if isinstance(value, list):
                total += wanted in value
            elif wanted.endswith("*"):
                total += value.startswith(wanted.rstrip("*"))
            else:
                total += value == wanted
        return total
    if ":" in words:
        return looked_up(summary, words[0]) / looked_up(summary, words[2])
    return looked_up(summary, source)


def as_printed(text):
    """Return the number that a reader reads, and half a unit of its last digit."""
    clean = text.replace("−", "-").replace("+", "").replace("°", "").strip()
    share = clean.endswith("%")
    clean = clean.removesuffix("%").strip()
    clean = clean.replace(" × 10", "e").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    value = float(clean)
    mantissa, _, exponent = clean.partition("e")
    digits = len(mantissa.partition(".")[2])
    unit = 0.5 * 10.0 ** (int(exponent or 0) - digits)
    if "." not in mantissa and not exponent:
        unit = max(unit, 0.5 * 10 ** max(0, len(mantissa.lstrip("-")) - 2))
    return (value / 100, unit / 100) if share else (value, unit)


@pytest.fixture
def marked(report):
    summary = json.loads(json.dumps(report.summary))
    detail = re.search(r'<section id="detail".*?</section>', report.pages["evidence.html"], re.S).group()
    found = re.findall(
        r'<data value="([^"]*)" data-source="([^"]*)">([^<]*)</data>',
        "".join((*screens(report.pages["index.html"]).values(), detail)),
    )
    return summary, [(float(value), html.unescape(source), html.unescape(text)) for value, source, text in found]


def test_every_number_of_the_story_is_computed_again_from_the_summary(marked):
    summary, numbers = marked
    assert len(numbers) > 50
    for value, source, text in numbers:
        assert again(summary, source) == value, source
        printed, half = as_printed(text)
        assert abs(printed - value) <= half * 1.001, (source, text, value)


def test_no_other_number_stands_in_the_story(report):
    for name, screen in screens(report.pages["index.html"]).items():
        screen = re.sub(r'src="data:[^"]*"', "", screen)
        for part in ("svg", "script", "math", "data", "style", "fieldset", "output"):
            screen = re.sub(rf"<{part}\b.*?</{part}>", "", screen, flags=re.S)
        screen = re.sub(r'<p class="soft">(The throw: |flipproof ).*?</p>', "", screen, flags=re.S)
        words = NAMED.sub(
            "", html.unescape(re.sub(r"<[^>]*>", "", NAMED.sub("", screen))).replace("\N{NO-BREAK SPACE}", " ")
        )
        words = NAMED.sub("", re.sub(r"\s+", " ", words))
        assert re.findall(r"[^ ]*\d[^ ]*", words) == [], name


def test_what_the_snapshot_found_is_told_in_full():
    """The snapshot is a full report's summary without its solvers and the paper: those are made up."""
    experiment = [
        {
            "id": id_,
            "closest": ["free-flight"],
            "equations": {solver: {"value": 0.3, "verdict": "fails"} for solver in SOLVERS},
        }
        for id_ in EXPERIMENTS.values()
    ]
    solvers = [{"name": solver, "plateau": 0.3} for solver in SOLVERS]
    kept = json.loads(KEPT.read_text(encoding="utf-8")) | {"solvers": solvers, "paper": {"experiment": experiment}}
    told = story(kept)
    assert [name for name, number in vars(told.n).items() if number is None] == []
    names = ["The time step", "The formulas of the program", "The physics of Eq. 8"]
    assert [layer.name for layer in told.layers] == names
    assert [layer.within for layer in told.layers] == [True, False, False]
    assert len(told.shares) == len(NAMES) == len(CHANGES)
    assert {share.name for share in told.shares} == set(CHANGES) == set(NAMES.values())
    assert told.nearest[0].name == "free flight"
    for name, experiment in told.experiments.items():
        assert all(experiment.values.values()), name
    assert set(told.experiments["landing"].verdicts.values()) == {"fails"}
    assert told.n.threshold.text == "0.1417"


def test_a_summary_with_nothing_in_it_tells_no_numbers():
    told = story({})
    assert told.layers == told.shares == told.nearest == []
    assert told.map is None
    assert [number for name, number in vars(told.n).items() if number is not None and number.value] == []


@pytest.mark.parametrize(
    ("names", "told"), [("free-flight, solve_ivp, pymunk, mujoco", True), ("free-flight, solve_ivp", False)]
)
def test_an_agreement_without_the_engines_is_not_told_as_theirs(names, told):
    found = story({"findings": [{"id": "agreement", "title": f"{names}: all agree", "value": 3e-4}]})
    assert (found.n.agreement is not None) == told
    assert (found.engines.count, found.engines.names) == ("two", "pymunk and MuJoCo")


@pytest.mark.parametrize(("band", "vague"), [(0.009, False), (0.2, True), (None, False)])
def test_an_agreement_that_its_uncertainty_hides_is_said_to_be_vague(band, vague):
    title = "free-flight, solve_ivp, pymunk, mujoco: all agree within their bands"
    found = story({"findings": [{"id": "agreement", "title": title, "value": 1e-3, "band": band}]})
    assert found.engines.vague is vague


def test_an_agreement_before_the_end_of_the_flight_says_up_to_when():
    title = "free-flight, solve_ivp, pymunk, mujoco: all agree within their bands"
    for until in ("", "193 ms"):
        words = f"{title}{UP_TO}{until}" if until else title
        found = story({"findings": [{"id": "agreement", "title": words, "value": 3e-4}]})
        assert found.engines.until == until


def test_sources_find_entries_and_say_when_there_are_none():
    summary = Summary({"a": [{"id": "x", "b": 2.0, "c": ["p", "q"]}, {"name": "y", "b": "nan", "c": ["q"]}]})
    assert summary.evaluate("a/x/b") == 2.0
    assert summary.evaluate("a/y/b") is None
    assert summary.evaluate("a/z/b") is None
    assert summary.evaluate("count a c q") == 2
    assert summary.evaluate("count a c p") == 1
    assert summary.evaluate("length a") == 2


def test_sliders_reach_the_throw_they_begin_at():
    for throw in (Scenario(), Scenario(omega0=45.0, gravity=0.0, restitution=0.97, water_mass=0.05)):
        for slider in sliders(throw):
            assert slider.low <= slider.value <= slider.high


# ---------------------------------------------------------------------- glossary


def test_every_term_has_a_sentence_and_a_place_of_its_own(report):
    places = [anchor(term) for term in TERMS]
    assert len(set(places)) == len(places)
    for term, words in TERMS.items():
        assert words.endswith("."), term
        assert f'<dt id="{anchor(term)}">' in report.pages["evidence.html"]
    for row in report.summary["solvers"]:
        assert row["name"] in TERMS, row["name"]


def test_the_first_appearance_of_a_term_is_a_link_and_nothing_inside_a_link_or_a_script():
    made = linked(
        '<p>recoil and <a href="#x">free flight</a> and recoil</p><script>if (a < recoil) b</script><p>ice</p>'
    )
    assert made.count('href="#term-recoil"') == 1
    assert "term-free-flight" not in made
    assert "a < recoil) b</script>" in made
    assert 'href="#term-ice"' in made
    assert linked("<p>ω₀ is not ω</p>").count('class="term"') == 2


def test_evidence_links_its_words(report):
    body = re.search(r'<section id="steps".*?</section>', report.pages["evidence.html"], re.S).group()
    assert body.count('class="term"') > 3


def test_the_story_draws_the_map_of_bottles_as_it_was_computed():
    """Small reports have no maps: this one has nothing else."""
    throw = Scenario().with_slices(4)
    fills, dampings = (0.3, 0.6, 0.9), (0.02, 0.1, 0.5)
    lost = next(run for run in plan_map(throw, "gamma", fills, dampings) if run.solver == "eq8")
    readings = {
        run: Reading(level=len(run.solver) / 64 + run.scenario.fill_fraction / 8 + run.scenario.damping_rate / 512)
        for run in plan_map(throw, "gamma", fills, dampings)
        if run != lost
    }
    shares = np.zeros((len(RUNGS), 3, 3))
    for k, at in enumerate(np.ndindex(3, 3)):
        shares[k % len(RUNGS), *at] = 0.1
    shares[:, 0, 0] = np.nan
    study = replace(study_readings(throw, "gamma", fills, dampings, readings), shares=shares)
    outcome = Outcome({"gamma": Outcome(study), "step": Outcome(None, "no memory")})
    ask = ask_of(throw, "full")
    gathered = Gathered(
        ask=ask, parts=chapters_named("maps"), outcomes={"maps": outcome}, flights=Flights({}), stages=Stages()
    )
    pages = page_of(gathered, Drawing("<svg/>", b""))
    drawn = json.loads(re.search(r'id="map-data">(.*?)</script>', pages["index.html"], re.S).group(1))
    assert (drawn["fills"], drawn["dampings"]) == (list(fills), list(dampings))
    assert drawn["solvers"] == ["published-python", "eq8", "free-flight"]
    assert drawn["numbers"] == {name: k for k, name in enumerate(RUNGS, start=1)}
    assert drawn["thrown"] == pytest.approx([throw.fill_fraction, throw.damping_rate / throw.omega0])
    assert len(drawn["cells"]) == 9
    for cell in drawn["cells"]:
        at = dampings.index(cell["y"]), fills.index(cell["x"])
        assert cell["which"] == ("" if at == (0, 0) else RUNGS[(3 * at[0] + at[1]) % len(RUNGS)])
        means = [pytest.approx(study.level[name][at], abs=1e-8, rel=0.0) for name in drawn["solvers"]]
        assert cell["mean"] == ([means[0], None, means[2]] if at == (0, 0) else means)
    # Of 0.25 the nearest in ratio is 0.5, not 0.1: drags are drawn in equal ratios.
    assert drawn["here"] == RUNGS[(3 * 2 + 1) % len(RUNGS)]
