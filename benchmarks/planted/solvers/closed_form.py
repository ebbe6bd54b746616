"""The exact path of a slice while omega, theta and the centre stand still: at the middle of each step."""

import math

import numpy as np


class Water:
    def __init__(self, throw, start):
        self.throw, self.bottle = throw, throw.bottle
        self.gamma = throw.damping_rate
        self.low, self.high = throw.r_min, throw.r_max
        self.theta, self.r, self.v = throw.theta0, start.copy(), np.zeros(len(start))
        self.momentum = self.inertia(start) * throw.omega0

    def centre(self, r):
        return (self.throw.slice_mass * r.sum() + self.bottle.mass * self.bottle.length / 2) / self.throw.total_mass

    def inertia(self, r):
        c, bottle = self.centre(r), self.bottle
        tube = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12 + (bottle.length / 2 - c) ** 2)
        return tube + self.throw.slice_mass * ((r - c) ** 2).sum()

    def frozen_field(self, theta, r, v):
        """Return omega and the place from which slices are driven away."""
        omega = self.momentum / self.inertia(r)
        v_c = self.throw.slice_mass * v.sum() / self.throw.total_mass
        forced = self.throw.gravity * math.cos(theta) + 2 * self.gamma * v_c
        return omega, self.centre(r) - forced / omega**2

    def path(self, r, v, omega, origin, t):
        """Return r and v after the times t."""
        k = math.sqrt(omega**2 + self.gamma**2)
        grow, fall = np.exp((k - self.gamma) * t), np.exp(-(k + self.gamma) * t)
        c, s = (grow + fall) / 2, (grow - fall) / 2
        x = r - origin
        return (
            origin + (c + self.gamma / k * s) * x + s / k * v,
            omega**2 / k * s * x + (c - self.gamma / k * s) * v,
        )

    def step(self, h):
        if self.throw.frozen:
            self.theta += h * self.momentum / self.inertia(self.r)
            return
        omega, origin = self.frozen_field(self.theta, self.r, self.v)
        a = omega**2 * (self.r - origin) - 2 * self.gamma * self.v
        free = ~((self.r >= self.high) & (self.v >= 0) & (a > 0) | (self.r <= self.low) & (self.v <= 0) & (a < 0))
        self.v[~free] = 0.0
        r, v = self.r[free], self.v[free]
        r_mid, v_mid = self.r.copy(), self.v.copy()
        r_mid[free], v_mid[free] = self.path(r, v, omega, origin, h / 2)
        np.clip(r_mid, self.low, self.high, out=r_mid)
        omega, origin = self.frozen_field(self.theta + h / 2 * omega, r_mid, v_mid)
        self.r[free], self.v[free] = self.path(r, v, omega, origin, h)
        self.theta += h * omega
        for side, end in ((1, self.high), (-1, self.low)):
            for i in np.flatnonzero(free & (side * (self.r - end) > 0) & (side * self.v > 0)):
                since = (self.r[i] - end) / self.v[i]
                for _ in range(8):  # back along the path to the end
                    r_hit, v_hit = self.path(self.r[i], self.v[i], omega, origin, -since)
                    since += (r_hit - end) / v_hit
                    since = min(max(since, 0.0), h)
                self.r[i], self.v[i] = self.path(end, -self.throw.restitution * v_hit, omega, origin, since)
                if side * (self.r[i] - end) >= 0:
                    self.r[i], self.v[i] = end, 0.0


def solve(ask):
    water = Water(ask.scenario, ask.start)
    t, rows = 0.0, []
    for when in ask.times:
        count = math.ceil((when - t) / ask.effort - 1e-9)
        for _ in range(count):
            water.step((when - t) / count)
        t = when
        inertia = water.inertia(water.r)
        rows.append((water.theta, water.momentum / inertia, water.r.copy(), water.v.copy(), inertia))
    theta, omega, r, v, inertia = (np.array(column) for column in zip(*rows))
    return {"t": ask.times, "theta": theta, "omega": omega, "r": r, "v": v, "inertia": inertia}


solve.name = "closed form at the middle of the step"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 2
