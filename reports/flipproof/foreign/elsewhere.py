"""Throws that differ from those of the other checks in everything at once, and what a solver gets wrong there.

A throw is a set of ``Knobs``: bottle, filling, slices, start, spin, weight, drag, restitution, output times. ``drawn``
draws them by a seed, so that no solver is tuned to them. Each answer is compared with the exact solution of its
equation in every field that it gives:

    abs(answer - reference) <= room(t) = FLOOR + OWN x own error(t) + BAND x band(t)

own error   change of the answer under refinement; it grows with the flight, so its running maximum counts
band        change of the reference with a release that differs by 1e-6 and with another rest speed: no solver's fault

Where the room exceeds ``BLURRED`` nothing is compared. If a throw is wrong, each knob is turned alone, from the
paper's throw or back to it, until one of them separates right from wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, cycle
from types import MappingProxyType
from typing import Any, Final

import numpy as np

import ode_reference
from flipproof.foreign.checking import (
    THROW,
    CheckGenerator,
    NotApplicableError,
    Observation,
    effort_of,
    rest_speed_of,
    scales,
)
from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits, started
from flipproof.foreign.departures import UNEXPLAINED, departing
from flipproof.foreign.place import name_of, placing, switches_of
from ode_reference.solver import usual_rest_speed
from ode_reference.switches import Switches
from slicemodel import Bottle, Scenario, Trajectory
from slicemodel.trajectory import BASE, CAP, NO_IMPACTS, FloatArray, Impacts

SEED: Final = 26
"""Seed of the throws where none is named."""

FLOOR: Final = 1e-4
"""Room of every field, a fraction of its scale (``scales``)."""

OWN: Final = 5.0
BAND: Final = 2.0
BLURRED: Final = 0.1
"""Room of omega, fraction of omega_0, above which a throw tells nothing."""

WEAK: Final = 0.01
"""Own error of omega, fraction of omega_0, above which it hides what the check is looking for."""

STRAY: Final = 0.03
"""Fraction of the values of v that may be off: v jumps at an impact, and an output time may lie close to it."""

LEVELS: Final = ((-1.3, -1.9, -2.6), (1, 0.4, -0.3), (3, 2.4, 1.7))
"""Levels of refinement, finer ones where coarser ones leave an own error that matters, or hide it.

No step is a multiple of another, so that no two share output times by chance.
"""

FINER: Final = tuple(level + 2 for level in LEVELS[-1])
"""Levels at which the errors of a weak solver, or one of order 1, are confirmed: a quarter of the finest steps."""


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
"""Knob -> how it is printed, and what to look at if it separates right from wrong."""


def knob_text(knobs: Knobs, name: str) -> str:
    """Return one knob as text."""
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
"""The factors that are varied, and their levels: ``damping`` as a fraction of omega_0, ``pull`` the weight as a
fraction of the largest centrifugal force, omega_0^2 L / 2, ``ratio`` the bottle's mass over that of the water: at any
spin drag holds slices, and weight lifts them, in some throws. Values in brackets are one level and take turns."""

FULL: Final = replace(PAPER, mass=0.05, filling=1.0, damping=0.0, gravity=0.0, theta0=0.7, omega0=-12.0, angle=4.0)
"""A light full bottle: of its four slices two rest on the ends, and two strike both ends at one instant.

Where the tube recoils, rounding decides whether a solver applies these hits together or in turn: neither is wrong.
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
"""A bottle of 8 mm with slices of 0.3 mm: shows a cut-off of lengths, masses or drag coefficients."""

SLOW: Final = replace(PAPER, slices=5, start="scattered", omega0=0.45, gravity=0.005, damping=0.05, angle=6.0)
"""A bottle that turns once in 14 s: shows a cut-off of spins, accelerations or durations."""

NARROW: Final = replace(PAPER, mass=0.5, length=0.14, filling=0.996, slices=1, start="scattered")
"""A single slice with half a millimetre of room: water that is taken for ice if it has little room shows here."""

NO_SCALE: Final = "the equation has no scale of its own: look for a constant in "

SIMILAR: Final[Mapping[Knobs, tuple[Knobs, str, str]]] = MappingProxyType(
    {
        SMALL: (
            replace(SMALL, mass=2.7, length=0.24, radius=0.09, capacity=5.4, gravity=60.0),
            "right in a bottle of 0.24 m, wrong in one of 8 mm that moves in proportion",
            f"{NO_SCALE}m, kg, kg/s or m/s, such as a least height, room, mass, drag or speed",
        ),
        SLOW: (
            replace(SLOW, omega0=18.0, gravity=8.0, damping=2.0),
            "right at 18 rad/s, wrong at 0.45 rad/s where everything moves in proportion",
            f"{NO_SCALE}rad/s, m/s, m/s^2, 1/s or s, such as a least spin, speed, weight, drag or a longest flight",
        ),
        NARROW: (
            replace(NARROW, filling=0.5),
            "right in a bottle half full, wrong in one in which water has half a millimetre of room",
            "water moves however little room it has: look for a least room, or for water that is taken for ice",
        ),
    }
)
"""Throws that differ from one of these in its scale or room alone: how wrong is told from right, and the advice."""

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
    throws = [_shortened(knobs, seed, MAX_IMPACTS) for knobs in throws]
    return (*throws, *(replace(knobs, frozen=True) for knobs in throws))


MAX_IMPACTS: Final = 100
"""Impacts of a throw beyond one per slice: more, if elastic or in a light bottle, tell nothing new and take long."""

FEW_IMPACTS: Final = 20
"""The same if one knob is turned: after many impacts a right solver's own error matters, too."""


def _shortened(knobs: Knobs, seed: int, impacts_left: int) -> Knobs:
    """Return the throw, ended after ``impacts_left`` impacts plus one per slice, by Eq. 8 and in free flight."""
    whole = replace(knobs, times="at the end alone").ask(seed)
    share = 1.0
    for model in ("eq8", "free-flight"):
        impacts = ode_reference.solve(started(whole), model, whole.times).impacts
        allowed = impacts_left + knobs.slices
        if impacts is not None and len(impacts.time) > allowed:
            share = min(share, 0.99 * float(impacts.time[allowed]) / whole.scenario.duration)
    return replace(knobs, angle=share * knobs.angle)


# ---------------------------------------------------------------------- the reference


@lru_cache(maxsize=256)
def _reference_flight(switches: Switches, throw: Scenario, times: bytes, rest_speed: float) -> Trajectory:
    return ode_reference.solve(throw, switches, np.frombuffer(times), rest_speed=rest_speed)


