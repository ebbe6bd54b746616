"""Figures 7b, 9b, 9c, S1b and S1c: one number per flight over filling, slices or time steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from flipproof.figures.style import solver_style
from flipproof.frame.exhibit import Exhibit
from flipproof.paper.costs import Cost
from flipproof.paper.figures_panels import (
    Axis,
    Band,
    Grid,
    Line,
    Panel,
    dots,
    exhibit_grid,
    listed,
    ranked,
    stretched,
)
from flipproof.paper.parameters import paper_throw
from flipproof.paper.runs import PUBLISHED, SOLVERS, PaperRuns
from slicemodel import Trajectory
from slicemodel.landing import Moment, moment_at, next_upright
from slicemodel.observables import plateau, plateau_of_points, static_toppling_angle

FILLING: Final = Axis(label="filling M̃ [1]", column="M_tilde [1]", low=0.0, high=1.04)
LEVEL: Final = Axis(label="ω_f / ω₀ [1]", column="omega_f/omega_0 [1]", low=0.0, high=1.05)
ANGLE: Final = Axis(label="toppling angle θ_c [degrees]", column="theta_c [degrees]", low=0.0, high=50.0)
VELOCITY: Final = Axis(label="v_CM in the bottle [m/s], to the base", column="v_CM [m/s]")

FINE: Final = 200
"""Points of the curve at rest."""

RED: Final = {"color": "#CC0000", "linestyle": "-", "linewidth": 1.6}
"""The paper's colour of the curve at rest."""


@dataclass(frozen=True, slots=True)
class _Reading:
    """A number at each filling, by one definition."""

    label: str
    filled: bool
    values: dict[float, float]

    def line(self, solver: str) -> Line:
        colour = solver_style(solver)["color"]
        return Line(
            label=self.label,
            x=np.array(list(self.values)),
            y=np.array(list(self.values.values())),
            look=dots(colour, filled=self.filled, joined=self.filled),
        )


def _read(runs: PaperRuns, solver: str, family: str, of: Callable[[Trajectory], float | None]) -> dict[float, float]:
    found = ((case.value, of(run)) for case, run in runs.members(solver, family))
    return {filling: value for filling, value in found if value is not None and math.isfinite(value)}


