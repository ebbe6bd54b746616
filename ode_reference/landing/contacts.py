"""The gaps of a landing, their rates, and where resting slices lie."""

from __future__ import annotations

import math

from slicemodel.compiled import merged


@merged
def gaps(s, q, sine, cosine, world, out):
    """Write all gaps: four corners over the table, then the slices' [m]; ``sine`` and ``cosine`` are of theta."""
    for c in range(4):
        a = world.half if c < 2 else -world.half
        b = world.radius if c % 2 == 0 else -world.radius
        out[c] = q[1] - a * cosine + b * sine
    n = world.n
    if world.rigid:
        return
    out[4] = world.half - world.rod / 2 - s[0]
    for j in range(1, n):
        out[4 + j] = s[j - 1] - s[j] - world.rod
    out[4 + n] = s[n - 1] + world.half - world.rod / 2


@merged
def rates(w, q, sine, cosine, world, out):
    """Write the rates of all gaps [m/s]; ``sine`` and ``cosine`` are of theta."""
    for c in range(4):
        a = world.half if c < 2 else -world.half
        b = world.radius if c % 2 == 0 else -world.radius
        out[c] = q[4] + q[5] * (a * sine + b * cosine)
    n = world.n
    if world.rigid:
        return
    out[4] = -w[0]
    for j in range(1, n):
        out[4 + j] = w[j - 1] - w[j]
    out[4 + n] = w[n - 1]


@merged
def seat(s, closed, world):
    """Put resting slices exactly on what they rest on: a rebound cut short has left them up to a micrometre off.

    A gap, however small, is no contact, and decides who takes part in the next impact on the table.
    """
    n = world.n
    if world.rigid:
        return
    if closed[4]:
        s[0] = world.half - world.rod / 2
    for j in range(1, n):
        if closed[4 + j]:
            s[j] = s[j - 1] - world.rod
    if closed[4 + n]:
        s[n - 1] = world.rod / 2 - world.half
        j = n - 1
        while j > 0 and closed[4 + j]:
            s[j - 1] = s[j] + world.rod
            j -= 1


@merged
def first_zero(begin, rate, end, h):
    """Return the first zero in (0, h] of the parabola that starts at ``begin`` > 0 with ``rate`` and ends below 0."""
    bend = (end - begin - rate * h) / (h * h)
    root = math.sqrt(max(rate * rate - 4 * bend * begin, 0.0))
    # The product of both zeros is begin / bend; this form of the smaller positive one loses no digits.
    return min(2 * begin / (root - rate), h) if root > rate else h
