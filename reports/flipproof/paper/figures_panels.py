"""Curves in a grid of panels, one column per solver: the shape that most figures of the paper take here."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from flipproof.figures.spoken import SPOKEN
from flipproof.figures.style import new_figure, solver_style, styled
from flipproof.frame.columns import columns_csv
from flipproof.frame.exhibit import Exhibit
from flipproof.paper.runs import BANDS, SOLVERS, PaperRuns
from slicemodel.trajectory import FloatArray

Recipe = tuple[tuple[str, ...], Callable[[PaperRuns], Iterator[Exhibit]]]
"""The families of throws that a figure shows, and what makes its exhibits."""

COLUMN: Final = 3.2
"""Width of a panel [inches]."""

DASHES: Final = ("-", (0, (5, 1.5)), (0, (2, 1)), (0, (6, 1.5, 1.5, 1.5)))

RAMP: Final = ListedColormap(mpl.colormaps["viridis"](np.linspace(0.0, 0.75, 256)))
"""Colours of ordered values, dark to light: beyond 0.75 lines are too pale on white, and too dark on black."""

DASHED: Final = {"color": "black", "linestyle": "--", "linewidth": 1.6, "zorder": 3}
"""Look of what is no throw of its own."""


@dataclass(frozen=True, slots=True)
class Line:
    """One curve or row of points (P,); the same throw has the same label in every panel.

    ``look`` holds keywords of matplotlib's ``plot``, which ``ranked``, ``dots`` and ``DASHED`` make.
    """

    label: str
    x: FloatArray
    y: FloatArray
    look: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Axis:
    """What an axis shows with its unit in brackets, the same as the head of a column, and its range.

    The upper end of a range moves up if a curve needs it. ``upside_down`` is for distances from the cap.
    """

    label: str
    column: str
    low: float | None = None
    high: float | None = None
    upside_down: bool = False


@dataclass(frozen=True, slots=True)
class Row:
    """A row of panels: their common vertical axis, the curves by solver, and what stands beside the axis."""

    y: Axis
    lines: Mapping[str, tuple[Line, ...]]
    heading: str = ""


class Shade(NamedTuple):
    """A shaded range along "x" or "y"; its label says whose it is."""

    along: str
    low: float
    high: float
    label: str


@dataclass(frozen=True, slots=True)
class Grid:
    """Rows of panels over one horizontal axis, each ``height`` inches high; shades lie in every panel."""

    x: Axis
    rows: tuple[Row, ...]
    height: float = 2.5
    shades: tuple[Shade, ...] = ()
    legend_columns: int = 6


def row_of(y: Axis, lines_of: Callable[[str], Iterable[Line]], heading: str = "") -> Row:
    """Return a row with the curves of every solver."""
    return Row(y, {solver: tuple(lines_of(solver)) for solver in SOLVERS}, heading)


def ranked(place: int, of: int, dash: int | None = None) -> dict[str, Any]:
    """Return the look of the ``place``-th of ``of`` ordered values, dark to light, with a dash to tell neighbours."""
    style = DASHES[(place if dash is None else dash) % len(DASHES)]
    return {"color": ramp(place, of), "linestyle": style, "linewidth": 1.4}


def dots(colour: Any, *, filled: bool = True, joined: bool = False, size: float = 5.0) -> dict[str, Any]:
    """Return the look of points, filled or open, joined by a thin line or not."""
    return {
        "color": colour, "marker": "o", "markersize": size, "markerfacecolor": colour if filled else "white",
        "linestyle": "-" if joined else "none", "linewidth": 1.0, "zorder": 3,
    }  # fmt: skip


def ramp(place: int, of: int) -> tuple[float, float, float, float]:
    """Return the colour of the ``place``-th of ``of`` ordered values, dark to light."""
    return RAMP(place / max(of - 1, 1))


@styled
def figure_grid(grid: Grid) -> Figure:
    """Draw a grid with one legend for all panels."""
    columns = len(grid.rows[0].lines)
    size = (COLUMN * columns, 1.0 + grid.height * len(grid.rows))
    figure, axes = new_figure(len(grid.rows), columns, size=size, sharex=True, sharey="row", squeeze=False)
    for row, places in zip(grid.rows, axes, strict=True):
        for lines, place in zip(row.lines.values(), places, strict=True):
            for line in lines:
                place.plot(line.x, line.y, label=line.label, **line.look)
            for shade in grid.shades:
                draw, colour = (place.axvspan, "#999999") if shade.along == "x" else (place.axhspan, "#E69F00")
                draw(shade.low, shade.high, color=colour, alpha=0.18, linewidth=0, label=shade.label, zorder=0)
            _set_range(place, grid.x, row)
        # Beside the row, not in it: there it would cover curves.
        places[0].set_ylabel("\n".join(filter(None, (row.heading, row.y.label))))
    for solver, top, bottom in zip(grid.rows[0].lines, axes[0], axes[-1], strict=True):
        head(top, solver)
        bottom.set_xlabel(grid.x.label)
    legend_below(figure, axes.flat, grid.legend_columns)
    return figure


def head(axes: Axes, solver: str) -> None:
    """Write the solver's name over a column, in its colour."""
    axes.set_title(SPOKEN[solver], fontsize=11, fontweight="bold", color=solver_style(solver)["color"])


