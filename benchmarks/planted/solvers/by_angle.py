"""Eq. 8 with the angle as the clock: omega never changes sign, so t, r and v are functions of theta."""
import math

import numpy as np


class Throw:
    STILL = 1e-4  # m/s
    SAME = 5e-11  # m

    def __init__(self, sc, start, steps):
        self.sc = sc
        self.N = sc.n_slices
        self.m = sc.water_mass / self.N
        self.mb = sc.bottle.mass
        self.half = sc.bottle.length / 2
        self.cap = sc.slice_height / 2
        self.base = sc.bottle.length - self.cap
        self.k = sc.drag / self.m
        self.tube = self.mb * (sc.bottle.radius**2 / 2 + sc.bottle.length**2 / 12)
        self.L = self.I(start) * sc.omega0
        self.sign = math.copysign(1.0, sc.omega0)
        self.step = sc.omega0 * sc.duration / steps
        self.theta = sc.theta0
        self.z = np.concatenate(([0.0], start, np.zeros(self.N)))  # t, r, v
        self.free = np.ones(self.N, bool)
        self.side = np.zeros(self.N)

    def cm(self, r):
        return (self.m * r.sum() + self.mb * self.half) / (self.mb + self.sc.water_mass)

    def I(self, r):
        c = self.cm(r)
        d = r - c
        return self.tube + self.m * d.dot(d) + self.mb * (self.half - c) ** 2

    def omega(self, r):
        return self.L / self.I(r)

    def dvdt(self, theta, z):
        r, v = z[1 : self.N + 1], z[self.N + 1 :]
        mean = self.m * v.sum() / (self.mb + self.sc.water_mass)
        w = self.omega(r)
        return w**2 * (r - self.cm(r)) + self.sc.gravity * math.cos(theta) - self.k * (v - mean)

    def slope(self, theta, z):
        """d(t, r, v) / d theta."""
        r, v = z[1 : self.N + 1], z[self.N + 1 :]
        out = np.empty_like(z)
        out[0] = 1.0
        out[1 : self.N + 1] = self.free * v
        out[self.N + 1 :] = self.free * self.dvdt(theta, z)
        return out / self.omega(r)

    def turn(self, d):
        """The state after turning on by the angle d, nothing happening on the way."""
        th, z = self.theta, self.z
        a = self.slope(th, z)
        b = self.slope(th + d / 3, z + d / 3 * a)
        c = self.slope(th + 2 * d / 3, z + d * (b - a / 3))
        e = self.slope(th + d, z + d * (a - b + c))
        return z + d / 8 * (a + 3 * b + 3 * c + e)

    # --- what can happen on the way

    def outside(self, z):
        r = z[1 : self.N + 1]
        return np.where(self.free, np.maximum(r - self.base, self.cap - r), -1.0)

    def hit_angle(self, d, z):
        """Return the part of the turn d after which the first slice is on an end, or None."""
        out = self.outside(z)
        if out.max() <= 0:
            # it can also have been outside and be back: look where its speed changed sign
            v0, v1, tops = self.z[self.N + 1 :], z[self.N + 1 :], []
            for i in np.flatnonzero(self.free & (v0 * v1 < 0)):
                part = d * v0[i] / (v0[i] - v1[i])
                for _ in range(3):
                    x = self.turn(part)
                    part -= x[self.N + 1 + i] / self.slope(self.theta + part, x)[self.N + 1 + i]
                    if not 0 < part / d < 1:
                        break
                if 0 < part / d < 1 and self.outside(self.turn(part))[i] > 0:
                    tops.append(part)
            if not tops:
                return None
            d = min(tops, key=abs)
            out = self.outside(self.turn(d))
        far = d
        while True:  # the slice that is out first: every other must not be out where this one crosses
            i = int(out.argmax())
            near, x = 0.0, far
            s, end = (1.0, self.base) if self.turn(far)[1 + i] > self.base else (-1.0, self.cap)
            for _ in range(80):
                zx = self.turn(x)
                gap = s * (zx[1 + i] - end)
                if gap > 0:
                    far = x
                else:
                    near = x
                if abs(gap) < 1e-14 and s * zx[self.N + 1 + i] > 0 or abs(far - near) < 1e-15:
                    break
                newton = x - gap / (s * zx[self.N + 1 + i]) * self.omega(zx[1 : self.N + 1]) if zx[self.N + 1 + i] else near
                inside = min(near, far) < newton < max(near, far)
                x = newton if inside else (near + far) / 2
            out = self.outside(self.turn(x))
            if out.max() <= 1e-13:
                return x
            far = x

    def pressure(self, theta, z):
        held = ~self.free
        return (self.side * self.dvdt(theta, z))[held].min()

    def release_angle(self, d, z):
        if self.free.all() or self.pressure(self.theta + d, z) >= 0:
            return None
        a, b = 0.0, d
        while abs(b - a) > 1e-13:
            c = (a + b) / 2
            if self.pressure(self.theta + c, self.turn(c)) < 0:
                b = c
            else:
                a = c
        return b

    def rest(self):
        r, v = self.z[1 : self.N + 1], self.z[self.N + 1 :]
        at = (r >= self.base - self.SAME) * 1.0 - (r <= self.cap + self.SAME) * 1.0
        r[at > 0], r[at < 0] = self.base, self.cap
        quiet = (at != 0) & (abs(v) < self.STILL)
        v[quiet] = 0.0
        self.free = ~(quiet & (at * self.dvdt(self.theta, self.z) >= 0))
        self.side = at

    def bounce(self):
        r, v = self.z[1 : self.N + 1], self.z[self.N + 1 :]
        down = self.free & (r >= self.base - self.SAME) & (v > 0)
        up = self.free & (r <= self.cap + self.SAME) & (v < 0)
        v[down | up] *= -self.sc.restitution
        self.rest()

    def go(self, when):
        """Turn until the time is ``when``."""
        while when - self.z[0] > 1e-14:
            d = self.step
            z = self.turn(d)
            if z[0] > when:  # the last turn ends at the time asked for
                d = (when - self.z[0]) * self.omega(self.z[1 : self.N + 1])
                for _ in range(8):
                    z = self.turn(d)
                    late = z[0] - when
                    d -= late * self.omega(z[1 : self.N + 1])
                    if abs(late) < 1e-15:
                        break
                z = self.turn(d)
            hit = self.hit_angle(d, z)
            if hit is not None:
                d, z = hit, self.turn(hit)
            loose = self.release_angle(d, z)
            if loose is not None:
                d, z = loose, self.turn(loose)
            self.theta, self.z = self.theta + d, z
            if loose is not None:
                self.free |= self.side * self.dvdt(self.theta, z) < 0
            elif hit is not None:
                self.bounce()


def solve(ask):
    sc = ask.scenario
    P, N = len(ask.times), sc.n_slices
    throw = Throw(sc, np.array(ask.start, float), ask.effort)
    answer = {name: np.empty(P) for name in ("theta", "omega", "r_cm", "inertia")}
    answer |= {"t": ask.times, "r": np.empty((P, N)), "v": np.empty((P, N))}
    if not sc.frozen:
        throw.rest()
    for k, t in enumerate(ask.times):
        if sc.frozen:
            throw.theta = sc.theta0 + sc.omega0 * t
        else:
            throw.go(t)
        r = throw.z[1 : N + 1]
        answer["theta"][k] = throw.theta
        answer["omega"][k] = throw.omega(r)
        answer["r"][k], answer["v"][k] = r, throw.z[N + 1 :]
        answer["r_cm"][k] = throw.cm(r)
        answer["inertia"][k] = throw.I(r)
    return answer


solve.name = "angle as the clock"
solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 4
