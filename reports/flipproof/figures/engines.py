"""What the engines can be trusted with: the stability chart, the widths of ensembles, and the gallery of facts."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from flipproof.figures.events import SIZE_LINES
from flipproof.figures.style import new_figure, solver_style, styled
from flipproof.frame.findings import Finding
from flipproof.studies.horizon import Ensemble, Horizon, Kind
from flipproof.studies.stability import DEFAULT_ITERATIONS, GRADES, StabilityPanel

COLOURS = dict(zip(GRADES, ("#7CCBA8", "#CDEBDC", "#F7DC87", "#C6B5E3", "#EDA184", "#F0F0F0"), strict=True))
SIGNS = dict(zip(GRADES, ("++", "+", "≠", "↓", "×", "–"), strict=True))
"""One colour and one sign per grade: the chart can be read without colours."""

GRADE_WORDS = {
    "excellent": "++ error ≤ 0.1 % of ω₀",
    "good": "+ error ≤ 1 %",
    "wrong": "≠ whole, but error > 1 %",
    "sinks in": "↓ stopped: slices sink in (shorten Δt)",
    "explodes": "× stopped: joints open (iterate more)",
    "not run": "– not run",
}

ROWS: tuple[tuple[tuple[Kind, ...], str], ...] = (
    (("angle", "order"), "arithmetic: angle, order"),
    (("release",), "flight: angle and spin"),
)
"""Kinds of ensembles in each row of the horizon plot."""

ORDER_LINE = "#000000"
WIDTH_FLOOR = 1e-16

TABLE_COLUMNS = (("engine", 0.0), ("fact", 0.1), ("number", 0.66), ("threshold", 0.8), ("", 0.955))
TABLE_SIGNS = {"pass": ("✓", "#0B6E4F"), "fail": ("✗", "#B00020"), "not evaluated": ("–", "#666666")}
WRAP = 66
LINE = 0.2
"""Height of a line of the table [inch]."""


@styled
def figure_stability(panels: Sequence[StabilityPanel]) -> Figure:
    """Grades over step and iterations, one panel per bottle: colour, sign and number in every cell."""
    columns = min(2, len(panels))
    rows = math.ceil(len(panels) / columns)
    height = 1.2 + rows * (1.0 + 0.4 * len(panels[0].iterations))
    figure, axes = new_figure(rows, columns, size=(8.0, height), squeeze=False)
    for at, panel in zip(axes.flat, panels, strict=False):
        _draw_panel(at, panel)
    for at in axes.flat[len(panels) :]:
        at.set_visible(False)
    for at in axes[:, 0]:
        at.set_ylabel("iterations per step [1]")
    for at in axes[-1, :]:
        at.set_xlabel("step Δt [ms], finer to the right")
    present = [grade for grade in GRADES if any(panel.counts[grade] for panel in panels)]
    handles: list[Artist] = [
        Patch(facecolor=COLOURS[grade], edgecolor="#888888", label=GRADE_WORDS[grade]) for grade in present
    ]
    handles.append(Line2D([], [], color="black", linewidth=2.0, label="rule: enough iterations above it"))
    handles.append(Line2D([], [], color="black", linewidth=1.2, linestyle="--", label="pymunk's default iterations"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_panel(axes: Axes, panel: StabilityPanel) -> None:
    for (row, column), grade in np.ndenumerate(panel.grade):
        corner = (column - 0.5, row - 0.5)
        axes.add_patch(Rectangle(corner, 1, 1, facecolor=COLOURS[grade], edgecolor="white", linewidth=1.0))
        axes.text(column, row, _cell_text(panel, row, column), ha="center", va="center", fontsize=7.5)
    axes.set_xlim(-0.5, len(panel.dt) - 0.5)
    axes.set_ylim(-0.5, len(panel.iterations) - 0.5)
    axes.set_xticks(range(len(panel.dt)), [f"{1e3 * dt:g}" for dt in panel.dt])
    axes.set_yticks(range(len(panel.iterations)), [str(n) for n in panel.iterations])
    axes.grid(visible=False)
    for row in np.flatnonzero(panel.iterations == DEFAULT_ITERATIONS):
        axes.add_patch(
            Rectangle((-0.47, row - 0.47), len(panel.dt) - 0.06, 0.94, fill=False, linestyle="--", linewidth=1.2)
        )
    # Rows are numbers of iterations, not a scale: the rule lies below the first row that follows it.
    axes.axhline(int((panel.iterations < panel.enough).sum()) - 0.5, color="black", linewidth=2.5)
    known = "" if math.isnan(panel.band) else f", reference ± {100 * panel.band:.1g} %"
    axes.set_title(
        f"M_w / M_b = {panel.mass_ratio:g}, N = {panel.slices}\nrule: {panel.enough} iterations{known}",
        fontsize=9.5, loc="left",
    )  # fmt: skip


def _cell_text(panel: StabilityPanel, row: int, column: int) -> str:
    grade, sign = panel.grade[row, column], SIGNS[panel.grade[row, column]]
    if grade == "not run":
        return sign
    if grade in ("explodes", "sinks in"):
        held = panel.held_until[row, column]
        # Not even the first output after release, one longest step later.
        return f"{sign}\n{1e3 * held:.0f} ms" if held > 0.0 else f"{sign}\n< {1e3 * panel.dt.max():g} ms"
    return f"{sign}\n{100 * panel.error[row, column]:.2g} %"


@styled
def figure_horizon(studies: Sequence[Horizon]) -> Figure:
    """Width of every ensemble over time: above what arithmetic alone does, below what the flight amplifies.

    At least one solver must have ensembles; one that has none is named in the legend.
    """
    made = [study for study in studies if study.ensembles]
    figure, axes = new_figure(len(ROWS), len(made), size=(8.0, 6.2), sharex=True, sharey=True, squeeze=False)
    sizes = sorted({e.size for study in made for e in study.ensembles if math.isfinite(e.size)})
    band = made[0].ensembles[0].band
    for column, study in enumerate(made):
        colour = solver_style(study.solver, column)["color"]
        for row, (kinds, _) in enumerate(ROWS):
            chosen = [ensemble for kind in kinds for ensemble in study.of_kind(kind)]
            _draw_widths(axes[row, column], chosen, sizes, colour)
        axes[0, column].set_title(study.solver, fontsize=10, loc="left", color=colour)
        axes[-1, column].set_xlabel("time t [s]")
    for at, (_, words) in zip(axes[:, 0], ROWS, strict=True):
        at.set_ylabel(f"width of ω / ω₀ [1]\n{words}")
    finite = [e.width[np.isfinite(e.width)].max(initial=0.0) for study in made for e in study.ensembles]
    for at in axes.flat:
        # Before the first line: nothing is left to scale where all widths are zero.
        at.set_ylim(WIDTH_FLOOR / 3, 10 * max(band, *finite))
        at.axhline(band, color="#B00020", linewidth=1.2, linestyle=":")
    axes[0, 0].annotate(
        f"band {band:g}", (0.02, band), xycoords=("axes fraction", "data"), va="bottom", fontsize=9, color="#B00020"
    )
    grey = "#444444"
    handles: list[Artist] = [
        Line2D([], [], color=grey, linestyle=SIZE_LINES[k % len(SIZE_LINES)], label=f"change of {size:.0e}")
        for k, size in enumerate(sizes)
    ]
    if any(study.of_kind("order") for study in made):
        handles.append(Line2D([], [], color=ORDER_LINE, linewidth=1.8, label="other orders of the bodies"))
    if any(study.horizon is not None for study in made):
        handles.append(Line2D([], [], linestyle="", marker="o", color=grey, label="horizon: band left"))
    handles += [
        Line2D([], [], linestyle="", label=f"{study.solver}: not run") for study in studies if not study.ensembles
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_widths(axes: Axes, ensembles: Sequence[Ensemble], sizes: Sequence[float], colour: str) -> None:
    axes.set_yscale("log")
    axes.margins(x=0.01)
    for ensemble in ensembles:
        order = ensemble.kind == "order"
        line = "-" if order else SIZE_LINES[sizes.index(ensemble.size) % len(SIZE_LINES)]
        seen = np.isfinite(ensemble.width) & (ensemble.width > 0.0)
        if seen.any():
            axes.plot(
                ensemble.t, np.where(seen, np.maximum(ensemble.width, WIDTH_FLOOR), np.nan), linestyle=line,
                color=ORDER_LINE if order else colour, linewidth=1.8 if order else 1.2,
            )  # fmt: skip
        if ensemble.horizon is not None:
            axes.plot(
                ensemble.horizon, ensemble.band, "o", color=colour, markeredgecolor="white", markersize=7, zorder=4
            )
        if ensemble.ended is not None:
            axes.axvline(ensemble.ended, color=colour, linewidth=1.0, linestyle="--")
    if ensembles and not any(ensemble.width.any() for ensemble in ensembles):
        axes.text(0.5, 0.5, "exactly 0", transform=axes.transAxes, ha="center", va="center", color=colour)


@styled
def figure_gallery(findings: Sequence[Finding], engines: Sequence[str]) -> Figure:
    """Table of facts: engine, fact, number, threshold, sign; ``engines`` names the engine of each finding."""
    texts = [textwrap.wrap(finding.title, WRAP) for finding in findings]
    lines = sum(len(text) for text in texts) + 0.6 * len(texts) + 1.6
    figure, axes = new_figure(size=(8.0, LINE * lines + 0.1))
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    axes.set_ylim(lines, 0)
    for heading, x in TABLE_COLUMNS:
        axes.text(x, 0.9, heading, fontsize=9, fontweight="bold", va="center")
    top = 1.5
    for finding, engine, text in zip(findings, engines, texts, strict=True):
        axes.axhline(top, color="#cccccc", linewidth=0.8)
        middle = top + 0.3 + len(text) / 2
        sign, colour = TABLE_SIGNS.get(finding.verdict, TABLE_SIGNS["not evaluated"])
        cells = (engine, "\n".join(text), finding.value_text, finding.threshold_text, sign)
        for (_, x), cell in zip(TABLE_COLUMNS, cells, strict=True):
            axes.text(
                x, middle, cell, fontsize=8.5 if cell is not sign else 12, va="center", linespacing=1.25,
                color=colour if cell is sign else "black",
            )  # fmt: skip
        top += len(text) + 0.6
    axes.axhline(top, color="#cccccc", linewidth=0.8)
    return figure
