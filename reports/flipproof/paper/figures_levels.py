"""Figures 7b, 9b and 9c: one number per flight over the filling."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from flipproof.figures.style import solver_style
from flipproof.frame.exhibit import Exhibit
from flipproof.paper import figures_panels as panels
from flipproof.paper.cases import paper_throw
from flipproof.paper.figures_panels import Axis, Grid, Line
from flipproof.paper.observe import level_by_points, steady_level
from flipproof.paper.runs import SOLVERS, PaperRuns
from slicemodel import Trajectory
from slicemodel.landing import Moment, moment_at, next_upright
from slicemodel.observables import static_toppling_angle

FILLING: Final = Axis("filling M̃ [1]", "M_tilde [1]", 0.0, 1.04)


@dataclass(frozen=True, slots=True)
class Points:
    """A number at each filling by one definition: solver -> filling -> number; drawn filled and joined, or open."""

    label: str
    filled: bool
    values: Mapping[str, Mapping[float, float]]

    def line(self, solver: str) -> Line:
        """Return the points of one solver."""
        curves = self.values[solver]
        look = panels.dots(solver_style(solver)["color"], filled=self.filled, joined=self.filled)
        return Line(self.label, np.array(list(curves)), np.array(list(curves.values())), look)

    def words(self, digits: int) -> str:
        """Return the numbers as words."""
        return panels.listed(lambda solver: {f"{fill:g}": value for fill, value in self.values[solver].items()}, digits)


def _points(runs: PaperRuns, label: str, family: str, of: Callable[[Trajectory], float], *, filled: bool) -> Points:
    """Return the points where there is a number, which is finite."""
    curves = {solver: [(case.value, of(run)) for case, run in runs.members(solver, family)] for solver in SOLVERS}
    finite = {solver: {at: value for at, value in points if math.isfinite(value)} for solver, points in curves.items()}
    return Points(label, filled, finite)


def _row(y: Axis, points: Sequence[Points], *extra: Line) -> panels.Row:
    return panels.row_of(y, lambda solver: (*extra, *(series.line(solver) for series in points)))


def _exhibits_7b(runs: PaperRuns) -> Iterator[Exhibit]:
    lowest = _points(runs, "around the minimum, as the paper has it", "filling", level_by_points, filled=True)
    second = _points(runs, "mean of the second half", "filling", steady_level, filled=False)
    row = _row(Axis("ω_f / ω₀ [1]", "omega_f/omega_0 [1]", 0.0, 1.05), (lowest, second))
    best = panels.Shade("x", 0.2, 0.5, "best filling as the paper has it")
    yield panels.exhibit_grid(
        "7b", "the level ω falls to, over the filling",
        "Filled: mean of the 21 points around the minimum. Open: mean of the second half of the flight; where the two "
        "part there is no plateau. Shaded: the paper's best filling.",
        "Points of omega_f over omega_0 against filling by three solvers. Around the minimum: "
        f"{lowest.words(3)}. Mean of the second half: {second.words(3)}.",
        Grid(FILLING, (row,), 3.2, (best,)),
    )  # fmt: skip


def _exhibits_9b(runs: PaperRuns) -> Iterator[Exhibit]:
    upright, landed = _at_two_moments(runs, lambda moment: math.degrees(moment.toppling_angle))
    fine = np.linspace(0.01, 1.0, 200)
    rest = np.degrees([static_toppling_angle(paper_throw(float(filling))) for filling in fine])
    red = {"color": "#CC0000", "linestyle": "-", "linewidth": 1.6}  # the paper's colour of this curve
    best = int(rest.argmax())
    axis = Axis("toppling angle θ_c [degrees]", "theta_c [degrees]", 0.0, 50.0)
    row = _row(axis, (upright, landed), Line("at rest, Eq. 13b", fine, rest, red))
    yield panels.exhibit_grid(
        "9b", "critical toppling angle θ_c over the filling",
        f"Red: water at rest, highest ({rest[best]:.1f}°) at M̃ = {fine[best]:.2f}. Points: water where the solver has "
        "it, filled where the bottle stands upright again (θ = 2π, as the text says), open at T = 0.5 s (as the "
        "caption says, on landing). A point below the red line is a bottle that topples sooner than the same at rest; "
        "above it, slices lie in one another on the base, lower than water can.",
        f"Toppling angle in degrees against filling by three solvers. At rest: highest {rest[best]:.2f} at filling "
        f"{fine[best]:.3f}. At theta = 2 pi: {upright.words(1)}. At 0.5 s: {landed.words(1)}.",
        Grid(FILLING, (row,), 3.2),
    )  # fmt: skip


def _exhibits_9c(runs: PaperRuns) -> Iterator[Exhibit]:
    upright, landed = _at_two_moments(runs, lambda moment: moment.v_cm)
    curves = [abs(v) for points in (upright, landed) for values in points.values.values() for v in values.values()]
    v_limit = 1.1 * max([*curves, 0.25])
    row = _row(Axis("v_CM in the bottle [m/s], to the base", "v_CM [m/s]", -v_limit, v_limit), (upright, landed))
    shades = (
        panels.Shade("x", 0.25, 0.6, "where the paper has it beyond 0.2 m/s"),
        panels.Shade("y", -0.2, 0.2, "slower than 0.2 m/s"),
    )
    yield panels.exhibit_grid(
        "9c", "velocity of the centre of mass on landing",
        "Velocity dr_CM/dt along the bottle, positive towards the base; the paper has it "
        "negative and does not say which way it counts, nor whether "
        "it means θ = 2π (filled) or T = 0.5 s (open). Where the shaded ranges cross, its statement needs points "
        "outside the horizontal one. Its photographs are not drawn again.",
        "Velocity of the centre of mass in the bottle in m/s against filling by three solvers. At theta = 2 pi: "
        f"{upright.words(2)}. At 0.5 s: {landed.words(2)}.",
        Grid(FILLING, (row,), 3.2, shades),
    )  # fmt: skip


def _at_two_moments(runs: PaperRuns, of: Callable[[Moment], float]) -> tuple[Points, Points]:
    def upright(run: Trajectory) -> float:
        moment = next_upright(run)
        return math.nan if moment is None else of(moment)

    def landed(run: Trajectory) -> float:
        return of(moment_at(run, float(run.t[-1])))

    return (
        _points(runs, "upright again, θ = 2π", "long", upright, filled=True),
        _points(runs, "at T = 0.5 s", "filling", landed, filled=False),
    )


RECIPES: Final[dict[str, panels.Recipe]] = {
    "7b": (("filling",), _exhibits_7b),
    "9b": (("filling", "long"), _exhibits_9b),
    "9c": (("filling", "long"), _exhibits_9c),
}
