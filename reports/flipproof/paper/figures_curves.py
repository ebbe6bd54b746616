"""Figures 5, 6, 7a, 8 and S1a: what happens over time in every throw of a family, solver by solver."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from flipproof.frame.exhibit import Exhibit
from flipproof.paper import figures_panels as panels
from flipproof.paper.cases import Case, family, number, numbers
from flipproof.paper.figures_panels import Axis, Grid, Line
from flipproof.paper.observe import normalised, steady_level
from flipproof.paper.runs import PUBLISHED, PaperRuns
from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray

TIME: Final = Axis("time t [s]", "t [s]", 0.0, number("duration"))
SHARE: Final = Axis("t / T [1]", "t/T [1]", 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Quantity:
    """What is drawn over time; ``curve`` reads abscissa and ordinate off a flight.

    In the alternative text ``plotted`` says what is drawn against what, and ``subject`` which ``number``, with how many
    ``digits`` after the point, stands for a curve.
    """

    x: Axis
    y: Axis
    curve: Callable[[Trajectory], tuple[FloatArray, FloatArray]]
    plotted: str
    subject: str
    number: Callable[[Trajectory], float]
    digits: int = 3


THETA: Final = Quantity(
    TIME,
    Axis("θ [rad]", "theta [rad]", 0.0, 3 * math.pi),
    lambda run: (run.t, run.theta),
    "theta against time",
    "Theta at 0.5 s in rad",
    lambda run: float(run.theta[-1]),
    digits=1,
)
OMEGA: Final = Quantity(
    TIME,
    Axis("ω [rad/s]", "omega [rad/s]", 0.0, 1.1 * number("release-spin")),
    lambda run: (run.t, run.omega),
    "omega against time",
    "Mean omega over omega_0 of the second half",
    steady_level,
)
RELATIVE: Final = Quantity(
    SHARE,
    Axis("ω / ω₀ [1]", "omega/omega_0 [1]", 0.0, 1.1),
    lambda run: (run.t / run.scenario.duration, normalised(run)),
    "omega over omega_0 against t over T",
    "Mean of the second half",
    steady_level,
)


def _of(symbol: str, unit: str = "", shown: Callable[[float], float] = float) -> Callable[[Case], str]:
    return lambda case: f"{symbol} = {shown(case.value):g}{unit}".replace("-", "−")


VARIED: Final = {
    "beta": (_of("β"), "α = 1 (caption), α/2m = 10 /s", "with alpha 1"),
    "beta at 5 /s": (_of("β"), "α = 0.5, α/2m = 5 /s", "with alpha 0.5"),
    "slices": (_of("N"), "α/2m = 10 /s kept", "at 10 per second"),
    "slices at 5 /s": (_of("N"), "α/2m = 5 /s kept", "at 5 per second"),
    "slices at alpha 1": (_of("N"), "α = 1 kept", "with alpha 1"),
    "drag": (_of("α", " kg/s"), "", ""),
    "filling": (_of("M̃"), "", ""),
    "spin": (_of("ω₀", " rad/s"), "", ""),
    "angle": (_of("θ₀", "°", math.degrees), "", ""),
    "aspect": (_of("L / 2R"), "", ""),
}
"""Family -> label of a curve, heading of its row, and words that tell its numbers from those of other rows."""


@dataclass(frozen=True, slots=True)
class Curves:
    """A figure of one quantity over time: a row for each family, ``height`` inches high."""

    quantity: Quantity
    families: tuple[str, ...]
    title: str
    caption: str
    height: float = 3.0
    legend_columns: int = 6


TWO_READINGS: Final = (
    "The caption's α = 1 and the damping rate of all later figures do not agree for ten slices; the upper row takes "
    "the first, the lower row the second. "
)

CURVES: Final = {
    "5b": Curves(
        THETA,
        ("beta", "beta at 5 /s"),
        "what the rebound β does to the angle θ(t)",
        f"{TWO_READINGS}Look at the end of the flight: does the elastic bottle (β = −1) turn ahead of the others?",
        height=2.5,
    ),
    "5c": Curves(
        OMEGA,
        ("beta", "beta at 5 /s"),
        "what the rebound β does to the angular velocity ω(t)",
        f"{TWO_READINGS}The paper has ω low and flat for β = −0.5 only, and bumpy for β = −1. In free flight no bottle "
        "speeds up late, whatever its β.",
        height=2.5,
    ),
    "5d": Curves(
        OMEGA,
        ("slices", "slices at 5 /s", "slices at alpha 1"),
        "what the number of slices N does to ω(t)",
        "In the upper rows the damping rate α/2m is kept and the curves close up with N. With α itself kept (bottom "
        "row, another scale) the published program stands still at N = 20, where α/2m equals ω₀, and spins up beyond "
        "ω₀ with more, so that the paper cannot have meant that.",
        height=2.5,
        legend_columns=7,
    ),
    "6b": Curves(
        THETA,
        ("drag",),
        "what the drag α does to the angle θ(t)",
        "The less a bottle has turned at the end, the lower its ω was on average.",
    ),
    "6c": Curves(
        OMEGA,
        ("drag",),
        "what the drag α does to the angular velocity ω(t)",
        "Is there one α whose curve drops and then stays flat? In the published program there is, near the paper's "
        "choice of 0.01, because its α weakens the centrifugal force instead of damping; in free flight every curve "
        "stays low.",
    ),
    "7a": Curves(
        RELATIVE,
        ("filling",),
        "what the filling M̃ does to ω(t)",
        "Look at M̃ = 0.1, which the experiment leaves at ω₀: the published program and Eq. 8 slow it down, free flight "
        "hardly does. And at M̃ = 1, which no solver keeps, because slices may overlap.",
        height=3.2,
    ),
    "8a": Curves(
        RELATIVE,
        ("spin",),
        "what the spin at release ω₀ does",
        "Without the gravity that Eq. 8 keeps, the spin sets only the pace and γ/ω₀: in free flight the curves fall "
        "one after the other, and none rises again. At 5 rad/s the published program's water does not move at all: "
        "its α takes (α/2m)² off ω², and here the two are equal.",
    ),
    "8b": Curves(
        RELATIVE,
        ("angle",),
        "what the angle at release θ₀ does",
        "In free flight the angle does nothing at all: a falling bottle cannot know where down is. What is seen in the "
        "other two is the gravity that Eq. 8 keeps.",
    ),
    "8c": Curves(
        RELATIVE,
        ("aspect",),
        "what the aspect ratio does at equal volume",
        "The paper's curves nearly coincide. The ratio is L / 2R, 3.5 for the paper's bottle, with volume, mass and "
        "water kept.",
    ),
}
"""Figure -> what it shows."""


def _exhibits_curves(name: str, runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield one figure of ``CURVES``."""
    shown = CURVES[name]
    quantity = shown.quantity
    rows = tuple(panels.row_of(quantity.y, partial(_lines, runs, quantity, of), VARIED[of][1]) for of in shown.families)
    count = ("", ", two rows", ", three rows")[len(rows) - 1]
    sentences: list[str] = []
    for of in shown.families:
        words = VARIED[of][2]
        words = words.capitalize() if sentences else f"{quantity.subject} {words}".rstrip()
        sentences.append(f"{words}: {panels.listed(partial(_numbers, runs, quantity, of), quantity.digits)}.")
    alt = f"Line plots of {quantity.plotted}{count} by three solvers. {' '.join(sentences)}"
    grid = Grid(quantity.x, rows, shown.height, legend_columns=shown.legend_columns)
    yield panels.exhibit_grid(name, shown.title, shown.caption, alt, grid)


