"""Size of every difference over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from flipproof.chapters.differences.study import PARTING_BAND, Difference, percent
from flipproof.figures.style import ASSUMPTIONS, MARKERS, new_figure, shared_legend, styled


@styled
def draw(differences: Sequence[Difference]) -> Figure:
    """Size of every difference over time on a logarithmic scale, with the parting band and moments."""
    figure, axes = new_figure(size=(8.0, 5.4))
    axes.axhline(PARTING_BAND, color="#444444", linewidth=1.0, linestyle=":")
    axes.text(1.005, PARTING_BAND, percent(PARTING_BAND), transform=axes.get_yaxis_transform(), va="center", fontsize=9)
    for k, difference in enumerate(differences):
        colour = ASSUMPTIONS[k % len(ASSUMPTIONS)]
        size = np.maximum(np.abs(difference.omega), 1e-12)
        line = "-" if k < len(ASSUMPTIONS) else "--"  # the colours begin anew
        axes.plot(difference.t, size, color=colour, linestyle=line, linewidth=1.4, label=difference.name)
        if difference.parting_time is not None:
            axes.plot(
                difference.parting_time,
                PARTING_BAND,
                MARKERS[k % len(MARKERS)],
                color=colour,
                markeredgecolor="white",
                markersize=8,
            )
    axes.set_yscale("log")
    axes.set_ylim(1e-7, 2.0)
    axes.set_xlabel("time t [s]")
    axes.set_ylabel("|difference in ω| / ω₀ [1]")
    axes.margins(x=0.01)
    shared_legend(figure, axes, columns=2)
    return figure
