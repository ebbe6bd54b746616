"""The landing as a film: water beside ice, and their energy against the saddle."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from flipproof.animate import GLASS, Picture, laid_out, outline, pictures, slice_corners
from flipproof.figures.style import styled
from flipproof.landing.throw import Row
from ode_reference.landing import Path, path
from ode_reference.landing_flight import FLIGHT_DT, release
from slicemodel import Table
from slicemodel.trajectory import FloatArray

COLOURS: Final = ("#0072B2", "#444444", "#D55E00", "#009E73")
"""Of the bottles of a film."""


@dataclass(frozen=True, slots=True)
class Shown:
    """A landing of the film: its motion over the table, which begins at the time ``begin`` from release [s]."""

    row: Row
    motion: Path
    begin: float


def shown(row: Row, table: Table) -> Shown:
    """Return a bottle from its release, or from its touch if it was not over the table at release, to 0.7 s after."""
    touch, scenario, bottle = row.touch, row.touch.scenario, row.touch.scenario.bottle
    sine, cosine = math.sin(scenario.theta0), math.cos(scenario.theta0)
    room = -bottle.length / 2 * (cosine + abs(cosine)) - bottle.radius * abs(sine) - table.height
    start, begin, drop = (release(scenario), 0.0, room) if room > 0.0 else (touch, touch.time, 0.0)
    motion = path(start, table, row.law, dt=FLIGHT_DT, every=5e-4, duration=touch.time - begin + 0.7, drop=drop)
    return Shown(row, motion, begin)


def film_times(bottles: Sequence[Shown], slow: float, fps: int) -> FloatArray:
    """Return the times from release that the frames show [s]."""
    end = max(bottle.begin + float(bottle.motion.t[-1]) for bottle in bottles)
    return np.linspace(0.0, end, max(round(end * slow * fps) + 1, 2))


def draw_landing(bottles: Sequence[Shown], times: FloatArray, slow: float) -> Iterator[Picture]:
    """Return the frames at these times, one after the other."""
    return pictures(*_scene(bottles, slow), times.tolist())


@styled
def _scene(bottles: Sequence[Shown], slow: float) -> tuple[Any, Callable[[float], None]]:
    """Return a canvas with all that is shown, on one scale, and what moves it to a time."""
    figure = Figure(figsize=(3.6 * max(len(bottles), 2), 6.4), dpi=100, layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(2.0, 1.0), squeeze=False)[:, 0]
    panels = above.subplots(1, len(bottles), squeeze=False)[0]
    reach = max(b.row.touch.scenario.bottle.length / 2 + b.row.touch.scenario.bottle.radius for b in bottles)
    width = max(float(np.ptp(b.motion.centre[:, 0])) for b in bottles) + 2 * reach
    height = max(float(b.motion.centre[:, 1].max()) for b in bottles) + reach
    energies = below.subplots()
    moves = []
    for k, (axes, bottle) in enumerate(zip(panels, bottles, strict=True)):
        colour = COLOURS[k % len(COLOURS)]
        moves.append(_panel(axes, bottle, colour, width, height))
        energy = np.minimum(bottle.motion.energy / bottle.motion.saddle, 40.0)
        energies.plot(bottle.begin + bottle.motion.t, energy, color=colour, linewidth=1.4, label=bottle.row.label)
    energies.axhline(1.0, color="black", linewidth=1.0)
    energies.set_ylim(0.0, 4.0)
    energies.margins(x=0.0)
    energies.set(xlabel="time from release [s]", ylabel="energy / saddle [1]")
    energies.legend(loc="upper right", ncols=len(bottles))
    cursor = energies.axvline(0.0, color="black", linewidth=0.8, linestyle=":")
    title = figure.suptitle(" ", fontsize=10, family="monospace")

    def show(time: float) -> None:
        title.set_text(f"t = {time:.3f} s, {slow:g} times slower")
        for move in moves:
            move(time)
        cursor.set_xdata([time, time])

    return laid_out(figure), show


def _panel(axes: Axes, bottle: Shown, colour: str, width: float, height: float) -> Callable[[float], None]:
    """Draw a bottle; return what moves it to a time, or to its last one if it ended, or to its first if it is early."""
    motion, scenario = bottle.motion, bottle.row.touch.scenario
    x, table = motion.centre[:, 0], 0.04
    middle = float(x.min() + x.max()) / 2
    axes.set(xlim=(middle - width / 2, middle + width / 2), ylim=(-table, height), aspect="equal")
    axes.set_axis_off()
    axes.axhspan(-table, 0.0, color="#C8B79A")
    axes.set_title(f"{bottle.row.label}: {bottle.row.outcome.outcome}", fontsize=10, color=colour)
    tint = "#B9C7D3" if scenario.frozen else "#56B4E9"
    water = PolyCollection([], facecolors=tint, edgecolors="none")
    axes.add_collection(water)
    (glass,) = axes.plot([], [], color=GLASS, linewidth=1.4)

    def move(time: float) -> None:
        k = int(np.clip(np.searchsorted(motion.t, time - bottle.begin), 0, len(motion.t) - 1))
        along = np.array([math.sin(motion.theta[k]), -math.cos(motion.theta[k])])
        cap = motion.centre[k] - scenario.bottle.length / 2 * along
        glass.set_data(*outline(scenario, cap, along).T)
        water.set_verts(list(slice_corners(scenario, motion.r[k], cap, along)))

    return move
