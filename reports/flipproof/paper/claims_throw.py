"""What sections 3 and 5 say of release and throw: spin, angle, aspect ratio (Fig. 8)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from operator import itemgetter
from typing import Final

from flipproof.paper import observe
from flipproof.paper.claim import FLAT_WHY, SUPERIMPOSED_WHY, states
from flipproof.paper.observe import FLAT, SUPERIMPOSED, Flights
from flipproof.paper.parameters import number, numbers, paper_steps, paper_throw
from flipproof.paper.statements import OMEGA, Reading, at_least, at_most
from slicemodel import Trajectory
from slicemodel.observables import release_angular_velocity

ORDER: Final = math.sqrt(10.0)
"""Factor up to which two numbers are of one order of magnitude."""

LEAST_SPIN: Final = 10.0
"""Angular velocity below which, by section 5, a bottle just falls [rad/s]."""

ONE_STEP: Final = 1.0 / (paper_steps() - 1)
"""One time step of the paper as a share of the flight: the least that counts as a difference in time."""

HALF_FULL: Final = "half full, α = 0.01 kg/s, β = −0.5"


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
def _release_spin(_: Flights, factor: float = ORDER) -> Iterator[Reading]:
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
def _spin_scale(_: Flights) -> Iterator[Reading]:
    gravity, length = paper_throw().gravity, paper_throw().bottle.length / 2
    note = (
        f"ℓ = {length:g} m; {math.sqrt(gravity / 0.1):.1f} rad/s for the paper's rounded 0.1 m. In free "
        "flight gravity cancels and no such scale exists"
    )
    admissible = (LEAST_SPIN / ORDER, ORDER * LEAST_SPIN)
    yield Reading("√(g/ℓ) for ℓ = L/2", math.sqrt(gravity / length), "rad/s", admissible, note=note)


@states(
    "fast-spin",
    place="section 5, Fig. 8a",
    says="ω₀ > 20 rad/s does not affect the final ω/ω₀, only the time to it.",
    means="ω_f/ω₀ changes by at most 0.05, and each faster spin drops earlier by at least T/1000.",
    throw=f"{HALF_FULL}; 20, 25 and 30 rad/s",
    why=f"{SUPERIMPOSED_WHY} T/1000 is one time step of the paper.",
)
def _fast_spin_changes_only_time(flights: Flights) -> Iterator[Reading]:
    usual = number("release-spin")
    levels, drops = (flights.measured("spin", read, low=usual) for read in (observe.level, observe.drop_time))
    change = {spin: abs(levels[spin] - levels[usual]) for spin in sorted(levels)}
    worst, most = max(change.items(), key=itemgetter(1))
    note = f"at {worst:g} rad/s"
    yield Reading("largest change of ω_f/ω₀ above 20 rad/s", most, OMEGA, at_most(SUPERIMPOSED), note=note)
    note = ", ".join(f"{drops[spin]:.3f} at {spin:g} rad/s" for spin in sorted(drops))
    name = "by how much each faster spin drops earlier, the least"
    yield Reading(name, _least_delay(drops), "of T", at_least(ONE_STEP), note=note)


def _least_delay(drops: dict[float, float]) -> float:
    """Return by how much the drop comes earlier from one spin or angle to the next, the least."""
    return min(drops[a] - drops[b] for a, b in pairwise(sorted(drops)))


@states(
    "slow-spin",
    place="section 5, Fig. 8a",
    says="For ω₀ < 20 rad/s ω is not monotonic.",
    means="From 10 rad/s on, below which the paper lets a bottle just fall, ω climbs by 0.1 ω₀ or more over its "
    "lowest value until then.",
    throw=f"{HALF_FULL}; 10 and 15 rad/s",
    why=FLAT_WHY,
)
def _slow_spin_is_not_monotonic(flights: Flights) -> Iterator[Reading]:
    for spin in numbers("figure-8a-spin"):
        if LEAST_SPIN <= spin < number("release-spin"):
            name = f"largest climb over the lowest ω until then, {spin:g} rad/s"
            yield Reading(name, observe.climb(flights.at("spin", spin)), OMEGA, at_least(FLAT))


@states(
    "release-angle",
    place="section 5, Fig. 8b",
    says="The angle of release hardly changes the shape of ω(t); the decrease only takes longer.",
    means="With time counted in each curve's own time to half its drop, all stay within 0.05 ω₀ (root mean square) "
    "of that for π/2.",
    throw=f"{HALF_FULL}; θ₀ = 0, 30, 60, 90 and 120°, of which the text names 0 and 90°",
    why=SUPERIMPOSED_WHY,
    otherwise={
        "with the delay taken out by a shift of t": {"apart": observe.delayed_distance},
        "with the delay left in": {"apart": observe.distance},
    },
)
def _angle_hardly_matters(
    flights: Flights, apart: Callable[[Trajectory, Trajectory], float] = observe.shape_distance
) -> Iterator[Reading]:
    usual = flights.at("angle", number("release-angle"))
    off = flights.measured("angle", lambda run: apart(run, usual))
    worst, most = max(off.items(), key=itemgetter(1))
    note = f"at θ₀ = {math.degrees(worst):.0f}°"
    yield Reading("largest distance from the curve of π/2", most, OMEGA, at_most(SUPERIMPOSED), note=note)


@states(
    "drop-later",
    place="section 5, Fig. 8b",
    says="The nearer to the vertical the release, the later the drop.",
    means="From π/2 down, each smaller θ₀ puts half the drop off by at least T/1000.",
    throw=f"{HALF_FULL}; θ₀ = 0, 30, 60 and 90°",
    why="T/1000 is one time step of the paper.",
)
def _drop_is_later_near_vertical(flights: Flights) -> Iterator[Reading]:
    drops = flights.measured("angle", observe.drop_time, high=number("release-angle"))
    note = ", ".join(f"{drops[angle]:.3f} at {math.degrees(angle):.0f}°" for angle in sorted(drops))
    name = "by how much each smaller θ₀ drops later, the least"
    yield Reading(name, _least_delay(drops), "of T", at_least(ONE_STEP), note=note)


@states(
    "aspect-ratio",
    place="section 5, Fig. 8c",
    says="The aspect ratio, at one volume, leaves the curves nearly superimposed.",
    means="All curves stay within 0.05 ω₀ (root mean square) of that of the paper's bottle; L/2R from 2 to 7.",
    throw=f"{HALF_FULL}; the text names no aspect ratio",
    why=SUPERIMPOSED_WHY,
)
def _aspect_ratio_does_not_matter(flights: Flights) -> Iterator[Reading]:
    bottle = paper_throw().bottle
    own = flights.at("aspect", bottle.length / (2 * bottle.radius))
    off = flights.measured("aspect", lambda run: observe.distance(run, own))
    worst, most = max(off.items(), key=itemgetter(1))
    name = "largest distance from the curve of the paper's bottle"
    yield Reading(name, most, OMEGA, at_most(SUPERIMPOSED), note=f"at L / 2R = {worst:g}")


OF_RELEASE: Final = (_release_spin, _spin_scale)
"""Statements that no figure shows, in the order of the paper."""

OF_THROWS: Final = (
    _fast_spin_changes_only_time,
    _slow_spin_is_not_monotonic,
    _angle_hardly_matters,
    _drop_is_later_near_vertical,
    _aspect_ratio_does_not_matter,
)
"""Statements on Fig. 8, in the order of the paper."""
