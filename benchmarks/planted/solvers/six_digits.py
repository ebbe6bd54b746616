"""Eq. 8: implicit midpoint extrapolated once, all numbers printed with six digits; declares dt, order 4, 6 digits."""

import math

import numpy as np



def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n, m, length = throw.n_slices, throw.slice_mass, bottle.length
    low, high, e = throw.r_min, throw.r_max, throw.restitution
    ice = throw.frozen or high - low < 1e-12 * length
    near, slow = 1e-10 * length, 1e-5 * length * max(abs(throw.omega0), math.sqrt(throw.gravity / length))
    own = bottle.mass * (bottle.radius**2 / 2 + length**2 / 12)
    total = throw.total_mass

    def observe(r):
        c = (m * r.sum() + bottle.mass * length / 2) / total
        return c, own + m * ((r - c) ** 2).sum() + bottle.mass * (length / 2 - c) ** 2

    def force(y):
        r, v = y[1 : n + 1], y[n + 1 :]
        c, inertia = observe(r)
        omega = momentum / inertia
        a = omega * omega * (r - c) + throw.gravity * math.cos(y[0]) - throw.drag / m * (v - m * v.sum() / total)
        return omega, a

    def field(y):
        omega, a = force(y)
        return np.concatenate([[omega], free * y[n + 1 :], free * a])

    def once(y, h):
        k = field(y)
        for _ in range(60):
            old, k = k, field(y + h / 2 * k)
            if np.abs(k - old).max() <= 1e-14 * np.abs(k).max():
                break
        return y + h * k

    def step(y, h):
        return (4 * once(once(y, h / 2), h / 2) - once(y, h)) / 3

    def over(y):
        """Which end each free slice is beyond, going out; and which slices have lost their support."""
        r, v = y[1 : n + 1], y[n + 1 :]
        out = free * (((r > high) & (v > 0)) * 1.0 - ((r < low) & (v < 0)))
        if free.all() or ice:
            return out
        return np.where((free == 0) & (side * force(y)[1] < 0), 2.0, out)

    def settle(y):
        """Turn round what goes out at an end, let rest what is slow and pressed."""
        nonlocal side, free
        r, v = y[1 : n + 1], y[n + 1 :]
        side = np.where(r > high - near, 1.0, np.where(r < low + near, -1.0, 0.0))
        r[side > 0], r[side < 0] = high, low
        v[side * v > 0] *= -e
        pressed = (side != 0) & (np.abs(v) < slow) & (side * force(y)[1] > 0)
        v[pressed] = 0.0
        free = np.where(pressed | ice, 0.0, 1.0)

    y = np.concatenate([[throw.theta0], ask.start, np.zeros(n)])
    momentum = observe(ask.start)[1] * throw.omega0
    side, free = np.zeros(n), np.ones(n)
    settle(y)
    t, rows = 0.0, []
    for when in ask.times:
        while when - t > 1e-13:
            h = (when - t) / math.ceil((when - t) / ask.effort - 1e-9)
            new = step(y, h)
            if over(new).any():
                a, b = 0.0, h
                while b - a > 1e-13:
                    half = (a + b) / 2
                    a, b = (a, half) if over(step(y, half)).any() else (half, b)
                t, y = t + b, step(y, b)
                settle(y)
            else:
                t, y = t + h, new
        rows.append(y.copy())
    rows = np.array(rows)
    r, v = rows[:, 1 : n + 1], rows[:, n + 1 :]
    omega = np.array([momentum / observe(row)[1] for row in r])
    def printed(values):
        return np.array([float(f"{x:.6g}") for x in np.ravel(values)]).reshape(np.shape(values))

    return {"t": ask.times, "theta": printed(rows[:, 0]), "omega": printed(omega), "r": printed(r), "v": printed(v)}


solve.name = "extrapolated implicit midpoint, six digits"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 4
solve.precision = "6 digits"
