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
def pool(x, tube, closed, world, y, total, weight, count):
    """Project ``x`` and ``tube`` on what the closed gaps of a chain allow; return the tube's value and its pool's mass.

    Bodies that touch one another make a run, along which values may not rise: slices resting on the cap, the tube and
    slices resting on the base make one, slices that touch neither end the others.
    """
    n = world.n
    for i in range(n):
        y[i] = x[i]  # stays so for slices that are pooled with nothing
    on_base = 0
    while on_base < n and closed[4 + on_base]:
        on_base += 1
    on_cap = n
    while on_cap > on_base and closed[4 + on_cap]:
        on_cap -= 1
    at, pooled = tube, world.tube
    if on_base > 0 or on_cap < n:
        blocks = 0
        for i in range(on_cap, n):
            blocks = join(x[i], world.m, blocks, total, weight, count)
        blocks = join(tube, world.tube, blocks, total, weight, count)
        for i in range(on_base):
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
    return at, pooled
