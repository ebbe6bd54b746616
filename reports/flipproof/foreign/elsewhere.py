"""Throws that differ from those of the other checks in everything at once, and what a solver gets wrong there.

A throw is a set of ``Knobs``: bottle, filling, slices, start, spin, weight, drag, restitution, output times. ``drawn``
takes them from a seed, so that no solver is tuned to them. Each answer is compared with the exact solution of its
equation in every field that it gives:

    abs(answer - reference) <= room(t) = FLOOR + OWN x own error(t) + BAND x band(t)

own error   change of the answer under refinement; it grows with the flight, so its running maximum counts
band        change of the reference with a release that differs by 1e-6 and with another rest speed: what no solver owes

Where the room exceeds ``BLURRED`` nothing is judged. Of a throw that is wrong each knob is turned alone, from the
paper's throw or back to it, until one of them tells right from wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, cycle
from types import MappingProxyType
from typing import Any, Final

import numpy as np

import ode_reference
from flipproof.foreign.checking import THROW, Found, Making, NotApplicableError, effort_of
from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits, started
from flipproof.foreign.departures import departing
from flipproof.foreign.place import name_of, placing, switches_of
from flipproof.frame.twins import usual_rest_speed
from ode_reference.switches import Switches
from slicemodel import Bottle, Scenario, Trajectory
from slicemodel.trajectory import FloatArray, Impacts

SEED: Final = 26
"""Seed of the throws where none is named."""

FLOOR: Final = 1e-4
"""Room of every field, a fraction of its scale (``scales``)."""

OWN: Final = 5.0
BAND: Final = 2.0
BLURRED: Final = 0.1
"""Room of omega, fraction of omega_0, from which on a throw tells nothing more."""

WEAK: Final = 0.01
"""Own error of omega, fraction of omega_0, from which on it hides what the check is there for."""

STRAY: Final = 0.03
"""Share of the values of v that may be off: a slice turns round at an impact, and an output time may lie beside it."""

LEVELS: Final = ((-1.3, -1.9, -2.6), (1, 0.4, -0.3), (3, 2.4, 1.7))
"""Levels of refinement, finer ones where coarser ones leave an own error that counts, or hide it.

No step of one is a multiple of another's, so that none shares the luck of its grid.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Knobs:
    """What a throw is made of; SI units, ``damping`` is alpha / m [1/s], ``angle`` is abs(omega_0) T [rad]."""

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
            start = np.array([throw.r_min + 0.3 * (throw.r_max - throw.r_min)])  # in the middle nothing pulls it
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
    """Return places in the middle fifth of the bottle, shape (N,) [m], the first slice nearest to the base."""
    return np.linspace(0.6, 0.4, throw.n_slices) * throw.bottle.length


PAPER: Final = Knobs()

WHOLE: Final = Knobs(damping=8.0, filling=0.45)
"""A throw with weight, drag, and impacts on both ends."""

UNREFINED: Final = 0.003
"""Own error, fraction of omega_0, granted on ``WHOLE`` to a solver that cannot be refined."""

WORDS: Final[Mapping[str, tuple[str, str]]] = {
    "restitution": ("e = {:.3g}", "take the restitution from the throw, at both ends and also when it is 0 or 1"),
    "slices": ("N = {}", "every slice must move: the ninth, the last of a loop over blocks, and the only one of N = 1"),
    "start": (
        "slices that start {}",
        "begin at ask.start, in the order in which it stands there, which need not be a stack",
    ),
    "times": (
        "output times {}",
        "the flight begins at t = 0; ask.times are answered as they stand, uneven and later than 0",
    ),
    "damping": ("alpha / m = {:.3g} /s", "the drag of a slice is alpha v with alpha of the throw, weak, strong or 0"),
    "gravity": ("g = {:.3g} m/s^2", "take gravity from the throw and scale the weight with it"),
    "theta0": ("theta_0 = {:.3g} rad", "theta begins at theta_0 and is never wrapped; the weight goes with cos(theta)"),
    "omega0": ("omega_0 = {:.3g} rad/s", "the spin is the throw's, fast or slow and in either direction"),
    "angle": ("{:.3g} rad turned", "nothing may depend on how long the flight lasts or how many impacts it has"),
    "filling": ("filling {:.3g}", "water mass and the height of a slice come from the throw"),
    "mass": ("M_b = {:.3g} kg", "take the mass of the bottle from the throw"),
    "length": ("L = {:.3g} m", "take the length of the bottle from the throw, also in its moment of inertia"),
    "radius": ("R = {:.3g} m", "take the radius of the bottle from the throw: I_b = M_b (R^2 / 2 + L^2 / 12)"),
    "capacity": ("M_max = {:.3g} kg", "the height of a slice is water mass / capacity x L / N"),
    "velocity": ("v_0 = {} m/s", "the flight of the centre of mass does not act inside the bottle"),
}
"""Knob -> how it is printed, and what to look at if it tells right from wrong."""


def said(knobs: Knobs, name: str) -> str:
    """Return one knob in words."""
    return WORDS[name][0].format(getattr(knobs, name))


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
"""What is varied, and its levels: ``damping`` as a fraction of omega_0, ``pull`` the weight as a fraction of the
largest centrifugal force, omega_0^2 L / 2, ``ratio`` the bottle's mass over that of the water: at any spin drag holds
slices, and weight lifts them, in some throws. What stands in brackets is one level and is taken in turn."""

FULL: Final = replace(PAPER, mass=0.05, filling=1.0, damping=0.0, gravity=0.0, theta0=0.7, omega0=-12.0, angle=4.0)
"""A light full bottle: of its four slices two rest on the ends, and two strike both ends at one instant.

Where the tube recoils, rounding decides whether a solver answers these hits together or in turn: neither is accused.
"""

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
"""A bottle of 8 mm with slices of 0.3 mm: a length, mass or drag coefficient that is cut off shows here."""

SLOW: Final = replace(PAPER, slices=5, start="scattered", omega0=0.45, gravity=0.005, damping=0.05, angle=6.0)
"""A bottle that turns once in 14 s: a spin, an acceleration or a duration that is cut off shows here."""

SIMILAR: Final[Mapping[Knobs, tuple[Knobs, str, str]]] = MappingProxyType(
    {
        SMALL: (
            replace(SMALL, mass=2.7, length=0.24, radius=0.09, capacity=5.4, gravity=60.0),
            "right in a bottle of 0.24 m, wrong in one of 8 mm that moves in proportion",
            "m, kg, kg/s or m/s, such as a least height, room, mass, drag or speed",
        ),
        SLOW: (
            replace(SLOW, omega0=18.0, gravity=8.0, damping=2.0),
            "right at 18 rad/s, wrong at 0.45 rad/s where everything moves in proportion",
            "rad/s, m/s, m/s^2, 1/s or s, such as a least spin, speed, weight, drag or a longest flight",
        ),
    }
)
"""The same flights on other scales: if they are right, what is wrong, and the units of a constant that does it."""

COUNT: Final = 16
"""Throws of a seed: eight of nine pairs of levels of two factors occur together in one of them, all levels do."""


def designed(rng: np.random.Generator) -> list[list[int]]:
    """Return the levels of ``COUNT`` throws, a number a factor: each is the one of 100 with the most new pairs."""
    sizes, met, rows = [len(levels) for levels in FACTORS.values()], set[tuple[int, ...]](), []
    for _ in range(COUNT):
        some = [
            ({(i, j, row[i], row[j]) for i, j in combinations(range(len(sizes)), 2)} - met, row)
            for row in rng.integers(0, sizes, (100, len(sizes))).tolist()
        ]
        new, row = max(some, key=lambda candidate: len(candidate[0]))
        met |= new
        rows.append(row)
    return rows


