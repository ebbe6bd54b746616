"""For which bottles which assumption matters: maps over fill fraction and damping, step or restitution."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, Literal

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch, Rectangle
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from scipy.ndimage import label

from flipproof.chapters.maps.study import (
    EXTRA,
    LABELS,
    LADDER,
    NEGLIGIBLE,
    RUNGS,
    SLICES,
    Axis,
    ValidityMap,
    make_readings,
    map_axes,
    plan_map,
    study_readings,
)
from flipproof.chapters.solvers import FREE, SCHEMES
from flipproof.figures.style import new_figure, styled
from flipproof.frame.chapter import Absent, Ask, Call, Chapter, Claims, Exhibit, Outcome, Study, attempt, results_of
from flipproof.frame.columns import rows_csv
from flipproof.frame.twins import BAND_WORDS
from slicemodel.scenario import shortened
from slicemodel.trajectory import FloatArray

AXES: Final[Mapping[Axis, str]] = {"gamma": "damping", "step": "step size", "restitution": "restitution"}

CHUNK: Final = 500
"""Runs of a map that a worker makes at a time; it returns their readings alone."""

COLOURS = ("#606060", "#D95F02", "#C2A500", "#7B3FB5", "#1F78B4", "#128A63", "#C2247F")
"""One per rung, dark enough for an outline on every shade; their order follows RUNGS."""

RANGE = (1e-3, 1.0)
"""Errors of the lightest and of the darkest shade, as fractions of omega_0."""

CONTOURS: tuple[tuple[float, Literal["--", "-"]], ...] = ((0.01, "--"), (0.1, "-"))
"""Error of the approximation as a fraction of omega_0, and the line that shows it."""

WORDED: Final = 6
"""Cells side by side from which the name of a region is written into it; a narrower one has its number."""

HALO: Final = [withStroke(linewidth=2.5, foreground="#FFFFFF")]


Maps = Mapping[Axis, Outcome[ValidityMap]]


def study(ask: Ask) -> Study[Maps]:
    """Fly every set of assumptions on ``ask.work`` by ``ask.work`` cells of each map, many runs to a call."""
    cut = ask.throw.with_slices(SLICES)
    ends = {axis: map_axes(axis, ask.work, ask.work) for axis in AXES}
    calls = {}
    for axis in AXES:
        runs = plan_map(cut, axis, *ends[axis], steps=ask.steps, banded=True)
        chunks = [runs[k : k + CHUNK] for k in range(0, len(runs), CHUNK)]
        calls[axis] = [Call(make_readings, (chunk,), f"map over {axis}") for chunk in chunks]
    # After the runs of the first wave, the longest of which would else wait behind tens of thousands of short ones.
    yield ()
    flights = yield [call for some in calls.values() for call in some]

    def mapped(axis: Axis) -> ValidityMap:
        # Cells of a chunk whose worker died stay "not run".
        answers = [(call.arguments[0], attempt(flights.answer, call).result or ()) for call in calls[axis]]
        readings = {run: reading for chunk, answer in answers for run, reading in zip(chunk, answer, strict=False)}
        return study_readings(cut, axis, *ends[axis], readings, steps=ask.steps)

    return {axis: attempt(mapped, axis) for axis in AXES}


def claims(maps: Maps) -> Claims:
    """Yield which map could not be made."""
    for axis, outcome in maps.items():
        if outcome.result is None:
            yield Absent(f"map-{axis}", f"map over {axis}", outcome.reason, "observation")


def figures(maps: Maps) -> Iterator[Exhibit]:
    """Yield every map."""
    yield from map(exhibit, results_of(maps).values())


def exhibit(study: ValidityMap) -> Exhibit:
    """Return a map with its words and the numbers of its cells."""
    dominant = study.dominant
    which = "fair share (mean over all orders of changing)"
    shade, contours = (
        ("the step error of the published program", "a scheme is 1 % and 10 % of ω₀ off its own equation")
        if study.axis == "step"
        else (
            "the difference between the published program and free flight",
            "the published program is 1 % and 10 % of ω₀ off free flight, and where free flight, whose slices overlap, "
            f"is that far off rods, which cannot overlap. {_beyond(study)}",
        )
    )
    counts = ", ".join(f"{name} {int((dominant == k).sum())}" for k, name in enumerate(RUNGS) if (dominant == k).any())
    return Exhibit(
        name=f"map-{study.axis}",
        title=f"Validity over filling and {AXES[study.axis]}",
        caption=f"Every cell is a throw. The shade of a cell is {shade} in the plateau, the mean of "
        "ω/ω₀ over the second half. "
        f"The outline around cells names the assumption with the largest {which} in the plateau; cells without one "
        f"have no share of {NEGLIGIBLE:g} of ω₀ or more, or two that differ by less than the band of free flight. "
        f"The contours are where {contours}. Hatched cells could not be computed.{_thrown_words(study)}"
        f"{_band_words(study)}",
        alt=f"Map of {dominant.size} throws of {study.slices} slices, fill fraction {study.fills[0]:g} to "
        f"{study.fills[-1]:g} by {AXES[study.axis]} {study.values[0]:g} to {study.values[-1]:g}. Cells by "
        f"largest {which}: {counts or 'none could be computed'}. {_within(study)}",
        maker=figure_map,
        data=(study,),
        table=_cells_csv(study),
    )


def nearest_cell(study: ValidityMap) -> tuple[int, int]:
    """Return row and column of the cell that is nearest to the throw, as the map is drawn."""
    fill, value = study.thrown
    row = np.abs(_as_drawn(study.values, study.axis) - _as_drawn(value, study.axis)).argmin()
    return int(row), int(np.abs(study.fills - fill).argmin())


def _thrown_words(study: ValidityMap) -> str:
    """Return what the cross marks, and which share is largest in the nearest cell."""
    k = int(study.dominant[nearest_cell(study)])
    largest = f"; in the cell nearest to it the largest fair share is that of “{RUNGS[k]}”" if k >= 0 else ""
    return f" The cross is the throw of this report{largest}."


def _as_drawn(values: Any, axis: Axis) -> Any:
    """Return values of an axis as they are spaced on it."""
    return values if axis == "restitution" else np.log(np.maximum(values, 1e-300))


def _beyond(study: ValidityMap) -> str:
    """Return in how many cells overlap changes more than any assumption of the ladder does, and what that compares."""
    finite = np.isfinite(study.overlap) & np.isfinite(study.shares).all(axis=0)
    more = int((np.abs(study.overlap) > np.abs(study.shares).max(axis=0))[finite].sum())
    return (
        f"The change by overlap is the difference of two models, free flight at N = {study.slices} and rods, and "
        "no fair share: rods have no assumptions of the ladder to mend. In "
        f"{more} of {int(finite.sum())} cells it is larger than the largest fair share"
    )


def _band_words(study: ValidityMap) -> str:
    """Return the bands of free flight, the most sensitive equation, over the cells."""
    bands = np.array([]) if study.band is None else study.band[np.isfinite(study.band)]
    if not len(bands):
        return ""
    return (
        f" The plateau of free flight has a band of {np.median(bands):.1g} of ω₀ in the median cell and "
        f"of {bands.max():.1g} in the worst, {BAND_WORDS}."
    )


def _within(study: ValidityMap) -> str:
    """Return how many cells lie within each contour."""
    parts = []
    for words, error in errors(study):
        finite = error[np.isfinite(error)]
        cells = ", ".join(f"below {level:.0%} in {int((finite < level).sum())}" for level, _ in CONTOURS)
        maximum = f", at most {finite.max():.2g}" if finite.size else ""
        parts.append(f"The {words} is {cells} of {finite.size} cells{maximum}")
    return "; ".join(parts) + "."


def _cells_csv(study: ValidityMap) -> str:
    """Return every cell: plateaus, fair shares and the assumption with the largest, differences and step errors."""
    solvers = (*LADDER, *EXTRA)
    others = [name for name in solvers if name != FREE]
    label = LABELS[study.axis]
    for sign, word in (("γ", "gamma"), ("ω", "omega"), ("₀", "_0"), ("Δ", "d")):
        label = label.replace(sign, word)
    return rows_csv(
        ("fill fraction [1]", label, "largest fair share",
         *(f"plateau of omega/omega_0 {name} [1]" for name in solvers),
         *(f"fair share of {name} [1]" for name in RUNGS),
         *(f"largest difference of {name} from {FREE} [1]" for name in others),
         *(f"step error of {name} [1]" for name in SCHEMES), "not computed because"),
        (
            (study.fills[column], study.values[row], RUNGS[k] if k >= 0 else None,
             *(study.level[name][row, column] for name in solvers), *study.shares[:, row, column],
             *(study.largest[name][row, column] for name in others),
             *(study.step_error[name][row, column] for name in SCHEMES), study.reason[row, column])
            for (row, column), k in np.ndenumerate(study.dominant)
        ),
    )  # fmt: skip


@styled
def figure_map(study: ValidityMap) -> Figure:
    """Size of an approximation's error as shade, the largest fair share as outline, failed cells hatched with reasons.

    Along "step" shade and contours are those of the schemes against their own equations, since only schemes have a
    step; the shade is the first scheme's.
    """
    figure, axes = new_figure(size=(8.0, 6.0))
    logarithmic = study.axis != "restitution"
    x, y = _edges(study.fills, logarithmic=False), _edges(study.values, logarithmic=logarithmic)
    shown = errors(study)
    shaded, error = shown[0]
    greys = ListedColormap(colormaps["Greys"](np.linspace(0.0, 0.6, 256)))  # light enough for black lines on top
    clipped = np.ma.masked_invalid(np.clip(error, *RANGE))
    shade = axes.pcolormesh(x, y, clipped, cmap=greys, norm=LogNorm(*RANGE), rasterized=True)
    bar = figure.colorbar(shade, ax=axes, label=f"{shaded} [of ω₀]", extend="min", ticks=[1e-3, 1e-2, 1e-1, 1.0])
    bar.ax.set_yticklabels(["0.1%", "1%", "10%", "100%"])
    handles: list[Artist] = []
    for k, (colour, name) in enumerate(zip(COLOURS, RUNGS, strict=True)):
        outline = _outline(study.dominant == k, x, y, logarithmic=logarithmic)
        if outline:
            border = Path.make_compound_path(*map(Path, outline))
            axes.add_patch(PathPatch(border, fill=False, edgecolor=colour, linewidth=2.2, capstyle="projecting"))
        handles.append(Patch(facecolor="none", edgecolor=colour, linewidth=2.2, label=f"{k + 1}  {name}"))
        for row, column, beside in _regions(study.dominant == k):
            words = f"{k + 1}  {name.partition(':')[0].partition(',')[0]}" if beside >= WORDED else f"{k + 1}"
            place: dict[str, Any] = {"ha": "center", "va": "center", "path_effects": HALO}
            axes.text(study.fills[column], study.values[row], words, color=colour, size=8, weight="bold", **place)
    hatched: dict[str, Any] = {"facecolor": "none", "edgecolor": "#555555", "hatch": "////"}
    for row, column in zip(*np.nonzero(study.missing), strict=True):
        size = (x[column + 1] - x[column], y[row + 1] - y[row])
        axes.add_patch(Rectangle((x[column], y[row]), *size, linewidth=0, **hatched))
    for (name, error), colour in zip(shown, ("#000000", "#D00000"), strict=True):
        handles += _contours(axes, study, error, name, colour)
    if logarithmic:
        axes.set_yscale("log")
    cross: dict[str, Any] = {"markersize": 10, "markeredgewidth": 2.5, "path_effects": HALO}
    handles += axes.plot(*study.thrown, "x", color="#000000", label="this throw", zorder=5, **cross)
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), xlabel="fill fraction M_w / M_max [1]", ylabel=LABELS[study.axis])
    axes.grid(visible=False)
    title = f"Plateau of ω / ω₀ at N = {study.slices}: {shaded} (shade), largest fair share (outline)"
    axes.set_title(title, fontsize=10, loc="left")
    reasons = _reasons(study)
    if reasons:
        handles.append(Patch(label=f"not computed: {reasons}", **hatched))
    longest = max(len(str(handle.get_label())) for handle in handles)
    figure.legend(handles=handles, loc="outside lower center", ncols=3 if longest < 38 else 2)
    return figure


def _regions(inside: NDArray[np.bool_]) -> Iterator[tuple[int, int, int]]:
    """Yield row and column of the cell in the middle of every connected region, and the number of cells beside it."""
    numbers, count = label(inside)
    for number in range(1, count + 1):
        at = np.argwhere(numbers == number)
        row, column = at[((at - at.mean(axis=0)) ** 2).sum(axis=1).argmin()]
        yield int(row), int(column), int((at[:, 0] == row).sum())


def errors(study: ValidityMap) -> Sequence[tuple[str, FloatArray]]:
    """Return what the contours show, with its name."""
    if study.axis == "step":
        return [(f"step error of {scheme}", study.step_error[scheme]) for scheme in SCHEMES]
    return [(f"error of {LADDER[0]}", study.error), ("change by overlap", np.abs(study.overlap))]


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
    return bool(finite.size and finite.min() < level < finite.max())


def _edges(centres: FloatArray, *, logarithmic: bool) -> FloatArray:
    """Return the borders of cells around ``centres``, halfway between neighbours on the axis as it is drawn."""
    at = np.log(centres) if logarithmic else centres
    middle = 0.5 * (at[:-1] + at[1:])
    edges = np.concatenate(([2 * at[0] - middle[0]], middle, [2 * at[-1] - middle[-1]]))
    return np.exp(edges) if logarithmic else edges


def _outline(inside: NDArray[np.bool_], x: FloatArray, y: FloatArray, *, logarithmic: bool) -> list[FloatArray]:
    """Return the border of the cells ``inside`` as segments, moved inwards so that neighbours' borders stay apart."""
    inset = 0.12  # of a cell
    at = np.log(y) if logarithmic else y
    around = np.pad(inside, 1)
    segments = []
    for row, column in zip(*np.nonzero(inside), strict=True):
        below, above = not around[row, column + 1], not around[row + 2, column + 1]
        before, behind = not around[row + 1, column], not around[row + 1, column + 2]
        dx, dy = inset * (x[column + 1] - x[column]), inset * (at[row + 1] - at[row])
        left, right = x[column] + before * dx, x[column + 1] - behind * dx
        low, high = at[row] + below * dy, at[row + 1] - above * dy
        sides = (
            (before, ((left, low), (left, high))),
            (behind, ((right, low), (right, high))),
            (below, ((left, low), (right, low))),
            (above, ((left, high), (right, high))),
        )
        segments += [np.array(side) for outer, side in sides if outer]
    if logarithmic:
        for side in segments:
            side[:, 1] = np.exp(side[:, 1])
    return segments


def _reasons(study: ValidityMap) -> str:
    """Return every reason once, with the number of cells it holds for."""
    reasons, counts = np.unique(study.reason[study.reason != ""], return_counts=True)
    words = [f"{reason} ({count})" for reason, count in zip(reasons, counts, strict=True)]
    return shortened(", ".join(words[:3]), 80) + (f" and {len(words) - 3} more" if len(words) > 3 else "")


CHAPTER: Final = Chapter(
    "maps", "For which bottles", study, claims, figures, ice=False, work={"full": 15}, page=lambda _: {"slices": SLICES}
)
