"""The spread of omega after tiny changes of the release."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from flipproof.chapters.predictability.study import HORIZON_BAND, Predictability
from flipproof.figures.style import new_figure, solver_style, styled

SIZE_LINES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (3, 1.5, 1, 1.5)), (0, (1, 1.5)))


@styled
def figure_predictability(studies: Sequence[Predictability]) -> Figure:
    """Spread of ω after tiny changes of the release, one panel per solver and one line style per size."""
    figure, panels = new_figure(
        1, len(studies), size=(max(8.0, 2.9 * len(studies)), 4.4), sharex=True, sharey=True, squeeze=False
    )
    for k, (axes, study) in enumerate(zip(panels[0], studies, strict=True)):
        colour = solver_style(study.solver, k)["color"]
        axes.axhline(HORIZON_BAND, color="#444444", linewidth=1.0, linestyle=":")
        for j, (row, horizon) in enumerate(zip(study.spread, study.horizons, strict=True)):
            shown = np.where(np.isfinite(row), row, np.nan)
            axes.plot(study.t, shown, color=colour, linestyle=SIZE_LINES[j % len(SIZE_LINES)], linewidth=1.3)
            if horizon is not None:
                axes.plot(horizon, HORIZON_BAND, "o", color=colour, markeredgecolor="white", markersize=7, zorder=4)
        axes.set_yscale("log")
        axes.set_title(study.solver, fontsize=10, loc="left", color=colour)
        axes.set_xlabel("time t [s]")
        axes.margins(x=0.01)
    panels[0][0].set_ylabel("largest |change of ω| / ω₀ [1]")
    handles = [
        Line2D(
            [], [], color="#444444", linestyle=SIZE_LINES[j % len(SIZE_LINES)], label=f"release changed by {size:.0e}"
        )
        for j, size in enumerate(studies[0].sizes)
    ]
    handles.append(Line2D([], [], color="#444444", linestyle=":", linewidth=1.0, label=f"band {HORIZON_BAND:g}"))
    if any(study.horizon is not None for study in studies):
        handles.append(Line2D([], [], linestyle="", marker="o", color="#444444", label="horizon"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure
