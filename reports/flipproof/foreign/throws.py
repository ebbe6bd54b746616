"""Throws as sets of knobs: some that show one thing each, and some drawn by a seed to differ in everything at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, cycle
from types import MappingProxyType
from typing import Any, Final

import numpy as np

import ode_reference
from flipproof.foreign.checking import THROW
from flipproof.foreign.contract import Ask, started
from slicemodel import Bottle, Scenario
from slicemodel.trajectory import FloatArray

SEED: Final = 26
"""Seed of the throws where none is named."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Knobs:
    """The parameters of a throw; SI units, ``damping`` is alpha / m [1/s], ``angle`` is abs(omega_0) T [rad]."""

    mass: float = THROW.bottle.mass
    length: float = THROW.bottle.length
    radius: float = THROW.bottle.radius
    capacity: float = THROW.bottle.capacity
    filling: float = THROW.fill_fraction
    slices: int = THROW.n_slices
    start: str = "stacked"
    restitution: float = THROW.restitution
    damping: float = 2 * THROW.damping_rate
    gravity: float = THROW.gravity
    theta0: float = THROW.theta0
    omega0: float = THROW.omega0
    angle: float = THROW.omega0 * THROW.duration
    times: str = "even from 0"
    velocity: tuple[float, float] = THROW.launch_velocity
    frozen: bool = False

    def ask(self, seed: int) -> Ask:
        """Return the ask, without effort; ``seed`` scatters slices and times."""
        water = self.filling * self.capacity
        bottle = Bottle(mass=self.mass, length=self.length, radius=self.radius, capacity=self.capacity)
        throw = Scenario(
            bottle=bottle,
            water_mass=water,
            n_slices=self.slices,
            drag=self.damping * water / self.slices,
            restitution=self.restitution,
            omega0=self.omega0,
            theta0=self.theta0,
            duration=self.angle / abs(self.omega0),
            gravity=self.gravity,
            launch_velocity=self.velocity,
            frozen=self.frozen,
        )
        rng, start = np.random.default_rng(seed), throw.initial_positions()
        if self.start == "permuted":
            start = np.roll(rng.permutation(start), 1) if self.slices > 2 else start[::-1].copy()
        elif self.start == "scattered" and self.slices == 1:
            start = np.array([throw.r_min + 0.3 * (throw.r_max - throw.r_min)])  # no force acts on it in the middle
        elif self.start == "stacked on the cap":
            start = throw.r_min + throw.r_max - start
        elif self.start == "in the middle":
            start = far_from_ends(throw)
        elif self.start != "stacked":
            start = rng.uniform(throw.r_min, throw.r_max, self.slices)
            if self.start == "partly on the ends":
                start[::3], start[1::3] = throw.r_max, throw.r_min
                start = rng.permutation(start)
        end, times = throw.duration, np.linspace(0.0, throw.duration, 61)
        if self.times == "at the end alone":
            times = times[-1:]
        elif self.times == "at three times":
            times = np.array([0.4, 0.41, 1.0]) * end
        elif self.times == "uneven from 10 ms":
            first = min(0.01, end / 20)
            times = np.concatenate([[first], np.sort(rng.uniform(first, end, 58)), [end]])
        elif self.times == "uneven and ended early":
            times = np.concatenate([[0.0], np.sort(rng.uniform(0.0, 0.7 * end, 58)), [0.7 * end, 0.70001 * end]])
        for array in (start, times):
            array.setflags(write=False)
        return Ask(scenario=throw, times=times, start=start)


def far_from_ends(throw: Scenario) -> FloatArray:
    """Return places off the centre and far from the ends, shape (N,) [m], the first slice nearest to the base."""
    return np.linspace(0.6, 0.3, throw.n_slices) * throw.bottle.length


PAPER: Final = Knobs()

WHOLE: Final = Knobs(damping=8.0, filling=0.45)
"""A throw with weight, drag, and impacts on both ends."""

