"""Restitution as a solver really has it: measured at both ends, for several speeds, with the threshold it may have."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from flipproof.foreign.checking import Found, Making, NotApplicableError, ask_of
from flipproof.foreign.contract import Answer, Ask, Traits
from slicemodel import Scenario

ASKED: Final = 0.5
ADMISSIBLE: Final = 0.02
"""The restitution asked for, and how far a measured one may be from it."""


@dataclass(frozen=True, slots=True)
class Rebound:
    """One impact as it was measured: ``speed`` before it [m/s], ``restitution``, at ``time`` [s]."""

    end: str
    spin: float
    speed: float
    restitution: float
    time: float


def throw_of(spin: float) -> Scenario:
    """Return the throw whose first impacts are measured: no drag, no gravity, so that all equations of motion agree.

    With omega_0 T = 5 the last slice reaches the cap in every one of them.
    """
    return replace(Scenario(), n_slices=4, drag=0.0, gravity=0.0, restitution=ASKED, omega0=spin, duration=5.0 / spin)


def measure(answer: Answer, scenario: Scenario, end: str) -> Rebound | None:
    """Return the first impact of one slice on ``end``, with or without a rebound; None if it reaches no end.

    The last slice strikes the cap first, the second one the base. A slice has struck that keeps less than 0.6 of its
    speed from one sample to the next. Speeds are the slopes of two parabolas where they meet, each through ``near``
    samples before and after the turn; the two next to it are left out.
    """
    assert answer.r is not None
    near, slowed = 6, 0.6
    side, index = (-1.0, scenario.n_slices - 1) if end == "cap" else (1.0, 1)
    x = side * answer.r[:, index]
    wall = side * (scenario.r_min if end == "cap" else scenario.r_max)
    step = float(answer.t[1] - answer.t[0])
    v = np.diff(x)
    fast_enough = v[:-1] > slowed * np.maximum.accumulate(v)[:-1]
    struck = fast_enough & (v[1:] < slowed * v[:-1]) & (wall - x[1:-1] < 0.1 * scenario.bottle.length)
    turns = np.flatnonzero(struck) + 1
    if not turns.size or turns[0] < near + 2 or turns[0] + near + 2 >= len(x):
        return None
    k = int(turns[0])
    before = np.polyfit(np.arange(-near - 1, -1), x[k - near - 1 : k - 1], 2)
    after = np.polyfit(np.arange(2, 2 + near), x[k + 2 : k + 2 + near], 2)
    crossing = np.roots(np.polysub(before, after))
    crossing = crossing[np.abs(crossing.imag) < 1e-9].real
    s = float(crossing[np.argmin(np.abs(crossing))]) if crossing.size else 0.0
    s = s if abs(s) <= 2.0 else 0.0
    fast, slow = float(np.polyval(np.polyder(before), s)) / step, float(np.polyval(np.polyder(after), s)) / step
    return Rebound(end, scenario.omega0, fast, -slow / fast, float(answer.t[k]))


def check_restitution(traits: Traits) -> Making:
    """A slice leaves an end with e times the speed at which it struck, at both ends and at every speed."""
    spins = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # with them first impacts come at 0.05 to 4 m/s
    answers = yield [_ask(traits, spin) for spin in spins]
    if answers[0].r is None:
        raise NotApplicableError("no r is given")
    curve = [
        found
        for end in ("base", "cap")
        for spin, answer in zip(spins, answers, strict=True)
        if (found := measure(answer, throw_of(spin), end)) is not None
    ]
    if not curve:
        raise NotApplicableError("no slice reaches an end")
    facts: dict[str, Any] = {"restitution": [(r.end, r.speed, r.restitution) for r in curve], "asked": ASKED}
    wrong = [r for r in curve if not abs(r.restitution - ASKED) <= ADMISSIBLE]
    worst = max(wrong or curve, key=lambda r: abs(r.restitution - ASKED))
    expected, came, advice = f"e = {ASKED} within {ADMISSIBLE}", f"e = {worst.restitution:.4f}", ""
    if not wrong:
        speeds = [r.speed for r in curve]
        came += f" where it is farthest off, at {min(speeds):.2g} to {max(speeds):.2g} m/s"
        where = f"{len(curve)} first impacts"
    elif (threshold := (yield from _threshold(traits, curve))) is not None:
        low, high = threshold
        facts["threshold"] = [low, high]
        expected += " at every speed"
        came = f"none below {(low + high) / 2:.3g} +- {(high - low) / 2:.1g} m/s, a velocity threshold"
        where = f"{wrong[0].end}, {wrong[0].speed:.3g} m/s: e = {wrong[0].restitution:.3f}"
        advice = "scale lengths up so that impacts are faster than the threshold, or lower it in the engine"
    else:
        where = f"{worst.end}, struck at {worst.speed:.3g} m/s, t = {worst.time:.4g} s"
        advice = "the speed after an impact, relative to the bottle, is e times the speed before it"
    return Found(holds=not wrong, expected=expected, came=came, where=where, advice=advice, facts=facts)


def _ask(traits: Traits, spin: float) -> Ask:
    return ask_of(traits, throw_of(spin), 2, 2401)


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
        for _ in range(5):
            spin = float(np.sqrt(low.spin * high.spin))
            (answer,) = yield [_ask(traits, spin)]
            found = measure(answer, throw_of(spin), end)
            if found is None:
                break
            low, high = (found, high) if abs(found.restitution) < ASKED / 4 else (low, found)
        return low.speed, high.speed
    return None
