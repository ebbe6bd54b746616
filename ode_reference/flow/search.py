r"""The first event of a step: no slice can meet an end, and no end can let go of a slice, without being found.

      w                     "Slice i meets an end" is a line that sweeps the plane of (u, w). The slices that are not
      |   . . . watched     watched, the flock, have abs(u) and abs(u + span w) below ``clear`` when the map starts. As
      |  [flock]  .         long as 0 <= B <= A span, A u + B w = (A - q) u + q (u + span w), q = B / span, is then
      +-----------> u       below A clear. Terms beyond the straight line enter with the sum of their magnitudes.

The slices near an end are looked at one by one: the gap to the end is a polynomial in x = time / step, its first zero
is approached along parabolas that lie below it.
"""

from __future__ import annotations

import math

from ode_reference.flow.layout import NEAR, PLACE, SIDE, SPEED, STALLED, TURN
from ode_reference.flow.points import rebase, set_scales
from ode_reference.flow.series import FORCE, PULL, ROWS, SQUARE, A, B, Z, value
from slicemodel.compiled import inner

POLYNOMIAL = ROWS
"""Row of the table in which the polynomial stands whose zero is sought."""

NONE = 2.0
"""What a search returns if there is no zero in the step."""

MAX_PARABOLAS = 1000
"""Parabolas of one search, of which some ten are needed; a flight that needs more is stalled."""

MARGIN = 1e-13
"""Room that the bound leaves for rounding, in units of the wall's distance."""

ROUNDING = 1e-13
"""Magnitude, against that of its summands, below which a first coefficient is zero: the sign of the next decides."""

STANDING = 1e-14
"""Speed that rounding makes of none, in units of wall * |omega|."""


@inner
def first_zero(now, table, order):
    """Return the first zero in [0, 1] of the polynomial, positive or zero at 0; NONE if none is before ``root``.

    The parabola with value and slope of the polynomial and the most negative curvature that the coefficients allow
    lies below it: its zero is never beyond the polynomial's own, and the last steps are as long as Newton's.
    """
    x = bend = 0.0
    for k in range(2, order + 1):
        bend += k * (k - 1) * abs(table[POLYNOMIAL, k])
    for _ in range(MAX_PARABOLAS):
        gap, rate = value(table, POLYNOMIAL, order, x)
        if gap <= 0.0 and rate <= 0.0:
            return x
        root = math.sqrt(max(rate * rate + 2.0 * bend * gap, 0.0))
        if rate <= 0.0:
            further = 2.0 * gap / (root - rate)
        elif bend > 0.0:
            further = (rate + root) / bend
        else:
            return NONE
        x += further
        if x > 1.0 or x >= now.root:
            return NONE
        if further <= 2e-16 * x:
            return x
    now.status = STALLED
    return NONE


@inner
def first_fall(now, table, order, unit, integrals):
    """Return the first zero of the polynomial over the power of x that it has as a factor; 0 if that is negative at 0.

    What rounding can make counts as a factor. An acceleration has terms of at most ``unit`` (rate h x)^k / k! by the
    fastest rate of the equations, and rounding in it has the same course; it is integrated so many times (0 or 2). So
    the acceleration of a slice and the gap that follows from it are held for zero together.
    """
    lead, rate = integrals, max(now.rate, now.damping)
    unit *= 0.5 if integrals == 2 else 1.0
    while lead <= order and abs(table[POLYNOMIAL, lead]) <= ROUNDING * unit:
        lead += 1
        unit *= rate * now.h / lead
    for k in range(lead, order + 1):
        table[POLYNOMIAL, k - lead] = table[POLYNOMIAL, k]
    if lead > order:
        return NONE
    return 0.0 if table[POLYNOMIAL, 0] < 0.0 else first_zero(now, table, order - lead)


