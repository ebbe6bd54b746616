"""Where pymunk is stable, and where it is right: the chart of step against iterations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from flipproof.chapters.stability.study import (
    DEFAULT_ITERATIONS,
    FULL,
    GOOD,
    QUICK,
    RULE_DT,
    Cell,
    StabilityPanel,
    plan_bands,
    plan_stability,
    study_stability,
)
from flipproof.figures.style import new_figure, styled
from flipproof.frame.chapter import (
    Ask,
    Band,
    Chapter,
    Claims,
    Exhibit,
    Finding,
    Study,
    attempt,
    judged,
    known,
    observed,
    regression,
)
from flipproof.frame.solvers import Made, Run
from flipproof.output.columns import rows_csv
from slicemodel import Trajectory

Results = tuple[tuple[StabilityPanel, ...], Made]
"""The charts, and the report's throw at the engine's own number of iterations."""


def study(ask: Ask) -> Study[Results]:
    """Fly every cell of the layout ``ask.work``."""
    default = Run("pymunk", ask.throw, {"iterations": DEFAULT_ITERATIONS}, f"pymunk, {DEFAULT_ITERATIONS} iterations")
    calls = plan_bands(ask.reference, ask.work)
    flights = yield [*plan_stability(ask.reference, ask.work), default, *calls.values()]
    bands = known({run: attempt(flights.answer, call) for run, call in calls.items()})
    largest = {run: float(band[-1]) for run, band in bands.items()}
    return study_stability(ask.reference, ask.work, flights, largest), flights[default]


def claims(results: Results) -> Claims:
    """Yield the rule of iterations, what happens at the default, and how many runs are whole and wrong."""
    panels, default = results
    id_, title = "engine-default-iterations", f"pymunk with its default {DEFAULT_ITERATIONS} iterations"
    yield judged(claim_explosion_is_reported, default, id=id_, title=title, kind="observation")
    yield claim_rule_of_iterations(panels)
    yield claim_default_iterations_explode(panels)
    yield claim_whole_and_wrong(panels)


def claim_rule_of_iterations(panels: Sequence[StabilityPanel]) -> Finding:
    """With the iterations that the rule asks for, and a step up to twice the default, pymunk follows free flight."""
    errors = [error for panel in panels for error in panel.by_the_rule]
    return regression(
        id="engine-rule-of-iterations",
        title=f"pymunk with enough iterations and Δt ≤ {RULE_DT:g} s: largest error of ω(t) against free flight",
        # A NaN among them stays NaN, and fails.
        value=float(np.max(errors)) if errors else None,
        unit="of ω₀",
        admissible=(0.0, GOOD),
        band=Band(float(np.max([panel.band for panel in panels])), "twins"),
        note=f"{len(errors)} runs; " + "; ".join(panel.words for panel in panels),
    )


def claim_default_iterations_explode(panels: Sequence[StabilityPanel]) -> Finding:
    """No run with pymunk's own number of iterations reaches the end of the flight, whatever its step."""
    grades = [grade for panel in panels for grade in panel.at_default]
    whole = float(len(grades) - grades.count("explodes")) if grades else None
    title = f"pymunk with its default {DEFAULT_ITERATIONS} iterations: runs that do not explode"
    note = f"of {len(grades)}, at every step of the chart; each is reported as diverged with its reason"
    return regression("engine-default-explodes", title, whole, "", (0.0, 0.0), note)


def claim_whole_and_wrong(panels: Sequence[StabilityPanel]) -> Finding:
    """How many runs break no invariant and are wrong all the same: only a reference tells."""
    counts = {grade: sum(panel.counts[grade] for panel in panels) for grade in ("wrong", "good", "excellent")}
    errors = [cell.error for panel in panels for cell in panel.cells.values() if cell.grade == "wrong"]
    note = f"by up to {100 * np.max(errors):.2g} % of ω₀; only a reference tells" if errors else "none on this chart"
    title = f"pymunk: runs that break no invariant and are wrong by more than {GOOD:.0%} of ω₀"
    return observed("engine-whole-and-wrong", title, float(counts["wrong"]), f"of {sum(counts.values())}", note)


def claim_explosion_is_reported(trajectory: Trajectory) -> Finding:
    """At the engine's default of 10 iterations the run explodes, and is reported as diverged instead of shown."""
    title = f"{trajectory.method} with its default 10 iterations: last output time before an invariant breaks"
    until = float(trajectory.t[-1]) if trajectory.status == "diverged" else None
    note = trajectory.message or "the run did not diverge"
    return observed("engine-default-iterations", title, until, "s", note)


