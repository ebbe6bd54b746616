r"""Where inside one step of the integrator the first event lies: a slice meets an end, or an end lets go.

    r                                    A slice that turns once inside a step has two monotone pieces:
    wall ---------------x--------        toward one end, then toward the other. On each piece the gap to the
                      /   \              end ahead is monotone, so it is crossed if and only if it is negative
                    /       o v_1 < 0    where the piece ends. The dip drawn here begins and ends inside the
          v_0 > 0 o                      bottle; it is found because its turning point lies beyond the wall.
                  t_0       t_1   t

A slice that leaves a wall at t_0 has gap 0 there, but that end is not ahead of it on the first piece, so the
start of the step is never found again. Limit: velocities that change sign more than twice within one step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

import numpy as np
from scipy.optimize import brentq

from ode_reference.contact import SideArray, Walls
from ode_reference.motion import BoolArray, Instant
from slicemodel.trajectory import BASE, CAP

MOST_NEWTON: Final = 50
"""Steps of Newton's method before a search for a crossing goes on by halving alone."""


class Path(Protocol):
    """The state at any time of one step."""

    def __call__(self, t: float) -> Instant:
        """Return the instant at ``t``."""

    def of_slice(self, t: float, i: int) -> tuple[float, float]:
        """Return position [m] and velocity [m/s] of one slice at ``t``: what a search for a wall needs, and cheap."""


class Node(NamedTuple):
    """One slice at one time: position [m], velocity [m/s], acceleration [m/s^2]."""

    t: float
    r: float
    v: float
    a: float


def event_wall(start: Instant, end: Instant, path: Path, free: BoolArray, walls: Walls) -> tuple[Instant, int] | None:
    """Return the first instant of the step at which a free slice meets an end, and that slice; None if none does.

    Parameters
    ----------
    start, end : Instant - both ends of the step
    path : Path - from the integrator's dense output
    free : array, shape (N,) of bool
    walls : Walls

    Accuracy
    --------
    The time is exact to two units in the last place for the given dense output.
    """
    found: tuple[Instant, int] | None = None
    searching = True
    while searching:
        searching = False
        for i in _suspects(start, end, free, walls):
            first = _first_contact(i, _node(start, i), _node(end, i), path, walls)
            if first is not None and (found is None or first < end.t):
                # The step now ends here: whoever met an end before this instant shows in the next round.
                end = path(first)
                found = (end, i)
                searching = True
                break
    return found


def event_release(start: Instant, end: Instant, path: Path, resting: SideArray) -> Instant | None:
    """Return the first instant of the step at which an end no longer presses on its slices; None if there is none.

    All slices on one end share position and velocity, hence acceleration: one speaks for all. The instant
    returned lies on the far side of the zero, so that whoever asks the model there gets the same answer.

    Parameters
    ----------
    start, end : Instant
    path : Path
    resting : array, shape (N,) - end that each slice rests on, else 0
    """
    found: Instant | None = None
    for side in (BASE, CAP):
        on_side = (resting == side).nonzero()[0]
        if on_side.size and side * end.a[on_side[0]] < 0:
            end = found = _letting_go(side, int(on_side[0]), start, end, path)
    return found


def _letting_go(side: int, i: int, start: Instant, end: Instant, path: Path) -> Instant:
    """Return the instant just after the push on ``side``, felt by slice ``i``, has changed sign within the step."""

    def push(now: Instant) -> float:
        return side * float(now.a[i])

    if push(start) < 0:
        return start
    now = path(_root(lambda t: push(path(t)), start.t, end.t))
    ahead = float(np.spacing(now.t))
    while push(now) >= 0:
        now = path(now.t + ahead) if now.t + ahead < end.t else end
        ahead *= 2
    return now


def _suspects(start: Instant, end: Instant, free: BoolArray, walls: Walls) -> list[int]:
    """Return the free slices that may meet an end in the step, the one expected first in front."""
    heading = np.where(start.v == 0, start.a, start.v)
    turning = heading * end.v
    turns_once = turning < 0
    turns_twice = (turning > 0) & (heading * start.a < 0) & (end.v * end.a > 0)
    over = np.maximum(end.r - walls.high, walls.low - end.r)
    found = over > walls.tolerance
    if np.count_nonzero(turns_once | turns_twice):
        length = end.t - start.t
        reach = length * np.maximum(np.abs(start.v), np.abs(end.v))
        reach += length**2 * np.maximum(np.abs(start.a), np.abs(end.a))
        near_base = np.maximum(start.r, end.r) + reach > walls.high
        near_cap = np.minimum(start.r, end.r) - reach < walls.low
        found |= turns_once & np.where(heading > 0, near_base, near_cap)
        found |= turns_twice & (near_base | near_cap)
    suspects = (free & found).nonzero()[0]
    if suspects.size < 2:
        return [int(i) for i in suspects]
    expected = end.t - np.maximum(over[suspects], 0.0) / np.maximum(np.abs(end.v[suspects]), np.finfo(np.float64).tiny)
    return [int(i) for i in suspects[np.argsort(expected, kind="stable")]]


