import math

import numpy as np

ON_END = 1e-11  # m: closer to an end counts as touching it
REST = 1e-3  # m/s: a slower rebound stays on the end


def first_crossing(g0, d0, g1, d1):
    """Return where in (0, 1] a gap that goes from g0 to g1 with slopes d0, d1 first becomes positive, or None."""
    c2, c3 = 3 * (g1 - g0) - 2 * d0 - d1, 2 * (g0 - g1) + d0 + d1
    if g0 == 0.0:  # it leaves the end now: divide that root out
        roots = np.roots([c3, c2, d0]) if c3 else np.array([-d0 / c2])
        ahead = [x.real for x in roots if abs(x.imag) < 1e-12 and 0.0 < x.real <= 1.0 and 2 * c3 * x.real + c2 > 0.0]
        return min(ahead, default=0.5 if g1 > 0.0 else None)
    last = 1.0
    if g1 <= 0.0:  # it turned inside the step: was it beyond the end?
        disc = c2 * c2 - 3 * c3 * d0
        if disc <= 0.0 or d0 <= 0.0:
            return None
        last = d0 / (math.sqrt(disc) - c2) if math.sqrt(disc) > c2 else 1.0
        if not 0.0 < last < 1.0 or g0 + last * (d0 + last * (c2 + last * c3)) <= 0.0:
            return None
    first = 0.0
    for _ in range(50):
        mid = (first + last) / 2
        if g0 + mid * (d0 + mid * (c2 + mid * c3)) > 0.0:
            last = mid
        else:
            first = mid
    return last


