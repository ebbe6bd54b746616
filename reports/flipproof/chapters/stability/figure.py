"""The stability chart: grades over step and iterations."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from flipproof.chapters.stability.study import DEFAULT_ITERATIONS, StabilityPanel
from flipproof.figures.style import new_figure, styled

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
    handles: list[Artist] = [
        Patch(facecolor=colour, edgecolor="#888888", label=words)
        for grade, (colour, _, words) in LOOKS.items()
        if any(panel.counts[grade] for panel in panels)
    ]
    handles.append(Line2D([], [], color="black", linewidth=2.0, label="rule: enough iterations above it"))
    handles.append(Line2D([], [], color="black", linewidth=1.2, linestyle="--", label="pymunk's default iterations"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_panel(axes: Axes, panel: StabilityPanel) -> None:
    for (row, column), grade in np.ndenumerate(panel.grade):
        corner = (column - 0.5, row - 0.5)
        axes.add_patch(Rectangle(corner, 1, 1, facecolor=LOOKS[grade][0], edgecolor="white", linewidth=1.0))
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
    grade = panel.grade[row, column]
    sign = LOOKS[grade][1]
    if grade == "not run":
        return sign
    if grade in ("explodes", "sinks in"):
        held = panel.held_until[row, column]
        # Not even the first output after release, one longest step later.
        return f"{sign}\n{1e3 * held:.0f} ms" if held > 0.0 else f"{sign}\n< {1e3 * panel.dt.max():g} ms"
    return f"{sign}\n{100 * panel.error[row, column]:.2g} %"
