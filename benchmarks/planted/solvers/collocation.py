"""Eq. 8 by Gauss collocation with three stages (order 6), solved by fixed point iteration; impacts and releases inside the step."""
import numpy as np
from scipy.optimize import brentq

Q = np.sqrt(15.0)
C = np.array([0.5 - Q / 10, 0.5, 0.5 + Q / 10])
A = np.array([
    [5 / 36, 2 / 9 - Q / 15, 5 / 36 - Q / 30],
    [5 / 36 + Q / 24, 2 / 9, 5 / 36 - Q / 24],
    [5 / 36 + Q / 30, 2 / 9 + Q / 15, 5 / 36],
])
B = np.array([5 / 18, 4 / 9, 5 / 18])
TWICE = A @ A
LAST = B @ A
INTERPOLATE = np.linalg.inv(np.vander(C, 3, increasing=True))
REST = 1e-6


class Flight:
    def __init__(self, ask):
        throw, bottle = ask.scenario, ask.scenario.bottle
        self.m, self.total = throw.slice_mass, throw.total_mass
        self.tube, self.half = bottle.mass, bottle.length / 2
        self.own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.e, self.g, self.rate = throw.restitution, throw.gravity, throw.drag / throw.slice_mass
        self.ends = ((1, throw.r_max), (-1, throw.r_min))
        self.length = bottle.length
        self.rest_speed = REST * abs(throw.omega0) * bottle.length
        self.t, self.theta = 0.0, throw.theta0
        self.r = np.array(ask.start, dtype=float)
        self.v = np.zeros_like(self.r)
        for _, end in self.ends:
            self.r[np.abs(self.r - end) < 1e-12 * bottle.length] = end
        self.stuck = bool(throw.frozen) or throw.r_max - throw.r_min < 1e-12 * bottle.length
        self.momentum = self.inertia(self.r) * throw.omega0
        self.dt = throw.duration / ask.effort
        self.rest = np.zeros(len(self.r), dtype=bool)
        self.impacts = []
        if not self.stuck:
            self.settle()

    def centre(self, r):
        return (self.m * r.sum(axis=-1) + self.tube * self.half) / self.total

    def inertia(self, r):
        centre = self.centre(r)
        water = self.m * ((r - centre[..., None]) ** 2).sum(axis=-1)
        return self.own + water + self.tube * (self.half - centre) ** 2

    def push(self, theta, r, v):
        """Spin and acceleration that every slice would have if no end held it."""
        omega = self.momentum / self.inertia(r)
        mean = self.m * v.sum(axis=-1) / self.total
        push = (omega**2)[..., None] * (r - self.centre(r)[..., None])
        push = push - self.rate * (v - mean[..., None])
        return omega, push + (self.g * np.cos(theta))[..., None]

    def step(self, h):
        """One step of h from the present state: (theta, r, v, accelerations of the stages), or None without a fixed point."""
        moves = ~self.rest
        omega, a = self.push(np.asarray(self.theta), self.r, self.v)
        omega, a = np.full(3, float(omega)), np.tile(a * moves, (3, 1))
        before = np.inf
        for _ in range(80):
            theta = self.theta + h * A @ omega
            r = self.r + h * C[:, None] * self.v + h**2 * TWICE @ a
            v = self.v + h * A @ a
            new_omega, new_a = self.push(theta, r, v)
            new_a = new_a * moves
            change = h**2 * np.abs(new_a - a).max() / self.length + h * np.abs(new_omega - omega).max()
            omega, a = new_omega, new_a
            if change < 1e-16 or (change < 1e-13 and change >= before):
                break
            before = change
        else:
            return None
        if not change < 1e-12:
            return None
        return (self.theta + h * B @ omega, self.r + h * self.v + h**2 * LAST @ a, self.v + h * B @ a, a)

    def take(self, h, new):
        self.t += h
        self.theta, self.r, self.v = new[:3]

    def first_impact(self, h, a):
        """(fraction of the step, slice, end) of the first arrival at an end by the collocation polynomial."""
        q = h**2 * (INTERPOLATE @ a)
        series = np.array([h * self.v, q[0] / 2, q[1] / 6, q[2] / 12])
        first = (2.0, None, None)
        for sign, end in self.ends:
            gap = self.r - end
            near = np.abs(gap) <= np.abs(series).sum(axis=0) * (1 + 1e-9)
            for i in np.flatnonzero(near & ~self.rest):
                poly = np.append(series[::-1, i], gap[i])
                slope = np.polyder(poly)
                if abs(gap[i]) < 1e-15 * self.length:
                    poly = poly[:-1]
                for root in np.roots(poly):
                    x = root.real
                    if abs(root.imag) < 1e-9 and 1e-13 < x <= 1 and sign * np.polyval(slope, x) > 0 and x < first[0]:
                        first = (x, i, end)
        return first

    def first_release(self, h, new):
        """Time within the step at which an end lets go of the first resting slice, and that slice."""
        first = (2 * h, None)
        if not self.rest.any():
            return first
        signs = np.where(self.r > self.half, 1, -1)
        after = signs * self.push(np.asarray(new[0]), new[1], new[2])[1]
        for i in np.flatnonzero(self.rest & (after < 0)):
            def force(part):
                theta, r, v = self.step(part)[:3] if part else (self.theta, self.r, self.v)
                return float(signs[i] * self.push(np.asarray(theta), r, v)[1][i])
            when = brentq(force, 0.0, h, xtol=1e-16, rtol=1e-14) if force(0.0) > 0 else 0.0
            if when < first[0]:
                first = (when, i)
        return first

    def settle(self):
        """Slices that lie on an end without speed rest there while they are pressed."""
        push = self.push(np.asarray(self.theta), self.r, self.v)[1]
        self.rest[:] = False
        for sign, end in self.ends:
            self.rest |= (self.r == end) & (self.v == 0) & (sign * push > 0)

    def strike(self):
        """Reverse every slice that has arrived at an end."""
        struck = False
        for sign, end in self.ends:
            for i in np.flatnonzero((sign * (self.r - end) > -1e-13 * self.length) & (sign * self.v > 0)):
                before, after = self.v[i], -self.e * self.v[i]
                self.r[i] = end
                self.v[i] = after if abs(after) > self.rest_speed else 0.0
                self.impacts.append([self.t, i, sign, before, self.v[i]])
                struck = True
        if struck:
            self.settle()

    def fly(self, target):
        """On to the target, which is at most one step away unless impacts or a missing fixed point cut it."""
        while target - self.t > 1e-15 * target:
            self.strike()
            h = target - self.t
            new = self.step(h)
            while new is None:
                h = h / 2
                new = self.step(h)
            x, i, end = self.first_impact(h, new[3])
            release, j = self.first_release(h, new)
            if j is not None and release <= x * h:
                if release:
                    self.take(release, self.step(release))
                same = self.rest & (self.r == self.r[j])
                self.rest[same] = False
                continue
            if i is not None:
                part = x * h
                for _ in range(10):
                    new = self.step(part)
                    miss = new[1][i] - end
                    if abs(miss) < 1e-15 * self.length or new[2][i] == 0:
                        break
                    part = min(max(part - miss / new[2][i], 0.5 * part), 2 * part)
                self.take(part, new)
                continue
            self.take(h, new)
        self.t = target

    def turn(self, target):
        self.theta += (target - self.t) * self.momentum / self.inertia(self.r)
        self.t = target


def solve(ask):
    flight = Flight(ask)
    rows = []
    for when in ask.times:
        if flight.stuck:
            flight.turn(when)
        else:
            start = flight.t
            pieces = int(np.ceil((when - start) / flight.dt - 1e-9))
            for k in range(pieces):
                flight.fly(start + (when - start) * (k + 1) / pieces)
        inertia = flight.inertia(flight.r)
        rows.append([flight.theta, flight.momentum / inertia, flight.r.copy(), flight.v.copy(), flight.centre(flight.r), inertia])
    keys = ("theta", "omega", "r", "v", "r_cm", "inertia")
    answer = {key: np.array(column) for key, column in zip(keys, zip(*rows))}
    return {"t": np.array(ask.times), **answer, "impacts": np.array(flight.impacts).reshape(-1, 5)}


solve.refined_by = "steps"
solve.order = 6
solve.equation = "eq8"
