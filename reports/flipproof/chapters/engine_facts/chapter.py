"""Engine behaviour that a user may not expect, measured anew with every report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from flipproof.chapters.differences.study import claim_change
from flipproof.chapters.engine_facts.figure import figure_gallery
from flipproof.chapters.engine_facts.study import FACTS, plan_engine_facts
from flipproof.chapters.solvers import ENGINE
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Made, Run, Study, judged
from flipproof.frame.findings import finite_or_none
from flipproof.frame.solvers import without_gravity
from flipproof.output.columns import rows_csv
from slicemodel import Trajectory

CHECK_DT: Final = 4e-4
"""Step of the engine where two of its runs are compared with one another [s]."""

GRAVITY_BAND: Final = 1e-9
"""Fraction of omega_0 by which a free engine's omega(t) may change when gravity is switched off."""


@dataclass(frozen=True, slots=True)
class EngineFacts:
    """The facts, and the engine's free flight of the paper's own throw with gravity and without."""

    facts: tuple[Finding, ...]
    usual: Made
    weightless: Made


def study(ask: Ask) -> Study[EngineFacts]:
    """Measure every fact."""
    runs = plan_engine_facts(ask.reference)
    usual, weightless = (
        Run(ENGINE, throw, {"dt": CHECK_DT}, f"{ENGINE}, g = {throw.gravity:g} m/s²")
        for throw in (ask.reference, without_gravity(ask.reference))
    )
    flights = yield [*runs.values(), usual, weightless]
    made = {words: flights[run] for words, run in runs.items()}
    return EngineFacts(tuple(fact.found(made) for fact in FACTS), flights[usual], flights[weightless])


def claims(found: EngineFacts) -> Claims:
    """Yield that gravity cancels, and every fact."""
    title = f"{ENGINE}: free flight is the same with g = 0"
    yield judged(claim_gravity_cancels, found.usual, found.weightless, id="engine-gravity", title=title)
    yield from found.facts


def claim_gravity_cancels(with_gravity: Trajectory, without: Trajectory) -> Finding:
    """A free engine spins the same with and without gravity."""
    return claim_change(
        "engine-gravity",
        f"{with_gravity.method}: free flight is the same with g = 0",
        with_gravity,
        without,
        GRAVITY_BAND,
        differ=with_gravity.scenario.gravity > 0.0 == without.scenario.gravity,
        note=f"g = {with_gravity.scenario.gravity:g} and {without.scenario.gravity:g} m/s²",
    )


def figures(found: EngineFacts) -> Iterator[Exhibit]:
    """Yield the table of facts."""
    yield draw_gallery(found.facts)


def draw_gallery(findings: Sequence[Finding]) -> Exhibit:
    """Return the findings of ``FACTS`` as a table."""
    engines = [fact.engine for fact in FACTS]
    words = " ".join(
        f"{finding.title}: {finding.value_text}, threshold {finding.threshold_text}, {finding.verdict}."
        for finding in findings
    )
    held = sum(finding.verdict == "pass" for finding in findings)
    return Exhibit(
        name="engine-facts",
        title="Engine behaviour that a user may not expect",
        caption=f"Each fact is measured anew with every report, and the sign says whether the number lies within its "
        f"threshold: {held} of {len(findings)} do. The engine check is set so that none of them changes "
        "a result unnoticed; how each was measured stands with the findings.",
        alt=f"Table of facts about the engines. {words}".replace("ω₀", "omega_0"),
        maker=figure_gallery,
        data=(findings, engines),
        table=table_gallery(findings, engines),
    )


def table_gallery(findings: Sequence[Finding], engines: Sequence[str]) -> str:
    """Every fact with its number and threshold, in the unit of its row."""
    return rows_csv(
        ("engine", "fact", "number [unit of the row]", "unit", "at least [unit of the row]",
         "at most [unit of the row]", "verdict"),
        (
            (engine, f.title, f.value, f.unit or "1", *map(finite_or_none, f.admissible), f.verdict)
            for f, engine in zip(findings, engines, strict=True)
        ),
    )  # fmt: skip


CHAPTER: Final = Chapter(
    name="engine-facts",
    title="Engine behaviour that a user may not expect",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
)
