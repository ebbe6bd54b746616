"""Eq. 8 by splitting: exact drift (r, theta) and exact kick (v), composed to order 4 (Blanes and Moan, six stages)."""
import math

import numpy as np

A1, A2, A3 = 0.0792036964311957, 0.353172906049774, -0.0420650803577195
A4 = 1 - 2 * (A1 + A2 + A3)
B1, B2 = 0.209515106613362, -0.143851773179818
B3 = 0.5 - B1 - B2
DRIFTS = (A1, A2, A3, A4, A3, A2, A1)
KICKS = (B1, B2, B3, B3, B2, B1)
NODE = math.sqrt(15) / 10
GAUSS = ((0.5 - NODE, 5 / 18), (0.5, 8 / 18), (0.5 + NODE, 5 / 18))
FREE, BASE, CAP = 0, 1, -1


class Flight:
    def __init__(self, ask):
        throw, bottle = ask.scenario, ask.scenario.bottle
        self.m, self.M, self.Mb, self.L = throw.slice_mass, throw.total_mass, bottle.mass, bottle.length
        self.own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.g, self.e, self.d = throw.gravity, throw.restitution, throw.drag / throw.slice_mass
        self.lo, self.hi, self.frozen = throw.r_min, throw.r_max, throw.frozen
        self.t, self.theta = 0.0, throw.theta0
        self.r = np.array(ask.start, float)
        self.v = np.zeros_like(self.r)
        self.tiny = 1e-13 * self.L
        self.r[np.abs(self.r - self.hi) < 1e-10 * self.L] = self.hi
        self.r[np.abs(self.r - self.lo) < 1e-10 * self.L] = self.lo
        self.slow = max(1e-6 * abs(throw.omega0) * self.L, 1e-10 * self.L)
        self.H = self.inertia(self.r) * throw.omega0
        self.state = np.zeros(len(self.r), int)
        self.free = np.ones(len(self.r), bool)
        self.impacts = []
        self.contact()

    # geometry
    def centre(self, r):
        return (self.m * r.sum() + self.Mb * self.L / 2) / self.M

    def inertia(self, r):
        c = self.centre(r)
        x = r - c
        return self.own + self.m * (x @ x) + self.Mb * (self.L / 2 - c) ** 2

    # the two flows
    def drift(self, r, v, theta, h):
        c, u = self.centre(r), self.m * v.sum() / self.M
        x, w = r - c, v - u
        j0 = self.own + self.m * (x @ x) + self.Mb * (self.L / 2 - c) ** 2
        j1 = 2 * self.m * (x @ w) - 2 * self.Mb * (self.L / 2 - c) * u
        j2 = self.m * (w @ w) + self.Mb * u * u
        turn = 0.0
        for node, weight in GAUSS:
            s = h * node
            turn += weight / (j0 + s * (j1 + s * j2))
        return r + h * v, theta + h * self.H * turn

    def kick(self, r, v, theta, h):
        count = self.count
        if count == 0:
            return v
        c = self.centre(r)
        omega = self.H / self.inertia(r)
        force = omega * omega * (r - c) + self.g * math.cos(theta)
        mean_force, mean_v = force[self.free].sum() / count, v.sum() / count
        own, joint = self.d, self.d * (1 - count * self.m / self.M)
        e_own, e_joint = math.exp(-own * h), math.exp(-joint * h)
        p_own = -math.expm1(-own * h) / own if own else h
        p_joint = -math.expm1(-joint * h) / joint if joint else h
        new = (v - mean_v) * e_own + (force - mean_force) * p_own + mean_v * e_joint + mean_force * p_joint
        return np.where(self.free, new, 0.0)

    def step(self, h):
        r, v, theta = self.r, self.v, self.theta
        for i in range(6):
            r, theta = self.drift(r, v, theta, DRIFTS[i] * h)
            v = self.kick(r, v, theta, KICKS[i] * h)
        r, theta = self.drift(r, v, theta, DRIFTS[6] * h)
        return r, v, theta

    # contact
    def pressure(self, r, v, theta):
        """The acceleration that a slice at rest on the base, and on the cap, would have, outward."""
        omega = self.H / self.inertia(r)
        common = self.g * math.cos(theta) + self.d * self.m * v.sum() / self.M
        c = self.centre(r)
        return omega**2 * (self.hi - c) + common, -(omega**2 * (self.lo - c) + common)

    def contact(self):
        on_base, on_cap = self.pressure(self.r, self.v, self.theta)
        still = self.v == 0
        self.state[:] = FREE
        if on_cap > 0:
            self.state[still & (self.r == self.lo)] = CAP
        if on_base > 0:
            self.state[still & (self.r == self.hi)] = BASE
        self.free = self.state == FREE
        self.count = int(self.free.sum())

    def excess(self, r):
        return np.where(self.free, np.maximum(r - self.hi, self.lo - r), -1.0)

    def loosened(self, new):
        on_base, on_cap = self.pressure(*new)
        return ((on_base <= 0 and bool((self.state == BASE).any())), (on_cap <= 0 and bool((self.state == CAP).any())))

    def locate(self, h, new, value):
        """The end of [0, h] where value, negative or 0 at 0 and positive at h, becomes positive (Illinois, from repeated steps)."""
        a, fa, b, fb, side = 0.0, min(value((self.r, self.v, self.theta)), 0.0), h, value(new), 0
        for _ in range(120):
            if b - a <= 4e-16 * h:
                break
            s = b - fb * (b - a) / (fb - fa) if fa < 0 else 0.5 * (a + b)
            if not a < s < b:
                s = 0.5 * (a + b)
            trial = self.step(s)
            f = value(trial)
            if f > 0:
                b, fb, new = s, f, trial
                if side > 0 and fa < 0:
                    fa /= 2
                side = 1
                if 0 <= f <= self.stop:
                    break
            else:
                a, fa = s, f
                if side < 0:
                    fb /= 2
                side = -1
                if value.touch and -self.stop <= f:
                    b, new = s, trial
                    break
        return b, new

    def run(self, h):
        """A step of h, in pieces between events."""
        end = self.t + h
        while True:
            h = end - self.t
            if h <= 1e-15 * max(abs(end), 1e-300):
                break
            new, event = self.step(h), False
            for _ in range(len(self.r) + 50):
                out = self.excess(new[0])
                if not (out > self.tiny).any():
                    turned = np.flatnonzero(self.free & (self.v * new[1] < 0))
                    for i in turned:
                        z = self.v[i] / (self.v[i] - new[1][i])
                        top = self.hermite(i, z, h, new)
                        if max(top - self.hi, self.lo - top) > self.tiny:
                            trial = self.step(z * h)
                            if self.excess(trial[0])[i] > self.tiny:
                                h, new = z * h, trial
                                break
                    out = self.excess(new[0])
                if (out > self.tiny).any():
                    index = np.flatnonzero(out > self.tiny)
                    i = index[(out[index] / np.maximum(np.abs(new[1][index]), 1e-300)).argmax()]
                    self.stop = self.tiny / 4
                    h, new = self.locate(h, new, Gap(i, self.lo, self.hi, new[0][i] > self.hi))
                    event = True
                    continue
                loose = self.loosened(new)
                if any(loose):
                    self.stop = 0.0
                    h, new = self.locate(h, new, Looseness(self, 0 if loose[0] else 1))
                    event = True
                    if any(self.loosened(new)):
                        break
                    continue
                break
            self.r, self.v, self.theta = new
            self.t = self.t + h if event else end
            if not event:
                break
            self.rebound()
            self.contact()

    def hermite(self, i, z, h, new):
        return (self.r[i] * (1 - z) ** 2 * (1 + 2 * z) + new[0][i] * z * z * (3 - 2 * z)
                + h * z * (1 - z) * ((1 - z) * self.v[i] - z * new[1][i]))

    def rebound(self):
        r, v = self.r, self.v
        for hit, wall, end in (((r >= self.hi - self.tiny) & (v > 0) & self.free, self.hi, 1),
                               ((r <= self.lo + self.tiny) & (v < 0) & self.free, self.lo, -1)):
            for i in np.flatnonzero(hit):
                before = v[i]
                after = -self.e * before
                if abs(after) < self.slow:
                    after = 0.0
                r[i], v[i] = wall, after
                self.impacts.append((self.t, i, end, before, after))


