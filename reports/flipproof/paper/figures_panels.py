"""Curves in a grid of panels, one column per solver: the shape that most figures of the paper take here."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from flipproof.figures.style import new_figure, solver_style, styled
from flipproof.frame.exhibit import Exhibit
from flipproof.frame.spoken import SPOKEN
from flipproof.output.columns import columns_csv
from flipproof.paper.runs import BANDS
from slicemodel.trajectory import FloatArray

COLUMN: Final = 3.2
"""Width of a panel [inches]."""

NAMES: Final = {name: SPOKEN[name] for name in ("published-python", "eq8", "free-flight")}
"""Solver -> its name over a column."""

DASHES: Final = ("-", (0, (5, 1.5)), (0, (2, 1)), (0, (6, 1.5, 1.5, 1.5)))

LIGHTEST: Final = 0.75
"""Part of the colour map that is used: beyond it lines are too pale on white, and too dark on black."""

RAMP: Final = ListedColormap(mpl.colormaps["viridis"](np.linspace(0.0, LIGHTEST, 256)))
"""Colours of ordered values, dark to light."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One curve or row of points.

    Parameters
    ----------
    label : str
        The same in every panel for the same throw.
    x, y : arrays of equal shape (P,)
    look : mapping
        Keywords of matplotlib's ``plot``: ``ranked``, ``dots`` and ``DASHED`` make them.
    """

    label: str
    x: FloatArray
    y: FloatArray
    look: Mapping[str, Any]


DASHED: Final = {"color": "black", "linestyle": "--", "linewidth": 1.6, "zorder": 3}
"""Look of what is no throw of its own."""


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
    red, green, blue, alpha = RAMP(place / max(of - 1, 1))
    return red, green, blue, alpha


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One pair of axes: the solver's column, the row's heading, and its curves."""

    solver: str
    heading: str
    lines: tuple[Line, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """What an axis shows with its unit in brackets, the same as the head of a column, and its range.

    ``upside_down`` is for distances from the cap.
    """

    label: str
    column: str
    low: float | None = None
    high: float | None = None
    upside_down: bool = False
    log: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A shaded range along "x" or "y"; its label says whose it is."""

    along: str
    low: float
    high: float
    label: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Panels row by row, each row with a panel for every solver, and the axes they share.

    Parameters
    ----------
    rows : tuple of rows of panels
    x : Axis
    y : tuple of Axis
        One for each row.
    height : float
        Of a row [inches].
    bands : tuple of Band
        Shaded in every panel.
    legend_columns : int
    """

    rows: tuple[tuple[Panel, ...], ...]
    x: Axis
    y: tuple[Axis, ...]
    height: float = 2.5
    bands: tuple[Band, ...] = ()
    legend_columns: int = 6


@styled
def figure_grid(grid: Grid) -> Figure:
    """Draw a grid with one legend for all panels."""
    columns = max(len(row) for row in grid.rows)
    size = (COLUMN * columns, 1.0 + grid.height * len(grid.rows))
    figure, axes = new_figure(len(grid.rows), columns, size=size, sharex=True, sharey="row", squeeze=False)
    for k, (row, y) in enumerate(zip(grid.rows, grid.y, strict=True)):
        for panel, place in zip(row, axes[k], strict=True):
            _draw_panel(place, panel, first=k == 0)
            for band in grid.bands:
                shade, colour = (place.axvspan, "#999999") if band.along == "x" else (place.axhspan, "#E69F00")
                shade(band.low, band.high, color=colour, alpha=0.18, linewidth=0, label=band.label, zorder=0)
            _set_range(place, grid.x, y)
        # Beside the row, not in it: there it would cover curves.
        axes[k][0].set_ylabel("\n".join(filter(None, (row[0].heading, y.label))))
    for place in axes[-1]:
        place.set_xlabel(grid.x.label)
    legend_below(figure, (place for row in axes for place in row), grid.legend_columns)
    return figure


def _draw_panel(axes: Axes, panel: Panel, *, first: bool) -> None:
    for line in panel.lines:
        axes.plot(line.x, line.y, label=line.label, **line.look)
    if first:
        head(axes, panel.solver)


def head(axes: Axes, solver: str) -> None:
    """Write the solver's name over a column, in its colour."""
    axes.set_title(NAMES[solver], fontsize=11, fontweight="bold", color=solver_style(solver)["color"])


def _set_range(axes: Axes, x: Axis, y: Axis) -> None:
    if x.log:
        axes.set_xscale("log")
    if y.log:
        axes.set_yscale("log")
    # Without a limit of its own an axis goes on following the curves of all panels that share it.
    if x.low is not None and x.high is not None:
        axes.set_xlim(x.low, x.high)
    if y.low is not None and y.high is not None:
        axes.set_ylim(*((y.high, y.low) if y.upside_down else (y.low, y.high)))


def stretched(axis: Axis, rows: Iterable[Panel]) -> Axis:
    """Return the axis with its upper end moved up, if any curve of these panels needs it."""
    highest = max((float(line.y.max()) for panel in rows for line in panel.lines if len(line.y)), default=0.0)
    return axis if axis.high is None or highest <= axis.high else replace(axis, high=1.05 * highest)


def legend_below(figure: Figure, panels: Iterable[Axes], columns: int) -> None:
    """Put one legend below the figure with every label of any panel once."""
    found: dict[str, Any] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    if found:
        figure.legend(
            list(found.values()), list(found), loc="outside lower center", ncols=min(columns, len(found)),
            handlelength=2.6, columnspacing=1.4,
        )  # fmt: skip


def exhibit(
    name: str, title: str, caption: str, alt: str, maker: Callable[..., Figure], data: tuple[Any, ...], table: str
) -> Exhibit:
    """Return what is shown as Fig. ``name`` of the paper; after a hyphen stands which of several it is."""
    return Exhibit(
        name=f"paper-{name}",
        title=f"Fig. {name.partition('-')[0]}: {title}",
        caption=caption,
        alt=alt,
        maker=maker,
        data=data,
        table=table,
    )


def exhibit_grid(name: str, title: str, caption: str, alt: str, grid: Grid) -> Exhibit:
    """Return a grid of curves as Fig. ``name``, with its numbers and, in the caption, how the runs were made."""
    return exhibit(name, title, f"{caption} {settings_words()}", alt, figure_grid, (grid,), table_grid(grid))


def table_grid(grid: Grid) -> str:
    """Return what is drawn as CSV: a column for each curve, beside the abscissa that it shares with others."""
    abscissae: list[FloatArray] = []
    members: list[dict[str, FloatArray]] = []
    for row, y in zip(grid.rows, grid.y, strict=True):
        for panel in row:
            for line in panel.lines:
                k = next((k for k, x in enumerate(abscissae) if np.array_equal(x, line.x)), len(abscissae))
                if k == len(abscissae):
                    abscissae.append(line.x)
                    members.append({})
                members[k][_header(y, panel, line)] = line.y
    columns: dict[str, FloatArray] = {}
    for k, (x, curves) in enumerate(zip(abscissae, members, strict=True)):
        columns[grid.x.column if k == 0 else f"{grid.x.column} of the next {len(curves)}, group {k + 1}"] = x
        columns |= curves
    return columns_csv(columns)


def _header(y: Axis, panel: Panel, line: Line) -> str:
    name, _, unit = y.column.partition(" [")
    return f"{', '.join(filter(None, (name, panel.solver, panel.heading, line.label)))} [{unit}"


def every_third(values: FloatArray) -> FloatArray:
    """Return every third value and both ends: what is drawn of a run of 1000 points."""
    return np.asarray(values[:: max(1, (len(values) - 1) // 333)])


# ---------------------------------------------------------------------- words


def settings_words() -> str:
    """Return how the runs were made: slices and bands."""
    own = ", ".join(f"{_plain(BANDS[solver])} ({NAMES[solver]})" for solver in BANDS)
    return (
        f"Every solver has the paper's own slices, and the published program its steps; Eq. 8 and free flight are "
        f"solved exactly between impacts. As fractions of ω₀ the event-driven ω is certain to {own}."
    )


def listed(values: Mapping[str, Mapping[str, float]], digits: int = 3) -> str:
    """Return solver -> label -> number as words."""
    return "; ".join(
        f"{NAMES[solver]}: " + ", ".join(f"{label} {value:.{digits}f}" for label, value in found.items())
        for solver, found in values.items()
        if found
    )


def _plain(value: float) -> str:
    """Return a small number as "1e-7" or "0.003"."""
    return f"{value:g}".replace("e-0", "e-")
