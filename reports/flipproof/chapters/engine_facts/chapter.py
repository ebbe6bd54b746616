"""Engine behaviour that a user may not expect: each fact measured anew with every report, and where it must lie.

Some facts need the bottle: they are runs. The others are measured in worlds of one or two bodies (``worlds``), because
in the bottle other settings hide them: ``engine_check`` has chosen its knobs so that they cannot bite.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from flipproof.chapters.differences.study import claim_change, largest_change
from flipproof.chapters.engine_facts import worlds
from flipproof.chapters.solvers import ENGINE
from flipproof.figures.style import new_figure, styled
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Made, Run, Study, judged
from flipproof.frame.findings import finite_or_none, regression
from flipproof.frame.solvers import without_gravity
from flipproof.output.columns import rows_csv
from slicemodel import Scenario, Trajectory

FEW_ITERATIONS: Final = 10
LONG_DT, SHORT_DT = 1e-3, 1e-4
"""Iterations and steps [s] of the two runs that explode."""

SHUFFLES: Final = (1, 2, 3)
FEW, MANY = 25, 100
"""Seeds of the order of insertion, and iterations at which they are compared."""

Measured = Callable[[Mapping[str, Made]], tuple[float, str]]
"""The runs by what is said of each -> the number that shows a fact, and how it was measured."""


@dataclass(frozen=True, slots=True)
class EngineFact:
    """One fact about an engine; its stable ``id`` is a key of ``WORDS``.

    It holds if the number that ``measure`` returns lies in the closed interval ``admissible``, in ``unit``. That raises
    LookupError, with the reason, if a run that it needs is not whole.
    """

    engine: str
    id: str
    unit: str
    admissible: tuple[float, float]
    measure: Measured

    def found(self, made: Mapping[str, Made]) -> Finding:
        """Return the finding: that the number lies in its interval, or why there is none.

        A fact about an engine that is not installed and need not be cannot fail.
        """
        value, absent = None, False
        try:
            value, note = self.measure(made)
        except ModuleNotFoundError as missing:
            note = f"{self.engine} is not installed ({missing})"
            absent = self.engine != "pymunk"
        except LookupError as missing:
            note = str(missing.args[0])
        fact = regression(f"engine-fact-{self.id}", WORDS[self.id], value, self.unit, self.admissible, note)
        return replace(fact, kind="observation") if absent else fact


def plan_engine_facts(throw: Scenario) -> dict[str, Run]:
    """Return the runs of the facts that need the bottle, by what is said of each; about two seconds in all.

    Few slices, a flight that has its first impacts, an output time every millisecond. In a run that is about something
    else the engine iterates 100 times, where its rule asks for 57.
    """
    few = replace(throw.with_slices(10), duration=min(0.2, throw.duration))
    usual: dict[str, Any] = {"dt": 2e-4, "iterations": 100, "times": np.linspace(0.0, few.duration, 201)}
    changes: dict[str, dict[str, Any]] = {"usual": {}, "no gravity": {}}
    for dt in (LONG_DT, SHORT_DT):
        changes[f"few iterations, dt {dt:g} s"] = {"dt": dt, "iterations": FEW_ITERATIONS}
    for iterations in (FEW, MANY):
        for seed in (0, *SHUFFLES):
            changes[f"order {seed}, {iterations} iterations"] = {"iterations": iterations, "shuffle": seed}
    # Unless told otherwise a joint removes a tenth of the error at each of 60 steps a second.
    changes["joints corrected as by default"] = {"error_bias": (1.0 - 0.1) ** 60}
    throws = dict.fromkeys(changes, few) | {"no gravity": without_gravity(few)}
    return {
        words: Run("pymunk", throws[words], usual | change, f"engine fact, {words}")
        for words, change in changes.items()
    }


def _gravity(made: Mapping[str, Made]) -> tuple[float, str]:
    usual, without = made["usual"].whole, made["no gravity"].whole
    fallen = 0.5 * usual.scenario.gravity * float(usual.t[-1]) ** 2
    return largest_change(usual, without), f"the bottle falls by {fallen:.2f} m meanwhile"


def _smaller_step(made: Mapping[str, Made]) -> tuple[float, str]:
    held = []
    for dt in (LONG_DT, SHORT_DT):
        run = made[f"few iterations, dt {dt:g} s"].flight
        if run.ok:
            raise LookupError(f"with {FEW_ITERATIONS} iterations and dt = {dt:g} s nothing explodes")
        held.append(float(run.t[-1]))
    long, short = held
    note = f"holds for {long * 1e3:g} ms at Δt = {LONG_DT:g} s, for {short * 1e3:g} ms at {SHORT_DT:g} s"
    return (short / long if long else math.nan), note


def _widest(made: Mapping[str, Made], iterations: int) -> float:
    """Return the largest change of omega by another order."""
    usual, *others = (made[f"order {seed}, {iterations} iterations"].whole for seed in (0, *SHUFFLES))
    return max(largest_change(usual, other) for other in others)


def _order(made: Mapping[str, Made]) -> tuple[float, str]:
    again = largest_change(made["usual"].whole, made[f"order 0, {MANY} iterations"].whole)
    return _widest(made, FEW), f"{len(SHUFFLES)} shuffled orders; the same order twice: {again:.1g}"


def _order_forgotten(made: Mapping[str, Made]) -> tuple[float, str]:
    few, many = _widest(made, FEW), _widest(made, MANY)
    note = f"{few:.1e} to {many:.1e} of ω₀: what the order moves is what the solver has not iterated away"
    return many / few, note


def _joints(made: Mapping[str, Made]) -> tuple[float, str]:
    default = made["joints corrected as by default"].whole.diagnostics["constraint_drift"]
    ours = made["usual"].whole.diagnostics["constraint_drift"]
    return float(default), f"{ours:.1e} with errors removed within one step"


def _elasticity(_: Mapping[str, Made]) -> tuple[float, str]:
    others = ", ".join(f"{a:g} and {b:g} give {worlds.rebound_of_two(a, b):.2f}" for a, b in ((1.0, 0.5), (0.0, 1.0)))
    return worlds.rebound_of_two(0.5, 0.5), others


def _slop(_: Mapping[str, Made]) -> tuple[float, str]:
    (default, left), without = worlds.depth_left(None), worlds.depth_left(0.0)[1]
    dropped = f"a disc dropped at 2 m/s (Δt = 10 ms) stays {left * 1e3:.1f} mm deep in the floor"
    return default, f"{dropped}, {without * 1e3:.1g} mm with slop 0"


def _tunnel(_: Mapping[str, Made]) -> tuple[float, str]:
    back = worlds.speed_through_wall(1e-3)
    note = f"5 m/s and a wall of 10 mm at Δt = 10 ms; at 1 ms it comes back, {back:.3g}"
    return worlds.speed_through_wall(1e-2), note


WORDS: Final = {
    "gravity": "gravity changes nothing in free flight: largest change of ω(t) when it is switched off",
    "smaller-step": f"with {FEW_ITERATIONS} iterations a tenth of the step explodes sooner: quotient of the times it "
    "holds",
    "order": f"the order in which bodies enter matters: largest change of ω(t), {FEW} iterations",
    "order-forgotten": f"a solver that converges forgets the order: that change at {MANY} iterations over "
    f"that at {FEW}",
    "joints": "joints give: how far a mass leaves the axis that a joint holds it on, default correction",
    "elasticity": "elasticities multiply: restitution of two shapes of 0.5 each",
    "groove-end": "the end of a groove is a dead stop whatever the elasticity: speed back over speed before",
    "stagger": "velocities stand half a step ahead of positions",
    "slop": "penetration is left alone up to collision_slop, by default a third of the bottle",
    "tunnel": "no swept test: a wall thinner than one step is passed, speed after over speed before",
    "mujoco-limit": "joint limits are soft and have no restitution: speed back over speed before (0.5 is meant)",
    "mujoco-contact": "contacts are soft: how deep a resting ball lies in the floor",
}
"""Fact -> what holds."""

FACTS: Final = (
    EngineFact("pymunk", "gravity", "of ω₀", (0.0, 1e-9), _gravity),
    EngineFact("pymunk", "smaller-step", "", (0.0, 0.5), _smaller_step),
    EngineFact("pymunk", "order", "of ω₀", (1e-9, 1e-2), _order),
    EngineFact("pymunk", "order-forgotten", "", (0.0, 0.1), _order_forgotten),
    EngineFact("pymunk", "joints", "of L", (1e-5, 1e-2), _joints),
    EngineFact("pymunk", "elasticity", "", (0.249, 0.251), _elasticity),
    EngineFact("pymunk", "groove-end", "", (0.0, 1e-3), worlds.groove_end),
    EngineFact("pymunk", "stagger", "steps", (0.49, 0.51), worlds.stagger),
    EngineFact("pymunk", "slop", "m", (0.099, 0.101), _slop),
    EngineFact("pymunk", "tunnel", "", (0.99, 1.01), _tunnel),
    EngineFact("mujoco", "mujoco-limit", "", (0.0, 0.3), worlds.soft_limit),
    EngineFact("mujoco", "mujoco-contact", "mm", (0.01, 10.0), worlds.soft_contact),
)
"""Every fact, in the order of the table."""


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
    "engine-facts", "Engine behaviour that a user may not expect", study, claims, figures, kind="regression"
)
