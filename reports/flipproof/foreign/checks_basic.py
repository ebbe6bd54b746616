"""Checks that need no equation: shape, start, repetition, ice, angle, angular momentum, mirror, moving frame."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from flipproof.foreign.answers import Answer
from flipproof.foreign.checking import THROW, Found, Making, NotApplicableError, ask_of, shift, when
from flipproof.foreign.contract import Traits
from slicemodel.observables import moment_of_inertia
from slicemodel.trajectory import FloatArray

ICE: Final = 1e-6
"""Drift of frozen water, fraction of omega_0: the constraint drift of a physics engine; formulas keep it to 1e-12."""

MOMENTUM: Final = 1e-6
"""Relative change of J omega below which a solver conserves it as well as an engine does."""

ANGLE: Final = 2e-4
"""What the rule of trapezia leaves of theta on ``FINE`` times with impacts between them [rad per rad of the flight]."""

FINE: Final = 961

FALL: Final = 3.0
"""Least factor by which a larger change must fall in two levels of refinement to count as a step's own error."""


def check_shape(traits: Traits) -> Making:
    """The solver answers at the times asked, with real, finite numbers of the right shape."""
    (answer,) = yield [ask_of(traits, THROW)]
    return Found(
        holds=True,
        expected="t, theta, omega at the times asked",
        came="; ".join(answer.given),
        facts={"fields": answer.given},
    )


def check_start(traits: Traits) -> Making:
    """At t = 0 the bottle has the angle and the angular velocity of the throw, and the slices their places."""
    ask = ask_of(traits, THROW)
    (answer,) = yield [ask]
    off = {
        "theta": abs(answer.theta[0] - THROW.theta0) / max(1.0, abs(THROW.theta0)),
        "omega": abs(answer.omega[0] / THROW.omega0 - 1.0),
    }
    if answer.r is not None:
        off["r"] = float(np.max(np.abs(answer.r[0] - ask.start))) / THROW.bottle.length
    worst = max(off, key=lambda name: off[name])
    bound = max(1e-12, 8 * traits.epsilon)
    return Found(
        holds=off[worst] <= bound,
        expected=f"theta_0, omega_0 and start within {bound:.1g}",
        came=f"{worst} off by {off[worst]:.2g}",
        where="t = 0 s",
        advice="begin at scenario.theta0, scenario.omega0 and ask.start, with all slices at rest",
    )


def check_determinism(traits: Traits) -> Making:
    """The same ask has the same answer to the last bit, also with another throw in between."""
    ask, other = ask_of(traits, THROW), ask_of(traits, replace(THROW, omega0=-7.0))
    first, _, second = yield [ask, other, ask]
    change = max(float(np.max(np.abs(getattr(first, f) - getattr(second, f)))) for f in ("theta", "omega"))
    return Found(
        holds=change == 0.0,
        expected="the same numbers",
        came="the same numbers" if change == 0.0 else f"numbers that differ by {change:.2g}",
        where="one throw asked twice, another throw between",
        advice="reset all state between asks; seed random numbers",
    )


def check_ice(traits: Traits) -> Making:
    """With frozen water omega stays what it was."""
    ask = ask_of(traits, replace(THROW, frozen=True))
    (answer,) = yield [ask]
    drift = np.abs(answer.omega / THROW.omega0 - 1.0)
    bound = max(ICE, 16 * traits.epsilon)
    return Found(
        holds=float(drift.max()) <= bound,
        expected=f"omega constant within {bound:.1g}",
        came=f"changed by {drift.max():.2g}",
        where=f"scenario.frozen = True, {when(ask.times, drift)}",
        advice="hold every slice where it is when scenario.frozen is true",
        facts={"drift": float(drift.max())},
    )


def check_angle(traits: Traits) -> Making:
    """theta is the integral of omega over time."""
    asks = [ask_of(traits, THROW, level, FINE) for level in ((0, 2) if traits.refined_by else (0,))]
    answers = yield asks
    offs = [np.abs(_integral(a.t, a.omega) - (a.theta - a.theta[0])) for a in answers]
    sizes = [float(off.max()) for off in offs]
    bound = max(ANGLE, 64 * traits.epsilon) * max(1.0, float(np.ptp(answers[0].theta)))
    refined = f", {sizes[-1]:.2g} rad at a quarter of the step" if len(sizes) > 1 else ""
    return Found(
        holds=sizes[0] <= bound or (len(sizes) > 1 and sizes[-1] * FALL <= sizes[0] and sizes[-1] <= 100 * bound),
        expected=f"theta - theta_0 = integral of omega within {bound:.1g} rad, or a change that falls with dt",
        came=f"off by {sizes[0]:.2g} rad{refined}",
        where=when(asks[0].times, offs[0]),
        advice="theta is in radians and advances by omega dt, omega of the same instant",
        facts={"angle": sizes},
    )


