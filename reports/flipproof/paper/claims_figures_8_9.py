"""What sections 5 and 6 say of the throw (Fig. 8) and of the landing (Fig. 9)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import pairwise
from operator import itemgetter
from typing import Final

from flipproof.frame.findings import Finding, regression
from flipproof.frame.solvers import Missing
from flipproof.paper import observe
from flipproof.paper.cases import number, numbers, paper_steps, paper_throw
from flipproof.paper.observe import FLAT, FLAT_WHY, SUPERIMPOSED, SUPERIMPOSED_WHY, CaseFlights
from flipproof.paper.statements import OMEGA, Reading, at_least, at_most, states
from slicemodel import Bottle, Trajectory
from slicemodel.landing import Moment, moment_at, next_upright
from slicemodel.observables import centre_of_mass_at_rest, static_toppling_angle

ONE_STEP: Final = 1.0 / (paper_steps() - 1)
"""One time step of the paper as a share of the flight: the least that counts as a difference in time."""

HALF_FULL: Final = "half full, α = 0.01 kg/s, β = −0.5"

# ---------------------------------------------------------------------- throw (Fig. 8)


@states(
    "fast-spin",
    place="section 5, Fig. 8a",
    says="ω₀ > 20 rad/s does not affect the final ω/ω₀, only the time to it.",
    means="ω_f/ω₀ changes by at most 0.05, and each faster spin drops earlier by at least T/1000.",
    throw=f"{HALF_FULL}; 20, 25 and 30 rad/s",
    why=f"{SUPERIMPOSED_WHY} T/1000 is one time step of the paper.",
)
def _fast_spin_changes_only_time(flights: CaseFlights) -> Iterator[Reading]:
    usual = number("release-spin")
    levels, drops = (flights.measured("spin", read, low=usual) for read in (observe.level, observe.drop_time))
    change = {spin: abs(levels[spin] - levels[usual]) for spin in sorted(levels)}
    worst, max_change = max(change.items(), key=itemgetter(1))
    note = f"at {worst:g} rad/s"
    yield Reading("largest change of ω_f/ω₀ above 20 rad/s", max_change, OMEGA, at_most(SUPERIMPOSED), note=note)
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
def _slow_spin_is_not_monotonic(flights: CaseFlights) -> Iterator[Reading]:
    for spin in numbers("figure-8a-spin"):
        if 10.0 <= spin < number("release-spin"):
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
    flights: CaseFlights, apart: Callable[[Trajectory, Trajectory], float] = observe.shape_distance
) -> Iterator[Reading]:
    usual = flights.at("angle", number("release-angle"))
    distances = flights.measured("angle", lambda run: apart(run, usual))
    worst, max_distance = max(distances.items(), key=itemgetter(1))
    note = f"at θ₀ = {math.degrees(worst):.0f}°"
    yield Reading("largest distance from the curve of π/2", max_distance, OMEGA, at_most(SUPERIMPOSED), note=note)


@states(
    "drop-later",
    place="section 5, Fig. 8b",
    says="The nearer to the vertical the release, the later the drop.",
    means="From π/2 down, each smaller θ₀ puts half the drop off by at least T/1000.",
    throw=f"{HALF_FULL}; θ₀ = 0, 30, 60 and 90°",
    why="T/1000 is one time step of the paper.",
)
def _drop_is_later_near_vertical(flights: CaseFlights) -> Iterator[Reading]:
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
def _aspect_ratio_does_not_matter(flights: CaseFlights) -> Iterator[Reading]:
    bottle = paper_throw().bottle
    paper_run = flights.at("aspect", bottle.length / (2 * bottle.radius))
    distances = flights.measured("aspect", lambda run: observe.distance(run, paper_run))
    worst, max_distance = max(distances.items(), key=itemgetter(1))
    name = "largest distance from the curve of the paper's bottle"
    yield Reading(name, max_distance, OMEGA, at_most(SUPERIMPOSED), note=f"at L / 2R = {worst:g}")


# ---------------------------------------------------------------------- landing (Fig. 9)

LONG: Final = "throws of Fig. 7, flown on to 1.2 s"
ON_LANDING: Final = "at t = 0.5 s instead of θ = 2π"

When = Callable[[Trajectory], Moment]


def upright(run: Trajectory) -> Moment:
    """Return the flight where it stands upright, theta = 2 pi; raises Missing if it does not turn that far."""
    moment = next_upright(run)
    if moment is None:
        filling, duration = run.scenario.fill_fraction, run.scenario.duration
        raise Missing(f"M̃ = {filling:g} does not reach θ = 2π in {duration:g} s")
    return moment


def at_landing_time(run: Trajectory) -> Moment:
    """Return the flight at the paper's time of landing."""
    return moment_at(run, paper_throw().duration)


