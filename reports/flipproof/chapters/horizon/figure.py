"""The widths of ensembles over time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flipproof.chapters.horizon.study import Ensemble, Horizon, Kind
from flipproof.chapters.predictability.figure import SIZE_LINES
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
