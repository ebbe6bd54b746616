"""Which impulses act when slices strike the ends at one instant, x = end * velocity > 0 approaching.

A law reads end, number of slices and approach speed of every contact, writes the speeds ``AFTER``, and returns the
velocity V that the tube gains: none where ``ratio``, m / M_b or 0 without recoil, is 0. To the simultaneous law all
slices at rest on one end are one contact; to the sequential law each is its own, for it may leave at its own speed.
"""

from __future__ import annotations

import math

import numpy as np

from ode_reference.flow.layout import AFTER, APPROACH, COUNT, END, INDEX
from slicemodel.compiled import inner

TIE = 1e-9
"""Approach speeds that differ by no more than this fraction are equal: the first slice strikes first."""

PASSES = 1000
"""Most binary impacts per touching slice of one instant in the sequential law."""

MAX_PIECES = 200
"""Most steps to the zero of f: from any place twenty halvings and as many of Newton's are ample."""


@inner
def simultaneous(now, points, row, e):
    """Write ``AFTER`` from the approach speeds in ``row`` by the law of Newton and Moreau; return V.

    With p_i = m max(0, (1 + e) x_i - s_i V) and V = sum s_i p_i / M_b, a slice that is pushed leaves at -e x_i, and
    from any other the end runs away, x_i - s_i V. V is the zero of

        f(V) = V - (m / M_b) sum s_i max(0, (1 + e) x_i - s_i V),

    which rises and is linear between the corners s_i (1 + e) x_i: Newton's step from the piece of the zero is exact.
    """
    gained, low, high = 0.0, -math.inf, math.inf
    for _ in range(MAX_PIECES):
        total = pushed = 0.0
        for k in range(now.hits):
            end, x = points[END, k], points[row, k]
            if (1.0 + e) * x - end * gained > 0.0:
                total += points[COUNT, k] * end * (1.0 + e) * x
                pushed += points[COUNT, k]
        updated = now.ratio * total / (1.0 + now.ratio * pushed)
        if updated == gained:
            break
        low, high = (gained, high) if updated > gained else (low, gained)
        gained = updated if low < updated < high else 0.5 * (low + high)
    for k in range(now.hits):
        end, x = points[END, k], points[row, k]
        points[AFTER, k] = -e * x if (1.0 + e) * x - end * gained > 0.0 else min(x - end * gained, 0.0)
    return gained


@inner
def sequential(now, points, marks):
    """Return V after binary impacts, the fastest approach first, until nothing approaches.

    Between mirror images rounding must not choose: of slices that approach equally fast the first one comes first.

    An exchange between slices on opposite ends may go on for ever at speeds that fall geometrically: it ends below the
    rest speed, and what still approaches is resolved by the simultaneous law with e = 0.
    """
    e, gained, after = now.restitution, 0.0, points[AFTER, : now.hits]
    for k in range(now.hits):
        after[k] = points[APPROACH, k]
    for _ in range(PASSES * now.hits):
        highest, first = np.max(after), -1
        if highest < now.rest_speed:
            break
        for k in range(now.hits):
            if after[k] >= (1.0 - TIE) * highest and (first < 0 or marks[INDEX, k] < marks[INDEX, first]):
                first = k
        speed = after[first]
        step = points[END, first] * (1.0 + e) * speed * now.ratio / (1.0 + now.ratio)
        for k in range(now.hits):
            after[k] -= points[END, k] * step
        after[first] = -e * speed
        gained += step
    if np.max(after) > 0.0:
        # All of them, for an end that moves on may catch up with a slice that was leaving.
        gained += simultaneous(now, points, AFTER, 0.0)
    return gained
