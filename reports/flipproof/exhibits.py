"""The figures of a report as it shows them: title, caption that says what to see, alternative text with the numbers.

Captions hold for every throw: they say how to read a figure. What this throw shows stands in the alternative text,
which is written from the data.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from flipproof import exhibit_tables as tables
from flipproof.chapters.guests.figures import draw_guests
from flipproof.evidence import FLIGHTS, LIMITS, Evidence
from flipproof.exhibits_attribution import draw_attribution
from flipproof.exhibits_engines import draw_instruments
from flipproof.exhibits_work_precision import draw_work_precision
from flipproof.figures import flights as flight_figures
from flipproof.figures import numerics as numeric_figures
from flipproof.frame.exhibit import Exhibit
from flipproof.studies.step_size import PHASES, StepSize
from slicemodel import Trajectory


def draw_all(evidence: Evidence) -> Iterator[Exhibit]:
    """Yield every figure with its title, a caption that says what to see, and an alternative text with its numbers.

    Nothing is drawn yet: ``flipproof.frame.exhibit.drawn`` does that, on all cores.
    """
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
    yield from draw_guests(evidence.guests)


def _draw_flights(flights: list[Trajectory]) -> Iterator[Exhibit]:
    ends = {run.label: float(run.omega[-1] / run.scenario.omega0) for run in flights}
    yield Exhibit(
        name="omega",
        section="flights",
        title="Angular velocity",
        caption="A solid scheme and the dashed equation of the same hue differ by what a finite step does. Curves of "
        "different hues solve different equations; free-flight and pymunk both solve free flight. All have "
        f"N = {flights[0].scenario.n_slices} slices.",
        alt=f"Line plot of omega over omega_0 against time, 1 at release. Values at the end: {_listed(ends, '.3f')}. "
        f"{_apart(ends, ' of omega_0', '.2g')}",
        maker=flight_figures.figure_omega,
        data=(flights,),
        table=tables.table_omega(flights),
    )
    turns = {run.label: float(np.degrees(run.theta[-1])) for run in flights}
    yield Exhibit(
        name="theta",
        section="flights",
        title="Angle",
        caption="The angle is the integral of the angular velocity above, so that a lasting difference in ω adds up. "
        "At 0° and at multiples of 360° the bottle stands upright.",
        alt=f"Line plot of the angle theta in degrees against time. Values at the end: {_listed(turns, '.0f')} degrees."
        f" {_apart(turns, ' degrees', '.1f')}",
        maker=flight_figures.figure_theta,
        data=(flights,),
        table=tables.table_theta(flights),
    )
    centres = {run.label: float(run.r_cm[-1] / run.scenario.bottle.length) for run in flights}
    yield Exhibit(
        name="centre-of-mass",
        section="flights",
        title="Centre of mass",
        caption="Distance from the cap. The nearer to the cap the centre of mass is on landing, the easier the bottle "
        "topples; in ice it stays where it is.",
        alt="Line plot of the centre of mass from the cap, as a fraction of the length, "
        f"{flights[0].r_cm[0] / flights[0].scenario.bottle.length:.3f} at release. At the end: "
        f"{_listed(centres, '.3f')}. {_apart(centres, ' of the length', '.2g')}",
        maker=flight_figures.figure_centre_of_mass,
        data=(flights,),
        table=tables.table_centre_of_mass(flights),
    )
    chosen = flight_figures.chosen_slices(flights[0])
    whole = [run for run in flights if len(run.r)]
    yield Exhibit(
        name="slices",
        section="flights",
        title="Chosen slices",
        caption="Cap at the top, base at the bottom. The first slice starts on the base, the last one on top of the "
        "water; the one in between starts nearest the centre of mass, where the push outwards is weakest.",
        alt="Line plots of position against time, cap (0) at the top and base (1) at the bottom, every solver. "
        + " ".join(f"Slice {i}, which {words}, is at the end at {_places(whole, i)}." for i, words in chosen),
        maker=flight_figures.figure_slices,
        data=(whole,),
        table=tables.table_slices(whole, [i for i, _ in chosen]),
    )


def _listed(values: dict[str, float], digits: str) -> str:
    return ", ".join(f"{name} {value:{digits}}" for name, value in values.items())


def _apart(ends: dict[str, float], unit: str, digits: str) -> str:
    """Return how far the solvers end apart, and how far each scheme from its own equation."""
    finite = {name: value for name, value in ends.items() if math.isfinite(value)}
    if len(finite) < 2:
        return ""
    low, high = min(finite, key=lambda name: finite[name]), max(finite, key=lambda name: finite[name])
    words = f"They end up to {finite[high] - finite[low]:{digits}}{unit} apart ({low} to {high})"
    pairs = [(s, m) for s, m in LIMITS.items() if s in finite and m in finite]
    if pairs:
        words += ", a scheme and its own equation up to " + (
            f"{max(abs(finite[s] - finite[m]) for s, m in pairs):{digits}}{unit}"
        )
    return words + "."


def _places(flights: Sequence[Trajectory], i: int) -> str:
    places = {run.label: float(run.r[-1, i] / run.scenario.bottle.length) for run in flights}
    return f"{_listed(places, '.2f')} of the length"


def _draw_differences(evidence: Evidence) -> Exhibit:
    words = "; ".join(f"{d.name}: at most {d.largest:.2g} of omega_0, {d.moment}" for d in evidence.differences)
    return Exhibit(
        name="differences",
        section="differences",
        title="Where the solvers part",
        caption="Each curve is the difference in ω of one pair of solvers. A marker on the dotted line is the moment "
        "at which it first exceeds 1 % of ω₀. The largest value of a curve belongs to that pair. It is no share of the "
        "difference between program and free flight: such shares stand in the waterfall.",
        alt=f"Logarithmic line plot of the differences in omega. {words}.".replace("ω₀", "omega_0"),
        maker=flight_figures.figure_differences,
        data=(evidence.differences,),
        table=tables.table_differences(evidence.differences),
    )


def _draw_step_size(evidence: Evidence) -> Exhibit:
    studies = list(evidence.flights_by_step.values())
    starts = list(evidence.starts_by_step.values())
    words = f"Over the whole flight: {'; '.join(map(_converges, studies))}."
    if starts:
        words += f" Before the first impact: {'; '.join(map(_converges, starts))}."
    return Exhibit(
        name="step-size",
        section="steps",
        title="Error against step size",
        caption="Points parallel to the dotted slope mean that halving the step halves the error. The shaded range is "
        f"that of the {PHASES} grids averaged in each point: other steps, other impact phases, because a rebound waits "
        "for the grid. A scheme that converges does so to its own equation, not to free flight.",
        alt=f"Two log-log plots of error against step. {words}",
        maker=numeric_figures.figure_step_size,
        data=(studies, starts),
        table=tables.table_step_size(studies, starts),
    )


def _converges(study: StepSize) -> str:
    if study.exact:
        return f"{study.scheme} equals {study.model} to round-off at every step"
    order = f"order {study.order:.2f}" if math.isfinite(study.order) else "no order"
    return (
        f"{study.scheme} to {study.model} {order}, error {study.mean_error[0]:.1e} of omega_0 at a step of "
        f"{study.mean_dt[0]:.1e} s down to {study.mean_error[-1]:.1e} at {study.mean_dt[-1]:.1e} s"
    )


def _draw_ice(evidence: Evidence) -> Exhibit:
    drifts = (*evidence.ice, *evidence.welded)
    words = ", ".join(f"{ice.label} {ice.largest:.2g}" for ice in drifts)
    return Exhibit(
        name="ice",
        section="ice",
        title="Ice keeps its angular velocity",
        caption="Nothing moves in a bottle of ice, so that every drift is an error of the solver; the largest value "
        "stands in the legend. Masses held by joints yield at the start, a quarter as much at half the step.",
        alt=f"Logarithmic plot of the drift of omega over omega_0 in a bottle of ice. Largest drift: {words}.",
        maker=numeric_figures.figure_ice,
        data=(drifts,),
        table=tables.table_ice(drifts),
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
        caption="The same water in more and more slices at the same damping rate. How far a curve still moves with the "
        "number of slices is an error of every number that is computed at one of them.",
        alt="Line plots of omega over omega_0 for several numbers of slices. Largest distance from the finest cut, of "
        f"omega_0: {words}.",
        maker=numeric_figures.figure_slice_count,
        data=(dict(evidence.slices),),
        table=tables.table_slice_count(evidence.slices),
    )
