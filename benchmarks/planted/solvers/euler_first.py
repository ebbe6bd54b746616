"""Eq. 8: semi-implicit Euler, a hit is answered at the end of its step; coarse, and declares so: dt, order 1."""

import math

import numpy as np


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n, m, length, total = throw.n_slices, throw.slice_mass, bottle.length, throw.total_mass
    own = bottle.mass * (bottle.radius**2 / 2 + length**2 / 12)

    def turn(r):
        c = (m * r.sum() + bottle.mass * length / 2) / total
        return c, momentum / (own + m * ((r - c) ** 2).sum() + bottle.mass * (length / 2 - c) ** 2)

    theta, r, v, momentum = throw.theta0, ask.start.copy(), np.zeros(n), 1.0
    momentum = throw.omega0 / turn(r)[1]
    t, rows = 0.0, []
    for when in ask.times:
        count = math.ceil((when - t) / ask.effort - 1e-9)
        for _ in range(count):
            h = (when - t) / count
            c, omega = turn(r)
            if not throw.frozen:
                a = omega**2 * (r - c) + throw.gravity * math.cos(theta) - throw.drag / m * (v - m * v.sum() / total)
                v = v + h * a
                r = r + h * v
                out = np.where(r > throw.r_max, 1.0, np.where(r < throw.r_min, -1.0, 0.0)) * v > 0
                back = -throw.restitution * v
                v = np.where(out, np.where(np.abs(back) < np.abs(a) * h, 0.0, back), v)
                r = np.clip(r, throw.r_min, throw.r_max)
            theta += h * omega
        t = when
        rows.append((theta, turn(r)[1], r, v))
    theta, omega, r, v = (np.array(column) for column in zip(*rows))
    return {"t": ask.times, "theta": theta, "omega": omega, "r": r, "v": v}


solve.name = "semi-implicit Euler"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 1
