"""Where pymunk is stable, and where it is right: the chart of step against iterations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from flipproof.chapters.stability.figure import figure_stability
from flipproof.chapters.stability.study import (
    DEFAULT_ITERATIONS,
    FULL,
    GOOD,
    QUICK,
    RULE_DT,
    StabilityPanel,
    plan_stability,
    study_stability,
)
from flipproof.frame.chapter import (
    Ask,
    Chapter,
    Claims,
    Exhibit,
    Finding,
    Made,
    Run,
    Study,
    judged,
    observed,
    regression,
)
from flipproof.output.columns import rows_csv
from slicemodel import Trajectory


@dataclass(frozen=True, slots=True)
class Stability:
    """The charts, and the report's throw at the engine's own number of iterations."""

    panels: tuple[StabilityPanel, ...]
    default: Made


def study(ask: Ask) -> Study[Stability]:
    """Fly every cell of the layout ``ask.work``."""
    default = Run("pymunk", ask.throw, {"iterations": DEFAULT_ITERATIONS}, f"pymunk, {DEFAULT_ITERATIONS} iterations")
    flights = yield [*plan_stability(ask.reference, ask.work), default]
    return Stability(study_stability(ask.reference, ask.work, flights), flights[default])


def claims(found: Stability) -> Claims:
    """Yield the rule of iterations, what happens at the default, and how many runs are whole and wrong."""
    id_, title = "engine-default-iterations", f"pymunk with its default {DEFAULT_ITERATIONS} iterations"
    yield judged(claim_explosion_is_reported, found.default, id=id_, title=title, kind="observation")
    yield claim_rule_of_iterations(found.panels)
    yield claim_default_iterations_explode(found.panels)
    yield claim_whole_and_wrong(found.panels)


def claim_rule_of_iterations(panels: Sequence[StabilityPanel]) -> Finding:
    """With the iterations that the rule asks for, and a step up to twice the default, pymunk follows free flight."""
    errors = np.concatenate([panel.by_the_rule for panel in panels])
    return Finding(
        id="engine-rule-of-iterations",
        title=f"pymunk with enough iterations and Δt ≤ {RULE_DT:g} s: largest error of ω(t) against free flight",
        # A NaN among them stays NaN, and fails.
        value=float(errors.max()) if len(errors) else None,
        unit="of ω₀",
        kind="regression",
        admissible=(0.0, GOOD),
        band=float(np.max([panel.band for panel in panels])),
        note=f"{len(errors)} runs; " + "; ".join(panel.words for panel in panels),
    )


def claim_default_iterations_explode(panels: Sequence[StabilityPanel]) -> Finding:
    """No run with pymunk's own number of iterations reaches the end of the flight, whatever its step."""
    grades = np.concatenate([panel.at_default for panel in panels])
    stopped = int((grades == "explodes").sum())
    return regression(
        id="engine-default-explodes",
        title=f"pymunk with its default {DEFAULT_ITERATIONS} iterations: runs that do not explode",
        value=float(len(grades) - stopped) if len(grades) else None,
        unit="",
        admissible=(0.0, 0.0),
        note=f"of {len(grades)}, at every step of the chart; each is reported as diverged with its reason",
    )


def claim_whole_and_wrong(panels: Sequence[StabilityPanel]) -> Finding:
    """How many runs break no invariant and are wrong all the same: only a reference tells."""
    counts = {grade: sum(panel.counts[grade] for panel in panels) for grade in ("wrong", "good", "excellent")}
    errors = np.concatenate([panel.error[panel.grade == "wrong"] for panel in panels])
    return observed(
        id="engine-whole-and-wrong",
        title=f"pymunk: runs that break no invariant and are wrong by more than {GOOD:.0%} of ω₀",
        value=float(counts["wrong"]),
        unit=f"of {sum(counts.values())}",
        note=f"by up to {100 * errors.max():.2g} % of ω₀; only a reference tells"
        if len(errors)
        else "none on this chart",
    )


def claim_explosion_is_reported(trajectory: Trajectory) -> Finding:
    """At the engine's default of 10 iterations the run explodes, and is reported as diverged instead of shown."""
    diverged = trajectory.status == "diverged"
    return observed(
        id="engine-default-iterations",
        title=f"{trajectory.method} with its default 10 iterations: last output time before an invariant breaks",
        value=float(trajectory.t[-1]) if diverged else None,
        unit="s",
        note=trajectory.message or "the run did not diverge",
    )


def figures(found: Stability) -> Iterator[Exhibit]:
    """Yield the chart."""
    yield draw_stability(found.panels)


def draw_stability(panels: Sequence[StabilityPanel]) -> Exhibit:
    """Return the stability chart."""
    counts = {grade: sum(panel.counts[grade] for panel in panels) for grade in panels[0].counts}
    default = np.concatenate([panel.at_default for panel in panels])
    missing = sorted({reason for panel in panels for reason in panel.reason[panel.grade == "not run"]})
    caption = (
        f"Every cell is a flight of {panels[0].duration:g} s, held against event-driven free flight; the sign in it "
        f"says the same as its colour. Of the {len(default)} flights with pymunk's own {DEFAULT_ITERATIONS} iterations "
        f"(dashed) {int((default == 'explodes').sum())} explode; their times from left to right show that a finer step "
        "does not help. Where a column reads the same from some row upwards, more iterations no longer change "
        f"anything, and only a shorter step does. {counts['wrong']} flights break no invariant and are wrong by more "
        f"than 1 %; {counts['good'] + counts['excellent']} are good; {counts['explodes'] + counts['sinks in']} were "
        "stopped, at the time that their cell shows."
    )
    if missing:
        caption += f" Not run ({counts['not run']}): {'; '.join(missing)}."
    return Exhibit(
        name="stability",
        title="Where pymunk is stable, and where it is right",
        caption=caption,
        alt="Charts of step against solver iterations. " + ". ".join(panel.words for panel in panels) + ".",
        maker=figure_stability,
        data=(panels,),
        table=_cells_csv(panels),
    )


def _cells_csv(panels: Sequence[StabilityPanel]) -> str:
    """Return every cell of the chart."""
    return rows_csv(
        ("mass ratio M_w/M_b [1]", "slices [1]", "iterations [1]", "iterations by the rule [1]", "dt [s]", "grade",
         "largest error of omega [of omega_0]", "error of the plateau [of omega_0]", "stopped after [s]", "reason"),
        (
            (panel.mass_ratio, panel.slices, panel.iterations[row], panel.enough, panel.dt[column], grade,
             panel.error[row, column], panel.plateau_error[row, column], panel.held_until[row, column],
             panel.reason[row, column])
            for panel in panels
            for (row, column), grade in np.ndenumerate(panel.grade)
        ),
    )  # fmt: skip


CHAPTER: Final = Chapter(
    name="stability",
    title="Where pymunk is stable, and where it is right",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
    work={"quick": QUICK, "full": FULL},
)
