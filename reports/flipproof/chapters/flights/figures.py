"""The flights over time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.figure import Figure

from flipproof.figures.style import new_figure, shared_legend, shown_name, solver_style, styled
from slicemodel import Trajectory


def _over_time(trajectories: Iterable[Trajectory], quantity: str, label: str) -> Figure:
    figure, axes = new_figure()
    for k, trajectory in enumerate(trajectories):
        scenario = trajectory.scenario
        values = {
            "omega": trajectory.omega / scenario.omega0,
            "theta": np.degrees(trajectory.theta),
            "r_cm": trajectory.r_cm / scenario.bottle.length,
        }[quantity]
        axes.plot(trajectory.t, values, label=shown_name(trajectory), **solver_style(trajectory.label, k))
    axes.set_xlabel("time t [s]")
    axes.set_ylabel(label)
    axes.margins(x=0.01)
    shared_legend(figure, axes)
    return figure


@styled
def figure_omega(trajectories: Iterable[Trajectory]) -> Figure:
    """Angular velocity over time."""
    figure = _over_time(trajectories, "omega", "angular velocity ω / ω₀ [1]")
    figure.axes[0].set_ylim(bottom=0.0)
    return figure


@styled
def figure_theta(trajectories: Iterable[Trajectory]) -> Figure:
    """Angle of the bottle over time."""
    return _over_time(trajectories, "theta", "angle θ [degrees]")


@styled
def figure_centre_of_mass(trajectories: Iterable[Trajectory]) -> Figure:
    """Centre of mass over time."""
    return _over_time(trajectories, "r_cm", "centre of mass r_CM / L [1], cap = 0")


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
        for k, trajectory in enumerate(trajectories):
            length = trajectory.scenario.bottle.length
            axes.plot(
                trajectory.t, trajectory.r[:, i] / length, label=shown_name(trajectory),
                **solver_style(trajectory.label, k),
            )  # fmt: skip
        axes.set_title(f"slice {i}: {words}", fontsize=10, loc="left")
        axes.set_ylabel("r / L [1]")
        axes.set_ylim(1.03, -0.03)
        axes.margins(x=0.01)
    panels[-1].set_xlabel("time t [s]")
    shared_legend(figure, panels[0])
    return figure
