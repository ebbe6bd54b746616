"""What section 5 says about the model's own knobs: rebound, slices, drag (Fig. 5 and 6)."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import numpy as np

from flipproof.paper.observe import (
    FLAT,
    SUPERIMPOSED,
    Flights,
    MissingFlightError,
    climb,
    departures,
    distance,
    drop_time,
    largest_share_near_cap,
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

SUDDEN: Final = 0.25
"""Share of the flight within which a sudden drop is half done."""

DETECTED: Final = 0.005
"""Share of omega_0 by which a minimum must move to be seen: a two-hundredth of the axis of Fig. 5d."""

FEW_SLICES: Final = (2.0, 5.0)
MANY_SLICES: Final = 100.0
FINEST: Final = 200
"""Slices of an event-driven flight that the others are held against."""

STRONG_DRAG: Final = 0.0125
GOOD_DRAG: Final = 0.01
NEXT_DRAGS: Final = (0.0075, 0.0125)
"""The values that the paper names on either side of the one it settles on [kg/s]."""

HALF: Final = 0.5


def finest_key(damping: str) -> str:
    """Return the key of the flight with the most slices; ``damping`` as in ``claim_few_slices``."""
    return f"slices finest{damping}"


# ---------------------------------------------------------------------- rebound


def claim_sticking_slices(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    """With beta = 0 a slice leaves an end only where its weight exceeds the centrifugal force."""
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


def claim_elastic_rises_late(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    """With beta = -1 theta rises faster in the last tenth of the flight than with beta = 0 or -0.5."""
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


def claim_angle_hardly_depends_on_rebound(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    """With beta = 0 and beta = -0.5 theta(t) is nearly the same."""
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


def claim_half_elastic_is_flat(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    """With beta = -0.5 omega becomes low, stays constant and does not rise late."""
    return (low_plateau(run := flights.at("beta" + damping, -0.5)), *flat_plateau(run))


def low_plateau(run: Trajectory) -> Reading:
    """Return whether the plateau is low."""
    return Reading(name="plateau ω_f", value=level(run), unit=OMEGA, admissible=(-math.inf, LOW))


def flat_plateau(run: Trajectory) -> tuple[Reading, Reading]:
    """Return whether omega does not rise late over its plateau, and never climbs again once it is low."""
    return (
        Reading(name="late rise over the plateau", value=late_rise(run), unit=OMEGA, admissible=AT_MOST_FLAT),
        Reading(name="largest climb over the lowest ω until then", value=climb(run), unit=OMEGA,
                admissible=AT_MOST_FLAT),
    )  # fmt: skip


def claim_other_rebounds_rise_late(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    """With beta = 0 and with beta = -1 omega rises late."""
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


def claim_few_slices(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    """Curves of 2 and 5 slices differ from the finest one by more than those of 10 and more slices do.

    ``damping`` is "" for the drag of the caption of Fig. 5, " at 5 /s" for the damping of all later figures.
    """
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


def claim_minimum_shifts(flights: Flights, damping: str = "") -> tuple[Reading, ...]:
    """Lowest omega still moves below N = 100, and no longer from there on."""
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


# ---------------------------------------------------------------------- drag


def claim_strong_drag_impedes(flights: Flights) -> tuple[Reading, ...]:
    """From alpha = 0.0125 on, less than half as much water as without drag ever gets into the cap's half."""
    free = largest_share_near_cap(flights.at("drag", 0.0))
    return tuple(
        Reading(
            name=f"most water in the cap's half at once for α = {drag:g}, by that for α = 0",
            value=largest_share_near_cap(flights.at("drag", drag)) / free,
            unit="",
            admissible=(-math.inf, HALF),
            note=f"{100 * free:.0f} % of the water for α = 0",
        )
        for drag in strong_drags()
    )


def strong_drags() -> list[float]:
    """Return the drags of Fig. 6 that count as strong [kg/s]."""
    return [drag for drag in numbers("figure-6-drag") if drag >= STRONG_DRAG]


def claim_sensitive_to_drag(flights: Flights) -> tuple[Reading, ...]:
    """With a quarter more or less drag than the settled one omega(t) is another."""
    settled = flights.at("drag", GOOD_DRAG)
    off = {drag: distance(flights.at("drag", drag), settled) for drag in NEXT_DRAGS}
    least = min(off, key=lambda drag: off[drag])
    return (
        Reading(
            name="distance of the curves for α = 0.0075 and 0.0125 from that for 0.01, the smaller",
            value=off[least],
            unit=OMEGA,
            admissible=(SUPERIMPOSED, math.inf),
            note=", ".join(f"{value:.3f} for {drag:g}" for drag, value in off.items()),
        ),
    )


def claim_angle_grows_again_with_drag(flights: Flights) -> tuple[Reading, ...]:
    """Over alpha the angle at the end falls up to 0.01 and grows from 0.0125 on."""
    turned = {case.value: math.degrees(float(run.theta[-1])) for case, run in flights.members("drag")}
    rising = [turned[b] - turned[a] for a, b in pairwise(sorted(turned)) if b >= STRONG_DRAG]
    note = ", ".join(f"{angle:.0f}° for {drag:g}" for drag, angle in turned.items())
    return (
        Reading(name="θ(T) for α = 0 minus that for 0.01", value=turned[0.0] - turned[GOOD_DRAG], unit="°",
                admissible=(0.0, math.inf), note=note),
        Reading(name="growth of θ(T) from one α to the next from 0.0125 on, the least", value=min(rising), unit="°",
                admissible=(0.0, math.inf)),
    )  # fmt: skip


def claim_strong_drag_turns_back(flights: Flights) -> tuple[Reading, ...]:
    """From alpha = 0.0125 on theta is not monotonic: somewhere the bottle turns backwards."""
    lowest = {drag: float(normalised(flights.at("drag", drag)).min()) for drag in strong_drags()}
    drag = min(lowest, key=lambda each: lowest[each])
    return (
        Reading(
            name="lowest ω",
            value=lowest[drag],
            unit=OMEGA,
            admissible=(-math.inf, 0.0),
            note=f"for α = {drag:g}; Eq. 12 keeps the sign of ω, so that θ can never turn back",
        ),
    )


def claim_strong_drag_oscillates(flights: Flights) -> tuple[Reading, ...]:
    """From alpha = 0.0125 on omega climbs again after its drop."""
    return tuple(
        Reading(
            name=f"largest climb over the lowest ω until then, α = {drag:g}",
            value=climb(flights.at("drag", drag)),
            unit=OMEGA,
            admissible=AT_LEAST_FLAT,
        )
        for drag in strong_drags()
    )


def claim_no_drag_rises_late(flights: Flights) -> tuple[Reading, ...]:
    """Without drag omega rises late."""
    rise = late_rise(flights.at("drag", 0.0))
    return (Reading(name="late rise over the plateau for α = 0", value=rise, unit=OMEGA, admissible=AT_LEAST_FLAT),)


def claim_moderate_drag_is_flat(flights: Flights, drag: float) -> tuple[Reading, ...]:
    """At a drag from 0.0075 to 0.01 omega drops suddenly and then stays flat."""
    run = flights.at("drag", drag)
    return (
        *flat_plateau(run),
        Reading(name="time to half the drop", value=drop_time(run), unit="of T", admissible=(-math.inf, SUDDEN)),
    )
