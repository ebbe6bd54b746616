r"""The equation that any set of ``Switches`` makes: one expression, of which every rung of the ladder is a case.

    r_i'' = k^2 s_i + w - d (r_i' - u) - a_c

    k^2 = omega^2 (roots), else omega^2 - gamma^2                             [1/s^2]
    w   = 0 (weightless), else k^2 g cos(theta) / omega^2                     [m/s^2]
    d   = 2 gamma (signs), else 0                                             [1/s]
    u   = r'_CM (drag_on_centre and not origin), else 0                       [m/s]
    a_c = 0 (not origin), else the acceleration of tube and resting slices    [m/s^2]

With ``origin`` the tube gets its own equation of motion, from the same forces that its slices feel. With M_c the mass
of tube and resting slices, n_h of them resting, and -m sum_free s_j = M_c s_c,

    M_c a_c = k^2 M_c s_c + d m sum_free r_j' + n_h m w:

the spring k^2 on the body, the reaction of the drag, the weight of what rests in it. The tube itself has no weight
here, as it has none in Eq. 8, which is an equation of slices only: a weight on everything would cancel and
leave nothing for ``weightless`` to mend. These are forces that a body can feel, so that contact keeps its meaning: the
push on a resting slice changes sign if and only if its acceleration once released would (see ``models.free_flight``).
Where ``weightless`` is on, -a_c is r''_CM, the second derivative of Eq. 10; with weight it is not, because then the
forces do not add up to zero and C_M accelerates in its own frame, which is what is wrong with that weight.

``recoil`` without ``origin`` is an impact law on relative velocities and nothing else: at an impact every r_i' jumps by
the velocity that the tube gains, between impacts nobody knows of the tube.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from functools import cache, lru_cache

import numpy as np

from ode_reference.motion import Acceleration, Model, Throw, accelerated
from ode_reference.switches import Switches
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray

SAMPLE = Scenario(n_slices=6, water_mass=0.37, drag=0.9, omega0=-13.0, theta0=0.7)
"""A throw in which no term of any equation vanishes: a model and its switches are compared in it."""

SAME = 1e-9
"""Largest difference of two accelerations that are the same equation, as a share of the largest acceleration."""

STATES = 24
"""States of a throw in which a model is compared with its switches."""

FLOWN = 257
"""Times of a flight at which a model of somebody else's is compared with its switches."""


@cache
def model_of(switches: Switches) -> Model:
    """Return the model that ``switches`` make, under the name ``switches.name``; equal switches make one model."""
    on = [field.name for field in fields(switches) if getattr(switches, field.name)]
    return Model(
        name=switches.name,
        equation="r_i'' = k^2 (r_i - r_CM) + w - d (r_i' - u) - a_c",
        reason="Published program with " + (", ".join(on) if on else "nothing") + " mended.",
        acceleration=acceleration_of(switches),
        switches=switches,
    )


def acceleration_of(switches: Switches) -> Acceleration:
    """Return the right-hand side that ``switches`` make; its parameters stand in ``Model``."""

    def acceleration(
        throw: Throw, theta: float, omega: float, s: FloatArray, v: FloatArray, free: FloatArray
    ) -> FloatArray:
        gamma = throw.drag_rate / 2
        slowness = np.float64(0.0 if switches.roots else gamma) / omega
        spring = omega * omega - (0.0 if switches.roots else gamma * gamma)
        weight = 0.0 if switches.weightless else (1 - slowness * slowness) * throw.gravity * np.cos(theta)
        damping = throw.drag_rate if switches.signs else 0.0
        common = weight
        if switches.drag_on_centre and not switches.origin:
            common += damping * throw.centre_of_mass_velocity(v)
        if switches.origin:
            common -= _origin(throw, spring, damping, weight, s, v, free)
        rates: FloatArray = s * spring
        rates -= damping * v
        rates += common
        return rates

    return acceleration


