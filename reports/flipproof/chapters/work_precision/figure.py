"""Error against cost: one panel per equation, with a legend of those who solve it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flipproof.chapters.work_precision.study import Curve, WorkPrecision
from flipproof.figures.style import EXTRA_COLOURS, STYLES, new_panels, styled

COLOURS: Final = {"DOP853": "#000000", "LSODA": "#0050A0", "Radau": "#6A5ACD"}
"""Of those whom ``STYLES`` does not know."""

LINES: Final[Mapping[str, Literal["-", "--", ":"]]] = {"scheme": "-", "method": "--", "engine": ":"}
MARKERS: Final = {"scheme": "os", "method": "^v<>", "engine": "DPX"}

HIGHEST: Final = 2.0
"""Largest error on the axes [omega_0]."""


@styled
def figure_work_precision(study: WorkPrecision) -> Figure:
    """Draw one panel per equation on common axes."""
    labels = "updates of one slice [1]", "max |Δω| / ω₀ [1]"
    figure, panels = new_panels(len(study.references), 2, *labels, head=0.4, height=2.3)
    floors = [reference.floor for reference in study.references.values() if math.isfinite(reference.floor)]
    bottom = max(1e-14, min([1e-10, *floors]) / 10)
    for axes, equation in zip(panels, study.references, strict=True):
        _panel(axes, study, equation, bottom)
    return figure


def _panel(axes: Axes, study: WorkPrecision, equation: str, bottom: float) -> None:
    floor = study.references[equation].floor
    axes.set(xscale="log", yscale="log", ylim=(bottom, HIGHEST))
    if math.isfinite(floor):
        axes.axhspan(bottom, floor, color="#c8c8c8", linewidth=0, zorder=0)
    words = f"floor {floor:.0e}" if math.isfinite(floor) else "no reference"
    axes.set_title(f"equation {equation}, {words}", fontsize=9.5, loc="left")
    counts = dict.fromkeys(LINES, 0)
    for curve in study.of(equation):
        _curve(axes, curve, counts[curve.contender.family])
        counts[curve.contender.family] += 1
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7.5, borderpad=0.0, handlelength=1.6)


def _curve(axes: Axes, curve: Curve, k: int) -> None:
    """Draw a curve, the ``k``-th of its family: the line tells the family, the marker who within it."""
    contender, floor = curve.contender, curve.reference.floor
    style = STYLES.get(contender.name)
    colour = style["color"] if style else COLOURS.get(contender.name, EXTRA_COLOURS[k % len(EXTRA_COLOURS)])
    marker = MARKERS[contender.family][k % len(MARKERS[contender.family])]
    whole = [point for point in curve.whole if math.isfinite(point.work)]
    failed = [point.work for point in curve.failed if math.isfinite(point.work)]
    words = "" if math.isnan(curve.slope.order) else f"\np {curve.slope.order:.2f} ± {curve.slope.error:.2f}"
    words = words if curve.whole else f"\n{curve.failed[0].reason.partition(':')[0]}"
    x = np.array([point.work for point in whole])
    low, y, high = (
        np.array([max(getattr(point, name), floor) for point in whole]) for name in ("lowest", "error", "highest")
    )
    look: dict[str, Any] = {"color": colour, "markersize": 4.5}
    axes.plot(
        x, y, linestyle=LINES[contender.family], linewidth=1.3, marker=marker, label=contender.name + words, **look
    )
    axes.vlines(x, low, high, color=colour, linewidth=0.8, alpha=0.6)
    hollow = np.array([point.at_floor for point in whole], dtype=bool)
    axes.plot(x[hollow], y[hollow], linestyle="none", marker=marker, markerfacecolor="white", **look)
    if failed:
        at_the_top: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "clip_on": False, "zorder": 5}
        axes.plot(failed, np.ones(len(failed)), "x", markeredgewidth=1.5, **look, **at_the_top)
