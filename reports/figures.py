"""The figures of the report: data in, a matplotlib Figure out. Never pyplot, nothing global, nothing saved here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports.studies.differences import PARTING_BAND, Difference
from reports.studies.ice import IceDrift
from reports.studies.slices import SliceCount
from reports.studies.step_size import StepSize
from slicemodel import Trajectory

WIDE = (8.0, 3.9)

# One hue per family, so that a scheme and the equation it converges to are seen as a pair (Okabe-Ito colours,
# told apart by most colour-blind readers; line style and marker carry the same information).
STYLES: dict[str, dict[str, Any]] = {
    "published-python": {"color": "#D55E00", "linestyle": "-", "linewidth": 1.6},
    "published-limit": {"color": "#7A3600", "linestyle": (0, (5, 3)), "linewidth": 1.4},
    "exact-step": {"color": "#56B4E9", "linestyle": "-", "linewidth": 2.4},
    "eq8": {"color": "#00466E", "linestyle": (0, (5, 3)), "linewidth": 1.4},
    "pymunk": {"color": "#009E73", "linestyle": "-", "linewidth": 1.6},
}
OTHERS = ("#CC79A7", "#E69F00", "#000000", "#999933", "#882255")
MARKERS = "os^Dv<>"

STYLE = {
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "svg.hashsalt": "flipproof",
}


@dataclass(frozen=True, slots=True)
class Drawing:
    """One finished figure as SVG text and PNG bytes."""

    svg: str
    png: bytes


def draw(figure: Figure) -> Drawing:
    """Render a figure; the same data give the same bytes (fixed ids, no date)."""
    with mpl.rc_context(STYLE):
        svg, png = BytesIO(), BytesIO()
        figure.savefig(svg, format="svg", metadata={"Date": None})
        figure.savefig(png, format="png", dpi=160)
    return Drawing(svg.getvalue().decode("utf-8"), png.getvalue())


def _style(label: str, k: int = 0) -> dict[str, Any]:
    return STYLES.get(label, {"color": OTHERS[k % len(OTHERS)], "linestyle": "-.", "linewidth": 1.4})


def _new(rows: int = 1, *, size: tuple[float, float] = WIDE, **options: Any) -> tuple[Figure, Any]:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(rows, 1, **options)
    return figure, axes


def _legend(figure: Figure, axes: Axes, columns: int = 5) -> None:
    handles, labels = axes.get_legend_handles_labels()
    with mpl.rc_context(STYLE):
        figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def _over_time(trajectories: Iterable[Trajectory], quantity: str, label: str) -> Figure:
    figure, axes = _new()
    for k, trajectory in enumerate(trajectories):
        scenario = trajectory.scenario
        values = {
            "omega": trajectory.omega / scenario.omega0,
            "theta": np.degrees(trajectory.theta),
            "r_cm": trajectory.r_cm / scenario.bottle.length,
        }[quantity]
        axes.plot(trajectory.t, values, label=_name(trajectory), **_style(trajectory.label, k))
    axes.set_xlabel("time t [s]")
    axes.set_ylabel(label)
    axes.margins(x=0.01)
    _legend(figure, axes)
    return figure


def _name(trajectory: Trajectory) -> str:
    return trajectory.label if trajectory.ok else f"{trajectory.label} ({trajectory.status})"


def figure_omega(trajectories: Iterable[Trajectory]) -> Figure:
    """Angular velocity over time."""
    figure = _over_time(trajectories, "omega", "angular velocity ω / ω₀ [1]")
    figure.axes[0].set_ylim(bottom=0.0)
    return figure


def figure_theta(trajectories: Iterable[Trajectory]) -> Figure:
    """Angle of the bottle over time."""
    return _over_time(trajectories, "theta", "angle θ [degrees]")


def figure_centre_of_mass(trajectories: Iterable[Trajectory]) -> Figure:
    """Centre of mass over time."""
    return _over_time(trajectories, "r_cm", "centre of mass r_CM / L [1], cap = 0")


def figure_slices(trajectories: Sequence[Trajectory]) -> Figure:
    """Paths of the first, the middle and the last slice, one panel each."""
    figure, panels = _new(3, size=(8.0, 7.2), sharex=True, sharey=True)
    n = trajectories[0].scenario.n_slices
    chosen = (("first slice (starts on the base)", 0), ("middle slice", n // 2), ("last slice", n - 1))
    for axes, (words, i) in zip(panels, chosen, strict=True):
        for k, trajectory in enumerate(trajectories):
            length = trajectory.scenario.bottle.length
            axes.plot(trajectory.t, trajectory.r[:, i] / length, label=_name(trajectory), **_style(trajectory.label, k))
        axes.set_title(f"{words}, number {i}", fontsize=10, loc="left")
        axes.set_ylabel("r / L [1]")
        axes.set_ylim(1.03, -0.03)
        axes.margins(x=0.01)
    panels[-1].set_xlabel("time t [s]")
    _legend(figure, panels[0])
    return figure


def figure_differences(differences: Sequence[Difference]) -> Figure:
    """Size of every difference over time on a logarithmic scale, with the parting band and moments."""
    figure, axes = _new(size=(8.0, 4.6))
    axes.axhline(PARTING_BAND, color="#444444", linewidth=1.0, linestyle=":")
    axes.annotate(
        f"{PARTING_BAND:.0%} of ω₀", (0.995, PARTING_BAND), xycoords=("axes fraction", "data"),
        ha="right", va="bottom", fontsize=8.5, color="#444444",
    )  # fmt: skip
    for k, difference in enumerate(differences):
        colour = ("#E69F00", "#56B4E9", "#CC79A7", "#009E73", "#000000")[k % 5]
        size = np.maximum(np.abs(difference.omega), 1e-12)
        axes.plot(difference.t, size, color=colour, linewidth=1.4, label=difference.name)
        if difference.parting_time is not None:
            axes.plot(
                difference.parting_time, PARTING_BAND, MARKERS[k], color=colour, markeredgecolor="white", markersize=8
            )
    axes.set_yscale("log")
    axes.set_ylim(1e-7, 2.0)
    axes.set_xlabel("time t [s]")
    axes.set_ylabel("|difference in ω| / ω₀ [1]")
    axes.margins(x=0.01)
    _legend(figure, axes, columns=2)
    return figure


def figure_step_size(flights: Sequence[StepSize], starts: Sequence[StepSize]) -> Figure:
    """Error against step size: over the whole flight (left) and before the first impact (right)."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 4.2), layout="constrained")
        panels = figure.subplots(1, 2)
    for axes, studies, title in ((panels[0], flights, "whole flight"), (panels[1], starts, "before the first impact")):
        for k, study in enumerate(studies):
            style = _style(study.scheme, k)
            low, high = study.error.min(axis=1), study.error.max(axis=1)
            axes.fill_between(study.mean_dt, low, high, color=style["color"], alpha=0.25, linewidth=0)
            axes.loglog(
                study.mean_dt, study.mean_error, marker=MARKERS[k], color=style["color"], linewidth=1.4,
                label=f"{study.scheme} → {study.model}: order {study.order:.2f}",
            )  # fmt: skip
        if studies:
            dt = studies[0].mean_dt
            top = max(study.mean_error[0] for study in studies) * 1.6
            axes.loglog(dt, top * dt / dt[0], color="#444444", linestyle=":", linewidth=1.0, label="slope 1")
            with mpl.rc_context(STYLE):
                axes.legend(loc="lower right", fontsize=8)
        axes.set_title(title, fontsize=10, loc="left")
        axes.set_xlabel("step Δt [s]")
    panels[0].set_ylabel("max |ω − ω of its equation| / ω₀ [1]")
    return figure


def figure_ice(drifts: Sequence[IceDrift]) -> Figure:
    """Drift of omega in the ice case over time, on a logarithmic scale with a floor."""
    figure, axes = _new()
    for k, ice in enumerate(drifts):
        colour = (*OTHERS, "#0072B2", "#D55E00", "#009E73", "#56B4E9")[k % 9]
        axes.semilogy(ice.t, np.maximum(ice.drift, 1e-17), color=colour, linewidth=1.3, label=ice.label)
    axes.set_ylim(1e-17, 1.0)
    axes.set_xlabel("time t [s]")
    axes.set_ylabel("|ω / ω₀ − 1| [1], floor 1e-17")
    axes.margins(x=0.01)
    _legend(figure, axes, columns=3)
    return figure


def figure_slice_count(studies: Mapping[str, SliceCount]) -> Figure:
    """Angular velocity for several numbers of slices, one panel per scheme."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 4.0), layout="constrained")
        panels = figure.subplots(1, len(studies), sharey=True, squeeze=False)[0]
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
    _legend(figure, panels[0], columns=7)
    return figure
