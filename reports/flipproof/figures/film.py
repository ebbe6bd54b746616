"""One frame after another of the flights as a film: bottles in the lab frame above, omega and theta below."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from flipproof.figures.style import solver_style, styled
from flipproof.page.motion import Flight, cap_and_base, parabola, release_point
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

Picture = NDArray[np.uint8]

GLASS: Final = "#57606a"


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """What is shown: ``t`` is the time of flight of every frame, shape (F,) [s], ``slow`` times slower than the flight.

    There is one flight per bottle, and ``fps`` frames are shown in a second.
    """

    throw: Scenario
    t: FloatArray
    flights: tuple[Flight, ...]
    fps: int
    slow: float


def draw_frames(film: Film) -> Iterator[Picture]:
    """Return the frames of a film, one after the other."""
    return pictures(*_scene(film), range(len(film.t)))


def laid_out(figure: Figure) -> Any:
    """Return the canvas of a figure that keeps its layout: to do it again for every frame would make panels tremble."""
    canvas = cast(Any, FigureCanvasAgg(figure))
    canvas.draw()
    figure.set_layout_engine("none")
    return canvas


def pictures(canvas: Any, show: Callable[[Any], None], frames: Iterable[Any]) -> Iterator[Picture]:
    """Yield every frame as red, green and blue, shape (height, width, 3); both sides are even, as MP4 needs.

    ``show`` moves all that is on the canvas to a frame.
    """
    for frame in frames:
        show(frame)
        canvas.draw()
        picture = np.asarray(canvas.buffer_rgba())
        height, width = (side - side % 2 for side in picture.shape[:2])
        yield np.ascontiguousarray(picture[:height, :width, :3])


@styled
def _scene(film: Film) -> tuple[Any, Callable[[int], None]]:
    """Return a canvas with all that is shown, and what moves it to a frame."""
    count = len(film.flights)
    figure = Figure(figsize=(2.4 * max(count, 2), 5.6), dpi=100, layout="constrained")
    # Laid out apart, so that the labels of the traces leave the panels of the bottles alone.
    above, below = figure.subfigures(2, 1, height_ratios=(1.45, 1.0), squeeze=False)[:, 0]
    panels = list(above.subplots(1, count, squeeze=False)[0])
    ends = [cap_and_base(film.throw, flight) for flight in film.flights]
    moves = [_bottle(axes, film, k, *ends[k]) for k, axes in enumerate(panels)]
    # Every panel has the same window, that of all bottles at all times.
    reached = np.concatenate([end for both in ends for end in both])
    margin = 1.2 * film.throw.bottle.radius
    low, high = reached.min(axis=0) - margin, reached.max(axis=0) + margin
    for axes in panels:
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set_axis_off()
    left, right = below.subplots(1, 2)
    cursors = [_trace(left, film, "omega"), _trace(right, film, "theta")]
    title = figure.suptitle(" ", fontsize=10, family="monospace")

    def show(k: int) -> None:
        title.set_text(f"t = {film.t[k]:.3f} s, {film.slow:g} times slower")
        for move in moves:
            move(k)
        for cursor in cursors:
            cursor.set_xdata([film.t[k], film.t[k]])

    show(0)
    return laid_out(figure), show


def _bottle(axes: Axes, film: Film, k: int, caps: FloatArray, bases: FloatArray) -> Callable[[int], None]:
    """Draw the ``k``-th bottle; return what moves it to a frame, or to its last one if it ended before."""
    throw, flight = film.throw, film.flights[k]
    colour = solver_style(flight.name, k)["color"]
    centres = parabola(throw, release_point(throw, float(flight.r_cm[0])), film.t)
    axes.plot(centres[:, 0], centres[:, 1], color=GLASS, linestyle=":", linewidth=1.0)
    (path,) = axes.plot([], [], color=colour, linewidth=1.2)
    # From the slice that starts on the base to the one that starts on top.
    first, last = (np.array(to_rgba(tint, 0.5)) for tint in ("#0b5cad", "#35b0c4"))
    shares = np.linspace(0.0, 1.0, max(len(flight.drawn), 1))[:, np.newaxis]
    slices = PolyCollection([], facecolors=[tuple(tint) for tint in first + shares * (last - first)], edgecolors="none")
    axes.add_collection(slices)
    (glass,) = axes.plot([], [], color=GLASS, linewidth=1.4)
    (centre,) = axes.plot([], [], marker="+", markersize=8, markeredgewidth=1.6, color="black")
    status = "" if flight.status == "ok" else f" ({flight.status})"
    axes.set_title(f"{flight.name}{status}", fontsize=10, color=colour)

    def move(frame: int) -> None:
        at = min(frame, len(flight.t) - 1)
        cap = caps[at]
        along = (bases[at] - cap) / throw.bottle.length
        glass.set_data(*outline(throw, cap, along).T)
        slices.set_verts(list(slice_corners(throw, flight.r[at], cap, along)))
        mass = cap + flight.r_cm[at] * along
        centre.set_data([mass[0]], [mass[1]])
        path.set_data(bases[: at + 1, 0], bases[: at + 1, 1])

    return move


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
