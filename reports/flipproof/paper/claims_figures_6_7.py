"""What section 5 says of drag (Fig. 6) and filling (Fig. 7)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from operator import itemgetter
from typing import Final

from flipproof.paper import observe
from flipproof.paper.cases import numbers
from flipproof.paper.claims_figure_5 import flat_plateau
from flipproof.paper.observe import FLAT, FLAT_WHY, SUPERIMPOSED, SUPERIMPOSED_WHY, CaseFlights, level, level_by_points
from flipproof.paper.statements import OMEGA, Read, Reading, Statement, at_least, at_most, states

# ---------------------------------------------------------------------- drag (Fig. 6)

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
def _sensitive_to_drag(flights: CaseFlights) -> Iterator[Reading]:
    settled = flights.at("drag", 0.01)
    distances = {drag: observe.distance(flights.at("drag", drag), settled) for drag in (0.0075, 0.0125)}
    name = "distance of the curves for α = 0.0075 and 0.0125 from that for 0.01, the smaller"
    note = ", ".join(f"{value:.3f} for {drag:g}" for drag, value in distances.items())
    yield Reading(name, min(distances.values()), OMEGA, at_least(SUPERIMPOSED), note=note)


@_of_drag(
    "strong-drag-impedes",
    place="section 5, Fig. 6a",
    says="For α ≥ 0.0125 drag keeps water from spreading over the whole bottle.",
    means="At most half as much water as for α = 0 is ever in the cap's half of the bottle at once.",
    why="Half is a choice of ours for “impeded”.",
)
def _strong_drag_impedes(flights: CaseFlights) -> Iterator[Reading]:
    free = observe.largest_share_near_cap(flights.at("drag", 0.0))
    for drag in STRONG_DRAGS:
        share = observe.largest_share_near_cap(flights.at("drag", drag)) / free
        name = f"most water in the cap's half at once for α = {drag:g}, by that for α = 0"
        yield Reading(name, share, "", at_most(0.5), note=f"{100 * free:.0f} % of the water for α = 0")


def _angle_grows_again_with_drag(flights: CaseFlights) -> Iterator[Reading]:
    turned = flights.measured("drag", lambda run: math.degrees(float(run.theta[-1])))
    rising = [turned[b] - turned[a] for a, b in pairwise(sorted(turned)) if b in STRONG_DRAGS]
    note = ", ".join(f"{angle:.0f}° for {drag:g}" for drag, angle in turned.items())
    yield Reading("θ(T) for α = 0 minus that for 0.01", turned[0.0] - turned[0.01], "°", at_least(0.0), note=note)
    yield Reading("growth of θ(T) from one α to the next from 0.0125 on, the least", min(rising), "°", at_least(0.0))


def _strong_drag_turns_back(flights: CaseFlights) -> Iterator[Reading]:
    lowest = {drag: float(observe.normalised(flights.at("drag", drag)).min()) for drag in STRONG_DRAGS}
    drag, min_omega = min(lowest.items(), key=itemgetter(1))
    note = f"for α = {drag:g}; Eq. 12 keeps the sign of ω, so that θ can never turn back"
    yield Reading("lowest ω", min_omega, OMEGA, at_most(0.0), note=note)


def _strong_drag_oscillates(flights: CaseFlights) -> Iterator[Reading]:
    for drag in STRONG_DRAGS:
        name = f"largest climb over the lowest ω until then, α = {drag:g}"
        yield Reading(name, observe.climb(flights.at("drag", drag)), OMEGA, at_least(FLAT))


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

_oscillates: Final = _of_drag(
    "strong-drag-oscillates",
    place="section 5, Fig. 6c",
    says="For α ≥ 0.0125 ω oscillates.",
    means="ω climbs by 0.1 ω₀ or more over its lowest value until then.",
    why=FLAT_WHY,
)(_strong_drag_oscillates)


@_of_drag(
    "no-drag-rises",
    place="section 5, Fig. 6",
    says="For α = 0 ω increases late.",
    means="ω over the last tenth of the flight lies at least 0.1 ω₀ over the plateau.",
    why=FLAT_WHY,
)
def _no_drag_rises_late(flights: CaseFlights) -> Iterator[Reading]:
    rise = observe.late_rise(flights.at("drag", 0.0))
    yield Reading("late rise over the plateau for α = 0", rise, OMEGA, at_least(FLAT))


def _moderate_drag(drag: float) -> Statement:
    @_of_drag(
        f"moderate-drag-flat-{drag:g}",
        place="section 5, Fig. 6c",
        says=f"For α from 0.0075 to 0.01 ω drops suddenly to a flat plateau: at α = {drag:g}.",
        means="Half the drop is done by T/4, the last tenth of the flight lies at most 0.1 ω₀ over the plateau, "
        "and ω never climbs by more than 0.1 ω₀ over its lowest value until then.",
        why=f"A quarter of the flight is a choice of ours for “sudden”. {FLAT_WHY}",
    )
    def is_flat(flights: CaseFlights) -> Iterator[Reading]:
        run = flights.at("drag", drag)
        yield from flat_plateau(run)
        yield Reading("time to half the drop", observe.drop_time(run), "of T", at_most(0.25))

    return is_flat


_lower_moderate_drag, _upper_moderate_drag = map(_moderate_drag, (0.0075, 0.01))


# ---------------------------------------------------------------------- filling (Fig. 7)

OPTIMUM: Final = (0.2, 0.5)
"""Fillings that the paper finds best, and its range of omega_f / omega_0 there: the same two numbers."""

CLEAR: Final = 0.8
"""omega / omega_0 below which a bottle is clearly slower."""

_of_filling: Final = partial(states, throw="α = 0.01 kg/s, β = −0.5, m = 1 g, T = 0.5 s, M̃ as named (Fig. 7)")
INTERMEDIATE: Final = (0.2, 0.75)
"""Intermediate fillings: those of the experiment but for 0.1, rounded outwards to the optimum."""

MAJORITY: Final = math.nextafter(0.5, 1.0)
RANGE_NAME: Final = f"share of the fillings from {INTERMEDIATE[0]:g} to {INTERMEDIATE[1]:g} with ω_f/ω₀ in 0.2 to 0.5"

SLOW_WHY: Final = "“Slower” is a word of ours for ω below 0.8 ω₀, “not slower” for above 0.9 ω₀."


@_of_filling(
    "plateau-range",
    place="section 5, Fig. 7b",
    says="In most cases ω_f/ω₀ is 0.2 to 0.5 at intermediate fillings.",
    means="So at more than half of the fillings from 0.2 to 0.75; ω_f is the lowest mean over T/50.",
    why="“Most” is more than half; the range is the paper's, the choice of fillings ours.",
)
def _plateau_range(flights: CaseFlights) -> Iterator[Reading]:
    note = plateau_range_words(flights) + _by_points(flights)
    yield Reading(RANGE_NAME, share_in_range(flights), "", at_least(MAJORITY), note=note)


def share_in_range(flights: CaseFlights) -> float:
    """Return the share of the intermediate fillings at which omega_f / omega_0 lies in the paper's range."""
    levels = flights.measured("filling", level, *INTERMEDIATE).values()
    return sum(OPTIMUM[0] <= value <= OPTIMUM[1] for value in levels) / len(levels)


