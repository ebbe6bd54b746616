"""The figures of a report as it shows them: title, caption that says what to see, alternative text with the numbers.

Captions hold for every throw: they say how to read a figure. What this throw shows stands in the alternative text,
which is written from the data.
"""

from __future__ import annotations

from collections.abc import Iterator

from reports.evidence import FLIGHTS, Evidence
from reports.exhibit import Exhibit
from reports.exhibits_attribution import draw_attribution
from reports.exhibits_engines import draw_instruments
from reports.exhibits_work_precision import draw_work_precision
from reports.figures import flights as flight_figures
from reports.figures import numerics as numeric_figures
from reports.figures.style import draw
from reports.studies.step_size import PHASES
from slicemodel import Trajectory


def draw_all(evidence: Evidence) -> Iterator[Exhibit]:
    """Yield every figure with its title, a caption that says what to see, and an alternative text with its numbers."""
    flights = [run for tag in FLIGHTS if (run := evidence.trajectory(tag)) is not None]
    if flights:
        yield from _draw_flights(flights)
    if evidence.differences:
        yield _draw_differences(evidence)
    if evidence.flights_by_step:
        yield _draw_step_size(evidence)
    if evidence.ice or evidence.welded:
        yield _draw_ice(evidence)
    if evidence.slices:
        yield _draw_slices(evidence)
    yield from draw_instruments(evidence.instruments)
    yield from draw_work_precision(evidence.precision)
    yield from draw_attribution(evidence.attribution)


def _draw_flights(flights: list[Trajectory]) -> Iterator[Exhibit]:
    ends = ", ".join(f"{run.label} {run.omega[-1] / run.scenario.omega0:.3f}" for run in flights)
    yield Exhibit(
        name="omega",
        section="flights",
        title="Angular velocity",
        caption="Compare each solid scheme with the dashed equation of the same hue: between them lies the step size. "
        "What lies between the hues comes from the equations; free-flight and pymunk are free flight.",
        alt=f"Line plot of omega over omega_0 against time. Values at the end: {ends}.",
        drawing=draw(flight_figures.figure_omega(flights)),
    )
    turns = ", ".join(f"{run.label} {run.theta[-1]:.2f} rad" for run in flights)
    yield Exhibit(
        name="theta",
        section="flights",
        title="Angle",
        caption="The angle is the integral of the curve above: a difference in ω that lasts decides how far the bottle "
        "has turned on landing. Multiples of 360° stand upright.",
        alt=f"Line plot of the angle theta in degrees against time. Values at the end: {turns}.",
        drawing=draw(flight_figures.figure_theta(flights)),
    )
    centres = ", ".join(f"{run.label} {run.r_cm[-1] / run.scenario.bottle.length:.3f}" for run in flights)
    yield Exhibit(
        name="centre-of-mass",
        section="flights",
        title="Centre of mass",
        caption="Distance from the cap. The nearer to the cap the centre of mass is on landing, the easier the bottle "
        "topples; in ice it stays where it is.",
        alt=f"Line plot of the centre of mass from the cap, as a fraction of the length. At the end: {centres}.",
        drawing=draw(flight_figures.figure_centre_of_mass(flights)),
    )
    yield Exhibit(
        name="slices",
        section="flights",
        title="Chosen slices",
        caption="Cap at the top, base at the bottom. The first slice starts on the base, the last one on top of the "
        "water; the one in between starts nearest the centre of mass, where the push outwards is weakest.",
        alt="Line plots of position against time, cap at the top, every solver. Slices: "
        + ", ".join(f"number {i}, {words}" for i, words in flight_figures.chosen_slices(flights[0]))
        + ".",
        drawing=draw(flight_figures.figure_slices([run for run in flights if len(run.r)])),
    )


def _draw_differences(evidence: Evidence) -> Exhibit:
    words = "; ".join(f"{d.name}: at most {d.largest:.2g} of omega_0, {d.moment}" for d in evidence.differences)
    return Exhibit(
        name="differences",
        section="differences",
        title="Where the solvers part",
        caption="Each curve is one assumption. A marker on the dotted line is the moment at which that assumption has "
        "first cost 1 % of ω₀. An assumption whose curve stays below the line costs this throw less than that.",
        alt=f"Logarithmic line plot of the differences in omega. {words}.".replace("ω₀", "omega_0"),
        drawing=draw(flight_figures.figure_differences(evidence.differences)),
    )


def _draw_step_size(evidence: Evidence) -> Exhibit:
    studies = list(evidence.flights_by_step.values())
    starts = list(evidence.starts_by_step.values())
    words = "; ".join(f"{s.scheme} to {s.model} order {s.order:.2f}" for s in studies)
    return Exhibit(
        name="step-size",
        section="steps",
        title="Error against step size",
        caption="Points parallel to the dotted slope mean that halving the step halves the error. The shaded range is "
        f"that of the {PHASES} grids averaged in each point: other steps, other impact phases, because a rebound waits "
        "for the grid. A scheme that converges does so to its own equation, not to free flight.",
        alt=f"Two log-log plots of error against step. Over the whole flight: {words}.",
        drawing=draw(numeric_figures.figure_step_size(studies, starts)),
    )


def _draw_ice(evidence: Evidence) -> Exhibit:
    drifts = (*evidence.ice, *evidence.welded)
    words = ", ".join(f"{ice.label} {ice.largest:.2g}" for ice in drifts)
    return Exhibit(
        name="ice",
        section="ice",
        title="Ice keeps its angular velocity",
        caption="Nothing moves inside a bottle of ice, so every drift is the solver's own: its largest value stands in "
        "the legend. Masses welded on by joints give in a little at the start, a quarter as much at half the step.",
        alt=f"Logarithmic plot of the drift of omega. Largest drift: {words}.",
        drawing=draw(numeric_figures.figure_ice(drifts)),
    )


def _draw_slices(evidence: Evidence) -> Exhibit:
    words = "; ".join(
        f"{scheme}: " + ", ".join(f"N = {n} {d:.2g}" for n, d in zip(s.counts, s.distance, strict=True))
        for scheme, s in evidence.slices.items()
    )
    return Exhibit(
        name="slice-count",
        section="slices",
        title="What more slices would change",
        caption="The same water cut finer and finer at the same damping rate: read off from which number of slices on "
        "the curve no longer moves by more than the differences above.",
        alt=f"Line plots of omega for several numbers of slices. Distance from the finest cut: {words}.",
        drawing=draw(numeric_figures.figure_slice_count(evidence.slices)),
    )
