"""Free flight by operator splitting, steps of at most `dt`: drag, kick, drift, kick, drag.

    drag    the slices slow down against the tube, solved exactly (the tube gains what they lose)
    kick    the centrifugal force, about the centre of the tube and of what rests in it
    drift   straight motion in the tube; hits are met in their order, each an exchange of momentum with the tube

All velocities are relative to the tube. Second order between hits.
"""
import math

import numpy as np

CLOSE = 1e-12  # of the bottle's length: nearer to an end counts as on it


class Splitting:
    def __init__(self, throw, start):
        tube = throw.bottle
        self.n, self.m, self.mb = throw.n_slices, throw.slice_mass, tube.mass
        self.low, self.high = throw.r_min, throw.r_max
        self.mid, self.close = tube.length / 2, CLOSE * tube.length
        self.own = tube.mass * (tube.radius**2 / 2 + tube.length**2 / 12)
        self.alpha, self.e = throw.drag, throw.restitution
        self.frozen = throw.frozen or self.high - self.low < self.close  # a full bottle of one slice has no room
        self.theta = throw.theta0
        self.r, self.v = np.array(start, dtype=float), np.zeros(self.n)
        self.L = self.inertia() * throw.omega0
        self.rest = self.side()  # +1: lies on the base, -1: on the cap, 0: moves
        self.let_go()

    def inertia(self):
        x = self.r - self.mid
        m = self.m
        return self.own + m * x.dot(x) - (m * x.sum()) ** 2 / (self.mb + m * self.n)

    def omega(self):
        return self.L / self.inertia()

    def side(self):
        return 1.0 * (self.r >= self.high - self.close) - (self.r <= self.low + self.close)

    def body(self):
        """Mass and centre of the tube with the slices that lie in it."""
        lying = self.rest != 0
        mass = self.mb + self.m * np.count_nonzero(lying)
        return mass, (self.mb * self.mid + self.m * self.r[lying].sum()) / mass

    def pull(self):
        """Centrifugal acceleration relative to the tube."""
        return self.omega() ** 2 * (self.r - self.body()[1])

    def acceleration(self):
        """With drag, relative to the tube; of a slice that lies: what it would be if its end were not there."""
        return self.pull() - self.alpha * (self.v / self.m + self.v.sum() / self.body()[0])

    def let_go(self):
        """Free the slices that their end no longer pushes, and those that freeing moves in turn."""
        while self.rest.any():
            off = (self.rest != 0) & (self.rest * self.acceleration() <= 0)
            if not off.any():
                return
            self.rest = np.where(off, 0.0, self.rest)

    def slow_down(self, h):
        moving = self.rest == 0
        count = moving.sum()
        if count == 0:
            return
        mass, _ = self.body()
        rate = self.alpha / self.m
        mean = self.v[moving].mean()
        spread = self.v[moving] - mean
        mean *= math.exp(-(rate + count * self.alpha / mass) * h)
        self.v[moving] = mean + spread * math.exp(-rate * h)

    def kick(self, h):
        self.v += np.where(self.rest == 0, self.pull() * h, 0.0)

    def drift(self, h):
        left = h
        while True:
            gap = np.where(self.v > 0, self.high - self.r, self.r - self.low)
            approaching = (self.rest == 0) & (self.v != 0)
            wait = np.full(self.n, np.inf)
            wait[approaching] = np.maximum(gap[approaching], 0.0) / np.abs(self.v[approaching])
            soonest = wait.min()
            if soonest > left:
                self.r += self.v * left
                return
            self.r += self.v * soonest
            left -= soonest
            side = self.side()
            self.r[side > 0], self.r[side < 0] = self.high, self.low
            # The drift moves with the velocity of the middle of the step; at the hit it is another.
            meets = (side != 0) & (side * self.v > 0)
            self.v += np.where(self.rest == 0, self.acceleration() * (h / 2 - left), 0.0)
            self.v[meets & (side * self.v < 0)] = 0.0
            self.collide(side, h)
            self.v -= np.where(self.rest == 0, self.acceleration() * (h / 2 - left), 0.0)
            self.v[(side != 0) & (side * self.v > 0)] = 0.0

    def collide(self, side, h):
        """Every slice on an end that moves against it, or lies there, strikes at the same moment."""
        on_end = (side != 0) & (side * self.v >= 0)
        back = -self.e * self.v  # velocity after, relative to the tube
        hits = on_end.copy()
        for _ in range(self.n + 1):
            # gain of the tube from momentum: mb gain + m sum(gain + back - v) = 0
            gain = self.m * (self.v - back)[hits].sum() / (self.mb + self.m * hits.sum())
            pressed = on_end & (side * (self.v - back - gain) > 0)
            if np.array_equal(pressed, hits):
                break
            hits = pressed
        self.v = np.where(hits, back, self.v - gain)
        self.rest = np.where(hits, self.rest, 0.0)
        # What the next kick would bring back at once stays, and gives its momentum to the tube.
        force = side * self.acceleration()
        stays = (side != 0) & (force > 0) & (np.abs(self.v) <= force * h)
        if stays.any():
            given = self.m * self.v[stays].sum()
            self.v[stays] = 0.0
            self.rest = np.where(stays, side, self.rest)
            mass, _ = self.body()
            self.v[self.rest == 0] -= given / mass

    def step(self, h):
        if self.frozen:
            self.theta += h * self.omega()
            return
        self.let_go()
        self.slow_down(h / 2)
        self.kick(h / 2)
        before = self.omega()
        self.drift(h)
        self.theta += h / 2 * (before + self.omega())
        self.kick(h / 2)
        self.slow_down(h / 2)


def solve(ask):
    flight = Splitting(ask.scenario, ask.start)
    now, theta, omega, r, v = 0.0, [], [], [], []
    for when in ask.times:
        count = math.ceil((when - now) / ask.effort)
        for _ in range(count):
            flight.step((when - now) / count)
        now = when
        theta.append(flight.theta)
        omega.append(flight.omega())
        r.append(flight.r.copy())
        v.append(flight.v.copy())
    return {"t": ask.times, "theta": np.array(theta), "omega": np.array(omega), "r": np.array(r), "v": np.array(v)}


solve.name = "free flight by splitting"
solve.equation = "free-flight"
solve.refined_by = "dt"
solve.order = 2
