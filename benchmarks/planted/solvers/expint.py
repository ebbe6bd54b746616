"""Eq. 8 by an exponential integrator.

The drag is linear in the velocities and is solved exactly: the mean velocity of the free slices decays with one rate,
the deviations from it with another. The rest of the acceleration is a parabola in time through the start, the middle
and the end of a step, found by iteration (collocation with exponential weights, order 4).
"""

import math

import numpy as np

FACTORIALS = [math.factorial(k) for k in range(25)]


def phi_functions(z):
    """exp(z), phi_1(z) ... phi_4(z) for z <= 0, where phi_k(0) = 1/k! and z phi_{k+1} = phi_k - 1/k!."""
    if abs(z) < 1.0:
        p4 = 0.0
        for k in range(24, 3, -1):
            p4 = p4 * z + 1.0 / FACTORIALS[k]
        p3 = z * p4 + 1.0 / 6.0
        p2 = z * p3 + 0.5
        p1 = z * p2 + 1.0
    else:
        p1 = math.expm1(z) / z
        p2 = (p1 - 1.0) / z
        p3 = (p2 - 0.5) / z
        p4 = (p3 - 1.0 / 6.0) / z
    return math.exp(z), p1, p2, p3, p4


class Throw:
    def __init__(self, sc, start):
        self.count, self.m, self.gamma = sc.n_slices, sc.slice_mass, sc.drag / sc.slice_mass
        self.length, self.g, self.e = sc.bottle.length, sc.gravity, sc.restitution
        self.eps = sc.bottle.mass / sc.total_mass
        self.bottle_mass = sc.bottle.mass
        self.own = sc.bottle.mass * (sc.bottle.radius**2 / 2.0 + sc.bottle.length**2 / 12.0)
        self.ends = ((1, sc.r_max), (-1, sc.r_min))
        self.rest_speed = max(5e-6 * abs(sc.omega0) * self.length, 5e-7 * math.sqrt(self.g * self.length))
        self.touch = 2e-14 * self.length
        self.spin0 = self.inertia(start) * sc.omega0
        self.impacts = []

    def centre(self, r):
        return (1.0 - self.eps) * r.sum() / self.count + 0.5 * self.eps * self.length

    def inertia(self, r, c=None):
        c = self.centre(r) if c is None else c
        d = r - c
        return self.m * d.dot(d) + self.own + self.bottle_mass * (0.5 * self.length - c) ** 2

    def push(self, r, theta):
        """Acceleration without drag, and omega."""
        c = self.centre(r)
        omega = self.spin0 / self.inertia(r, c)
        return omega * omega * (r - c) + self.g * math.cos(theta), omega

    def pressing(self, r, v, theta, rest):
        """Outward acceleration of the resting slices, against their ends."""
        a = self.push(r, theta)[0] + self.gamma * (1.0 - self.eps) * v.sum() / self.count
        return rest * a

    def weights(self, rate, h, part):
        """At the time part * h: decay of v, its way, weights of the push at start, middle, end for r and for v."""
        t = part * h
        ex, p1, p2, p3, p4 = phi_functions(rate * t)
        q, qq = part, part * part
        way = [t * t * (p2 - 3 * q * p3 + 4 * qq * p4), t * t * (4 * q * p3 - 8 * qq * p4), t * t * (4 * qq * p4 - q * p3)]
        speed = [t * (p1 - 3 * q * p2 + 4 * qq * p3), t * (4 * q * p2 - 8 * qq * p3), t * (4 * qq * p3 - q * p2)]
        return np.array([ex, t * p1] + way + speed)

    def fly(self, state, h):
        """The state after a time h without events."""
        r0, v0, theta0, rest = state
        if h == 0.0:
            return state
        free = rest == 0
        n = max(1, np.count_nonzero(free))
        share = free / n
        slow = -self.gamma * (1.0 - (1.0 - self.eps) * n / self.count)
        f0, w0 = self.push(r0, theta0)
        mean_v = v0.sum() / n
        nodes = []
        for part in (0.5, 1.0):
            dev = self.weights(-self.gamma, h, part)
            extra = self.weights(slow, h, part) - dev
            nodes.append((dev, extra.tolist(), r0 + free * (dev[1] * v0 + extra[1] * mean_v)))
        fm = f1 = f0
        wm = w1 = w0
        r1 = r0
        for _ in range(60):
            means = [f.dot(share) for f in (f0, fm, f1)]
            moved = []
            for dev, extra, base in nodes:
                gain = dev[2] * f0 + dev[3] * fm + dev[4] * f1
                gain += extra[2] * means[0] + extra[3] * means[1] + extra[4] * means[2]
                moved.append(base + free * gain)
            theta_m = theta0 + h * (5.0 * w0 + 8.0 * wm - w1) / 24.0
            theta = theta0 + h * (w0 + 4.0 * wm + w1) / 6.0
            fm, wm = self.push(moved[0], theta_m)
            f1, w_new = self.push(moved[1], theta)
            change = abs(moved[1] - r1).max() / self.length + abs(w_new - w1) * h
            r1, w1 = moved[1], w_new
            if change < 1e-13:
                break
            if not change < 1e6:
                return self.fly(self.fly(state, h / 2), h / 2)
        else:
            if change > 1e-12:
                return self.fly(self.fly(state, h / 2), h / 2)
        theta = theta0 + h * (w0 + 4.0 * wm + w1) / 6.0
        dev, extra, _ = nodes[1]
        means = [f.dot(share) for f in (f0, fm, f1)]
        v1 = dev[0] * v0 + extra[0] * mean_v + dev[5] * f0 + dev[6] * fm + dev[7] * f1
        v1 = free * (v1 + sum(extra[5 + k] * means[k] for k in range(3)))
        return r1, v1, theta, rest

    def first_hit(self, state, new, h):
        """(fraction of the step, slice, end) of the first slice that crosses an end, by cubics through r and v."""
        best = None
        for side, end in self.ends:
            x0, x1 = side * (state[0] - end), side * (new[0] - end)
            u0, u1 = side * h * state[1], side * h * new[1]
            c2, c3 = 3.0 * (x1 - x0) - 2.0 * u0 - u1, 2.0 * (x0 - x1) + u0 + u1
            top = np.ones(self.count)
            turns = np.flatnonzero((u0 > 0) & (u1 < 0) & (x1 <= self.touch))
            if turns.size:
                b, a, c = c2[turns], 3.0 * c3[turns], u0[turns]
                top[turns] = c / (-b + np.sqrt(np.maximum(b * b - a * c, 0.0)))
            high = x0 + top * (u0 + top * (c2 + top * c3))
            found = np.flatnonzero((state[3] == 0) & (high > self.touch))
            if not found.size:
                continue
            x, u, p, q = x0[found], u0[found], c2[found], c3[found]
            at_end = abs(x) <= self.touch
            lo, hi = np.zeros(found.size), top[found]
            for _ in range(36):
                mid = 0.5 * (lo + hi)
                inner = u + mid * (p + mid * q)
                beyond = np.where(at_end, inner, x + mid * inner) > 0
                hi, lo = np.where(beyond, mid, hi), np.where(beyond, lo, mid)
            hi[(at_end | (x > 0)) & ((u > 0) | ((u == 0) & (p >= 0)))] = 0.0
            k = hi.argmin()
            if best is None or hi[k] < best[0]:
                best = hi[k], found[k], side, end, top[found[k]]
        return best

    def reach(self, state, hit, h):
        """Fly to the hit: Newton's method with whole steps, held between bounds. False if it does not take place."""
        part, i, side, end, top = hit
        lo, hi = 0.0, top
        for _ in range(40):
            new = self.fly(state, part * h)
            x, u = side * (new[0][i] - end), side * new[1][i]
            if part == 0.0 or abs(x) <= self.touch or hi - lo < 1e-15:
                return part * h, new, True
            lo, hi = (lo, part) if x > 0 else (part, hi)
            part = part - x / (u * h) if u > 0 else lo
            if not lo < part < hi:
                part = 0.5 * (lo + hi)
        return part * h, new, hi < top

    def let_go(self, state, new, h):
        """Time of the first release within h, by regula falsi (Illinois), and the state there; h if there is none."""
        if not state[3].any():
            return h, new, False
        found = False
        for _ in range(4):
            loose = np.flatnonzero((state[3] != 0) & (self.pressing(*new) < 0.0))
            if not loose.size:
                break
            i, found = loose[0], True
            lo, f_lo, hi, f_hi = 0.0, self.pressing(*state)[i], h, self.pressing(*new)[i]
            if f_lo <= 0.0:
                return 0.0, state, True
            for _ in range(60):
                if hi - lo <= 1e-14 * h or f_hi == 0.0:
                    break
                t = hi - f_hi * (hi - lo) / (f_hi - f_lo)
                t = min(max(t, lo + 0.5e-14 * h), hi - 0.5e-14 * h)
                trial = self.fly(state, t)
                f = self.pressing(*trial)[i]
                if f > 0.0:
                    lo, f_lo, f_hi = t, f, 0.5 * f_hi
                else:
                    hi, f_hi, f_lo, new = t, f, 0.5 * f_lo, trial
            h = hi
        return h, new, found

    def bounce(self, t, state, at_once):
        """All slices beyond or at an end that move outward come back with e times their speed, or stay there."""
        r, v, theta, rest = (np.copy(x) for x in state)
        hits = []
        for side, end in self.ends:
            for i in np.flatnonzero((rest == 0) & (side * (r - end) >= -self.touch) & (side * v >= 0.0)):
                r[i] = end
                hits.append((i, side))
                if v[i] != 0.0:
                    self.impacts.append((t, i, side, abs(v[i]), self.e * abs(v[i])))
                v[i] *= -self.e
        for i, side in hits:
            here = np.zeros(self.count)
            here[i] = side
            if abs(v[i]) < self.rest_speed and (at_once or self.pressing(r, v, theta, here)[i] > 0.0):
                v[i], rest[i] = 0.0, side
        return r, v, float(theta), rest

    def release(self, state):
        r, v, theta, rest = state
        return r, v, theta, np.where((rest != 0) & (self.pressing(*state) <= 0.0), 0, rest)


