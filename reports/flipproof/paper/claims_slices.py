"""What section 5 says of rebound and slices (Fig. 5)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from flipproof.paper.claim import FLAT_WHY, Claim, Read, states
from flipproof.paper.observe import (
    FLAT,
    SUPERIMPOSED,
    Flights,
    MissingFlightError,
    climb,
    departures,
    distance,
    late_mean,
    late_rise,
    level,
    normalised,
)
from flipproof.paper.parameters import numbers
from flipproof.paper.runs import PUBLISHED
from flipproof.paper.statements import OMEGA, Reading
from slicemodel import Trajectory

AT_LEAST_FLAT: Final = (FLAT, math.inf)
AT_MOST_FLAT: Final = (-math.inf, FLAT)

LOW: Final = 0.5
"""Share of omega_0 that a low plateau does not exceed; the upper end of the paper's own range."""

DETECTED: Final = 0.005
"""Share of omega_0 by which a minimum must move to be seen: a two-hundredth of the axis of Fig. 5d."""

FEW_SLICES: Final = (2.0, 5.0)
MANY_SLICES: Final = 100.0
FINEST: Final = 200
"""Slices of an event-driven flight that the others are held against."""


def _figure_5(id_: str, says: str, means: str, why: str, place: str = "Fig. 5") -> Callable[[Read], Claim]:
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
def _sticking_slices(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    left = departures(flights.at("beta" + damping, 0.0))
    name = "largest outward acceleration, centrifugal and weight, of a slice that leaves its end"
    if not left:
        return (Reading(name=name, value=0.0, unit="m/s²", admissible=(-math.inf, 0.0), note="no slice leaves an end"),)
    worst = max(left, key=lambda departure: departure.outward)
    against = sum(departure.outward > departure.step for departure in left)
    note = f"{against} of {len(left)} departures against both; this one at t = {worst.time:.3f} s"
    return (
        Reading(
            name=name, value=worst.outward, unit="m/s²", admissible=(-math.inf, 0.0), band=worst.step, note=note
        ),
    )  # fmt: skip


@_figure_5(
    "beta-1-rises",
    "For β = −1 θ rises faster late in the flight.",
    "Mean ω over the last tenth of the flight is larger for β = −1 than for β = 0 and β = −0.5.",
    "The sentence is a comparison: its threshold is zero.",
    "Fig. 5b",
)
def _elastic_rises_late(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    elastic, *others = (late_mean(flights.at("beta" + damping, beta)) for beta in (-1.0, 0.0, -0.5))
    return (
        Reading(
            name="late ω for β = −1 minus the larger of the others",
            value=elastic - max(others),
            unit=OMEGA,
            admissible=(0.0, math.inf),
            note=f"{elastic:.3f} against {others[0]:.3f} for β = 0 and {others[1]:.3f} for β = −0.5",
        ),
    )


@_figure_5(
    "beta-angle-alike",
    "θ(t) for β = 0 and for β = −0.5 differ little.",
    "θ is nowhere farther apart than 0.05 of the angle that the bottle of β = −0.5 turns.",
    "The share is that of ω for “superimposed”, a word of ours: 0.05 of what the axis shows.",
    "Fig. 5b",
)
def _angle_hardly_depends_on_rebound(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    sticky, half = (flights.at("beta" + damping, beta) for beta in (0.0, -0.5))
    apart = np.abs(half.theta - np.interp(half.t, sticky.t, sticky.theta))
    turned = abs(float(half.theta[-1] - half.theta[0]))
    return (
        Reading(
            name="largest difference of θ for β = 0 and β = −0.5",
            value=float(apart.max()) / turned,
            unit="of the angle turned",
            admissible=(-math.inf, SUPERIMPOSED),
            note=f"{math.degrees(float(apart.max())):.1f}° of {math.degrees(turned):.0f}°, "
            f"at t = {half.t[int(apart.argmax())]:.3f} s",
        ),
    )


def flat_plateau(run: Trajectory) -> tuple[Reading, Reading]:
    """Return whether omega does not rise late over its plateau, and never climbs again once it is low."""
    return (
        Reading(name="late rise over the plateau", value=late_rise(run), unit=OMEGA, admissible=AT_MOST_FLAT),
        Reading(name="largest climb over the lowest ω until then", value=climb(run), unit=OMEGA,
                admissible=AT_MOST_FLAT),
    )  # fmt: skip


@_figure_5(
    "beta-half-flat",
    "For β = −0.5 ω remains low and constant, without a late increase.",
    "The plateau is at most 0.5 ω₀, the last tenth of the flight lies at most 0.1 ω₀ over it, and ω never climbs "
    "by more than 0.1 ω₀ over its lowest value until then.",
    f"0.5 is the upper end of the paper's own range in Fig. 7b. {FLAT_WHY}",
    "Fig. 5c",
)
def _half_elastic_is_flat(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    run = flights.at("beta" + damping, -0.5)
    low = Reading(name="plateau ω_f", value=level(run), unit=OMEGA, admissible=(-math.inf, LOW))
    return (low, *flat_plateau(run))


@_figure_5(
    "beta-others-rise",
    "Only β = −0.5 does so: for β = 0 and β = −1 ω increases late.",
    "For both, ω over the last tenth of the flight lies at least 0.1 ω₀ over the plateau.",
    FLAT_WHY,
    "Fig. 5c",
)
def _other_rebounds_rise_late(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    return tuple(
        Reading(
            name=f"late rise for β = {beta:g}".replace("-", "−"),
            value=late_rise(flights.at("beta" + damping, beta)),
            unit=OMEGA,
            admissible=AT_LEAST_FLAT,
        )
        for beta in (0.0, -1.0)
    )


# ---------------------------------------------------------------------- slices


@_figure_5(
    "few-slices",
    "Only N = 2 and N = 5 differ significantly.",
    "Both are farther (root mean square of ω) from the finest cut than any N from 10 on.",
    "The sentence is a comparison: its threshold is zero.",
    "Fig. 5d",
)
def _few_slices(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    finest = _finest(flights, damping)
    off = {
        case.value: distance(run, finest)
        for case, run in flights.members("slices" + damping)
        if run.scenario.n_slices < finest.scenario.n_slices
    }
    few = [off[count] for count in FEW_SLICES]
    many = [value for count, value in off.items() if count not in FEW_SLICES]
    return (
        Reading(
            name=f"distance from {finest.scenario.n_slices} slices: the smaller of N = 2 and 5 "
            "minus the largest from N = 10 on",
            value=min(few) - max(many),
            unit=OMEGA,
            admissible=(0.0, math.inf),
            band=off[max(off)],
            note=", ".join(f"N = {count:g}: {value:.3f}" for count, value in off.items()),
        ),
    )


@_figure_5(
    "minimum-shifts",
    "The minimum of ω still moves for N < 100.",
    "Against the finest cut, lowest ω is off by 0.005 ω₀ or more at an N from 10 to 50, by less at N = 100.",
    "0.005 ω₀ is a two-hundredth of the axis of Fig. 5d: less cannot be seen there.",
    "Fig. 5d",
)
def _minimum_shifts(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    finest = float(normalised(_finest(flights, damping)).min())
    shift = {
        case.value: abs(float(normalised(run).min()) - finest)
        for case, run in flights.members("slices" + damping)
        if 10.0 <= case.value <= MANY_SLICES
    }
    if MANY_SLICES not in shift:
        raise MissingFlightError(f"{flights.solver} has not flown {MANY_SLICES:g} slices")
    last = shift.pop(MANY_SLICES)
    most = max(shift, key=lambda count: shift[count])
    # What the finest cut is still off by is at most what the one before it is off from it.
    return (
        Reading(name="largest shift of the minimum, N = 10 to 99", value=shift[most], unit=OMEGA,
                admissible=(DETECTED, math.inf), band=last, note=f"at N = {most:g}"),
        Reading(name="shift of the minimum, N = 100", value=last, unit=OMEGA, admissible=(-math.inf, DETECTED),
                band=last),
    )  # fmt: skip


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
