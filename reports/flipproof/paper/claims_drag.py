"""What section 5 says of drag (Fig. 6)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from operator import itemgetter
from typing import Final

from flipproof.paper import observe
from flipproof.paper.claim import FLAT_WHY, SUPERIMPOSED_WHY, states
from flipproof.paper.claims_slices import flat_plateau
from flipproof.paper.observe import FLAT, SUPERIMPOSED, Flights
from flipproof.paper.parameters import numbers
from flipproof.paper.statements import OMEGA, Reading, at_least, at_most

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
