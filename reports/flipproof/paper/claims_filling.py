"""What section 5 says of fillings (Fig. 7)."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

from flipproof.paper.claim import SUPERIMPOSED_WHY, states
from flipproof.paper.observe import (
    SUPERIMPOSED,
    Flights,
    level,
    level_by_points,
)
from flipproof.paper.statements import OMEGA, Reading

OPTIMUM: Final = (0.2, 0.5)
"""Fillings that the paper finds best, and its range of omega_f / omega_0 there: the same two numbers."""

INTERMEDIATE: Final = (0.2, 0.75)
"""Fillings that count as intermediate: those of the experiment but for 0.1, rounded outwards to the optimum."""

NO_SLOW_DOWN: Final = (0.9, math.inf)
"""omega_f / omega_0 of a bottle that does not slow down."""

LITTLE: Final = 0.05
TENTH: Final = 0.1
"""Fillings between which the paper's model, unlike its experiment, begins to slow down."""

CLEAR: Final = 0.8
"""omega / omega_0 below which a bottle is clearly slower."""

MEASURED: Final = (0.25, 0.33, 0.5)
"""Fillings of the experiment that are intermediate and for which the text gives a range of omega_f / omega_0."""

LESS_MEASURED: Final = 0.75
"""Filling of the experiment for which the text says only that omega is already significantly reduced."""

SLOW_DOWN: Final = (-math.inf, CLEAR)
"""omega_f / omega_0 of a bottle that clearly slows down."""

MOST: Final = 0.5

DIFFERENT: Final = 0.005
"""Difference of two plateaus, as a share of omega_0, below which two definitions agree."""

FILLINGS: Final = "α = 0.01 kg/s, β = −0.5, m = 1 g, T = 0.5 s, M̃ as named (Fig. 7)"
SLOW_WHY: Final = "“Slower” is a word of ours for ω below 0.8 ω₀, “not slower” for above 0.9 ω₀."


def levels(flights: Flights) -> dict[float, float]:
    """Return omega_f / omega_0 by filling."""
    return {case.value: level(run) for case, run in flights.members("filling")}


@states(
    "plateau-range",
    place="section 5, Fig. 7b",
    says="In most cases ω_f/ω₀ is 0.2 to 0.5 at intermediate fillings.",
    means="So at more than half of the fillings from 0.2 to 0.75; ω_f is the lowest mean over T/50.",
    throw=FILLINGS,
    why="“Most” is more than half; the range is the paper's, the choice of fillings ours.",
)
def _plateau_range(flights: Flights) -> tuple[Reading, ...]:
    low, high = INTERMEDIATE
    found = {filling: value for filling, value in levels(flights).items() if low <= filling <= high}
    inside = [OPTIMUM[0] <= value <= OPTIMUM[1] for value in found.values()]
    return (
        Reading(
            name=f"share of the {len(found)} fillings from {low:g} to {high:g} with ω_f/ω₀ in 0.2 to 0.5",
            value=sum(inside) / len(inside),
            unit="",
            admissible=(math.nextafter(MOST, 1.0), math.inf),
            note=f"ω_f/ω₀ from {min(found.values()):.3f} to {max(found.values()):.3f}" + _by_points(flights),
        ),
    )


def _by_points(flights: Flights) -> str:
    """Return where the paper's average over points and the mean over time differ."""
    differ = {
        case.value: (level(run), level_by_points(run))
        for case, run in flights.members("filling")
        if abs(level(run) - level_by_points(run)) > DIFFERENT
    }
    if not differ:
        return "; the paper's average over points agrees with the mean over time"
    return "; by the paper's points " + ", ".join(
        f"{points:.3f} instead of {time:.3f} at M̃ = {filling:g}" for filling, (time, points) in differ.items()
    )


def plateau_at(flights: Flights, filling: float, admissible: tuple[float, float]) -> tuple[Reading, ...]:
    """Return the plateau at one filling."""
    run = flights.at("filling", filling)
    return (Reading(name=f"ω_f at M̃ = {filling:g}", value=level(run), unit=OMEGA, admissible=admissible),)


@states(
    "full-slows",
    place="section 5, Fig. 7a; section 6",
    says="At M̃ = 1 the model slows down, although nothing can slosh.",
    means="ω_f is at most 0.8 ω₀.",
    throw=FILLINGS,
    why=SLOW_WHY,
    kind="admitted limit",
)
def _slow_down_when_full(flights: Flights) -> tuple[Reading, ...]:
    return plateau_at(flights, 1.0, SLOW_DOWN)


@states(
    "empty-keeps-spin",
    place="section 5, Fig. 7a",
    says="At M̃ = 0.05 the bottle does not slow down.",
    means="ω_f is at least 0.9 ω₀.",
    throw=FILLINGS,
    why=SLOW_WHY,
)
def _no_slow_down_when_nearly_empty(flights: Flights) -> tuple[Reading, ...]:
    return plateau_at(flights, LITTLE, NO_SLOW_DOWN)


