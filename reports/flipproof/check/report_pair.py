"""The curves of two reports, one over the other, and their difference."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from flipproof.figures.style import new_figure, shared_legend, styled
from flipproof.frame.columns import Series
from slicemodel.trajectory import FloatArray


def differences(old: Series, new: Series) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return new minus old by the curves' names, at the old curve's times up to where the shorter of the two ends.

    The new curve is linear between its times.
    """
    differences = {}
    for name in (name for name in old if name in new):
        (t, before), (times, after) = old[name], new[name]
        together = (t >= times[0]) & (t <= times[-1])
        differences[name] = (t[together], np.interp(t[together], times, after) - before[together])
    return differences


@styled
def figure_report_pair(old: Series, new: Series, apart: Mapping[str, tuple[FloatArray, FloatArray]]) -> Figure:
    """One row per curve that both have: left both of them, right new minus old on its own scale."""
    figure, grid = new_figure(len(apart), 2, size=(8.0, 1.1 + 1.7 * len(apart)), sharex=True, squeeze=False)
    for (left, right), (name, (t, difference)) in zip(grid, apart.items(), strict=True):
        left.plot(*old[name], label="old", color="#56B4E9", linewidth=3.0)
        left.plot(*new[name], label="new", color="#1a1a1a", linestyle=(0, (4, 3)), linewidth=1.3)
        left.set_title(name, fontsize=10, loc="left")
        left.set_ylabel("ω / ω₀ [1]")
        right.plot(t, difference, color="#D55E00", linewidth=1.2)
        right.set_title("new minus old", fontsize=10, loc="left")
        right.set_ylabel("difference [1]")
        right.ticklabel_format(axis="y", style="sci", scilimits=(-2, 2))
        if not difference.any():
            right.set_ylim(-1.0, 1.0)
            right.set_yticks([0.0])
    for axes in grid[-1]:
        axes.set_xlabel("time t [s]")
        axes.margins(x=0.01)
    shared_legend(figure, grid[0, 0])
    return figure
