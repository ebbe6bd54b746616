"""Impacts of two runs side by side, a curve in its tube, and the growth of tiny changes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from flipproof.chapters.alignment.found import Alignment, Keyed, Rests
from flipproof.chapters.alignment.tube import Tube
from flipproof.chapters.predictability.study import Predictability
from flipproof.figures.style import new_figure, shared_legend, solver_style, styled
from slicemodel.trajectory import BASE, CAP

MOST_ROWS = 16
FIRST_LANE, SECOND_LANE = 0.2, -0.2
END_COLOURS = {BASE: "#0072B2", CAP: "#E69F00"}
END_MARKERS = {BASE: "v", CAP: "^"}
SIZE_LINES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (3, 1.5, 1, 1.5)), (0, (1, 1.5)))

IMPACTS: dict[str, dict[str, Any]] = {
    "agrees": {"color": "#444444", "markersize": 3.5},
    "shifted": {"color": "#009E73", "markersize": 5.0},
    "missing": {"color": "#D1001C", "markersize": 6.5},
    "extra": {"color": "#A030C0", "markersize": 6.5},
    "after a fork": {"color": "#BBBBBB", "markersize": 3.5},
}

SIGNAL_LABELS = {
    "omega": "angular velocity ω [rad/s]",
    "theta": "angle θ [rad]",
    "r_cm": "centre of mass r_CM [m], cap = 0",
    "inertia": "moment of inertia J [kg m²]",
}


def even_rows(n_slices: int, most: int = MOST_ROWS) -> list[int]:
    """Return at most ``most`` slices, evenly chosen, the first and the last among them."""
    return [int(i) for i in np.unique(np.linspace(0, n_slices - 1, min(most, n_slices)).round())]


@styled
def figure_gantt(alignment: Alignment, *, slices: Sequence[int] | None = None) -> Figure:
    """Contacts and impacts of two runs, one row per slice: the first run above, the second paler below."""
    chosen = even_rows(alignment.n_slices) if slices is None else list(slices)
    rows = {i: row for row, i in enumerate(chosen)}
    figure, axes = new_figure(size=(8.0, 1.9 + 0.36 * len(rows)))
    axes.grid(visible=False)
    for row in range(1, len(rows), 2):
        axes.axhspan(row - 0.5, row + 0.5, color="#f4f4f4", linewidth=0)
    for rests, lane, opacity in zip(alignment.rests, (FIRST_LANE, SECOND_LANE), (0.9, 0.4), strict=True):
        _draw_rests(axes, rests, rows, lane, opacity, alignment.until)
    _draw_impacts(axes, alignment, rows)
    for fork in alignment.forks:
        if fork.slice in rows:
            axes.plot(fork.time, rows[fork.slice], "*", color="black", markersize=9, zorder=5)
    axes.set_yticks(range(len(rows)), [str(i) for i in rows])
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.set_xlim(-0.01 * alignment.until, 1.01 * alignment.until)
    axes.set_xlabel("time t [s]")
    axes.set_ylabel("slice number [1], 0 starts on the base")
    title = (
        f"in each row: {alignment.first} above, {alignment.second} below; {len(alignment.swapped)} neighbours swapped"
    )
    axes.set_title(title, fontsize=10, loc="left")
    figure.legend(handles=_gantt_handles(alignment), loc="outside lower center", ncols=4)
    return figure


def _draw_rests(axes: Axes, rests: Rests, rows: dict[int, int], lane: float, opacity: float, until: float) -> None:
    for i, end, start, stop in zip(rests.slice, rests.end, rests.start, rests.stop, strict=True):
        if int(i) in rows and start <= until:
            axes.barh(
                rows[int(i)] + lane,
                min(stop, until) - start,
                left=start,
                height=0.3,
                color=END_COLOURS[int(end)],
                alpha=opacity,
                linewidth=0,
            )


def _draw_impacts(axes: Axes, alignment: Alignment, rows: dict[int, int]) -> None:
    """Mark every impact in its lane, and join the two of a shifted pair."""
    matched, moved = alignment.matched, alignment.shifted
    second = matched.time + alignment.shift
    for k in np.flatnonzero(moved):
        if int(matched.slice[k]) in rows:
            row = rows[int(matched.slice[k])]
            ends = (row + FIRST_LANE, row + SECOND_LANE)
            axes.plot((matched.time[k], second[k]), ends, color=IMPACTS["shifted"]["color"], linewidth=0.6, alpha=0.7)
    for chosen, kind in ((~moved, "agrees"), (moved, "shifted")):
        part = Keyed(
            time=matched.time[chosen], slice=matched.slice[chosen], end=matched.end[chosen], k=matched.k[chosen]
        )
        later = Keyed(time=second[chosen], slice=part.slice, end=part.end, k=part.k)
        _mark(axes, part, rows, FIRST_LANE, kind)
        _mark(axes, later, rows, SECOND_LANE, kind)
    for after, lane in zip(alignment.after_fork, (FIRST_LANE, SECOND_LANE), strict=True):
        _mark(axes, after, rows, lane, "after a fork")
    _mark(axes, alignment.missing, rows, FIRST_LANE, "missing")
    _mark(axes, alignment.extra, rows, SECOND_LANE, "extra")


def _mark(axes: Axes, impacts: Keyed, rows: dict[int, int], lane: float, kind: str) -> None:
    for end, marker in END_MARKERS.items():
        shown = np.flatnonzero((impacts.end == end) & np.isin(impacts.slice, list(rows)))
        heights = [rows[int(i)] + lane for i in impacts.slice[shown]]
        axes.plot(
            impacts.time[shown],
            heights,
            marker,
            color=IMPACTS[kind]["color"],
            markersize=IMPACTS[kind]["markersize"],
            markeredgecolor="white",
            markeredgewidth=0.3,
            zorder=3 if kind == "agrees" else 4,
        )


def _gantt_handles(alignment: Alignment) -> list[Patch | Line2D]:
    counts = {
        "agrees": f"agrees within {alignment.shift_band * 1e3:g} ms ({int((~alignment.shifted).sum())})",
        "shifted": f"shifted further ({int(alignment.shifted.sum())})",
        "missing": f"missing in {alignment.second} ({len(alignment.missing)})",
        "extra": f"extra in {alignment.second} ({len(alignment.extra)})",
        "after a fork": "after a fork ({} + {})".format(*map(len, alignment.after_fork)),
    }
    handles: list[Patch | Line2D] = [
        Patch(color=END_COLOURS[BASE], label="in contact with the base"),
        Patch(color=END_COLOURS[CAP], label="in contact with the cap"),
        Line2D([], [], linestyle="", marker="v", color="#444444", label="impact on the base"),
        Line2D([], [], linestyle="", marker="^", color="#444444", label="impact on the cap"),
    ]
    handles += [
        Line2D([], [], linestyle="", marker="o", color=IMPACTS[kind]["color"], label=label)
        for kind, label in counts.items()
    ]
    handles.append(
        Line2D([], [], linestyle="", marker="*", markersize=9, color="black", label=f"fork ({len(alignment.forks)})")
    )
    return handles


@styled
def figure_tube(tube: Tube) -> Figure:
    """Draw a curve in the tube around its reference, with what lies outside marked."""
    figure, axes = new_figure()
    reference, run = (solver_style(label, k) for k, label in enumerate((tube.first, tube.second)))
    words = f"tube: ±{tube.dt * 1e3:g} ms and ±{tube.dy:.3g} {_unit(tube.signal)}"
    axes.fill_between(tube.t, tube.lower, tube.upper, color=reference["color"], alpha=0.2, linewidth=0, label=words)
    axes.plot(tube.t, tube.reference, label=tube.first, **{**reference, "linewidth": 1.0})
    axes.plot(tube.t, tube.value, label=tube.second, **{**run, "linewidth": 1.4})
    if not tube.inside:
        outside = ~((tube.value >= tube.lower) & (tube.value <= tube.upper))
        axes.plot(
            tube.t,
            np.where(outside, tube.value, np.nan),
            color="#D1001C",
            linewidth=3.5,
            alpha=0.45,
            zorder=1.5,
            label=f"outside ({1 - tube.share:.0%} of the time)",
        )
        axes.axvline(tube.first_exit or 0.0, color="#444444", linewidth=1.0, linestyle=":", label="first exit")
    axes.set_xlabel("time t [s]")
    axes.set_ylabel(SIGNAL_LABELS.get(tube.signal, f"{tube.signal} [m], cap = 0"))
    axes.margins(x=0.01)
    shared_legend(figure, axes, columns=3 if tube.inside else 5)
    return figure


def _unit(signal: str) -> str:
    return {"omega": "rad/s", "theta": "rad", "inertia": "kg m²"}.get(signal, "m")


@styled
def figure_predictability(studies: Sequence[Predictability]) -> Figure:
    """Spread of ω after tiny changes of the release, one panel per solver and one line style per size."""
    figure, panels = new_figure(
        1, len(studies), size=(max(8.0, 2.9 * len(studies)), 4.4), sharex=True, sharey=True, squeeze=False
    )
    for k, (axes, study) in enumerate(zip(panels[0], studies, strict=True)):
        colour = solver_style(study.solver, k)["color"]
        axes.axhline(study.band, color="#444444", linewidth=1.0, linestyle=":")
        for j, (row, horizon) in enumerate(zip(study.spread, study.horizons, strict=True)):
            shown = np.where(np.isfinite(row), row, np.nan)
            axes.plot(study.t, shown, color=colour, linestyle=SIZE_LINES[j % len(SIZE_LINES)], linewidth=1.3)
            if horizon is not None:
                axes.plot(horizon, study.band, "o", color=colour, markeredgecolor="white", markersize=7, zorder=4)
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
    handles.append(Line2D([], [], color="#444444", linestyle=":", linewidth=1.0, label=f"band {studies[0].band:g}"))
    if any(study.horizon is not None for study in studies):
        handles.append(Line2D([], [], linestyle="", marker="o", color="#444444", label="horizon"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure
