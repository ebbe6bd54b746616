"""One frame after another of the flights as a film: bottles in the lab frame above, omega and theta below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from flipproof.figures.style import solver_style, styled
from flipproof.page.motion import Flight, cap_and_base, parabola, release_point
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

Picture = NDArray[np.uint8]

DPI: Final = 100
INCH: Final = 2.4
"""Width of one bottle's panel."""

WATER: Final = ("#0b5cad", "#35b0c4")
"""The slice that starts on the base, and the one that starts on top."""

WATER_OPACITY: Final = 0.5
GLASS: Final = "#57606a"


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """What is shown.

    Parameters
    ----------
    throw : Scenario
    t : (F,) - time of flight of every frame [s]
    flights : one per bottle
    fps : int - frames shown in a second
    slow : float - how many times slower than the flight
    """

    throw: Scenario
    t: FloatArray
    flights: tuple[Flight, ...]
    fps: int
    slow: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Bottle:
    """What moves in one panel, and the flight's cap and base, shape (F, 2) [m]."""

    flight: Flight
    cap: FloatArray
    base: FloatArray
    outline: Line2D
    slices: PolyCollection
    centre: Line2D
    path: Line2D


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scene:
    """A figure, laid out, and all in it that moves."""

    canvas: Any
    title: Text
    bottles: list[_Bottle]
    cursors: list[Line2D]


def draw_frames(film: Film) -> Iterator[Picture]:
    """Yield every frame as red, green and blue, shape (height, width, 3); both sides are even, as MP4 needs."""
    scene = _scene(film)
    for k in range(len(film.t)):
        scene.title.set_text(_title(film, k))
        for bottle in scene.bottles:
            _move(bottle, film.throw, k)
        for cursor in scene.cursors:
            cursor.set_xdata([film.t[k], film.t[k]])
        scene.canvas.draw()
        picture = np.asarray(scene.canvas.buffer_rgba())
        height, width = (side - side % 2 for side in picture.shape[:2])
        yield np.ascontiguousarray(picture[:height, :width, :3])


@styled
def _scene(film: Film) -> _Scene:
    count = len(film.flights)
    figure = Figure(figsize=(INCH * max(count, 2), 5.6), dpi=DPI, layout="constrained")
    canvas = cast(Any, FigureCanvasAgg(figure))
    # Laid out apart, so that the labels of the traces leave the panels of the bottles alone.
    above, below = figure.subfigures(2, 1, height_ratios=(1.45, 1.0), squeeze=False)[:, 0]
    panels = list(above.subplots(1, count, squeeze=False)[0])
    bottles = [_bottle(axes, film, k) for k, axes in enumerate(panels)]
    _frame_panels(panels, film, bottles)
    left, right = below.subplots(1, 2)
    cursors = [_trace(left, film, "omega"), _trace(right, film, "theta")]
    title = figure.suptitle(_title(film, 0), fontsize=10, family="monospace")
    canvas.draw()
    figure.set_layout_engine("none")  # laid out by now; to do it again for every frame would make panels tremble
    return _Scene(canvas=canvas, title=title, bottles=bottles, cursors=cursors)


def _title(film: Film, k: int) -> str:
    return f"t = {film.t[k]:.3f} s, {film.slow:g} times slower"


def _bottle(axes: Axes, film: Film, k: int) -> _Bottle:
    throw, flight = film.throw, film.flights[k]
    style = solver_style(flight.name, k)
    cap, base = cap_and_base(throw, flight)
    centres = parabola(throw, release_point(throw, float(flight.r_cm[0])), film.t)
    axes.plot(centres[:, 0], centres[:, 1], color=GLASS, linestyle=":", linewidth=1.0)
    (path,) = axes.plot([], [], color=style["color"], linewidth=1.2)
    first, last = (np.array(to_rgba(colour, WATER_OPACITY)) for colour in WATER)
    shares = np.linspace(0.0, 1.0, max(len(flight.drawn), 1))[:, np.newaxis]
    tints = first + shares * (last - first)
    slices = PolyCollection([], facecolors=[tuple(tint) for tint in tints], edgecolors="none")
    axes.add_collection(slices)
    (outline,) = axes.plot([], [], color=GLASS, linewidth=1.4)
    (centre,) = axes.plot([], [], marker="+", markersize=8, markeredgewidth=1.6, color="black")
    status = "" if flight.status == "ok" else f" ({flight.status})"
    axes.set_title(f"{flight.name}{status}", fontsize=10, color=style["color"])
    return _Bottle(flight=flight, cap=cap, base=base, outline=outline, slices=slices, centre=centre, path=path)


def _frame_panels(panels: Sequence[Axes], film: Film, bottles: Sequence[_Bottle]) -> None:
    """Give every panel the same window, that of all bottles at all times."""
    ends = np.concatenate([end for bottle in bottles for end in (bottle.cap, bottle.base)])
    margin = 1.2 * film.throw.bottle.radius
    low, high = ends.min(axis=0) - margin, ends.max(axis=0) + margin
    for axes in panels:
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_aspect("equal")
        axes.set_axis_off()


def _move(bottle: _Bottle, throw: Scenario, k: int) -> None:
    """Draw the bottle at frame ``k``, or at its last one if it ended before."""
    flight = bottle.flight
    k = min(k, len(flight.t) - 1)
    cap = bottle.cap[k]
    along = (bottle.base[k] - cap) / throw.bottle.length
    bottle.outline.set_data(*outline(throw, cap, along).T)
    bottle.slices.set_verts(list(slice_corners(throw, flight.r[k], cap, along)))
    centre = cap + flight.r_cm[k] * along
    bottle.centre.set_data([centre[0]], [centre[1]])
    bottle.path.set_data(bottle.base[: k + 1, 0], bottle.base[: k + 1, 1])


def _across(along: FloatArray) -> FloatArray:
    return np.array([-along[1], along[0]])


def outline(throw: Scenario, cap: FloatArray, along: FloatArray) -> FloatArray:
    """Return the bottle's outline with a small cap on it, shape (K, 2) [m]."""
    radius, length = throw.bottle.radius, throw.bottle.length
    wall, neck, base = radius * _across(along), 0.35 * radius * _across(along), length * along
    top = -0.25 * radius * along
    body = [neck, wall, wall + base, -wall + base, -wall, -neck]
    return np.asarray(cap + np.array([*body, top - neck, top + neck, neck, -neck]))


def slice_corners(throw: Scenario, r: FloatArray, cap: FloatArray, along: FloatArray) -> FloatArray:
    """Return the corners of the slices at ``r``, shape (n, 4, 2) [m]; the drawn ones are as high as all together."""
    height = throw.slice_height * throw.n_slices / max(len(r), 1)
    half, wall = height / 2 * along, 0.94 * throw.bottle.radius * _across(along)
    corner = np.array([-half - wall, half - wall, half + wall, -half + wall])
    return np.asarray((cap + r[:, np.newaxis] * along)[:, np.newaxis, :] + corner)


def _trace(axes: Axes, film: Film, quantity: str) -> Line2D:
    """Draw one quantity of all flights over time; return the cursor."""
    for k, flight in enumerate(film.flights):
        values = flight.omega if quantity == "omega" else np.degrees(flight.theta)
        style = solver_style(flight.name, k)
        # The thinner line above: of two that agree both are seen.
        axes.plot(flight.t, values, zorder=3.0 - 0.1 * style["linewidth"], **style)
    axes.set_xlabel("time t [s]")
    axes.set_ylabel("ω [rad/s]" if quantity == "omega" else "θ [degrees]")
    axes.margins(x=0.01)
    if quantity == "omega" and axes.get_ylim()[0] > 0:
        axes.set_ylim(bottom=0.0)
    return axes.axvline(0.0, color="black", linewidth=1.0)