@lru_cache(maxsize=8)
def drawn(seed: int) -> tuple[Knobs, ...]:
    """Return the throws of a seed: a small covering design, its numbers moved by some percent."""
    rng = np.random.default_rng(seed)
    throws = []
    turns = {
        level: cycle(rng.permutation(level).tolist())
        for levels in FACTORS.values()
        for level in levels
        if isinstance(level, tuple)
    }
    for row in designed(rng):
        of = {name: levels[level] for (name, levels), level in zip(FACTORS.items(), row, strict=True)}
        of |= {name: next(turns[level]) for name, level in of.items() if level in turns}
        moved = dict(zip(FACTORS, (1 + 0.08 * rng.uniform(-1, 1, len(FACTORS))).tolist(), strict=True))
        slices = of["slices"] + (int(rng.integers(0, 5)) if of["slices"] > 30 else 0)
        # A single slice hardly moves in a light bottle or against strong drag, and not at all in a full one; many in
        # little water hit the base at once.
        alone = slices == 1
        length, radius = rng.uniform(0.1, 0.6), rng.uniform(0.02, 0.1)
        fluid = float(rng.choice([700.0, 1000.0, 1000.0, 13_500.0]) * rng.uniform(0.92, 1.08))  # [kg/m^3]
        capacity = fluid * np.pi * radius**2 * length
        filling = min(max(of["filling"], 0.4 if slices > 30 else 0.0) * moved["filling"], 1.0 if slices > 2 else 0.8)
        omega0 = of["way"] * of["spin"] * moved["spin"]
        throws.append(
            Knobs(
                mass=max(of["ratio"], 1.5 if alone else 0.0) * filling * capacity,
                length=length,
                radius=radius,
                capacity=capacity,
                filling=filling,
                slices=slices,
                # The stack of a full bottle is its own mirror image: rounding decides which of two impacts comes first.
                start=of["start"] if slices > 2 and filling < 1.0 else "scattered",
                restitution=of["restitution"] * (moved["restitution"] if of["restitution"] < 1.0 else 1.0),
                damping=min(of["damping"], 0.15 if alone else 2.5) * moved["damping"] * abs(omega0),
                gravity=of["pull"] * moved["pull"] * omega0**2 * length / 2,
                theta0=of["theta0"] * moved["theta0"],
                omega0=omega0,
                angle=of["angle"] * moved["angle"],
                times=of["times"],
                velocity=tuple(rng.uniform(-3.0, 3.0, 2).round(2).tolist()),
            )
        )
    throws = [_shortened(knobs, seed, MAX_IMPACTS) for knobs in throws]
    return (*throws, *(replace(knobs, frozen=True) for knobs in throws))


MAX_IMPACTS: Final = 100
"""Impacts of a throw beyond one a slice: more, of elastic ones or in a light bottle, say no more and take long."""

FEW_IMPACTS: Final = 20
"""The same where one knob is turned: after many impacts a right solver's own error counts, too."""


def _shortened(knobs: Knobs, seed: int, impacts_left: int) -> Knobs:
    """Return a throw that ends, by Eq. 8 and in free flight, after so many impacts and one more a slice."""
    whole = replace(knobs, times="at the end alone").ask(seed)
    share = 1.0
    for model in ("eq8", "free-flight"):
        impacts = ode_reference.solve(started(whole), model, whole.times).impacts
        last = impacts_left + knobs.slices
        if impacts is not None and len(impacts.time) > last:
            share = min(share, 0.99 * float(impacts.time[last]) / whole.scenario.duration)
    return replace(knobs, angle=share * knobs.angle)


# ---------------------------------------------------------------------- the reference


@lru_cache(maxsize=256)
def _flown(switches: Switches, throw: Scenario, times: bytes, rest_speed: float) -> Trajectory:
    return ode_reference.solve(throw, switches, np.frombuffer(times), rest_speed=rest_speed)


def references(equation: str, ask: Ask) -> list[Trajectory]:
    """Return the exact flight of an equation from the ask's start, and its two twins: in release, in rest speed."""
    switches = switches_of(equation)
    throw, usual, times = started(ask), usual_rest_speed(switches.name), ask.times.tobytes()
    bottle = replace(throw.bottle, mass=throw.bottle.mass * (1 + 1e-6))
    other = replace(throw, bottle=bottle, omega0=throw.omega0 * (1 + 1e-6))
    rest = 1e-3 if usual < 1e-3 else 1e-4
    return [
        _flown(switches, throw, times, usual),
        _flown(switches, other, times, usual),
        _flown(switches, throw, times, rest),
    ]


