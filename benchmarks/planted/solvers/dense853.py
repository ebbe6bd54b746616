"""Eq. 8 with scipy's DOP853; impacts and releases are roots of its dense output."""
import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

V_STICK = 1e-4  # m/s
TOUCH = 1e-10  # m
KNOTS = np.linspace(0.0, 1.0, 13)


class Water:
    """The model: who moves, with which acceleration."""

    def __init__(self, sc, start):
        bt = sc.bottle
        self.sc = sc
        self.n = sc.n_slices
        self.m = sc.slice_mass
        self.M = sc.total_mass
        self.lo, self.hi = sc.r_min, sc.r_max
        self.mid = bt.length / 2
        self.mb = bt.mass
        self.I0 = bt.mass * (bt.radius**2 / 2 + bt.length**2 / 12)
        self.J = self.geometry(np.asarray(start, float))[1] * sc.omega0
        self.gamma2 = sc.drag / self.m
        self.stuck = np.zeros(self.n, int)

    def geometry(self, r):
        c = (self.m * r.sum(axis=-1) + self.mb * self.mid) / self.M
        x = r - np.expand_dims(c, -1)
        return c, self.I0 + self.m * (x * x).sum(axis=-1) + self.mb * (self.mid - c) ** 2

    def acc(self, y):
        n = self.n
        th, r, v = y[0], y[1 : 1 + n], y[1 + n :]
        c, inertia = self.geometry(r)
        w = self.J / inertia
        return w, w * w * (r - c) + self.sc.gravity * np.cos(th) - self.gamma2 * (v - self.m * v.sum() / self.M)

    def rhs(self, _, y):
        n = self.n
        w, a = self.acc(y)
        moves = self.stuck == 0
        return np.concatenate(([w], np.where(moves, y[1 + n :], 0.0), np.where(moves, a, 0.0)))

    def sides(self, y):
        r = y[1 : 1 + self.n]
        return (r > self.hi - TOUCH).astype(int) - (r < self.lo + TOUCH).astype(int)

    def stick(self, y):
        """Decide who stays on an end; y is changed in place."""
        n = self.n
        v = y[1 + n :]
        at = self.sides(y)
        y[1 : 1 + n] = np.where(at > 0, self.hi, np.where(at < 0, self.lo, y[1 : 1 + n]))
        lazy = (at != 0) & (np.abs(v) < V_STICK)
        v[lazy] = 0.0
        _, a = self.acc(y)
        self.stuck = np.where(lazy & (at * a >= 0), at, 0)

    def reflect(self, y):
        v = y[1 + self.n :]
        at = self.sides(y)
        out = (at * v > 0) & (self.stuck == 0)
        v[out] *= -self.sc.restitution
        self.stick(y)


def first_event(w, poly, t0, t1):
    """Time and kind of the first thing that happens in the step, or None."""
    n, ts = w.n, t0 + KNOTS * (t1 - t0)
    Y = poly(ts)
    Y0 = Y[:, 0]
    best, kind = None, None
    for side, end in ((1, w.hi), (-1, w.lo)):
        gap = side * (end - Y[1 : 1 + n])
        out = -side * Y[1 + n :]  # rate of the gap
        for i in np.flatnonzero(w.stuck == 0):
            fresh = abs(gap[i, 0]) < 1e-15

            def f(t, i=i, fresh=fresh, side=side, end=end):
                if fresh:  # it leaves the end now: that root is divided out
                    if t == t0:
                        return -side * Y0[1 + n + i] + 1e-300
                    return side * (end - poly(t)[1 + i]) / (t - t0)
                return side * (end - poly(t)[1 + i])

            below = np.flatnonzero(gap[i, 1:] < 0)
            b = ts[1 + below[0]] if below.size else None
            dips = np.flatnonzero((out[i, :-1] < 0) & (out[i, 1:] > 0))
            for k in dips:
                if b is None or ts[k + 1] < b:
                    low = brentq(lambda t: poly(t)[1 + n + i], ts[k], ts[k + 1], xtol=1e-14)
                    if side * (end - poly(low)[1 + i]) < 0:
                        b = low
                        break
            if b is None:
                continue
            a = t0 if not below.size or b <= ts[1] else max(x for x in ts if x < b)
            if f(a) < 0:
                a = t0
            if f(a) <= 0:
                root = t0
            else:
                root = brentq(f, a, b, xtol=1e-16, rtol=1e-14)
            if best is None or root < best:
                best, kind = root, "impact"
    if w.stuck.any():
        def press(t):
            _, a = w.acc(poly(t))
            return (w.stuck * a)[w.stuck != 0].min()

        until = t1 if best is None else best
        if press(until) < 0:
            lo, hi = t0, until
            while hi - lo > 1e-13:
                mid = 0.5 * (lo + hi)
                lo, hi = (lo, mid) if press(mid) < 0 else (mid, hi)
                if mid == t0 + 0.0 and hi == mid:
                    break
            best, kind = hi, "release"
    return best, kind


def solve(ask):
    sc = ask.scenario
    ts = np.asarray(ask.times, float)
    w = Water(sc, ask.start)
    n = w.n
    y = np.concatenate(([sc.theta0], ask.start, np.zeros(n)))
    out = np.empty((len(ts), 1 + 2 * n))
    if sc.frozen:
        out[:] = y
        out[:, 0] += sc.omega0 * ts
    else:
        w.stick(y)
        t, k = 0.0, 0
        while k < len(ts) and ts[k] <= 0.0:
            out[k] = y
            k += 1
        speed = abs(sc.omega0) * sc.bottle.length
        atol = ask.effort * 0.1 * np.concatenate(([1.0], np.full(n, sc.bottle.length), np.full(n, speed)))
        longest = 0.3 / abs(sc.omega0) if sc.omega0 else np.inf
        first = 0.02 / abs(sc.omega0)
        while k < len(ts):
            machine = DOP853(w.rhs, t, y, ts[-1], rtol=max(ask.effort, 3e-14), atol=atol, max_step=longest, first_step=min(first, ts[-1] - t))
            event = None
            while event is None and machine.status == "running":
                machine.step()
                poly = machine.dense_output()
                event, kind = first_event(w, poly, machine.t_old, machine.t)
                stop = machine.t if event is None else event
                while k < len(ts) and ts[k] <= stop:
                    out[k] = poly(ts[k])
                    k += 1
            if event is None:
                break
            t, y = event, poly(event)
            if kind == "impact":
                w.reflect(y)
            else:
                _, a = w.acc(y)
                w.stuck = np.where(w.stuck * a < 0, 0, w.stuck)
            if ts[-1] - t < 1e-14:
                while k < len(ts):
                    out[k] = y
                    k += 1
    r, v = out[:, 1 : 1 + n], out[:, 1 + n :]
    c, inertia = w.geometry(r)
    return {"t": ts, "theta": out[:, 0], "omega": w.J / inertia, "r": r, "v": v, "r_cm": c, "inertia": inertia}


solve.name = "scipy DOP853 with dense output"
solve.equation = "eq8"
solve.refined_by = "rtol"
