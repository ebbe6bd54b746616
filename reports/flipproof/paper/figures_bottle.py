"""Figures 2b, 3b and 9a: the bottle itself, at rest, in flight and about to topple.

u_r = (sin theta, -cos theta) points from the cap to the base, n = (cos theta, sin theta) across.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from flipproof.figures.style import new_figure, styled
from flipproof.frame.exhibit import Exhibit
from flipproof.output.columns import rows_csv
from flipproof.paper.cases import HALF_FULL, family
from flipproof.paper.figures_panels import COLUMN, NAMES, RAMP, exhibit, head, legend_below, listed, settings_words
from flipproof.paper.runs import SOLVERS, PaperRuns
from slicemodel import Scenario, Trajectory
from slicemodel.landing import lab_motion, moment_at
from slicemodel.observables import static_toppling_angle
from slicemodel.trajectory import FloatArray

WATER: Final = "#3B8EC2"
MOMENT: Final = 0.1
"""Time at which Fig. 2b shows the bottle in motion [s]."""

SHOWN: Final = "beta -0.5, 5 /s"
"""Case of Fig. 2b: ten slices at the usual damping rate."""

VECTORS: Final = 26
"""Vectors of a flight in Fig. 3b: one every 20 ms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """A bottle somewhere: place of its cap [m], angle [rad], slices and centre of mass along its axis [m]."""

    cap: tuple[float, float]
    theta: float
    r: FloatArray
    r_cm: float

    def axis(self) -> FloatArray:
        """Return u_r."""
        return np.array([math.sin(self.theta), -math.cos(self.theta)])

    def across(self) -> FloatArray:
        """Return n."""
        return np.array([math.cos(self.theta), math.sin(self.theta)])

    def place(self, r: float, sideways: float = 0.0) -> FloatArray:
        """Return the point at ``r`` along the axis and ``sideways`` across [m]."""
        return np.asarray(self.cap) + r * self.axis() + sideways * self.across()

    def box(self, begin: float, end: float, radius: float) -> FloatArray:
        """Return the corners of the part of the bottle from ``begin`` to ``end``, shape (4, 2)."""
        corners = ((begin, -radius), (begin, radius), (end, radius), (end, -radius))
        return np.array([self.place(r, side) for r, side in corners])


def standing(scenario: Scenario, x: float, r: FloatArray, r_cm: float) -> Pose:
    """Return the bottle standing upright at ``x`` with its base at y = 0."""
    return Pose(cap=(x, scenario.bottle.length), theta=0.0, r=r, r_cm=r_cm)


def tipping(scenario: Scenario, tilt: float, r: FloatArray, r_cm: float) -> Pose:
    """Return the bottle tilted by ``tilt`` on the rim of its base, which touches the origin."""
    bottle = scenario.bottle
    base = bottle.radius * np.array([math.cos(tilt), math.sin(tilt)])
    cap = base - bottle.length * np.array([math.sin(tilt), -math.cos(tilt)])
    return Pose(cap=(float(cap[0]), float(cap[1])), theta=tilt, r=r, r_cm=r_cm)


def _draw_bottle(axes: Axes, pose: Pose, scenario: Scenario) -> None:
    bottle, half = scenario.bottle, scenario.slice_height / 2
    slices = [pose.box(r - half, r + half, bottle.radius) for r in pose.r]
    # Hundreds of slices as one picture: as shapes of their own they would be a twelfth of the page.
    axes.add_collection(
        PolyCollection(slices, facecolors=WATER, edgecolors="none", alpha=0.4, rasterized=len(slices) > 100)
    )
    if len(slices) <= 20:
        axes.add_collection(PolyCollection(slices, facecolors="none", edgecolors="#1B4F72", linewidths=0.6))
    outline = [pose.box(0.0, bottle.length, bottle.radius)]
    axes.add_collection(PolyCollection(outline, facecolors="none", edgecolors="black", linewidths=1.4))
    cap = [pose.box(-0.015, 0.0, 0.4 * bottle.radius)]
    axes.add_collection(PolyCollection(cap, facecolors="#444444", edgecolors="black"))
    axes.plot(*pose.place(pose.r_cm), "o", color="#CC0000", markersize=5, label="centre of mass", linestyle="none")


def _no_grid(axes: Axes, x: tuple[float, float], y: tuple[float, float]) -> None:
    axes.set_aspect("equal")
    axes.set_xlim(*x)
    axes.set_ylim(*y)
    axes.set_xlabel("x [m]")


# ---------------------------------------------------------------------- Fig. 2b


@dataclass(frozen=True, slots=True)
class RestAndMotion:
    """One panel of Fig. 2b."""

    solver: str
    scenario: Scenario
    theta: float
    r: FloatArray
    r_cm: float