@cache
def toppling_peak() -> tuple[float, float]:
    """Return filling and angle [rad] at which Eq. 13b has its maximum, found by optimisation."""
    from scipy.optimize import minimize_scalar

    def lowered(filling: float) -> float:
        return -static_toppling_angle(paper_throw(filling))

    minimum = minimize_scalar(lowered, bounds=(1e-3, 1.0), method="bounded", options={"xatol": 1e-9})
    return float(minimum.x), -float(minimum.fun)


@states(
    "toppling-peak",
    place="section 6, Eq. 13b, Fig. 9b",
    says="At rest θ_c is largest, 45°, at M̃ = 0.14.",
    means="The maximum of Eq. 13b is 45.2 ± 0.3° at 0.14 ± 0.01.",
    throw="water at rest",
    why="The last digits that the paper prints.",
    of_geometry=True,
)
def _toppling_peak(_: CaseFlights) -> Iterator[Reading]:
    filling, angle = toppling_peak()
    yield Reading("filling of the largest θ_c, Eq. 13b", filling, "", (0.13, 0.15))
    yield Reading("largest θ_c, Eq. 13b", math.degrees(angle), "°", (44.9, 45.5))


def lowered_by(run: Trajectory, when: When = upright) -> float:
    """Return by how much the toppling angle lies below the one at rest [degrees]."""
    return math.degrees(static_toppling_angle(run.scenario) - when(run).toppling_angle)


@states(
    "dynamic-lower",
    place="section 6, Fig. 9b",
    says="In flight θ_c is lower than at rest, except above 0.75.",
    means="With r_CM at θ = 2π it is, at all fillings up to 0.75.",
    throw=LONG,
    why="The sentence is a comparison: its threshold is zero.",
    otherwise={ON_LANDING: {"when": at_landing_time}},
)
def _dynamic_angle_is_lower(flights: CaseFlights, when: When = upright) -> Iterator[Reading]:
    lower = flights.measured("long", partial(lowered_by, when=when), high=0.75)
    at, min_lowering = min(lower.items(), key=itemgetter(1))
    above = ", ".join(f"{filling:g}" for filling, value in lower.items() if value <= 0.0)
    note = f"at M̃ = {at:g}; " + (f"not lower at {above}" if above else "lower at all fillings")
    yield Reading("static minus dynamic θ_c, the least up to M̃ = 0.75", min_lowering, "°", at_least(0.0), note=note)


@states(
    "dynamic-agrees",
    place="section 6, Fig. 9b",
    says="Above 0.75 the two agree well.",
    means="With r_CM at θ = 2π they differ by at most 3°.",
    throw=f"{LONG}; M̃ = 0.9 and 1",
    why="3° is a choice of ours: a twentieth of the axis of Fig. 9b.",
    otherwise={ON_LANDING: {"when": at_landing_time}},
)
def _dynamic_angle_agrees_when_full(flights: CaseFlights, when: When = upright) -> Iterator[Reading]:
    differences = flights.measured("long", lambda run: abs(lowered_by(run, when)), low=0.9)
    at, max_difference = max(differences.items(), key=itemgetter(1))
    name = "largest difference of static and dynamic θ_c above M̃ = 0.75"
    yield Reading(name, max_difference, "°", at_most(3.0), note=f"at M̃ = {at:g}")


