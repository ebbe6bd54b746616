"""Cases with an exact solution: what any integrator of the equations must reproduce, and to how many digits.

Each ``case_*`` takes the name of a model and returns an ``ExactCase``; ``CASES`` lists them all. Most live in a tube
too heavy to feel the water (``ode_reference.heavy_tube``), where the slices are independent of each other; the
symmetric pair and the elliptic case hold in a free bottle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.integrate import quad

from ode_reference.elliptic import spread_from_rest
from ode_reference.heavy_tube import Flight, Hits, history
from ode_reference.models import MODELS
from slicemodel.scenario import Bottle, Scenario
from slicemodel.trajectory import BASE, CAP, FloatArray, Impacts

HEAVY: Final = 1e15
"""Mass of a tube that the water cannot move [kg]: M_w/M_b is below round-off."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExactCase:
    """A scenario with its exact solution at chosen times, none of which is the time of an impact.

    Parameters
    ----------
    name, model : str
    scenario : Scenario
    rest_speed : float - with which the case is to be solved [m/s]
    t : (P,) [s], theta : (P,) [rad], omega : (P,) [rad/s], r : (P, N) [m], v : (P, N) [m/s]
    impacts : Impacts - all of them up to the duration
    tolerance : float
        Admissible error of the states, as a fraction of L for r, of |omega_0| L for v, of |omega_0| for omega and
        of 1 rad for theta.
    impact_tolerance : float
        The same for impacts, as a fraction of 1/|omega_0| for times and of |omega_0| L for speeds.
    reason : str - where the tolerances come from
    """

    name: str
    model: str
    scenario: Scenario
    rest_speed: float = 1e-5
    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    r: FloatArray
    v: FloatArray
    impacts: Impacts
    tolerance: float = 1e-12
    impact_tolerance: float = 1e-10
    reason: str = (
        "states: round-off, both sides are exact to about 1e-15 a step; impacts: a flight at 1e-5 m/s rises "
        "1e-12 m, so that round-off of 1e-16 m in r moves its end by 1e-11 s"
    )


def _heavy_tube(name: str, model: str, scenario: Scenario, points: int) -> ExactCase:
    """Return the case of independent slices in a heavy tube, at ``points`` times that no impact shares."""
    rest_speed = 1e-5
    t = np.linspace(0.0, scenario.duration, points)
    r, v = np.empty((len(t), scenario.n_slices)), np.empty((len(t), scenario.n_slices))
    hits: Hits = []
    for i in range(scenario.n_slices):
        pieces, slice_hits = history(model, scenario, i, rest_speed)
        hits += slice_hits
        for p, time in enumerate(t):
            motion = [move for begins, move in pieces if begins <= time][-1]
            r[p, i], v[p, i] = motion(float(time))
    return ExactCase(
        name=name,
        model=model,
        scenario=scenario,
        rest_speed=rest_speed,
        t=t,
        theta=scenario.theta0 + scenario.omega0 * t,
        omega=np.full(len(t), scenario.omega0),
        r=r + scenario.bottle.length / 2,
        v=v,
        impacts=_impacts(hits),
    )


def _impacts(hits: Sequence[tuple[float, int, int, float, float]]) -> Impacts:
    columns = list(zip(*sorted(hits), strict=True)) or [()] * 5
    return Impacts(*(np.array(column) for column in columns))


# ---------------------------------------------------------------------- the cases


def case_ice(model: str = "eq8") -> ExactCase:
    """Return the frozen bottle: no slice moves, omega is constant and theta linear, for every model."""
    scenario = Scenario(n_slices=50, drag=0.1, frozen=True)
    t = np.linspace(0.0, scenario.duration, 101)
    return ExactCase(
        name="ice",
        model=model,
        scenario=scenario,
        t=t,
        theta=scenario.theta0 + scenario.omega0 * t,
        omega=np.full(len(t), scenario.omega0),
        r=np.tile(scenario.initial_positions(), (len(t), 1)),
        v=np.zeros((len(t), scenario.n_slices)),
        impacts=_impacts([]),
    )


