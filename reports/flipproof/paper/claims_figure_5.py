"""What section 5 says of release, rebound and slices, up to Fig. 5, and of the cost of the model (Supp. Fig. 1)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from operator import attrgetter, itemgetter
from typing import Final

import numpy as np

from flipproof.frame.solvers import Missing
from flipproof.paper import observe
from flipproof.paper.cases import number, numbers, paper_steps, paper_throw
from flipproof.paper.cost import SQUARE, exponents_of_cost
from flipproof.paper.observe import FLAT, FLAT_WHY, SUPERIMPOSED, CaseFlights
from flipproof.paper.runs import MANY_SLICES, MANY_STEPS, MANY_STEPS_KEY, PUBLISHED, SAME_STEPS_KEY
from flipproof.paper.statements import OMEGA, Read, Reading, Statement, at_least, at_most, states
from slicemodel import Trajectory
from slicemodel.observables import release_angular_velocity

ORDER: Final = math.sqrt(10.0)
"""Factor up to which two numbers are of one order of magnitude."""

DETECTED: Final = 0.005
"""Share of omega_0 by which a minimum must move to be seen: a two-hundredth of the axis of Fig. 5d."""


@states(
    "release-spin",
    place="section 5, “Numerical model”, with section 3",
    says="ω₀ = v₀ / r_CM(0), with v₀ of about 2 m/s “as an order of magnitude”. The 20 rad/s of the runs was "
    "measured, not derived from it.",
    means="v₀ / r_CM(0) is of the order of the measured 20 rad/s.",
    throw="half full, water at rest",
    why="Of one order of magnitude: within a factor of √10.",
    of_geometry=True,
    otherwise={"as an equation, to a quarter": {"factor": 1.25}},
)
def _release_spin(_: CaseFlights, factor: float = ORDER) -> Iterator[Reading]:
    spin = release_angular_velocity(paper_throw(), number("launch-speed"))
    usual = number("release-spin")
    note = "the formula holds for a bottle swung about its cap"
    name = "v₀ / r_CM(0) for v₀ = 2 m/s and M̃ = 0.5"
    yield Reading(name, spin, "rad/s", (usual / factor, factor * usual), note=note)


@states(
    "spin-scale",
    place="section 5, below Eq. 9d",
    says="Eq. 8 sets the scale ω ~ √(g/ℓ) ~ 10 rad/s, ℓ being of the order of L/2.",
    means="√(g/ℓ) with ℓ = L/2 is of the order of 10 rad/s.",
    throw="the paper's bottle; no throw enters",
    why="Of one order of magnitude: within a factor of √10.",
    of_geometry=True,
)
def _spin_scale(_: CaseFlights) -> Iterator[Reading]:
    gravity, length = paper_throw().gravity, paper_throw().bottle.length / 2
    note = (
        f"ℓ = {length:g} m; {math.sqrt(gravity / 0.1):.1f} rad/s for the paper's rounded 0.1 m. In free "
        "flight gravity cancels and no such scale exists"
    )
    admissible = (10.0 / ORDER, 10.0 * ORDER)
    yield Reading("√(g/ℓ) for ℓ = L/2", math.sqrt(gravity / length), "rad/s", admissible, note=note)


# ---------------------------------------------------------------------- rebound and slices (Fig. 5)


def _figure_5(id_: str, says: str, means: str, why: str, place: str = "Fig. 5") -> Callable[[Read], Statement]:
    """Return a decorator for Fig. 5: at the drag of its caption, and at the damping rate of all later figures."""
    return states(
        id_,
        place=f"section 5, {place}",
        says=says,
        means=means,
        throw="half full, α = 1 kg/s at N = 10 (the caption's), damping rate kept at other N",
        why=why,
        otherwise={"with α/2m = 5 /s instead of the caption's α = 1": {"damping": " at 5 /s"}},
    )


@_figure_5(
    "beta-0-sticks",
    "For β = 0 slices stay at the ends until their weight exceeds the centrifugal force.",
    "Wherever a slice begins to leave an end (by more than 1 mm), ω²(r − r_CM) + g cos θ points away from it.",
    "The sentence is an inequality: its threshold is zero.",
    "Fig. 5a",
)
def _sticking_slices(flights: CaseFlights, damping: str = "") -> Iterator[Reading]:
    left = observe.departures(flights.at("beta" + damping, 0.0))
    value, band, note = 0.0, 0.0, "no slice leaves an end"
    if left:
        worst = max(left, key=attrgetter("outward"))
        value, band = worst.outward, worst.step
        against = sum(departure.outward > departure.step for departure in left)
        note = f"{against} of {len(left)} departures against both; this one at t = {worst.time:.3f} s"
    name = "largest outward acceleration, centrifugal and weight, of a slice that leaves its end"
    yield Reading(name, value, "m/s²", at_most(0.0), band, note)


@_figure_5(
    "beta-1-rises",
    "For β = −1 θ rises faster late in the flight.",
    "Mean ω over the last tenth of the flight is larger for β = −1 than for β = 0 and β = −0.5.",
    "The sentence is a comparison: its threshold is zero.",
    "Fig. 5b",
)
def _elastic_rises_late(flights: CaseFlights, damping: str = "") -> Iterator[Reading]:
    elastic, sticky, half = (observe.late_mean(flights.at("beta" + damping, beta)) for beta in (-1.0, 0.0, -0.5))
    note = f"{elastic:.3f} against {sticky:.3f} for β = 0 and {half:.3f} for β = −0.5"
    more = elastic - max(sticky, half)
    yield Reading("late ω for β = −1 minus the larger of the others", more, OMEGA, at_least(0.0), note=note)


@_figure_5(
    "beta-angle-alike",
    "θ(t) for β = 0 and for β = −0.5 differ little.",
    "θ is nowhere farther apart than 0.05 of the angle that the bottle of β = −0.5 turns.",
    "The share is that of ω for “superimposed”, a word of ours: 0.05 of what the axis shows.",
    "Fig. 5b",
)
def _angle_hardly_depends_on_rebound(flights: CaseFlights, damping: str = "") -> Iterator[Reading]:
    sticky, half = (flights.at("beta" + damping, beta) for beta in (0.0, -0.5))
    apart = np.abs(half.theta - np.interp(half.t, sticky.t, sticky.theta))
    max_apart, time = float(apart.max()), half.t[int(apart.argmax())]
    turned = abs(float(half.theta[-1] - half.theta[0]))
    name, unit = "largest difference of θ for β = 0 and β = −0.5", "of the angle turned"
    note = f"{math.degrees(max_apart):.1f}° of {math.degrees(turned):.0f}°, at t = {time:.3f} s"
    yield Reading(name, max_apart / turned, unit, at_most(SUPERIMPOSED), note=note)


def flat_plateau(run: Trajectory) -> Iterator[Reading]:
    """Yield whether omega does not rise late over its plateau, and never climbs again once it is low."""
    yield Reading("late rise over the plateau", observe.late_rise(run), OMEGA, at_most(FLAT))
    yield Reading("largest climb over the lowest ω until then", observe.climb(run), OMEGA, at_most(FLAT))


@_figure_5(
    "beta-half-flat",
    "For β = −0.5 ω remains low and constant, without a late increase.",
    "The plateau is at most 0.5 ω₀, the last tenth of the flight lies at most 0.1 ω₀ over it, and ω never climbs "
    "by more than 0.1 ω₀ over its lowest value until then.",
    f"0.5 is the upper end of the paper's own range in Fig. 7b. {FLAT_WHY}",
    "Fig. 5c",
)
def _half_elastic_is_flat(flights: CaseFlights, damping: str = "") -> Iterator[Reading]:
    run = flights.at("beta" + damping, -0.5)
    yield Reading("plateau ω_f", observe.level(run), OMEGA, at_most(0.5))
    yield from flat_plateau(run)


@_figure_5(
    "beta-others-rise",
    "Only β = −0.5 does so: for β = 0 and β = −1 ω increases late.",
    "For both, ω over the last tenth of the flight lies at least 0.1 ω₀ over the plateau.",
    FLAT_WHY,
    "Fig. 5c",
)
def _other_rebounds_rise_late(flights: CaseFlights, damping: str = "") -> Iterator[Reading]:
    for beta, name in ((0.0, "late rise for β = 0"), (-1.0, "late rise for β = −1")):
        yield Reading(name, observe.late_rise(flights.at("beta" + damping, beta)), OMEGA, at_least(FLAT))


@_figure_5(
    "few-slices",
    "Only N = 2 and N = 5 differ significantly.",
    "Both are farther (root mean square of ω) from the finest cut than any N from 10 on.",
    "The sentence is a comparison: its threshold is zero.",
    "Fig. 5d",
)
def _few_slices(flights: CaseFlights, damping: str = "") -> Iterator[Reading]:
    finest = _finest(flights, damping)
    n_finest = finest.scenario.n_slices
    distances = flights.measured("slices" + damping, lambda run: observe.distance(run, finest), high=n_finest - 1)
    min_distance = min(distances[2.0], distances[5.0])
    far = max(value for count, value in distances.items() if count not in (2.0, 5.0))
    name = f"distance from {n_finest} slices: the smaller of N = 2 and 5 minus the largest from N = 10 on"
    note = ", ".join(f"N = {count:g}: {value:.3f}" for count, value in distances.items())
    yield Reading(name, min_distance - far, OMEGA, at_least(0.0), distances[max(distances)], note)


@_figure_5(
    "minimum-shifts",
    "The minimum of ω still moves for N < 100.",
    "Against the finest cut, lowest ω is off by 0.005 ω₀ or more at an N from 10 to 50, by less at N = 100.",
    "0.005 ω₀ is a two-hundredth of the axis of Fig. 5d: less cannot be seen there.",
    "Fig. 5d",
)
def _minimum_shifts(flights: CaseFlights, damping: str = "") -> Iterator[Reading]:
    finest = float(observe.normalised(_finest(flights, damping)).min())
    shift = flights.measured(
        "slices" + damping, lambda run: abs(float(observe.normalised(run).min()) - finest), 10.0, MANY_SLICES
    )
    if MANY_SLICES not in shift:
        raise Missing(f"{flights.solver} has not flown {MANY_SLICES:g} slices")
    last = shift.pop(MANY_SLICES)
    count, max_shift = max(shift.items(), key=itemgetter(1))
    # What the finest cut is still off by is at most what the one before it is off from it.
    name = "largest shift of the minimum, N = 10 to 99"
    yield Reading(name, max_shift, OMEGA, at_least(DETECTED), last, f"at N = {count:g}")
    yield Reading("shift of the minimum, N = 100", last, OMEGA, at_most(DETECTED), last)


def _finest(flights: CaseFlights, damping: str) -> Trajectory:
    """Return the flight with the most slices, the paper's 500."""
    return flights.at("slices" + damping, max(numbers("figure-5d-slices")))


