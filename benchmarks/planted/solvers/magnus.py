"""Exponential midpoint (second-order Magnus): over one step omega^2 and g cos(theta) are frozen at their midpoint values, and
the linear equation that is left (drag, centrifugal push, the mean of the slices) is solved in closed form."""
import math

import numpy as np


def response(k, w2, t):
    """C, S, P with x = C x0 + S v0 + P F for x'' = w2 x - k x' + F; x' = w2 S x0 + (C - k S) v0 + S F."""
    s = math.sqrt(0.25 * k * k + w2)
    up = w2 / (0.5 * k + s)
    down = -0.5 * k - s
    grow = math.exp(up * t)
    S = grow * -math.expm1(-2.0 * s * t) / (2.0 * s)
    C = grow - up * S
    if s * t > 0.3:
        P = (math.expm1(up * t) / up - math.expm1(down * t) / down) / (2.0 * s)
    else:
        older, newer, P = 0.0, 0.5 * t * t, 0.5 * t * t
        for n in range(1, 18):
            older, newer = newer, (w2 * t * t * older - k * t * (n + 1) * newer) / ((n + 2) * (n + 1))
            P += newer
    return C, S, P


class Tube:
    """The constants of one throw, and the closed-form motion between two events."""

    def __init__(self, sc):
        b = sc.bottle
        self.N = sc.n_slices
        self.m = sc.water_mass / sc.n_slices
        self.Mb, self.L, self.R = b.mass, b.length, b.radius
        self.eps = b.mass / (b.mass + sc.water_mass)
        self.k = sc.drag / self.m
        self.g, self.e = sc.gravity, sc.restitution
        half = 0.5 * (sc.water_mass / b.capacity) * b.length / sc.n_slices
        self.cap, self.base = half, b.length - half
        self.tol = 1e-12 * b.length

    def centre(self, r):
        return (1.0 - self.eps) * r.mean() + 0.5 * self.eps * self.L

    def drift(self, v):
        return (1.0 - self.eps) * v.mean()

    def inertia(self, r):
        x = self.centre(r)
        d = r - x
        return self.m * d.dot(d) + self.Mb * (0.5 * self.R ** 2 + self.L ** 2 / 12.0 + (0.5 * self.L - x) ** 2)

    def omega(self, r):
        return self.spin / self.inertia(r)

    def push(self, end, r, v, om, th):
        """The acceleration of a slice that lies still at `end`."""
        return om * om * (end - self.centre(r)) + self.g * math.cos(th) + self.k * self.drift(v)

    def fly(self, r, v, free, w2, pull, t, only=None):
        """Positions and velocities after t with frozen w2 = omega^2 and pull = g cos(theta); held slices stay."""
        count = int(free.sum())
        if count == 0 or t <= 0.0:
            return (r.copy(), v.copy()) if only is None else (r[only], v[only])
        rf, vf = r[free], v[free]
        c = 1.0 - (1.0 - self.eps) * count / self.N
        F = pull - w2 * ((1.0 - self.eps) * (r.sum() - rf.sum()) / self.N + 0.5 * self.eps * self.L)
        X, U = rf.mean(), vf.mean()
        C, S, _ = response(self.k, w2, t)
        Cm, Sm, Pm = response(self.k * c, w2 * c, t)
        mean_r = Cm * X + Sm * U + Pm * F
        mean_v = w2 * c * Sm * X + (Cm - self.k * c * Sm) * U + Sm * F
        if only is not None:
            q, u = r[only] - X, v[only] - U
            return mean_r + C * q + S * u, mean_v + w2 * S * q + (C - self.k * S) * u
        r1, v1 = r.copy(), v.copy()
        q, u = rf - X, vf - U
        r1[free] = mean_r + C * q + S * u
        v1[free] = mean_v + w2 * S * q + (C - self.k * S) * u
        return r1, v1

    def middle(self, r, v, th, free, h):
        """omega at the start and in the middle, theta in the middle, and the state there."""
        w0 = self.omega(r)
        rm, vm = self.fly(r, v, free, w0 * w0, self.g * math.cos(th), 0.5 * h)
        wm = self.omega(rm)
        return w0, wm, th + 0.25 * h * (w0 + wm), rm, vm

    def plan(self, r, v, th, h):
        """Which slices are free over the coming h, and the frozen coefficients."""
        still = v == 0.0
        low, high = still & (r == self.cap), still & (r == self.base)
        w0 = self.omega(r)
        held = np.zeros(self.N, bool)
        if high.any() and self.push(self.base, r, v, w0, th) >= 0.0:
            held |= high
        if low.any() and self.push(self.cap, r, v, w0, th) <= 0.0:
            held |= low
        for _ in range(2):
            free = ~held
            w0, wm, thm, rm, vm = self.middle(r, v, th, free, h)
            again = held.copy()
            if high.any() and self.push(self.base, rm, vm, wm, thm) >= 0.0 and not held[high].any():
                again |= high
            if low.any() and self.push(self.cap, rm, vm, wm, thm) <= 0.0 and not held[low].any():
                again |= low
            if (again == held).all():
                break
            held = again
        return free, w0, wm, thm

    def finish(self, r, v, th, free, w0, wm, thm, h):
        r1, v1 = self.fly(r, v, free, wm * wm, self.g * math.cos(thm), h)
        return r1, v1, th + h * (w0 + 4.0 * wm + self.omega(r1)) / 6.0

    def first_hit(self, r, v, r1, v1, free, w2, pull, h):
        """The earliest time in (0, h] at which a free slice crosses an end (h + 1 if none does)."""
        out = np.where(r1 > self.base + self.tol, 1, np.where(r1 < self.cap - self.tol, -1, 0)) * free
        hi = h
        reach = r + v * h
        turned = free & (out == 0) & (v * v1 < 0.0) & ((reach > self.base) | (reach < self.cap))
        for i in np.nonzero(turned)[0]:
            a, b = 0.0, h
            for _ in range(40):
                t = 0.5 * (a + b)
                vt = self.fly(r, v, free, w2, pull, t, np.array([i]))[1][0]
                a, b = (t, b) if vt * v[i] > 0.0 else (a, t)
            rt = self.fly(r, v, free, w2, pull, b, np.array([i]))[0][0]
            if rt > self.base + self.tol or rt < self.cap - self.tol:
                out[i] = 1 if v[i] > 0.0 else -1
                hi = min(hi, b)
        who = np.nonzero(out)[0]
        if len(who) == 0:
            return h + 1.0
        side, end = out[who], np.where(out[who] > 0, self.base, self.cap)
        touching = r[who] == end
        flow = 0.0
        f_lo = min(float(np.max(np.where(touching, side * v[who], side * (r[who] - end) / h))), -1e-300)
        gap = lambda t: float(np.max(side * (self.fly(r, v, free, w2, pull, t, who)[0] - end) / np.where(touching, t, h)))
        f_hi = gap(hi)
        if f_hi <= 0.0:
            return h + 1.0
        for n in range(80):
            if hi - flow <= 1e-14 * h:
                break
            t = (flow * f_hi - hi * f_lo) / (f_hi - f_lo) if n % 4 < 3 else 0.5 * (flow + hi)
            f = gap(t)
            if f > 0.0:
                hi, f_hi, f_lo = t, f, 0.5 * f_lo
            else:
                flow, f_lo, f_hi = t, f, 0.5 * f_hi
        return hi

    def bounce(self, r, v, th, free):
        """Impacts of all slices that are at an end and still move outwards."""
        up = free & (r >= self.base - self.tol) & (v > 0.0)
        dn = free & (r <= self.cap + self.tol) & (v < 0.0)
        hit = up | dn
        r[up], r[dn] = self.base, self.cap
        v[hit] *= -self.e
        w = self.omega(r)
        for mask, end, sign in ((up, self.base, 1.0), (dn, self.cap, -1.0)):
            press = sign * self.push(end, r, v, w, th)
            if press > 0.0:
                v[mask & (v * v < 2.0 * press * 1e-10 * self.L)] = 0.0

    def advance(self, r, v, th, h):
        """Up to h ahead, but no further than the first event; returns the time gone and the new state."""
        free, w0, wm, thm = self.plan(r, v, th, h)
        r1, v1, th1 = self.finish(r, v, th, free, w0, wm, thm, h)
        off, w1 = h + 1.0, self.omega(r1)
        for end, sign in ((self.base, 1.0), (self.cap, -1.0)):
            if (~free & (r == end)).any():
                p0, p1 = sign * self.push(end, r, v, w0, th), sign * self.push(end, r1, v1, w1, th1)
                if p0 > 0.0 > p1:
                    off = min(off, max(h * p0 / (p0 - p1), 0.01 * h))
        hit = self.first_hit(r, v, r1, v1, free, wm * wm, self.g * math.cos(thm), h)
        tau = min(off, hit)
        if tau > h:
            return h, r1, v1, th1
        w0, wm, thm, _, _ = self.middle(r, v, th, free, tau)
        if hit <= off:
            r1, v1 = self.fly(r, v, free, wm * wm, self.g * math.cos(thm), tau)
            over = np.where(free & (v1 > 0.0), r1 - self.base, np.where(free & (v1 < 0.0), self.cap - r1, -self.L))
            i = int(np.argmax(over))
            if abs(v1[i]) > 0.0:
                tau = min(max(tau - over[i] / abs(v1[i]), 0.9 * tau), 1.1 * tau, h)
        r1, v1, th1 = self.finish(r, v, th, free, w0, wm, thm, tau)
        if hit <= off and abs(v1[i]) > 0.0:
            r1[i] = self.base if v1[i] > 0.0 else self.cap
        self.bounce(r1, v1, th1, free)
        return tau, r1, v1, th1


