"""Error against cost: one panel per equation, every contender labelled where its curve ends."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Final, Literal, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, LogLocator, NullLocator

from flipproof.chapters.work_precision.study import Curve, WorkPrecision
from flipproof.figures.style import OTHERS, STYLES, new_figure, styled
from ode_reference.models import MODELS

COLOURS: Final = {"DOP853": "#000000", "LSODA": "#0050A0", "Radau": "#6A5ACD", "mujoco": "#D55E00"}
"""Of those whom ``STYLES`` does not know."""

LINES: Final[Mapping[str, Literal["-", "--", ":"]]] = {"scheme": "-", "method": "--", "engine": ":"}
MARKERS: Final = {"scheme": "os", "method": "^v<>", "engine": "DPX"}
FLOOR_COLOUR: Final = "#c8c8c8"
ROOM: Final = 0.54
"""Share of a panel's width that is left for the labels."""

HIGHEST: Final = 2.0
"""Largest error on the axes [omega_0]."""

LINE_HEIGHT: Final = 0.075
"""Least distance of two labels, as a share of the panel's height."""


Label = tuple[tuple[float, float], str, str]
"""Where a curve ends, at its last level or at the top edge above its dearest failure; its words; their colour."""


class Limits(NamedTuple):
    """Least cost on the axes, the cost beside which labels begin, the largest cost, and the least error."""

    left: float
    beside: float
    right: float
    bottom: float


@styled
def figure_work_precision(study: WorkPrecision) -> Figure:
    """Draw one panel per equation on common axes, and a last one that explains the signs."""
    rows = math.ceil((len(study.references) + 1) / 2)
    figure, panels = new_figure(rows, 2, size=(8.0, 0.4 + 2.55 * rows), sharex=True, sharey=True, squeeze=False)
    *used, legend = list(panels.flat)[: len(study.references) + 1]
    for spare in list(panels.flat)[len(study.references) + 1 :]:
        spare.set_visible(False)
    limits = _limits(study)
    for axes, equation in zip(used, study.references, strict=True):
        _panel(axes, study, equation, limits)
    for axes in panels[:, 0]:
        axes.set_ylabel("max |Δω| / ω₀ [1]")
    for axes in used[-2:]:
        axes.set_xlabel("updates of one slice [1]")
        axes.xaxis.set_tick_params(labelbottom=True)
    _explain(legend)
    return figure


def _limits(study: WorkPrecision) -> Limits:
    costs = [point.work for curve in study.curves.values() for point in curve.points]
    finite = [value for value in costs if math.isfinite(value) and value > 0.0] or [1.0, 10.0]
    floors = [reference.floor for reference in study.references.values() if math.isfinite(reference.floor)]
    left, beside = min(finite) / 1.6, 1.6 * max(finite)
    right = beside * (beside / left) ** (ROOM / (1.0 - ROOM))
    return Limits(left, beside, right, max(1e-14, min([1e-10, *floors]) / 10))


def _panel(axes: Axes, study: WorkPrecision, equation: str, limits: Limits) -> None:
    floor = study.references[equation].floor
    axes.set(xscale="log", yscale="log", xlim=(limits.left, limits.right), ylim=(limits.bottom, HIGHEST))
    # No ticks under the labels.
    decades = np.arange(math.ceil(math.log10(limits.left)), math.floor(math.log10(limits.beside)) + 1)
    axes.xaxis.set_major_locator(FixedLocator((10.0**decades).tolist()))
    axes.yaxis.set_major_locator(LogLocator(100.0, numticks=12))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())
        # Typeset, the ticks of eight panels cost half a second.
        axis.set_major_formatter(lambda value, _: f"1e{round(math.log10(value))}")
    words = f"equation {equation}" if equation in MODELS else equation
    if math.isfinite(floor):
        axes.axhspan(limits.bottom, floor, color=FLOOR_COLOUR, linewidth=0, zorder=0)
    words += f", floor {floor:.0e}" if math.isfinite(floor) else ", no reference"
    axes.set_title(words, fontsize=9.5, loc="left")
    labels = []
    counts = dict.fromkeys(LINES, 0)
    for curve in study.of(equation):
        labels.append(_curve(axes, curve, counts[curve.contender.family]))
        counts[curve.contender.family] += 1
    _write(axes, [label for label in labels if label is not None], limits)