def _set_range(axes: Axes, x: Axis, row: Row) -> None:
    y = row.y
    # Without a limit of its own an axis goes on following the curves of all panels that share it.
    if x.low is not None and x.high is not None:
        axes.set_xlim(x.low, x.high)
    if y.low is not None and y.high is not None:
        tops = (float(line.y.max()) for lines in row.lines.values() for line in lines if len(line.y))
        highest = max(tops, default=0.0)
        high = y.high if highest <= y.high else 1.05 * highest
        axes.set_ylim(*((high, y.low) if y.upside_down else (y.low, high)))


def legend_below(figure: Figure, panels: Iterable[Axes], columns: int) -> None:
    """Put one legend below the figure with every label of any panel once."""
    handles: dict[str, Any] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if handles:
        figure.legend(
            list(handles.values()), list(handles), loc="outside lower center", ncols=min(columns, len(handles)),
            handlelength=2.6, columnspacing=1.4,
        )  # fmt: skip


def exhibit(
    name: str, title: str, caption: str, alt: str, maker: Callable[..., Figure], data: tuple[Any, ...], table: str
) -> Exhibit:
    """Return what is shown as Fig. ``name`` of the paper; after a hyphen stands which of several it is."""
    title = f"Fig. {name.partition('-')[0]}: {title}"
    return Exhibit(name=f"paper-{name}", title=title, caption=caption, alt=alt, maker=maker, data=data, table=table)


def exhibit_grid(name: str, title: str, caption: str, alt: str, grid: Grid) -> Exhibit:
    """Return a grid of curves as Fig. ``name``, with its numbers and, in the caption, how the runs were made."""
    return exhibit(name, title, f"{caption} {settings_words()}", alt, figure_grid, (grid,), table_grid(grid))


def table_grid(grid: Grid) -> str:
    """Return what is drawn as CSV: a column for each curve, beside the abscissa that it shares with others."""
    groups: list[tuple[FloatArray, dict[str, FloatArray]]] = []
    for row in grid.rows:
        name, _, unit = row.y.column.partition(" [")
        for solver, lines in row.lines.items():
            for line in lines:
                curves = next((curves for x, curves in groups if np.array_equal(x, line.x)), None)
                if curves is None:
                    curves = {}
                    groups.append((line.x, curves))
                curves[f"{', '.join(filter(None, (name, solver, row.heading, line.label)))} [{unit}"] = line.y
    columns: dict[str, FloatArray] = {}
    for k, (x, curves) in enumerate(groups):
        columns[grid.x.column if k == 0 else f"{grid.x.column} of the next {len(curves)}, group {k + 1}"] = x
        columns |= curves
    return columns_csv(columns)


def every_third(values: FloatArray) -> FloatArray:
    """Return every third value and both ends: what is drawn of a run of 1000 points."""
    return np.asarray(values[:: max(1, (len(values) - 1) // 333)])


# ---------------------------------------------------------------------- words


def settings_words() -> str:
    """Return how the runs were made: slices and bands, each as "1e-7" or "0.003"."""
    bands = ", ".join(f"{f'{band:g}'.replace('e-0', 'e-')} ({SPOKEN[solver]})" for solver, band in BANDS.items())
    return (
        f"Every solver has the paper's own slices, and the published program its steps; Eq. 8 and free flight are "
        f"solved exactly between impacts. As fractions of ω₀ the event-driven ω is certain to {bands}."
    )


def listed(values_of: Callable[[str], Mapping[str, float]], digits: int = 3) -> str:
    """Return label -> number of every solver as words; a solver without any is left out."""
    panels = {solver: values_of(solver) for solver in SOLVERS}
    return "; ".join(
        f"{SPOKEN[solver]}: " + ", ".join(f"{label} {value:.{digits}f}" for label, value in values.items())
        for solver, values in panels.items()
        if values
    )