def solve(ask):
    sc, times = ask.scenario, np.asarray(ask.times, float)
    start = np.array(ask.start, float)
    throw = Throw(sc, start)
    rest = np.zeros(sc.n_slices, int)
    for side, end in throw.ends:
        rest[abs(start - end) <= 1e-12 * throw.length] = side
        start[rest == side] = end
    state = throw.release((start, np.zeros(sc.n_slices), float(sc.theta0), rest))
    if sc.frozen or sc.r_max - sc.r_min <= 1e-12 * throw.length:
        throw.fly = lambda state, h: (start, state[1], state[2] + h * sc.omega0, state[3])
        throw.first_hit, throw.let_go = (lambda *_: None), (lambda state, new, h: (h, new, False))
    steps = max(1, math.ceil(sc.duration / ask.effort - 1e-9))
    t, k, rows = 0.0, 0, []
    while len(rows) < times.size:
        while k < steps - 1 and sc.duration * (k + 1) / steps <= t:
            k += 1
        h = max(sc.duration * (k + 1) / steps - t, 0.0)
        new = throw.fly(state, h)
        hit = throw.first_hit(state, new, h)
        reached = False
        if hit:
            h, new, reached = throw.reach(state, hit, h)
        h_free, new, loose = throw.let_go(state, new, h)
        done = t + h_free >= sc.duration * (1.0 - 1e-15)
        while len(rows) < times.size and (times[len(rows)] <= t + h_free or done):
            rows.append(throw.fly(state, times[len(rows)] - t))
        t, state = t + h_free, new
        if loose:
            state = throw.release(state)
        elif reached:
            state = throw.bounce(t, state, h == 0.0)
            state = throw.release(state) if h > 0.0 else state
    r, v = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    inertia = np.array([throw.inertia(x) for x in r])
    return {
        "t": times, "theta": np.array([row[2] for row in rows]), "omega": throw.spin0 / inertia, "r": r, "v": v,
        "r_cm": np.array([throw.centre(x) for x in r]), "inertia": inertia,
        "impacts": np.array([row for row in throw.impacts if row[0] <= times[-1]]).reshape(-1, 5),
    }


solve.name = "exponential collocation"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 4
