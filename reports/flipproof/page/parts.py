"""The order of both pages: the screens of the story; the parts of the report, and what stands behind them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from jinja2 import Environment
from markupsafe import Markup

from flipproof.frame.chapter import Part
from flipproof.frame.exhibit import Exhibit
from flipproof.frame.findings import RULES, Finding
from flipproof.frame.gather import ChapterResult, Gathered
from flipproof.frame.solvers import FINER
from flipproof.page.glossary import indexed, linked

STORY: Final[Mapping[str, str]] = {
    "verdict": "Two bottles",
    "outward": "Thrown outward",
    "drag": "Slowed by drag",
    "weight": "Gravity drops out",
    "recoil": "The bottle recoils",
    "overlap-idea": "Water cannot overlap",
    "answer": "Is Eq. 8 right?",
    "live": "Throw it yourself",
    "bottles": "Other bottles",
    "survives": "What holds, and what does not",
    "sure": "How sure we are",
}
"""Screen of the story -> its name in the contents, in the order of the page."""

BEHIND: Final[Mapping[str, tuple[str, str]]] = {
    "detail": (
        "The story in detail",
        "Why the program is off, what survives, and every witness, with the numbers that the story leaves out.",
    ),
    "findings": ("All findings", "Every claim and every observation of this report, to search and to link to."),
    "solvers": ("Every solver", "What each solver solves, how it ended on this throw, and why what failed did."),
    "glossary": ("Glossary", "Names and symbols of this report, each in one plain sentence."),
    "provenance": (
        "Settings and provenance",
        "What was thrown, with which versions, on which machine; files for machines.",
    ),
}
"""Section behind the parts of a report, with a template of its name -> its title and what it shows."""

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
    """One section of the evidence: anchor, heading, in one sentence what it shows, and its content without these.

    Of its findings those that must hold come first; ``figure`` is the name of its first figure, "" if it has none.
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
        words = {
            "pass": ("claim holds", "claims hold"),
            "fail": ("claim fails", "claims fail"),
            "observed": ("observation", "observations"),
            "not evaluated": ("not evaluated", "not evaluated"),
        }
        counted = [(counts[verdict], *forms) for verdict, forms in words.items() if verdict in counts]
        return ", ".join(f"{n} {singular if n == 1 else plural}" for n, singular, plural in counted)


def sections(gathered: Gathered, results: Mapping[str, ChapterResult], templates: Environment) -> tuple[Section, ...]:
    """Return every part that has a chapter in this report, in order."""

    def section(part: Part, chapters: Sequence[ChapterResult]) -> Section:
        findings = [finding for result in chapters for finding in result.findings]
        return Section(
            id=part.id,
            title=part.title,
            sentence=part.sentence,
            html=linked("\n".join(_chapter(gathered, result, templates) for result in chapters)),
            findings=tuple(sorted(findings, key=lambda finding: finding.kind != "regression")),
            figure=next((figure.name for result in chapters for figure in result.figures), ""),
        )

    contents = (
        (part, [results[chapter.name] for chapter in part.chapters if chapter.name in results])
        for part in gathered.parts
    )
    return tuple(section(part, chapters) for part, chapters in contents if chapters)


def _chapter(gathered: Gathered, result: ChapterResult, templates: Environment) -> Markup:
    """Return a chapter's part: what is missing and why, then its own template, or its figures alone."""
    chapter = result.chapter
    text = PLAIN if chapter.template is None else chapter.template.read_text(encoding="utf-8")
    body = "" if result.study_result is None else text
    extra: dict[str, Any] = {} if result.study_result is None else dict(chapter.page(result.study_result))
    return Markup(
        templates.from_string(f"{MACROS}{{{{ missing(notes) }}}}\n{body}").render(
            found=result.study_result,
            figures=result.figures,
            findings=result.findings,
            notes=result.notes,
            finer=FINER,
            throw=gathered.ask.throw,
            **extra,
        )
    )


def _rules(parts: Sequence[Section]) -> dict[str, str]:
    """Return the rules of the bands of all findings, in words."""
    used = {finding.band.rule for part in parts for finding in part.findings if finding.band is not None}
    return {rule: words for rule, words in RULES.items() if rule in used}


def behind(parts: Sequence[Section], templates: Environment, context: Mapping[str, Any]) -> Iterator[Section]:
    """Yield the sections that stand behind the parts of a report, with links to the glossary."""
    for id_, (title, sentence) in BEHIND.items():
        html = templates.get_template(f"{id_}.html.j2").render(context, parts=parts, rules=_rules(parts))
        yield Section(id=id_, title=title, sentence=sentence, html=(indexed if id_ == "glossary" else linked)(html))


def shared(figures: Sequence[Exhibit]) -> tuple[str, tuple[str, ...]]:
    """Return the sentences that three and more captions, and three in four, have; and the captions without them."""
    split = [re.split(r"(?<=[.?!]) (?=[A-Z“])", figure.caption) for figure in figures]
    counts = Counter(sentence for sentences in split for sentence in dict.fromkeys(sentences))
    common = [sentence for sentence, count in counts.items() if count >= max(3, 0.75 * len(figures))]
    return " ".join(common), tuple(
        " ".join(sentence for sentence in sentences if sentence not in common) for sentences in split
    )
