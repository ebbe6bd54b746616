"""Throws that scatter about an aim, each by its own seed, and the interval of a share."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Final

import numpy as np

from slicemodel import Scenario
from slicemodel.scenario import MOST, _Checks

Z: Final = 1.959963984540054
"""Half width of a 95 % interval of the normal distribution, in standard deviations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter:
    """Standard deviations of a thrower. None was found measured: they are assumed, and are said beside every share.

    Parameters
    ----------
    spin : float - of omega_0, share of itself [1]
    angle : float - of theta_0 [rad]
    speed : float - of the upward launch velocity [m/s]
    """

    spin: float = 0.05
    angle: float = math.radians(5.0)
    speed: float = 0.1

    def __post_init__(self) -> None:
        checks = _Checks("scatter.")
        for name, unit in (("spin", ""), ("angle", "rad"), ("speed", "m/s")):
            checks.number(name, getattr(self, name), unit, least=0.0, most=MOST)
        checks.refuse()

    def times(self, factor: float) -> Scatter:
        """Return the same, all ``factor`` times as large."""
        return Scatter(spin=factor * self.spin, angle=factor * self.angle, speed=factor * self.speed)


def scattered(throw: Scenario, scatter: Scatter, seed: tuple[int, ...]) -> Scenario:
    """Return a throw about ``throw`` that depends on nothing but its seed.

    It is made of the raw bits of PCG64, which NumPy promises to keep, and not of its distributions, which it does not.

    Raises
    ------
    ScenarioError
        If no bottle can be thrown so.
    """
    bits = np.random.PCG64(np.random.SeedSequence(seed)).random_raw(3) >> np.uint64(11)
    spin, angle, speed = (NormalDist().inv_cdf((float(b) + 0.5) * 2.0**-53) for b in bits)
    v_x, v_y = throw.launch_velocity
    return replace(
        throw,
        omega0=throw.omega0 * (1.0 + scatter.spin * spin),
        theta0=throw.theta0 + scatter.angle * angle,
        launch_velocity=(v_x, v_y + scatter.speed * speed),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """How many of ``throws`` ended upright, and how many nobody can tell; the 95 % interval counts those both ways."""

    upright: int
    undecided: int
    throws: int

    @property
    def value(self) -> float:
        """Share of the decided throws that ended upright; NaN if none was decided."""
        decided = self.throws - self.undecided
        return self.upright / decided if decided else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval, 95 %, with the undecided counted as fallen at its low end and as upright at its high."""
        if not self.throws:
            return 0.0, 1.0
        return wilson(self.upright, self.throws)[0], wilson(self.upright + self.undecided, self.throws)[1]

    def minus(self, other: Share) -> tuple[float, float, float]:
        """Return the difference of two shares and its 95 % interval (Newcombe's, of two Wilson intervals)."""
        difference = self.value - other.value
        (low, high), (other_low, other_high) = self.interval, other.interval
        return (
            difference,
            difference - math.hypot(self.value - low, other_high - other.value),
            difference + math.hypot(high - self.value, other.value - other_low),
        )


def wilson(count: int, throws: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share of ``throws``."""
    share, z = count / throws, Z * Z
    middle = (share + z / (2 * throws)) / (1 + z / throws)
    half = Z * math.sqrt(share * (1 - share) / throws + z / (4 * throws * throws)) / (1 + z / throws)
    # Rounding must not put the ends beyond what is possible.
    return (0.0 if count == 0 else middle - half), (1.0 if count == throws else middle + half)
