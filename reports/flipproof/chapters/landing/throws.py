"""Which throws a study makes: aimed at a landing upright, scattered each by its own seed, and numbered as a sweep does.

Of the throws of a case a share ends upright; the interval of that share is Wilson's.

Family A throws at the omega_0 given and solves for the height of the table that it meets as it falls; family B keeps
the time of flight and solves for omega_0. Between release and touch nothing but its water decides how far a bottle
turns: its flight has no table and no scatter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import accumulate
from statistics import NormalDist
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from flipproof.chapters.landing.work import MAKER, REFERENCE, Landed, make_landing
from flipproof.sweep.work import Point
from ode_reference import turn
from slicemodel import Scenario
from slicemodel.scenario import MAX_VALUE, _Checks

FAMILIES: Final[Mapping[str, str]] = MappingProxyType({"A": "ω₀ as thrown", "B": "time of flight as thrown"})
"""Family of throws -> what all its bottles share."""

LONGEST: Final = 2.0
"""Longest flight of family A [s]."""

FASTEST: Final = 60.0
"""Largest omega_0 of family B [rad/s]."""

SPARE: Final = 1.0
"""Time that scattered throws are given beyond the aimed flight [s]."""

Z: Final = 1.959963984540054
"""Half width of a 95 % interval of the normal distribution, in standard deviations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Aim:
    """A throw and the height of the table [m] on which it touches down at ``time`` [s] with the angle aimed at.

    ``rival`` is the largest share upright that another aim may have by the throws that chose this one (95 %).
    """

    throw: Scenario
    height: float
    time: float
    rival: float = 0.0


def mirrored(throw: Scenario) -> Scenario:
    """Return the mirror image of a throw, which lands as its mirror image."""
    v_x, v_y = throw.launch_velocity
    return replace(throw, omega0=-throw.omega0, theta0=-throw.theta0, launch_velocity=(-v_x, v_y))


def forwards(throw: Scenario) -> Scenario:
    """Return the throw, or its mirror image if it spins backwards."""
    return throw if throw.omega0 > 0.0 else mirrored(throw)


def aimed(throw: Scenario, family: str, offset: float = 0.0) -> Aim:
    """Return the throw whose lowest rim is at the height of the table ``offset`` [rad] beyond the next upright angle.

    Of family A, the next one at which its centre of mass falls. A bottle whose rim turns faster than the bottle falls,
    omega R > |v_y|, has met such a table a moment before: ice of family A does. Of a throw that spins backwards, the
    mirror image is aimed, in whose angles messages are.

    Raises
    ------
    ValueError
        If no omega_0, or no time, gives that angle, if nothing pulls the bottle down, or if it still rises then.
    """
    if family not in FAMILIES:
        raise ValueError(f"family = {family!r} is unknown (admissible: {', '.join(FAMILIES)})")
    if throw.gravity <= 0.0:
        raise ValueError(f"gravity = {throw.gravity:g} m/s^2 is outside (0, inf): nothing lands without it")
    if throw.omega0 < 0.0:
        try:
            return aimed(mirrored(throw), family, offset)
        except ValueError as error:
            raise ValueError(f"the mirror image, which spins forwards: {error}") from None
    goal = math.tau * (math.floor(throw.theta0 / math.tau) + 1) + offset
    if not goal > throw.theta0:
        raise ValueError(
            f"offset = {math.degrees(offset):g} degrees aims at {math.degrees(goal):g} degrees, which is not beyond "
            f"theta0 = {math.degrees(throw.theta0):g} degrees"
        )
    return _by_height(throw, goal) if family == "A" else _by_spin(throw, goal)


def _by_height(throw: Scenario, goal: float) -> Aim:
    t, theta, rim = turn(replace(throw, duration=LONGEST), 1e-3)
    falls = t > throw.launch_velocity[1] / throw.gravity
    if falls.any() and (passed := theta[falls][0] - goal) > 0.0:  # upright before it falls: another turn
        goal += math.tau * math.ceil(passed / math.tau)
    reached = np.flatnonzero(falls & (theta >= goal))
    if not reached.size:
        raise ValueError(
            f"theta stays below {math.degrees(theta.max()):.0f} degrees for {LONGEST:g} s at omega0 = {throw.omega0:g} "
            f"rad/s and fill fraction {throw.fill_fraction:g}; the aim is {math.degrees(goal):.0f} degrees"
        )
    k = int(reached[0])
    share = (goal - theta[k - 1]) / (theta[k] - theta[k - 1])
    time, height = (float(curve[k - 1] + share * (curve[k] - curve[k - 1])) for curve in (t, rim))
    return Aim(throw=replace(throw, duration=time + SPARE), height=height, time=time)


