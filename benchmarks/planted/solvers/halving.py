"""A step with an impact in it is cut into two, and these again, until it is shorter than a tenth of a microsecond.

The state has omega and the slices' momenta; omega is integrated.
"""

import math

import numpy as np

SHORT = 1e-7  # s


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n, m = throw.n_slices, throw.slice_mass
    total, middle = throw.total_mass, bottle.length / 2
    low, high, e = throw.r_min, throw.r_max, throw.restitution
    own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)

    def centre(r):
        return (m * r.sum() + bottle.mass * middle) / total

    def inertia(r):
        c = centre(r)
        return own + m * ((r - c) ** 2).sum() + bottle.mass * (middle - c) ** 2

    def slope(y, free):
        theta, omega, r, p = y[0], y[1], y[2 : n + 2], y[n + 2 :]
        x = r - centre(r)
        force = m * (omega**2 * x + throw.gravity * math.cos(theta)) - throw.drag / m * (p - p.sum() * m / total)
        d = np.empty_like(y)
        d[0] = omega
        d[1] = -2 * omega * (x @ (p * free)) / inertia(r)
        d[2 : n + 2] = p / m * free
        d[n + 2 :] = force * free
        return d

    def trial(y, h, free):
        k1 = slope(y, free)
        k2 = slope(y + h / 3 * k1, free)
        k3 = slope(y + h * (k2 - k1 / 3), free)
        k4 = slope(y + h * (k1 - k2 + k3), free)
        return y + h / 8 * (k1 + 3 * k2 + 3 * k3 + k4)

    everything, nothing = np.ones(n), np.zeros(n)

    def fly(y, h):
        r, p = y[2 : n + 2], y[n + 2 :]
        side = np.where(r >= high, 1.0, np.where(r <= low, -1.0, 0.0))
        if throw.frozen or high - low < 1e-12:
            return trial(y, h, nothing)
        force = slope(y, everything)[n + 2 :]
        held = (side != 0) & (side * force > 0) & (np.abs(p) <= 2 * np.abs(force) * SHORT)
        y = y.copy()
        y[n + 2 :][held] = 0.0
        free = np.where(held, 0.0, 1.0)
        new = trial(y, h, free)
        r, p = new[2 : n + 2], new[n + 2 :]
        away = free * np.where((r > high) & (p > 0), 1.0, np.where((r < low) & (p < 0), -1.0, 0.0))
        lifted = held.any() and (side * slope(new, everything)[n + 2 :] < 0)[held].any()
        if not away.any() and not (lifted and h > SHORT):
            return new
        if h > SHORT:
            return fly(fly(y, h / 2), h / 2)
        new[2 : n + 2] = np.where(away > 0, high, np.where(away < 0, low, r))
        new[n + 2 :] = np.where(away != 0, -e * p, p)
        return new

    y = np.concatenate([[throw.theta0, throw.omega0], ask.start, np.zeros(n)])
    t, rows = 0.0, []
    for when in ask.times:
        parts = math.ceil((when - t) / ask.effort - 1e-9)
        for _ in range(parts):
            y = fly(y, (when - t) / parts)
        t = when
        rows.append(y)
    rows = np.array(rows)
    return {"t": ask.times, "theta": rows[:, 0], "omega": rows[:, 1], "r": rows[:, 2 : n + 2], "v": rows[:, n + 2 :] / m}


solve.name = "steps cut in two until an impact is found"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 4
solve.timeout = 300.0
