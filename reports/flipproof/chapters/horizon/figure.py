"""The widths of ensembles over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flipproof.chapters.horizon.study import Ensemble, Horizon, Kind
from flipproof.chapters.predictability.figure import SIZE_LINES
from flipproof.chapters.predictability.study import HORIZON_BAND
from flipproof.figures.style import new_figure, solver_style, styled

ROWS: tuple[tuple[tuple[Kind, ...], str], ...] = (
    (("angle", "order"), "arithmetic: angle, order"),
    (("release",), "flight: angle and spin"),
)
"""Kinds of ensembles in each row of the horizon plot."""

ORDER_LINE = "#000000"
WIDTH_FLOOR = 1e-16


@styled
def figure_horizon(studies: Sequence[Horizon]) -> Figure:
    """Width of every ensemble over time: above what arithmetic alone does, below what the flight amplifies.

    At least one solver must have ensembles; one that has none is named in the legend.
    """
    red, grey = "#B00020", "#444444"
    made = [study for study in studies if study.ensembles]
    figure, axes = new_figure(len(ROWS), len(made), size=(8.0, 6.2), sharex=True, sharey=True, squeeze=False)
    sizes = sorted({e.size for study in made for e in study.ensembles if math.isfinite(e.size)})
    for column, study in enumerate(made):
        colour = solver_style(study.solver, column)["color"]
        for row, (kinds, _) in enumerate(ROWS):
            _draw_widths(axes[row, column], study.of_kind(*kinds), sizes, colour)
        axes[0, column].set_title(study.solver, fontsize=10, loc="left", color=colour)
        axes[-1, column].set_xlabel("time t [s]")
    for at, (_, words) in zip(axes[:, 0], ROWS, strict=True):
        at.set_ylabel(f"width of ω / ω₀ [1]\n{words}")
    finite = [e.width[np.isfinite(e.width)].max(initial=0.0) for study in made for e in study.ensembles]
    for at in axes.flat:
        # Before the first line: nothing is left to scale where all widths are zero.
        at.set_ylim(WIDTH_FLOOR / 3, 10 * max(HORIZON_BAND, *finite))
        at.axhline(HORIZON_BAND, color=red, linewidth=1.2, linestyle=":")
    place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "va": "bottom", "fontsize": 9, "color": red}
    axes[0, 0].annotate(f"band {HORIZON_BAND:g}", (0.02, HORIZON_BAND), **place)
    lines = zip(sizes, cycle(SIZE_LINES), strict=False)
    handles = [Line2D([], [], color=grey, linestyle=line, label=f"change of {size:.0e}") for size, line in lines]
    if any(study.of_kind("order") for study in made):
        handles.append(Line2D([], [], color=ORDER_LINE, linewidth=1.8, label="other orders of the bodies"))
    if any(study.horizon is not None for study in made):
        handles.append(Line2D([], [], linestyle="", marker="o", color=grey, label="horizon: band left"))
    idle = [study.solver for study in studies if not study.ensembles]
    handles += [Line2D([], [], linestyle="", label=f"{solver}: not run") for solver in idle]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_widths(axes: Axes, ensembles: Sequence[Ensemble], sizes: Sequence[float], colour: str) -> None:
    axes.set_yscale("log")
    axes.margins(x=0.01)
    for ensemble in ensembles:
        seen = np.isfinite(ensemble.width) & (ensemble.width > 0.0)
        shown = np.where(seen, np.maximum(ensemble.width, WIDTH_FLOOR), np.nan)
        if seen.any() and ensemble.kind == "order":
            axes.plot(ensemble.t, shown, color=ORDER_LINE, linewidth=1.8)
        elif seen.any():
            line = SIZE_LINES[sizes.index(ensemble.size) % len(SIZE_LINES)]
            axes.plot(ensemble.t, shown, color=colour, linestyle=line, linewidth=1.2)
        if ensemble.horizon is not None:
            look: dict[str, Any] = {"color": colour, "markeredgecolor": "white", "markersize": 7, "zorder": 4}
            axes.plot(ensemble.horizon, HORIZON_BAND, "o", **look)
        if ensemble.ended is not None:
            axes.axvline(ensemble.ended, color=colour, linewidth=1.0, linestyle="--")
    if ensembles and not any(ensemble.width.any() for ensemble in ensembles):
        axes.text(0.5, 0.5, "exactly 0", transform=axes.transAxes, ha="center", va="center", color=colour)
