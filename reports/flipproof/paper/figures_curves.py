"""Figures 5b-d, 6b-c, 7a, 8a-c and S1a: a quantity over time for every throw of a family, solver by solver."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from flipproof.frame.exhibit import Exhibit
from flipproof.paper.cases import Case, family
from flipproof.paper.figures_panels import (
    Axis,
    Grid,
    Line,
    Panel,
    dots,
    every_third,
    exhibit_grid,
    listed,
    ramp,
    ranked,
    stretched,
)
from flipproof.paper.parameters import number, numbers
from flipproof.paper.runs import PUBLISHED, SOLVERS, PaperRuns
from slicemodel import Trajectory
from slicemodel.observables import plateau
from slicemodel.trajectory import FloatArray

Quantity = Callable[[Trajectory], tuple[FloatArray, FloatArray]]
Label = Callable[[Case], str]

TIME: Final = Axis(label="time t [s]", column="t [s]", low=0.0, high=number("duration"))
RELATIVE_TIME: Final = Axis(label="t / T [1]", column="t/T [1]", low=0.0, high=1.0)
OMEGA: Final = Axis(label="ω [rad/s]", column="omega [rad/s]", low=0.0, high=1.1 * number("release-spin"))
RELATIVE_OMEGA: Final = Axis(label="ω / ω₀ [1]", column="omega/omega_0 [1]", low=0.0, high=1.1)
THETA: Final = Axis(label="θ [rad]", column="theta [rad]", low=0.0, high=3 * math.pi)


def omega_over_time(run: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Return t [s] and omega [rad/s]."""
    return every_third(run.t), every_third(run.omega)


