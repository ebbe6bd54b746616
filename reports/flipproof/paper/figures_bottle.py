"""Figures 2b, 3b and 9a: the bottle itself, at rest, in flight and about to topple.

u_r = (sin theta, -cos theta) points from the cap to the base, n = (cos theta, sin theta) across.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from flipproof.figures.spoken import SPOKEN
from flipproof.figures.style import new_figure, styled
from flipproof.frame.columns import rows_csv
from flipproof.frame.exhibit import Exhibit
from flipproof.paper.cases import HALF_FULL, family
from flipproof.paper.figures_panels import COLUMN, RAMP, Recipe, exhibit, head, legend_below, listed, settings_words
from flipproof.paper.runs import SOLVERS, PaperRuns
from slicemodel import Scenario, Trajectory
from slicemodel.landing import LabMotion, lab_motion, moment_at
from slicemodel.observables import centre_of_mass, static_toppling_angle
from slicemodel.trajectory import FloatArray

RED: Final = "#CC0000"
"""Colour of the centre of mass."""

MOMENT: Final = 0.1
"""Time at which Fig. 2b shows the bottle in motion [s]."""


@dataclass(frozen=True, slots=True)
class Pose:
    """A bottle by a solver, or at rest (""), tilted by ``theta`` [rad]; slices and centre of mass on its axis [m]."""

    solver: str
    scenario: Scenario
    theta: float
    r: FloatArray
    r_cm: float

    def along(self, r: float, sideways: float = 0.0) -> FloatArray:
        """Return the vector from the cap to the point at ``r`` along the axis and ``sideways`` across [m]."""
        sin, cos = math.sin(self.theta), math.cos(self.theta)
        return r * np.array([sin, -cos]) + sideways * np.array([cos, sin])


def at_rest(scenario: Scenario, theta: float = 0.0) -> Pose:
    """Return the bottle with its water as it is at release."""
    r = scenario.initial_positions()
    return Pose("", scenario, theta, r, float(centre_of_mass(scenario, r)))


def cap_of_tipping(pose: Pose) -> FloatArray:
    """Return the place of the cap of a bottle on the rim of its base, which touches the origin."""
    bottle = pose.scenario.bottle
    return -pose.along(bottle.length, -bottle.radius)


def _draw_bottle(axes: Axes, pose: Pose, cap: FloatArray) -> None:
    """Draw a bottle with its cap at a place."""
    bottle, half = pose.scenario.bottle, pose.scenario.slice_height / 2

    def add(boxes: list[tuple[float, float, float]], **look: Any) -> None:
        """Add parts of the bottle, each from one distance from the cap to another, and so wide to either side."""
        corners = [
            [cap + pose.along(r, side) for r, side in ((a, -wide), (a, wide), (b, wide), (b, -wide))]
            for a, b, wide in boxes
        ]
        axes.add_collection(PolyCollection(corners, **look))

    slices = [(r - half, r + half, bottle.radius) for r in pose.r]
    # Hundreds of slices as one picture: as shapes of their own they would be a twelfth of the page.
    add(slices, facecolors="#3B8EC2", edgecolors="none", alpha=0.4, rasterized=len(slices) > 100)
    if len(slices) <= 20:
        add(slices, facecolors="none", edgecolors="#1B4F72", linewidths=0.6)
    add([(0.0, bottle.length, bottle.radius)], facecolors="none", edgecolors="black", linewidths=1.4)
    add([(-0.015, 0.0, 0.4 * bottle.radius)], facecolors="#444444", edgecolors="black")
    centre = cap + pose.along(pose.r_cm)
    axes.plot(*centre, "o", color=RED, markersize=5, label="centre of mass", linestyle="none")


# ---------------------------------------------------------------------- Fig. 2b


@styled
def figure_rest_and_motion(poses: tuple[Pose, ...]) -> Figure:
    """Draw the bottle at rest and in motion, slice by slice, for every solver."""
    figure, (row,) = new_figure(1, len(poses), size=(COLUMN * len(poses), 3.5), sharey=True, squeeze=False)
    for axes, pose in zip(row, poses, strict=True):
        length = pose.scenario.bottle.length
        _draw_bottle(axes, at_rest(pose.scenario), np.array([-0.12, length]))
        _draw_bottle(axes, pose, np.array([0.14, length / 2]) - pose.along(length / 2))
        for x, words in ((-0.12, "at rest"), (0.14, f"after {MOMENT:g} s")):
            axes.text(x, -0.035, words, ha="center", va="top", fontsize=9)
        axes.set(aspect="equal", xlim=(-0.2, 0.32), ylim=(-0.08, 0.33), xlabel="x [m]")
        head(axes, pose.solver)
    row[0].set_ylabel("y [m]")
    legend_below(figure, row, 1)
    return figure


def _exhibits_2b(runs: PaperRuns) -> Iterator[Exhibit]:
    poses = {}
    for solver in SOLVERS:
        run = runs.trajectory(solver, "beta -0.5, 5 /s")
        if run is not None:
            k = int(np.abs(run.t - MOMENT).argmin())
            poses[solver] = Pose(solver, run.scenario, float(run.theta[k]), run.r[k], float(run.r_cm[k]))
    rows = [
        (solver, i + 1, rest, in_motion)
        for solver, pose in poses.items()
        for i, (rest, in_motion) in enumerate(zip(pose.scenario.initial_positions(), pose.r, strict=True))
    ]

    def words(solver: str) -> dict[str, float]:
        pose = poses.get(solver)
        if pose is None:
            return {}
        return {"theta [rad]": pose.theta, "centre of mass [m]": pose.r_cm, "last slice [m]": pose.r[-1]}

    yield exhibit(
        "2b", "the bottle at rest and in motion",
        "Half full, ten slices of the water, each drawn with its own height across the bottle; where they overlap the "
        "blue is fuller. The paper's sketch names neither filling nor moment: both are chosen here. Ten slices at the "
        "usual damping rate of 5 /s for every solver.",
        f"Sketches of the bottle at rest and {MOMENT:g} s after release for three solvers. {listed(words)}.",
        figure_rest_and_motion, (tuple(poses.values()),),
        rows_csv(("solver", "slice [1]", "r at rest [m]", f"r after {MOMENT:g} s [m]"), rows),
    )  # fmt: skip


# ---------------------------------------------------------------------- Fig. 3b

Vectors = tuple[str, str, FloatArray, LabMotion]
"""One panel of Fig. 3b: solver, heading, a few times [s], and where the bottle is then."""


@styled
def figure_vectors(rows: tuple[tuple[Vectors, ...], ...]) -> Figure:
    """Draw every flight as vectors from cap to base, coloured by time."""
    size = (COLUMN * len(SOLVERS), 0.9 + 2.6 * len(rows))
    figure, grid = new_figure(len(rows), len(SOLVERS), size=size, sharex=True, sharey=True, squeeze=False)
    ends = [end for row in rows for _, _, _, motion in row for end in (motion.cap, motion.base)]
    if not ends:
        return figure
    low, high = np.min(ends, axis=(0, 1)) - 0.02, np.max(ends, axis=(0, 1)) + 0.02
    for k, row in enumerate(rows):
        for solver, heading, t, motion in row:
            axes = grid[k][SOLVERS.index(solver)]
            arrows = axes.quiver(
                *motion.cap.T, *(motion.base - motion.cap).T, t, angles="xy", scale_units="xy", scale=1.0, cmap=RAMP,
                width=0.006, headwidth=4.0,
            )  # fmt: skip
            axes.plot(*motion.centre.T, color=RED, linewidth=1.2, label="centre of mass")
            axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
            box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
            axes.text(0.98, 0.97, heading, transform=axes.transAxes, ha="right", va="top", fontsize=9, bbox=box)
            if k == 0:
                head(axes, solver)
        grid[k][0].set_ylabel("y [m]")
    for axes in grid[-1]:
        axes.set_xlabel("x [m]")
    figure.colorbar(arrows, ax=grid, label="time t [s]", shrink=0.5)
    legend_below(figure, grid.flat, 1)
    return figure


def _exhibits_3b(runs: PaperRuns) -> Iterator[Exhibit]:
    rows = []
    for case in family("flight"):
        heading = "ice, half full" if case.scenario.frozen else f"M̃ = {case.value:g}"
        flown = ((solver, runs.trajectory(solver, case.key)) for solver in SOLVERS)
        rows.append(tuple((solver, heading, *_every_20_ms(run)) for solver, run in flown if run is not None))

    def angles(solver: str) -> dict[str, float]:
        return {
            heading: math.degrees(math.atan2(*(motion.base - motion.cap)[-1] * (1, -1)) % math.tau)
            for row in rows
            for by, heading, _, motion in row
            if by == solver
        }

    cells = [
        (solver, heading, *numbers)
        for row in rows
        for solver, heading, t, motion in row
        for numbers in np.column_stack((t, motion.cap, motion.base, motion.centre))
    ]
    header = ("solver", "bottle", "t [s]", "x_cap [m]", "y_cap [m]", "x_base [m]", "y_base [m]", "x_CM [m]", "y_CM [m]")
    yield exhibit(
        "3b", "the flight as vectors from cap to base",
        "An arrow every 20 ms, its tail the cap. The centre of mass (red) flies the same parabola whatever the solver; "
        "how often the bottle turns while it does so is what they differ in. The launch speed is the paper's 2 m/s, "
        f"its direction chosen. {settings_words()}",
        "Vector plots of flights, four bottles by three solvers. Angle at 0.5 s, modulo 360 degrees: "
        f"{listed(angles, digits=0)}.",
        figure_vectors, (tuple(rows),), rows_csv(header, cells),
    )  # fmt: skip


def _every_20_ms(run: Trajectory) -> tuple[FloatArray, LabMotion]:
    motion, at = lab_motion(run), np.linspace(0, len(run.t) - 1, 26).round().astype(int)
    return run.t[at], LabMotion(cap=motion.cap[at], base=motion.base[at], centre=motion.centre[at])


# ---------------------------------------------------------------------- Fig. 9a


@styled
def figure_tipping(poses: tuple[Pose, ...]) -> Figure:
    """Draw bottles that stand on the rim of their base, the centre of mass right above it."""
    figure, (row,) = new_figure(1, len(poses), size=(2.4 * len(poses), 3.3), sharey=True, squeeze=False)
    for axes, pose in zip(row, poses, strict=True):
        axes.axhline(0.0, color="#444444", linewidth=1.5)
        _draw_bottle(axes, pose, cap_of_tipping(pose))
        axes.plot([0.0, 0.0], [0.0, 0.36], color=RED, linestyle=":", linewidth=1.4)
        axes.text(0.16, 0.33, f"θ_c = {math.degrees(pose.theta):.1f}°", ha="right", va="top", fontsize=10)
        axes.set(aspect="equal", xlim=(-0.24, 0.17), ylim=(-0.03, 0.37), xlabel="x [m]")
        if pose.solver:
            head(axes, pose.solver)
        else:
            axes.set_title("water at rest", fontsize=11, fontweight="bold")
    row[0].set_ylabel("y [m]")
    legend_below(figure, row, 1)
    return figure


def _exhibits_9a(runs: PaperRuns) -> Iterator[Exhibit]:
    flown = [run for solver in SOLVERS if (run := runs.trajectory(solver, HALF_FULL)) is not None]
    poses = [at_rest(run.scenario, static_toppling_angle(run.scenario)) for run in flown[-1:]]
    for run in flown:
        moment = moment_at(run, float(run.t[-1]))
        poses.append(Pose(run.method, run.scenario, moment.toppling_angle, run.r[-1], moment.r_cm))
    rows = [(pose.solver or "at rest", pose.r_cm, math.degrees(pose.theta)) for pose in poses]
    words = ", ".join(f"{SPOKEN.get(solver, solver)} {angle:.1f}" for solver, _, angle in rows)
    yield exhibit(
        "9a", "what the critical toppling angle θ_c is",
        "The half-full bottle on the rim of its base, tilted until its centre of mass (red) stands right above the "
        "rim: tilted further, it topples. The higher the water, the smaller the angle; water where each solver has it "
        f"at T = 0.5 s. {settings_words()}",
        f"Sketches of tilted bottles. Critical toppling angle in degrees: {words}.",
        figure_tipping, (tuple(poses),), rows_csv(("water", "r_CM [m]", "theta_c [degrees]"), rows),
    )  # fmt: skip


RECIPES: Final[dict[str, Recipe]] = {
    "2b": (("beta at 5 /s",), _exhibits_2b),
    "3b": (("flight",), _exhibits_3b),
    "9a": (("filling",), _exhibits_9a),
}