@styled
def figure_rest_and_motion(panels: tuple[RestAndMotion, ...]) -> Figure:
    """Draw the bottle at rest and in motion, slice by slice, for every solver."""
    figure, row = new_figure(1, len(panels), size=(COLUMN * len(panels), 3.5), sharey=True, squeeze=False)
    for axes, panel in zip(row[0], panels, strict=True):
        scenario = panel.scenario
        at_rest = scenario.initial_positions()
        start = standing(scenario, -0.12, at_rest, _centre(scenario, at_rest))
        _draw_bottle(axes, start, scenario)
        middle = np.array([0.14, scenario.bottle.length / 2])
        axis = np.array([math.sin(panel.theta), -math.cos(panel.theta)])
        cap = middle - scenario.bottle.length / 2 * axis
        _draw_bottle(axes, Pose(cap=(cap[0], cap[1]), theta=panel.theta, r=panel.r, r_cm=panel.r_cm), scenario)
        axes.text(-0.12, -0.035, "at rest", ha="center", va="top", fontsize=9)
        axes.text(0.14, -0.035, f"after {MOMENT:g} s", ha="center", va="top", fontsize=9)
        _no_grid(axes, (-0.2, 0.32), (-0.08, 0.33))
        head(axes, panel.solver)
    row[0][0].set_ylabel("y [m]")
    legend_below(figure, row[0], 1)
    return figure


def _centre(scenario: Scenario, r: FloatArray) -> float:
    from slicemodel.observables import centre_of_mass

    return float(centre_of_mass(scenario, r))


