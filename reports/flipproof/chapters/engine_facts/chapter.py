"""Engine behaviour that a user may not expect, measured anew with every report."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from matplotlib.figure import Figure

from flipproof.chapters.differences.study import claim_change
from flipproof.chapters.engine_facts.study import FACTS, plan_engine_facts
from flipproof.chapters.solvers import ENGINE
from flipproof.figures.style import new_figure, styled
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Made, Run, Study, judged
from flipproof.frame.findings import finite_or_none
from flipproof.frame.solvers import without_gravity
from flipproof.output.columns import rows_csv
from slicemodel import Trajectory

CHECK_DT: Final = 4e-4
"""Step of the engine where two of its runs are compared with one another [s]."""


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
    """A free engine spins the same with and without gravity, to a billionth of omega_0."""
    title = f"{with_gravity.method}: free flight is the same with g = 0"
    differ = with_gravity.scenario.gravity > 0.0 == without.scenario.gravity
    note = f"g = {with_gravity.scenario.gravity:g} and {without.scenario.gravity:g} m/s²"
    return claim_change("engine-gravity", title, with_gravity, without, 1e-9, differ=differ, note=note)


def figures(found: EngineFacts) -> Iterator[Exhibit]:
    """Yield the table of facts, each with its number and threshold in the unit of its row."""
    findings, engines = found.facts, [fact.engine for fact in FACTS]
    words = " ".join(
        f"{finding.title}: {finding.value_text}, threshold {finding.threshold_text}, {finding.verdict}."
        for finding in findings
    )
    held = sum(finding.verdict == "pass" for finding in findings)
    unit = "[unit of the row]"
    rows = [
        (engine, f.title, f.value, f.unit or "1", *map(finite_or_none, f.admissible), f.verdict)
        for f, engine in zip(findings, engines, strict=True)
    ]
    yield Exhibit(
        name="engine-facts",
        title="Engine behaviour that a user may not expect",
        caption=f"Each fact is measured anew with every report, and the sign says whether the number lies within its "
        f"threshold: {held} of {len(findings)} do. The engine check is set so that none of them changes "
        "a result unnoticed; how each was measured stands with the findings.",
        alt=f"Table of facts about the engines. {words}".replace("ω₀", "omega_0"),
        maker=figure_gallery,
        data=(findings, engines),
        table=rows_csv(
            ("engine", "fact", f"number {unit}", "unit", f"at least {unit}", f"at most {unit}", "verdict"), rows
        ),
    )


@styled
def figure_gallery(findings: Sequence[Finding], engines: Sequence[str]) -> Figure:
    """Table of facts: engine, fact, number, threshold, sign; ``engines`` names the engine of each finding."""
    columns = {"engine": 0.0, "fact": 0.1, "number": 0.66, "threshold": 0.8, "": 0.955}
    signs = {"pass": ("✓", "#0B6E4F"), "fail": ("✗", "#B00020")}
    texts = [textwrap.wrap(finding.title, 66) for finding in findings]
    lines = sum(len(text) for text in texts) + 0.6 * len(texts) + 1.6
    figure, axes = new_figure(size=(8.0, 0.2 * lines + 0.1))
    axes.set_axis_off()
    axes.set(xlim=(0, 1), ylim=(lines, 0))
    for heading, x in columns.items():
        axes.text(x, 0.9, heading, fontsize=9, fontweight="bold", va="center")
    top = 1.5
    for finding, engine, text in zip(findings, engines, texts, strict=True):
        axes.axhline(top, color="#cccccc", linewidth=0.8)
        middle = top + 0.3 + len(text) / 2
        cells = (engine, "\n".join(text), finding.value_text, finding.threshold_text)
        for x, cell in zip(columns.values(), cells, strict=False):
            axes.text(x, middle, cell, fontsize=8.5, va="center", linespacing=1.25, color="black")
        sign, colour = signs.get(finding.verdict, ("–", "#666666"))
        axes.text(columns[""], middle, sign, fontsize=12, va="center", linespacing=1.25, color=colour)
        top += len(text) + 0.6
    axes.axhline(top, color="#cccccc", linewidth=0.8)
    return figure


CHAPTER: Final = Chapter(
    name="engine-facts",
    title="Engine behaviour that a user may not expect",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
)
