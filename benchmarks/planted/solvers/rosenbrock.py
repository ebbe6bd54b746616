"""Water slices in a spinning bottle (eq. 8), by a linearly implicit Runge-Kutta method.

Kaps and Rentrop's four-stage Rosenbrock method with Shampine's coefficients (order 4) on the fixed grid 0, dt, 2 dt, ...
The Jacobian is a multiple of the unit matrix plus a few outer products, so that every stage costs O(N): all is reduced to
two scalar unknowns, the mean shift of the slices and the change of the spin.
An impact or a release inside a step is found by safeguarded Newton iteration on the length of the step itself.
"""
import math
from collections import namedtuple

import numpy as np

State = namedtuple("State", "r v theta")

GAMMA = 0.5
A21, A31, A32 = 2.0, 48.0 / 25.0, 6.0 / 25.0
C21, C31, C32 = -8.0, 372.0 / 25.0, 12.0 / 5.0
C41, C42, C43 = -112.0 / 125.0, -54.0 / 125.0, -2.0 / 5.0
B1, B2, B3, B4 = 19.0 / 9.0, 0.5, 25.0 / 108.0, 125.0 / 108.0

FREE, CAP, BASE = 0, -1, 1


def constants(sc):
    """Everything of the scenario that stays the same, in one namedtuple."""
    b = sc.bottle
    n = sc.n_slices
    m = sc.water_mass / n
    eps = b.mass / (b.mass + sc.water_mass)
    half = 0.5 * sc.water_mass / b.capacity * b.length / n
    values = dict(n=n, m=m, eps=eps, share=1.0 - eps, L=b.length, lo=half, hi=b.length - half, k=sc.drag / m, g=sc.gravity,
                  e=sc.restitution, mb=b.mass, jb=b.mass * (0.5 * b.radius ** 2 + b.length ** 2 / 12.0),
                  touch=1e-13 * b.length, still=1e-10 * b.length)
    return namedtuple("Constants", values)(**values)


def centre(c, r):
    return c.share * r.mean() + 0.5 * c.eps * c.L


def inertia(c, r):
    x = centre(c, r)
    d = r - x
    return c.m * float(d @ d) + c.jb + c.mb * (0.5 * c.L - x) ** 2


def end_pull(c, y, spin):
    """Acceleration that a slice at rest at the cap, and one at the base, would have."""
    w = spin / inertia(c, y.r)
    common = c.g * math.cos(y.theta) + c.k * c.share * y.v.mean() - w * w * centre(c, y.r)
    return w * w * c.lo + common, w * w * c.hi + common


def rates(c, y, free, spin):
    x = centre(c, y.r)
    w = spin / inertia(c, y.r)
    acc = w * w * (y.r - x) + c.g * math.cos(y.theta) - c.k * (y.v - c.share * y.v.mean())
    return State(y.v * free, acc * free, w)


def linear_solver(c, y, free, spin, s):
    """Returns a function which solves (s - Jacobian) u = (a, b, d) for u."""
    q = y.r - centre(c, y.r)
    big_j = inertia(c, y.r)
    w = spin / big_j
    gs = c.g * math.sin(y.theta)
    den = s * s + c.k * s - w * w
    c1 = c.share * (c.k * s - w * w)
    col_w = free * (2.0 * w * q - gs / s)
    kappa = 2.0 * c.m * w / big_j
    m11 = 1.0 - c1 * free.mean() / den
    m12 = -col_w.mean() / den
    m21 = kappa * c1 * float(q @ free) / den
    m22 = 1.0 + kappa * float(q @ col_w) / den
    det = m11 * m22 - m12 * m21

    def solve_for(a, b, d):
        rhs = free * (b + (s + c.k) * a - c.k * c.share * a.mean() - gs * d / s)
        p1 = rhs.mean() / den
        p2 = -kappa * float(q @ rhs) / den
        mean = (p1 * m22 - m12 * p2) / det
        dw = (m11 * p2 - m21 * p1) / det
        dr = (rhs + c1 * mean * free + col_w * dw) / den
        return State(dr, s * dr - a, (d + dw) / s)

    return solve_for


