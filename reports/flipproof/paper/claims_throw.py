"""What sections 3 and 5 say of the throw: release, filling (Fig. 7), spin, angle and aspect ratio (Fig. 8)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from operator import itemgetter
from typing import Final

from flipproof.paper import observe
from flipproof.paper.claim import FLAT_WHY, SUPERIMPOSED_WHY, states
from flipproof.paper.observe import FLAT, SUPERIMPOSED, Flights, level, level_by_points
from flipproof.paper.parameters import number, numbers, paper_steps, paper_throw
from flipproof.paper.statements import OMEGA, Read, Reading, Statement, at_least, at_most
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


OF_RELEASE: Final = (_release_spin, _spin_scale)
"""Statements that no figure shows, in the order of the paper."""


# ---------------------------------------------------------------------- fillings

OPTIMUM: Final = (0.2, 0.5)
"""Fillings that the paper finds best, and its range of omega_f / omega_0 there: the same two numbers."""

INTERMEDIATE: Final = (0.2, 0.75)
"""Fillings that count as intermediate: those of the experiment but for 0.1, rounded outwards to the optimum."""

CLEAR: Final = 0.8
"""omega / omega_0 below which a bottle is clearly slower."""

_of_filling: Final = partial(states, throw="α = 0.01 kg/s, β = −0.5, m = 1 g, T = 0.5 s, M̃ as named (Fig. 7)")
SLOW_WHY: Final = "“Slower” is a word of ours for ω below 0.8 ω₀, “not slower” for above 0.9 ω₀."


@_of_filling(
    "plateau-range",
    place="section 5, Fig. 7b",
    says="In most cases ω_f/ω₀ is 0.2 to 0.5 at intermediate fillings.",
    means="So at more than half of the fillings from 0.2 to 0.75; ω_f is the lowest mean over T/50.",
    why="“Most” is more than half; the range is the paper's, the choice of fillings ours.",
)
def _plateau_range(flights: Flights) -> Iterator[Reading]:
    low, high = INTERMEDIATE
    found = flights.measured("filling", level, low, high).values()
    share = sum(OPTIMUM[0] <= value <= OPTIMUM[1] for value in found) / len(found)
    name = f"share of the {len(found)} fillings from {low:g} to {high:g} with ω_f/ω₀ in 0.2 to 0.5"
    note = f"ω_f/ω₀ from {min(found):.3f} to {max(found):.3f}" + _by_points(flights)
    yield Reading(name, share, "", at_least(math.nextafter(0.5, 1.0)), note=note)


def _by_points(flights: Flights) -> str:
    """Return where the paper's average over points and the mean over time differ by more than 0.005 of omega_0."""
    time, points = (flights.measured("filling", read) for read in (level, level_by_points))
    differ = ", ".join(
        f"{points[filling]:.3f} instead of {time[filling]:.3f} at M̃ = {filling:g}"
        for filling in time
        if abs(time[filling] - points[filling]) > 0.005
    )
    return (
        f"; by the paper's points {differ}"
        if differ
        else ("; the paper's average over points agrees with the mean over time")
    )


def _plateau_at(flights: Flights, filling: float, admissible: tuple[float, float]) -> Iterator[Reading]:
    yield Reading(f"ω_f at M̃ = {filling:g}", level(flights.at("filling", filling)), OMEGA, admissible)


_keeps_spin_at: Final = partial(_plateau_at, admissible=at_least(0.9))
_slows_at: Final = partial(_plateau_at, admissible=at_most(CLEAR))


def _about_slowing(id_: str, says: str, place: str = "section 5, Fig. 7a") -> Callable[[Read], Statement]:
    """Return a decorator for a bottle that slows down in the model, a limit that the paper admits."""
    means = "ω_f is at most 0.8 ω₀."
    return _of_filling(id_, place=place, says=says, means=means, why=SLOW_WHY, kind="admitted limit")


_slow_down_when_full: Final = _about_slowing(
    "full-slows",
    "At M̃ = 1 the model slows down, although nothing can slosh.",
    "section 5, Fig. 7a; section 6",
)(partial(_slows_at, filling=1.0))

_slow_down_at_a_tenth: Final = _about_slowing(
    "tenth-slows", "At M̃ = 0.1 the model clearly slows down, unlike the bottle that was thrown."
)(partial(_slows_at, filling=0.1))

_no_slow_down_when_nearly_empty: Final = _of_filling(
    "empty-keeps-spin",
    place="section 5, Fig. 7a",
    says="At M̃ = 0.05 the bottle does not slow down.",
    means="ω_f is at least 0.9 ω₀.",
    why=SLOW_WHY,
)(partial(_keeps_spin_at, filling=0.05))


def filling_of_slow_down(flights: Flights) -> float:
    """Return the least filling with omega_f = 0.8 omega_0, interpolated between flights; NaN if there is none."""
    found = sorted(flights.measured("filling", level).items())
    for (low, above), (high, below) in pairwise(found):
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
def _change_at_low_filling(flights: Flights) -> Iterator[Reading]:
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
def _agreement_is_excellent(flights: Flights) -> Iterator[Reading]:
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
def _best_filling(flights: Flights) -> Iterator[Reading]:
    found = flights.measured("filling", level)
    inside = flights.measured("filling", level, *OPTIMUM)
    best, lowest = min(inside.items(), key=itemgetter(1))
    rival, other = min(((filling, found[filling]) for filling in found if filling not in inside), key=itemgetter(1))
    note = f"{lowest:.3f} at M̃ = {best:g}, {other:.3f} at {rival:g}"
    yield Reading("lowest ω_f outside 0.2 to 0.5 minus lowest inside", other - lowest, OMEGA, at_least(0.0), note=note)


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


# ---------------------------------------------------------------------- throws


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
    levels, drops = (flights.measured("spin", read, low=usual) for read in (level, observe.drop_time))
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


OF_THROWS: Final = (
    _fast_spin_changes_only_time,
    _slow_spin_is_not_monotonic,
    _angle_hardly_matters,
    _drop_is_later_near_vertical,
    _aspect_ratio_does_not_matter,
)
"""Statements on Fig. 8, in the order of the paper."""
