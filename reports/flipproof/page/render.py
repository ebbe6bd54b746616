"""The page: one self-contained HTML file, made from a template and nothing fetched."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from flipproof.chapters.differences.study import Difference, moved, percent
from flipproof.frame.gather import Gathered, Told
from flipproof.frame.solvers import find
from flipproof.page.equations import equation, mathematics, numbers, typeset
from flipproof.page.glossary import EQUATIONS, TERMS, anchor, symbols
from flipproof.page.headlines import headlines
from flipproof.page.lead import answer, answers, lead_words
from flipproof.page.live import live_data, sliders, touch_data
from flipproof.page.parts import STORY, behind, sections, shared
from flipproof.page.story import story
from flipproof.page.templating import environment


def unbroken(text: str) -> str:
    """Return text in which no line ends between a sign of equality or a number and what belongs to it."""
    between = r"(?<==) (?=[\d−])|(?<=\bEq\.) (?=\d)|(?<=\d) (?=(?:%|ms|s|rad)\b|%)| (?== )"
    return re.sub(between, "\N{NO-BREAK SPACE}", text)


def amount(difference: Difference) -> str:
    """Return the size of a difference, its numerical band, and where known how far it moves with more slices.

    As in "13 % ± 0.03 %; 0.35 % of ω₀ less at N = 100".
    """
    size = percent(difference.largest)
    if difference.band is not None:
        band = 100 * difference.band
        size += f" ± {band:.1g} %" if band >= 1e-3 else " ± < 0.001 %"
    if difference.finer is not None:
        slices, largest = difference.finer
        size += f"; {moved(difference.largest, largest, slices)}"
    return size


def short(value: float | None) -> str:
    """Return a number with two digits, a dash if there is none."""
    if value is None:
        return "–"
    return str(value) if isinstance(value, int) else f"{value:.2g}"


def restitution_error(certificate: Mapping[str, Any]) -> float | None:
    """Return the largest |measured - asked| restitution of a certificate; None if none was measured."""
    errors = [abs(r["measured"] - r["asked"]) for r in certificate["restitution"] if r["measured"] is not None]
    return max(errors, default=None)


def read_assets() -> dict[str, Markup]:
    """Return the style sheets and scripts of the page, file name -> text."""
    items = (files("flipproof.page") / "assets").iterdir()
    return {
        item.name: Markup(item.read_text(encoding="utf-8")) for item in items if item.name.endswith((".css", ".js"))
    }


def render(
    gathered: Gathered, told: Mapping[str, Told], provenance: Mapping[str, str], summary: Mapping[str, Any]
) -> str:
    """Return the whole page; ``summary``, which its story is told from, is that of the report."""
    templates = environment()
    templates.filters |= {
        "typeset": typeset, "unbroken": unbroken, "amount": amount, "percent": percent, "touch_data": touch_data,
        "short": short, "restitution_error": restitution_error, "term_anchor": anchor, "equation": equation,
        "shared": shared, "symbols": symbols, "mathematics": mathematics, "numbers": numbers,
    }  # fmt: skip
    templates.globals["assets"] = read_assets()
    verdict = headlines(gathered)
    findings = [finding for each in told.values() for finding in each.findings]
    regressions = [finding for finding in findings if finding.kind == "regression"]
    flown = gathered.found("flights")
    facts = story(summary, {figure.name: figure.table for each in told.values() for figure in each.figures})
    asked = sliders(gathered.ask.throw)
    context = dict(
        scenario=gathered.ask.scenario,
        throw=gathered.ask.throw,
        answer=answer(verdict),
        lead=lead_words(verdict),
        answers=tuple(answers(verdict)),
        regressions=regressions,
        failed=[finding for finding in regressions if finding.failed],
        solvers=flown.rows if flown is not None else [],
        problems=[made for made in gathered.flights.values() if made.trajectory is None],
        notes=[note for each in told.values() for note in each.notes],
        motion=flown.motion if flown is not None else None,
        measured=gathered.found("measured"),
        provenance=provenance,
        settings=gathered.ask.scenario.to_toml(),
        terms=TERMS,
        formulas={term: find(solver).equation for term, solver in EQUATIONS.items()},
        story=facts,
        story_ids=STORY,
        sliders=asked,
        slider_of={one.name: one for one in asked},
        live=live_data(gathered.ask.throw),
    )
    parts = sections(gathered, told, templates)
    body = (*parts, *behind(parts, templates, context))
    left_out = {"motion-story": not context["motion"], "shares": not facts.shares, "bottles": not facts.map}
    screens = [(id_, words) for id_, words in STORY.items() if not left_out.get(id_)]
    return templates.get_template("report.html.j2").render(
        context, contents=[*screens, *((section.id, section.title) for section in body)], sections=body
    )
