"""Maps of validity: which mistake is the largest, and where an approximation is good enough."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from flipproof.chapters.maps.study import LABELS, RUNGS, SCHEMES, Measure, ValidityMap
from flipproof.figures.style import new_figure, styled
from slicemodel.scenario import shortened
from slicemodel.trajectory import FloatArray

COLOURS = ("#D9D9D9", "#F4B183", "#F7E08A", "#BFA6D9", "#9CC9EA", "#98D3BC", "#E8A9C4")
"""One per rung, light enough for lines on top; their order follows RUNGS."""

CONTOURS: tuple[tuple[float, Literal["--", "-"]], ...] = ((0.01, "--"), (0.1, "-"))
"""Error of the approximation as a fraction of omega_0, and the line that shows it."""

LINES = ("#000000", "#0050A0")
HATCH = "////"

WIDE = 80
"""Characters of the reasons that a legend has room for."""


@styled
def figure_map(study: ValidityMap, approximation: str = "published-python", measure: Measure = "plateau") -> Figure:
    """Dominant mistake as colour, error of an approximation as contours, failed cells hatched with their reasons.

    Along "step" the contours are those of the two schemes against their own equations, since only schemes have a step.
    """
    figure, axes = new_figure(size=(8.0, 5.6))
    logarithmic = study.axis != "restitution"
    x, y = _edges(study.fills, logarithmic=False), _edges(study.values, logarithmic=logarithmic)
    dominant = np.ma.masked_less(study.dominant, 0)
    axes.pcolormesh(x, y, dominant, cmap=ListedColormap(COLOURS), vmin=-0.5, vmax=len(RUNGS) - 0.5, edgecolor="white")
    for row, column in zip(*np.nonzero(study.dominant < 0), strict=True):
        corner = (x[column], y[row])
        size = (x[column + 1] - x[column], y[row + 1] - y[row])
        axes.add_patch(Rectangle(corner, *size, facecolor="none", edgecolor="#555555", hatch=HATCH, linewidth=0))
    handles: list[Artist] = [Patch(facecolor=colour, label=name) for colour, name in zip(COLOURS, RUNGS, strict=True)]
    for (words, error), colour in zip(errors(study, approximation, measure), LINES, strict=False):
        handles += _contours(axes, study, error, words, colour)
    if logarithmic:
        axes.set_yscale("log")
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    axes.grid(visible=False)
    axes.set_xlabel("fill fraction M_w / M_max [1]")
    axes.set_ylabel(LABELS[study.axis])
    which = "step down the ladder" if study.shares is None else "fair share"
    axes.set_title(f"largest {which} in the plateau of ω / ω₀, {study.slices} slices", fontsize=10, loc="left")
    reasons = _reasons(study)
    if reasons:
        handles.append(Patch(facecolor="none", edgecolor="#555555", hatch=HATCH, label=f"not computed: {reasons}"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def errors(
    study: ValidityMap, approximation: str = "published-python", measure: Measure = "plateau"
) -> Sequence[tuple[str, FloatArray]]:
    """Return what the contours show, with its name."""
    if study.axis == "step":
        return [(f"step error of {scheme}", study.step_error[scheme]) for scheme in SCHEMES]
    return [(f"error of {approximation}", study.error(approximation, measure))]


def _contours(axes: Axes, study: ValidityMap, error: FloatArray, words: str, colour: str) -> list[Line2D]:
    """Draw the contours that exist; return a legend entry for each, saying where the map lies if there is none."""
    handles = []
    for level, style in CONTOURS:
        finite = error[np.isfinite(error)]
        label = f"{words}: {level:.0%}"
        if _crosses(error, level):
            lines = axes.contour(
                study.fills, study.values, error, levels=[level], colors=colour, linestyles=style, linewidths=1.6
            )
            axes.clabel(lines, fmt={level: f"{level:.0%}"}, fontsize=8)
        elif finite.size:
            label += " (all above)" if finite.min() >= level else " (all below)"
        handles.append(Line2D([], [], color=colour, linestyle=style, linewidth=1.6, label=label))
    return handles


def _crosses(error: FloatArray, level: float) -> bool:
    """Return whether a map has a contour at ``level``."""
    finite = error[np.isfinite(error)]
    return bool(finite.size and finite.min() < level < finite.max() and min(error.shape) > 1)


def contour_lines(study: ValidityMap, error: FloatArray, level: float) -> list[FloatArray]:
    """Return the contour of ``error`` as lines of (fill fraction, value), each of shape (K, 2)."""
    if not _crosses(error, level):
        return []
    found = Figure().subplots().contour(study.fills, study.values, error, levels=[level])
    return [np.asarray(line) for line in found.allsegs[0] if len(line)]


def _edges(centres: FloatArray, *, logarithmic: bool) -> FloatArray:
    """Return the borders of cells around ``centres``, halfway between neighbours on the axis as it is drawn."""
    at = np.log(centres) if logarithmic else centres
    if len(at) == 1:
        inner = np.array([at[0] - 0.5, at[0] + 0.5])
    else:
        middle = 0.5 * (at[:-1] + at[1:])
        inner = np.concatenate(([2 * at[0] - middle[0]], middle, [2 * at[-1] - middle[-1]]))
    return np.exp(inner) if logarithmic else np.asarray(inner)


def _reasons(study: ValidityMap) -> str:
    """Return every reason once, with the number of cells it holds for."""
    found, counts = np.unique(study.reason[study.reason != ""], return_counts=True)
    words = [f"{reason} ({count})" for reason, count in zip(found, counts, strict=True)]
    return shortened(", ".join(words[:3]), WIDE) + (f" and {len(words) - 3} more" if len(words) > 3 else "")