def _by_spin(throw: Scenario, goal: float) -> Aim:
    """Halve 24 times the first interval, of a grid of 2 rad/s, in which a throw turns far enough."""
    apex = throw.launch_velocity[1] / throw.gravity
    if throw.duration <= apex:
        raise ValueError(
            f"duration = {throw.duration:g} s is outside ({apex:.4g}, inf) s: until then the bottle rises, and meets "
            "no table from above"
        )
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
            checks.number(name, getattr(self, name), unit, minimum=0.0, maximum=MAX_VALUE)
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
    """How many of ``throws`` ended upright, and how many nobody can tell; the 95 % interval counts those both ways.

    It is an interval of the share at the best aim: it reaches up to ``rival``, what another aim may have.
    """

    upright: int
    undecided: int
    throws: int
    rival: float = 0.0

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
        low, high = wilson(self.upright, self.throws)[0], wilson(self.upright + self.undecided, self.throws)[1]
        return low, max(high, self.rival)

    def minus(self, other: Share, phi: float = 0.0) -> tuple[float, float, float]:
        """Return the difference of two shares and its 95 % interval: Newcombe's (1998), of two Wilson intervals.

        Without ``phi``, the correlation of paired throws, it is that of independent samples.
        """
        difference = self.value - other.value
        (low, high), (other_low, other_high) = self.interval, other.interval

        def distance(first: float, second: float) -> float:
            return math.sqrt(max(first**2 - 2.0 * phi * first * second + second**2, 0.0))

        return (
            difference,
            difference - distance(self.value - low, other_high - other.value),
            difference + distance(high - self.value, other.value - other_low),
        )


def correlation(stood: Sequence[bool | None], other_stood: Sequence[bool | None]) -> float:
    """Return phi of paired throws that stood or did not, with Newcombe's correction for continuity (1998, method 10).

    It is 0, that of independent samples, if the counts differ, if a throw is undecided (None), or if all end alike.
    """
    if len(stood) != len(other_stood) or None in stood or None in other_stood:
        return 0.0
    throws, first, second = len(stood), sum(map(bool, stood)), sum(map(bool, other_stood))
    spread = first * (throws - first) * second * (throws - second)
    both = sum(bool(a and b) for a, b in zip(stood, other_stood, strict=True))
    excess = float(throws * both - first * second)
    if excess > 0:
        excess = max(excess - throws / 2, 0.0)
    return excess / math.sqrt(spread) if spread else 0.0


def wilson(count: int, throws: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share of ``throws``."""
    share, z = count / throws, Z * Z
    middle = (share + z / (2 * throws)) / (1 + z / throws)
    half = Z * math.sqrt(share * (1 - share) / throws + z / (4 * throws * throws)) / (1 + z / throws)
    # Rounding must not put the ends beyond what is possible.
    return (0.0 if count == 0 else middle - half), (1.0 if count == throws else middle + half)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Throws about one aim onto one table, landed event by event under one law; None for ice.

    Seeds of different streams have no throw in common.
    """

    aim: Aim
    law: str | None
    restitution: float = 0.3
    friction: float = 0.4
    scatter: Scatter = field(default_factory=Scatter)
    throws: int
    stream: int = 0

    def settings(self) -> dict[str, Any]:
        """Return what the landing is called with."""
        table = {"height": self.aim.height, "restitution": self.restitution, "friction": self.friction}
        return {**table, "law": self.law}


@dataclass(frozen=True, kw_only=True)
class Throws:
    """Every throw of some cases, as points of a sweep.

    Throw k of any case of one stream is scattered by the seed (seed, stream, k): water and ice, fillings, laws and
    tables meet the same throwers.
    """

    cases: tuple[Case, ...]
    seed: int

    @cached_property
    def ends(self) -> tuple[int, ...]:
        """Number of the first point after each case."""
        return tuple(accumulate(case.throws for case in self.cases))

    @property
    def size(self) -> int:
        """Points of all cases."""
        return self.ends[-1] if self.ends else 0

    def points(self) -> Iterator[Point]:
        """Yield every point, case by case."""
        for case in self.cases:
            settings = case.settings()
            for place in range(case.throws):
                yield Point(REFERENCE, self.thrown(case, place).to_mapping(), settings, MAKER)

    def thrown(self, case: Case, place: int) -> Scenario:
        """Return the throw of a case at that place in [0, throws)."""
        return scattered(case.aim.throw, case.scatter, (self.seed, case.stream, place))

    def by_case(self, rows: Sequence[Landed]) -> list[list[Landed]]:
        """Return the rows of all points, in their order, case by case."""
        return [list(rows[end - case.throws : end]) for case, end in zip(self.cases, self.ends, strict=True)]


def make_cases(cases: Sequence[Case], seed: int) -> list[list[Landed]]:
    """Make the throws of some cases in this process, and return their rows, case by case."""
    design = Throws(cases=tuple(cases), seed=seed)
    points = design.points()
    return design.by_case([make_landing(point.solver, point.settings, point.throw) for point in points])
