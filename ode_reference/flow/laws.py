"""Which impulses act when slices strike the ends at one instant, x = end * velocity > 0 approaching.

A law reads end, number of slices and approach speed of every contact, writes the speeds ``AFTER``, and returns the
velocity V that the tube gains: none where ``ratio``, m / M_b or 0 without recoil, is 0. All slices at rest on one end
are one contact.
"""

from __future__ import annotations

import math

from ode_reference.flow.layout import AFTER, APPROACH, COUNT, END
from slicemodel.compiled import inner

MAX_PIECES = 200
"""Most steps to the zero of f: from any place twenty halvings and as many of Newton's are ample."""


@inner
def simultaneous(now, points):
    """Write ``AFTER`` from the approach speeds by the law of Newton and Moreau; return V.

    With p_i = m max(0, (1 + e) x_i - s_i V) and V = sum s_i p_i / M_b, a slice that is pushed leaves at -e x_i, and
    from any other the end runs away, x_i - s_i V. V is the zero of

        f(V) = V - (m / M_b) sum s_i max(0, (1 + e) x_i - s_i V),

    which rises and is linear between the corners s_i (1 + e) x_i: Newton's step from the piece of the zero is exact.
    """
    e, gained, low, high = now.restitution, 0.0, -math.inf, math.inf
    for _ in range(MAX_PIECES):
        total = pushed = 0.0
        for k in range(now.hits):
            end, x = points[END, k], points[APPROACH, k]
            if (1.0 + e) * x - end * gained > 0.0:
                total += points[COUNT, k] * end * (1.0 + e) * x
                pushed += points[COUNT, k]
        updated = now.ratio * total / (1.0 + now.ratio * pushed)
        if updated == gained:
            break
        low, high = (gained, high) if updated > gained else (low, gained)
        gained = updated if low < updated < high else 0.5 * (low + high)
    for k in range(now.hits):
        end, x = points[END, k], points[APPROACH, k]
        points[AFTER, k] = -e * x if (1.0 + e) * x - end * gained > 0.0 else min(x - end * gained, 0.0)
    return gained