def exhibits_7b(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the level that omega falls to over the filling, by two definitions."""
    readings = {
        solver: (
            _Reading("around the minimum, as the paper has it", True, _read(runs, solver, "filling", _lowest)),
            _Reading("mean of the second half", False, _read(runs, solver, "filling", _second_half)),
        )
        for solver in SOLVERS
    }
    grid = Grid(
        rows=(_row(readings),), x=FILLING, y=(LEVEL,), height=3.2,
        bands=(Band(along="x", low=0.2, high=0.5, label="best filling as the paper has it"),),
    )  # fmt: skip
    yield exhibit_grid(
        "7b", "the level ω falls to, over the filling",
        "Filled: mean of the 21 points around the minimum. Open: mean of the second half of the flight; where the two "
        "part there is no plateau. Shaded: the paper's best filling.",
        "Points of omega_f over omega_0 against filling by three solvers. Around the minimum: "
        f"{_words(readings, 0, 3)}. Mean of the second half: {_words(readings, 1, 3)}.",
        grid,
    )  # fmt: skip


def _lowest(run: Trajectory) -> float:
    return plateau_of_points(run.t, run.omega, run.scenario.omega0).level


def _second_half(run: Trajectory) -> float:
    return plateau(run.t, run.omega, run.scenario.omega0)


def exhibits_9b(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the critical toppling angle over the filling, at rest and in flight."""
    readings = _at_two_moments(runs, lambda moment: math.degrees(moment.toppling_angle))
    fine = np.linspace(0.01, 1.0, FINE)
    rest = np.degrees([static_toppling_angle(paper_throw(float(filling))) for filling in fine])
    at_rest = Line(label="at rest, Eq. 13b", x=fine, y=rest, look=RED)
    best = int(rest.argmax())
    row = _row(readings, at_rest)
    grid = Grid(rows=(row,), x=FILLING, y=(stretched(ANGLE, row),), height=3.2)
    yield exhibit_grid(
        "9b", "critical toppling angle θ_c over the filling",
        f"Red: water at rest, highest ({rest[best]:.1f}°) at M̃ = {fine[best]:.2f}. Points: water where the solver has "
        "it, filled where the bottle stands upright again (θ = 2π, as the text says), open at T = 0.5 s (as the "
        "caption says, on landing). A point below the red line is a bottle that topples sooner than the same at rest; "
        "above it, slices lie in one another on the base, lower than water can.",
        f"Toppling angle in degrees against filling by three solvers. At rest: highest {rest[best]:.2f} at filling "
        f"{fine[best]:.3f}. At theta = 2 pi: {_words(readings, 0, 1)}. At 0.5 s: {_words(readings, 1, 1)}.",
        grid,
    )  # fmt: skip


def exhibits_9c(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the velocity of the centre of mass on landing over the filling."""
    readings = _at_two_moments(runs, lambda moment: moment.v_cm)
    values = [abs(value) for found in readings.values() for reading in found for value in reading.values.values()]
    most = 1.1 * max([*values, 0.25])
    axis = Axis(label=VELOCITY.label, column=VELOCITY.column, low=-most, high=most)
    grid = Grid(
        rows=(_row(readings),), x=FILLING, y=(axis,), height=3.2,
        bands=(
            Band(along="x", low=0.25, high=0.6, label="where the paper has it beyond 0.2 m/s"),
            Band(along="y", low=-0.2, high=0.2, label="slower than 0.2 m/s"),
        ),
    )  # fmt: skip
    yield exhibit_grid(
        "9c", "velocity of the centre of mass on landing",
        "Velocity dr_CM/dt along the bottle, positive towards the base as in the table of statements; the paper has it "
        "negative and does not say which way it counts, nor whether "
        "it means θ = 2π (filled) or T = 0.5 s (open). Where the shaded ranges cross, its statement needs points "
        "outside the horizontal one. Its photographs are not drawn again.",
        "Velocity of the centre of mass in the bottle in m/s against filling by three solvers. At theta = 2 pi: "
        f"{_words(readings, 0, 2)}. At 0.5 s: {_words(readings, 1, 2)}.",
        grid,
    )  # fmt: skip


def _at_two_moments(runs: PaperRuns, of: Callable[[Moment], float]) -> dict[str, tuple[_Reading, ...]]:
    def upright(run: Trajectory) -> float | None:
        moment = next_upright(run)
        return None if moment is None else of(moment)

    def landed(run: Trajectory) -> float:
        return of(moment_at(run, float(run.t[-1])))

    return {
        solver: (
            _Reading("upright again, θ = 2π", True, _read(runs, solver, "long", upright)),
            _Reading("at T = 0.5 s", False, _read(runs, solver, "filling", landed)),
        )
        for solver in SOLVERS
    }


def _row(readings: Mapping[str, tuple[_Reading, ...]], *extra: Line) -> tuple[Panel, ...]:
    return tuple(
        Panel(solver=solver, heading="", lines=(*extra, *(reading.line(solver) for reading in found)))
        for solver, found in readings.items()
    )


def _words(readings: Mapping[str, tuple[_Reading, ...]], k: int, digits: int) -> str:
    values = {
        solver: {f"{filling:g}": v for filling, v in found[k].values.items()} for solver, found in readings.items()
    }
    return listed(values, digits)


# ---------------------------------------------------------------------- computing time

WORK: Final = Axis(label="work [slice evaluations]", column="work [1]", log=True)
SECONDS: Final = Axis(label="processor time [s]", column="processor time [s]", log=True)


def exhibits_s1b(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield what a run costs over its number of slices."""
    axis = Axis(label="slices N [1]", column="N [1]", log=True)
    yield _cost_exhibit(runs, "S1b", "what a run costs over its number of slices N", axis, over="slices")


def exhibits_s1c(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield what a run costs over its number of time steps."""
    axis = Axis(label="time steps or output times P [1]", column="P [1]", log=True)
    yield _cost_exhibit(runs, "S1c", "what a run costs over its number of time steps P", axis, over="steps")


def _cost_exhibit(runs: PaperRuns, name: str, title: str, x: Axis, *, over: str) -> Exhibit:
    rows = tuple(
        tuple(
            Panel(solver=solver, heading="", lines=tuple(_cost_lines(runs.costs, solver, over, of)))
            for solver in SOLVERS
        )
        for of in (lambda cost: float(cost.work), lambda cost: cost.seconds)
    )
    grid = Grid(rows=rows, x=x, y=(WORK, SECONDS), height=2.5)
    exponent = _exponent(runs.costs, over)
    return exhibit_grid(
        name, title,
        "Counted work above, processor time of this machine below. The published program's work is N P by "
        "construction, straight and of slope 1; its time is this program's compiled loop and bends where the fixed "
        "cost of a run dominates. The others evaluate their right-hand side as often as the impacts ask; their output "
        "times cost nothing.",
        f"Log-log plots of work and processor time by three solvers. The published program's work grows as the power "
        f"{exponent:.2f}; the longest of its runs took {_longest(runs.costs):.2g} s.",
        grid,
    )  # fmt: skip


def _cost_lines(costs: Sequence[Cost], solver: str, over: str, of: Callable[[Cost], float]) -> Iterator[Line]:
    """Yield one line for each value of what is not varied."""
    other = "steps" if over == "slices" else "slices"
    own = [cost for cost in costs if cost.solver == solver]
    kept = sorted({getattr(cost, other) for cost in own})
    symbol = "P" if other == "steps" else "N"
    every = sorted({getattr(cost, other) for cost in costs})
    for value in kept:
        found = sorted((getattr(cost, over), of(cost)) for cost in own if getattr(cost, other) == value)
        if len(found) < 2:
            continue
        x, y = np.array(found, dtype=np.float64).T
        look = {**ranked(every.index(value), len(every)), "marker": "o", "markersize": 4.0}
        yield Line(label=f"{symbol} = {value}", x=x, y=y, look=look)


def _exponent(costs: Sequence[Cost], over: str) -> float:
    """Return the exponent of the published program's counted work between the ends of the range."""
    other = "steps" if over == "slices" else "slices"
    own = [cost for cost in costs if cost.solver == PUBLISHED]
    if not own:
        return math.nan
    most = max(getattr(cost, other) for cost in own)
    ends = sorted((getattr(cost, over), cost.work) for cost in own if getattr(cost, other) == most)
    (few, less), (many, more) = ends[0], ends[-1]
    return math.log(more / less) / math.log(many / few)


def _longest(costs: Sequence[Cost]) -> float:
    return max((cost.seconds for cost in costs if cost.solver == PUBLISHED), default=math.nan)


RECIPES: Final[dict[str, tuple[tuple[str, ...], Callable[[PaperRuns], Iterator[Exhibit]]]]] = {
    "7b": (("filling",), exhibits_7b),
    "9b": (("filling", "long"), exhibits_9b),
    "9c": (("filling", "long"), exhibits_9c),
    "S1b": ((), exhibits_s1b),
    "S1c": ((), exhibits_s1c),
}
"""Figure -> the families it needs, and how it is made."""
