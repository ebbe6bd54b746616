r"""The first event of a step: no slice can meet an end, and no end can let go of a slice, without being found.

      w                     "Slice i meets an end" is a line that sweeps the plane of (u, w). As long as
      |   . . . watched     0 <= B <= A span, four extremes of the slices that are not watched, those of u and of
      |  [flock]  .         u + span w, bound their places: A u + B w = (A - q) u + q (u + span w), q = B / span.
      +-----------> u       Terms of the series beyond the straight line enter with the sum of their magnitudes.

The slices near an end are looked at one by one: the gap to the end is a polynomial in x = time / step, its first zero
is approached along parabolas that lie below it.
"""

from __future__ import annotations

import math
from typing import Any

from ode_reference.flow.layout import NEAR, PLACE, SIDE, SPEED, STILL, WATCHED, IntArray
from ode_reference.flow.series import FORCE, PULL, ROWS, SQUARE, A, B, Z, slope, value
from slicemodel.compiled import inner
from slicemodel.trajectory import FloatArray

POLYNOMIAL = ROWS
"""Row of the table in which the polynomial stands whose zero is sought."""

NONE = 2.0
"""What a search returns if there is no zero in the step."""

MOST_PARABOLAS = 200
"""Parabolas of one search; then the step ends where they have come, and a new one begins there."""

MARGIN = 1e-13
"""Room that the bound leaves for rounding, in units of the wall's distance."""

ROUNDING = 1e-13
"""Magnitude, against that of its summands, below which a first coefficient is zero: the sign of the next decides."""


@inner
def first_zero(table: FloatArray, order: int, x: float) -> tuple[float, bool]:
    """Return the first zero in [x, 1] of the polynomial, positive or zero at x, and whether it is one; NONE if none.

    The parabola with value and slope of the polynomial and the most negative curvature that the coefficients allow
    lies below it: its zero is never beyond the polynomial's own, and the last steps are as long as Newton's.
    """
    bend = 0.0
    for k in range(2, order + 1):
        bend += k * (k - 1) * abs(table[POLYNOMIAL, k])
    for _ in range(MOST_PARABOLAS):
        gap, rate = value(table, POLYNOMIAL, order, x), slope(table, POLYNOMIAL, order, x)
        if gap <= 0.0 and rate <= 0.0:
            return x, True
        root = math.sqrt(max(rate * rate + 2.0 * bend * gap, 0.0))
        if rate > 0.0:
            if bend == 0.0:
                return NONE, False
            further = (rate + root) / bend
        else:
            further = 2.0 * gap / (root - rate)
        x += further
        if x > 1.0:
            return NONE, False
        if further <= 2e-16 * x:
            return x, True
    return x, False


@inner
def without_leading_zeros(now: Any, table: FloatArray, order: int, unit: float, integrals: int) -> int:
    """Divide the polynomial by the power of x that it has as a factor, but for rounding; return the order of the rest.

    An acceleration has terms of at most ``unit`` (rate h x)^k / k! by the fastest rate of the equations, and rounding
    in it has the same course; it is integrated so many times (0 or 2). So the acceleration of a slice and the gap that
    follows from it are held for zero together. The order is -1 if nothing is left.
    """
    lead, rate = 0, max(now.rate, now.damping)
    unit *= 0.5 if integrals == 2 else 1.0
    while lead <= order and abs(table[POLYNOMIAL, lead]) <= ROUNDING * unit:
        lead += 1
        unit *= rate * now.h / (lead + integrals)
    for k in range(order - lead + 1):
        table[POLYNOMIAL, k] = table[POLYNOMIAL, k + lead]
    return order - lead


@inner
def sum_rests(now: Any, table: FloatArray) -> None:
    """Sum the magnitudes of the terms beyond the straight line: what A, B and z can add in this step."""
    rest_A = rest_B = rest_z = 0.0
    for k in range(2, now.order + 1):
        rest_A += abs(table[A, k])
        rest_B += abs(table[B, k])
        rest_z += abs(table[Z, k])
    now.rest_A, now.rest_B, now.rest_z = rest_A, rest_B, rest_z


@inner
def gather(now: Any, points: FloatArray, marks: IntArray) -> None:
    """List the slices that may come near an end within the span; take the extremes of the others, the flock."""
    wall, span = now.wall, now.span
    clear = wall - 0.5 * now.thrust * span * span - 1e-6 * wall
    now.near = 0
    now.low_u = now.low_far = math.inf
    now.high_u = now.high_far = -math.inf
    now.fastest = 0.0
    for i in range(points.shape[1]):
        marks[WATCHED, i] = 0
        if marks[SIDE, i] == 0:
            u, w = points[PLACE, i], points[SPEED, i]
            far = u + span * w
            if max(abs(u), abs(far)) > clear:
                watch(now, marks, i)
            else:
                now.low_u, now.high_u = min(now.low_u, u), max(now.high_u, u)
                now.low_far, now.high_far = min(now.low_far, far), max(now.high_far, far)
                now.fastest = max(now.fastest, abs(w))


@inner
def watch(now: Any, marks: IntArray, i: int) -> None:
    """Put slice i on the list of those that are looked at one by one."""
    if marks[WATCHED, i] == 0:
        marks[NEAR, now.near] = i
        marks[WATCHED, i] = 1
        now.near += 1


