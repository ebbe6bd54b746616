"""Impacts of two runs side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from flipproof.chapters.alignment.found import Alignment, Keyed, Rests
from flipproof.figures.style import new_figure, styled
from slicemodel.trajectory import BASE, CAP

MOST_ROWS = 16
FIRST_LANE, SECOND_LANE = 0.2, -0.2
END_COLOURS = {BASE: "#0072B2", CAP: "#E69F00"}
END_MARKERS = {BASE: "v", CAP: "^"}

IMPACTS: dict[str, dict[str, Any]] = {
    "agrees": {"color": "#444444", "markersize": 3.5},
    "shifted": {"color": "#009E73", "markersize": 5.0},
    "missing": {"color": "#D1001C", "markersize": 6.5},
    "extra": {"color": "#A030C0", "markersize": 6.5},
    "after a fork": {"color": "#BBBBBB", "markersize": 3.5},
}


def even_rows(n_slices: int) -> list[int]:
    """Return at most ``MOST_ROWS`` slices, evenly chosen, the first and the last among them."""
    return [int(i) for i in np.unique(np.linspace(0, n_slices - 1, min(MOST_ROWS, n_slices)).round())]


@styled
def figure_gantt(alignment: Alignment) -> Figure:
    """Contacts and impacts of two runs, one row per slice: the first run above, the second paler below."""
    rows = {i: row for row, i in enumerate(even_rows(alignment.n_slices))}
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
    title = f"in each row: {alignment.first} above, {alignment.second} below; "
    title += f"{len(alignment.swapped)} impacts in another order"
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
