"""Eq. 8 in single precision, for a graphics card: explicit midpoint rule in the scaled unknowns

    y = (r - L/2) / (L/2)   and   u = r' / (|omega0| L/2)   over   tau = |omega0| t ,

increments summed with Kahan's compensation. An impact is the root of the parabola of the step. dt limits the step.
"""
import math

import numpy as np

F = np.float32
REST = F(2e-4)  # a slice that leaves an end more slowly, against a push, stays on it


class Sum:
    """A running sum in single precision that keeps what rounding loses."""

    def __init__(self, value):
        self.value = np.array(value, dtype=F)
        self.lost = np.zeros_like(self.value)

    def add(self, increment):
        wanted = increment - self.lost
        new = self.value + wanted
        self.lost = (new - self.value) - wanted
        self.value = new

    def set(self, where, values):
        self.value[where] = values[where]
        self.lost[where] = 0


class Card:
    def __init__(self, throw, start):
        bottle = throw.bottle
        self.n = throw.n_slices
        self.half = bottle.length / 2
        self.unit = abs(throw.omega0)  # of inverse time
        share = throw.water_mass / (throw.water_mass + bottle.mass)
        total = throw.water_mass + bottle.mass
        self.share = F(share)
        self.shell = F((1 - share) * ((bottle.radius / self.half) ** 2 / 2 + 1 / 3))
        self.reach = F(1 - throw.water_mass / bottle.capacity / self.n)
        self.g = F(throw.gravity / (self.half * self.unit**2))
        self.rate = F(throw.drag * self.n / throw.water_mass / self.unit)
        self.e = F(throw.restitution)
        self.ice = throw.frozen or self.reach < 1e-6
        self.scale = total * self.half**2  # of moments of inertia
        self.y = Sum((np.array(start) - self.half) / self.half)
        self.u = Sum(np.zeros(self.n))
        self.turned = Sum(np.zeros(1))
        self.theta0 = throw.theta0
        y = self.y.value
        y[np.abs(np.abs(y) - self.reach) < 1e-6] = np.sign(y[np.abs(np.abs(y) - self.reach) < 1e-6]) * self.reach
        self.turn = F(math.copysign(1, throw.omega0))
        self.spin = self.turn * self.inertia(y)

    def inertia(self, y):
        mean = np.mean(y)
        centre = self.share * mean
        return self.shell + self.share * np.mean((y - mean) ** 2) + self.share * mean**2 - centre**2

    def rates(self, y, u, turned):
        """Angular velocity and acceleration of the slices."""
        omega = self.spin / self.inertia(y)
        # the turn in double precision only to bring it into one revolution
        angle = F(math.remainder(self.theta0 + float(turned[0]), math.tau))
        centre, drift = self.share * np.mean(y), self.share * np.mean(u)
        return omega, omega**2 * (y - centre) + self.g * np.cos(angle) - self.rate * (u - drift)

    def lying(self, a):
        """Slices at rest on an end that pushes them to it."""
        y, u = self.y.value, self.u.value
        return (np.abs(y) == self.reach) & (u == 0) & (y * a >= 0)

    def step(self, h):
        y, u, turned = self.y.value, self.u.value, self.turned.value
        omega, a = self.rates(y, u, turned)
        still = self.lying(a) | self.ice
        a[still] = 0
        half = h / F(2)
        y_mid, u_mid = y + half * u, u + half * a
        omega, a = self.rates(y_mid, u_mid, turned + half * omega)
        a[still] = 0
        self.turned.add(h * omega)
        y0, u0 = y.copy(), u.copy()
        self.y.add(h * u_mid)
        self.u.add(h * a)
        if not self.ice:
            self.bounce(y0, u0, a, h)

    def bounce(self, y0, u0, a, h):
        """Slices that the parabola y0 + u0 s + a s^2 / 2 takes past an end leave it again with restitution."""
        y, u = self.y.value, self.u.value
        side = np.sign(y).astype(F)
        turning = (u0 * u < 0) & (u0 * a < 0)
        side[turning] = np.sign(u0[turning])
        farthest = y.copy()
        farthest[turning] = (y0 - u0**2 / (2 * np.where(a == 0, F(1), a)))[turning]
        out = side * farthest > self.reach
        if not out.any():
            return
        gap = np.maximum(self.reach - side * y0, F(0))
        speed, pull = side * u0, side * a
        with np.errstate(divide="ignore", invalid="ignore"):
            disc = np.sqrt(np.maximum(speed**2 + 2 * pull * gap, F(0)))
            s = np.where(speed >= 0, 2 * gap / (speed + disc), (disc - speed) / pull)
        s = np.clip(np.nan_to_num(s), F(0), h)
        left = h - s
        after = self.e * (speed + pull * s)
        y_new = self.reach - after * left + pull * left**2 / 2
        u_new = -after + pull * left
        stays = (after <= REST) & (pull > 0) | (y_new > self.reach)
        y_new = np.where(stays, self.reach, y_new)
        u_new = np.where(stays, F(0), u_new)
        self.y.set(out, side * y_new)
        self.u.set(out, side * u_new)


def solve(ask):
    card = Card(ask.scenario, ask.start)
    longest = card.unit * ask.effort
    if card.rate > 0:
        longest = min(longest, 0.5 / float(card.rate))
    theta, omega, r, v, inertia = [], [], [], [], []
    before = 0.0
    for t in ask.times:
        span = card.unit * (t - before)
        steps = math.ceil(span / longest)
        for _ in range(steps):
            card.step(F(span / steps))
        before = t
        y = card.y.value
        theta.append(card.theta0 + float(card.turned.value[0]))
        omega.append(float(card.spin / card.inertia(y)) * card.unit)
        inertia.append(float(card.inertia(y)) * card.scale)
        r.append(card.half * (1.0 + y.astype(float)))
        v.append(card.half * card.unit * card.u.value.astype(float))
    return {
        "t": ask.times,
        "theta": np.array(theta),
        "omega": np.array(omega),
        "r": np.array(r),
        "v": np.array(v),
        "inertia": np.array(inertia),
    }


solve.name = "midpoint rule in single precision"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 2
solve.precision = "float32"
