"""Adams-Bashforth of second order with a variable step; begun again by a Heun step after each impact."""

import math

import numpy as np


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n = throw.n_slices
    m = throw.slice_mass
    share = bottle.mass / throw.total_mass
    low, high = throw.r_min, throw.r_max

    def centre(r):
        return (1 - share) * r.mean() + share * bottle.length / 2

    def inertia(r):
        c = centre(r)
        tube = bottle.radius**2 / 2 + bottle.length**2 / 12 + (bottle.length / 2 - c) ** 2
        return m * np.sum((r - c) ** 2) + bottle.mass * tube

    def slope(y):
        theta, r, v = y[0], y[1 : n + 1], y[n + 1 :]
        omega = momentum / inertia(r)
        v_c = (1 - share) * v.mean()
        a = omega**2 * (r - centre(r)) + throw.gravity * math.cos(theta) - throw.drag / m * (v - v_c)
        return np.concatenate([[omega], v, a])

    momentum = inertia(ask.start) * throw.omega0
    y = np.concatenate([[throw.theta0], ask.start, np.zeros(n)])
    longest = throw.duration / ask.effort
    t, states = 0.0, []
    before = still_before = None
    for when in ask.times:
        count = math.ceil((when - t) / longest - 1e-9)
        for _ in range(count):
            h = (when - t) / count
            f = slope(y)
            r, v, a = y[1 : n + 1], y[n + 1 :], f[n + 1 :]
            still = throw.frozen | ((r >= high) & (v >= 0) & (a > 0)) | ((r <= low) & (v <= 0) & (a < 0))
            mask = np.concatenate([[True], ~still, ~still])
            f = np.where(mask, f, 0.0)
            if before is None or not np.array_equal(still, still_before):
                g = np.where(mask, slope(y + h * f), 0.0)
                new = y + h / 2 * (f + g)
            else:
                ratio = h / before[0]
                new = y + h * ((1 + ratio / 2) * f - ratio / 2 * before[1])
            before, still_before = (h, f), still
            y = new
            r, v = y[1 : n + 1], y[n + 1 :]
            v[still] = 0.0
            for end, side in ((high, 1), (low, -1)):
                hit = (side * (r - end) > 0) & (side * v > 0)
                if hit.any():
                    before = None
                    since = (r[hit] - end) / v[hit]
                    push = a[hit]
                    after = -throw.restitution * v[hit] + (1 + throw.restitution) * push * since
                    after = np.where(np.abs(after) < np.abs(push) * h, 0.0, after)
                    r[hit], v[hit] = end + after * since, after
        t = when
        states.append(y.copy())
    states = np.array(states)
    r = states[:, 1 : n + 1]
    omega = np.array([momentum / inertia(row) for row in r])
    return {"t": ask.times, "theta": states[:, 0], "omega": omega, "r": r, "v": states[:, n + 1 :]}


solve.name = "Adams-Bashforth 2"
solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 2