def _integral(t: FloatArray, omega: FloatArray) -> FloatArray:
    """Return the integral of omega from t[0], by the rule of trapezia [rad]."""
    parts = np.diff(t) * (omega[1:] + omega[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(parts)])


def check_momentum(traits: Traits) -> Making:
    """J omega is J_0 omega_0 at all times, with J by its definition from the positions of the slices."""
    asks = [ask_of(traits, THROW, level) for level in ((0, 2) if traits.refined_by else (0,))]
    answers = yield asks
    if answers[0].inertia is None:
        raise NotApplicableError("neither r nor inertia is given")
    start = float(moment_of_inertia(THROW, asks[0].start)) * THROW.omega0
    changes = [np.abs(a.inertia * a.omega / start - 1.0) for a in answers if a.inertia is not None]
    sizes = [float(change.max()) for change in changes]
    bound = max(MOMENTUM, 64 * traits.epsilon)
    holds = sizes[0] <= bound or (len(sizes) > 1 and sizes[-1] * FALL <= sizes[0])
    refined = f", {sizes[-1]:.2g} at a quarter of the step" if len(sizes) > 1 else ""
    return Found(
        holds=holds,
        expected=f"J omega constant within {bound:.1g}, or a change that falls with refinement",
        came=f"changed by {sizes[0]:.2g}{refined}",
        where=when(asks[0].times, changes[0]),
        advice="no torque acts about the centre of mass: omega = J_0 omega_0 / J, with J of the same instant",
        facts={"momentum": sizes},
    )


def check_mirror(traits: Traits) -> Making:
    """A throw mirrored left to right has the mirrored flight: -theta, -omega, the same r."""
    mirrored = replace(THROW, theta0=-THROW.theta0, omega0=-THROW.omega0)
    one, other = yield [ask_of(traits, THROW), ask_of(traits, mirrored)]
    change = np.abs(one.omega + other.omega) / abs(THROW.omega0)
    bound = max(1e-9, 1024 * traits.epsilon)  # the launch is not mirrored, and round-off grows with every impact
    return Found(
        holds=float(change.max()) <= bound,
        expected=f"omega -> -omega within {bound:.1g} of omega_0",
        came=f"off by {change.max():.2g}",
        where=when(one.t, change),
        advice="look for abs(omega), a sign of theta, or a place that assumes omega > 0",
    )


def check_moving_frame(traits: Traits) -> Making:
    """A bottle thrown with another velocity, and so seen from a moving frame, turns alike."""
    moved = replace(THROW, launch_velocity=(3.0, -1.0))
    one, other = yield [ask_of(traits, THROW), ask_of(traits, moved)]
    change = shift(one, other, THROW.omega0)
    bound = max(1e-7, 1024 * traits.epsilon)
    return Found(
        holds=change <= bound,
        expected=f"no change beyond {bound:.1g} of omega_0",
        came=f"omega changes by {change:.2g}",
        where="launch_velocity = (3, -1) m/s instead of (0.5, 1.94) m/s",
        advice="nothing inside the bottle may know how fast it flies",
    )


def check_gravity(traits: Traits) -> Making:
    """omega(t) changes with gravity as much as in the declared equation; in free flight not at all."""
    without = replace(THROW, gravity=0.0)
    finer = 1 if traits.refined_by else 0
    asks = [ask_of(traits, THROW), ask_of(traits, without), ask_of(traits, THROW, finer)]
    one, other, refined = yield asks
    measured = shift(one, other, THROW.omega0)
    if traits.equation is None:
        raise NotApplicableError(f"no equation is declared; omega changes by {measured:.2g} of omega_0 with g")
    from flipproof.foreign.place import curve

    expected = _change(curve(traits.equation, THROW, one.t), curve(traits.equation, without, one.t))
    room = max(1e-6, 1024 * traits.epsilon, 4 * shift(one, refined, THROW.omega0))
    return Found(
        holds=abs(measured - expected) <= room and not math.isnan(measured),
        expected=f"omega changes by {expected:.2g} of omega_0, as in {traits.equation}, within {room:.1g}",
        came=f"{measured:.2g}",
        where="g = 9.81 and 0 m/s^2",
        advice="free flight does not feel gravity; Eq. 8 does: compare the weight term with the declared equation",
        facts={"gravity": measured},
    )


def _change(one: Answer, other: Answer) -> float:
    return shift(one, other, THROW.omega0)
