"""Step size, ice and number of slices: what is the solvers' own doing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from flipproof.figures.style import ICE_FLOOR, MARKERS, STYLES, new_figure, shared_legend, solver_style, styled
from flipproof.studies.ice import IceDrift
from flipproof.studies.slices import SliceCount
from flipproof.studies.step_size import ROUND_OFF, StepSize


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


@styled
def figure_ice(drifts: Sequence[IceDrift]) -> Figure:
    """Drift of omega in the ice case over time, on a logarithmic scale with a floor."""
    figure, axes = new_figure(size=(8.0, 4.3))
    others = iter(("#882255", "#CC79A7", "#E69F00"))
    exact = 0
    for ice in drifts:
        # Runs that do not drift at all would lie on one another: each gets its own line just above the floor.
        floor = ICE_FLOOR * 3.0**exact
        exact += ice.largest == 0.0
        words = "none" if ice.largest == 0.0 else f"{ice.largest:.1e}"
        known = STYLES.get(ice.label.removesuffix(" rigid"))
        axes.semilogy(
            ice.t, np.maximum(ice.drift, floor), color=known["color"] if known else next(others), linewidth=1.5,
            label=f"{ice.label}: {words}",
        )  # fmt: skip
    axes.set_ylim(ICE_FLOOR / 3, 1e-2)
    axes.set_xlabel("time t [s]")
    axes.set_ylabel(f"|ω / ω₀ − 1| [1], zero drawn below {1000 * ICE_FLOOR:.0e}")
    axes.margins(x=0.01)
    shared_legend(figure, axes, columns=2)
    return figure


@styled
def figure_slice_count(studies: Mapping[str, SliceCount]) -> Figure:
    """Angular velocity for several numbers of slices, one panel per scheme."""
    figure, panels = new_figure(1, len(studies), size=(8.0, 4.0), sharey=True, squeeze=False)
    panels = panels[0]
    for axes, (scheme, study) in zip(panels, studies.items(), strict=True):
        colours = mpl.colormaps["viridis"](np.linspace(0.9, 0.0, len(study.counts)))
        for n, trajectory, colour in zip(study.counts, study.trajectories, colours, strict=True):
            omega = trajectory.omega / trajectory.scenario.omega0
            axes.plot(trajectory.t, omega, color=colour, linewidth=1.3, label=f"{n} slices")
        axes.set_title(scheme, fontsize=10, loc="left")
        axes.set_xlabel("time t [s]")
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.01)
    panels[0].set_ylabel("angular velocity ω / ω₀ [1]")
    shared_legend(figure, panels[0], columns=7)
    return figure