@inner
def flock_is_clear(now: Any, table: FloatArray) -> bool:
    """Return whether no slice of the flock can meet an end in this step."""
    if now.low_u > now.high_u:
        return True
    reach_u = max(abs(now.low_u - now.mu), abs(now.high_u - now.mu))
    rest = now.rest_z + now.rest_A * reach_u + now.rest_B * (now.fastest + abs(now.mw)) + MARGIN * now.wall
    for x in range(2):
        a, b = table[A, 0] + x * table[A, 1], table[B, 0] + x * table[B, 1]
        middle = now.centre + table[Z, 0] + x * table[Z, 1] - a * now.mu - b * now.mw
        q = b / now.span
        if not 0.0 <= q <= a:
            return False
        if not middle + (a - q) * now.high_u + q * now.high_far + rest < now.wall:
            return False
        if not middle + (a - q) * now.low_u + q * now.low_far - rest > -now.wall:
            return False
    return True


@inner
def contact(now: Any, table: FloatArray, points: FloatArray, marks: IntArray, j: int, end: float) -> tuple[float, bool]:
    """Return when in the step slice j meets ``end`` (+1 base, -1 cap), and whether it does or may.

    A slice that leaves an end starts there with gap 0 and rate > 0. One that stands still there starts with a gap of
    order x^2: the sign of the first coefficient that is not zero says whether it leaves or is pressed.
    """
    p, u, w = now.order, points[PLACE, j] - now.mu, points[SPEED, j] - now.mw
    for k in range(p + 1):
        table[POLYNOMIAL, k] = -end * (table[Z, k] + table[A, k] * u + table[B, k] * w)
    table[POLYNOMIAL, 0] += now.wall - end * now.centre
    if marks[STILL, j] == end:
        for k in range(2, p + 1):
            table[POLYNOMIAL, k - 2] = table[POLYNOMIAL, k]
        p = without_leading_zeros(now, table, p - 2, now.thrust * now.h * now.h, 2)
        if p < 0:
            return NONE, False
        if table[POLYNOMIAL, 0] < 0.0:
            return 0.0, True
        return first_zero(table, p, 0.0)
    if table[POLYNOMIAL, 0] < 0.0 < table[POLYNOMIAL, 1]:
        table[POLYNOMIAL, 0] = 0.0
    return first_zero(table, p, 0.0)


@inner
def release(now: Any, table: FloatArray, end: float) -> tuple[float, bool]:
    """Return when in the step ``end`` ceases to press on the slices that rest on it, and whether it does or may."""
    p, arm = now.order - 2, end * now.wall - now.centre
    for k in range(p + 1):
        drag = now.push_dz * (k + 1) * table[Z, k + 1] / now.h
        thrown = table[SQUARE, k] * arm - now.push_z * table[PULL, k]
        table[POLYNOMIAL, k] = end * (thrown + drag + now.weight * table[FORCE, k])
    p = without_leading_zeros(now, table, p, now.thrust, 0)
    if p < 0:
        return NONE, False
    if table[POLYNOMIAL, 0] < 0.0:
        return 0.0, True
    return first_zero(table, p, 0.0)


@inner
def find(now: Any, table: FloatArray, points: FloatArray, marks: IntArray) -> None:
    """Set ``root`` to the first event of the step, or NONE; ``struck`` or ``released`` say which, if any is certain."""
    now.root, now.struck, now.released = NONE, -1, 0
    for k in range(now.near):
        j = marks[NEAR, k]
        u, w = points[PLACE, j] - now.mu, points[SPEED, j] - now.mw
        begin = now.centre + table[Z, 0] + table[A, 0] * u + table[B, 0] * w
        gone = table[Z, 1] + table[A, 1] * u + table[B, 1] * w
        rest = now.rest_z + now.rest_A * abs(u) + now.rest_B * abs(w) + MARGIN * now.wall
        if max(begin, begin + gone) + rest > now.wall:
            note_contact(now, table, points, marks, j, 1.0)
        if min(begin, begin + gone) - rest < -now.wall:
            note_contact(now, table, points, marks, j, -1.0)
    if now.on_base > 0:
        note_release(now, table, 1.0)
    if now.on_cap > 0:
        note_release(now, table, -1.0)


@inner
def note_contact(now: Any, table: FloatArray, points: FloatArray, marks: IntArray, j: int, end: float) -> None:
    """Keep the contact of slice j with ``end`` if it comes first."""
    x, certain = contact(now, table, points, marks, j, end)
    if x < now.root:
        now.root, now.struck, now.struck_end = x, j if certain else -1, int(end)


@inner
def note_release(now: Any, table: FloatArray, end: float) -> None:
    """Keep the release from ``end`` if it comes first."""
    x, certain = release(now, table, end)
    if x < now.root:
        now.root, now.struck, now.released = x, -1, int(end) if certain else 0


@inner
def guessed_step(now: Any, points: FloatArray, marks: IntArray, longest: float) -> float:
    """Return about how long it takes until a watched slice meets an end, at most ``longest`` [s]."""
    h = longest
    for k in range(now.near):
        j = marks[NEAR, k]
        u, w = points[PLACE, j] - now.mu, points[SPEED, j] - now.mw
        y, v = now.y_mean + now.A * u + now.B * w, now.dy_mean + now.dA * u + now.dB * w
        gap = now.wall - y if v > 0.0 else now.wall + y
        if 1e-12 * now.wall < gap < abs(v) * h:
            h = gap / abs(v)
    return min(max(1.02 * h, 1e-3 * longest), longest)
