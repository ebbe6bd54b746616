"""What section 5 says of the parameters of the model: rebound and slices (Fig. 5), drag (Fig. 6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from operator import attrgetter, itemgetter
from typing import Final

import numpy as np

from flipproof.frame.solvers import Missing
from flipproof.paper import observe
from flipproof.paper.claim import FLAT_WHY, SUPERIMPOSED_WHY, states
from flipproof.paper.observe import FLAT, SUPERIMPOSED, Flights
from flipproof.paper.parameters import numbers
from flipproof.paper.runs import MANY_SLICES, PUBLISHED, finest_key
from flipproof.paper.statements import OMEGA, Read, Reading, Statement, at_least, at_most
from slicemodel import Trajectory

DETECTED: Final = 0.005
"""Share of omega_0 by which a minimum must move to be seen: a two-hundredth of the axis of Fig. 5d."""


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


# ---------------------------------------------------------------------- drag

STRONG_DRAGS: Final = [drag for drag in numbers("figure-6-drag") if drag >= 0.0125]
"""The drags of Fig. 6 that count as strong [kg/s]."""

_of_drag: Final = partial(states, throw="half full, β = −0.5, α as named (Fig. 6)")


@_of_drag(
    "alpha-sensitive",
    place="section 5, Fig. 6",
    says="The outcome is highly sensitive to α.",
    means="The curves for α = 0.0075 and for 0.0125, a quarter less and more than the settled 0.01, are both "
    "farther than 0.05 ω₀ (root mean square) from it.",
    why=SUPERIMPOSED_WHY,
)
def _sensitive_to_drag(flights: Flights) -> Iterator[Reading]:
    settled = flights.at("drag", 0.01)
    off = {drag: observe.distance(flights.at("drag", drag), settled) for drag in (0.0075, 0.0125)}
    name = "distance of the curves for α = 0.0075 and 0.0125 from that for 0.01, the smaller"
    note = ", ".join(f"{value:.3f} for {drag:g}" for drag, value in off.items())
    yield Reading(name, min(off.values()), OMEGA, at_least(SUPERIMPOSED), note=note)


@_of_drag(
    "strong-drag-impedes",
    place="section 5, Fig. 6a",
    says="For α ≥ 0.0125 drag keeps water from spreading over the whole bottle.",
    means="At most half as much water as for α = 0 is ever in the cap's half of the bottle at once.",
    why="Half is a choice of ours for “impeded”.",
)
def _strong_drag_impedes(flights: Flights) -> Iterator[Reading]:
    free = observe.largest_share_near_cap(flights.at("drag", 0.0))
    for drag in STRONG_DRAGS:
        share = observe.largest_share_near_cap(flights.at("drag", drag)) / free
        name = f"most water in the cap's half at once for α = {drag:g}, by that for α = 0"
        yield Reading(name, share, "", at_most(0.5), note=f"{100 * free:.0f} % of the water for α = 0")


def _angle_grows_again_with_drag(flights: Flights) -> Iterator[Reading]:
    turned = flights.measured("drag", lambda run: math.degrees(float(run.theta[-1])))
    rising = [turned[b] - turned[a] for a, b in pairwise(sorted(turned)) if b in STRONG_DRAGS]
    note = ", ".join(f"{angle:.0f}° for {drag:g}" for drag, angle in turned.items())
    yield Reading("θ(T) for α = 0 minus that for 0.01", turned[0.0] - turned[0.01], "°", at_least(0.0), note=note)
    yield Reading("growth of θ(T) from one α to the next from 0.0125 on, the least", min(rising), "°", at_least(0.0))


def _strong_drag_turns_back(flights: Flights) -> Iterator[Reading]:
    lowest = {drag: float(observe.normalised(flights.at("drag", drag)).min()) for drag in STRONG_DRAGS}
    drag, least = min(lowest.items(), key=itemgetter(1))
    note = f"for α = {drag:g}; Eq. 12 keeps the sign of ω, so that θ can never turn back"
    yield Reading("lowest ω", least, OMEGA, at_most(0.0), note=note)


def _strong_drag_oscillates(flights: Flights) -> Iterator[Reading]:
    for drag in STRONG_DRAGS:
        name = f"largest climb over the lowest ω until then, α = {drag:g}"
        yield Reading(name, observe.climb(flights.at("drag", drag)), OMEGA, at_least(FLAT))


_oscillates: Final = _of_drag(
    "strong-drag-oscillates",
    place="section 5, Fig. 6c",
    says="For α ≥ 0.0125 ω oscillates.",
    means="ω climbs by 0.1 ω₀ or more over its lowest value until then.",
    why=FLAT_WHY,
)(_strong_drag_oscillates)

_turns_back: Final = _of_drag(
    "strong-drag-turns-back",
    place="section 5, Fig. 6b",
    says="For α ≥ 0.0125 θ varies non-monotonically.",
    means="The slope of θ(t), which is ω, falls and rises again by 0.1 ω₀ or more. θ itself cannot turn back: by "
    "Eq. 12 ω keeps its sign. This sense rests on the number of the next statement.",
    why=FLAT_WHY,
    otherwise={
        "as θ(T) over α, which falls up to 0.01 and grows from 0.0125 on": _angle_grows_again_with_drag,
        "by the letter, as θ(t) turning back": _strong_drag_turns_back,
    },
)(_strong_drag_oscillates)


@_of_drag(
    "no-drag-rises",
    place="section 5, Fig. 6",
    says="For α = 0 ω increases late.",
    means="ω over the last tenth of the flight lies at least 0.1 ω₀ over the plateau.",
    why=FLAT_WHY,
)
def _no_drag_rises_late(flights: Flights) -> Iterator[Reading]:
    rise = observe.late_rise(flights.at("drag", 0.0))
    yield Reading("late rise over the plateau for α = 0", rise, OMEGA, at_least(FLAT))


def _moderate_drag_is_flat(flights: Flights, drag: float) -> Iterator[Reading]:
    run = flights.at("drag", drag)
    yield from flat_plateau(run)
    yield Reading("time to half the drop", observe.drop_time(run), "of T", at_most(0.25))


MODERATE: Final = tuple(
    _of_drag(
        f"moderate-drag-flat-{drag:g}",
        place="section 5, Fig. 6c",
        says=f"For α from 0.0075 to 0.01 ω drops suddenly to a flat plateau: at α = {drag:g}.",
        means="Half the drop is done by T/4, the last tenth of the flight lies at most 0.1 ω₀ over the plateau, "
        "and ω never climbs by more than 0.1 ω₀ over its lowest value until then.",
        why=f"A quarter of the flight is a choice of ours for “sudden”. {FLAT_WHY}",
    )(partial(_moderate_drag_is_flat, drag=drag))
    for drag in (0.0075, 0.01)
)


OF_DRAG: Final = (_sensitive_to_drag, _strong_drag_impedes, _turns_back, _oscillates, _no_drag_rises_late, *MODERATE)
"""Statements on Fig. 6, in the order of the paper."""