def blend(pairs):
    """Sum of factor * State."""
    return State(*(sum(f * u[i] for f, u in pairs) for i in range(3)))


def step(c, y, free, spin, h):
    if h <= 0.0:
        return y
    invert = linear_solver(c, y, free, spin, 1.0 / (GAMMA * h))
    f1 = rates(c, y, free, spin)
    g1 = invert(*f1)
    f2 = rates(c, blend(((1.0, y), (A21, g1))), free, spin)
    g2 = invert(*blend(((1.0, f2), (C21 / h, g1))))
    f3 = rates(c, blend(((1.0, y), (A31, g1), (A32, g2))), free, spin)
    g3 = invert(*blend(((1.0, f3), (C31 / h, g1), (C32 / h, g2))))
    g4 = invert(*blend(((1.0, f3), (C41 / h, g1), (C42 / h, g2), (C43 / h, g3))))
    return blend(((1.0, y), (B1, g1), (B2, g2), (B3, g3), (B4, g4)))


def excess(c, y, where):
    """How far the farthest free slice is beyond its end, and the speed at which it goes there."""
    out = np.where(where == FREE, np.maximum(y.r - c.hi, c.lo - y.r), -c.L)
    i = int(out.argmax())
    return float(out[i]), float(y.v[i] if y.r[i] > 0.5 * c.L else -y.v[i])


def strain(c, y, where, spin):
    """Positive if a resting slice is no longer pressed to its end."""
    at_cap, at_base = end_pull(c, y, spin)
    worst = -math.inf
    if (where == CAP).any():
        worst = at_cap
    if (where == BASE).any():
        worst = max(worst, -at_base)
    return worst


def first_impact(c, y, where, free, spin, h, y1):
    """The first moment in (0, h] at which a free slice reaches an end, and the state there; else (h, y1) and False."""
    far, speed = excess(c, y1, where)
    top, ytop = h, y1
    if far <= c.touch:
        # an excursion inside the step: out and back again
        rising = (where == FREE) & (y.v * y1.v < 0.0)
        worst, at = c.touch, None
        if rising.any():
            for i in np.flatnonzero(rising):
                s = y.v[i] / (y.v[i] - y1.v[i])
                peak = y.r[i] + 0.5 * y.v[i] * s * h
                over = max(peak - c.hi, c.lo - peak)
                inward = (y.v[i] > 0.0) == (y.r[i] < 0.5 * c.L)
                if over > -0.2 * abs(y.v[i] * s * h) and not (inward and abs(y.r[i] - 0.5 * c.L) >= 0.5 * (c.hi - c.lo)):
                    trial = step(c, y, free, spin, s * h)
                    beyond = max(trial.r[i] - c.hi, c.lo - trial.r[i])
                    if beyond > worst:
                        worst, at, ytop = beyond, s * h, trial
        if at is None:
            return h, y1, False
        top = at
        far, speed = excess(c, ytop, where)
    low = 0.0
    tau, yt = top, ytop
    for _ in range(80):
        guess = tau - far / speed if speed != 0.0 else -1.0
        if not low < guess < top:
            guess = 0.5 * (low + top)
        tau = guess
        yt = step(c, y, free, spin, tau)
        far, speed = excess(c, yt, where)
        if abs(far) <= c.touch:
            break
        if far > 0.0:
            top = tau
        else:
            low = tau
        if top - low <= 1e-15 * h:
            break
    return tau, yt, True


def first_release(c, y, where, free, spin, h, y1):
    """The first moment at which a resting slice is pulled off its end (regula falsi, Illinois)."""
    fb = strain(c, y1, where, spin)
    if fb <= 0.0:
        return h, y1, False
    a, fa = 0.0, min(strain(c, y, where, spin), 0.0)
    b, yb = h, y1
    goal = 1e-13 * (fb - fa)
    for _ in range(60):
        tau = b - fb * (b - a) / (fb - fa)
        yt = step(c, y, free, spin, tau)
        ft = strain(c, yt, where, spin)
        if ft > 0.0:
            b, fb, yb = tau, ft, yt
            fa *= 0.5
        else:
            a, fa = tau, ft
            fb *= 0.5
        if abs(ft) <= goal or b - a <= 1e-15 * h:
            break
    return b, yb, True


