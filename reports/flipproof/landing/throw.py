"""One throw that lands, in words and as a film: its touch, its outcome under every law, and ice thrown alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

import ode_reference
from flipproof.animate import GLASS, Picture, laid_out, outline, pictures, slice_corners
from flipproof.figures.style import styled
from flipproof.landing.design import SPARE
from flipproof.landing.work import REFERENCE, landed, saddle, touch_readings
from ode_reference.landing import Path, path
from ode_reference.landing_flight import FLIGHT_DT, release
from slicemodel import Outcome, Scenario, Table, Touch
from slicemodel.scenario import unknown_name
from slicemodel.table import LAWS
from slicemodel.trajectory import FloatArray

COLOURS: Final = ("#0072B2", "#444444", "#D55E00", "#009E73")
"""Of the bottles of a film."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One landing: what landed, by which program under which law, and how it ended."""

    name: str
    touch: Touch
    program: str
    law: str | None
    outcome: Outcome

    @property
    def label(self) -> str:
        """What landed, with its law if it has one."""
        return self.name if self.law is None else f"{self.name}, {self.law}"


def land_throw(
    throw: Scenario, table: Table, law: str | None = None, programs: Sequence[str] = (REFERENCE,)
) -> list[Row]:
    """Throw water and ice alike on a table and land both by every program and law asked for.

    Parameters
    ----------
    throw : Scenario - its duration is the time within which the table has to be reached
    table : Table
    law : str or None - one law; None: every law that a program has
    programs : names - "ode_reference", or engines of ``engine_check.land``

    Raises
    ------
    ValueError
        Naming the argument: an unknown program, a law for ice, a table that is not reached.
    """
    from engine_check.landing import LANDERS

    for program in programs:
        if program != REFERENCE and program not in LANDERS:
            raise ValueError(unknown_name("program =", program, (REFERENCE, *LANDERS)))
    if throw.frozen and law is not None:
        raise ValueError(f"law = {law!r} has no meaning for ice (scenario.frozen): leave it out")
    if law is not None and law not in LAWS:
        raise ValueError(unknown_name("law =", law, LAWS))
    long = replace(throw, duration=throw.duration + SPARE)
    bottles = {"ice": long} if throw.frozen else {"water": long, "ice": replace(long, frozen=True)}
    rows = []
    for name, bottle in bottles.items():
        touch = ode_reference.fly(bottle, table)
        for program in programs:
            laws: tuple[str | None, ...] = tuple(LAWS) if program == REFERENCE else LANDERS[program].laws
            if bottle.frozen or not laws:
                laws = (None,)
            elif law is not None:
                laws = tuple(known for known in laws if known == law)
            for chosen in laws:
                outcome = landed(touch, table, program, chosen)
                rows.append(Row(name=name, touch=touch, program=program, law=chosen, outcome=outcome))
    return rows


def told(rows: Sequence[Row], table: Table) -> str:
    """Return what happens as lines: the touch of each bottle, then a line for each landing."""
    lines = [
        f"table at {table.height:g} m, e_table = {table.restitution:g}, friction {table.friction:g} (both assumed: no "
        "measured ones were found)"
    ]
    said: set[str] = set()
    for row in rows:
        if row.name not in said:
            said.add(row.name)
            lines.append(_touch_line(row.name, row.touch))
        program = "event by event" if row.program == REFERENCE else row.program
        lines.append(f"  {program if row.law is None else f'{program}, {row.law}':34} {_how(row.outcome)}")
    return "\n".join(lines)


def _touch_line(name: str, touch: Touch) -> str:
    read = touch_readings(touch)
    stands = "below" if read["static_margin"] > 0.0 else "above"
    return (
        f"{name} touches at t = {touch.time:.4f} s: tilt {math.degrees(touch.tilt):+.1f} degrees, {stands} its "
        f"toppling angle by {math.degrees(abs(read['static_margin'])):.1f}; omega {touch.omega:.2f} rad/s; falls at "
        f"{read['touch_speed']:.2f} m/s; energy {read['touch_energy']:.2f} E_s (saddle {saddle(touch.scenario):.4f} J)"
    )


def _how(outcome: Outcome) -> str:
    if not outcome.decided:
        return f"undecided: {outcome.reason}"
    assert outcome.certified is not None
    assert outcome.margin is not None
    assert outcome.slid is not None
    return (
        f"{outcome.outcome}; certain {outcome.certified:.3f} s after the touch, {outcome.margin:.1%} below the saddle; "
        f"bounces {outcome.bounces}; slid {1000 * outcome.slid:+.0f} mm"
    )


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