@inner
def contact(now, table, points, j, end):
    """Return when in the step slice j meets ``end`` (+1 base, -1 cap).

    A slice that leaves an end starts there with gap 0 and rate > 0. One that stands still there starts with a gap of
    order x^2: the sign of the first coefficient that is not zero says whether it leaves or is pressed.
    """
    u, w = points[PLACE, j] - now.mu, points[SPEED, j] - now.mw
    for k in range(now.order + 1):
        table[POLYNOMIAL, k] = -end * (table[Z, k] + table[A, k] * u + table[B, k] * w)
    table[POLYNOMIAL, 0] += now.wall - end * now.centre
    gap, rate = table[POLYNOMIAL, 0], table[POLYNOMIAL, 1]
    if abs(gap) <= now.tolerance and abs(rate) <= STANDING * now.wall * abs(now.omega) * now.h:
        return first_fall(now, table, now.order, now.thrust * now.h * now.h, 2)
    if gap < 0.0 < rate:
        table[POLYNOMIAL, 0] = 0.0
    return first_zero(now, table, now.order)


@inner
def release(now, table, end):
    """Return when in the step ``end`` ceases to press on the slices that rest on it."""
    arm = end * now.wall - now.centre
    for k in range(now.order - 1):
        drag = now.push_dz * (k + 1) * table[Z, k + 1] / now.h
        thrown = table[SQUARE, k] * arm - now.push_z * table[PULL, k]
        table[POLYNOMIAL, k] = end * (thrown + drag + now.weight * table[FORCE, k])
    return first_fall(now, table, now.order - 2, now.thrust, 0)


@inner
def find(now, table, points, marks):
    """Set ``root`` to the first event of the step, or NONE; ``struck`` or ``released`` say which it is."""
    now.root, now.struck, now.released = NONE, -1, 0
    for k in range(now.near):
        j = marks[NEAR, k]
        u, w = points[PLACE, j] - now.mu, points[SPEED, j] - now.mw
        begin = now.centre + table[Z, 0] + table[A, 0] * u + table[B, 0] * w
        gone = table[Z, 1] + table[A, 1] * u + table[B, 1] * w
        remainder = now.rest_z + now.rest_A * abs(u) + now.rest_B * abs(w) + MARGIN * now.wall
        for end in (1.0, -1.0):
            if end * begin + max(end * gone, 0.0) + remainder > now.wall:
                x = contact(now, table, points, j, end)
                if x < now.root:
                    now.root, now.struck = x, j
    for end, resting in ((1, now.on_base), (-1, now.on_cap)):
        if resting > 0:
            x = release(now, table, float(end))
            if x < now.root:
                now.root, now.struck, now.released = x, -1, end


@inner
def gather(now, points, marks, longest):
    """Start the map anew and list the slices that may come near an end within its span; the others are the flock.

    The span falls as 1/sqrt(N), and with it how many are watched, while starting anew costs N: so do both sqrt(N).
    """
    rebase(now, points, marks)
    set_scales(now)
    now.span = min(longest, TURN / now.rate / math.sqrt(1.0 + points.shape[1] / 100.0))
    now.clear = now.wall - now.thrust * now.span * now.span - 1e-6 * now.wall
    now.near, now.fastest = 0, 0.0
    for i in range(points.shape[1]):
        if marks[SIDE, i] == 0:
            u, w = points[PLACE, i], points[SPEED, i]
            if max(abs(u), abs(u + now.span * w)) > now.clear:
                marks[NEAR, now.near] = i
                now.near += 1
            else:
                now.fastest = max(now.fastest, abs(w))


@inner
def flock_is_clear(now, table):
    """Return whether no slice of the flock can meet an end in this step."""
    if now.near == now.free:
        return True
    remainder = now.rest_A * (now.clear + abs(now.mu)) + now.rest_B * (now.fastest + abs(now.mw)) + now.rest_z
    for x in range(2):
        a, b = table[A, 0] + x * table[A, 1], table[B, 0] + x * table[B, 1]
        middle = now.centre + table[Z, 0] + x * table[Z, 1] - a * now.mu - b * now.mw
        if not 0.0 <= b <= a * now.span or not abs(middle) + a * now.clear + remainder < (1.0 - MARGIN) * now.wall:
            return False
    return True