def settle(c, y, where, spin, hit):
    """Bounce what has hit an end; lay to rest what would not measurably rise; let go what is pulled away."""
    r, v = y.r.copy(), y.v.copy()
    at_hi = (where == FREE) & (r >= c.hi - 2.0 * c.touch)
    at_lo = (where == FREE) & (r <= c.lo + 2.0 * c.touch)
    if hit:
        bounce = (at_hi & (v > 0.0)) | (at_lo & (v < 0.0))
        v[bounce] *= -c.e
    r[at_hi] = c.hi
    r[at_lo] = c.lo
    y = State(r, v, y.theta)
    where = where.copy()
    at_cap, at_base = end_pull(c, y, spin)
    if at_base > 0.0:
        where[at_hi & (v * v <= 2.0 * at_base * c.still)] = BASE
    if at_cap < 0.0:
        where[at_lo & (v * v <= -2.0 * at_cap * c.still)] = CAP
    v[where != FREE] = 0.0
    for _ in range(3):
        at_cap, at_base = end_pull(c, y, spin)
        loose = ((where == BASE) & (at_base < 0.0)) | ((where == CAP) & (at_cap > 0.0))
        if not loose.any():
            break
        where[loose] = FREE
    return y, where


def solve(ask):
    sc = ask.scenario
    c = constants(sc)
    dt = float(ask.effort)
    times = np.asarray(ask.times, dtype=float)
    r0 = np.array(ask.start, dtype=float)
    y = State(r0, np.zeros(c.n), float(sc.theta0))
    spin = inertia(c, r0) * sc.omega0
    rows = []
    if sc.frozen or c.hi - c.lo <= 1e-9 * c.L:
        w = spin / inertia(c, r0)
        rows = [State(r0, y.v, y.theta + w * t) for t in times]
    else:
        where = np.zeros(c.n, dtype=int)
        y, where = settle(c, y, where, spin, False)
        free = (where == FREE).astype(float)
        t, k, tick = 0.0, 0, 1
        while k < len(times) and times[k] <= 0.0:
            rows.append(y)
            k += 1
        while k < len(times):
            while tick * dt - t <= 1e-9 * dt:
                tick += 1
            w = spin / inertia(c, y.r)
            h = min(tick * dt - t, 0.5 / abs(w))
            y1 = step(c, y, free, spin, h)
            tau, y1, hit = first_impact(c, y, where, free, spin, h, y1)
            tau, y1, let_go = first_release(c, y, where, free, spin, tau, y1)
            hit = hit and not let_go
            while k < len(times) and times[k] <= t + tau:
                rows.append(step(c, y, free, spin, times[k] - t))
                k += 1
            t += tau
            y = y1
            if hit or let_go:
                if let_go:
                    at_cap, at_base = end_pull(c, y, spin)
                    if (where == CAP).any() and at_cap >= 0.0:
                        where = np.where(where == CAP, FREE, where)
                    if (where == BASE).any() and at_base <= 0.0:
                        where = np.where(where == BASE, FREE, where)
                else:
                    y, where = settle(c, y, where, spin, True)
                free = (where == FREE).astype(float)
    r = np.array([row.r for row in rows])
    v = np.array([row.v for row in rows])
    theta = np.array([row.theta for row in rows])
    big_j = np.array([inertia(c, row) for row in r])
    return {"t": times, "theta": theta, "omega": spin / big_j, "r": np.clip(r, c.lo, c.hi), "v": v,
            "r_cm": np.array([centre(c, row) for row in r]), "inertia": big_j}


solve.name = "rosenbrock"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 4
solve.precision = "float64"