def case_single_slice(model: str = "eq8") -> ExactCase:
    """Return one slice that strikes the base again and again, with drag and no gravity; its neighbour rests there.

    For Eq. 8 each flight is a damped cosh/sinh: x = exp(-gamma t) (A cosh(w t) + B sinh(w t)), w^2 = omega^2 + gamma^2.
    """
    scenario = Scenario(
        bottle=Bottle(mass=HEAVY), water_mass=0.5, n_slices=2, drag=2.5, gravity=0.0, restitution=0.6, duration=0.2
    )
    return _heavy_tube("single slice", model, scenario, 61)


def case_driven_slices(model: str = "eq8") -> ExactCase:
    """Return seven slices that fall along the turning axis, drag and rebound."""
    scenario = Scenario(
        bottle=Bottle(mass=HEAVY), water_mass=0.7, n_slices=7, drag=1.0, theta0=0.4, omega0=12.0, duration=0.15
    )
    return _heavy_tube("driven slices", model, scenario, 61)


def case_sticking(model: str = "eq8") -> ExactCase:
    """Return ten slices with e = 0, half near each end: each stops at its first impact and stays."""
    scenario = Scenario(
        bottle=Bottle(mass=HEAVY), water_mass=0.9, n_slices=10, drag=0.45, gravity=0.0, restitution=0.0, duration=0.3
    )
    return _heavy_tube("sticking", model, scenario, 61)


def case_release(model: str = "eq8") -> ExactCase:
    """Return one slice that rests on the base until gravity wins, falls to the cap, and is released there in turn.

    It leaves when k X + G cos(theta) = 0, that is cos(theta) = -omega^2 X / g for either model.
    """
    scenario = Scenario(
        bottle=Bottle(mass=HEAVY),
        water_mass=0.1,
        n_slices=1,
        drag=0.1,
        restitution=0.0,
        omega0=6.0,
        theta0=0.3,
        duration=1.6,
    )
    return _heavy_tube("release", model, scenario, 61)


def case_zeno(model: str = "eq8") -> ExactCase:
    """Return one slice whose rebounds accumulate on the base, drag and gravity absent, known impact by impact.

    Energy gives back e u after each flight, and x = X cosh(w s) - (e u / w) sinh(w s) = X again at
    s = (2/w) artanh(e u / (w X)), w = omega_0; the sum over all flights is finite. The slice rests once e u is
    below the rest speed.
    """
    scenario = Scenario(
        bottle=Bottle(mass=HEAVY), water_mass=0.5, n_slices=2, drag=0.0, gravity=0.0, restitution=0.5, duration=0.25
    )
    rest_speed = 1e-5
    w, half = scenario.omega0, scenario.bottle.length / 2
    wall, start = scenario.r_max - half, float(scenario.initial_positions()[1]) - half
    time = math.acosh(wall / start) / w
    speed = w * math.sqrt(wall**2 - start**2)
    hits: Hits = []
    bounds, flights = [0.0], [Flight(0.0, w**2, 0.0, 0.0, w, 0.0, start, 0.0)]
    while True:
        after = scenario.restitution * speed
        rests = after < rest_speed
        hits.append((time, 1, BASE, speed, 0.0 if rests else after))
        if rests:
            break
        bounds.append(time)
        flights.append(Flight(0.0, w**2, 0.0, 0.0, w, time, wall, -after))
        time += 2 / w * math.atanh(after / (w * wall))
        speed = after
    t = np.sort(np.concatenate([np.linspace(0.0, scenario.duration, 51), [time + 1e-9]]))
    moving = [
        flights[int(np.searchsorted(bounds, now, side="right")) - 1](now) if now < time else (wall, 0.0) for now in t
    ]
    x, v = np.array(moving).T
    return ExactCase(
        name="Zeno",
        model=model,
        scenario=scenario,
        rest_speed=rest_speed,
        t=t,
        theta=scenario.theta0 + w * t,
        omega=np.full(len(t), w),
        r=np.column_stack([np.full(len(t), wall), x]) + half,
        v=np.column_stack([np.zeros(len(t)), v]),
        impacts=_impacts(hits),
    )


