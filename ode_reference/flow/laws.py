"""Which impulses act when slices strike the ends at one instant, x = end * velocity > 0 approaching.

A law reads the approach speeds ``x`` and the ends of the slices that strike, writes their speeds ``after``, and returns
the velocity V that the tube gains. Slices that rest enter the simultaneous law as two counts, the sequential law one by
one: there each may leave at a speed of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ode_reference.flow.layout import AFTER, APPROACH, CORNER, END, RANK, IntArray
from slicemodel.compiled import inner
from slicemodel.trajectory import FloatArray

TIE = 1e-9
"""Approach speeds that differ by no more than this fraction are equal: the first slice strikes first."""

PASSES = 1000
"""Most binary impacts per touching slice of one instant in the sequential law."""


@inner
def strike(now: Any, points: FloatArray, marks: IntArray) -> float:
    """Write ``after`` by the law of this flight; return V [m/s]."""
    ratio = now.slice_mass / now.bottle_mass
    if now.recoil == 0:
        for k in range(now.hits):
            points[AFTER, k] = -now.restitution * points[APPROACH, k]
        return 0.0
    if now.sequential == 0:
        return simultaneous(now, points, marks, APPROACH, now.restitution, ratio)
    return sequential(now, points, marks, ratio)


@inner
def simultaneous(now: Any, points: FloatArray, marks: IntArray, row: int, e: float, ratio: float) -> float:
    """Write ``AFTER`` from the approach speeds in ``row`` by the law of Newton and Moreau; return V.

    With p_i = m max(0, (1 + e) x_i - s_i V) and V = sum s_i p_i / M_b, a slice that is pushed leaves at -e x_i, and
    from any other the end runs away, x_i - s_i V. V is the zero of

        f(V) = V - (m / M_b) sum s_i max(0, (1 + e) x_i - s_i V),

    which rises and is linear between the corners s_i (1 + e) x_i: it is solved exactly between the two around it.
    """
    gained = tube_velocity(now, points, marks, row, 1.0 + e, ratio)
    for k in range(now.hits):
        pushed = (1.0 + e) * points[row, k] - points[END, k] * gained > 0.0
        points[AFTER, k] = -e * points[row, k] if pushed else min(points[row, k] - points[END, k] * gained, 0.0)
    return gained


@inner
def tube_velocity(now: Any, points: FloatArray, marks: IntArray, row: int, factor: float, ratio: float) -> float:
    """Return the zero V of f. The slices at rest have their corners at 0."""
    hits = now.hits
    # Far to the left the whole base is pushed; a corner on the way right drops a slice of the base or adds one of the
    # cap. Left of the first corner that is not below its candidate the zero has not come yet.
    total, count = 0.0, now.on_base
    for k in range(hits):
        points[CORNER, k], marks[RANK, k] = points[END, k] * factor * points[row, k], k
        if points[END, k] > 0.0:
            total += points[CORNER, k]
            count += 1
    sort(points[CORNER], marks[RANK], hits)
    resting_passed = False
    for k in range(hits + 1):
        candidate = ratio * total / (1.0 + ratio * count)
        if not resting_passed and (k == hits or points[CORNER, k] >= 0.0):
            if candidate <= 0.0:
                return candidate  # type: ignore[no-any-return]
            count += now.on_cap - now.on_base
            candidate = ratio * total / (1.0 + ratio * count)
            resting_passed = True
        if k == hits or candidate <= points[CORNER, k]:
            break
        if points[END, marks[RANK, k]] > 0.0:
            total, count = total - points[CORNER, k], count - 1
        else:
            total, count = total + points[CORNER, k], count + 1
    return candidate  # type: ignore[no-any-return]


@inner
def sort(values: Any, companions: Any, n: int) -> None:
    """Sort the first n values, and their companions with them, in place (Shell)."""
    gap = n // 2
    while gap > 0:
        for i in range(gap, n):
            value, companion, j = values[i], companions[i], i
            while j >= gap and values[j - gap] > value:
                values[j], companions[j] = values[j - gap], companions[j - gap]
                j -= gap
            values[j], companions[j] = value, companion
        gap //= 2


@inner
def sequential(now: Any, points: FloatArray, marks: IntArray, ratio: float) -> float:
    """Return V after binary impacts, the fastest approach first, until nothing approaches.

    Between mirror images rounding must not choose: of slices that approach equally fast the first one comes first.

    An exchange between slices on opposite ends may go on for ever at speeds that fall geometrically: it ends below the
    rest speed, and what still approaches is resolved by the simultaneous law with e = 0.
    """
    e, hits = now.restitution, now.hits
    for k in range(hits):
        points[AFTER, k] = points[APPROACH, k]
    gained, approaching = 0.0, False
    for _ in range(PASSES * hits):
        highest = np.max(points[AFTER, :hits])
        if highest < now.rest_speed:
            break
        fastest = 0
        while points[AFTER, fastest] < (1.0 - TIE) * highest:
            fastest += 1
        speed = points[AFTER, fastest]
        step = points[END, fastest] * (1.0 + e) * speed * ratio / (1.0 + ratio)
        for k in range(hits):
            points[AFTER, k] -= points[END, k] * step
        points[AFTER, fastest] = -e * speed
        gained += step
    for k in range(hits):
        approaching = approaching or points[AFTER, k] > 0.0
    if approaching:
        # All of them, for an end that moves on may catch up with a slice that was leaving.
        gained += simultaneous(now, points, marks, AFTER, 0.0, ratio)
    return gained
