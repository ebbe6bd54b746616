"""The look of every figure: style, colours by meaning, and how a figure becomes SVG and PNG.

Never pyplot, nothing global, nothing saved here.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from io import BytesIO
from typing import Any, TypeVar, cast

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogFormatterMathtext

from flipproof.figures.spoken import spoken
from slicemodel import Trajectory

# One hue per family, so that a scheme and the equation it converges to are seen as a pair (Okabe-Ito colours,
# told apart by most colour-blind readers; line style and marker carry the same information).
STYLES: dict[str, dict[str, Any]] = {
    "published-python": {"color": "#D55E00", "linestyle": "-", "linewidth": 1.6},
    "published-limit": {"color": "#7A3600", "linestyle": (0, (5, 3)), "linewidth": 1.4},
    "exact-step": {"color": "#56B4E9", "linestyle": "-", "linewidth": 2.4},
    "eq8": {"color": "#00466E", "linestyle": (0, (5, 3)), "linewidth": 1.4},
    "pymunk": {"color": "#00B386", "linestyle": "-", "linewidth": 2.4},
    "free-flight": {"color": "#00402F", "linestyle": (0, (5, 3)), "linewidth": 1.4},
    "midpoint": {"color": "#CC79A7", "linestyle": "-", "linewidth": 1.6},
    "mujoco": {"color": "#E69F00", "linestyle": (0, (1, 1.5)), "linewidth": 2.0},
}
ASSUMPTIONS = (
    "#E69F00", "#6A5ACD", "#CC79A7", "#882255", "#999933", "#0072B2", "#44AA99", "#D55E00", "#999999", "#000000",
)  # fmt: skip
EXTRA_COLOURS = ("#CC79A7", "#E69F00", "#000000", "#999933", "#882255")
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

INDEXED = re.compile(r"(?<![A-Za-z_$])([A-Zrvetθω])_(CM|[Mwbcfs]|max|table)(?![\w$])")
"""A symbol with its index in plain text."""

DOLLAR = re.compile(r"\\*\$")
"""A dollar sign with the backslashes before it."""

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class PlainPowers(LogFormatterMathtext):
    """Powers of ten with superscript characters: typeset, the labels of an axis would take longer than its data."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the label of ``x``; what is no power of ten is typeset as usual."""
        typeset = super().__call__(x, pos)
        exponent = round(np.log10(x)) if typeset and x > 0.0 else 0
        if not typeset or not np.isclose(x, 10.0**exponent, rtol=1e-9, atol=0.0):
            return typeset
        return f"10{str(exponent).translate(SUPERSCRIPTS)}"


class WrittenLabels(FuncFormatter):
    """The labels of another formatter as ``_written`` gives them, once, although several panels may share it."""

    def __init__(self, form: FuncFormatter) -> None:
        super().__init__(lambda x, place: _written(form(x, place)))


@dataclass(frozen=True, slots=True)
class Drawing:
    """One finished figure as SVG text, and as PNG bytes if somebody asked for them."""

    svg: str
    png: bytes


Maker = TypeVar("Maker", bound=Callable[..., Any])


def styled(function: Maker) -> Maker:
    """Run a function under the report's style, whatever matplotlib's settings are, and leave these as they are."""

    @wraps(function)
    def run(*arguments: Any, **options: Any) -> Any:
        with matplotlib.style.context(["default", STYLE]):
            return function(*arguments, **options)

    return cast(Maker, run)


@styled
def draw(figure: Figure, png: bool = True) -> Drawing:
    """Render a figure; the same data give the same bytes (fixed ids, no date). Without ``png`` it has none."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            form = axis.get_major_formatter()
            if isinstance(form, LogFormatterMathtext):
                axis.set_major_formatter(PlainPowers())
            elif type(form) is FuncFormatter:  # labels that were given, not computed
                axis.set_major_formatter(WrittenLabels(form))
    for text in figure.findobj(Text):
        text.set_text(_written(text.get_text()))
    lines, points = BytesIO(), BytesIO()
    canvas: Any = FigureCanvasSVG(figure)  # matplotlib gives its method no types
    canvas.print_svg(lines, metadata={"Date": None})  # savefig would draw twice, once for the layout
    figure.set_layout_engine("none")  # laid out by now; to do it again for the second format costs as much as drawing
    if png:
        figure.savefig(points, format="png", dpi=100)
    return Drawing(lines.getvalue().decode("utf-8"), points.getvalue())


def _written(text: str) -> str:
    """Return a text of a figure with solvers under their spoken names and indices set lower.

    A dollar sign in it is text, never the beginning of mathematics: names of solvers are others' words.
    """
    return INDEXED.sub(r"$\1_{\\mathrm{\2}}$", DOLLAR.sub(r"\\$", spoken(text)))


def solver_style(label: str, k: int = 0) -> dict[str, Any]:
    """Return colour, style and width of a solver's line; an unknown solver takes the ``k``-th of the other colours."""
    return STYLES.get(label, {"color": EXTRA_COLOURS[k % len(EXTRA_COLOURS)], "linestyle": "-.", "linewidth": 1.4})


def new_figure(
    rows: int = 1, columns: int = 1, *, size: tuple[float, float] = (8.0, 3.9), **options: Any
) -> tuple[Figure, Any]:
    """Return a figure and its axes, laid out so that nothing overlaps."""
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def new_panels(
    count: int, columns: int, x: str, y: str, *, head: float, height: float, common: bool = True
) -> tuple[Figure, list[Axes]]:
    """Return a figure of ``count`` panels, ``columns`` a row, labelled at the left and under the lowest of each column.

    A row is ``height`` inches high, what is not panels ``head``; ``common`` says that all have the same axes.
    """
    rows = -(-count // columns)
    size = (8.0, head + height * rows)
    figure, grid = new_figure(rows, columns, size=size, sharex=common, sharey=common, squeeze=False)
    panels, spare = list(grid.flat)[:count], list(grid.flat)[count:]
    for axes in spare:
        axes.remove()
    for axes in grid[:, 0]:
        axes.set_ylabel(y)
    for axes in panels[-columns:]:
        axes.set_xlabel(x)
        axes.tick_params(labelbottom=True)
    return figure, panels


def shared_legend(figure: Figure, axes: Axes, columns: int = 3) -> None:
    """Put one legend for all panels below the figure, from the entries of ``axes``."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def shown_name(trajectory: Trajectory) -> str:
    """Return the name of a run for legends, with its status if that is not "ok"."""
    return trajectory.label if trajectory.ok else f"{trajectory.label} ({trajectory.status})"