def _lines(runs: PaperRuns, quantity: Quantity, of: str, solver: str) -> Iterator[Line]:
    # Ranks come from the values, so that a throw that one solver does not fly leaves the others their colours.
    values = sorted(case.value for case in family(of))
    for case, run in runs.members(solver, of):
        x, y = map(panels.every_third, quantity.curve(run))
        yield Line(VARIED[of][0](case), x, y, panels.ranked(values.index(case.value), len(values)))


def _numbers(runs: PaperRuns, quantity: Quantity, of: str, solver: str) -> dict[str, float]:
    return {VARIED[of][0](case): quantity.number(run) for case, run in runs.members(solver, of)}


def _exhibits_s1a(runs: PaperRuns) -> Iterator[Exhibit]:
    row = panels.row_of(RELATIVE.y, partial(_steps, runs))
    yield panels.exhibit_grid(
        "S1a", "what the number of time steps P does",
        "How far does a curve of fewer steps lie from that of 1000? Eq. 8 and free flight choose their own steps; for "
        "them P is only the number of points given out, drawn as points on the same curve for the half-full bottle: 10 "
        "open, 100 small.",
        f"Line plots of omega over omega_0 by three solvers. Distance of the published program from its own curve of "
        f"1000 steps, as a fraction of omega_0: {', '.join(_step_words(runs))}.",
        Grid(SHARE, (row,), height=3.2, legend_columns=3),
    )  # fmt: skip


def _steps(runs: PaperRuns, solver: str) -> Iterator[Line]:
    fillings, every = numbers("figure-S1-filling"), sorted(numbers("figure-S1-steps"), reverse=True)
    for rank, filling in enumerate(fillings):
        for case, run in runs.members(solver, f"steps {filling:g}"):
            if solver == PUBLISHED or case.value == every[0]:
                look = panels.ranked(rank, len(fillings), every.index(case.value))
            else:
                fewest = case.value == every[-1]
                look = panels.dots(panels.ramp(rank, len(fillings)), filled=not fewest, size=6.0 if fewest else 2.5)
            x, y = map(panels.every_third, RELATIVE.curve(run))
            yield Line(f"M̃ = {filling:g}, P = {case.value:g}", x, y, look)