RESTLESS: Final = replace(WHOLE, start="scattered", restitution=1.0, damping=0.0, angle=6.0)
"""A throw with weight and impacts on both ends in which no slice ever rests."""

STICKY: Final = replace(WHOLE, restitution=0.05, omega0=8.0)
"""A throw in which slices rest on either end, and weight releases them."""


HELD: Final = replace(
    PAPER,
    slices=5,
    start="partly on the ends",
    restitution=0.3,
    damping=1.0,
    gravity=9.0,
    omega0=8.0,
    angle=13.0,
)
"""One that begins with slices on both ends, and lets them go from both."""

PIECES: Final = (
    WHOLE,
    replace(STICKY, slices=5),
    replace(RESTLESS, slices=5),
    replace(WHOLE, gravity=0.0, damping=0.0, angle=5.0),
    HELD,
    replace(WHOLE, start="stacked on the cap"),
)
"""Throws with and without weight, drag, and rests on one or both ends, of an even and an odd number of slices."""

FACTORS: Final[Mapping[str, tuple[Any, ...]]] = MappingProxyType(
    {
        "slices": ((1, 2), (3, 5, 6), (9, 13, 17), (35, 70)),
        "way": (1, -1),
        "spin": (4.0, 12.0, 40.0),
        "times": ("uneven from 10 ms", "even from 0", "uneven and ended early", ("at the end alone", "at three times")),
        "damping": (0.0, 0.15, 2.5),
        "restitution": (0.0, 0.3, 0.8, 1.0),
        "start": ("stacked", "permuted", "scattered", "partly on the ends"),
        "pull": (0.0, 0.3, 3.0),
        "theta0": (0.0, 0.7, 7.0, -5.0),
        "filling": (0.05, 0.4, 0.8, 1.0),
        "ratio": (0.05, 0.3, 1.5),
        "angle": (4.0, 7.0, 13.0),
    }
)
"""The factors that are varied, and their levels: ``damping`` as a fraction of omega_0, ``pull`` the weight as a
fraction of the largest centrifugal force, omega_0^2 L / 2, ``ratio`` the bottle's mass over that of the water: at any
spin drag holds slices, and weight lifts them, in some throws. Values in brackets are one level and take turns."""

FULL: Final = replace(PAPER, mass=0.05, filling=1.0, damping=0.0, gravity=0.0, theta0=0.7, omega0=-12.0, angle=4.0)
"""A light full bottle: of its four slices two rest on the ends, and two strike both ends at one instant.

Where the tube recoils, rounding decides whether a solver applies these hits together or in turn: neither is wrong.
"""

LASTING: Final = replace(PAPER, slices=16, restitution=0.95, damping=0.0, angle=150.0)
"""Seven hundred impacts, about as many in each tenth of the flight."""

SMALL: Final = replace(
    PAPER,
    mass=1e-4,
    length=0.008,
    radius=0.003,
    capacity=2e-4,
    filling=0.3,
    slices=9,
    start="permuted",
    omega0=-40.0,
    gravity=2.0,
)
"""A bottle of 8 mm with slices of 0.3 mm: shows a cut-off of lengths, masses or drag coefficients."""

SLOW: Final = replace(PAPER, slices=5, start="scattered", omega0=0.45, gravity=0.005, damping=0.05, angle=6.0)
"""A bottle that turns once in 14 s: shows a cut-off of spins, accelerations or durations."""

NARROW: Final = replace(PAPER, mass=0.5, length=0.14, filling=0.996, slices=1, start="scattered")
"""A single slice with half a millimetre of room: water that is taken for ice if it has little room shows here."""

COUNT: Final = 16
"""Throws of a seed: they hold every level, and eight of nine pairs of levels of two factors."""


