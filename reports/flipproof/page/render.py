"""The page: one self-contained HTML file, made from a template and nothing fetched."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from jinja2 import Environment
from markupsafe import Markup

from flipproof.chapters.differences.study import Difference, moved, percent
from flipproof.frame.gather import Gathered, Told
from flipproof.page.headlines import headlines
from flipproof.page.inline import data_uri, shape
from flipproof.page.lead import answers, lead_words
from flipproof.page.parts import sections
from flipproof.page.templating import environment
from flipproof.page.verdict import answer, strips, tiles

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


def render(gathered: Gathered, told: Mapping[str, Told], provenance: Mapping[str, str], *, explore: Any = None) -> str:
    """Return the whole page; ``explore`` is what its template draws from, and a part that is None is left out."""
    templates = page_environment()
    body = sections(gathered, told, templates)
    verdict = headlines(gathered)
    waterfalls = gathered.found("waterfall")
    findings = [finding for each in told.values() for finding in each.findings]
    regressions = [finding for finding in findings if finding.kind == "regression"]
    flown = gathered.found("flights")
    ahead = [("verdict", "Verdict"), *((section.id, section.title) for section in body)]
    behind = [("findings", "All findings"), ("solvers", "Every solver"), ("provenance", "Settings and provenance")]
    return templates.get_template("report.html.j2").render(
        scenario=gathered.ask.scenario,
        throw=gathered.ask.throw,
        contents=[*ahead, *([("throws", "Explore other throws")] if explore else []), *behind],
        sections=body,
        answer=answer(verdict),
        tiles=tiles(verdict),
        waterfall=waterfalls[0] if waterfalls else None,
        strips=strips(waterfalls[0]) if waterfalls else (),
        lead=lead_words(verdict),
        answers=tuple(answers(verdict)),
        regressions=regressions,
        observations=[finding for finding in findings if finding.kind == "observation"],
        failed=[finding for finding in regressions if finding.failed],
        solvers=flown.rows if flown is not None else [],
        problems=[made for made in gathered.flights.values() if made.trajectory is None],
        notes=[note for each in told.values() for note in each.notes],
        explore=explore,
        assets=read_assets(),
        provenance=provenance,
        settings=gathered.ask.scenario.to_toml(),
    )


def page_environment() -> Environment:
    """Return the environment of the page's templates, with the filters that they and the chapters' parts use."""
    templates = environment()
    templates.tests["about_the_paper"] = lambda id_: id_.startswith("paper-")
    templates.filters |= {
        "typeset": typeset, "unbroken": unbroken, "amount": amount, "percent": percent, "data_uri": data_uri,
        "shape": shape, "short": short, "restitution_error": restitution_error,
    }  # fmt: skip
    templates.globals["assets"] = read_assets()
    return templates