def plateau_range_words(flights: CaseFlights) -> str:
    """Return between which values omega_f / omega_0 lies at the intermediate fillings."""
    levels = flights.measured("filling", level, *INTERMEDIATE).values()
    return f"ω_f/ω₀ from {min(levels):.3f} to {max(levels):.3f} at {len(levels)} fillings"


def _by_points(flights: CaseFlights) -> str:
    """Return where the paper's average over points and the mean over time differ by more than 0.005 of omega_0."""
    time, points = (flights.measured("filling", read) for read in (level, level_by_points))
    differ = ", ".join(
        f"{points[filling]:.3f} instead of {time[filling]:.3f} at M̃ = {filling:g}"
        for filling in time
        if abs(time[filling] - points[filling]) > 0.005
    )
    if differ:
        return f"; by the paper's points {differ}"
    return "; the paper's average over points agrees with the mean over time"


def _plateau_at(flights: CaseFlights, filling: float, admissible: tuple[float, float]) -> Iterator[Reading]:
    yield Reading(f"ω_f at M̃ = {filling:g}", level(flights.at("filling", filling)), OMEGA, admissible)


_keeps_spin_at: Final = partial(_plateau_at, admissible=at_least(0.9))
_slows_at: Final = partial(_plateau_at, admissible=at_most(CLEAR))


