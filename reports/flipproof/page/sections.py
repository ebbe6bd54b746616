"""The order of the page: the screens of its story, the parts of the report, and what stands behind them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from jinja2 import Environment

from flipproof.page.glossary import indexed, linked
from flipproof.page.parts import Section

STORY: Final[Mapping[str, str]] = {
    "verdict": "What was asked",
    "answer": "The answer",
    "motion-story": "One flight, four ways",
    "live": "Switch gravity off",
    "shares": "Which assumption costs what",
    "survives": "What survives",
    "bottles": "For which bottles",
    "sure": "How sure we are",
}
"""Screen of the story -> its name in the contents, in the order of the page."""

BEHIND: Final[Mapping[str, tuple[str, str]]] = {
    "findings": ("All findings", "Every claim and every observation of this report, to search and to link to."),
    "solvers": ("Every solver", "What each solver solves, how it ended on this throw, and why what failed did."),
    "glossary": ("Glossary", "Every name and symbol of this page in one plain sentence."),
    "provenance": (
        "Settings and provenance",
        "What was thrown, with which versions, on which machine; files for machines.",
    ),
}
"""Section behind the parts of a report, with a template of its name -> its title and what it shows."""


def behind(parts: Sequence[Section], templates: Environment, context: Mapping[str, Any]) -> Iterator[Section]:
    """Yield the sections that stand behind the parts of a report, with links to the glossary."""
    for id_, (title, sentence) in BEHIND.items():
        html = templates.get_template(f"{id_}.html.j2").render(context, parts=parts)
        yield Section(id=id_, title=title, sentence=sentence, html=(indexed if id_ == "glossary" else linked)(html))