def theta_over_time(run: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Return t [s] and theta [rad]."""
    return every_third(run.t), every_third(run.theta)


def relative_omega(run: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Return t / T and omega / omega_0."""
    return every_third(run.t / run.scenario.duration), every_third(run.omega / run.scenario.omega0)


def row_of(runs: PaperRuns, name: str, quantity: Quantity, label: Label, heading: str = "") -> tuple[Panel, ...]:
    """Return one panel for each solver with the curves of a family."""
    # Ranks come from the values, so that a throw that one solver does not fly leaves the others their colours.
    values = sorted(case.value for case in family(name))
    return tuple(
        Panel(
            solver=solver,
            heading=heading,
            lines=tuple(
                Line(label=label(case), x=x, y=y, look=ranked(values.index(case.value), len(values)))
                for case, run in runs.members(solver, name)
                for x, y in [quantity(run)]
            ),
        )
        for solver in SOLVERS
    )


def plateaus(runs: PaperRuns, name: str, label: Label) -> str:
    """Return the mean of omega / omega_0 over the second half of every flight of a family, as words for each solver."""
    return listed(
        {
            solver: {
                label(case): plateau(run.t, run.omega, run.scenario.omega0) for case, run in runs.members(solver, name)
            }
            for solver in SOLVERS
        }
    )


def turns(runs: PaperRuns, name: str, label: Label) -> str:
    """Return theta at the end of every flight of a family [rad], as words for each solver."""
    return listed(
        {solver: {label(case): float(run.theta[-1]) for case, run in runs.members(solver, name)} for solver in SOLVERS},
        digits=1,
    )


def _of(symbol: str, unit: str = "") -> Label:
    return lambda case: f"{symbol} = {case.value:g}{unit}".replace("-", "−")


BETA: Final = _of("β")
SLICES: Final = _of("N")
ALPHA: Final = _of("α", " kg/s")
FILLING: Final = _of("M̃")
READINGS: Final = (("beta", "α = 1 (caption), α/2m = 10 /s"), ("beta at 5 /s", "α = 0.5, α/2m = 5 /s"))

TWO_READINGS: Final = (
    "The caption's α = 1 and the damping rate of all later figures do not agree for ten slices; the upper row takes "
    "the first, the lower row the second. "
)


def exhibits_5b(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the angle for three rebounds."""
    rows = tuple(row_of(runs, name, theta_over_time, BETA, heading) for name, heading in READINGS)
    grid = Grid(rows=rows, x=TIME, y=(THETA, THETA))
    yield exhibit_grid(
        "5b", "what the rebound β does to the angle θ(t)",
        f"{TWO_READINGS}Look at the end of the flight: does the elastic bottle (β = −1) turn ahead of the others?",
        f"Line plots of theta against time, two rows by three solvers. Theta at 0.5 s in rad with alpha 1: "
        f"{turns(runs, 'beta', BETA)}. With alpha 0.5: {turns(runs, 'beta at 5 /s', BETA)}.",
        grid,
    )  # fmt: skip


def exhibits_5c(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the angular velocity for three rebounds."""
    rows = tuple(row_of(runs, name, omega_over_time, BETA, heading) for name, heading in READINGS)
    grid = Grid(rows=rows, x=TIME, y=tuple(stretched(OMEGA, row) for row in rows))
    yield exhibit_grid(
        "5c", "what the rebound β does to the angular velocity ω(t)",
        f"{TWO_READINGS}The paper has ω low and flat for β = −0.5 only, and bumpy for β = −1. In free flight no bottle "
        "speeds up late, whatever its β.",
        "Line plots of omega against time, two rows by three solvers. Mean omega over omega_0 of the second half with "
        f"alpha 1: {plateaus(runs, 'beta', BETA)}. With alpha 0.5: {plateaus(runs, 'beta at 5 /s', BETA)}.",
        grid,
    )  # fmt: skip


def exhibits_5d(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the angular velocity for several numbers of slices."""
    rows = (
        row_of(runs, "slices", omega_over_time, SLICES, "α/2m = 10 /s kept"),
        row_of(runs, "slices at 5 /s", omega_over_time, SLICES, "α/2m = 5 /s kept"),
        row_of(runs, "slices at alpha 1", omega_over_time, SLICES, "α = 1 kept"),
    )
    grid = Grid(rows=rows, x=TIME, y=tuple(stretched(OMEGA, row) for row in rows), legend_columns=7)
    yield exhibit_grid(
        "5d", "what the number of slices N does to ω(t)",
        "In the upper rows the damping rate α/2m is kept and the curves close up with N. With α itself kept (bottom "
        "row, another scale) the published program stands still at N = 20, where α/2m equals ω₀, and spins up beyond "
        "ω₀ with more, so that the paper cannot have meant that.",
        "Line plots of omega against time, three rows by three solvers. Mean omega over omega_0 of the second half at "
        f"10 per second: {plateaus(runs, 'slices', SLICES)}. At 5 per second: "
        f"{plateaus(runs, 'slices at 5 /s', SLICES)}. With alpha 1: {plateaus(runs, 'slices at alpha 1', SLICES)}.",
        grid,
    )  # fmt: skip


def exhibits_6b(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the angle for several drags."""
    grid = Grid(rows=(row_of(runs, "drag", theta_over_time, ALPHA),), x=TIME, y=(THETA,), height=3.0)
    yield exhibit_grid(
        "6b", "what the drag α does to the angle θ(t)",
        "The less a bottle has turned at the end, the longer its ω stayed low.",
        f"Line plots of theta against time by three solvers. Theta at 0.5 s in rad: {turns(runs, 'drag', ALPHA)}.",
        grid,
    )  # fmt: skip


def exhibits_6c(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the angular velocity for several drags."""
    grid = Grid(rows=(row_of(runs, "drag", omega_over_time, ALPHA),), x=TIME, y=(OMEGA,), height=3.0)
    yield exhibit_grid(
        "6c", "what the drag α does to the angular velocity ω(t)",
        "Is there one α whose curve drops and then stays flat? In the published program there is, near the paper's "
        "choice of 0.01, because its α weakens the centrifugal force instead of damping; in free flight every curve "
        "stays low.",
        "Line plots of omega against time by three solvers. Mean omega over omega_0 of the second half: "
        f"{plateaus(runs, 'drag', ALPHA)}.",
        grid,
    )  # fmt: skip


def exhibits_7a(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the angular velocity for all fillings."""
    grid = Grid(
        rows=(row_of(runs, "filling", relative_omega, FILLING),), x=RELATIVE_TIME, y=(RELATIVE_OMEGA,), height=3.2
    )
    yield exhibit_grid(
        "7a", "what the filling M̃ does to ω(t)",
        "Look at M̃ = 0.1, which the experiment leaves at ω₀: the published program and Eq. 8 slow it down, free flight "
        "hardly does. And at M̃ = 1, which no solver keeps, because slices may overlap.",
        "Line plots of omega over omega_0 against t over T by three solvers. Mean of the second half: "
        f"{plateaus(runs, 'filling', FILLING)}.",
        grid,
    )  # fmt: skip


def _eight(runs: PaperRuns, name: str, family_name: str, label: Label, title: str, caption: str) -> Iterator[Exhibit]:
    rows = (row_of(runs, family_name, relative_omega, label),)
    axis = stretched(RELATIVE_OMEGA, rows[0])
    alt = (
        "Line plots of omega over omega_0 against t over T by three solvers. Mean of the second half: "
        f"{plateaus(runs, family_name, label)}."
    )
    yield exhibit_grid(name, title, caption, alt, Grid(rows=rows, x=RELATIVE_TIME, y=(axis,), height=3.0))


def exhibits_8a(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the angular velocity for several releases by spin."""
    yield from _eight(
        runs, "8a", "spin", lambda case: f"ω₀ = {case.value:g} rad/s", "what the spin at release ω₀ does",
        "Without the gravity that Eq. 8 keeps, the spin only sets the pace: in free flight the curves fall one after "
        "the other, and none rises again. At 5 rad/s the published program's water does not move at all: its α takes "
        "(α/2m)² off ω², and here the two are equal.",
    )  # fmt: skip


def exhibits_8b(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the angular velocity for several angles at release."""
    yield from _eight(
        runs, "8b", "angle", lambda case: f"θ₀ = {math.degrees(case.value):.0f}°", "what the angle at release θ₀ does",
        "In free flight the angle does nothing at all: a falling bottle cannot know where down is. What is seen in the "
        "other two is the gravity that Eq. 8 keeps.",
    )  # fmt: skip


def exhibits_8c(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the angular velocity for several aspect ratios."""
    yield from _eight(
        runs, "8c", "aspect", lambda case: f"L / 2R = {case.value:g}", "what the aspect ratio does at equal volume",
        "The paper's curves nearly coincide. The ratio is L / 2R, 3.5 for the paper's bottle, with volume, mass and "
        "water kept.",
    )  # fmt: skip


def exhibits_s1a(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the angular velocity for several numbers of time steps."""
    panels = []
    for solver in SOLVERS:
        lines = [line for filling in numbers("figure-S1-filling") for line in _steps(runs, solver, filling)]
        panels.append(Panel(solver=solver, heading="", lines=tuple(lines)))
    grid = Grid(rows=(tuple(panels),), x=RELATIVE_TIME, y=(RELATIVE_OMEGA,), height=3.2, legend_columns=3)
    yield exhibit_grid(
        "S1a", "what the number of time steps P does",
        "How far does a curve of fewer steps lie from that of 1000? Eq. 8 and free flight choose their own steps; for "
        "them P is only the number of points given out, drawn as points on the same curve for the half-full bottle: 10 "
        "open, 100 small.",
        f"Line plots of omega over omega_0 by three solvers. Distance of the published program from its own curve of "
        f"1000 steps, as a fraction of omega_0: {_step_words(runs)}.",
        grid,
    )  # fmt: skip


def _steps(runs: PaperRuns, solver: str, filling: float) -> Iterator[Line]:
    fillings = numbers("figure-S1-filling")
    for case, run in runs.members(solver, f"steps {filling:g}"):
        finest = case.steps == max(numbers("figure-S1-steps"))
        x, y = relative_omega(run)
        label = f"M̃ = {filling:g}, P = {case.value:g}"
        rank = fillings.index(filling)
        if solver == PUBLISHED or finest:
            dash = sorted(numbers("figure-S1-steps"), reverse=True).index(case.value)
            look = ranked(rank, len(fillings), dash)
        else:
            fewest = case.value == min(numbers("figure-S1-steps"))
            look = dots(ramp(rank, len(fillings)), filled=not fewest, size=6.0 if fewest else 2.5)
        yield Line(label=label, x=x, y=y, look=look)


def _step_words(runs: PaperRuns) -> str:
    words = []
    for filling in numbers("figure-S1-filling"):
        found: dict[float, Trajectory] = {
            case.value: run for case, run in runs.members(PUBLISHED, f"steps {filling:g}")
        }
        if not found:
            continue
        finest = found[max(found)]
        for steps, run in sorted(found.items())[:-1]:
            there = np.interp(run.t, finest.t, finest.omega)
            far = float(np.abs(run.omega - there).max()) / run.scenario.omega0
            words.append(f"filling {filling:g} with {steps:g} steps {far:.2g}")
    return ", ".join(words)


RECIPES: Final[dict[str, tuple[tuple[str, ...], Callable[[PaperRuns], Iterator[Exhibit]]]]] = {
    "5b": (("beta", "beta at 5 /s"), exhibits_5b),
    "5c": (("beta", "beta at 5 /s"), exhibits_5c),
    "5d": (("slices", "slices at 5 /s", "slices at alpha 1"), exhibits_5d),
    "6b": (("drag",), exhibits_6b),
    "6c": (("drag",), exhibits_6c),
    "7a": (("filling",), exhibits_7a),
    "8a": (("spin",), exhibits_8a),
    "8b": (("angle",), exhibits_8b),
    "8c": (("aspect",), exhibits_8c),
    "S1a": (("steps 0.25", "steps 0.5", "steps 0.75"), exhibits_s1a),
}
"""Figure -> the families it needs, and how it is made."""
