"""One landing: from instant to instant until its outcome is certain."""

from __future__ import annotations

import math

import numpy as np

from ode_reference.landing.contacts import first_zero, gaps, rates, seat
from ode_reference.landing.layout import (
    ALOFT,
    BROKEN,
    CAP,
    LANDED,
    LOCATED,
    LYING,
    MAX_TRIALS,
    STILL,
    TIMEOUT,
    TOUCHED,
    UPRIGHT,
    Landing,
)
from ode_reference.landing.motion import energy, impact, step
from slicemodel.compiled import kept_on_disk


@kept_on_disk()
def land(q, s, w, dt, longest, fly, world, every, record):
    """Land from the state (q, s, w), which is changed; stop at a certain outcome, or, to ``fly``, at the first touch.

    q = (x, y, theta, v_x, v_y, omega) of the tube's middle over the table. Row k of ``record`` becomes (t, q, s, w) at
    the first instant from k ``every`` on.
    """
    n = world.n
    rows = 0
    count = 4 if world.rigid else 4 + n + 1
    gap, gap1, rate, ahead = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    closed, touching, taking = np.zeros(count, np.bool_), np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    free, target, work = np.empty(2), np.empty(4), np.empty((3, n + 1))
    x, y, pn, pt = np.empty(n), np.empty(n), np.empty(4), np.empty(4)
    q1, s1, w1 = np.empty(6), np.empty(n), np.empty(n)
    near = world.touching * 2 * world.half
    tolerance = LOCATED * 2 * world.half
    t, rise = 0.0, 0.0
    steps, impacts, unresolved, bounces = 0, 0, 0, 0
    aloft, still = False, 0
    origin = q[0] + world.half * math.sin(q[2])
    # Sines and cosines take a third of a landing: those of an instant, and of the end of a step, are computed once.
    sine, cosine = math.sin(q[2]), math.cos(q[2])
    rates(w, q, sine, cosine, world, rate)
    while t < longest:
        # This instant: whatever touches and approaches strikes.
        gaps(s, q, sine, cosine, world, gap)
        strikes = False
        lowest = gap[0]
        for k in range(count):
            touching[k] = closed[k] or gap[k] <= near
            strikes = strikes or (touching[k] and not closed[k] and rate[k] < -STILL)
            if k < 4:
                lowest = min(lowest, gap[k])
        if fly and lowest <= near and min(rate[0], rate[1], rate[2], rate[3]) < 0.0:
            return Landing(TOUCHED, t, 0.0, 0, 0.0, rise, steps, impacts, unresolved)
        if lowest > ALOFT:
            aloft = True
        elif aloft and lowest < LANDED:
            aloft = False
            bounces += 1
        before = energy(q, s, w, sine, cosine, world)
        if strikes:
            impacts += 1
            if not impact(
                q, s, w, sine, cosine, touching, taking, closed, world, free, target, work, x, y, pn, pt, rate
            ):
                unresolved += 1
            after = energy(q, s, w, sine, cosine, world)
            rise = max(rise, (after - before) / world.saddle)
            before = after
            rates(w, q, sine, cosine, world, rate)
            for k in range(count):
                closed[k] = touching[k] and rate[k] <= STILL
        while rows < len(record) and t >= rows * every:
            record[rows, 0] = t
            record[rows, 1:7] = q
            record[rows, 7 : 7 + n] = s
            record[rows, 7 + n :] = w
            rows += 1
        if not math.isfinite(before):
            return Landing(BROKEN, t, 0.0, bounces, 0.0, rise, steps, impacts, unresolved)
        tilt = abs(q[2] - 2 * math.pi * math.floor(q[2] / (2 * math.pi) + 0.5))
        saddle = world.cap_saddle if tilt > world.cap else world.saddle
        if not fly and before < saddle:
            code = UPRIGHT if tilt < world.upright else CAP if tilt > world.cap else LYING
            slid = q[0] + world.half * math.sin(q[2]) - origin
            margin = (saddle - before) / saddle
            return Landing(code, t, margin, bounces, slid, rise, steps, impacts, unresolved)
        # The time until the next instant: a step, or less if a gap closes in it.
        h = min(dt, longest - t)
        while True:
            steps += 1
            if not step(q, s, w, h, closed, world, free, target, work, x, y, pn, pt, q1, s1, w1):
                unresolved += 1
            sine1, cosine1 = math.sin(q1[2]), math.cos(q1[2])
            gaps(s1, q1, sine1, cosine1, world, gap1)
            again, crossed, until = False, False, h
            for k in range(count):
                if closed[k] or gap1[k] >= -tolerance or gap1[k] >= gap[k]:
                    continue
                if gap[k] <= near:
                    closed[k] = True
                    again = True
                else:
                    crossed = True
                    until = min(until, first_zero(gap[k], rate[k], gap1[k], h))
            if again:
                continue
            if not crossed:
                break
            # Newton's method for the first gap to close, from the parabola through its ends, kept inside what is known.
            low, high, h = 0.0, h, until
            for _ in range(MAX_TRIALS):
                steps += 1
                step(q, s, w, h, closed, world, free, target, work, x, y, pn, pt, q1, s1, w1)
                sine1, cosine1 = math.sin(q1[2]), math.cos(q1[2])
                gaps(s1, q1, sine1, cosine1, world, gap1)
                rates(w1, q1, sine1, cosine1, world, ahead)
                early, min_gap = high - h, np.inf
                for k in range(count):
                    if not closed[k] and gap[k] > near:
                        min_gap = min(min_gap, gap1[k])
                        if ahead[k] < 0.0:
                            early = min(early, gap1[k] / -ahead[k])
                if abs(min_gap) <= tolerance or high - low < 1e-15:
                    break
                if min_gap > 0.0:
                    low = h
                else:
                    high = h
                    for k in range(count):
                        if not closed[k] and gap[k] > near and gap1[k] < 0.0:
                            early = min(early, gap1[k] / max(-ahead[k], STILL))
                h = h + early if low < h + early < high else (low + high) / 2
            break
        t += h
        for k in range(6):
            q[k] = q1[k]
        for i in range(n):
            s[i], w[i] = s1[i], w1[i]
        sine, cosine = sine1, cosine1
        rates(w, q, sine, cosine, world, rate)
        for k in range(count):
            if closed[k] and (pn[k] == 0.0 if k < 4 else rate[k] > STILL):
                closed[k] = False
        seat(s, closed, world)
        still = still + 1 if h < 1e-14 else 0
        if still > 1000:
            return Landing(BROKEN, t, 0.0, bounces, 0.0, rise, steps, impacts, unresolved)
    return Landing(TIMEOUT, t, 0.0, bounces, 0.0, rise, steps, impacts, unresolved)