@states(
    "landing-velocity",
    place="section 6, Fig. 9c",
    says="On landing v_CM is negative and beyond 0.2 m/s for M̃ from 0.25 to 0.6.",
    means="At θ = 2π the centre of mass moves in the bottle towards its base at more than 0.2 m/s: downwards, as "
    "the argument about descending water needs it. v_CM = dr_CM/dt, positive towards the base here and in Fig. 9c.",
    throw=f"{LONG}; M̃ from 0.25 to 0.6",
    why="Speed and range are the paper's.",
    otherwise={
        ON_LANDING: {"when": at_landing_time},
        "as negative dr_CM/dt, towards the cap, at θ = 2π": {"base": -1.0},
        "as negative dr_CM/dt at t = 0.5 s": {"base": -1.0, "when": at_landing_time},
    },
)
def _centre_of_mass_falls(flights: CaseFlights, when: When = upright, base: float = 1.0) -> Iterator[Reading]:
    velocity = flights.measured("long", lambda run: when(run).v_cm, 0.25, 0.6)
    worst = min(velocity, key=lambda filling: base * velocity[filling])
    all_ = ", ".join(f"{v:+.2f} at {filling:g}" for filling, v in velocity.items()).replace("-", "\N{MINUS SIGN}")
    name = f"v_CM towards the base, the {'least' if base > 0 else 'largest'} from M̃ = 0.25 to 0.6"
    admissible = at_least(0.2) if base > 0 else at_most(-0.2)
    yield Reading(name, velocity[worst], "m/s", admissible, note=f"at M̃ = {worst:g}; {all_}")


# ---------------------------------------------------------------------- from which filling on water leaves the base


def filling_of_change(bottle: Bottle) -> float:
    """Return the filling at which the surface of the resting water stands as high as the centre of mass.

    Below it all water lies on the base's side of the centre of mass and is thrown towards the base; above it the top
    of the water is thrown towards the cap. L - h = r_CM(0) (Eq. 3e) gives h/L = eps / (1 + eps); with
    eps = b / (b + M), b = M_b / M_max (Eq. 4a) and h/L = M that is M^2 + 2 b M - b = 0.
    """
    share = bottle.mass / bottle.capacity
    return math.sqrt(share * (1.0 + share)) - share


def surface_over_centre(filling: float) -> float:
    """Return by how much the surface of the resting water is nearer to the cap than the centre of mass [m]."""
    throw = paper_throw(filling)
    return centre_of_mass_at_rest(throw) - (1.0 - filling) * throw.bottle.length


def claim_filling_of_change() -> Finding:
    """Water at rest reaches up to the centre of mass at the closed form's filling, where Eq. 13b has its maximum."""
    from scipy.optimize import brentq

    closed = filling_of_change(paper_throw().bottle)
    surface = float(brentq(surface_over_centre, 1e-3, 1.0, xtol=1e-12))
    peak, _ = toppling_peak()
    title = f"Water at rest reaches up to the centre of mass at M̃ = {closed:.4f}, where Eq. 13b has its maximum"
    note = (
        f"h/L = ε/(1 + ε): {closed:.7f} in closed form, {surface:.7f} where r_CM(0) = L − h, {peak:.7f} by "
        "maximising Eq. 13b. Water that lies higher is thrown towards the cap. Slices may overlap and sink towards the "
        "base first: in free flight the first of them goes over to the cap at 0.13 to 0.14"
    )
    error = max(abs(surface - closed), abs(peak - closed))
    return regression("paper-filling-of-change", title, error, "", (0.0, 1e-6), note)
