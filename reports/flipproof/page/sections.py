"""The evidence below the story: one fold a section, with a sentence, a figure and a count of its findings."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from markupsafe import Markup

from flipproof.frame.exhibit import Exhibit
from flipproof.frame.findings import Finding
from flipproof.page.glossary import linked

STORY: Final[Mapping[str, str]] = {
    "verdict": "What was asked",
    "answer": "The answer",
    "motion-story": "One flight, four ways",
    "live": "Switch gravity off",
    "shares": "Which mistake costs what",
    "survives": "What survives",
    "bottles": "For which bottles",
    "sure": "How sure we are",
}
"""Screen of the story -> its name in the contents, in the order of the page."""

EVIDENCE: Final[Mapping[str, tuple[str, str]]] = {
    "measured": ("Your measurement", "The flight that was measured, over the solvers and fitted by them: which "
    "equation is nearest."),
    "assumptions": ("What each assumption costs", "Each change that leads from the published program to free "
    "flight, made in every order, and what it does to ω."),
    "flights": ("The flights", "Every solver's flight of this throw: ω, θ, the centre of mass and the slices "
    "over time, and the bottles in motion."),
    "differences": ("Where the solvers differ", "Which pairs of solvers differ by how much, when the difference "
    "is largest, and when it first exceeds 1 % of ω₀."),
    "steps": ("Step size", "How the error falls as the step becomes shorter, and what holding ω constant over a "
    "step costs by itself."),
    "slices": ("How many slices", "How far the numbers move when the water is cut into more slices."),
    "events": ("Impacts", "When slices hit the ends in each solver, which impacts correspond, and how a small "
    "change of the release grows."),
    "energy": ("Energy", "Where the energy of the flight goes, and whether the energy ledger of every equation "
    "closes."),
    "ice": ("Ice", "Frozen water cannot slide, so ω must stay constant: how closely every solver keeps it."),
    "engines": ("The engines", "What each physics engine computes by itself, how far its result can be trusted, "
    "and where it fails."),
    "work-precision": ("What a digit costs", "How much computing one more correct digit of ω costs, solver by solver."),
    "maps": ("Maps of validity", "Over filling and damping, step size or restitution: how wrong an "
    "approximation is, and which assumption is to blame."),
    "paper": ("The paper's figures and claims", "Every statement of the paper about its model and about the "
    "bottles really thrown, judged by three equations."),
    "errata": ("Errata", "What the paper prints, what follows from its own earlier equations, and the number "
    "that separates the two."),
    "findings": ("All findings", "Every claim and every observation of this report, to search and to link to."),
    "solvers": ("Every solver", "What each solver solves, how it ended on this throw, and how it was checked "
    "against a second method."),
    "glossary": ("Glossary", "Every name and symbol of this page in one plain sentence."),
    "provenance": ("Settings and provenance", "What was thrown, with which versions, on which machine; files "
    "for machines."),
}  # fmt: skip
"""Section of the evidence -> its title and what it shows, in the order of the page."""

BELONGS: Final[Mapping[str, str]] = {
    "measured": "measured",
    "waterfall": "assumptions", "difference": "differences", "order": "steps", "finite-step": "steps",
    "limit": "steps", "model-form": "steps", "tube": "events", "predictability": "events", "energy": "energy",
    "ice": "ice", "engine": "engines", "certificate": "engines", "agreement": "engines", "horizon": "engines",
    "overlap": "engines", "work": "work-precision", "paper": "paper", "erratum": "errata", "vectors": "solvers",
    "reference": "solvers", "second-method": "solvers", "exact-cases": "solvers",
}  # fmt: skip
"""How the id of a finding begins -> the section that it belongs to."""

_SECTION: Final = re.compile(r'<section id="([\w-]+)">\s*<h2>.*?</h2>(.*?)</section>', re.DOTALL)


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One folded section: its place, its title, one sentence, its content, its findings, its first figure."""

    id: str
    title: str
    sentence: str
    html: Markup
    counts: Mapping[str, int] = field(default_factory=dict)
    figure: str = ""

    @property
    def count_words(self) -> str:
        """The findings in words, as in "12 claims hold, 3 observations"; nothing if there are none."""
        held, failed = self.counts.get("pass", 0), self.counts.get("fail", 0)
        missing, seen = self.counts.get("not evaluated", 0), self.counts.get("observed", 0)
        parts = (
            (held, "claim holds", "claims hold"),
            (failed, "claim fails", "claims fail"),
            (seen, "observation", "observations"),
            (missing, "not evaluated", "not evaluated"),
        )
        return ", ".join(f"{count} {one if count == 1 else many}" for count, one, many in parts if count)


def section_of(id_: str) -> str:
    """Return the section of a finding by its id; "findings" for one that belongs nowhere else."""
    return next((section for begin, section in BELONGS.items() if id_.startswith(begin)), "findings")


def counted(findings: Sequence[Finding]) -> dict[str, dict[str, int]]:
    """Return section -> verdict -> number of findings."""
    found: dict[str, Counter[str]] = {}
    for finding in findings:
        found.setdefault(section_of(finding.id), Counter())[finding.verdict] += 1
    return {section: dict(counts) for section, counts in found.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """The findings of one section."""

    id: str
    title: str
    findings: tuple[Finding, ...]


def grouped(findings: Sequence[Finding]) -> list[Group]:
    """Return the findings by section, in the order of EVIDENCE; those that must hold first."""
    ranked = sorted(findings, key=lambda finding: finding.kind != "regression")
    return [
        Group(id=id_, title=title if id_ != "findings" else "Other findings", findings=mine)
        for id_, (title, _) in EVIDENCE.items()
        if (mine := tuple(finding for finding in ranked if section_of(finding.id) == id_))
    ]


def folded(html: str, findings: Sequence[Finding], exhibits: Sequence[Exhibit]) -> list[Section]:
    """Return the sections that the templates wrote, in the order of EVIDENCE, with links to the glossary."""
    counts = counted(findings)
    parts = dict(_SECTION.findall(html))
    first: dict[str, str] = {}
    for exhibit in exhibits:
        first.setdefault(exhibit.section, exhibit.name)
    return [
        Section(
            id=id_,
            title=title,
            sentence=sentence,
            html=Markup(parts[id_]) if id_ == "glossary" else linked(parts[id_]),
            counts=counts.get(id_, {}),
            figure=first.get(id_, ""),
        )
        for id_, (title, sentence) in EVIDENCE.items()
        if id_ in parts
    ]