def _node(now: Instant, i: int) -> Node:
    return Node(now.t, float(now.r[i]), float(now.v[i]), float(now.a[i]))


def _first_contact(i: int, a: Node, b: Node, path: Path, walls: Walls) -> float | None:
    """Return the first time in [a.t, b.t] at which slice ``i`` meets an end it moves toward, or None."""
    heading = a.v if a.v != 0 else a.a
    if heading * b.v > 0 and heading * a.a < 0 and b.v * b.a > 0:
        middle = _node(path(a.t + (b.t - a.t) * a.a / (a.a - b.a)), i)
        if heading * middle.v < 0 and a.t < middle.t < b.t:
            first = _first_contact(i, a, middle, path, walls)
            return first if first is not None else _first_contact(i, middle, b, path, walls)
    if heading == 0:
        heading = b.v
    ahead, behind = (BASE, CAP) if heading > 0 else (CAP, BASE)

    def at(t: float) -> tuple[float, float]:
        return path.of_slice(t, i)

    if walls.gap(ahead, b.r) < -walls.tolerance:
        return _crossing(at, ahead, (a.t, a.r), (b.t, b.r), walls)
    if heading * b.v >= 0:
        return None
    if walls.gap(behind, b.r) < -walls.tolerance:
        return _crossing(at, behind, _clear_of(at, behind, a, b, walls), (b.t, b.r), walls)
    if a.v == 0:
        return None
    turn = _root(lambda t: at(t)[1], a.t, b.t)
    place = at(turn)[0]
    return (
        _crossing(at, ahead, (a.t, a.r), (turn, place), walls) if walls.gap(ahead, place) < -walls.tolerance else None
    )


OfTime = Callable[[float], tuple[float, float]]


def _clear_of(at: OfTime, side: int, a: Node, b: Node, walls: Walls) -> tuple[float, float]:
    """Return a time and place at which a slice that leaves ``side`` at ``a`` and is beyond it at ``b`` is inside.

    The gap rises and then falls, so whatever time has a positive gap lies before the crossing sought.
    """
    if walls.gap(side, a.r) > walls.tolerance:
        return a.t, a.r
    # Where the velocity turns; after a release at v = 0 that may be anywhere, and the acceleration turns before.
    share = a.v / (a.v - b.v) if a.v != 0 else (a.a / (a.a - b.a) if a.a * b.a < 0 else 0.5)
    t = a.t + (b.t - a.t) * share
    while walls.gap(side, at(t)[0]) <= 0 and t - a.t > 2 * np.spacing(b.t):
        t = a.t + (t - a.t) / 2
    return t, at(t)[0]


def _crossing(at: OfTime, side: int, a: tuple[float, float], b: tuple[float, float], walls: Walls) -> float:
    """Return the time at which the gap to ``side``, positive at ``a`` and negative at ``b``, is zero.

    Newton's method, kept inside a bracket that shrinks with every evaluation: where Newton leaves the
    bracket (near a turning point) the bracket is halved. A slice that touches at ``a`` meets the end at ``a``.

    Parameters
    ----------
    at : callable - position and velocity of the slice at a time
    a, b : tuple - time [s] and position [m] of the slice
    """
    (low, r_low), (high, r_high) = a, b
    gap_a, gap_b = walls.gap(side, r_low), walls.gap(side, r_high)
    if gap_a <= 0:
        return low
    t = low + (high - low) * gap_a / (gap_a - gap_b)
    tries = 0
    while high - low > 2 * math.ulp(high):
        r, v = at(t)
        tries += 1
        gap = walls.gap(side, r)
        if gap > 0:
            low = t
        else:
            high = t
        closing = side * v
        new = t + gap / closing if closing > 0 else -math.inf
        if abs(new - t) <= math.ulp(t):
            return t
        # Where round-off in r spoils Newton's steps, the bracket would shrink by units in the last place.
        t = new if low < new < high and tries < MOST_NEWTON else low + (high - low) / 2
    return high


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of ``function`` between two times at which it has opposite signs, to round-off [s]."""
    return float(brentq(function, low, high, xtol=float(np.spacing(high)), rtol=4 * float(np.finfo(np.float64).eps)))