def require_own_switches(model: Model, scenario: Scenario) -> None:
    """Check that a model's acceleration is the one that its switches make: the reduced flow knows only the switches.

    The two are compared in ``STATES`` states of ``SAMPLE``, in which no term vanishes, with all, some and none of the
    slices at rest. An acceleration that this package does not define, which may be anything elsewhere, is compared in
    as many states of the throw itself, and in those at ``FLOWN`` times of the flight that the switches make. A term
    that acts in none of these states is not seen.

    Raises
    ------
    ValueError
        If they differ by more than ``SAME``.
    """
    if is_ours(model):
        same = _same_in_sample(model)
    else:
        same = all(_same(model, thrown, _drawn(thrown)) for thrown in (SAMPLE, scenario))
        same = same and _same(model, scenario, _flown(model, scenario))
    if not same:
        raise ValueError(
            f"model = {model.name!r}: its acceleration is not that of its switches, {model.switches.name!r}, which "
            "method 'taylor' solves: register the model with the switches that make its equation "
            "(ode_reference/combinations.py), or, if none do, choose another method, such as 'DOP853'"
        )


def is_ours(model: Model) -> bool:
    """Return whether a model's acceleration is defined in this package."""
    names = getattr(model.acceleration, "__globals__", {})  # which functools.wraps leaves alone, unlike __module__
    return str(names.get("__name__")).partition(".")[0] == __name__.partition(".")[0]


State = tuple[float, FloatArray, FloatArray, FloatArray]
"""theta [rad], r [m], v [m/s] and which slices are free (1.0), the last three of shape (N,)."""


@lru_cache(maxsize=4096)
def _same_in_sample(model: Model) -> bool:
    return _same(model, SAMPLE, _drawn(SAMPLE))


def _same(model: Model, scenario: Scenario, states: Iterable[State]) -> bool:
    throw, by_switches = Throw.of(scenario), replace(model, acceleration=acceleration_of(model.switches))
    for theta, r, v, free in states:
        wanted = accelerated(by_switches, throw, theta, r, v, free)[1]
        if not np.abs(accelerated(model, throw, theta, r, v, free)[1] - wanted).max() <= SAME * np.abs(wanted).max():
            return False
    return True


def _drawn(scenario: Scenario) -> Iterator[State]:
    """Yield ``STATES`` states without a pattern, the same on every machine: sines of whole numbers."""
    throw, n = Throw.of(scenario), scenario.n_slices
    # No bottle turns faster than by its own inertia alone.
    turn = abs(throw.angular_momentum) / throw.bottle_inertia * scenario.duration
    numbers = np.sin(np.arange(1.0, 1.0 + STATES * (2 * n + 1))).reshape(STATES, 2 * n + 1)
    for state, row in enumerate(numbers):
        free = np.where(np.arange(n) < math.ceil(n * (1.0 - state / (STATES - 1))), 1.0, 0.0)
        theta = scenario.theta0 + min(max(4.0, turn), 1e3) * float(row[2 * n])
        speed = (0.2, 2.0, 20.0)[state % 3]
        yield theta, throw.half_length * (1.0 + row[:n]), speed * row[n : 2 * n] * free, free


def _flown(model: Model, scenario: Scenario) -> Iterator[State]:
    """Yield the states of the flight that a model's switches make, at ``FLOWN`` times."""
    from ode_reference.flow import api  # it is not needed to name an equation

    settings = {"model": model.name, "rest_speed": 1e-6, "energy": False}
    flight = api.fly(scenario, np.linspace(0.0, scenario.duration, FLOWN), model.switches, settings)
    for theta, r, v in zip(flight.theta, flight.r, flight.v, strict=True):
        yield float(theta), r, v, np.where((v == 0.0) & ((r <= scenario.r_min) | (r >= scenario.r_max)), 0.0, 1.0)


def _origin(
    throw: Throw, spring: float, damping: float, weight: float, s: FloatArray, v: FloatArray, free: FloatArray
) -> float:
    """Return a_c, the acceleration of tube and resting slices in the frame of C_M [m/s^2]."""
    m, free_count = throw.slice_mass, float(free.dot(free))
    force = m * (-spring * float(s.dot(free)) + damping * float(v.dot(free)) + (len(s) - free_count) * weight)
    return force / (throw.total_mass - m * free_count)