def solve(ask):
    sc = ask.scenario
    tube = Tube(sc)
    times = np.asarray(ask.times, float)
    r = np.clip(np.array(ask.start, float), tube.cap, tube.base) if tube.cap < tube.base else np.array(ask.start, float)
    r[np.abs(r - tube.cap) < 1e-10 * tube.L] = tube.cap
    r[np.abs(r - tube.base) < 1e-10 * tube.L] = tube.base
    v = np.zeros_like(r)
    tube.spin = sc.omega0 * tube.inertia(r)
    stuck = sc.frozen or tube.base - tube.cap < 1e-9 * tube.L
    t, th, step, dt = 0.0, sc.theta0, 0, float(ask.effort)
    rows = []
    for want in times:
        if stuck:
            t, th = want, sc.theta0 + sc.omega0 * want
        while not stuck and want >= (step + 1) * dt:
            while (step + 1) * dt - t > 1e-13 * dt:
                gone, r, v, th = tube.advance(r, v, th, (step + 1) * dt - t)
                t += gone
            t = (step + 1) * dt
            step += 1
        s, rr, vv, hh = t, r.copy(), v.copy(), th
        while want - s > 1e-13 * dt:
            gone, rr, vv, hh = tube.advance(rr, vv, hh, want - s)
            s += gone
        rows.append((hh, rr, vv))
    R = np.array([row[1] for row in rows])
    return {"t": times, "theta": np.array([row[0] for row in rows]), "omega": np.array([tube.omega(x) for x in R]),
            "r": R, "v": np.array([row[2] for row in rows]), "r_cm": np.array([tube.centre(x) for x in R]),
            "inertia": np.array([tube.inertia(x) for x in R])}


solve.name = "magnus"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 2
