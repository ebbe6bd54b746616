"""The sections of the page: one for each part of the report, rendered from its chapters' own templates."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from jinja2 import Environment
from markupsafe import Markup

from flipproof.frame.chapter import Part
from flipproof.frame.findings import Finding
from flipproof.frame.gather import Gathered, Told
from flipproof.frame.throws import FINER
from flipproof.page.glossary import linked

MACROS: Final = '{% from "macros.html.j2" import anchor, draw, minus, missing, scroll, status with context %}\n'

PLAIN: Final = """{{ draw(figures) }}
{% if not figures and findings %}
<ul>
{% for finding in findings %}<li><a href="#{{ finding.id }}">{{ finding.title }}</a>:
{{ minus(finding.value_text) }}, {{ finding.verdict }}.</li>
{% endfor %}
</ul>
{% endif %}
"""
"""The part of a chapter that has no template of its own: its figures; or, without any, its findings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One section of the page.

    Parameters
    ----------
    id, title, sentence : str - anchor, heading, and in one sentence what it shows
    html : Markup - its content, without heading and sentence
    findings : tuple of Finding - those that must hold first
    figure : name of its first figure, "" if it has none
    """

    id: str
    title: str
    sentence: str
    html: Markup
    findings: tuple[Finding, ...] = ()
    figure: str = ""

    @property
    def counts(self) -> Mapping[str, int]:
        """Verdict -> number of its findings."""
        return Counter(finding.verdict for finding in self.findings)

    @property
    def count_words(self) -> str:
        """The findings in words, as in "12 claims hold, 3 observations"; nothing if there are none."""
        counts = self.counts
        words = (
            ("pass", "claim holds", "claims hold"),
            ("fail", "claim fails", "claims fail"),
            ("observed", "observation", "observations"),
            ("not evaluated", "not evaluated", "not evaluated"),
        )
        return ", ".join(
            f"{counts[verdict]} {one if counts[verdict] == 1 else many}"
            for verdict, one, many in words
            if verdict in counts
        )


def sections(gathered: Gathered, told: Mapping[str, Told], templates: Environment) -> tuple[Section, ...]:
    """Return every part that has a chapter in this report, in order."""
    return tuple(
        _section(gathered, part, [told[chapter.name] for chapter in part.chapters if chapter.name in told], templates)
        for part in gathered.parts
        if any(chapter.name in told for chapter in part.chapters)
    )


def _section(gathered: Gathered, part: Part, chapters: Sequence[Told], templates: Environment) -> Section:
    return Section(
        id=part.id,
        title=part.title,
        sentence=part.sentence,
        html=linked("\n".join(_chapter(gathered, each, templates) for each in chapters)),
        findings=tuple(
            sorted(
                (finding for each in chapters for finding in each.findings),
                key=lambda finding: finding.kind != "regression",
            )
        ),
        figure=next((figure.name for each in chapters for figure in each.figures), ""),
    )


def _chapter(gathered: Gathered, told: Told, templates: Environment) -> Markup:
    """Return a chapter's part: what is missing and why, then its own template, or its figures alone."""
    chapter = told.chapter
    text = PLAIN if chapter.template is None else chapter.template.read_text(encoding="utf-8")
    body = "" if told.found is None else text
    extra: dict[str, Any] = {} if told.found is None else dict(chapter.page(told.found))
    return Markup(
        templates.from_string(f"{MACROS}{{{{ missing(notes) }}}}\n{body}").render(
            found=told.found,
            figures=told.figures,
            findings=told.findings,
            notes=told.notes,
            finer=FINER,
            throw=gathered.ask.throw,
            **extra,
        )
    )
