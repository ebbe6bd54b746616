"""What section 6 says about the landing: toppling angle and velocity of the centre of mass (Fig. 9)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Final

from flipproof.frame.findings import Finding
from flipproof.paper.observe import Flights, MissingFlightError
from flipproof.paper.parameters import paper_throw
from flipproof.paper.statements import Reading
from slicemodel import Bottle, Trajectory
from slicemodel.landing import Moment, moment_at, next_upright
from slicemodel.observables import centre_of_mass_at_rest, static_toppling_angle

PEAK_DEGREES: Final = (44.9, 45.5)
"""The paper's 45 degrees: 45.2 within 0.3."""

PEAK_FILLING: Final = (0.13, 0.15)

ABOVE: Final = 0.75
"""Filling above which the paper finds the dynamic angle in agreement with the static one."""

AGREEMENT: Final = 3.0
"""Degrees within which two toppling angles agree: a twentieth of the axis of Fig. 9b."""

FALLING: Final = 0.2
"""Speed of the centre of mass that counts [m/s]."""

FALLING_FILLINGS: Final = (0.25, 0.6)

When = Callable[[Trajectory], Moment]


def upright(run: Trajectory) -> Moment:
    """Return the flight where it stands upright, theta = 2 pi.

    Raises
    ------
    MissingFlightError
        If it does not turn that far.
    """
    moment = next_upright(run)
    if moment is None:
        filling, duration = run.scenario.fill_fraction, run.scenario.duration
        raise MissingFlightError(f"M̃ = {filling:g} does not reach θ = 2π in {duration:g} s")
    return moment


def at_landing_time(run: Trajectory) -> Moment:
    """Return the flight at the paper's time of landing."""
    return moment_at(run, paper_throw().duration)


@cache
def toppling_peak() -> tuple[float, float]:
    """Return filling and angle [rad] at which Eq. 13b has its maximum, found by optimisation."""
    from scipy.optimize import minimize_scalar

    throw = paper_throw()

    def lowered(filling: float) -> float:
        return -static_toppling_angle(replace(throw, water_mass=filling * throw.bottle.capacity, n_slices=1))

    found = minimize_scalar(lowered, bounds=(1e-3, 1.0), method="bounded", options={"xatol": 1e-9})
    return float(found.x), -float(found.fun)


def claim_toppling_peak(flights: Flights) -> tuple[Reading, ...]:
    """At rest the toppling angle has its maximum of 45 degrees at a filling of 0.14."""
    del flights
    filling, angle = toppling_peak()
    return (
        Reading(name="filling of the largest θ_c, Eq. 13b", value=filling, unit="", admissible=PEAK_FILLING),
        Reading(name="largest θ_c, Eq. 13b", value=math.degrees(angle), unit="°", admissible=PEAK_DEGREES),
    )


def lowered_by(run: Trajectory, when: When = upright) -> float:
    """Return by how much the toppling angle lies below the one at rest [degrees]."""
    return math.degrees(static_toppling_angle(run.scenario) - when(run).toppling_angle)


def claim_dynamic_angle_is_lower(flights: Flights, when: When = upright) -> tuple[Reading, ...]:
    """Up to a filling of 0.75 the bottle in flight topples at a smaller angle than at rest."""
    lower = {case.value: lowered_by(run, when) for case, run in flights.members("long") if case.value <= ABOVE}
    least = min(lower, key=lambda filling: lower[filling])
    above = [f"{filling:g}" for filling, value in lower.items() if value <= 0.0]
    return (
        Reading(
            name="static minus dynamic θ_c, the least up to M̃ = 0.75",
            value=lower[least],
            unit="°",
            admissible=(0.0, math.inf),
            note=f"at M̃ = {least:g}; " + (f"not lower at {', '.join(above)}" if above else "lower at all fillings"),
        ),
    )


def claim_dynamic_angle_agrees_when_full(flights: Flights, when: When = upright) -> tuple[Reading, ...]:
    """Above a filling of 0.75 the bottle in flight topples at the angle at rest."""
    off = {case.value: abs(lowered_by(run, when)) for case, run in flights.members("long") if case.value > ABOVE}
    worst = max(off, key=lambda filling: off[filling])
    return (
        Reading(
            name="largest difference of static and dynamic θ_c above M̃ = 0.75",
            value=off[worst],
            unit="°",
            admissible=(-math.inf, AGREEMENT),
            note=f"at M̃ = {worst:g}",
        ),
    )


def claim_centre_of_mass_falls(flights: Flights, when: When = upright, base: float = 1.0) -> tuple[Reading, ...]:
    """From a filling of 0.25 to 0.6 the centre of mass moves towards the base at more than 0.2 m/s.

    v_CM = dr_CM/dt is positive towards the base, as in the figures. ``base`` is 1 if the paper's negative velocity
    means towards the base, downwards in a bottle that stands, and -1 if it is dr_CM/dt itself.
    """
    low, high = FALLING_FILLINGS
    velocity = {case.value: when(run).v_cm for case, run in flights.members("long") if low <= case.value <= high}
    worst = min(velocity, key=lambda filling: base * velocity[filling])
    return (
        Reading(
            name=f"v_CM towards the base, the {'least' if base > 0 else 'largest'} from M̃ = 0.25 to 0.6",
            value=velocity[worst],
            unit="m/s",
            admissible=(FALLING, math.inf) if base > 0 else (-math.inf, -FALLING),
            note=f"at M̃ = {worst:g}; "
            + ", ".join(f"{v:+.2f} at {filling:g}" for filling, v in velocity.items()).replace("-", "\N{MINUS SIGN}"),
        ),
    )


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
    throw = replace(paper_throw(), water_mass=filling * paper_throw().bottle.capacity, n_slices=1)
    return centre_of_mass_at_rest(throw) - (1.0 - filling) * throw.bottle.length


def claim_filling_of_change() -> Finding:
    """Water at rest reaches up to the centre of mass at the closed form's filling, where Eq. 13b has its maximum."""
    from scipy.optimize import brentq

    closed = filling_of_change(paper_throw().bottle)
    surface = float(brentq(surface_over_centre, 1e-3, 1.0, xtol=1e-12))
    peak, _ = toppling_peak()
    return Finding(
        id="paper-filling-of-change",
        title=f"Water at rest reaches up to the centre of mass at M̃ = {closed:.4f}, where Eq. 13b has its maximum",
        value=max(abs(surface - closed), abs(peak - closed)),
        unit="",
        kind="regression",
        admissible=(0.0, 1e-6),
        note=f"h/L = ε/(1 + ε): {closed:.7f} in closed form, {surface:.7f} where r_CM(0) = L − h, {peak:.7f} by "
        "maximising Eq. 13b. Water that lies higher is thrown towards the cap. Slices may overlap and sink towards the "
        "base first: in free flight the first of them goes over to the cap at 0.13 to 0.14",
    )
