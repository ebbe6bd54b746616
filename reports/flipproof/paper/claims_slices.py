"""What section 5 says of rebound and slices (Fig. 5)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from operator import attrgetter, itemgetter
from typing import Final

import numpy as np

from flipproof.frame.solvers import Missing
from flipproof.paper import observe
from flipproof.paper.claim import FLAT_WHY, states
from flipproof.paper.observe import FLAT, SUPERIMPOSED, Flights
from flipproof.paper.parameters import numbers
from flipproof.paper.runs import PUBLISHED
from flipproof.paper.statements import OMEGA, Read, Reading, Statement, at_least, at_most
from slicemodel import Trajectory

DETECTED: Final = 0.005
"""Share of omega_0 by which a minimum must move to be seen: a two-hundredth of the axis of Fig. 5d."""

MANY_SLICES: Final = 100.0
FINEST: Final = 200
"""Slices of an event-driven flight that the others are held against."""


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


def finest_key(damping: str) -> str:
    """Return the key of the flight with the most slices.

    ``damping`` is "" for the drag of the caption of Fig. 5, " at 5 /s" for the damping of all later figures.
    """
    return f"slices finest{damping}"


# ---------------------------------------------------------------------- rebound


@_figure_5(
    "beta-0-sticks",
    "For β = 0 slices stay at the ends until their weight exceeds the centrifugal force.",
    "Wherever a slice begins to leave an end (by more than 1 mm), ω²(r − r_CM) + g cos θ points away from it.",
    "The sentence is an inequality: its threshold is zero.",
    "Fig. 5a",
)
def _sticking_slices(flights: Flights, damping: str = "") -> Iterator[Reading]:
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
def _elastic_rises_late(flights: Flights, damping: str = "") -> Iterator[Reading]:
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
def _angle_hardly_depends_on_rebound(flights: Flights, damping: str = "") -> Iterator[Reading]:
    sticky, half = (flights.at("beta" + damping, beta) for beta in (0.0, -0.5))
    apart = np.abs(half.theta - np.interp(half.t, sticky.t, sticky.theta))
    most, time = float(apart.max()), half.t[int(apart.argmax())]
    turned = abs(float(half.theta[-1] - half.theta[0]))
    name, unit = "largest difference of θ for β = 0 and β = −0.5", "of the angle turned"
    note = f"{math.degrees(most):.1f}° of {math.degrees(turned):.0f}°, at t = {time:.3f} s"
    yield Reading(name, most / turned, unit, at_most(SUPERIMPOSED), note=note)


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
def _half_elastic_is_flat(flights: Flights, damping: str = "") -> Iterator[Reading]:
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
def _other_rebounds_rise_late(flights: Flights, damping: str = "") -> Iterator[Reading]:
    for beta, name in ((0.0, "late rise for β = 0"), (-1.0, "late rise for β = −1")):
        yield Reading(name, observe.late_rise(flights.at("beta" + damping, beta)), OMEGA, at_least(FLAT))


# ---------------------------------------------------------------------- slices


@_figure_5(
    "few-slices",
    "Only N = 2 and N = 5 differ significantly.",
    "Both are farther (root mean square of ω) from the finest cut than any N from 10 on.",
    "The sentence is a comparison: its threshold is zero.",
    "Fig. 5d",
)
def _few_slices(flights: Flights, damping: str = "") -> Iterator[Reading]:
    finest = _finest(flights, damping)
    most = finest.scenario.n_slices
    off = flights.measured("slices" + damping, lambda run: observe.distance(run, finest), high=most - 1)
    least = min(off[2.0], off[5.0])
    far = max(value for count, value in off.items() if count not in (2.0, 5.0))
    name = f"distance from {most} slices: the smaller of N = 2 and 5 minus the largest from N = 10 on"
    note = ", ".join(f"N = {count:g}: {value:.3f}" for count, value in off.items())
    yield Reading(name, least - far, OMEGA, at_least(0.0), off[max(off)], note)


@_figure_5(
    "minimum-shifts",
    "The minimum of ω still moves for N < 100.",
    "Against the finest cut, lowest ω is off by 0.005 ω₀ or more at an N from 10 to 50, by less at N = 100.",
    "0.005 ω₀ is a two-hundredth of the axis of Fig. 5d: less cannot be seen there.",
    "Fig. 5d",
)
def _minimum_shifts(flights: Flights, damping: str = "") -> Iterator[Reading]:
    finest = float(observe.normalised(_finest(flights, damping)).min())
    shift = flights.measured(
        "slices" + damping, lambda run: abs(float(observe.normalised(run).min()) - finest), 10.0, MANY_SLICES
    )
    if MANY_SLICES not in shift:
        raise Missing(f"{flights.solver} has not flown {MANY_SLICES:g} slices")
    last = shift.pop(MANY_SLICES)
    count, most = max(shift.items(), key=itemgetter(1))
    # What the finest cut is still off by is at most what the one before it is off from it.
    name = "largest shift of the minimum, N = 10 to 99"
    yield Reading(name, most, OMEGA, at_least(DETECTED), last, f"at N = {count:g}")
    yield Reading("shift of the minimum, N = 100", last, OMEGA, at_most(DETECTED), last)


def _finest(flights: Flights, damping: str) -> Trajectory:
    """Return the flight with the most slices: the paper's 500, fewer where the equation is solved through events."""
    if flights.solver == PUBLISHED:
        return flights.at("slices" + damping, max(numbers("figure-5d-slices")))
    return flights.run(finest_key(damping))


OF_SLICES: Final = (
    _sticking_slices,
    _elastic_rises_late,
    _angle_hardly_depends_on_rebound,
    _half_elastic_is_flat,
    _other_rebounds_rise_late,
    _few_slices,
    _minimum_shifts,
)
"""Statements on Fig. 5, in the order of the paper."""