def figures(results: Results) -> Iterator[Exhibit]:
    """Yield the stability chart."""
    panels, _ = results
    counts = {grade: sum(panel.counts[grade] for panel in panels) for grade in panels[0].counts}
    default = [grade for panel in panels for grade in panel.at_default]
    missing = sorted({cell.reason for panel in panels for cell in panel.cells.values() if cell.grade == "not run"})
    duration, burst = panels[0].layout.duration, default.count("explodes")
    caption = (
        f"Every cell is a flight of {duration:g} s, held against event-driven free flight; the sign in it says the "
        f"same as its colour. Of the {len(default)} flights with pymunk's own {DEFAULT_ITERATIONS} iterations (dashed) "
        f"{burst} explode; their times from left to right show that a finer step does not help. Where a column reads "
        "the same from some row upwards, more iterations no longer change anything, and only a shorter step does. "
        f"{counts['wrong']} flights break no invariant and are wrong by more "
        f"than 1 %; {counts['good'] + counts['excellent']} are good; {counts['explodes'] + counts['sinks in']} were "
        "stopped, at the time that their cell shows."
    )
    if missing:
        caption += f" Not run ({counts['not run']}): {'; '.join(missing)}."
    yield Exhibit(
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
            (panel.mass_ratio, panel.slices, panel.layout.iterations[row], panel.enough, panel.layout.dt[column], *cell)
            for panel in panels
            for (row, column), cell in panel.cells.items()
        ),
    )  # fmt: skip


LOOKS = {
    "excellent": ("#7CCBA8", "++", "++ error ≤ 0.1 % of ω₀"),
    "good": ("#CDEBDC", "+", "+ error ≤ 1 %"),
    "wrong": ("#F7DC87", "≠", "≠ whole, but error > 1 %"),
    "sinks in": ("#C6B5E3", "↓", "↓ stopped: slices sink in (shorten Δt)"),
    "explodes": ("#EDA184", "×", "× stopped: joints open (iterate more)"),
    "not run": ("#F0F0F0", "–", "– not run"),
}
"""One colour, one sign and the words of the legend per grade: the chart can be read without colours."""


@styled
def figure_stability(panels: Sequence[StabilityPanel]) -> Figure:
    """Grades over step and iterations, one panel per bottle: colour, sign and number in every cell."""
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    height = 1.2 + rows * (1.0 + 0.4 * len(panels[0].layout.iterations))
    figure, axes = new_figure(rows, columns, size=(8.0, height), squeeze=False)
    for at, panel in zip(axes.flat, panels, strict=False):
        _draw_panel(at, panel)
    for at in axes.flat[len(panels) :]:
        at.set_visible(False)
    for at in axes[:, 0]:
        at.set_ylabel("iterations per step [1]")
    for at in axes[-1, :]:
        at.set_xlabel("step Δt [ms], finer to the right")
    handles: list[Artist] = [
        Patch(facecolor=colour, edgecolor="#888888", label=words)
        for grade, (colour, _, words) in LOOKS.items()
        if any(panel.counts[grade] for panel in panels)
    ]
    line = partial(Line2D, [], [], color="black")
    handles.append(line(linewidth=2.0, label="rule: enough iterations above it"))
    handles.append(line(linewidth=1.2, linestyle="--", label="pymunk's default iterations"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_panel(axes: Axes, panel: StabilityPanel) -> None:
    steps, iterations = panel.layout.dt, panel.layout.iterations
    for (row, column), cell in panel.cells.items():
        corner = (column - 0.5, row - 0.5)
        axes.add_patch(Rectangle(corner, 1, 1, facecolor=LOOKS[cell.grade][0], edgecolor="white", linewidth=1.0))
        axes.text(column, row, _cell_text(cell, steps[0]), ha="center", va="center", fontsize=7.5)
    axes.set(xlim=(-0.5, len(steps) - 0.5), ylim=(-0.5, len(iterations) - 0.5))
    axes.set_xticks(range(len(steps)), [f"{1e3 * dt:g}" for dt in steps])
    axes.set_yticks(range(len(iterations)), [str(n) for n in iterations])
    axes.grid(visible=False)
    if DEFAULT_ITERATIONS in iterations:
        corner, width = (-0.47, iterations.index(DEFAULT_ITERATIONS) - 0.47), len(steps) - 0.06
        axes.add_patch(Rectangle(corner, width, 0.94, fill=False, linestyle="--", linewidth=1.2))
    # Rows are numbers of iterations, not a scale: the rule lies below the first row that follows it.
    axes.axhline(sum(n < panel.enough for n in iterations) - 0.5, color="black", linewidth=2.5)
    known = "" if math.isnan(panel.band) else f", reference ± {100 * panel.band:.1g} %"
    words = f"M_w / M_b = {panel.mass_ratio:g}, N = {panel.slices}\nrule: {panel.enough} iterations{known}"
    axes.set_title(words, fontsize=9.5, loc="left")


def _cell_text(cell: Cell, longest: float) -> str:
    sign, held = LOOKS[cell.grade][1], cell.held_until
    if cell.grade == "not run":
        return sign
    if cell.grade in ("explodes", "sinks in"):
        # Not even the first output after release, one longest step later.
        return f"{sign}\n{1e3 * held:.0f} ms" if held > 0.0 else f"{sign}\n< {1e3 * longest:g} ms"
    return f"{sign}\n{100 * cell.error:.2g} %"


CHAPTER: Final = Chapter(
    name="stability",
    title="Where pymunk is stable, and where it is right",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
    work={"quick": QUICK, "full": FULL},
)
