"""Restitution as a solver really has it: measured at both ends, for several speeds, with the threshold it may have."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from flipproof.foreign.answers import Answer
from flipproof.foreign.checking import Found, Making, NotApplicableError, ask_of
from flipproof.foreign.contract import Ask, Traits
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

SPINS: Final = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""Angular velocities at release [rad/s]; the speeds of the first impacts grow with them, from 0.05 to 4 m/s."""

SAMPLES: Final = 2401
TURNS: Final = 5.0
"""omega_0 T of a throw: long enough for the last slice to reach the cap in every equation."""

NEAR: Final = 6
"""Samples on either side of an impact from which its speeds are read; the two next to it are left out."""

SLOWED: Final = 0.6
"""A slice that keeps less than this of its speed from one sample to the next has struck."""

ADMISSIBLE: Final = 0.02
"""How far a measured restitution may be from the one asked for."""

HALVINGS: Final = 5
"""How often the interval of a threshold is halved."""

ASKED: Final = 0.5


@dataclass(frozen=True, slots=True)
class Rebound:
    """One impact as it was measured: ``speed`` before it [m/s], ``restitution``, at ``time`` [s]."""

    end: str
    spin: float
    speed: float
    restitution: float
    time: float


def throw_of(spin: float) -> Scenario:
    """Return the throw whose first impacts are measured: no drag, no gravity, so that all equations of motion agree."""
    return replace(Scenario(), n_slices=4, drag=0.0, gravity=0.0, restitution=ASKED, omega0=spin, duration=TURNS / spin)


def measure(answer: Answer, scenario: Scenario, end: str) -> Rebound | None:
    """Return the first impact of one slice on ``end``, with or without a rebound; None if it reaches no end.

    The last slice strikes the cap first, the second one the base. Speeds are the slopes of two parabolas, through the
    samples before and after the turn, where the parabolas meet.
    """
    assert answer.r is not None
    side, index = (-1.0, scenario.n_slices - 1) if end == "cap" else (1.0, 1)
    x = side * answer.r[:, index]
    wall = side * (scenario.r_min if end == "cap" else scenario.r_max)
    step = float(answer.t[1] - answer.t[0])
    v = np.diff(x)
    fast_enough = v[:-1] > SLOWED * np.maximum.accumulate(v)[:-1]
    slowed = fast_enough & (v[1:] < SLOWED * v[:-1]) & (wall - x[1:-1] < 0.1 * scenario.bottle.length)
    turns = np.flatnonzero(slowed) + 1
    if not turns.size or turns[0] < NEAR + 2 or turns[0] + NEAR + 2 >= len(x):
        return None
    k = int(turns[0])
    before = _parabola(x[k - NEAR - 1 : k - 1], -NEAR - 1)
    after = _parabola(x[k + 2 : k + 2 + NEAR], 2)
    crossing = np.roots(np.polysub(before, after))
    crossing = crossing[np.abs(crossing.imag) < 1e-9].real
    s = float(crossing[np.argmin(np.abs(crossing))]) if crossing.size else 0.0
    s = s if abs(s) <= 2.0 else 0.0
    fast, slow = float(np.polyval(np.polyder(before), s)) / step, float(np.polyval(np.polyder(after), s)) / step
    return Rebound(end, scenario.omega0, fast, -slow / fast, float(answer.t[k]))


def _parabola(x: FloatArray, first: int) -> FloatArray:
    found: FloatArray = np.polyfit(np.arange(first, first + len(x)), x, 2)
    return found


def check_restitution(traits: Traits) -> Making:
    """A slice leaves an end with e times the speed at which it struck, at both ends and at every speed."""
    answers = yield [_ask(traits, spin) for spin in SPINS]
    if answers[0].r is None:
        raise NotApplicableError("no r is given")
    curve = [
        found
        for end in ("base", "cap")
        for spin, answer in zip(SPINS, answers, strict=True)
        if (found := measure(answer, throw_of(spin), end)) is not None
    ]
    if not curve:
        raise NotApplicableError("no slice reaches an end")
    facts = {"restitution": [(r.end, r.speed, r.restitution) for r in curve], "asked": ASKED}
    wrong = [r for r in curve if not abs(r.restitution - ASKED) <= ADMISSIBLE]
    if not wrong:
        largest = max(curve, key=lambda r: abs(r.restitution - ASKED))
        return Found(
            holds=True,
            expected=f"e = {ASKED} within {ADMISSIBLE}",
            came=f"e = {largest.restitution:.4f} where it is farthest off, at {_range(curve)}",
            where=f"{len(curve)} first impacts",
            facts=facts,
        )
    threshold = yield from _threshold(traits, curve)
    if threshold is not None:
        low, high = threshold
        facts["threshold"] = [low, high]
        said = f"none below {(low + high) / 2:.3g} +- {(high - low) / 2:.1g} m/s, a velocity threshold"
        return Found(
            holds=False,
            expected=f"e = {ASKED} within {ADMISSIBLE} at every speed",
            came=said,
            where=f"{wrong[0].end}, {wrong[0].speed:.3g} m/s: e = {wrong[0].restitution:.3f}",
            advice="scale lengths up so that impacts are faster than the threshold, or lower it in the engine",
            facts=facts,
        )
    worst = max(wrong, key=lambda r: abs(r.restitution - ASKED))
    return Found(
        holds=False,
        expected=f"e = {ASKED} within {ADMISSIBLE}",
        came=f"e = {worst.restitution:.4f}",
        where=f"{worst.end}, struck at {worst.speed:.3g} m/s, t = {worst.time:.4g} s",
        advice="the speed after an impact, relative to the bottle, is e times the speed before it",
        facts=facts,
    )


def _ask(traits: Traits, spin: float) -> Ask:
    return ask_of(traits, throw_of(spin), 2, SAMPLES)


def _range(curve: Sequence[Rebound]) -> str:
    speeds = [r.speed for r in curve]
    return f"{min(speeds):.2g} to {max(speeds):.2g} m/s"


def _threshold(
    traits: Traits, curve: Sequence[Rebound]
) -> Generator[Sequence[Ask], Sequence[Answer], tuple[float, float] | None]:
    """Return speeds [m/s] between which rebounds begin, if slow impacts have none and fast ones the right one."""
    for end in ("cap", "base"):
        here = sorted((r for r in curve if r.end == end), key=lambda r: r.speed)
        dead = [r for r in here if abs(r.restitution) < ASKED / 4]
        live = [r for r in here if abs(r.restitution - ASKED) <= 4 * ADMISSIBLE]
        if not dead or not live or dead[-1].speed > live[0].speed or len(dead) + len(live) < len(here):
            continue
        low, high = dead[-1], live[0]
        for _ in range(HALVINGS):
            spin = float(np.sqrt(low.spin * high.spin))
            (answer,) = yield [_ask(traits, spin)]
            found = measure(answer, throw_of(spin), end)
            if found is None:
                break
            low, high = (found, high) if abs(found.restitution) < ASKED / 4 else (low, found)
        return low.speed, high.speed
    return None
