"""The page: one self-contained HTML file, made from a template and nothing fetched."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from flipproof.evidence import FLIGHTS, Evidence
from flipproof.exhibits_work_precision import tabulate_work_precision
from flipproof.frame.exhibit import Exhibit
from flipproof.frame.findings import Finding
from flipproof.frame.twins import BAND_WORDS
from flipproof.instruments import witnesses
from flipproof.output.summary import summarise
from flipproof.page.glossary import TERMS
from flipproof.page.glossary import anchor as term_anchor
from flipproof.page.headlines import headlines
from flipproof.page.inline import data_uri, shape
from flipproof.page.lead import answer, answers, lead_words
from flipproof.page.sections import EVIDENCE, STORY, folded, grouped
from flipproof.page.story.facts import story
from flipproof.page.story.live import live_data, sliders
from flipproof.page.templating import environment
from flipproof.studies.differences import Difference, moved, percent
from flipproof.studies.slices import FINER

CONTENTS = {**STORY, **{id_: title for id_, (title, _) in EVIDENCE.items()}}
"""Section -> its name in the contents, in the order of the page."""

PLACES = {
    "waterfall": "assumptions",
    "frozen": "steps",
    "limit of": "steps",
    "map over": "maps",
    "ledger of": "energy",
    "exact cases": "energy",
    "errata": "errata",
    "agreement": "engines",
    "stability chart": "engines",
    "engine facts": "engines",
    "horizon": "engines",
    "overlap": "engines",
}
"""How the name of a study begins -> the section that tells of its failure; every other stands with the events."""

SYMBOLS = {
    "omega_0": "ω₀", "omega0": "ω₀", "omega": "ω", "theta": "θ", "gamma": "γ", "alpha": "α", "epsilon": "ε",
    "dt -> 0": "Δt → 0", "sum_free ": "Σ_free ", "beta = -": "β = −", "sqrt(": "√(", "^2": "²", " +- ": " ± ",
    "<<": "≪", " - ": " − ", "-gamma": "−γ",
}  # fmt: skip


def typeset(text: str) -> str:
    """Return plain-text mathematics with Greek letters and signs; the command line prints it as it is."""
    pattern = "|".join(re.escape(word) for word in sorted(SYMBOLS, key=len, reverse=True))
    return re.sub(pattern, lambda match: SYMBOLS[match.group()], text)


def unbroken(text: str) -> str:
    """Return text in which no line ends between a sign of equality or a number and what belongs to it."""
    return re.sub(r"(?<==) (?=[\d−])|(?<=\d) (?=(?:%|ms|s|rad)\b|%)| (?== )", "\N{NO-BREAK SPACE}", text)


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
    folder = files("flipproof.page") / "assets"
    return {
        item.name: Markup(item.read_text(encoding="utf-8"))
        for item in folder.iterdir()
        if item.name.endswith((".css", ".js"))
    }


def sort_problems(problems: Mapping[str, str]) -> Mapping[str, Sequence[tuple[str, str]]]:
    """Return section -> studies that failed there, each with its reason."""
    sorted_problems: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for name, reason in problems.items():
        place = next((section for begin, section in PLACES.items() if name.startswith(begin)), "events")
        sorted_problems[place].append((name, reason))
    return sorted_problems


def render(
    evidence: Evidence,
    findings: Sequence[Finding],
    exhibits: Sequence[Exhibit],
    solvers: Sequence[Mapping[str, Any]],
    provenance: Mapping[str, str],
    *,
    summary: Mapping[str, Any] | None = None,
    motion: Any = None,
    paper: Any = None,
    measured: Any = None,
) -> str:
    """Return the whole page.

    ``motion``, ``paper`` and ``measured`` are what their templates draw from; a part that is None is left out.
    ``summary`` is the content of summary.json, which the story is told from; None: made here.
    """
    summary = summary or summarise(evidence, findings, exhibits, solvers, provenance)
    templates = environment()
    templates.filters["typeset"] = typeset
    templates.filters["unbroken"] = unbroken
    templates.filters["amount"] = amount
    templates.filters["percent"] = percent
    templates.filters["data_uri"] = data_uri
    templates.filters["shape"] = shape
    templates.filters["short"] = short
    templates.filters["restitution_error"] = restitution_error
    templates.filters["term_anchor"] = term_anchor
    found = evidence.attribution
    reasons = sort_problems({**found.problems, **evidence.instruments.problems})
    tables = list(tabulate_work_precision(evidence.precision))
    verdict = headlines(evidence)
    regressions = [finding for finding in findings if finding.kind == "regression"]
    told = story(summary, {exhibit.name: exhibit.table for exhibit in exhibits})
    context = dict(
        scenario=evidence.scenario,
        throw=evidence.throw,
        finer=FINER,
        costs=tuple(
            zip(evidence.finite_step, evidence.finite_step_finer or (None,) * len(evidence.finite_step), strict=True)
        ),
        size=evidence.size,
        answer=answer(verdict),
        differences=sorted(evidence.differences, key=lambda difference: -difference.largest),
        lead=lead_words(verdict),
        answers=tuple(answers(verdict)),
        regressions=regressions,
        grouped=grouped(findings),
        failed=[finding for finding in regressions if finding.failed],
        exhibits=exhibits,
        steps=evidence.flights_by_step,
        slices=evidence.slices,
        growths=evidence.growths,
        found=found,
        instruments=evidence.instruments,
        uncertified=[tag for tag in witnesses(evidence.throw) if tag not in evidence.size.bench.certified],
        tables=tables,
        forms_omega=[(pair, forms["omega"]) for pair, forms in found.forms.items()],
        solvers=solvers,
        flown=[row for row in solvers if row["name"] in FLIGHTS],
        problems=[made for made in evidence.made.values() if made.trajectory is None],
        reasons=reasons,
        motion=motion,
        paper=paper,
        assets=read_assets(),
        provenance=provenance,
        twin_words=BAND_WORDS,
        settings=evidence.scenario.to_toml(),
        terms=TERMS,
        measured=measured,
    )
    sections = folded(templates.get_template("evidence.html.j2").render(context), findings, exhibits)
    there = {
        **dict.fromkeys(("verdict", "answer", "live", "survives", "sure"), True),
        "motion-story": motion,
        "shares": told.shares,
        "bottles": told.map,
        **{section.id: True for section in sections},
    }
    return templates.get_template("report.html.j2").render(
        context,
        contents=[(id_, words) for id_, words in CONTENTS.items() if there.get(id_)],
        story_ids=STORY,
        story=told,
        sliders=sliders(evidence.throw),
        live=live_data(evidence.throw),
        sections=sections,
    )
