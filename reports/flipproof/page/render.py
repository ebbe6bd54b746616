"""The pages: two self-contained HTML files, the story and its evidence, made from templates and nothing fetched."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from flipproof.chapters.differences.study import Difference, moved, percent
from flipproof.frame.gather import ChapterResult, Gathered
from flipproof.frame.solvers import find
from flipproof.output.templating import environment
from flipproof.page.equations import equation, mathematics, typeset
from flipproof.page.glossary import EQUATIONS, TERMS, anchor, symbols
from flipproof.page.live import live_data, sliders, touch_data
from flipproof.page.parts import STORY, behind, sections, shared
from flipproof.page.verdict import answer, headlines, lead, signed, story


def unbroken(text: str) -> str:
    """Return text in which no line ends between a sign of equality or a number and what belongs to it."""
    between = r"(?<==) (?=[\d−])|(?<=\bEq\.) (?=\d)|(?<=\d) (?=(?:%|ms|s|rad)\b|%)| (?== )"
    return re.sub(between, "\N{NO-BREAK SPACE}", text)


def amount(difference: Difference) -> str:
    """Return the size of a difference, its numerical band, and where known how far it moves with more slices.

    As in "13 % ± 0.032 %; 0.35 % of ω₀ less at N = 100".
    """
    size = percent(difference.largest)
    if difference.band is not None:
        size += f" ± {percent(difference.band)}" if difference.band >= 1e-5 else " ± < 0.001 %"
    if difference.finer is not None:
        slices, largest = difference.finer
        size += f"; {moved(difference.largest, largest, slices)}"
    return size


def short(value: float | None) -> str:
    """Return a number with two digits, a dash if there is none."""
    if value is None:
        return "–"
    return str(value) if isinstance(value, int) else f"{value:.2g}"


def restitution_error(certificate: Mapping[str, Any], *, still: bool) -> float | None:
    """Return the largest |measured - asked| restitution of a certificate, of e = 0 or of all other e; None without any.

    What is measured with e = 0 is a slice that stays on the end: as it settles, it moves.
    """
    measured = [r for r in certificate["restitution"] if r["measured"] is not None and (r["asked"] == 0.0) == still]
    return max((abs(r["measured"] - r["asked"]) for r in measured), default=None)


def read_assets() -> dict[str, Markup]:
    """Return the style sheets and scripts of the page, file name -> text."""
    items = (files("flipproof.page") / "assets").iterdir()
    return {
        item.name: Markup(item.read_text(encoding="utf-8")) for item in items if item.name.endswith((".css", ".js"))
    }


def render(
    gathered: Gathered, results: Mapping[str, ChapterResult], provenance: Mapping[str, str], summary: Mapping[str, Any]
) -> dict[str, str]:
    """Return the pages by the names of their files; ``summary``, which the story prints from, is that of the report."""
    templates = environment()
    templates.filters |= {
        "typeset": typeset, "unbroken": unbroken, "amount": amount, "percent": percent, "touch_data": touch_data,
        "short": short, "restitution_error": restitution_error, "term_anchor": anchor, "equation": equation,
        "shared": shared, "symbols": symbols, "mathematics": mathematics, "signed": signed,
    }  # fmt: skip
    templates.globals["assets"] = read_assets()
    verdict = headlines(gathered)
    findings = [finding for result in results.values() for finding in result.findings]
    figures = {figure.name: figure for result in results.values() for figure in result.figures}
    regressions = [finding for finding in findings if finding.kind == "regression"]
    flown = gathered.result("flights")
    maps = gathered.result("maps") or {}
    facts = story(summary, maps["gamma"].result if "gamma" in maps else None)
    controls = sliders(gathered.ask.throw)
    context = dict(
        scenario=gathered.ask.scenario,
        throw=gathered.ask.throw,
        answer=answer(verdict),
        lead=lead(verdict),
        headlines=verdict,
        regressions=regressions,
        failed=[finding for finding in regressions if finding.failed],
        solvers=flown.rows if flown is not None else [],
        problems=[flight for flight in gathered.flights.values() if flight.trajectory is None],
        notes=[note for result in results.values() for note in result.notes],
        motion=flown.motion if flown is not None else None,
        measured=gathered.result("measured"),
        provenance=provenance,
        settings=gathered.ask.scenario.to_toml(),
        terms=TERMS,
        formulas={term: find(solver).equation for term, solver in EQUATIONS.items()},
        story=facts,
        omega=figures.get("omega"),
        sliders=controls,
        slider_of={slider.name: slider for slider in controls},
        live=live_data(gathered.ask.throw),
    )
    parts = sections(gathered, results, templates)
    screens = [(id_, words) for id_, words in STORY.items() if id_ != "bottles" or facts.map]
    body = (*parts, *behind(parts, templates, context))
    contents = [("evidence", "The verdict in numbers"), *((section.id, section.title) for section in body)]
    return {
        "index.html": templates.get_template("story.html.j2").render(context, contents=screens),
        "evidence.html": templates.get_template("evidence.html.j2").render(context, contents=contents, sections=body),
    }
