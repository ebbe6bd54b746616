"""What changes the state of a landing: a step of the midpoint rule, and an impact; and its energy."""

from __future__ import annotations

import math

from ode_reference.landing.contacts import rates
from ode_reference.landing.impulses import respond
from ode_reference.landing.layout import MAX_ROUNDS, STILL
from slicemodel.compiled import merged


@merged
def step(q, s, w, h, closed, world, free, target, work, x, y, pn, pt, q1, s1, w1):
    """Write the state a time ``h`` later with the closed contacts as they are; return whether impulses were found."""
    n, m = world.n, world.m
    theta = q[2] + q[5] * h / 2
    sine, cosine = math.sin(theta), math.cos(theta)
    v_r, v_t = q[3] * sine - q[4] * cosine, q[3] * cosine + q[4] * sine
    sum1, sum2 = 0.0, 0.0
    for i in range(n):
        s1[i] = s[i] if world.rigid else s[i] + w[i] * h / 2
        w1[i] = w[i]
        sum1 += s1[i]
        sum2 += s1[i] * s1[i]
    m_all = world.tube + m * n
    a12, a22 = m * sum1, world.tube_inertia + m * sum2
    det = m_all * a22 - a12 * a12
    omega = q[5]
    start = v_r + world.gravity * cosine * h
    for c in range(4):
        target[c] = 0.0
    for _ in range(2):  # the second time with the mean spin of the first: order 2, as the rule itself has
        mean = (q[5] + omega) / 2
        push = 0.0
        rate1, rate2 = 0.0, 0.0
        if world.rigid:
            push = m * sum1 * mean * mean * h / m_all
        else:
            for i in range(n):
                speed = (w[i] + w1[i]) / 2
                rate1 += speed
                rate2 += s1[i] * speed
                x[i] = w[i] + (mean * mean * s1[i] - world.rub * speed) * h
            push = world.rub * m * rate1 * h / world.tube
        side, turn = -2 * m * mean * rate1 * h, -2 * m * mean * rate2 * h
        free[0] = v_t + (side * a22 - a12 * turn) / det - world.gravity * sine * h
        free[1] = q[5] + (m_all * turn - a12 * side) / det
        at, new_t, omega, solved = respond(
            x,
            push,
            start,
            sum1,
            sum2,
            sine,
            cosine,
            theta + omega * h / 2,
            closed,
            target,
            world,
            free,
            work,
            y,
            pn,
            pt,
        )
        if not world.rigid:
            for i in range(n):
                w1[i] = y[i] - at
    new_r = start + at
    q1[3], q1[4], q1[5] = new_r * sine + new_t * cosine, -new_r * cosine + new_t * sine, omega
    q1[0] = q[0] + (q[3] + q1[3]) * h / 2
    q1[1] = q[1] + (q[4] + q1[4]) * h / 2
    q1[2] = theta + omega * h / 2
    if not world.rigid:
        for i in range(n):
            s1[i] += w1[i] * h / 2
    return solved


@merged
def energy(q, s, w, sine, cosine, world):
    """Return the energy over the table [J]; ``sine`` and ``cosine`` are of theta."""
    v_r, v_t = q[3] * sine - q[4] * cosine, q[3] * cosine + q[4] * sine
    total = world.tube * ((q[3] * q[3] + q[4] * q[4]) / 2 + world.gravity * q[1]) + world.tube_inertia * q[5] * q[5] / 2
    for i in range(world.n):
        along, across = v_r + w[i], v_t + s[i] * q[5]
        total += world.m * ((along * along + across * across) / 2 + world.gravity * (q[1] - s[i] * cosine))
    return total


@merged
def strike(q, s, w, sine, cosine, taking, closed, world, free, target, work, x, y, pn, pt, rate):
    """Change the velocities by one impact of the contacts ``taking`` part; return whether impulses were found."""
    v_r, v_t = q[3] * sine - q[4] * cosine, q[3] * cosine + q[4] * sine
    sum1, sum2 = 0.0, 0.0
    for i in range(world.n):
        sum1 += s[i]
        sum2 += s[i] * s[i]
        x[i] = (1.0 + world.e_water) * w[i]
    for c in range(4):
        target[c] = 0.0 if closed[c] else max(-world.e_table * rate[c], 0.0)
    free[0], free[1] = v_t, q[5]
    at, new_t, omega, solved = respond(
        x, 0.0, v_r, sum1, sum2, sine, cosine, q[2], taking, target, world, free, work, y, pn, pt
    )
    if not world.rigid:
        for i in range(world.n):
            # Pooled slices move with the tube exactly: only then does a resting one stay where it is.
            w[i] = (y[i] - at) - world.e_water * w[i]
    new_r = v_r + at
    q[3], q[4], q[5] = new_r * sine + new_t * cosine, -new_r * cosine + new_t * sine, omega
    return solved


@merged
def impact(q, s, w, sine, cosine, touching, taking, closed, world, free, target, work, x, y, pn, pt, rate):
    """Resolve one instant by the law of the world; return whether it could be."""
    count = len(touching)
    rates(w, q, sine, cosine, world, rate)
    if world.in_turn and min(rate[0], rate[1], rate[2], rate[3]) < 0.0:
        for k in range(count):
            taking[k] = touching[k] and k < 4
        if not strike(q, s, w, sine, cosine, taking, closed, world, free, target, work, x, y, pn, pt, rate):
            return False
    for _ in range(MAX_ROUNDS):
        rates(w, q, sine, cosine, world, rate)
        approach = 0.0
        for k in range(count):
            if touching[k]:
                approach = min(approach, rate[k])
        if approach > -STILL:
            return True
        if not strike(q, s, w, sine, cosine, touching, closed, world, free, target, work, x, y, pn, pt, rate):
            return False
    return False