class Gap:
    touch = True

    def __init__(self, i, lo, hi, base):
        self.i, self.side, self.wall = i, (1.0 if base else -1.0), (hi if base else lo)

    def __call__(self, new):
        return self.side * (new[0][self.i] - self.wall)


class Looseness:
    touch = False

    def __init__(self, flight, end):
        self.flight, self.end = flight, end

    def __call__(self, new):
        return -self.flight.pressure(*new)[self.end]


def solve(ask):
    flight = Flight(ask)
    rows = []
    for when in ask.times:
        if flight.frozen:
            flight.theta = ask.scenario.theta0 + ask.scenario.omega0 * when
        elif when > flight.t:
            start = flight.t
            steps = max(1, math.ceil((when - start) / ask.effort - 1e-9))
            for k in range(1, steps + 1):
                stop = when if k == steps else start + (when - start) * k / steps
                flight.run(stop - flight.t)
            flight.t = when
        J = flight.inertia(flight.r)
        rows.append((flight.theta, flight.H / J, flight.r.copy(), flight.v.copy(), flight.centre(flight.r), J))
    theta, omega, r, v, c, J = (np.array(column) for column in zip(*rows))
    return {"t": np.array(ask.times, float), "theta": theta, "omega": omega, "r": r, "v": v, "r_cm": c, "inertia": J,
            "impacts": [list(map(float, row)) for row in flight.impacts]}


solve.refined_by = "dt"
solve.order = 4
solve.equation = "eq8"
solve.timeout = 120
