"""Step size, ice and number of slices: what is the solvers' own doing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from flipproof.chapters.step_size.study import ROUND_OFF, StepSize
from flipproof.figures.style import MARKERS, STYLES, new_figure, shared_legend, solver_style, styled


@styled
def figure_step_size(flights: Sequence[StepSize], starts: Sequence[StepSize]) -> Figure:
    """Error against step size: over the whole flight (left) and before the first impact (right)."""
    figure, panels = new_figure(1, 2, size=(8.0, 4.4))
    for axes, studies, title in ((panels[0], flights, "whole flight"), (panels[1], starts, "before the first impact")):
        for k, study in enumerate(studies):
            style = solver_style(study.scheme, k)
            spread = study.error.min(axis=1), study.error.max(axis=1)
            low, high = np.maximum(spread, ROUND_OFF)
            axes.fill_between(study.mean_dt, low, high, color=style["color"], alpha=0.25, linewidth=0)
            axes.loglog(
                study.mean_dt, np.maximum(study.mean_error, ROUND_OFF), marker=MARKERS[k], color=style["color"],
                linewidth=1.4, label=f"{study.scheme} → {study.model}",
            )  # fmt: skip
            axes.text(
                0.03, 0.96 - 0.07 * k, f"{study.scheme}: order {study.order:.2f}", transform=axes.transAxes,
                va="top", fontsize=9, color=STYLES.get(study.model, style)["color"],
            )  # fmt: skip
        if studies:
            dt = studies[0].mean_dt
            top = max(ROUND_OFF, *(study.mean_error[0] for study in studies)) * 2.0
            axes.loglog(dt, top * dt / dt[0], color="#444444", linestyle=":", linewidth=1.0, label="slope 1")
        axes.set_title(title, fontsize=10, loc="left")
        axes.set_xlabel("step Δt [s]")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_minor_formatter(NullFormatter())
    panels[0].set_ylabel("max |ω − ω of its equation| / ω₀ [1]")
    shared_legend(figure, panels[0] if flights else panels[1], columns=3)
    return figure