# ---------------------------------------------------------------------- cost (Supp. Fig. 1)

SQUARE_WHY: Final = "An exponent of a square is 2; a tenth of it is allowed either way."


def _of_programs(id_: str, place: str, says: str, means: str, why: str) -> Callable[[Read], Statement]:
    """Return a decorator for the cost of the programs: first MATLAB, which times itself (tic, toc), then Python."""
    return states(
        id_,
        place=f"section 5, {place}",
        says=says,
        means=means,
        throw="any; the count does not depend on it. The MATLAB program is counted: it is the one that times itself",
        why=why,
        judges=(PUBLISHED,),
        silent="it chooses its own time steps and slices cost it otherwise; the sentence is about the programs",
        otherwise={"in the Python program, which copies no history": {"program": "Python"}},
    )


@_of_programs(
    "cost-slices",
    "Supp. Fig. 1b",
    "Computing time grows roughly as N², N being the number of slices.",
    "The exponent of N in the counted work is 1.8 to 2.2.",
    SQUARE_WHY,
)
def _cost_of_slices(_: CaseFlights, program: str = "MATLAB") -> Iterator[Reading]:
    yield Reading("exponent of N in the work", _exponents(program)[0], "", SQUARE, note=_counted(program))


@_of_programs(
    "cost-intervals",
    "Supp. Fig. 1c",
    "Computing time grows roughly as N², N being N_t, the number of time intervals of section 5 (the P that the "
    "sentence before calls most critical).",
    "The exponent of P in the counted work is 1.8 to 2.2.",
    SQUARE_WHY,
)
def _cost_of_intervals(_: CaseFlights, program: str = "MATLAB") -> Iterator[Reading]:
    yield Reading("exponent of P in the work", _exponents(program)[1], "", SQUARE, note=_counted(program))