@states(
    "tenth-slows",
    place="section 5, Fig. 7a",
    says="At M̃ = 0.1 the model clearly slows down, unlike the bottle that was thrown.",
    means="ω_f is at most 0.8 ω₀.",
    throw=FILLINGS,
    why=SLOW_WHY,
    kind="admitted limit",
)
def _slow_down_at_a_tenth(flights: Flights) -> tuple[Reading, ...]:
    return plateau_at(flights, TENTH, SLOW_DOWN)


def filling_of_slow_down(flights: Flights) -> float:
    """Return the least filling with omega_f = 0.8 omega_0, interpolated between flights; NaN if there is none."""
    found = sorted(levels(flights).items())
    for (low, above), (high, below) in pairwise(found):
        if above >= CLEAR > below:
            return low + (high - low) * (above - CLEAR) / (above - below)
    return math.nan


@states(
    "low-filling-change",
    place="section 5, Fig. 7a",
    says="The model begins to slow down between M̃ = 0.05 and 0.1, the experiment between 0.1 and 0.2; the paper "
    "calls that not critical.",
    means="ω_f falls to 0.8 ω₀ at a filling from 0.05 to 0.1. Where weight plays no part the change comes at about "
    "h/L = ε/(1 + ε), M̃ = 0.1417: up to there resting water lies below the centre of mass.",
    throw=FILLINGS,
    why=f"The interval is the paper's. {SLOW_WHY}",
    kind="admitted limit",
)
def _change_at_low_filling(flights: Flights) -> tuple[Reading, ...]:
    return (
        Reading(
            name="filling at which ω_f falls to 0.8 ω₀",
            value=filling_of_slow_down(flights),
            unit="",
            admissible=(LITTLE, TENTH),
            note="interpolated between the fillings flown: 0.05, 0.09, 0.095, 0.1, 0.13, 0.135, 0.14, 0.15, 0.2; that "
            "adds an error of up to 0.002",
        ),
    )


def _agreement_at_a_tenth(flights: Flights) -> tuple[Reading, ...]:
    return plateau_at(flights, TENTH, NO_SLOW_DOWN)


@states(
    "agreement-excellent",
    place="section 5, Fig. 4d and 7b",
    says="The agreement of measured and computed plateaus is excellent.",
    means="ω_f/ω₀ is in 0.2 to 0.5, widened by 0.05, at M̃ = 0.25, 0.33 and 0.5, and at most 0.8 at 0.75. That is "
    "all the data the text gives there: a range, and “significant reduction”; no measured number is printed.",
    throw=FILLINGS,
    why=f"{SUPERIMPOSED_WHY} Low and high fillings are left out: there the same paragraph itself reports "
    "significant differences.",
    otherwise={"with M̃ = 0.1, where the text says of the experiment: very close to ice": _agreement_at_a_tenth},
)
def _agreement_is_excellent(flights: Flights) -> tuple[Reading, ...]:
    low, high = OPTIMUM
    widened = (low - SUPERIMPOSED, high + SUPERIMPOSED)
    measured = (reading for filling in MEASURED for reading in plateau_at(flights, filling, widened))
    return (*measured, *plateau_at(flights, LESS_MEASURED, SLOW_DOWN))


@states(
    "best-filling",
    place="section 5, Fig. 7b",
    says="Fillings from 0.2 to 0.5 make the rotation slowest.",
    means="The lowest ω_f is at one of them.",
    throw=FILLINGS,
    why="The sentence is a comparison: its threshold is zero.",
)
def _best_filling(flights: Flights) -> tuple[Reading, ...]:
    found = levels(flights)
    inside = {filling: value for filling, value in found.items() if OPTIMUM[0] <= filling <= OPTIMUM[1]}
    outside = {filling: value for filling, value in found.items() if filling not in inside}
    best, rival = (min(each, key=lambda filling: each[filling]) for each in (inside, outside))
    return (
        Reading(
            name="lowest ω_f outside 0.2 to 0.5 minus lowest inside",
            value=outside[rival] - inside[best],
            unit=OMEGA,
            admissible=(0.0, math.inf),
            note=f"{inside[best]:.3f} at M̃ = {best:g}, {outside[rival]:.3f} at {rival:g}",
        ),
    )


OF_FILLINGS: Final = (
    _plateau_range,
    _slow_down_when_full,
    _no_slow_down_when_nearly_empty,
    _slow_down_at_a_tenth,
    _change_at_low_filling,
    _agreement_is_excellent,
    _best_filling,
)
"""Statements on Fig. 7, in the order of the paper."""
