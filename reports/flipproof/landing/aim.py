"""The throw that a bottle lands from upright: what is not given is solved for.

Family A throws at the omega_0 given and solves for the height of the table; family B keeps the time of flight and
solves for omega_0. Between release and touch nothing but its water decides how far a bottle turns: its
flight has no table and no scatter.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Final

import numpy as np

from ode_reference import turn
from slicemodel import Scenario

FAMILIES: Final[Mapping[str, str]] = MappingProxyType({"A": "ω₀ as thrown", "B": "time of flight as thrown"})
"""Family of throws -> what all its bottles share."""

LONGEST: Final = 2.0
"""Longest flight of family A [s]."""

FASTEST: Final = 60.0
"""Largest omega_0 of family B [rad/s]."""

SPARE: Final = 1.0
"""Time that scattered throws are given beyond the aimed flight [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Aim:
    """A throw and the height of the table [m] on which it touches down at ``time`` [s] with the angle aimed at."""

    throw: Scenario
    height: float
    time: float


def aimed(throw: Scenario, family: str, offset: float = 0.0) -> Aim:
    """Return the throw whose lowest rim is at the height of the table ``offset`` [rad] beyond the next upright angle.

    A bottle whose rim turns faster than the bottle falls, omega R > |v_y|, has met such a table a moment before: ice
    of family A does.

    Raises
    ------
    ValueError
        If no omega_0, or no time, gives that angle; or if the bottle does not turn forwards, or nothing pulls it down.
    """
    if family not in FAMILIES:
        raise ValueError(f"family = {family!r} is unknown (admissible: {', '.join(FAMILIES)})")
    if throw.gravity <= 0.0:
        raise ValueError(f"gravity = {throw.gravity:g} m/s^2 is outside (0, inf): nothing lands without it")
    goal = math.tau * (math.floor(throw.theta0 / math.tau) + 1) + offset
    if not goal > throw.theta0:
        raise ValueError(
            f"offset = {math.degrees(offset):g} degrees aims at {math.degrees(goal):g} degrees, which is not beyond "
            f"theta0 = {math.degrees(throw.theta0):g} degrees"
        )
    return _by_height(throw, goal) if family == "A" else _by_spin(throw, goal)


def _by_height(throw: Scenario, goal: float) -> Aim:
    if not throw.omega0 > 0.0:
        raise ValueError(f"omega0 = {throw.omega0:g} rad/s is outside (0, inf): the aim is a turn forwards")
    t, theta, rim = turn(replace(throw, duration=LONGEST), 1e-3)
    reached = np.flatnonzero(theta >= goal)
    if not reached.size:
        raise ValueError(
            f"theta stays below {math.degrees(theta.max()):.0f} degrees for {LONGEST:g} s at omega0 = {throw.omega0:g} "
            f"rad/s and fill fraction {throw.fill_fraction:g}; the aim is {math.degrees(goal):.0f} degrees"
        )
    k = int(reached[0])
    share = (goal - theta[k - 1]) / (theta[k] - theta[k - 1])
    time = float(t[k - 1] + share * (t[k] - t[k - 1]))
    height = float(rim[k - 1] + share * (rim[k] - rim[k - 1]))
    return Aim(throw=replace(throw, duration=time + SPARE), height=height, time=time)


def _by_spin(throw: Scenario, goal: float) -> Aim:
    """Halve 24 times the first interval, of a grid of 2 rad/s, in which a throw turns far enough."""
    slow, farthest = 0.0, -math.inf
    for fast in np.arange(2.0, FASTEST + 1.0, 2.0).tolist():
        angle = _end(throw, fast)[0]
        farthest = max(farthest, angle)
        if angle >= goal:
            break
        slow = fast
    else:
        raise ValueError(
            f"theta({throw.duration:g} s) stays below {math.degrees(farthest):.0f} degrees up to omega0 = {FASTEST:g} "
            f"rad/s at fill fraction {throw.fill_fraction:g}; the aim is {math.degrees(goal):.0f} degrees"
        )
    for _ in range(24):
        middle = (slow + fast) / 2
        slow, fast = (slow, middle) if _end(throw, middle)[0] >= goal else (middle, fast)
    spun = replace(throw, omega0=fast, duration=throw.duration + SPARE)
    return Aim(throw=spun, height=_end(throw, fast)[1], time=throw.duration)


@lru_cache(maxsize=256)
def _end(throw: Scenario, omega0: float) -> tuple[float, float]:
    """Return angle [rad] and height of the lowest rim [m] at the end of a flight; the grid's serve every offset."""
    _, theta, rim = turn(replace(throw, omega0=omega0), throw.duration)
    return float(theta[-1]), float(rim[-1])