def scales(ask: Ask, truth: Trajectory) -> dict[str, float]:
    """Return by field what its differences are fractions of; of the inertia its largest value."""
    throw = ask.scenario
    spin, length = abs(throw.omega0), throw.bottle.length
    return {
        "omega": spin,
        "theta": max(1.0, spin * throw.duration),
        "r": length,
        "r_cm": length,
        "inertia": float(np.max(truth.inertia, initial=0.0)) or 1.0,
        "v": length * spin,
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """What is wrong on one throw: field -> (difference, room, time), fractions of its scale.

    ``own`` is the solver's own error of omega where it was judged, ``error`` says why there is no answer, ``since``
    up to which impact it is right, and ``passed`` how many impacts that are.
    """

    wrong: Mapping[str, tuple[float, float, float]]
    own: float = 0.0
    largest: float = 0.0
    share: float = 1.0
    error: str = ""
    since: str = ""
    passed: int = 0

    @property
    def farthest(self) -> float:
        """The largest difference of what is wrong, 0 if nothing is."""
        return max((off for off, _, _ in self.wrong.values()), default=0.0)

    @property
    def excess(self) -> float:
        """The largest difference over its room."""
        return max((off / room for off, room, _ in self.wrong.values()), default=0.0)


def judge(traits: Traits, ask: Ask, answers: Sequence[Answer], equation: str, unrefined: float) -> Judged:
    """Judge the answer to one throw; ``answers`` is the finest first, then coarser ones, if it can be refined."""
    truth, *twins = references(equation, ask)
    scale = scales(ask, truth)
    reached = min(len(run.t) for run in (truth, *twins))

    def sizes(flight: Any, other: Any, name: str) -> FloatArray:
        difference = np.abs(getattr(flight, name)[:reached] - getattr(other, name)[:reached]) / scale[name]
        return np.asarray(difference)

    def grown(values: FloatArray) -> FloatArray:
        return np.maximum.accumulate(values if values.ndim == 1 else values.max(axis=1))

    mine = answers[0]
    floor = max(FLOOR, 1024 * traits.epsilon)
    given = [name for name in scale if getattr(mine, name) is not None]
    rooms: dict[str, FloatArray] = {}
    owns: dict[str, FloatArray] = {}
    for name in given:
        summed = grown if name != "v" else lambda x: np.full(reached, np.quantile(x, 1 - STRAY))
        own = np.max([np.zeros(reached), *(summed(sizes(mine, coarser, name)) for coarser in answers[1:])], axis=0)
        owns[name] = own if len(answers) > 1 else np.full(reached, unrefined)
        rooms[name] = floor + OWN * owns[name] + BAND * sum(summed(sizes(truth, twin, name)) for twin in twins)
    clear = rooms["omega"] <= BLURRED
    wrong: dict[str, tuple[float, float, float]] = {}
    first = float(ask.times[-1])
    for name in given:
        off = sizes(mine, truth, name)[clear]
        room = rooms[name][clear]
        if not off.size:
            continue
        if name == "v":
            beyond = off > 10 * room[:, None]
            if np.count_nonzero(beyond) <= max(2, STRAY * off.size):
                continue
        rows = off if off.ndim == 1 else off.max(axis=1)
        k = int(np.argmax(rows / room))
        if not rows[k] <= room[k]:
            wrong[name] = float(rows[k]), float(room[k]), float(ask.times[k])
            row = int(np.argmax(rows > room))
            first = min(first, float(ask.times[:reached][clear][row]))
    if mine.impacts is not None and clear.any():
        room_of_r = rooms.get("r", rooms["omega"])[clear]
        if late := _unmatched(ask, mine.impacts, truth.impacts or NO_IMPACTS, room_of_r, ask.times[:reached][clear]):
            wrong["impacts"] = late
    passed, onset = _since(ask, truth.impacts or NO_IMPACTS, first) if wrong else (0, "")
    return Judged(
        wrong=wrong,
        own=float(np.max(owns["omega"][clear])) if clear.any() else float(owns["omega"].min()),
        largest=float(np.max(sizes(mine, truth, "omega")[clear], initial=0.0)),
        share=float(np.mean(clear)) * reached / len(ask.times),
        since=onset,
        passed=passed,
    )


def _since(ask: Ask, impacts: Impacts, first: float) -> tuple[int, str]:
    """Return how many impacts an answer passes rightly that is wrong at ``first`` [s], and up to which, as a phrase."""
    right = np.max(ask.times[ask.times < first], initial=0.0)
    before = int(np.sum(impacts.time <= right))
    between = np.flatnonzero((impacts.time > right) & (impacts.time < first))
    if not between.size:
        return before, f"after {before} impacts that were right" if before else "before the first impact"
    k = int(between[0])
    together = between[np.abs(impacts.time[between] - impacts.time[k]) < 1e-9 * ask.scenario.duration]
    ends = {"base" if end > 0 else "cap" for end in impacts.end[together].tolist()}
    which = f"slice {impacts.slice[k]} on the {ends.pop()}"
    if len(together) > 1:
        which = f"slices {', '.join(map(str, impacts.slice[together].tolist()))} {AT_ONCE}"
    so_far = f"{before} impacts that were right, " if before else ""
    return before, f"after {so_far}the impact of {which} at {impacts.time[k]:.3g} s"


AT_ONCE: Final = "at one instant"


NO_IMPACTS: Final = Impacts(np.empty(0), np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty(0))

FAINT: Final = 0.02
"""Speed, fraction of L omega_0, below which an impact need not be answered: a slice may rest there."""


def _unmatched(
    ask: Ask, mine: Impacts, truth: Impacts, room_of_r: FloatArray, times: FloatArray
) -> tuple[float, float, float] | None:
    """Return difference, room and time of the impact that is farthest beyond its room from any of the other list.

    Impacts of one slice on one end are matched by time and number, up to the last of ``times``; a slice that is
    ``room_of_r`` off is late by as much over its speed. Fractions of the flight; None if every impact has its match.
    """
    throw, misses = ask.scenario, []
    faint = FAINT * throw.bottle.length * abs(throw.omega0)
    for one, other in ((mine, truth), (truth, mine)):
        for k in np.flatnonzero(one.speed_before > faint):
            when, at = one.time[k], int(np.searchsorted(times, one.time[k]))
            if at == len(times):
                continue
            late = float(room_of_r[at]) * throw.bottle.length / one.speed_before[k]
            room = FLOOR + late / throw.duration
            near, others = (
                np.sort(np.abs(hits.time[(hits.slice == one.slice[k]) & (hits.end == one.end[k])] - when))
                / throw.duration
                for hits in (one, other)
            )
            count = int(np.sum(near <= room))
            off = float(others[count - 1]) if count <= len(others) else 1.0
            if off > 2 * room and when + 2 * room * throw.duration < times[-1]:
                misses.append((off, 2 * room, float(when)))
    return max(misses, key=lambda one: one[0] / one[1], default=None)


Judging = Generator[Sequence[Ask], Sequence[Answer], list[Judged]]
Asking = Generator[Sequence[Ask], Sequence[Answer], str]


def judging(
    traits: Traits,
    throws: Sequence[Knobs],
    seed: int,
    equation: str,
    unrefined: float,
    all_levels: Sequence[Sequence[float]] = LEVELS,
) -> Judging:
    """Ask for throws, at three levels if the solver can be refined and at finer ones if need be, and judge each.

    Ice has an answer without an error of the step: one level is enough.
    """
    asks, judged = [knobs.ask(seed) for knobs in throws], {}
    left = list(range(len(asks)))
    for levels in all_levels if traits.refined_by else ((0,),):
        refined = {
            k: [
                replace(asks[k], effort=effort_of(traits, asks[k].scenario, level))
                for level in (levels[:1] if throws[k].frozen else levels)
            ]
            for k in left
        }
        with suppress(ForeignError):
            # All at once, where somebody writes the answers.
            yield [ask for series in refined.values() for ask in series]
        for k, series in refined.items():
            try:
                judged[k] = judge(traits, asks[k], (yield series), equation, 0.0 if throws[k].frozen else unrefined)
            except ForeignError as error:
                judged[k] = Judged(wrong={"answer": (1.0, 1e-3, 0.0)}, error=str(error))
        # What fails at long steps need not fail at short ones.
        left = [
            k for k in left if judged[k].error or OWN * judged[k].own > FLOOR or (throws[k].frozen and judged[k].wrong)
        ]
    return [judged[k] for k in range(len(asks))]


def confirmed(
    traits: Traits, knobs: Knobs, judged: Judged, seed: int, equation: str, unrefined: float
) -> Generator[Sequence[Ask], Sequence[Answer], Judged]:
    """Return the judgement of a throw that is wrong at the finest levels, too.

    A step that something else limits, such as an output time or a longest step, is the same at all coarse levels: its
    error does not show there as a change.
    """
    if traits.refined_by is None or knobs.frozen or judged.error:
        return judged
    (judged,) = yield from judging(traits, [knobs], seed, equation, unrefined, LEVELS[-1:])
    return judged


def check_elsewhere(traits: Traits, seed: int = SEED) -> Making:
    """Other bottles, fillings, slices, starts, spins and times: every field is that of the equation."""
    place = yield from placing(traits)
    equation = traits.equation or place.equation
    if not place.on_lattice or place.equation != name_of(switches_of(equation)):
        raise NotApplicableError("needs an equation that the solver is found to solve")
    unrefined = min(0.01 + 4 * place.distance, 0.018)  # as far off as where it was placed, and not blurred
    throws = (*drawn(seed), SMALL, SLOW)
    flights = list(zip(throws, (yield from judging(traits, throws, seed, equation, unrefined)), strict=True))
    # Where a solver of low order errs less than elsewhere by luck, it owes no more than elsewhere.
    usual = (
        float(np.median([judged.own for knobs, judged in flights if not knobs.frozen])) if traits.refined_by else 0.0
    )
    wrong = [(knobs, judged) for knobs, judged in flights if judged.farthest > (0.0 if knobs.frozen else usual)]
    wrong = [flight for flight in wrong if not flight[0].frozen] or wrong
    wrong.sort(key=lambda flight: -flight[1].excess)
    while wrong:
        finest = yield from confirmed(traits, *wrong[0], seed, equation, unrefined)
        if finest.wrong:
            break
        wrong = wrong[1:]
    own = max((judged.own for _, judged in flights if not judged.error), default=0.0)
    facts = {
        "seed": seed,
        "elsewhere": [
            {"own": judged.own, "largest": judged.largest, "judged": judged.share, "wrong": sorted(judged.wrong)}
            for _, judged in flights
        ],
    }
    expected = f"{equation} in every field, on {len(flights)} throws of seed {seed}"
    (full,) = yield from judging(traits, [FULL], seed, equation, unrefined)
    in_turn = bool(full.wrong) and not full.error and switches_of(equation).recoil
    if full.wrong and not in_turn and not wrong:
        wrong = [(FULL, full)]
    if not wrong:
        largest = max(judged.largest for _, judged in flights)
        blurred = sum(judged.share < 0.3 for _, judged in flights)
        weak = own > WEAK or blurred > len(flights) // 2
        words = f"its own error, {own:.2g} of omega_0, hides mistakes smaller than {OWN * own:.2g}" if weak else ""
        if in_turn:
            words = f"a full bottle with hits on both ends at one instant: {_wrong_words(full)}; in turn, not together?"
        came = f"at most {largest:.2g} of omega_0 off, its own error {own:.2g}"
        return Found(holds=True, expected=expected, came=came, weak=words, facts=facts)
    came, advice = yield from bisected(traits, *wrong[0], seed, equation, unrefined)
    if not (wrong[0][0].frozen or wrong[0][1].error):
        with suppress(ForeignError, NotApplicableError):
            pieces, what = yield from departing(traits, equation, [wrong[0][0].ask(seed)])
            advice = f"{pieces and f'there it departs {pieces}; '}{what and f'{what}; '}{advice}"
    where = f"{len(wrong)} of {len(flights)} throws"
    return Found(holds=False, expected=expected, came=came, where=where, advice=advice, facts=facts)


def bisected(
    traits: Traits, knobs: Knobs, judged: Judged, seed: int, equation: str, unrefined: float
) -> Generator[Sequence[Ask], Sequence[Answer], tuple[str, str]]:
    """Return the sentence that tells right from wrong by one knob, and what to look at."""
    how: Callable[[Sequence[Knobs]], Judging] = lambda all: judging(traits, all, seed, equation, unrefined)  # noqa: E731
    if knobs in SIMILAR:
        similar, words, units = SIMILAR[knobs]
        (scaled,) = yield from how([similar])
        if not scaled.wrong:
            advice = f"the equation has no scale of its own: look for a constant in {units}"
            return f"{words}: {_wrong_words(judged)}", advice
    lost, together = _wrong_words(judged), TOGETHER if knobs is FULL else ""
    names = [name for name in WORDS if getattr(knobs, name) != getattr(PAPER, name)]
    paper, ice = replace(PAPER, frozen=knobs.frozen), "in ice " if knobs.frozen else ""
    (base,) = yield from how([paper])
    if base.wrong:
        fields = _field_advice(base, ice=knobs.frozen)
        without = "" if knobs.frozen or fields else (yield from simplified(traits, equation, unrefined))
        return f"{ice}{_wrong_words(base)} on the paper's throw, too", f"{without}{fields}"
    single = [_shortened(replace(paper, **{name: getattr(knobs, name)}), seed, FEW_IMPACTS) for name in names]
    turned = sorted(zip(names, single, (yield from how(single)), strict=True), key=lambda trial: -trial[2].excess)
    for name, throw, first in turned:
        alone = (yield from confirmed(traits, throw, first, seed, equation, unrefined)) if first.wrong else first
        if alone.wrong:
            return (
                f"{ice}right at {said(PAPER, name)}, wrong at {said(knobs, name)}: {_wrong_words(alone)}",
                (together or _impact_advice(alone)) + (_field_advice(alone, ice=knobs.frozen) or WORDS[name][1]),
            )
    backs = yield from how([replace(knobs, **{name: getattr(PAPER, name)}) for name in names])
    again = [name for name, back in zip(names, backs, strict=True) if not back.wrong and back.share > 0.3]
    if 0 < len(again) <= 4:
        paper_words, throw_words = (
            " or ".join(said(PAPER, name) for name in again),
            " and ".join(said(knobs, name) for name in again),
        )
        return (
            f"{ice}right at {paper_words}, wrong at {throw_words} where other things are changed, too: {lost}",
            f"{together or _impact_advice(judged)}{'; or '.join(WORDS[name][1] for name in again)}"
            f"{_field_advice(judged, '; ', ice=knobs.frozen)}",
        )
    return (
        f"{ice}{lost} where {', '.join(said(knobs, name) for name in names)}",
        f"{together or _impact_advice(judged)}{_field_advice(judged, ice=knobs.frozen)}",
    )


def on_the_paper(traits: Traits, equation: str) -> Asking:
    """Return what is wrong on a throw with drag and impacts on both ends, beyond the solver's own error; or nothing."""
    (judged,) = yield from judging(traits, [WHOLE], 0, equation, UNREFINED)
    if judged.wrong:
        judged = yield from confirmed(traits, WHOLE, judged, 0, equation, UNREFINED)
    return _wrong_words(judged) if "omega" in judged.wrong else ""


LOOK_AT: Final[Mapping[str, str]] = {
    "weight": "the weight term, g cos(theta) along the bottle",
    "drag": "the drag, alpha v / m, and against what v is measured",
    "impacts": "impacts: restitution, recoil, their places, which slices take part",
    "rests": "rests: when a slice begins to rest on base or cap, when it is let go, and its part in what others do",
}
"""What to look at if an answer is right without weight, drag, impacts or rests, in the order in which this is asked."""


def right_without(name: str) -> str:
    """Return the advice for an answer that is right without one of ``LOOK_AT``."""
    return f"right {'before the first impact' if name == 'impacts' else f'without {name}'}: look at {LOOK_AT[name]}; "


RESTLESS: Final = replace(WHOLE, start="scattered", restitution=1.0, damping=0.0, angle=6.0)
"""A throw with weight and impacts on both ends in which no slice ever rests."""

STICKY: Final = replace(WHOLE, restitution=0.05, omega0=8.0)
"""One in which slices rest on either end, and weight lets them go."""


def simplified(traits: Traits, equation: str, unrefined: float = UNREFINED) -> Asking:
    """Return without what a throw is right, if anything tells: weight, drag, impacts, rests; and what to look at."""
    for whole in (WHOLE, STICKY):
        (first,) = yield from judging(traits, [whole], 0, equation, unrefined)
        if first.wrong:
            break
    else:
        return ""
    simpler = {
        "weight": replace(whole, gravity=0.0),
        "drag": replace(whole, damping=0.0),
        "impacts": replace(whole, angle=1.0),
        "rests": RESTLESS,
        "all": replace(whole, gravity=0.0, damping=0.0, angle=1.0),
    }
    others = yield from judging(traits, list(simpler.values()), 0, equation, unrefined)
    right = {name for name, judged in zip(simpler, others, strict=True) if not judged.wrong}
    onset = f"with all of it first wrong {first.since}; "
    if {"weight", "impacts"} <= right:
        if "rests" in right:
            return f"right without weight, and without rests: look at {LOOK_AT['rests']}; {onset}"
        if first.passed:
            return f"right without weight, and through some impacts: look at rests and at {LOOK_AT['impacts']}; {onset}"
        return f"right without weight, and before half a turn: look at {LOOK_AT['weight']}, at every angle; {onset}"
    if {"rests", "impacts"} <= right:
        return f"right through impacts as long as no slice rests: look at {LOOK_AT['rests']}; {onset}"
    for name in ("weight", "drag", "impacts"):
        if name in right:
            return f"{right_without(name)}{onset}"
    if "all" in right:
        return f"right without weight, drag and impacts together, but wrong if only one of them is removed; {onset}"
    too = "wrong before the first impact without weight and drag, too"
    (apart,) = yield from judging(traits, [replace(simpler["all"], start="in the middle")], 0, equation, unrefined)
    if not apart.wrong:
        return f"{too}, but right with every slice far from the ends: look at the places of the ends, and at rests; "
    return f"{too}: look at the centrifugal term omega^2 (r - r_cm), the inertia and the masses; "


def _wrong_words(judged: Judged) -> str:
    """Return what is wrong, the worst first."""
    if judged.error:
        return f"no answer ({judged.error})"
    worst = sorted(judged.wrong, key=lambda name: judged.wrong[name][0] / judged.wrong[name][1], reverse=True)
    off, room, time = judged.wrong[worst[0]]
    units = {"omega": "omega_0", "theta": "the angle turned", "inertia": "the largest J", "v": "L omega_0"}
    unit = {**units, "impacts": "the flight"}.get(worst[0], "L")
    also = f", and {', '.join(worst[1:])}" if len(worst) > 1 else ""
    is_off = f"{'are' if worst[0] == 'impacts' else 'is'} {off:.2g} of {unit} off (room {room:.1g})"
    onset = f", first {judged.since}" if judged.since else ""
    return f"{worst[0]} {is_off} at t = {time:.3g} s{also}{onset}"


TOGETHER: Final = "slices strike both ends at one instant there: each keeps its own speed times -e, none is left out; "
"""What to look at where ``FULL`` alone is wrong."""


def _impact_advice(judged: Judged) -> str:
    """Return that impacts come first, where an answer is right through some of them and wrong later."""
    if AT_ONCE in judged.since:
        return "several slices strike at one instant there, and each keeps its own speed times -e; "
    late = judged.passed and not _field_advice(judged)
    return (
        "right through some impacts: look first at impacts, their number and order (of several in a step the earliest "
        "comes first), and at rests and their ends; "
        if late
        else ""
    )


def _field_advice(judged: Judged, before: str = "", *, ice: bool = False) -> str:
    """Return what to look at by the fields that are wrong, if omega is right: through impacts not by a small error."""
    if ice and set(judged.wrong) == {"v"}:
        return f"{before}what is frozen does not move in the bottle: its v is 0 and stays 0"
    if judged.error or "omega" in judged.wrong or (judged.passed and judged.farthest < FAINT / 4):
        return ""
    only = ", ".join(judged.wrong)
    return f"{before}omega is right, {only} not: look at how the answer is put together"
