"""The flights: every solver on the throw, the flights that are drawn, and the moving bottles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from engine_check.engines import ENGINES
from flipproof.chapters.solvers import FLIGHTS, LIMITS, OTHER_SOLVERS, SCHEMES, Guest
from flipproof.figures.style import new_figure, shared_legend, shown_name, solver_style, styled
from flipproof.frame.chapter import Ask, Chapter, Exhibit, RunResult, Study, Touch
from flipproof.frame.columns import curves_csv, json_ready
from flipproof.frame.solvers import find
from flipproof.output.motion import motion_data
from flipproof.output.tables import trajectory_csv
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray

AXES = {
    "omega": "angular velocity ω / ω₀ [1]",
    "theta": "angle θ [degrees]",
    "centre-of-mass": "centre of mass r_CM / L [1], cap = 0",
}


class Flown(NamedTuple):
    """What became of every solver on the throw, by its name."""

    throw: Scenario
    results: Mapping[str, RunResult]
    guests: Mapping[str, Guest] = MappingProxyType({})

    @property
    def shown(self) -> tuple[str, ...]:
        """The solvers whose flights are drawn."""
        return (*FLIGHTS, *self.guests)

    @property
    def drawn(self) -> list[Trajectory]:
        """The flights that are drawn."""
        return [run for name in self.shown if (run := self.results[name].trajectory) is not None]

    @property
    def tables(self) -> dict[str, str]:
        """The file of the trajectory of every solver that flew, by its name."""
        names = {name: f"guest-{guest.slug}" for name, guest in self.guests.items()}
        flown = [name for name, result in self.results.items() if result.trajectory is not None]
        return {name: f"trajectories/{names.get(name, name)}/data.csv" for name in flown}

    @property
    def rows(self) -> list[dict[str, Any]]:
        """What a report says of every solver: status, end, plateau, impacts, diagnostics."""
        return [solver_row(name, result) for name, result in self.results.items()]

    @property
    def motion(self) -> dict[str, Any] | None:
        """What the moving bottles are drawn from."""
        return motion_data(self.throw, self.results)


def study(ask: Ask) -> Study[Flown]:
    """Fly the throw with every solver that can."""
    flights = yield ask.solvers.values()
    names = [name for name in (*FLIGHTS, *OTHER_SOLVERS, *ask.guests) if name in ask.solvers]
    return Flown(ask.throw, {name: flights[ask.solvers[name]] for name in names}, ask.guests)


def solver_row(name: str, result: RunResult) -> dict[str, Any]:
    """Return what a report says of one solver."""
    solver, run = find(result.run.solver), result.trajectory
    row: dict[str, Any] = {"name": name, "package": solver.package, "equation": solver.equation}
    row |= {"reason": solver.reason, "seconds": result.seconds}
    if run is None:
        return row | {"status": "failed", "message": result.reason}
    if solver.package == "engine_check":
        row |= {"reason": ENGINES[result.run.solver].words}
    landed = run.t[-1] >= run.scenario.duration * (1 - 1e-12)
    return row | {
        "status": run.status,
        "message": run.message,
        "final": float(run.omega[-1] / run.scenario.omega0) if landed else None,
        "plateau": result.plateau if run.ok else None,
        "impacts": None if run.impacts is None else len(run.impacts),
        "diagnostics": json_ready(run.diagnostics),
    }


def figures(results: Flown) -> Iterator[Exhibit]:
    """Yield omega, theta, the centre of mass and a few slices over time."""
    flights = results.drawn
    if not flights:
        return
    length = results.throw.bottle.length
    yield _over_time(
        flights,
        "omega",
        "Angular velocity",
        caption="Two pairs are a scheme and the equation that it solves, and differ by the effect of a finite time "
        "step: the published program and its limit Δt → 0, and the exact step and Eq. 8. pymunk computes free flight "
        "by its own mechanics. Any other two curves solve different equations, unless what tells them apart, such as "
        "drag, is missing in this throw. All have "
        f"N = {flights[0].scenario.n_slices}.",
        alt="Line plot of omega over omega_0 against time, 1 at release. Values at the end: {}.",
        column="omega/omega_0 {} [1]",
        unit=" of omega_0",
        label="angular velocity ω / ω₀ [1]",
    )
    yield _over_time(
        flights,
        "theta",
        "Angle",
        caption="The angle is the integral of the angular velocity above, so that a lasting difference in ω adds up. "
        "At 0° and at multiples of 360° the bottle stands upright.",
        alt="Line plot of the angle theta in degrees against time. Values at the end: {} degrees.",
        column="theta {} [degrees]",
        unit=" degrees",
        label="angle θ [°]",
    )
    yield _over_time(
        flights,
        "centre-of-mass",
        "Centre of mass",
        caption="Distance of the centre of mass from the cap. The smaller it is at a landing, the more easily the "
        "bottle topples; in a bottle of ice it is constant.",
        alt="Line plot of the centre of mass from the cap, as a fraction of the length, "
        f"{flights[0].r_cm[0] / length:.3f} at release. At the end: {{}}.",
        column="r_CM/L {} [1]",
        unit=" of the length",
        label="centre of mass from the cap, r_CM / L [1]",
    )
    chosen = chosen_slices(flights[0])
    whole = [run for run in flights if len(run.r)]
    ends_of = {i: {run.label: float(run.r[-1, i] / length) for run in whole} for i, _ in chosen}
    yield Exhibit(
        name="slices",
        title="Chosen slices",
        caption="Cap at the top, base at the bottom. "
        + "; ".join(f"slice {i} {words}" for i, words in chosen).capitalize()
        + ". Near the centre of mass the push outwards is weakest.",
        alt="Line plots of position against time, cap (0) at the top and base (1) at the bottom, every solver. "
        + " ".join(
            f"Slice {i}, which {words}, is at the end at {_listed(ends_of[i], '.2f')} of the length."
            for i, words in chosen
        ),
        maker=figure_slices,
        data=(whole,),
        table=curves_csv(
            {f"r/L of slice {i} {run.label} [1]": (run.t, run.r[:, i] / length) for i, _ in chosen for run in whole}
        ),
    )


def _over_time(
    flights: Sequence[Trajectory], name: str, title: str, *, caption: str, alt: str, column: str, unit: str, label: str
) -> Exhibit:
    """Return the figure of one quantity; ``unit`` is that of its differences, in words."""
    field = "r_cm" if name == "centre-of-mass" else name
    flights = [run for run in flights if field not in run.diagnostics.get("not_given", ())]
    curves = {run.label: (run.t, values_of(run, name)) for run in flights}
    ends = {label: float(values[-1]) for label, (_, values) in curves.items()}
    angle = name == "theta"
    return Exhibit(
        name=name,
        title=title,
        caption=caption,
        alt=f"{alt.format(_listed(ends, '.0f' if angle else '.3f'))} {_apart(ends, unit, '.1f' if angle else '.2g')}",
        maker=figure_over_time,
        data=(list(flights), name),
        table=curves_csv({column.format(run): curve for run, curve in curves.items()}),
        touch=Touch(label=label, curves=curves, digits=1 if angle else 3),
    )


def _listed(values: Mapping[str, float], digits: str) -> str:
    return ", ".join(f"{name} {value:{digits}}" for name, value in values.items())


def _apart(ends: Mapping[str, float], unit: str, digits: str) -> str:
    """Return how far the solvers end apart, and how far each scheme from its own equation."""
    finite = {name: value for name, value in ends.items() if math.isfinite(value)}
    if len(finite) < 2:
        return ""
    low, high = min(finite, key=finite.__getitem__), max(finite, key=finite.__getitem__)
    words = f"They end up to {finite[high] - finite[low]:{digits}}{unit} apart ({low} to {high})"
    pairs = [abs(finite[s] - finite[LIMITS[s]]) for s in SCHEMES if s in finite and LIMITS[s] in finite]
    return words + (f", a scheme and its own equation up to {max(pairs):{digits}}{unit}." if pairs else ".")


def values_of(run: Trajectory, quantity: str) -> FloatArray:
    """Return a quantity of ``AXES`` over time, in the unit of its axis."""
    if quantity == "omega":
        return run.omega / run.scenario.omega0
    return np.degrees(run.theta) if quantity == "theta" else run.r_cm / run.scenario.bottle.length


@styled
def figure_over_time(trajectories: Iterable[Trajectory], quantity: str) -> Figure:
    """One quantity of ``AXES`` over time."""
    figure, axes = new_figure()
    for k, run in enumerate(trajectories):
        axes.plot(run.t, values_of(run, quantity), label=shown_name(run), **solver_style(run.label, k))
    axes.set(xlabel="time t [s]", ylabel=AXES[quantity])
    axes.margins(x=0.01)
    shared_legend(figure, axes)
    if quantity == "omega":
        axes.set_ylim(bottom=0.0)
    return figure


def chosen_slices(trajectory: Trajectory) -> list[tuple[int, str]]:
    """Return the slices worth drawing: first, nearest the centre of mass at release, last; fewer if they coincide."""
    nearest = int(np.abs(trajectory.r[0] - trajectory.r_cm[0]).argmin())
    words = {trajectory.scenario.n_slices - 1: "starts on top of the water", 0: "starts on the base"}
    words.setdefault(nearest, "starts nearest the centre of mass")
    return sorted(words.items())


@styled
def figure_slices(trajectories: Sequence[Trajectory]) -> Figure:
    """Paths of a few slices, one panel each."""
    chosen = chosen_slices(trajectories[0])
    size = (8.0, 1.2 + 2.0 * len(chosen))
    figure, grid = new_figure(len(chosen), size=size, sharex=True, sharey=True, squeeze=False)
    panels = grid[:, 0]
    for axes, (i, words) in zip(panels, chosen, strict=True):
        for k, run in enumerate(trajectories):
            length = run.scenario.bottle.length
            axes.plot(run.t, run.r[:, i] / length, label=shown_name(run), **solver_style(run.label, k))
        axes.set_title(f"slice {i}: {words}", fontsize=10, loc="left")
        axes.set(ylabel="r / L [1]", ylim=(1.03, -0.03))
        axes.margins(x=0.01)
    panels[-1].set_xlabel("time t [s]")
    shared_legend(figure, panels[0])
    return figure


CHAPTER: Final = Chapter(
    name="flights",
    title="The flights",
    study=study,
    figures=figures,
    page=lambda results: {"rows": results.rows, "drawn": results.shown, "tables": results.tables},
    summary=lambda results: {"solvers": results.rows},
    tables=lambda flown: {file: trajectory_csv(flown.results[name].flight) for name, file in flown.tables.items()},
)