def case_symmetric_pair(model: str = "eq8") -> ExactCase:
    """Return four slices in a full, free bottle: two rest on the ends, two fly apart and strike both ends at once.

    r_CM stays at L/2, so that with x the distance of the flying pair from it and J = J_b + 2 m X^2 + 2 m x^2

        m x'^2 + (J_0 omega_0)^2 / 2J + gamma'^2 J / 2 = constant,   gamma' = gamma for published-limit, else 0

    (derivative: 2 m x'' = 2 m (omega^2 - gamma'^2) x). The time follows by quadrature, t = integral of dx / x'.
    The published limit keeps gamma, since it damps nothing; every other model is taken without drag. The symmetry
    leaves the tube at rest, so that origin and recoil make no difference.
    """
    gamma = 5.0 if model == "published-limit" else 0.0
    scenario = Scenario(water_mass=1.0, n_slices=4, drag=2 * gamma * 0.25, gravity=0.0, restitution=0.5)
    bottle, m = scenario.bottle, scenario.slice_mass
    wall, start = scenario.r_max - bottle.length / 2, float(scenario.initial_positions()[1]) - bottle.length / 2
    fixed = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12) + 2 * m * wall**2
    momentum = (fixed + 2 * m * start**2) * scenario.omega0

    def speed_over_root(x: float) -> float:
        """Return x' / sqrt(x - x_0): the difference of potentials divided by x - x_0 before anything cancels."""
        j, j0 = fixed + 2 * m * x**2, fixed + 2 * m * start**2
        return math.sqrt((x + start) * (momentum**2 / (j * j0) - gamma**2))

    def time_at(x: float) -> float:
        # x = x_0 + u^2 takes the integrable singularity at rest out of the integrand
        value, _ = quad(lambda u: 2 / speed_over_root(start + u * u), 0.0, math.sqrt(x - start), epsabs=0, epsrel=1e-13)
        return float(value)

    x = np.linspace(start, wall, 13)[:-1]
    speed = np.array([speed_over_root(place) * math.sqrt(place - start) for place in x])
    t = np.array([time_at(place) for place in x])
    inertia = fixed + 2 * m * x**2
    strike, strike_speed = time_at(wall), speed_over_root(wall) * math.sqrt(wall - start)

    def angle_at(x: float) -> float:
        def rate(u: float) -> float:
            place = start + u * u
            return 2 * momentum / (fixed + 2 * m * place**2) / speed_over_root(place)

        value, _ = quad(rate, 0.0, math.sqrt(x - start), epsabs=0, epsrel=1e-13)
        return float(value)

    flying = np.column_stack([np.full(len(x), wall), x, -x, np.full(len(x), -wall)])
    moving = np.column_stack([np.zeros(len(x)), speed, -speed, np.zeros(len(x))])
    after = scenario.restitution * strike_speed
    return ExactCase(
        name="symmetric pair",
        model=model,
        scenario=replace(scenario, duration=1.1 * strike),  # no second impact by then
        t=t,
        theta=scenario.theta0 + np.array([angle_at(place) for place in x]),
        omega=momentum / inertia,
        r=flying + bottle.length / 2,
        v=moving,
        impacts=_impacts([(strike, 1, BASE, strike_speed, after), (strike, 2, CAP, strike_speed, after)]),
        tolerance=1e-11,
        impact_tolerance=1e-11,
        reason="quadrature to 1e-13",
    )


def case_elliptic(model: str = "eq8", n_slices: int = 12) -> ExactCase:
    """Return slices that fly from rest, without drag and gravity, until the first meets an end: elliptic integrals.

    Where the tube does not accelerate (no ``origin``) z has a rate of its own, and the bottle is full: z = 0.
    """
    filling = 0.6 if MODELS[model].switches.origin else 1.0
    scenario = Scenario(water_mass=filling, n_slices=n_slices, drag=0.0, gravity=0.0, theta0=0.3)
    t, theta, omega, r, v = spread_from_rest(scenario, 13)
    return ExactCase(
        name=f"elliptic, N = {n_slices}",
        model=model,
        scenario=replace(scenario, duration=float(t[-1]) if len(t) > 1 else 0.1),
        t=t,
        theta=theta,
        omega=omega,
        r=r,
        v=v,
        impacts=_impacts([]),
    )


CASES: Final[tuple[Callable[[str], ExactCase], ...]] = (
    case_ice,
    case_single_slice,
    case_driven_slices,
    case_sticking,
    case_release,
    case_zeno,
    case_symmetric_pair,
    case_elliptic,
)
"""Every exact case; each takes the name of any rung of the ladder."""