def designed(rng: np.random.Generator) -> list[list[int]]:
    """Return the levels of ``COUNT`` throws, one index per factor: each is the one of 100 with the most new pairs."""
    sizes, covered, rows = [len(levels) for levels in FACTORS.values()], set[tuple[int, ...]](), []
    for _ in range(COUNT):
        candidates = [
            ({(i, j, row[i], row[j]) for i, j in combinations(range(len(sizes)), 2)} - covered, row)
            for row in rng.integers(0, sizes, (100, len(sizes))).tolist()
        ]
        new, row = max(candidates, key=lambda candidate: len(candidate[0]))
        covered |= new
        rows.append(row)
    return rows


@lru_cache(maxsize=8)
def drawn(seed: int) -> tuple[Knobs, ...]:
    """Return the throws of a seed: a small covering design, its values perturbed by some percent."""
    rng = np.random.default_rng(seed)
    throws = []
    turns = {
        level: cycle(rng.permutation(level).tolist())
        for levels in FACTORS.values()
        for level in levels
        if isinstance(level, tuple)
    }
    for row in designed(rng):
        values = {name: levels[level] for (name, levels), level in zip(FACTORS.items(), row, strict=True)}
        values |= {name: next(turns[level]) for name, level in values.items() if level in turns}
        factors = dict(zip(FACTORS, (1 + 0.08 * rng.uniform(-1, 1, len(FACTORS))).tolist(), strict=True))
        slices = values["slices"] + (int(rng.integers(0, 5)) if values["slices"] > 30 else 0)
        # A single slice hardly moves in a light bottle or against strong drag, and not at all in a full one; many in
        # little water hit the base at once.
        single = slices == 1
        length, radius = rng.uniform(0.1, 0.6), rng.uniform(0.02, 0.1)
        fluid = float(rng.choice([700.0, 1000.0, 1000.0, 13_500.0]) * rng.uniform(0.92, 1.08))  # [kg/m^3]
        capacity = fluid * np.pi * radius**2 * length
        filling = min(
            max(values["filling"], 0.4 if slices > 30 else 0.0) * factors["filling"], 1.0 if slices > 2 else 0.8
        )
        omega0 = values["way"] * values["spin"] * factors["spin"]
        throws.append(
            Knobs(
                mass=max(values["ratio"], 1.5 if single else 0.0) * filling * capacity,
                length=length,
                radius=radius,
                capacity=capacity,
                filling=filling,
                slices=slices,
                # The stack of a full bottle is its own mirror image: rounding decides which of two impacts comes first.
                start=values["start"] if slices > 2 and filling < 1.0 else "scattered",
                restitution=values["restitution"] * (factors["restitution"] if values["restitution"] < 1.0 else 1.0),
                damping=min(values["damping"], 0.15 if single else 2.5) * factors["damping"] * abs(omega0),
                gravity=values["pull"] * factors["pull"] * omega0**2 * length / 2,
                theta0=values["theta0"] * factors["theta0"],
                omega0=omega0,
                angle=values["angle"] * factors["angle"],
                times=values["times"],
                velocity=tuple(rng.uniform(-3.0, 3.0, 2).round(2).tolist()),
            )
        )
    throws = [shortened(knobs, seed, MAX_IMPACTS) for knobs in throws]
    return (*throws, *(replace(knobs, frozen=True) for knobs in throws))


MAX_IMPACTS: Final = 100
"""Impacts of a throw beyond one per slice: more, if elastic or in a light bottle, tell nothing new and take long."""

FEW_IMPACTS: Final = 20
"""The same if one knob is turned: after many impacts a right solver's own error matters, too."""


def shortened(knobs: Knobs, seed: int, impacts_left: int) -> Knobs:
    """Return the throw, ended after ``impacts_left`` impacts plus one per slice, by Eq. 8 and in free flight."""
    whole = replace(knobs, times="at the end alone").ask(seed)
    share = 1.0
    for model in ("eq8", "free-flight"):
        impacts = ode_reference.solve(started(whole), model, whole.times).impacts
        allowed = impacts_left + knobs.slices
        if impacts is not None and len(impacts.time) > allowed:
            share = min(share, 0.99 * float(impacts.time[allowed]) / whole.scenario.duration)
    return replace(knobs, angle=share * knobs.angle)
