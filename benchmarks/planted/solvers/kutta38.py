"""Kutta's 3/8 rule (order 4) with a fixed number of steps, in dimensionless distances from the tube's middle; impacts by secant on re-taken steps."""
from dataclasses import dataclass, field
from math import ceil
import numpy as np


@dataclass
class Model:
    """Lengths in L, masses in M_b + M_w, times in 1/|omega0|."""
    n: int
    eps: float          # mass of the tube
    lam: float          # mass of a slice
    c: float            # the ends are at z = -c (cap) and z = +c (base)
    own: float          # tube's inertia about its own centre
    k: float            # wall drag
    e: float
    j0: float = 0.0
    side: np.ndarray = field(default=None)       # +1 rests on the base, -1 on the cap, 0 flies
    rest_speed: float = 1e-5

    def inertia(self, z):
        return self.lam * z @ z - (self.lam * z.sum()) ** 2 + self.own

    def w(self, z):
        return self.j0 / self.inertia(z)

    def load(self):
        self.fly = self.side == 0
        self.mc = self.eps + self.lam * np.abs(self.side).sum()
        self.zc = self.lam * self.c * self.side.sum() / self.mc

    def slope(self, z, zd):
        w = self.w(z)
        zdd = w * w * (z - self.zc) - self.k / self.lam * zd - self.k / self.mc * zd.sum()
        return zd, np.where(self.fly, zdd, 0.0), w

    def advance(self, s, h):
        """One step of the 3/8 rule (in equal parts, if the drag is too stiff for it); s = (z, zd, angle)."""
        parts = max(1, ceil(abs(h) * (self.k / self.lam + self.n * self.k / self.mc) / 1.0))
        h = h / parts
        for _ in range(parts):
            z, zd, a = s
            p1, q1, w1 = self.slope(z, zd)
            p2, q2, w2 = self.slope(z + h / 3 * p1, zd + h / 3 * q1)
            p3, q3, w3 = self.slope(z + h * (p2 - p1 / 3), zd + h * (q2 - q1 / 3))
            p4, q4, w4 = self.slope(z + h * (p1 - p2 + p3), zd + h * (q1 - q2 + q3))
            s = (z + h / 8 * (p1 + 3 * p2 + 3 * p3 + p4), zd + h / 8 * (q1 + 3 * q2 + 3 * q3 + q4),
                 a + h / 8 * (w1 + 3 * w2 + 3 * w3 + w4))
        return s

    def loose(self, s):
        """Ends (+1, -1) whose resting slices are no longer pressed on."""
        z, zd, _ = s
        push = self.w(z) ** 2 * (np.array([self.c, -self.c]) - self.zc) - self.k / self.mc * zd[self.fly].sum()
        return [end for end, f in ((1, push[0]), (-1, push[1])) if end * f < 0 and (self.side == end).any()]

    def outside(self, s):
        return np.where(self.fly, np.abs(s[0]) - self.c, -1.0)

    def when(self, s, h, after):
        """Time within the step of its first event."""
        best = h
        if self.loose(after):
            lo, hi = 0.0, h
            while hi - lo > 1e-11 * h:
                mid = (lo + hi) / 2
                lo, hi = (lo, mid) if self.loose(self.advance(s, mid)) else (mid, hi)
            best = hi
        end = self.advance(s, best)
        for _ in range(3 * self.n):
            gone = self.outside(end)
            i = int(np.argmax(gone))
            if gone[i] <= 1e-12:
                break
            sign = np.sign(end[0][i])
            lo, hi, slope = 0.0, best, max(sign * end[1][i], 1e-9)
            x = best - gone[i] / slope
            for _ in range(80):
                if not lo < x < hi:
                    x = (lo + hi) / 2
                now = self.advance(s, x)
                g, slope = sign * now[0][i] - self.c, sign * now[1][i]
                if g > 0:
                    hi = x
                else:
                    lo = x
                if 0 <= g < 1e-13 or hi - lo < 1e-14 * h:
                    break
                x = x - (g - 5e-14) / slope if slope > 0 else (lo + hi) / 2
            best = hi
            end = self.advance(s, best)
        return best, end

    def knock(self, z, zd):
        """Impulses of all slices at the ends; the tube's jump of speed is found by bisection, then exactly."""
        at = np.where(np.abs(z) >= self.c - 1e-10, np.sign(z), 0.0)
        aim = (1 + self.e) * zd[at != 0]
        sgn = at[at != 0]
        lo, hi = min(aim.min(), 0.0), max(aim.max(), 0.0)
        for _ in range(60):
            mid = (lo + hi) / 2
            total = self.lam * (sgn * np.maximum(0.0, sgn * (aim - mid))).sum()
            lo, hi = (mid, hi) if total > self.eps * mid else (lo, mid)
        jump = (lo + hi) / 2
        hit = sgn * (aim - jump) > 1e-13
        jump = self.lam * aim[hit].sum() / (self.eps + self.lam * hit.sum())
        p = np.zeros(self.n)
        p[at != 0] = np.where(hit, self.lam * (aim - jump), 0.0)
        return zd - p / self.lam - jump

    def park(self, s):
        z, zd, a = s
        at = np.where(np.abs(z) >= self.c - 1e-10, np.sign(z), 0.0)
        z = np.where(at != 0, at * self.c, z)
        self.side = np.where(np.abs(zd) <= self.rest_speed, at, 0.0)
        self.load()
        for _ in range(2):
            for end in self.loose((z, zd, a)):
                self.side[self.side == end] = 0
            self.load()
        share = self.lam * zd[~self.fly].sum() / self.mc      # speed that tube and newly parked slices end up with
        return z, np.where(self.fly, zd - share, 0.0), a