def references(equation: str, ask: Ask) -> list[Trajectory]:
    """Return the exact flight of an equation from the ask's start, and twins in release and in rest speed.

    A solver's rest speed is its own affair: with recoil it may be a fixed one or a fraction of the speeds of the throw.
    """
    switches = switches_of(equation)
    throw, times = started(ask), ask.times.tobytes()
    bottle = replace(throw.bottle, mass=throw.bottle.mass * (1 + 1e-6))
    perturbed = replace(throw, bottle=bottle, omega0=throw.omega0 * (1 + 1e-6))
    fixed, other = rest_speed_of(switches), usual_rest_speed(switches, throw) / 10 if switches.recoil else 1e-3
    return [
        _reference_flight(switches, throw, times, fixed),
        _reference_flight(switches, perturbed, times, fixed),
        _reference_flight(switches, throw, times, other),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What is wrong on one throw: field -> (difference, room, time), fractions of its scale.

    ``own_error`` is the solver's own error of omega where it was compared, ``largest`` the largest difference of omega,
    ``share`` the share of output times that were compared. ``error`` says why there is no answer, ``onset`` after which
    impact it goes wrong, ``impacts_passed`` how many it gets right before, ``listed`` what is wrong with its impacts.
    """

    wrong: Mapping[str, tuple[float, float, float]]
    own_error: float = 0.0
    largest: float = 0.0
    share: float = 1.0
    error: str = ""
    onset: str = ""
    impacts_passed: int = 0
    listed: str = ""

    @property
    def largest_wrong(self) -> float:
        """The largest difference of the wrong fields, 0 if none is wrong."""
        return max((difference for difference, _, _ in self.wrong.values()), default=0.0)

    @property
    def excess(self) -> float:
        """The largest difference over its room."""
        return max((difference / room for difference, room, _ in self.wrong.values()), default=0.0)


def compare(traits: Traits, ask: Ask, answers: Sequence[Answer], equation: str, unrefined: float) -> Comparison:
    """Compare the answer to one throw; ``answers`` holds the finest, then coarser ones if the solver can be refined."""
    truth, *twins = references(equation, ask)
    scale = scales(ask.scenario, truth.inertia)
    reached = min(len(run.t) for run in (truth, *twins))

    def sizes(flight: Any, other: Any, name: str) -> FloatArray:
        difference = np.abs(getattr(flight, name)[:reached] - getattr(other, name)[:reached]) / scale[name]
        return np.asarray(difference)

    def grown(values: FloatArray) -> FloatArray:
        return np.maximum.accumulate(values if values.ndim == 1 else values.max(axis=1))

    finest = answers[0]
    floor = max(FLOOR, 1024 * traits.epsilon)
    names = [name for name in scale if getattr(finest, name) is not None]
    rooms: dict[str, FloatArray] = {}
    own_errors: dict[str, FloatArray] = {}
    for name in names:
        summarize = grown if name != "v" else lambda x: np.full(reached, np.quantile(x, 1 - STRAY))
        own_error = np.max(
            [np.zeros(reached), *(summarize(sizes(finest, coarser, name)) for coarser in answers[1:])], axis=0
        )
        own_errors[name] = own_error if len(answers) > 1 else np.full(reached, unrefined)
        rooms[name] = floor + OWN * own_errors[name] + BAND * sum(summarize(sizes(truth, twin, name)) for twin in twins)
    clear = rooms["omega"] <= BLURRED
    wrong: dict[str, tuple[float, float, float]] = {}
    first_wrong = float(ask.times[-1])
    for name in names:
        errors = sizes(finest, truth, name)[clear]
        room = rooms[name][clear]
        if not errors.size:
            continue
        if name == "v":
            beyond = errors > 10 * room[:, None]
            if np.count_nonzero(beyond) <= max(2, STRAY * errors.size):
                continue
        rows = errors if errors.ndim == 1 else errors.max(axis=1)
        k = int(np.argmax(rows / room))
        if not rows[k] <= room[k]:
            wrong[name] = float(rows[k]), float(room[k]), float(ask.times[k])
            row = int(np.argmax(rows > room))
            first_wrong = min(first_wrong, float(ask.times[:reached][clear][row]))
    impacts_passed, onset = _onset(ask, truth.impacts or NO_IMPACTS, first_wrong) if wrong else (0, "")
    listed = ""
    if finest.impacts is not None and clear.any():
        room_of_r = rooms.get("r", rooms["omega"])[clear]
        by_rest_speed = [
            _unmatched(ask, finest.impacts, run.impacts or NO_IMPACTS, room_of_r, ask.times[:reached][clear])
            for run in (truth, twins[-1])
        ]
        unmatched = [miss for miss in by_rest_speed if miss is not None]
        if len(unmatched) == len(by_rest_speed):
            wrong["impacts"] = unmatched[0]
            listed = _listed_wrongly(ask, finest.impacts, truth.impacts or NO_IMPACTS)
    return Comparison(
        wrong=wrong,
        own_error=float(np.max(own_errors["omega"][clear])) if clear.any() else float(own_errors["omega"].min()),
        largest=float(np.max(sizes(finest, truth, "omega")[clear], initial=0.0)),
        share=float(np.mean(clear)) * reached / len(ask.times),
        onset=onset,
        impacts_passed=impacts_passed,
        listed=listed,
    )


def _onset(ask: Ask, impacts: Impacts, first_wrong: float) -> tuple[int, str]:
    """Return how many impacts are right before the first wrong time [s], and after which it goes wrong, as a phrase."""
    last_right = np.max(ask.times[ask.times < first_wrong], initial=0.0)
    count = int(np.sum(impacts.time <= last_right))
    between = np.flatnonzero((impacts.time > last_right) & (impacts.time < first_wrong))
    if not between.size:
        return count, f"after {count} impacts that were right" if count else "before the first impact"
    k = int(between[0])
    together = between[np.abs(impacts.time[between] - impacts.time[k]) < 1e-9 * ask.scenario.duration]
    ends = {"base" if end > 0 else "cap" for end in impacts.end[together].tolist()}
    struck = f"slice {impacts.slice[k]} on the {ends.pop()}"
    if len(together) > 1:
        struck = f"slices {', '.join(map(str, impacts.slice[together].tolist()))} {AT_ONCE}"
    so_far = f"{count} impacts that were right, " if count else ""
    return count, f"after {so_far}the impact of {struck} at {impacts.time[k]:.3g} s"


AT_ONCE: Final = "at one instant"


FAINT: Final = 0.02
"""Speed, fraction of L omega_0, below which an impact need not be answered: a slice may rest there."""


def _unmatched(
    ask: Ask, answered: Impacts, truth: Impacts, room_of_r: FloatArray, times: FloatArray
) -> tuple[float, float, float] | None:
    """Return difference, room and time of the impact that most exceeds its room from any in the other list.

    Impacts of one slice on one end are matched by time and number, up to the last of ``times``; a slice that is off by
    ``room_of_r`` is late by that over its speed. Fractions of the flight; None if every impact has its match.
    """
    throw, misses = ask.scenario, []
    faint = FAINT * throw.bottle.length * abs(throw.omega0)
    for listed, counterpart in ((answered, truth), (truth, answered)):
        for k in np.flatnonzero(listed.speed_before > faint):
            time, row = listed.time[k], int(np.searchsorted(times, listed.time[k]))
            if row == len(times):
                continue
            delay = float(room_of_r[row]) * throw.bottle.length / listed.speed_before[k]
            room = FLOOR + delay / throw.duration
            # Faint ones near it need not be answered, either.
            own_distances, distances = (
                np.sort(
                    np.abs(hits.time[(hits.slice == listed.slice[k]) & (hits.end == listed.end[k]) & counted] - time)
                )
                / throw.duration
                for hits, counted in ((listed, listed.speed_before > faint), (counterpart, True))
            )
            count = int(np.sum(own_distances <= room))
            distance = float(distances[count - 1]) if count <= len(distances) else 1.0
            if distance > 2 * room and time + 2 * room * throw.duration < times[-1]:
                misses.append((distance, 2 * room, float(time)))
    return max(misses, key=lambda miss: miss[0] / miss[1], default=None)


def _listed_wrongly(ask: Ask, answered: Impacts, truth: Impacts) -> str:
    """Return which impacts a list lacks, has besides, or gives another slice or end; empty if not clear."""
    throw = ask.scenario
    fast = FAINT * throw.bottle.length * abs(throw.omega0)
    expected = np.flatnonzero((truth.speed_before > fast) & (truth.time < 0.999 * ask.times[-1]))
    near = np.abs(answered.time[:, None] - truth.time) < 1e-3 * throw.duration
    same = {name: getattr(answered, name)[:, None] == getattr(truth, name) for name in ("slice", "end")}
    exact = near & same["slice"] & same["end"]
    odd = ~exact.any(axis=1) & (answered.speed_before > fast)
    lacking = [int(k) for k in expected if not exact[:, k].any()]
    for name, other in (("slice", "end"), ("end", "slice")):
        if named := [k for k in lacking if np.any(near[odd, k] & same[other][odd, k])]:
            return f"{len(named)} of {len(expected)} name another {name}"
    if lacking:
        kinds = {
            "on the cap": truth.end == CAP,
            "on the base": truth.end == BASE,
            **{f"of slice {k}": truth.slice == k for k in range(throw.n_slices)},
            "after which a slice rests": truth.speed_after == 0.0,
            "after the first": np.arange(len(truth)) > 0,
        }
        fits = [kind for kind, of_kind in kinds.items() if expected[of_kind[expected]].tolist() == lacking]
        which = fits[0] if fits else f"at {times_text(truth.time[lacking])}"
        return f"{len(lacking)} of {len(expected)} are missing, those {which}"
    if odd.any():
        return f"{np.sum(odd)} are listed where there is none, at {times_text(answered.time[odd])}"
    return f"{len(answered)} are listed, {len(truth)} expected" if len(answered) != len(truth) else ""


def times_text(times: FloatArray) -> str:
    """Return at most three times [s] in words."""
    return f"{', '.join(f'{time:.3g}' for time in times[:3])} s{' ...' if len(times) > 3 else ''}"


ComparisonsGenerator = Generator[Sequence[Ask], Sequence[Answer], list[Comparison]]
TextGenerator = Generator[Sequence[Ask], Sequence[Answer], str]


def comparing(
    traits: Traits,
    throws: Sequence[Knobs],
    seed: int,
    equation: str,
    unrefined: float,
    all_levels: Sequence[Sequence[float]] = LEVELS,
) -> ComparisonsGenerator:
    """Ask for throws, at three levels if the solver can be refined and at finer ones if needed, and compare each.

    For ice the step makes no error: one level is enough.
    """
    asks, comparisons = [knobs.ask(seed) for knobs in throws], {}
    remaining = list(range(len(asks)))
    for levels in all_levels if traits.refined_by else ((0,),):
        asks_by_throw = {
            k: [
                replace(asks[k], effort=effort_of(traits, asks[k].scenario, level))
                for level in (levels[:1] if throws[k].frozen else levels)
            ]
            for k in remaining
        }
        with suppress(ForeignError):
            # All at once, in case somebody writes the answers by hand.
            yield [ask for series in asks_by_throw.values() for ask in series]
        for k, series in asks_by_throw.items():
            try:
                comparisons[k] = compare(
                    traits, asks[k], (yield series), equation, 0.0 if throws[k].frozen else unrefined
                )
            except ForeignError as error:
                comparisons[k] = Comparison(wrong={"answer": (1.0, 1e-3, 0.0)}, error=str(error))
        # What fails at long steps need not fail at short ones.
        remaining = [
            k
            for k in remaining
            if comparisons[k].error
            or OWN * comparisons[k].own_error > FLOOR
            or (throws[k].frozen and comparisons[k].wrong)
        ]
    return [comparisons[k] for k in range(len(asks))]


def confirmed(
    traits: Traits, knobs: Knobs, comparison: Comparison, seed: int, equation: str, unrefined: float
) -> Generator[Sequence[Ask], Sequence[Answer], Comparison]:
    """Return the comparison of a wrong throw at the finest levels.

    A step that something else limits, such as an output time or a longest step, is the same at all coarse levels: its
    error does not show there as a change. Where impacts wait for the grid, or the order is 1, errors fall by leaps, and
    three levels may agree by chance: a solver of order 1, or whose own error is still ``WEAK``, is asked at ``FINER``
    ones, and compared there if it answers.
    """
    if traits.refined_by is None or knobs.frozen or comparison.error:
        return comparison
    (comparison,) = yield from comparing(traits, [knobs], seed, equation, unrefined, LEVELS[-1:])
    if comparison.wrong and (comparison.own_error >= WEAK or (traits.order or math.inf) <= 1.0):
        (finer,) = yield from comparing(traits, [knobs], seed, equation, unrefined, [FINER])
        return comparison if finer.error else finer
    return comparison


DENSE: Final = 2000
"""Output times of a throw that is asked once more at many."""


def check_elsewhere(traits: Traits, seed: int = SEED) -> CheckGenerator:
    """Other bottles, fillings, slices, starts, spins and times: every field is that of the equation."""
    place = yield from placing(traits)
    equation = traits.equation or place.equation
    if not place.on_lattice or place.equation != name_of(switches_of(equation)):
        raise NotApplicableError("needs an equation that the solver is found to solve")
    unrefined = min(0.01 + 4 * place.distance, 0.018)  # as far off as on the throws that place it, below blurring
    throws = (*drawn(seed), SMALL, SLOW, NARROW)
    flights = list(zip(throws, (yield from comparing(traits, throws, seed, equation, unrefined)), strict=True))
    # Where a solver of low order errs less by luck, it is held to no more than its typical error.
    typical_error = (
        float(np.median([comparison.own_error for knobs, comparison in flights if not knobs.frozen]))
        if traits.refined_by
        else 0.0
    )
    wrong = [
        (knobs, comparison)
        for knobs, comparison in flights
        if comparison.largest_wrong > (0.0 if knobs.frozen else typical_error)
    ]
    wrong = [flight for flight in wrong if not flight[0].frozen] or wrong
    wrong.sort(key=lambda flight: -flight[1].excess)
    while wrong:
        finest = yield from confirmed(traits, *wrong[0], seed, equation, unrefined)
        if finest.wrong:
            break
        wrong = wrong[1:]
    own_error = max((comparison.own_error for _, comparison in flights if not comparison.error), default=0.0)
    facts = {
        "seed": seed,
        "elsewhere": [
            {
                "own": comparison.own_error,
                "largest": comparison.largest,
                "judged": comparison.share,
                "wrong": sorted(comparison.wrong),
            }
            for _, comparison in flights
        ],
    }
    expected = f"{equation} in every field, on {len(flights)} throws of seed {seed}"
    (full,) = yield from comparing(traits, [FULL], seed, equation, unrefined)
    in_turn = bool(full.wrong) and not full.error and switches_of(equation).recoil
    if full.wrong and not in_turn and not wrong:
        wrong = [(FULL, full)]
    if not wrong:
        largest = max(comparison.largest for _, comparison in flights)
        blurred = sum(comparison.share < 0.3 for _, comparison in flights)
        weak = own_error > WEAK or blurred > len(flights) // 2
        weak_text = (
            f"its own error, {own_error:.2g} of omega_0, hides mistakes smaller than {OWN * own_error:.2g}"
            if weak
            else ""
        )
        if in_turn:
            weak_text = (
                f"a full bottle with hits on both ends at one instant: {_wrong_text(full)}; in turn, not together?"
            )
        observed = f"at most {largest:.2g} of omega_0 off, its own error {own_error:.2g}"
        return Observation(holds=True, expected=expected, observed=observed, weak=weak_text, facts=facts)
    observed, impacts, advice = yield from bisected(traits, *wrong[0], seed, equation, unrefined)
    if not (wrong[0][0].frozen or wrong[0][1].error or set(wrong[0][1].wrong) == {"v"}):
        with suppress(ForeignError, NotApplicableError):
            departure, cause = yield from departing(traits, equation, [wrong[0][0].ask(seed)])
            if departure:  # more exact than the impact after which the whole flight is first wrong
                together = TOGETHER if wrong[0][0] is FULL else ""
                cause = "" if cause == UNEXPLAINED and "right at " in observed else cause  # the value tells more
                impacts = f"there it departs {departure}; {cause and f'{cause}; '}{together}"
    if traits.refined_by is None and not wrong[0][1].error:
        ask = wrong[0][0].ask(seed)
        times = np.union1d(ask.times, np.linspace(0.0, ask.times[-1], DENSE))
        with suppress(ForeignError):
            (answer,) = yield [replace(ask, times=times)]
            if not compare(traits, replace(ask, times=times), [answer], equation, unrefined).wrong:
                impacts = "right where outputs lie close: look at what goes on within a long step; "
    advice = f"{impacts}{advice}".removesuffix("; ")
    where = "a full bottle, thrown besides" if wrong[0][0] is FULL else f"{len(wrong)} of {len(flights)} throws"
    return Observation(holds=False, expected=expected, observed=observed, where=where, advice=advice, facts=facts)


def bisected(
    traits: Traits, knobs: Knobs, comparison: Comparison, seed: int, equation: str, unrefined: float
) -> Generator[Sequence[Ask], Sequence[Answer], tuple[str, str, str]]:
    """Return a sentence that separates right from wrong by one knob, and what to look at: of impacts, and besides."""
    compare_all: Callable[[Sequence[Knobs]], ComparisonsGenerator] = lambda throws: comparing(  # noqa: E731
        traits, throws, seed, equation, unrefined
    )
    if knobs in SIMILAR:
        similar, text, advice = SIMILAR[knobs]
        (scaled,) = yield from compare_all([similar])
        if not scaled.wrong:
            return f"{text}: {_wrong_text(comparison)}", "", advice
    wrong_text, together = _wrong_text(comparison), TOGETHER if knobs is FULL else ""
    names = [name for name in WORDS if getattr(knobs, name) != getattr(PAPER, name)]
    paper, ice = replace(PAPER, frozen=knobs.frozen), "in ice " if knobs.frozen else ""
    (base,) = yield from compare_all([paper])
    if base.wrong:
        fields = _field_advice(base, ice=knobs.frozen)
        simpler_advice = (
            "" if knobs.frozen or fields else (yield from simpler_throws_advice(traits, equation, unrefined))
        )
        return f"{ice}{_wrong_text(base)} on the paper's throw, too", "", f"{simpler_advice}{fields}"
    single = [_shortened(replace(paper, **{name: getattr(knobs, name)}), seed, FEW_IMPACTS) for name in names]
    trials = sorted(zip(names, single, (yield from compare_all(single)), strict=True), key=lambda row: -row[2].excess)
    for name, throw, trial in trials:
        result = (yield from confirmed(traits, throw, trial, seed, equation, unrefined)) if trial.wrong else trial
        if result.wrong:
            fields = _field_advice(result, ice=knobs.frozen)
            smooth = not (knobs.frozen or fields or result.impacts_passed)
            without = (yield from _without_a_force(compare_all, throw, name)) if smooth else ""
            # A slice that never moves is wrong before any impact.
            knob_advice = "" if name == "slices" and result.impacts_passed else WORDS[name][1]
            return (
                f"{ice}right at {knob_text(PAPER, name)}, wrong at {knob_text(knobs, name)}: {_wrong_text(result)}",
                together or ("" if name == "restitution" else _impact_advice(result)),
                fields or without or knob_advice,
            )
    reverted = yield from compare_all([replace(knobs, **{name: getattr(PAPER, name)}) for name in names])
    decisive = [name for name, result in zip(names, reverted, strict=True) if not result.wrong and result.share > 0.3]
    if 0 < len(decisive) <= 4:
        paper_words, throw_words = (
            " or ".join(knob_text(PAPER, name) for name in decisive),
            " and ".join(knob_text(knobs, name) for name in decisive),
        )
        return (
            f"{ice}right at {paper_words}, wrong at {throw_words} where other things are changed, too: {wrong_text}",
            together or _impact_advice(comparison),
            f"{'; or '.join(WORDS[name][1] for name in decisive)}{_field_advice(comparison, '; ', ice=knobs.frozen)}",
        )
    return (
        f"{ice}{wrong_text} where {', '.join(knob_text(knobs, name) for name in names)}",
        together or _impact_advice(comparison),
        _field_advice(comparison, ice=knobs.frozen),
    )


def _without_a_force(
    compare_all: Callable[[Sequence[Knobs]], ComparisonsGenerator], throw: Knobs, name: str
) -> TextGenerator:
    """Return that a throw, wrong because of one knob, is right without weight or without drag, if it is."""
    trials = {"drag": replace(throw, damping=0.0), "weight": replace(throw, gravity=0.0)}
    trials = {force: trial for force, trial in trials.items() if trial != throw and name not in ("damping", "gravity")}
    results = yield from compare_all(list(trials.values()))
    right = [force for force, result in zip(trials, results, strict=True) if not result.wrong and result.share > 0.3]
    # Without weight nothing may move that drag could spoil.
    return f"there right without {' and without '.join(right)}: look at {LOOK_AT[right[0]]}" if right else ""


def wrong_on_whole(traits: Traits, equation: str) -> TextGenerator:
    """Return what is wrong on a throw with drag and impacts on both ends, beyond the solver's own error; or empty."""
    (comparison,) = yield from comparing(traits, [WHOLE], 0, equation, UNREFINED)
    if comparison.wrong:
        comparison = yield from confirmed(traits, WHOLE, comparison, 0, equation, UNREFINED)
    return _wrong_text(comparison) if "omega" in comparison.wrong else ""


LOOK_AT: Final[Mapping[str, str]] = {
    "weight": "the weight term, g cos(theta) along the bottle",
    "drag": "the drag, alpha v / m, and against what v is measured",
    "impacts": "impacts: restitution, recoil, their places, which slices take part",
    "rests": "rests: when a slice begins to rest on base or cap, when it is let go, and its part in the motion "
    "and the impacts of others",
}
"""What to look at if an answer is right without weight, drag, impacts or rests, in the order they are tested."""


def right_without(name: str) -> str:
    """Return the advice for an answer that is right without one of ``LOOK_AT``."""
    return f"right {'before the first impact' if name == 'impacts' else f'without {name}'}: look at {LOOK_AT[name]}; "


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


def simpler_throws_advice(traits: Traits, equation: str, unrefined: float = UNREFINED) -> TextGenerator:
    """Return which of weight, drag, impacts or rests must be left out to be right, if any, and what to look at."""
    for whole in (WHOLE, STICKY):
        (full,) = yield from comparing(traits, [whole], 0, equation, unrefined)
        if full.wrong:
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
    comparisons = yield from comparing(traits, list(simpler.values()), 0, equation, unrefined)
    right = {
        name: comparison.largest for name, comparison in zip(simpler, comparisons, strict=True) if not comparison.wrong
    }
    if traits.refined_by is None and right:  # the room is wide: a small error may still be the same one
        right = {name: size for name, size in right.items() if size <= 1e-9 + 100 * min(right.values())}
    onset = f"with all of it first wrong {full.onset}; "
    if {"weight", "impacts"} <= right.keys():
        if "rests" in right:
            return f"right without weight, and without rests: look at {LOOK_AT['rests']}; {onset}"
        if full.impacts_passed:
            return f"right without weight, and through some impacts: look at rests and at {LOOK_AT['impacts']}; {onset}"
        return f"right without weight, and before half a turn: look at {LOOK_AT['weight']}, at every angle; {onset}"
    if {"rests", "impacts"} <= right.keys():
        if not full.impacts_passed:
            (sticking,) = yield from comparing(traits, [replace(whole, restitution=0.0)], 0, equation, unrefined)
            if not sticking.wrong:  # with more rests than any other
                return f"right where e is 0 or 1: look at the speed after an impact, e times that before; {onset}"
        return f"right through impacts as long as no slice rests: look at {LOOK_AT['rests']}; {onset}"
    for name in ("weight", "drag", "impacts"):
        if name in right:
            return f"{right_without(name)}{onset}"
    if "all" in right:
        return f"right without weight, drag and impacts together, but wrong if only one of them is removed; {onset}"
    text = "wrong before the first impact without weight and drag, too"
    (centred,) = yield from comparing(traits, [replace(simpler["all"], start="in the middle")], 0, equation, unrefined)
    if not centred.wrong:
        return f"{text}, but right with every slice far from the ends: look at the places of the ends, and at rests; "
    return f"{text}: look at the centrifugal term omega^2 (r - r_cm), the inertia and the masses; "


def _wrong_text(comparison: Comparison) -> str:
    """Return what is wrong, the worst first."""
    if comparison.error:
        return f"no answer ({comparison.error})"
    worst = sorted(
        comparison.wrong, key=lambda name: comparison.wrong[name][0] / comparison.wrong[name][1], reverse=True
    )
    error, room, time = comparison.wrong[worst[0]]
    units = {"omega": "omega_0", "theta": "the angle turned", "inertia": "the largest J", "v": "L omega_0"}
    unit = {**units, "impacts": "the flight"}.get(worst[0], "L")
    further = f", and {', '.join(worst[1:])}" if len(worst) > 1 else ""
    error_text = f"{'are' if worst[0] == 'impacts' else 'is'} {error:.2g} of {unit} off (room {room:.1g})"
    onset = f", first {comparison.onset}" if comparison.onset else ""
    return f"{worst[0]} {error_text} at t = {time:.3g} s{further}{onset}"


TOGETHER: Final = "slices strike both ends at one instant there: each keeps its own speed times -e, none is left out; "
"""What to look at where ``FULL`` alone is wrong."""


def _impact_advice(comparison: Comparison) -> str:
    """Return that impacts are the first suspect, if an answer is right through some of them and wrong later."""
    if AT_ONCE in comparison.onset:
        return "several slices strike at one instant there, and each keeps its own speed times -e; "
    after_impacts = comparison.impacts_passed and not _field_advice(comparison)
    return (
        "right through some impacts: look first at impacts, their number and order (of several in a step the earliest "
        "comes first), and at rests and their ends; "
        if after_impacts
        else ""
    )


def _field_advice(comparison: Comparison, prefix: str = "", *, ice: bool = False) -> str:
    """Return what to look at by the wrong fields, if omega is right; not for a small error after impacts."""
    if ice and set(comparison.wrong) == {"v"}:
        return f"{prefix}what is frozen does not move in the bottle: its v is 0 and stays 0"
    if (
        comparison.error
        or "omega" in comparison.wrong
        or (
            comparison.impacts_passed
            and (
                comparison.largest_wrong < FAINT / 4
                # Further off than the flight is long, they are answered wrongly, not made wrongly.
                or (set(comparison.wrong) == {"impacts"} and comparison.largest_wrong < 1.0)
            )
        )
    ):
        return ""
    fields = ", ".join(comparison.wrong)
    if set(comparison.wrong) == {"impacts"}:
        listed = comparison.listed or "look at time, slice, end and number of each"
        return f"{prefix}the motion is right, the impacts listed are not: {listed}"
    closer = ", and at sign, unit and instant of v" if fields == "v" else ""
    return f"{prefix}omega is right, {fields} not: look at how the answer is put together{closer}"