def exhibits_2b(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the bottle at rest and in motion."""
    panels = []
    for solver in SOLVERS:
        run = runs.trajectory(solver, SHOWN)
        if run is not None:
            k = int(np.abs(run.t - MOMENT).argmin())
            panels.append(RestAndMotion(solver, run.scenario, float(run.theta[k]), run.r[k], float(run.r_cm[k])))
    rows = [
        (panel.solver, i + 1, at_rest, in_motion)
        for panel in panels
        for i, (at_rest, in_motion) in enumerate(zip(panel.scenario.initial_positions(), panel.r, strict=True))
    ]
    words = listed(
        {p.solver: {"theta [rad]": p.theta, "centre of mass [m]": p.r_cm, "last slice [m]": p.r[-1]} for p in panels}
    )
    yield exhibit(
        "2b", "the bottle at rest and in motion",
        "Half full, ten slices of the water, each drawn with its own height across the bottle; where they overlap the "
        "blue is fuller. The paper's sketch names neither filling nor moment: both are chosen here. Ten slices at the "
        "usual damping rate of 5 /s for every solver.",
        f"Sketches of the bottle at rest and {MOMENT:g} s after release for three solvers. {words}.",
        figure_rest_and_motion, (tuple(panels),),
        rows_csv(("solver", "slice [1]", "r at rest [m]", f"r after {MOMENT:g} s [m]"), rows),
    )  # fmt: skip


# ---------------------------------------------------------------------- Fig. 3b


@dataclass(frozen=True, slots=True)
class Flight:
    """One panel of Fig. 3b: cap, base and centre of mass in the lab at a few times, shape (K, 2) each [m]."""

    solver: str
    heading: str
    t: FloatArray
    cap: FloatArray
    base: FloatArray
    centre: FloatArray


@styled
def figure_vectors(rows: tuple[tuple[Flight, ...], ...]) -> Figure:
    """Draw every flight as vectors from cap to base, coloured by time."""
    figure, grid = new_figure(
        len(rows), len(SOLVERS), size=(COLUMN * len(SOLVERS), 0.9 + 2.6 * len(rows)), sharex=True, sharey=True,
        squeeze=False,
    )  # fmt: skip
    every = [point for row in rows for flight in row for ends in (flight.cap, flight.base) for point in ends]
    low, high = (np.min(every, axis=0), np.max(every, axis=0)) if every else (np.zeros(2), np.ones(2))
    arrows: Any = None
    for k, row in enumerate(rows):
        for flight in row:
            axes = grid[k][SOLVERS.index(flight.solver)]
            along = flight.base - flight.cap
            arrows = axes.quiver(
                *flight.cap.T, *along.T, flight.t, angles="xy", scale_units="xy", scale=1.0, cmap=RAMP,
                width=0.006, headwidth=4.0,
            )  # fmt: skip
            axes.plot(*flight.centre.T, color="#CC0000", linewidth=1.2, label="centre of mass")
            axes.set_aspect("equal")
            axes.set_xlim(low[0] - 0.02, high[0] + 0.02)
            axes.set_ylim(low[1] - 0.02, high[1] + 0.02)
            axes.text(0.98, 0.97, flight.heading, transform=axes.transAxes, ha="right", va="top", fontsize=9,
                      bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0})  # fmt: skip
            if k == 0:
                head(axes, flight.solver)
        grid[k][0].set_ylabel("y [m]")
    for axes in grid[-1]:
        axes.set_xlabel("x [m]")
    if arrows is not None:
        figure.colorbar(arrows, ax=grid, label="time t [s]", shrink=0.5)
    legend_below(figure, (axes for row in grid for axes in row), 1)
    return figure


def exhibits_3b(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the flights of ice and water as vectors."""
    rows = []
    for case in family("flight"):
        heading = "ice, half full" if case.scenario.frozen else f"M̃ = {case.value:g}"
        flown = [(solver, runs.trajectory(solver, case.key)) for solver in SOLVERS]
        rows.append(tuple(_flight(solver, heading, run) for solver, run in flown if run is not None))
    words = listed(
        {
            solver: {
                f.heading: math.degrees(math.atan2(*(f.base - f.cap)[-1] * (1, -1)) % math.tau)
                for row in rows
                for f in row
                if f.solver == solver
            }
            for solver in SOLVERS
        },
        digits=0,
    )
    cells = [
        (flight.solver, flight.heading, *map(float, (t, *cap, *base, *centre)))
        for row in rows
        for flight in row
        for t, cap, base, centre in zip(flight.t, flight.cap, flight.base, flight.centre, strict=True)
    ]
    header = ("solver", "bottle", "t [s]", "x_cap [m]", "y_cap [m]", "x_base [m]", "y_base [m]", "x_CM [m]", "y_CM [m]")
    yield exhibit(
        "3b", "the flight as vectors from cap to base",
        "An arrow every 20 ms, its tail the cap. The centre of mass (red) flies the same parabola whatever the solver; "
        "how often the bottle turns while it does so is what they differ in. The launch speed is the paper's 2 m/s, "
        f"its direction chosen. {settings_words()}",
        f"Vector plots of flights, four bottles by three solvers. Angle at 0.5 s, modulo 360 degrees: {words}.",
        figure_vectors, (tuple(rows),), rows_csv(header, cells),
    )  # fmt: skip


def _flight(solver: str, heading: str, run: Trajectory) -> Flight:
    motion = lab_motion(run)
    at = np.linspace(0, len(run.t) - 1, VECTORS).round().astype(int)
    return Flight(solver, heading, run.t[at], motion.cap[at], motion.base[at], motion.centre[at])


# ---------------------------------------------------------------------- Fig. 9a


@dataclass(frozen=True, slots=True)
class Tipping:
    """One panel of Fig. 9a: a bottle at the angle at which it topples [rad]. ``solver`` is empty at rest."""

    solver: str
    scenario: Scenario
    tilt: float
    r: FloatArray
    r_cm: float


@styled
def figure_tipping(panels: tuple[Tipping, ...]) -> Figure:
    """Draw bottles that stand on the rim of their base, the centre of mass right above it."""
    figure, row = new_figure(1, len(panels), size=(2.4 * len(panels), 3.3), sharey=True, squeeze=False)
    for axes, panel in zip(row[0], panels, strict=True):
        pose = tipping(panel.scenario, panel.tilt, panel.r, panel.r_cm)
        axes.axhline(0.0, color="#444444", linewidth=1.5)
        _draw_bottle(axes, pose, panel.scenario)
        axes.plot([0.0, 0.0], [0.0, 0.36], color="#CC0000", linestyle=":", linewidth=1.4)
        axes.text(0.16, 0.33, f"θ_c = {math.degrees(panel.tilt):.1f}°", ha="right", va="top", fontsize=10)
        _no_grid(axes, (-0.24, 0.17), (-0.03, 0.37))
        if panel.solver:
            head(axes, panel.solver)
        else:
            axes.set_title("water at rest", fontsize=11, fontweight="bold")
    row[0][0].set_ylabel("y [m]")
    legend_below(figure, row[0], 1)
    return figure


def exhibits_9a(runs: PaperRuns) -> Iterator[Exhibit]:
    """Yield the definition of the critical toppling angle, at rest and with the water where each solver leaves it."""
    flown = [run for solver in SOLVERS if (run := runs.trajectory(solver, HALF_FULL)) is not None]
    panels = [_resting(run.scenario) for run in flown[-1:]]
    for run in flown:
        moment = moment_at(run, float(run.t[-1]))
        panels.append(Tipping(run.method, run.scenario, moment.toppling_angle, run.r[-1], moment.r_cm))
    rows = [(panel.solver or "at rest", panel.r_cm, math.degrees(panel.tilt)) for panel in panels]
    words = ", ".join(f"{NAMES.get(panel.solver, 'at rest')} {math.degrees(panel.tilt):.1f}" for panel in panels)
    yield exhibit(
        "9a", "what the critical toppling angle θ_c is",
        "The half-full bottle on the rim of its base, tilted until its centre of mass (red) stands right above the "
        "rim: tilted further, it topples. The higher the water, the smaller the angle; water where each solver has it "
        f"at T = 0.5 s. {settings_words()}",
        f"Sketches of tilted bottles. Critical toppling angle in degrees: {words}.",
        figure_tipping, (tuple(panels),), rows_csv(("water", "r_CM [m]", "theta_c [degrees]"), rows),
    )  # fmt: skip


def _resting(scenario: Scenario) -> Tipping:
    r = scenario.initial_positions()
    return Tipping("", scenario, static_toppling_angle(scenario), r, _centre(scenario, r))


RECIPES: Final[dict[str, tuple[tuple[str, ...], Callable[[PaperRuns], Iterator[Exhibit]]]]] = {
    "2b": (("beta at 5 /s",), exhibits_2b),
    "3b": (("flight",), exhibits_3b),
    "9a": (("filling",), exhibits_9a),
}
"""Figure -> the families it needs, and how it is made."""
