"""Eq. 8: RK4 with step doubling and a cap on the step, impacts by bisection; declares rtol."""

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

    def rk4(y, h):
        k1 = field(y)
        k2 = field(y + h / 2 * k1)
        k3 = field(y + h / 2 * k2)
        k4 = field(y + h * k3)
        return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def step(y, h):
        return rk4(rk4(y, h / 2), h / 2)

    scale = np.concatenate([[1.0], np.full(n, length), np.full(n, length * abs(throw.omega0))])

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
    h, cap = 1e-4 / abs(throw.omega0), min(0.15 / abs(throw.omega0), throw.duration / 10)
    for when in ask.times:
        while when - t > 1e-13:
            h = min(h, cap)
            d = min(h, when - t)
            new = step(y, d)
            wrong = np.max(np.abs(new - rk4(y, d)) / scale) / 15 / ask.effort
            if wrong > 1.0:
                h = d * max(0.2, 0.9 * wrong**-0.2)
                continue
            if over(new).any():
                a, b = 0.0, d
                while b - a > 1e-13:
                    half = (a + b) / 2
                    a, b = (a, half) if over(step(y, half)).any() else (half, b)
                t, y = t + b, step(y, b)
                settle(y)
                continue
            t, y = t + d, new
            h = max(h, d * min(3.0, 0.9 * max(wrong, 1e-9) ** -0.2))
        rows.append(y.copy())
    rows = np.array(rows)
    r, v = rows[:, 1 : n + 1], rows[:, n + 1 :]
    omega = np.array([momentum / observe(row)[1] for row in r])
    return {"t": ask.times, "theta": rows[:, 0], "omega": omega, "r": r, "v": v}


solve.name = "RK4 with step doubling, capped"
solve.equation = "eq8"
solve.refined_by = "rtol"
