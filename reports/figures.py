"""The figures of the report: data in, a matplotlib Figure out. Never pyplot, nothing global, nothing saved here."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from io import BytesIO
from typing import Any, TypeVar, cast

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

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
ASSUMPTIONS = ("#E69F00", "#6A5ACD", "#CC79A7", "#882255", "#000000")
ICE_FLOOR = 1e-18
OTHERS = ("#CC79A7", "#E69F00", "#000000", "#999933", "#882255")
MARKERS = "os^Dv<>"

STYLE: dict[Any, Any] = {
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


Maker = TypeVar("Maker", bound=Callable[..., Any])


def styled(function: Maker) -> Maker:
    """Run a function under the report's style without touching matplotlib's global settings."""

    @wraps(function)
    def run(*arguments: Any, **options: Any) -> Any:
        with mpl.rc_context(STYLE):
            return function(*arguments, **options)

    return cast(Maker, run)


@styled
def draw(figure: Figure) -> Drawing:
    """Render a figure; the same data give the same bytes (fixed ids, no date)."""
    svg, png = BytesIO(), BytesIO()
    figure.savefig(svg, format="svg", metadata={"Date": None})
    figure.savefig(png, format="png", dpi=160)
    return Drawing(svg.getvalue().decode("utf-8"), png.getvalue())


def _style(label: str, k: int = 0) -> dict[str, Any]:
    return STYLES.get(label, {"color": OTHERS[k % len(OTHERS)], "linestyle": "-.", "linewidth": 1.4})


def _new(rows: int = 1, columns: int = 1, *, size: tuple[float, float] = WIDE, **options: Any) -> tuple[Figure, Any]:
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def _legend(figure: Figure, axes: Axes, columns: int = 5) -> None:
    handles, labels = axes.get_legend_handles_labels()
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


@styled
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


@styled
def figure_differences(differences: Sequence[Difference]) -> Figure:
    """Size of every difference over time on a logarithmic scale, with the parting band and moments."""
    figure, axes = _new(size=(8.0, 4.6))
    axes.axhline(PARTING_BAND, color="#444444", linewidth=1.0, linestyle=":")
    axes.text(1.005, PARTING_BAND, f"{PARTING_BAND:.0%}", transform=axes.get_yaxis_transform(), va="center", fontsize=9)
    for k, difference in enumerate(differences):
        colour = ASSUMPTIONS[k % len(ASSUMPTIONS)]
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


@styled
def figure_step_size(flights: Sequence[StepSize], starts: Sequence[StepSize]) -> Figure:
    """Error against step size: over the whole flight (left) and before the first impact (right)."""
    figure, panels = _new(1, 2, size=(8.0, 4.4))
    for axes, studies, title in ((panels[0], flights, "whole flight"), (panels[1], starts, "before the first impact")):
        for k, study in enumerate(studies):
            style = _style(study.scheme, k)
            low, high = study.error.min(axis=1), study.error.max(axis=1)
            axes.fill_between(study.mean_dt, low, high, color=style["color"], alpha=0.25, linewidth=0)
            axes.loglog(
                study.mean_dt, study.mean_error, marker=MARKERS[k], color=style["color"], linewidth=1.4,
                label=f"{study.scheme} → {study.model}",
            )  # fmt: skip
            axes.text(
                0.03, 0.96 - 0.07 * k, f"{study.scheme}: order {study.order:.2f}", transform=axes.transAxes,
                va="top", fontsize=9, color=STYLES.get(study.model, style)["color"],
            )  # fmt: skip
        if studies:
            dt = studies[0].mean_dt
            top = max(study.mean_error[0] for study in studies) * 2.0
            axes.loglog(dt, top * dt / dt[0], color="#444444", linestyle=":", linewidth=1.0, label="slope 1")
        axes.set_title(title, fontsize=10, loc="left")
        axes.set_xlabel("step Δt [s]")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_minor_formatter(NullFormatter())
    panels[0].set_ylabel("max |ω − ω of its equation| / ω₀ [1]")
    _legend(figure, panels[0] if flights else panels[1], columns=3)
    return figure


@styled
def figure_ice(drifts: Sequence[IceDrift]) -> Figure:
    """Drift of omega in the ice case over time, on a logarithmic scale with a floor."""
    figure, axes = _new(size=(8.0, 4.3))
    colours = ("#D55E00", "#7A3600", "#56B4E9", "#00466E", "#009E73", "#882255", "#CC79A7", "#E69F00")
    exact = 0
    for k, ice in enumerate(drifts):
        # Runs that do not drift at all would lie on one another: each gets its own line just above the floor.
        floor = ICE_FLOOR * 3.0**exact
        exact += ice.largest == 0.0
        words = "none" if ice.largest == 0.0 else f"{ice.largest:.1e}"
        axes.semilogy(
            ice.t, np.maximum(ice.drift, floor), color=colours[k % len(colours)], linewidth=1.5,
            label=f"{ice.label}: {words}",
        )  # fmt: skip
    axes.set_ylim(ICE_FLOOR / 3, 1e-2)
    axes.set_xlabel("time t [s]")
    axes.set_ylabel(f"|ω / ω₀ − 1| [1], zero drawn below {1000 * ICE_FLOOR:.0e}")
    axes.margins(x=0.01)
    _legend(figure, axes, columns=2)
    return figure


@styled
def figure_slice_count(studies: Mapping[str, SliceCount]) -> Figure:
    """Angular velocity for several numbers of slices, one panel per scheme."""
    figure, panels = _new(1, len(studies), size=(8.0, 4.0), sharey=True, squeeze=False)
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
    _legend(figure, panels[0], columns=7)
    return figure
