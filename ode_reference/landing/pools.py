"""Impulses along the axis: neighbours that approach are pooled."""

from __future__ import annotations

from slicemodel.compiled import merged


@merged
def join(value, mass, blocks, total, weight, count):
    """Add a body behind ``blocks`` of pooled ones, pool those that approach, and return how many blocks there are."""
    total[blocks], weight[blocks], count[blocks] = value * mass, mass, 1
    while blocks > 0 and total[blocks] * weight[blocks - 1] > total[blocks - 1] * weight[blocks]:
        total[blocks - 1] += total[blocks]
        weight[blocks - 1] += weight[blocks]
        count[blocks - 1] += count[blocks]
        blocks -= 1
    return blocks + 1


@merged
def reached(closed, n):
    """Return how many slices the base carries, and from which on the cap does: runs of closed gaps from either end."""
    on_base = 0
    while on_base < n and closed[4 + on_base]:
        on_base += 1
    on_cap = n
    while on_cap > on_base and closed[4 + on_cap]:
        on_cap -= 1
    return on_base, on_cap


@merged
def pool_flying(x, on_base, on_cap, closed, world, y, total, weight, count):
    """Project ``x`` of the slices that neither end carries on what the closed gaps between them allow.

    Bodies that touch one another make a run, along which values may not rise.
    """
    for i in range(on_base, on_cap):
        y[i] = x[i]  # stays so for slices that are pooled with nothing
    j = on_base + 1
    while j < on_cap:
        if closed[4 + j]:
            k = j - 1
            blocks = join(x[k], world.m, 0, total, weight, count)
            while j < on_cap and closed[4 + j]:
                blocks = join(x[j], world.m, blocks, total, weight, count)
                j += 1
            for block in range(blocks):
                end = k + int(count[block])
                if end > k + 1:
                    value = total[block] / weight[block]
                    for i in range(k, end):
                        y[i] = value
                k = end
        j += 1


@merged
def pool_tube(x, tube, on_base, on_cap, world, y, total, weight, count):
    """Project ``x`` and ``tube`` in the run of the tube and what its ends carry; return its value and its pool's mass.

    The run: slices resting on the cap, the tube, slices resting on the base.
    """
    n = world.n
    if on_base == 0 and on_cap == n:
        return tube, world.tube
    at, pooled = tube, world.tube
    blocks = 0
    for i in range(on_cap, n):
        y[i] = x[i]
        blocks = join(x[i], world.m, blocks, total, weight, count)
    blocks = join(tube, world.tube, blocks, total, weight, count)
    for i in range(on_base):
        y[i] = x[i]
        blocks = join(x[i], world.m, blocks, total, weight, count)
    k, behind = 0, n - on_cap
    for block in range(blocks):
        end = k + int(count[block])
        if end > k + 1:
            value = total[block] / weight[block]
            for j in range(k, end):
                if j == behind:
                    at, pooled = value, weight[block]
                else:
                    y[on_cap + j if j < behind else j - behind - 1] = value
        k = end
    return at, pooled
