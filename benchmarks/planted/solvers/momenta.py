"""Free flight in canonical momenta, by the implicit Gauss rule of two stages.

p_i is the momentum along the axis of slice i as seen from the common centre of mass; tube and resting slices move with
u = -sum(p of the free slices) / (their mass). Then p' = m omega^2 (r - r_cm) - alpha v, r' = p / m - u, and whatever
comes to rest or is let go keeps the sum of all momenta at zero by itself.
"""
import math

import numpy as np

TINY_SPEED = 1e-3
TINY_GAP = 2e-11
ROOT3 = math.sqrt(3.0)


class Bottle:
    def __init__(self, sc, start):
        self.n = sc.n_slices
        self.mass = sc.slice_mass
        self.empty = sc.bottle.mass
        self.all = sc.total_mass
        self.half = sc.bottle.length / 2
        self.wall = {-1: sc.r_min, 1: sc.r_max}
        self.e, self.alpha = sc.restitution, sc.drag
        self.shell = self.empty * (sc.bottle.radius**2 / 2 + sc.bottle.length**2 / 12)
        self.spin = self.inertia(start) * sc.omega0

    def centre(self, r):
        return (self.mass * np.sum(r) + self.empty * self.half) / self.all

    def inertia(self, r):
        c = self.centre(r)
        return self.shell + self.mass * np.sum((r - c) ** 2) + self.empty * (self.half - c) ** 2


class State:
    """theta, r, p of all slices; ``rest``: 0 for a free slice, else the side of the end it rests on."""

    def __init__(self, theta, r, p, rest):
        self.theta, self.r, self.p, self.rest = theta, r, p, rest


def tube_speed(b, p, rest):
    free = rest == 0
    return -p[free].sum() / (b.empty + b.mass * (b.n - free.sum()))


def velocities(b, s):
    return np.where(s.rest == 0, s.p / b.mass - tube_speed(b, s.p, s.rest), 0.0)


def rates(b, theta, r, p, rest):
    free = rest == 0
    v = np.where(free, p / b.mass - tube_speed(b, p, rest), 0.0)
    c = (b.mass * r.sum() + b.empty * b.half) / b.all
    x = r - c
    w = b.spin / (b.shell + b.mass * (x @ x) + b.empty * (b.half - c) ** 2)
    return w, v, np.where(free, b.mass * w * w * x - b.alpha * v, 0.0)


def gauss(b, s, h):
    """One step of order 4; the stages are iterated until they stand still."""
    th1, th2 = 0.5 - ROOT3 / 6, 0.5 + ROOT3 / 6
    a11, a12, a21 = 0.25, 0.25 - ROOT3 / 6, 0.25 + ROOT3 / 6
    w, v, f = rates(b, s.theta, s.r, s.p, s.rest)
    r1, p1 = s.r + th1 * h * v, s.p + th1 * h * f
    r2, p2 = s.r + th2 * h * v, s.p + th2 * h * f
    scale = abs(b.spin / b.inertia(s.r)) * 2 * b.half
    for _ in range(100):
        k1 = rates(b, s.theta, r1, p1, s.rest)
        k2 = rates(b, s.theta, r2, p2, s.rest)
        old = r1, r2, p1, p2
        r1 = s.r + h * (a11 * k1[1] + a12 * k2[1])
        r2 = s.r + h * (a21 * k1[1] + a11 * k2[1])
        p1 = s.p + h * (a11 * k1[2] + a12 * k2[2])
        p2 = s.p + h * (a21 * k1[2] + a11 * k2[2])
        moved = max(np.abs(r1 - old[0]).max(), np.abs(r2 - old[1]).max()) / (2 * b.half)
        pushed = max(np.abs(p1 - old[2]).max(), np.abs(p2 - old[3]).max()) / (b.mass * scale)
        if moved < 1e-13 and pushed < 1e-12:
            break
    else:
        if h > 1e-9:
            return gauss(b, gauss(b, s, h / 2), h / 2)
    k1 = rates(b, s.theta, r1, p1, s.rest)
    k2 = rates(b, s.theta, r2, p2, s.rest)
    return State(
        s.theta + h / 2 * (k1[0] + k2[0]), s.r + h / 2 * (k1[1] + k2[1]), s.p + h / 2 * (k1[2] + k2[2]), s.rest
    )


def overshoot(b, s):
    """How far outside each slice is (negative: inside)."""
    out = np.maximum(s.r - b.wall[1], b.wall[-1] - s.r)
    return np.where(s.rest == 0, out, -1.0)


def locate(b, s, h, end):
    """Return the time in (0, h] at which the first slice reaches an end, or None."""
    late = h if overshoot(b, end).max() > 0 else None
    if late is None:
        before, after = velocities(b, s), velocities(b, end)
        for i in np.flatnonzero(before * after < 0):
            if (before[i] > 0) == (s.r[i] > b.half):  # it was on its way out
                lo, hi = 0.0, h
                for _ in range(25):
                    mid = (lo + hi) / 2
                    lo, hi = (mid, hi) if velocities(b, gauss(b, s, mid))[i] * before[i] > 0 else (lo, mid)
                    if abs(s.r[i] - b.wall[1 if before[i] > 0 else -1]) > 2 * h * abs(before[i]):
                        break  # too far from the end to reach it
                if overshoot(b, gauss(b, s, lo))[i] > 0:
                    late = lo if late is None else min(late, lo)
        if late is None:
            return None
    early, g0, g1 = 0.0, overshoot(b, s).max(), overshoot(b, gauss(b, s, late)).max()
    stale = 0
    for _ in range(100):
        x = (early * g1 - late * g0) / (g1 - g0) if g0 < 0 and stale < 2 else (early + late) / 2
        g = overshoot(b, gauss(b, s, x)).max()
        if g > 0:
            stale = stale + 1 if late - x < 0.1 * (late - early) or g > 0.5 * g1 else 0
            late, g1 = x, g
        else:
            stale = stale + 1 if x - early < 0.1 * (late - early) else 0
            early, g0 = x, g
        if g1 < 1e-14 or late - early < 1e-16 + 1e-15 * h:
            break
    return late


