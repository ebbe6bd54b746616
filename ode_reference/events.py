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

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from ode_reference.contact import SideArray, Walls
from ode_reference.models import BoolArray, Instant
from slicemodel.trajectory import BASE, CAP

Path = Callable[[float], Instant]


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
    path : callable - the state at any time of the step, from the integrator's dense output
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
    path : callable
    resting : array, shape (N,) - end that each slice rests on, else 0
    """
    found: Instant | None = None
    for side in (BASE, CAP):
        on_side = np.flatnonzero(resting == side)
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
    length = end.t - start.t
    heading = np.where(start.v == 0, start.a, start.v)
    reach = length * np.maximum(np.abs(start.v), np.abs(end.v))
    reach += length**2 * np.maximum(np.abs(start.a), np.abs(end.a))
    over = np.maximum(end.r - walls.high, walls.low - end.r)
    near_base = np.maximum(start.r, end.r) + reach > walls.high
    near_cap = np.minimum(start.r, end.r) - reach < walls.low
    turns_once = heading * end.v < 0
    turns_twice = (heading * end.v > 0) & (heading * start.a < 0) & (end.v * end.a > 0)
    ahead = np.where(heading > 0, near_base, near_cap)
    inside = (turns_once & ahead) | (turns_twice & (near_base | near_cap))
    suspects = np.flatnonzero(free & ((over > walls.tolerance) | inside))
    if suspects.size < 2:
        return [int(i) for i in suspects]
    expected = end.t - np.maximum(over[suspects], 0.0) / np.maximum(np.abs(end.v[suspects]), np.finfo(np.float64).tiny)
    return [int(i) for i in suspects[np.argsort(expected, kind="stable")]]


def _node(now: Instant, i: int) -> Node:
    return Node(now.t, float(now.r[i]), float(now.v[i]), float(now.a[i]))


def _first_contact(i: int, a: Node, b: Node, path: Path, walls: Walls) -> float | None:
    """Return the first time in [a.t, b.t] at which slice ``i`` meets an end it moves toward, or None."""

    def at(t: float) -> Node:
        return _node(path(t), i)

    heading = a.v if a.v != 0 else a.a
    if heading * b.v > 0 and heading * a.a < 0 and b.v * b.a > 0:
        middle = at(a.t + (b.t - a.t) * a.a / (a.a - b.a))
        if heading * middle.v < 0 and a.t < middle.t < b.t:
            first = _first_contact(i, a, middle, path, walls)
            return first if first is not None else _first_contact(i, middle, b, path, walls)
    if heading == 0:
        heading = b.v
    ahead, behind = (BASE, CAP) if heading > 0 else (CAP, BASE)
    if walls.gap(ahead, b.r) < -walls.tolerance:
        return _crossing(at, ahead, a, b, walls)
    if heading * b.v >= 0:
        return None
    if walls.gap(behind, b.r) < -walls.tolerance:
        inside = _clear_of(at, behind, a, b, walls)
        return _crossing(at, behind, inside, b, walls)
    turn = at(_root(lambda t: at(t).v, a.t, b.t)) if a.v != 0 else a
    return _crossing(at, ahead, a, turn, walls) if walls.gap(ahead, turn.r) < -walls.tolerance else None


def _clear_of(at: Callable[[float], Node], side: int, a: Node, b: Node, walls: Walls) -> Node:
    """Return a node at which a slice that moves away from ``side`` at ``a`` and beyond it at ``b`` is still inside.

    The gap rises and then falls, so whatever time has a positive gap lies before the crossing sought.
    """
    if walls.gap(side, a.r) > walls.tolerance:
        return a
    node = at(a.t + (b.t - a.t) * a.v / (a.v - b.v))
    while walls.gap(side, node.r) <= 0 and node.t - a.t > 2 * np.spacing(b.t):
        node = at(a.t + (node.t - a.t) / 2)
    return node


def _crossing(at: Callable[[float], Node], side: int, a: Node, b: Node, walls: Walls) -> float:
    """Return the time at which the gap to ``side``, positive at ``a`` and negative at ``b``, is zero.

    Newton's method, kept inside a bracket that shrinks with every evaluation: where Newton leaves the
    bracket (near a turning point) the bracket is halved. A slice that touches at ``a`` meets the end at ``a``.
    """
    gap_a, gap_b = walls.gap(side, a.r), walls.gap(side, b.r)
    if gap_a <= 0:
        return a.t
    low, high = a.t, b.t
    t = low + (high - low) * gap_a / (gap_a - gap_b)
    while high - low > 2 * np.spacing(high):
        node = at(t)
        gap = walls.gap(side, node.r)
        if gap > 0:
            low = t
        else:
            high = t
        closing = side * node.v
        new = t + gap / closing if closing > 0 else -np.inf
        if abs(new - t) <= np.spacing(t):
            return t
        t = new if low < new < high else low + (high - low) / 2
    return high


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of ``function`` between two times at which it has opposite signs, to round-off [s]."""
    return float(brentq(function, low, high, xtol=float(np.spacing(high)), rtol=4 * float(np.finfo(np.float64).eps)))
