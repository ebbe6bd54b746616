"""What section 5 says about fillings and throws: plateau against filling, spin, angle, aspect ratio (Fig. 7 and 8)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Final

from flipproof.paper.observe import (
    FLAT,
    SUPERIMPOSED,
    Flights,
    climb,
    delayed_distance,
    distance,
    drop_time,
    level,
    level_by_points,
    shape_distance,
)
from flipproof.paper.parameters import number, numbers, paper_steps, paper_throw
from flipproof.paper.statements import OMEGA, Reading
from slicemodel import Trajectory
from slicemodel.observables import release_angular_velocity

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

ORDER: Final = math.sqrt(10.0)
"""Factor up to which two numbers are of one order of magnitude."""

SLOW_DOWN: Final = (-math.inf, CLEAR)
"""omega_f / omega_0 of a bottle that clearly slows down."""

MOST: Final = 0.5

LEAST_SPIN: Final = 10.0
"""Angular velocity below which, by section 5, a bottle just falls [rad/s]."""

DIFFERENT: Final = 0.005
"""Difference of two plateaus, as a share of omega_0, below which two definitions agree."""


def levels(flights: Flights) -> dict[float, float]:
    """Return omega_f / omega_0 by filling."""
    return {case.value: level(run) for case, run in flights.members("filling")}


def claim_plateau_range(flights: Flights) -> tuple[Reading, ...]:
    """At most intermediate fillings the plateau lies between 0.2 and 0.5 of omega_0."""
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


def claim_best_filling(flights: Flights) -> tuple[Reading, ...]:
    """Lowest plateaus belong to a filling between 0.2 and 0.5."""
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


def plateau_at(flights: Flights, filling: float, admissible: tuple[float, float]) -> tuple[Reading, ...]:
    """Return the plateau at one filling."""
    run = flights.at("filling", filling)
    return (Reading(name=f"ω_f at M̃ = {filling:g}", value=level(run), unit=OMEGA, admissible=admissible),)


def claim_no_slow_down_when_nearly_empty(flights: Flights) -> tuple[Reading, ...]:
    """At a filling of 0.05 the bottle does not slow down."""
    return plateau_at(flights, LITTLE, NO_SLOW_DOWN)


def claim_slow_down_at_a_tenth(flights: Flights) -> tuple[Reading, ...]:
    """At a filling of 0.1 the bottle slows down clearly."""
    return plateau_at(flights, TENTH, SLOW_DOWN)


def claim_slow_down_when_full(flights: Flights) -> tuple[Reading, ...]:
    """At a filling of 1 the bottle slows down."""
    return plateau_at(flights, 1.0, SLOW_DOWN)


def filling_of_slow_down(flights: Flights) -> float:
    """Return the least filling with omega_f = 0.8 omega_0, interpolated between flights; NaN if there is none."""
    found = sorted(levels(flights).items())
    for (low, above), (high, below) in pairwise(found):
        if above >= CLEAR > below:
            return low + (high - low) * (above - CLEAR) / (above - below)
    return math.nan


def claim_change_at_low_filling(flights: Flights) -> tuple[Reading, ...]:
    """Between fillings of 0.05 and 0.1 the bottle begins to slow down."""
    return (
        Reading(
            name="filling at which ω_f falls to 0.8 ω₀",
            value=filling_of_slow_down(flights),
            unit="",
            admissible=(LITTLE, TENTH),
            note="interpolated between the fillings flown: 0.05, 0.09, 0.095, 0.1, 0.13, 0.135, 0.14, 0.15, 0.2",
        ),
    )


def claim_agreement_is_excellent(flights: Flights) -> tuple[Reading, ...]:
    """At the intermediate fillings of the experiment the plateau is what the text gives for the experiment."""
    low, high = OPTIMUM
    widened = (low - SUPERIMPOSED, high + SUPERIMPOSED)
    measured = (reading for filling in MEASURED for reading in plateau_at(flights, filling, widened))
    return (*measured, *plateau_at(flights, LESS_MEASURED, SLOW_DOWN))


def claim_agreement_at_a_tenth(flights: Flights) -> tuple[Reading, ...]:
    """At a filling of 0.1 the plateau is that of ice, as the text gives it for the experiment."""
    return plateau_at(flights, TENTH, NO_SLOW_DOWN)


# ---------------------------------------------------------------------- the throw


def claim_fast_spin_changes_only_time(flights: Flights) -> tuple[Reading, ...]:
    """Spins above 20 rad/s leave the plateau where it was and only make it come earlier."""
    usual = number("release-spin")
    runs = {case.value: run for case, run in flights.members("spin") if case.value >= usual}
    plateaus, drops = ({spin: read(run) for spin, run in runs.items()} for read in (level, drop_time))
    spins = sorted(runs)
    worst = max(spins, key=lambda spin: abs(plateaus[spin] - plateaus[usual]))
    return (
        Reading(name="largest change of ω_f/ω₀ above 20 rad/s", value=abs(plateaus[worst] - plateaus[usual]),
                unit=OMEGA, admissible=(-math.inf, SUPERIMPOSED), note=f"at {worst:g} rad/s"),
        Reading(name="by how much each faster spin drops earlier, the least",
                value=min(drops[a] - drops[b] for a, b in pairwise(spins)),
                unit="of T", admissible=(one_step(), math.inf),
                note=", ".join(f"{drops[spin]:.3f} at {spin:g} rad/s" for spin in spins)),
    )  # fmt: skip


def one_step() -> float:
    """Return one time step of the paper as a share of the flight: the least that counts as a difference in time."""
    return 1.0 / (paper_steps() - 1)


def claim_slow_spin_is_not_monotonic(flights: Flights) -> tuple[Reading, ...]:
    """At a spin from 10 to below 20 rad/s omega climbs again after its drop."""
    return tuple(
        Reading(
            name=f"largest climb over the lowest ω until then, {spin:g} rad/s",
            value=climb(flights.at("spin", spin)),
            unit=OMEGA,
            admissible=(FLAT, math.inf),
        )
        for spin in numbers("figure-8a-spin")
        if LEAST_SPIN <= spin < number("release-spin")
    )


def claim_angle_hardly_matters(
    flights: Flights, apart: Callable[[Trajectory, Trajectory], float] = shape_distance
) -> tuple[Reading, ...]:
    """Angles of release hardly change the shape of omega(t); ``apart`` is how far two curves are apart."""
    usual = flights.at("angle", number("release-angle"))
    off = {case.value: apart(run, usual) for case, run in flights.members("angle")}
    worst = max(off, key=lambda angle: off[angle])
    return (
        Reading(
            name="largest distance from the curve of π/2",
            value=off[worst],
            unit=OMEGA,
            admissible=(-math.inf, SUPERIMPOSED),
            note=f"at θ₀ = {math.degrees(worst):.0f}°",
        ),
    )


ANGLE_SENSES: Final = (
    ("with the delay taken out by a shift of t", partial(claim_angle_hardly_matters, apart=delayed_distance)),
    ("with the delay left in", partial(claim_angle_hardly_matters, apart=distance)),
)
"""The statement about the angle of release in two more senses."""


def claim_drop_is_later_near_vertical(flights: Flights) -> tuple[Reading, ...]:
    """Let go nearer to the vertical, the bottle drops its omega later."""
    drops = {
        case.value: drop_time(run) for case, run in flights.members("angle") if case.value <= number("release-angle")
    }
    angles = sorted(drops)
    return (
        Reading(
            name="by how much each smaller θ₀ drops later, the least",
            value=min(drops[a] - drops[b] for a, b in pairwise(angles)),
            unit="of T",
            admissible=(one_step(), math.inf),
            note=", ".join(f"{drops[angle]:.3f} at {math.degrees(angle):.0f}°" for angle in angles),
        ),
    )


def claim_aspect_ratio_does_not_matter(flights: Flights) -> tuple[Reading, ...]:
    """Bottles of one volume and several aspect ratios have one omega(t)."""
    bottle = paper_throw().bottle
    own = flights.at("aspect", bottle.length / (2 * bottle.radius))
    off = {case.value: distance(run, own) for case, run in flights.members("aspect")}
    worst = max(off, key=lambda aspect: off[aspect])
    return (
        Reading(
            name="largest distance from the curve of the paper's bottle",
            value=off[worst],
            unit=OMEGA,
            admissible=(-math.inf, SUPERIMPOSED),
            note=f"at L / 2R = {worst:g}",
        ),
    )


def claim_release_spin(flights: Flights, factor: float = ORDER) -> tuple[Reading, ...]:
    """Launch speed of section 3 and measured spin of section 5 agree by omega_0 = v_0 / r_CM(0) up to a factor."""
    del flights
    spin = release_angular_velocity(paper_throw(), number("launch-speed"))
    usual = number("release-spin")
    return (
        Reading(
            name="v₀ / r_CM(0) for v₀ = 2 m/s and M̃ = 0.5",
            value=spin,
            unit="rad/s",
            admissible=(usual / factor, factor * usual),
            note="the formula holds for a bottle swung about its cap",
        ),
    )


def claim_spin_scale(flights: Flights) -> tuple[Reading, ...]:
    """Weight and centrifugal force balance at an angular velocity of the order of 10 rad/s."""
    del flights
    throw = paper_throw()
    length = throw.bottle.length / 2
    return (
        Reading(
            name="√(g/ℓ) for ℓ = L/2",
            value=math.sqrt(throw.gravity / length),
            unit="rad/s",
            admissible=(LEAST_SPIN / ORDER, ORDER * LEAST_SPIN),
            note=f"ℓ = {length:g} m; {math.sqrt(throw.gravity / 0.1):.1f} rad/s for the paper's rounded 0.1 m. In free "
            "flight gravity cancels and no such scale exists",
        ),
    )
