"""Bogacki and Shampine's pair with a tolerance; impacts by the secant rule on steps taken again."""

import math

import numpy as np

STICK = 2e-5  # of length times spin


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n, m = throw.n_slices, throw.slice_mass
    low, high = throw.r_min, throw.r_max
    frozen = throw.frozen or high - low < 1e-12
    own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    speed = bottle.length * max(abs(throw.omega0), math.sqrt(throw.gravity / bottle.length))
    scale = np.concatenate([[1.0], np.full(n, bottle.length), np.full(n, speed)])
    longest = min(throw.duration / 20, 0.05 * bottle.length / speed)

    def observe(r):
        c = (m * r.sum() + bottle.mass * bottle.length / 2) / throw.total_mass
        return c, own + m * ((r - c) ** 2).sum() + bottle.mass * (bottle.length / 2 - c) ** 2

    def force(y):
        c, inertia = observe(y[1 : n + 1])
        omega, v = momentum / inertia, y[n + 1 :]
        a = omega**2 * (y[1 : n + 1] - c) + throw.gravity * math.cos(y[0])
        return omega, a - throw.drag / m * (v - m * v.sum() / throw.total_mass)

    def slope(y):
        omega, a = force(y)
        return np.concatenate([[omega], np.where(free, y[n + 1 :], 0.0), np.where(free, a, 0.0)])

    def attempt(y, h):
        k1 = slope(y)
        k2 = slope(y + h / 2 * k1)
        k3 = slope(y + 3 * h / 4 * k2)
        new = y + h / 9 * (2 * k1 + 3 * k2 + 4 * k3)
        k4 = slope(new)
        wrong = h * (-5 / 72 * k1 + k2 / 12 + k3 / 9 - k4 / 8)
        return new, float(np.max(np.abs(wrong) / scale)) / ask.effort

    def margin(y):
        """Return how far inside the most outward slice and the weakest support are; negative if one is past it."""
        r, v = y[1 : n + 1], y[n + 1 :]
        out = np.where(v > 0, high - r, r - low)
        inside = float(out[free].min()) / bottle.length if free.any() else 1.0
        if free.all():
            return inside
        return min(inside, float((side * force(y)[1])[~free].min()) / speed**2 * bottle.length)

    def support(y):
        nonlocal side, free
        r, v = y[1 : n + 1], y[n + 1 :]
        side = np.where(r >= high - near, 1.0, np.where(r <= low + near, -1.0, 0.0))
        v[(side * v > 0)] *= -throw.restitution
        r[side > 0], r[side < 0] = high, low
        a = force(y)[1]
        free = ~((side != 0) & (np.abs(v) < STICK * speed) & (side * a > 1e-9 * speed**2 / bottle.length))
        v[~free] = 0.0
        if frozen:
            free[:] = False

    near = 1e-9 * bottle.length
    y = np.concatenate([[throw.theta0], ask.start, np.zeros(n)])
    momentum = observe(ask.start)[1] * throw.omega0
    side, free = np.zeros(n), np.ones(n, dtype=bool)
    support(y)
    t, h, rows = 0.0, longest / 10, []
    for when in ask.times:
        while when - t > 1e-13:
            step = min(h, when - t, longest)
            new, wrong = attempt(y, step)
            if wrong > 1.0:
                h = step * max(0.2, 0.9 * wrong ** (-1 / 3))
                continue
            if frozen or margin(new) >= 0.0:
                t, y = t + step, new
                h = max(h, step * min(4.0, 0.9 * max(wrong, 1e-9) ** (-1 / 3)))
                continue
            a, b = 0.0, step
            while b - a > 1e-12:
                middle = (a + b) / 2
                if margin(attempt(y, middle)[0]) < 0.0:
                    b = middle
                else:
                    a = middle
            t, y = t + b, attempt(y, b)[0]
            support(y)
        rows.append(y.copy())
    rows = np.array(rows)
    omega = np.array([momentum / observe(r)[1] for r in rows[:, 1 : n + 1]])
    return {"t": ask.times, "theta": rows[:, 0], "omega": omega, "r": rows[:, 1 : n + 1], "v": rows[:, n + 1 :]}


solve.name = "Bogacki-Shampine 3(2)"
solve.equation = "eq8"
solve.refined_by = "rtol"
