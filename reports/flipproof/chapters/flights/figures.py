"""The flights over time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.figure import Figure

from flipproof.figures.style import new_figure, shared_legend, shown_name, solver_style, styled
from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray

AXES = {
    "omega": "angular velocity ω / ω₀ [1]",
    "theta": "angle θ [degrees]",
    "centre-of-mass": "centre of mass r_CM / L [1], cap = 0",
}


def values_of(run: Trajectory, quantity: str) -> FloatArray:
    """Return a quantity of ``AXES`` over time, in the unit of its axis."""
    if quantity == "omega":
        return run.omega / run.scenario.omega0
    return np.degrees(run.theta) if quantity == "theta" else run.r_cm / run.scenario.bottle.length


@styled
def figure_over_time(trajectories: Iterable[Trajectory], quantity: str) -> Figure:
    """One quantity of ``AXES`` over time."""
    figure, axes = new_figure()
    for k, run in enumerate(trajectories):
        axes.plot(run.t, values_of(run, quantity), label=shown_name(run), **solver_style(run.label, k))
    axes.set_xlabel("time t [s]")
    axes.set_ylabel(AXES[quantity])
    axes.margins(x=0.01)
    shared_legend(figure, axes)
    if quantity == "omega":
        axes.set_ylim(bottom=0.0)
    return figure


def chosen_slices(trajectory: Trajectory) -> list[tuple[int, str]]:
    """Return the slices worth drawing: first, nearest the centre of mass at release, last; fewer if they coincide."""
    nearest = int(np.abs(trajectory.r[0] - trajectory.r_cm[0]).argmin())
    words = {0: "starts on the base", trajectory.scenario.n_slices - 1: "starts on top of the water"}
    words.setdefault(nearest, "starts nearest the centre of mass")
    return sorted(words.items())


@styled
def figure_slices(trajectories: Sequence[Trajectory]) -> Figure:
    """Paths of a few slices, one panel each."""
    chosen = chosen_slices(trajectories[0])
    size = (8.0, 1.2 + 2.0 * len(chosen))
    figure, grid = new_figure(len(chosen), size=size, sharex=True, sharey=True, squeeze=False)
    panels = grid[:, 0]
    for axes, (i, words) in zip(panels, chosen, strict=True):
        for k, run in enumerate(trajectories):
            length = run.scenario.bottle.length
            axes.plot(run.t, run.r[:, i] / length, label=shown_name(run), **solver_style(run.label, k))
        axes.set_title(f"slice {i}: {words}", fontsize=10, loc="left")
        axes.set_ylabel("r / L [1]")
        axes.set_ylim(1.03, -0.03)
        axes.margins(x=0.01)
    panels[-1].set_xlabel("time t [s]")
    shared_legend(figure, panels[0])
    return figure