def press(b, s):
    """Force per mass that a resting slice exerts on its end: +inf where none rests there."""
    free = s.rest == 0
    u = tube_speed(b, s.p, s.rest)
    v = s.p[free] / b.mass - u
    mass = b.empty + b.mass * (b.n - free.sum())
    w = b.spin / b.inertia(s.r)
    centre = (b.empty * b.half + b.mass * s.r[~free].sum()) / mass
    return np.where(free, np.inf, s.rest * (w * w * (s.r - centre) - b.alpha * v.sum() / mass))


def let_go(b, s):
    """Let go whoever is pulled off its end; letting one go may pull at the next."""
    while (s.rest != 0).any():
        off = press(b, s) < 0
        if not off.any():
            return
        u = tube_speed(b, s.p, s.rest)
        s.p[off] = b.mass * u
        s.rest = np.where(off, 0, s.rest)


def settle(b, s, v):
    """Put slow slices at the ends to rest, given the velocities relative to the tube."""
    side = (s.r >= b.wall[1] - TINY_GAP).astype(int) - (s.r <= b.wall[-1] + TINY_GAP)
    s.r = np.where(side > 0, b.wall[1], np.where(side < 0, b.wall[-1], s.r))
    slow = (side != 0) & (np.abs(v) < TINY_SPEED)
    u = -b.mass * v.sum() / b.all
    s.p = b.mass * (v + u)
    while True:
        s.rest = np.where(slow, side, 0)
        off = press(b, s) < 0
        if not off.any():
            return
        slow &= ~off


def collide(b, s):
    """All slices at an end get their impulses at once; the tube's own change of speed is found by bisection."""
    v = velocities(b, s)
    side = (s.r >= b.wall[1] - TINY_GAP).astype(int) - (s.r <= b.wall[-1] + TINY_GAP)
    on = (side != 0) & (side * v >= 0)
    if not on.any():
        return settle(b, s, v)
    t, w = side[on], v[on]

    def given(du):  # impulses on the tube when its speed changes by du
        return b.mass * t * np.maximum(t * ((1 + b.e) * w - du), 0.0)

    most = (1 + b.e) * np.abs(w).max()
    lo, hi = -most, most
    for _ in range(200):
        mid = (lo + hi) / 2
        if mid in (lo, hi):
            break
        if b.empty * mid > given(mid).sum():
            hi = mid
        else:
            lo = mid
    du = (lo + hi) / 2
    new = v - du
    new[on] -= given(du) / b.mass
    new[on] = np.where(given(du) != 0, -b.e * w, new[on])
    settle(b, s, new)


def forward(b, s, h):
    """Go on from s to the next event, but not farther than h; return the new state and the time used."""
    end = gauss(b, s, h)
    used, event = h, None
    hit = locate(b, s, h, end)
    if hit is not None:
        used, event = hit, "impact"
        end = gauss(b, s, used)
    if press(b, end).min() < 0:
        lo, hi = 0.0, used
        while hi - lo > 1e-13:
            mid = (lo + hi) / 2
            if press(b, gauss(b, s, mid)).min() < 0:
                hi = mid
            else:
                lo = mid
        used, event = hi, "release"
        end = gauss(b, s, used)
    end = State(end.theta, end.r.copy(), end.p.copy(), end.rest.copy())
    if event == "impact":
        collide(b, end)
    elif event == "release":
        let_go(b, end)
    return end, used


def solve(ask):
    sc = ask.scenario
    start = np.array(ask.start, dtype=float)
    b = Bottle(sc, start)
    s = State(sc.theta0, start, np.zeros(b.n), np.zeros(b.n, int))
    if not sc.frozen:
        settle(b, s, np.zeros(b.n))
    t = 0.0
    theta, r, v = [], [], []
    for when in ask.times:
        if sc.frozen:
            s.theta = sc.theta0 + sc.omega0 * when
            t = when
        while t < when - 1e-14:
            pieces = math.ceil((when - t) / ask.effort * (1 - 1e-12))
            s, used = forward(b, s, (when - t) / pieces)
            t += used
        theta.append(s.theta)
        r.append(s.r.copy())
        v.append(velocities(b, s))
    inertia = np.array([b.inertia(x) for x in r])
    return {
        "t": ask.times,
        "theta": np.array(theta),
        "omega": b.spin / inertia,
        "r": np.array(r),
        "v": np.array(v),
        "r_cm": np.array([b.centre(x) for x in r]),
        "inertia": inertia,
    }


solve.name = "momenta, Gauss 4"
solve.equation = "free-flight"
solve.refined_by = "dt"
solve.order = 4