def _exponents(program: str) -> tuple[float, float]:
    return exponents_of_cost(copies_history=program == "MATLAB")


def _counted(program: str) -> str:
    return f"array elements that the {program} program touches, 250 to 1000 of each; no clock"


@_of_programs(
    "cost-steps",
    "Supp. Fig. 1b, 1c",
    "Of N and P, P is what limits computing time.",
    "The exponent of P in the counted work exceeds that of N by 0.1 at least.",
    "The sentence is a comparison; 0.1 is what counting from 250 to 1000 leaves open.",
)
def _cost_of_steps(_: CaseFlights, program: str = "MATLAB") -> Iterator[Reading]:
    of_n, of_p = _exponents(program)
    note = f"{of_p:.2f} and {of_n:.2f} in the {program} program"
    yield Reading("exponent of P minus exponent of N in the work", of_p - of_n, "", at_least(0.1), note=note)


@states(
    "steps-enough",
    place="section 5, Supp. Fig. 1a",
    says="All calculations take P = 1000 time steps.",
    means="More steps change ω by at most 0.01 ω₀ (root mean square). For Eq. 8 the exact step at P = 1000 is held "
    "against the solution event by event.",
    throw="M̃ = 0.25, 0.5 and 0.75, α = 0.01 kg/s, β = −0.5",
    why="0.01 ω₀ is a hundredth of the axis: a fifth of “superimposed”.",
    of_steps=True,
    judges=(PUBLISHED, "eq8"),
    silent="it is only solved event by event, with time steps of its own choice",
)
def _steps_are_enough(flights: CaseFlights) -> Iterator[Reading]:
    distances, against, fewer = {}, "the event-driven solution", ""
    for filling in numbers("figure-S1-filling"):
        flight = flights.at("filling", filling)
        if flights.solver == PUBLISHED:
            distances[filling] = observe.distance(flight, flights.run(MANY_STEPS_KEY.format(filling)))
        else:
            distances[filling] = observe.distance(flights.run(SAME_STEPS_KEY.format(filling)), flight)
    if flights.solver == PUBLISHED:
        against, fewer = f"P = {MANY_STEPS}", _fewer_steps(flights)
    worst, max_distance = max(distances.items(), key=itemgetter(1))
    other_fillings = ", ".join(f"{distances[filling]:.2g} at {filling:g}" for filling in distances if filling != worst)
    note = f"largest at M̃ = {worst:g}; {other_fillings}{fewer}"
    yield Reading(f"distance of P = {paper_steps()} from {against}", max_distance, OMEGA, at_most(0.01), note=note)


def _fewer_steps(flights: CaseFlights) -> str:
    """Return what a tenth of the steps does, and to the paper's plateau: its points then span a fifth of the flight."""
    fewer = flights.at("steps 0.5", 100)
    apart = observe.distance(fewer, flights.at("filling", 0.5))
    points, time = observe.level_by_points(fewer), observe.level(fewer)
    return (
        f"; P = 100 is {apart:.2g} off at 0.5, and there the average over points is {points:.3f}, "
        f"the mean over time {time:.3f}"
    )