class Flight:
    def __init__(self, throw, start):
        bottle = throw.bottle
        self.n = n = throw.n_slices
        self.m = throw.water_mass / n
        self.mb = bottle.mass
        self.total = throw.water_mass + bottle.mass
        self.middle = bottle.length / 2
        height = throw.water_mass / bottle.capacity * bottle.length / n
        self.low, self.high = height / 2, bottle.length - height / 2
        self.own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.e, self.alpha, self.frozen = throw.restitution, throw.drag, throw.frozen
        self.t = 0.0
        self.y = np.concatenate([[throw.theta0], start, np.zeros(n)])
        self.momentum = self.inertia(start) * throw.omega0
        self.hold(np.zeros(n))  # +1 for a slice that rests on the base, -1 on the cap
        self.settle(self.touching(self.y))

    def centre(self, r):
        return (self.m * r.sum() + self.mb * self.middle) / self.total

    def inertia(self, r):
        centre = self.centre(r)
        return self.own + self.m * ((r - centre) ** 2).sum() + self.mb * (self.middle - centre) ** 2

    def omega(self, r):
        return self.momentum / self.inertia(r)

    def acceleration(self, y):
        n = self.n
        r, v = y[1 : n + 1], y[n + 1 :]
        centre = self.centre(r)
        x = r - centre
        omega = self.momentum / (self.own + self.m * (x @ x) + self.mb * (self.middle - centre) ** 2)
        drag = self.alpha / self.m * v + self.alpha / self.body_mass * v.sum()
        return omega, omega**2 * (r - self.body_centre) - drag

    def hold(self, rest):
        """These slices rest and are one body with the tube."""
        self.rest = rest
        at_base, at_cap = (rest > 0).sum(), (rest < 0).sum()
        self.held = bool(at_base + at_cap)
        self.body_mass = self.mb + self.m * (at_base + at_cap)
        weighted = self.mb * self.middle + self.m * (at_base * self.high + at_cap * self.low)
        self.body_centre = weighted / self.body_mass

    def slope(self, y):
        n = self.n
        omega, a = self.acceleration(y)
        d = np.empty(2 * n + 1)
        d[0] = omega
        d[1 : n + 1] = y[n + 1 :]
        d[n + 1 :] = a
        if self.frozen:
            d[1:] = 0.0
        elif self.held:
            d[1 : n + 1][self.rest != 0] = 0.0
            d[n + 1 :][self.rest != 0] = 0.0
        return d

    def step(self, y, h):
        k1 = self.slope(y)
        k2 = self.slope(y + h / 2 * k1)
        k3 = self.slope(y + h / 2 * k2)
        k4 = self.slope(y + h * k3)
        return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def touching(self, y):
        r = y[1 : self.n + 1]
        return np.where(r >= self.high - ON_END, 1.0, np.where(r <= self.low + ON_END, -1.0, 0.0))

    def settle(self, side):
        """Slices that touch an end without moving rest there while they are pushed against it."""
        n = self.n
        v = self.y[n + 1 :]
        slow = (side != 0) & (np.abs(v) < REST)
        speeds = np.where(slow, v, 0.0)
        v[slow] = 0.0
        while True:
            self.hold(np.where(slow, side, 0.0))
            _, a = self.acceleration(self.y)
            pulled = slow & (side * a <= -1e-7)
            if not pulled.any():
                break
            slow &= ~pulled
            v[pulled] = speeds[pulled]
        v[self.rest == 0] -= self.m * speeds[slow].sum() / self.body_mass  # what comes to rest gives its momentum to the tube

    def next_event(self, y0, y1, h):
        """Return fraction of the step and (slice, side) of the first impact, or None."""
        n, found = self.n, None
        r0, v0, r1, v1 = y0[1 : n + 1], y0[n + 1 :], y1[1 : n + 1], y1[n + 1 :]
        for side, end in ((1.0, self.high), (-1.0, self.low)):
            suspects = (self.rest == 0) & ((side * (r1 - end) > 0) | ((side * v0 > 0) & (side * v1 < 0)))
            for i in np.flatnonzero(suspects):
                at = first_crossing(side * (r0[i] - end), side * h * v0[i], side * (r1[i] - end), side * h * v1[i])
                if at is not None and (found is None or at < found[0]):
                    found = at, i, side, end
        return found

    def impact(self):
        n = self.n
        r, v = self.y[1 : n + 1], self.y[n + 1 :]
        side = self.touching(self.y)
        pressed = (side != 0) & (side * v >= 0)
        s, before = side[pressed], v[pressed]
        impulse = 0.0  # of all slices on the tube: F(P) = P - sum s p(P) rises and is linear in pieces
        for _ in range(100):
            p = s * self.m * ((1 + self.e) * before - impulse / self.mb)
            acts = p > 0
            new = (self.m * (1 + self.e) * before[acts]).sum() / (1 + self.m * acts.sum() / self.mb)
            if abs(new - impulse) <= 1e-15 * abs(new):
                break
            impulse = new
        p = np.maximum(s * self.m * ((1 + self.e) * before - impulse / self.mb), 0.0)
        v[self.rest != 0] = 0.0
        v -= impulse / self.mb
        v[pressed] -= s * p / self.m
        r[side > 0] = self.high
        r[side < 0] = self.low
        self.settle(side)

    def push(self, y):
        """Return the smallest acceleration against an end of a slice that rests there."""
        _, a = self.acceleration(y)
        return (self.rest * a)[self.rest != 0].min()

    def advance(self, h):
        """Go on by h or to the first event before."""
        y0 = self.y
        y1 = self.step(y0, h)
        if self.frozen:
            self.y, self.t = y1, self.t + h
            return
        kind, used = None, h
        found = self.next_event(y0, y1, h)
        if found is not None:
            at, i, side, end = found
            kind, used = "impact", at * h
            for _ in range(4):
                y1 = self.step(y0, used)
                gap, speed = side * (y1[1 + i] - end), side * y1[1 + self.n + i]
                if abs(gap) < 1e-14 or speed <= 0.0:
                    break
                used = min(max(used - gap / speed, 0.0), h)
        if self.held:
            before, after = self.push(y0), self.push(y1)
            if after < -1e-7:
                kind, a, b = "release", 0.0, used
                for _ in range(30):
                    at = a + (b - a) * before / (before - after) if before > 0.0 else a
                    y1 = self.step(y0, at)
                    now = self.push(y1)
                    if abs(now) < 1e-9 or before <= 0.0:
                        break
                    if now > 0.0:
                        a, before = at, now
                    else:
                        b, after = at, now
                used = at
        self.y, self.t = y1, self.t + used
        if kind == "impact":
            self.impact()
        elif kind == "release":
            _, a = self.acceleration(self.y)
            self.hold(np.where((self.rest != 0) & (self.rest * a < 1e-6), 0.0, self.rest))

    def go_to(self, when, dt):
        while when - self.t > 1e-13:
            left = when - self.t
            self.advance(left / math.ceil(left / dt - 1e-9))


def solve(ask):
    flight = Flight(ask.scenario, ask.start)
    n = flight.n
    rows = []
    for when in ask.times:
        flight.go_to(when, ask.effort)
        rows.append(flight.y.copy())
    states = np.array(rows)
    r, v = states[:, 1 : n + 1], states[:, n + 1 :]
    omega = np.array([flight.omega(row) for row in r])
    r_cm = np.array([flight.centre(row) for row in r])
    inertia = np.array([flight.inertia(row) for row in r])
    return {"t": ask.times, "theta": states[:, 0], "omega": omega, "r": r, "v": v, "r_cm": r_cm, "inertia": inertia}


solve.name = "free flight by RK4"
solve.equation = "free-flight"
solve.refined_by = "dt"
solve.order = 4
