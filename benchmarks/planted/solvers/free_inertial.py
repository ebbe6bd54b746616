"""Free flight in the frame of the centre of mass, RK4, the tube follows from momentum, impacts by bisection; declares dt, order 4."""

import math

import numpy as np


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n, m, mb, length = throw.n_slices, throw.slice_mass, bottle.mass, bottle.length
    wall, e = length / 2 - throw.slice_height / 2, throw.restitution
    ice = throw.frozen or wall < 1e-12 * length
    near, slow = 1e-10 * length, 2e-4 * length * abs(throw.omega0)
    own = mb * (bottle.radius**2 / 2 + length**2 / 12)
    # s, u: place and speed of the slices as seen from the centre of mass, which no force moves; the tube follows

    def tube(s, u):
        """Place and speed of the tube's middle: with all that rests in it, it balances the free slices."""
        body = mb + m * np.count_nonzero(side)
        at = -m * (s[side == 0].sum() + wall * side.sum()) / (mb + m * n - m * np.count_nonzero(side == 0))
        return at, -m * u[side == 0].sum() / body, body

    def whole(s, u):
        at, speed, _ = tube(s, u)
        return np.where(side == 0, s, at + side * wall), np.where(side == 0, u, speed), at, speed

    def spin(s, at):
        return momentum / (own + m * (s @ s) + mb * at * at)

    def field(y):
        s, u = y[1 : n + 1], y[n + 1 :]
        s, u, at, speed = whole(s, u)
        omega = spin(s, at)
        d = np.zeros_like(y)
        d[0] = omega
        if not ice:
            d[1 : n + 1] = u * (side == 0)
            d[n + 1 :] = (omega * omega * s - throw.drag / m * (u - speed)) * (side == 0)
        return d

    def press(y):
        """Acceleration of each resting slice against the body, outward, as if it were let go."""
        s, u, at, speed = whole(y[1 : n + 1], y[n + 1 :])
        body = mb + m * np.count_nonzero(side)
        middle = at + m * wall * side.sum() / body
        pull = spin(s, at) ** 2 * (s - middle) - throw.drag / body * (u - speed)[side == 0].sum()
        return side * pull

    def step(y, h):
        k1 = field(y)
        k2 = field(y + h / 2 * k1)
        k3 = field(y + h / 2 * k2)
        k4 = field(y + h * k3)
        return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def over(y):
        if ice:
            return False
        s, u, at, speed = whole(y[1 : n + 1], y[n + 1 :])
        x, v = s - at, u - speed
        if ((side == 0) & (np.abs(x) > wall) & (x * v > 0)).any():
            return True
        return bool(side.any() and (press(y) < 0)[side != 0].any())

    def settle(y):
        nonlocal side
        s, u, at, speed = whole(y[1 : n + 1], y[n + 1 :])
        x, v = s - at, u - speed
        end = np.where(np.abs(x) > wall - near, np.sign(x), 0.0)
        contact = (end != 0) & (end * v >= 0)
        if (contact & (side == 0) & (end * v > 0)).any():
            t, w = end[contact], v[contact]

            def push(change):
                return m * np.maximum(t * ((1 + e) * w - change), 0.0)

            a, b = -2 * np.abs(w).max(), 2 * np.abs(w).max()
            for _ in range(120):
                middle = (a + b) / 2
                a, b = (middle, b) if (t * push(middle)).sum() > mb * middle else (a, middle)
            v = v - (a + b) / 2
            v[contact] -= t * push((a + b) / 2) / m
        # back to the frame of the centre of mass, every slice on its own
        speed = -m * v.sum() / (mb + m * n)
        x = np.where(end != 0, end * wall, x)
        at = -m * x.sum() / (mb + m * n)
        y[1 : n + 1], y[n + 1 :] = at + x, speed + v
        rest = (end != 0) & (np.abs(v) < slow)
        while True:
            side = np.where(rest, end, 0.0)
            lifted = rest & (press(y) <= 0)
            if not lifted.any():
                return
            rest = rest & ~lifted

    side = np.zeros(n)
    x = np.clip(ask.start - length / 2, -wall, wall)
    at = -m * x.sum() / (mb + m * n)
    y = np.concatenate([[throw.theta0], at + x, np.zeros(n)])
    momentum = 1.0
    momentum = throw.omega0 / spin(at + x, at)
    if not ice:
        settle(y)
    t, rows = 0.0, []
    for when in ask.times:
        while when - t > 1e-13:
            h = (when - t) / math.ceil((when - t) / ask.effort - 1e-9)
            new = step(y, h)
            if over(new):
                a, b = 0.0, h
                while b - a > 1e-13:
                    half = (a + b) / 2
                    a, b = (a, half) if over(step(y, half)) else (half, b)
                t, y = t + b, step(y, b)
                settle(y)
            else:
                t, y = t + h, new
        s, u, at, speed = whole(y[1 : n + 1], y[n + 1 :])
        rows.append((y[0], spin(s, at), length / 2 + s - at, u - speed, length / 2 - at))
    theta, omega, r, v, r_cm = (np.array(column) for column in zip(*rows))
    return {"t": ask.times, "theta": theta, "omega": omega, "r": r, "v": v, "r_cm": r_cm}


solve.name = "free flight, tube from momentum"
solve.equation = "free-flight"
solve.refined_by = "dt"
solve.order = 4
solve.timeout = 600.0