def solve(ask):
    sc, times = ask.scenario, np.asarray(ask.times, float)
    L, rate = sc.bottle.length, abs(sc.omega0)
    turn = np.sign(sc.omega0)
    mass = sc.total_mass
    m = Model(n=sc.n_slices, eps=sc.bottle.mass / mass, lam=sc.slice_mass / mass, c=sc.r_max / L - 0.5,
              own=sc.bottle.mass / mass * ((sc.bottle.radius / L) ** 2 / 2 + 1 / 12), k=sc.drag / (mass * rate), e=sc.restitution)
    if sc.frozen or m.c < 1e-12:
        return {"t": times, "theta": sc.theta0 + sc.omega0 * times, "omega": np.full(len(times), sc.omega0)}
    z = np.clip(np.asarray(ask.start, float) / L - 0.5, -m.c, m.c)
    m.j0 = m.inertia(z)
    m.side = np.zeros(m.n)
    m.load()
    s = m.park((z, np.zeros(m.n), 0.0))
    step = sc.duration * rate / ask.effort
    theta, omega = [], []
    t, i, hits = 0.0, 1, 0
    for when in times * rate:
        while True:
            span = i * step - t
            after = m.advance(s, span)
            event = bool(m.loose(after)) or m.outside(after).max() > 1e-12
            if event:
                span, after = m.when(s, span, after)
            if when <= t + span:
                break
            t, s = t + span, after
            if event:
                z, zd, a = s
                if ((np.abs(z) >= m.c - 1e-10) & m.fly & (z * zd > 0)).any():
                    s, hits = (z, m.knock(z, zd), a), hits + 1
                s = m.park(s)
            else:
                t, i = i * step, i + 1
        z, _, a = m.advance(s, when - t)
        theta.append(sc.theta0 + turn * a)
        omega.append(sc.omega0 * m.w(z))
    return {"t": times, "theta": np.array(theta), "omega": np.array(omega)}


solve.name = "three-eighths rule"
solve.equation = "free-flight"
solve.refined_by = "steps"
solve.order = 4
