"""Size of every difference over time, one panel a pair."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from flipproof.chapters.differences.study import PARTING_BAND, Difference, percent
from flipproof.figures.style import new_figure, styled

COLUMNS = 3
LEAST, MOST = 1e-6, 2.0
"""Ends of the axis, as shares of omega_0."""

LINE, LIMIT = "#0072B2", "#B00020"


@styled
def draw(differences: Sequence[Difference]) -> Figure:
    """Draw a panel a pair on one logarithmic scale, with the parting band and when it is first passed."""
    rows = -(-len(differences) // COLUMNS)
    figure, grid = new_figure(
        rows, COLUMNS, size=(8.0, 0.5 + 1.75 * rows), sharex=True, sharey=True, squeeze=False,
    )  # fmt: skip
    for axes, difference in zip(grid.flat, differences, strict=False):
        axes.plot(difference.t, np.maximum(np.abs(difference.omega), LEAST / 10), color=LINE, linewidth=1.2)
        axes.axhline(PARTING_BAND, color=LIMIT, linewidth=1.0, linestyle=":")
        if difference.parting_time is not None:
            axes.plot(difference.parting_time, PARTING_BAND, "o", color=LIMIT, markeredgecolor="white", markersize=7)
        words = f"{textwrap.fill(difference.name, 32)}\nat most {percent(difference.largest)}"
        axes.set_title(words, fontsize=9, loc="left")
        axes.margins(x=0.02)
    for axes in grid.flat[len(differences) :]:
        axes.remove()
    grid[0, 0].set_yscale("log")
    grid[0, 0].set_ylim(LEAST, MOST)
    for axes in grid[:, 0]:
        axes.set_ylabel("|difference| [1]")
    for column in range(COLUMNS):
        lowest = grid[(len(differences) - 1 - column) // COLUMNS, column]
        lowest.set_xlabel("time t [s]")
        lowest.tick_params(labelbottom=True)
    return figure