def _curve(axes: Axes, curve: Curve, k: int) -> Label | None:
    """Draw a curve, the ``k``-th of its family; return its label if it has a point.

    The line tells the family, the marker who within it.
    """
    contender, floor = curve.contender, curve.reference.floor
    known = STYLES.get(contender.name) or STYLES.get(contender.solver if contender.family == "engine" else "")
    colour = known["color"] if known else COLOURS.get(contender.name, OTHERS[k % len(OTHERS)])
    marker = MARKERS[contender.family][k % len(MARKERS[contender.family])]
    whole = [point for point in curve.whole if math.isfinite(point.work)]
    x = np.array([point.work for point in whole])
    low, y, high = (
        np.array([max(getattr(point, name), floor) for point in whole]) for name in ("lowest", "error", "highest")
    )
    axes.plot(x, y, color=colour, linestyle=LINES[contender.family], linewidth=1.3)
    axes.vlines(x, low, high, color=colour, linewidth=0.8, alpha=0.6)
    hollow = np.array([point.at_floor for point in whole], dtype=bool)
    for chosen, face in ((~hollow, colour), (hollow, "white")):
        axes.plot(
            x[chosen], y[chosen], linestyle="none", marker=marker, markersize=4.5, markerfacecolor=face,
            markeredgecolor=colour,
        )  # fmt: skip
    failed = [point.work for point in curve.failed if math.isfinite(point.work)]
    if failed:
        axes.plot(
            failed, np.ones(len(failed)), "x", color=colour, markersize=6, markeredgewidth=1.5,
            transform=axes.get_xaxis_transform(), clip_on=False, zorder=5,
        )  # fmt: skip
    if not whole and not failed:
        return None
    words = "" if math.isnan(curve.slope) else f"  p {curve.slope:.2f} ± {curve.slope_error:.2f}"
    words = words if curve.whole else f": {curve.failed[0].reason.partition(':')[0]}"
    at = (float(x.max()), float(y[-1])) if whole else (max(failed), 1.0)
    return at, contender.name + words, colour


def _write(axes: Axes, labels: Sequence[Label], limits: Limits) -> None:
    """Write the labels beside the dearest point of all, in the order of the curves' ends and clear of each other."""
    low = limits.bottom
    span = math.log(HIGHEST / low)
    placed = sorted(labels, key=lambda label: -label[0][1])
    heights = [min(math.log(at[1] / low) / span, 0.93) for at, _, _ in placed]
    heights = list(accumulate(heights, lambda above, height: min(height, above - LINE_HEIGHT)))
    # Labels that were pushed below the panel push the others up again.
    heights[-1:] = [max(height, 0.05) for height in heights[-1:]]
    heights = list(accumulate(heights[::-1], lambda below, height: max(height, below + LINE_HEIGHT)))[::-1]
    for (at, words, colour), height in zip(placed, heights, strict=True):
        aloft = math.exp(math.log(low) + height * span)
        note = axes.annotate(
            words, at, xytext=(limits.beside, aloft), textcoords="data", ha="left", va="center", fontsize=8.0,
            color=tuple(0.55 * part for part in to_rgb(colour)),  # darker: small letters on white and on the floor
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.5, "alpha": 0.6, "shrinkB": 4},
        )  # fmt: skip
        note.set_in_layout(False)


def _explain(axes: Axes) -> None:
    axes.axis("off")
    handles: list[Artist] = [
        Line2D([], [], color="#333333", linestyle=line, marker=MARKERS[family][0], markersize=4.5, label=label)
        for (family, line), label in zip(
            LINES.items(), ("scheme, by its steps", "method, by its tolerance", "engine, by its dt"), strict=True
        )
    ]
    handles += [
        Line2D([], [], color="#333333", linestyle="none", marker="o", markerfacecolor="white", label="at the floor"),
        Line2D([], [], color="#333333", linestyle="none", marker="x", markeredgewidth=1.5, label="failed (top edge)"),
        Patch(facecolor=FLOOR_COLOUR, label="below the reference's own error"),
        Line2D([], [], linestyle="none", label="p: error halves p times as work doubles"),
    ]
    axes.legend(handles=handles, loc="center left", fontsize=9.0)