def _step_words(runs: PaperRuns) -> Iterator[str]:
    for filling in numbers("figure-S1-filling"):
        by_value = {case.value: run for case, run in runs.members(PUBLISHED, f"steps {filling:g}")}
        *fewer, max_steps = sorted(by_value) or [0.0]
        for steps in fewer:
            run, finest = by_value[steps], by_value[max_steps]
            reference = np.interp(run.t, finest.t, finest.omega)
            far = float(np.abs(run.omega - reference).max()) / run.scenario.omega0
            yield f"filling {filling:g} with {steps:g} steps {far:.2g}"


# ---------------------------------------------------------------------- paths of slices

POSITION: Final = Axis(
    "r [m], cap at 0", "r [m]", low=-0.02 * number("length"), high=1.1 * number("length"), upside_down=True
)
"""The range of the Python program's own plot, the cap on top."""


def _exhibits_5a(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the paths of ten slices for three rebounds, once for each reading of the drag."""
    slices = {i: f"slice {i + 1}" for i in range(round(number("figure-5-slices")))}
    for suffix, of, words in (
        ("", "beta", "α = 1 as the caption says, α/2m = 10 /s"),
        ("-5-per-second", "beta at 5 /s", "α = 0.5, the damping rate α/2m = 5 /s of all later figures"),
    ):
        yield _paths(
            runs, f"5a{suffix}", of, numbers("figure-5-rebound"), slices, "beta",
            f"what the rebound β does to ten slices ({words})",
            "Slice 1 starts on the base, slice 10 on top of the water. Look at the ends: with β = 0 slices stay "
            "where they hit until something pulls them off: in free flight the tube, which the drag of the other "
            "slices speeds up; in Eq. 8 weight and the drag against the moving centre of mass; in the published "
            "program weight, or its spring, which turns round where ω falls below α/2m.",
        )  # fmt: skip


def _exhibits_6a(runs: PaperRuns) -> Iterator[Exhibit]:
    n = round(number("figure-6-slices"))
    slices = {0: "first slice", n // 2 - 1: "middle slice (number N/2)", n - 1: "last slice"}
    yield _paths(
        runs, "6a", "drag", (0.0, 0.0075, 0.01, 0.0125), slices, "alpha",
        "what the drag α does to the first, the middle and the last slice",
        "The first slice starts on the base, the last one on top of the water. The more drag, the later the last one "
        "reaches the cap.",
    )  # fmt: skip


def _paths(
    runs: PaperRuns,
    name: str,
    of: str,
    values: tuple[float, ...],
    slices: Mapping[int, str],
    symbol: str,
    title: str,
    caption: str,
) -> Exhibit:
    """Return a row of panels for each of the ``values`` of a family; ``slices`` are those drawn, with their names."""

    def lines(solver: str, case: Case) -> Iterator[Line]:
        run = runs.trajectory(solver, case.key)
        if run is not None:
            t = panels.every_third(run.t)
            for k, (i, label) in enumerate(slices.items()):
                yield Line(label, t, panels.every_third(run.r[:, i]), panels.ranked(k, len(slices), dash=0))
            yield Line("centre of mass", t, panels.every_third(run.r_cm), panels.DASHED)

    def ends(solver: str) -> dict[str, float]:
        flown = runs.members(solver, of)
        return {f"{case.value:g}": float(run.r_cm[-1] / run.scenario.bottle.length) for case, run in flown}

    cases = [case for case in family(of) if case.value in values]
    rows = tuple(panels.row_of(POSITION, partial(lines, case=case), VARIED[of][0](case)) for case in cases)
    return panels.exhibit_grid(
        name, title,
        f"Cap on top, base below, the centre of mass dashed. {caption}",
        f"Line plots of slice positions against time, a row for each {symbol}, a column for each solver. Centre of "
        f"mass from the cap at the end, as a fraction of the length, by {symbol}: {panels.listed(ends)}.",
        Grid(TIME, rows, height=2.1),
    )  # fmt: skip


RECIPES: Final[dict[str, panels.Recipe]] = {
    **{name: (shown.families, partial(_exhibits_curves, name)) for name, shown in CURVES.items()},
    "5a": (("beta", "beta at 5 /s"), _exhibits_5a),
    "6a": (("drag",), _exhibits_6a),
    "S1a": (tuple(f"steps {filling:g}" for filling in numbers("figure-S1-filling")), _exhibits_s1a),
}