def _about_slowing(id_: str, says: str, place: str = "section 5, Fig. 7a") -> Callable[[Read], Statement]:
    """Return a decorator for a bottle that slows down in the model, a limit that the paper admits."""
    means = "ω_f is at most 0.8 ω₀."
    return _of_filling(id_, place=place, says=says, means=means, why=SLOW_WHY, kind="admitted limit")


_slow_down_when_full: Final = _about_slowing(
    "full-slows", "At M̃ = 1 the model slows down, although nothing can slosh.", "section 5, Fig. 7a; section 6"
)(partial(_slows_at, filling=1.0))

_no_slow_down_when_nearly_empty: Final = _of_filling(
    "empty-keeps-spin",
    place="section 5, Fig. 7a",
    says="At M̃ = 0.05 the bottle does not slow down.",
    means="ω_f is at least 0.9 ω₀.",
    why=SLOW_WHY,
)(partial(_keeps_spin_at, filling=0.05))

_slow_down_at_a_tenth: Final = _about_slowing(
    "tenth-slows", "At M̃ = 0.1 the model clearly slows down, unlike the bottle that was thrown."
)(partial(_slows_at, filling=0.1))


def filling_of_slow_down(flights: CaseFlights) -> float:
    """Return the least filling with omega_f = 0.8 omega_0, interpolated between flights; NaN if there is none."""
    levels = sorted(flights.measured("filling", level).items())
    for (low, above), (high, below) in pairwise(levels):
        if above >= CLEAR > below:
            return low + (high - low) * (above - CLEAR) / (above - below)
    return math.nan


@_of_filling(
    "low-filling-change",
    place="section 5, Fig. 7a",
    says="The model begins to slow down between M̃ = 0.05 and 0.1, the experiment between 0.1 and 0.2; the paper "
    "calls that not critical.",
    means="ω_f falls to 0.8 ω₀ at a filling from 0.05 to 0.1. Where weight plays no part the change comes at about "
    "h/L = ε/(1 + ε), M̃ = 0.1417: up to there resting water lies below the centre of mass.",
    why=f"The interval is the paper's. {SLOW_WHY}",
    kind="admitted limit",
)
def _change_at_low_filling(flights: CaseFlights) -> Iterator[Reading]:
    note = (
        "interpolated between the fillings flown: 0.05, 0.09, 0.095, 0.1, 0.13, 0.135, 0.14, 0.15, 0.2; that "
        "adds an error of up to 0.002"
    )
    yield Reading("filling at which ω_f falls to 0.8 ω₀", filling_of_slow_down(flights), "", (0.05, 0.1), note=note)


@_of_filling(
    "agreement-excellent",
    place="section 5, Fig. 4d and 7b",
    says="The agreement of measured and computed plateaus is excellent.",
    means="ω_f/ω₀ is in 0.2 to 0.5, widened by 0.05, at M̃ = 0.25, 0.33 and 0.5, and at most 0.8 at 0.75. That is "
    "all the data the text gives there: a range, and “significant reduction”; no measured number is printed.",
    why=f"{SUPERIMPOSED_WHY} Low and high fillings are left out: there the same paragraph itself reports "
    "significant differences.",
    otherwise={
        "with M̃ = 0.1, where the text says of the experiment: very close to ice": partial(_keeps_spin_at, filling=0.1)
    },
)
def _agreement_is_excellent(flights: CaseFlights) -> Iterator[Reading]:
    low, high = OPTIMUM
    for filling in (0.25, 0.33, 0.5):
        yield from _plateau_at(flights, filling, (low - SUPERIMPOSED, high + SUPERIMPOSED))
    yield from _slows_at(flights, 0.75)


@_of_filling(
    "best-filling",
    place="section 5, Fig. 7b",
    says="Fillings from 0.2 to 0.5 make the rotation slowest.",
    means="The lowest ω_f is at one of them.",
    why="The sentence is a comparison: its threshold is zero.",
)
def _best_filling(flights: CaseFlights) -> Iterator[Reading]:
    levels = flights.measured("filling", level)
    inside = flights.measured("filling", level, *OPTIMUM)
    best, lowest = min(inside.items(), key=itemgetter(1))
    rival, second = min(((filling, levels[filling]) for filling in levels if filling not in inside), key=itemgetter(1))
    note = f"{lowest:.3f} at M̃ = {best:g}, {second:.3f} at {rival:g}"
    yield Reading("lowest ω_f outside 0.2 to 0.5 minus lowest inside", second - lowest, OMEGA, at_least(0.0), note=note)
