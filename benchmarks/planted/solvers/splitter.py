"""Free flight, seen from the common centre of mass, by a symmetric splitting composed to fourth order (Suzuki).

z[0] is the tube's middle, z[1:] are the slices, along the axis from the centre of mass towards the base, u their
velocities in the turning frame. A slice that rests moves as one body with the tube.
"""
import math
from collections import namedtuple

import numpy as np
from scipy.optimize import brentq

Point = namedtuple("Point", "theta z u")
S = 1 / (4 - 4 ** (1 / 3))  # the stages of a step are S, S, 1 - 4 S, S, S
CLOSE, CREEP = 1e-11, 1e-3  # m, m/s

class System:
    def __init__(self, scenario, start):
        b = scenario.bottle
        self.n, self.drag, self.e = scenario.n_slices, scenario.drag, scenario.restitution
        self.m = scenario.water_mass / self.n
        self.masses = np.concatenate(([b.mass], np.full(self.n, self.m)))
        self.own = b.mass * (b.radius**2 / 2 + b.length**2 / 12)
        self.reach = (b.length - scenario.slice_height) / 2  # of a slice from the middle, either way
        z = np.concatenate(([b.length / 2], start))
        z -= self.masses @ z / self.masses.sum()
        self.spin = self.inertia(z) * scenario.omega0
        self.now, self.t = Point(scenario.theta0, z, np.zeros(self.n + 1)), 0.0
        self.settle(self.contact(z))

    def inertia(self, z):
        return self.own + self.masses @ z**2

    def fix(self, rest):  # let the slices with rest = +1 (base) or -1 (cap) ride on the tube
        self.rest = rest
        self.body = np.concatenate(([True], rest != 0))
        self.body_mass = self.masses[self.body].sum()
        self.loose = self.n + 1 - self.body.sum()

    def force(self, z):  # centrifugal acceleration; the tube's is the mean over all that ride on it
        a = (self.spin / self.inertia(z)) ** 2 * z
        a[self.body] = self.masses[self.body] @ a[self.body] / self.body_mass
        return a

    def rub(self, u, h):  # exact drag over h: the mean slip fades faster than the differences, since the tube yields
        slip, k = u - u[0], self.drag / self.m
        mean = slip.sum() / max(self.loose, 1)
        after = (slip - mean) * math.exp(-k * h) + mean * math.exp(-(k + self.loose * self.drag / self.body_mass) * h)
        after[self.body] = 0.0
        return after + (self.masses @ u - self.m * after.sum()) / self.masses.sum()

    def strang(self, p, h):
        z = p.z + h / 2 * p.u
        kick = h / 2 * self.force(z)
        u = self.rub(p.u + kick, h) + kick
        return Point(p.theta + h * self.spin / self.inertia(z), z + h / 2 * u, u)

    def step(self, p, h):
        for share in (S, S, 1 - 4 * S, S, S):
            p = self.strang(p, share * h)
        return p

    def view(self, p, side):  # distances beyond an end (negative: inside), and speeds towards it, as the tube sees them
        return side * (p.z[1:] - p.z[0]) - self.reach, side * (p.u[1:] - p.u[0])

    def push(self, p):  # how hard (per mass) the slices at rest press on their ends, at the least
        slip = p.u - p.u[0]
        a = (self.spin / self.inertia(p.z)) ** 2 * p.z
        tube = (self.masses[self.body] @ a[self.body] + self.drag * slip.sum()) / self.body_mass
        return np.where(self.rest != 0, self.rest * (a[1:] - tube), np.inf)

    def contact(self, z):
        return np.where(np.abs(z[1:] - z[0]) > self.reach - CLOSE, np.sign(z[1:] - z[0]), 0.0)

    def settle(self, side):
        theta, z, u = self.now
        touching = np.flatnonzero(side) + 1
        z[touching] = z[0] + side[touching - 1] * self.reach
        lifted = stays = (side != 0) & (np.abs(u[1:] - u[0]) < CREEP)
        while lifted.any() or self.now.u is u:
            self.fix(np.where(stays, side, 0.0))
            joint = u.copy()
            joint[self.body] = self.masses[self.body] @ u[self.body] / self.body_mass
            self.now = Point(theta, z, joint)
            lifted = stays & (self.push(self.now) <= -1e-7)
            stays = stays & ~lifted

    def collide(self):  # bounce what touches and approaches; simultaneous blows share one impulse on the tube
        u, side = self.now.u, self.contact(self.now.z)
        speed = u[1:] - u[0]
        hit = (side != 0) & (side * speed >= 0)
        s, want = side[hit], self.m * (1 + self.e) * side[hit] * speed[hit]
        share, blow, last = self.m / self.masses[0], 0.0, None
        while blow != last:
            acting = want > s * share * blow
            last, blow = blow, (s * want)[acting].sum() / (1 + share * acting.sum())
        u[1:][hit] -= s * np.maximum(want - s * share * blow, 0.0) / self.m
        u[0] += blow / self.masses[0]
        self.settle(side)

    def blow(self, q, h):  # time of the first blow on an end within the step to q, or None
        times, p = [], self.now
        for side in (1, -1):
            (g0, w0), (g1, w1) = self.view(p, side), self.view(q, side)
            for i in np.flatnonzero((self.rest == 0) & ((g1 > 0) | ((w0 > 0) & (w1 < 0) & (g0 + h * w0 > 0)))):
                gap, speed = (lambda x, k=k: self.view(self.step(p, x), side)[k][i] for k in (0, 1))
                low, high = (0.0 if w0[i] else h / 1000), h
                if w0[i] * w1[i] < 0:  # it turns on the way
                    turn = brentq(speed, 0.0, h)
                    low, high = (turn, h) if w1[i] > 0 else (0.0, turn)
                if gap(high) > 0:
                    times.append(brentq(gap, low, high, xtol=1e-15) if gap(low) < 0 else low)
        return min(times, default=None)

    def advance(self, h):  # step by h, or to the first blow or release before
        p, q = self.now, self.step(self.now, h)
        if (hit := self.blow(q, h)) is not None:
            h, q = hit, self.step(p, hit)
        if release := self.push(q).min() < -1e-7:
            least = lambda x: self.push(self.step(p, x)).min()
            h = brentq(least, 0.0, h, xtol=1e-13) if least(0.0) > 0 else 0.0
            q = self.step(p, h)
            self.fix(np.where(self.push(q) < 1e-6, 0.0, self.rest))
        self.now, self.t = q, self.t + h
        if hit is not None and not release:
            self.collide()

def solve(ask):
    throw = ask.scenario
    if throw.frozen:
        return {"t": ask.times, "theta": throw.theta0 + throw.omega0 * ask.times, "omega": 0 * ask.times + throw.omega0}
    system, theta, omega = System(throw, ask.start), [], []
    for when in ask.times:
        while when - system.t > 1e-13:
            left = when - system.t
            system.advance(left / math.ceil(left / ask.effort - 1e-9))
        theta.append(system.now.theta)
        omega.append(system.spin / system.inertia(system.now.z))
    return {"t": ask.times, "theta": np.array(theta), "omega": np.array(omega)}

vars(solve).update(name="Suzuki's splitting, free flight", equation="free-flight", refined_by="dt", order=4)
