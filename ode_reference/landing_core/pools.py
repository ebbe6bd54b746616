"""Impulses along the axis: neighbours that approach are pooled."""

from __future__ import annotations

import numpy as np

from ode_reference.landing_core.layout import MOST_POOLS
from slicemodel.compiled import inner


@inner
def pool_chain(x, tube, closed, world, y, total, weight, count):
    """Project ``x`` and ``tube`` on what the closed gaps of a chain allow; return the tube's value and its pool's mass.

    The order is: slices resting on the cap, the tube, slices resting on the base, then slices that touch neither end.
    Along it values may not rise across a closed gap.
    """
    n = world.n
    on_base = 0
    while on_base < n and closed[4 + on_base]:
        on_base += 1
    on_cap = n
    while on_cap > on_base and closed[4 + on_cap]:
        on_cap -= 1
    behind = n - on_cap
    blocks = 0
    for k in range(n + 1):
        if k < behind:
            value, mass, linked = x[on_cap + k], world.m, k > 0
        elif k == behind:
            value, mass, linked = tube, world.tube, k > 0
        else:
            i = k - behind - 1
            value, mass, linked = x[i], world.m, closed[4 + i]
        total[blocks], weight[blocks], count[blocks] = value * mass, mass, 1
        if not linked:
            count[blocks] = -1  # a block that begins a run: negative count
        blocks += 1
        while (
            blocks > 1
            and count[blocks - 1] > 0
            and total[blocks - 1] * weight[blocks - 2] > total[blocks - 2] * weight[blocks - 1]
        ):
            total[blocks - 2] += total[blocks - 1]
            weight[blocks - 2] += weight[blocks - 1]
            joined = abs(count[blocks - 2]) + count[blocks - 1]
            count[blocks - 2] = joined if count[blocks - 2] > 0 else -joined
            blocks -= 1
    k = 0
    at, pooled = tube, world.tube
    for block in range(blocks):
        value = total[block] / weight[block]
        alone = abs(count[block]) == 1
        for _ in range(int(abs(count[block]))):
            if k < behind:
                y[on_cap + k] = x[on_cap + k] if alone else value
            elif k == behind:
                at, pooled = tube if alone else value, weight[block]
            else:
                y[k - behind - 1] = x[k - behind - 1] if alone else value
            k += 1
    return at, pooled


@inner
def pool_stops(x, tube, closed, world, y):
    """Do the same where each slice has its own stops: it is pooled with the tube or with nothing."""
    n = world.n
    below, above = -np.inf, np.inf
    at, pooled = tube, world.tube
    for _ in range(MOST_POOLS):
        mass, momentum = world.tube, world.tube * tube
        for i in range(n):
            if (closed[4 + i] and x[i] > at) or (closed[4 + n + i] and x[i] < at):
                mass += world.m
                momentum += world.m * x[i]
        new = momentum / mass
        pooled = mass
        if new == at:
            break
        # The momentum balance is monotone in the tube's value: keep Newton's step inside what is known of its root.
        if new > at:
            below = at
        else:
            above = at
        if not below <= new <= above:
            new = (below + above) / 2
        at = new
    for i in range(n):
        y[i] = x[i]
        if (closed[4 + i] and x[i] > at) or (closed[4 + n + i] and x[i] < at):
            y[i] = at
    return at, pooled
