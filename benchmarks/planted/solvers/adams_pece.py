"""Adams-Bashforth-Moulton of order 4 (PECE) on equal steps; begins afresh by Runge-Kutta after each impact."""
from collections import deque
from dataclasses import dataclass

import numpy as np

GENTLE = 3e-5
NEAR = 1e-11
PREDICT = np.array([55.0, -59.0, 37.0, -9.0]) / 24
CORRECT = np.array([9.0, 19.0, -5.0, 1.0]) / 24


@dataclass
class Point:
    t: float
    y: np.ndarray  # theta, r..., v...
    f: np.ndarray  # its rate


def model(sc, start):
    """Return functions of the state: rate(y, rests), push(y) and the properties of rows of positions."""
    n, m, b = sc.n_slices, sc.slice_mass, sc.bottle
    mass = b.mass + sc.water_mass
    half = b.length / 2

    def shape(r):
        s1 = m * r.sum(-1) + b.mass * half
        s2 = m * (r**2).sum(-1) + b.mass * half**2
        return s1 / mass, s2 - s1**2 / mass + b.mass * (b.radius**2 / 2 + b.length**2 / 12)

    spin = shape(start)[1] * sc.omega0

    def push(y):
        r, v = y[1 : n + 1], y[n + 1 :]
        c, inertia = shape(r)
        w = spin / inertia
        a = w**2 * (r - c) + sc.gravity * np.cos(y[0]) - sc.drag / m * (v - m * v.sum() / mass)
        return w, a

    def rate(y, rests):
        w, a = push(y)
        f = np.empty_like(y)
        f[0] = w
        f[1 : n + 1] = y[n + 1 :]
        f[n + 1 :] = a
        f[1 : n + 1][rests != 0] = 0.0
        f[n + 1 :][rests != 0] = 0.0
        return f

    return rate, push, shape, spin


def cubic(p, q, t):
    """Hermite's polynomial through two points and their rates."""
    h = q.t - p.t
    x = (t - p.t) / h
    return (
        (1 + 2 * x) * (1 - x) ** 2 * p.y
        + x * (1 - x) ** 2 * h * p.f
        + x * x * (3 - 2 * x) * q.y
        + x * x * (x - 1) * h * q.f
    )


def solve(ask):
    sc = ask.scenario
    n = sc.n_slices
    rate, push, shape, spin = model(sc, ask.start)
    ends = {1: sc.r_max, -1: sc.r_min}
    rests = np.zeros(n)
    if sc.frozen:
        rests[:] = 1

    def runge(p, h):
        k2 = rate(p.y + h / 2 * p.f, rests)
        k3 = rate(p.y + h / 2 * k2, rests)
        k4 = rate(p.y + h * k3, rests)
        y = p.y + h / 6 * (p.f + 2 * k2 + 2 * k3 + k4)
        return Point(p.t + h, y, rate(y, rests))

    def adams(history, h):
        p = history[0]
        guess = p.y + h * sum(c * q.f for c, q in zip(PREDICT, history))
        ahead = rate(guess, rests)
        y = p.y + h * (CORRECT[0] * ahead + sum(c * q.f for c, q in zip(CORRECT[1:], history)))
        return Point(p.t + h, y, rate(y, rests))

    def where(y):
        r = y[1 : n + 1]
        return np.where(r >= ends[1] - NEAR, 1, 0) - np.where(r <= ends[-1] + NEAR, 1, 0)

    def settle(y):
        nonlocal rests
        side = where(y)
        r, v = y[1 : n + 1], y[n + 1 :]
        for s in (1, -1):
            r[side == s] = ends[s]
        idle = (side != 0) & (np.abs(v) <= GENTLE)
        v[idle] = 0.0
        rests = np.where(idle & (side * push(y)[1] >= 0), side, 0)

    def crossing(p, q):
        """Return (time, slice, side) of the first impact on the cubic, or None."""
        found = None
        x = np.linspace(0, 1, 9)[1:]
        for i in np.flatnonzero(rests == 0):
            for s in (1, -1):
                g0, g1 = s * (p.y[1 + i] - ends[s]), s * (q.y[1 + i] - ends[s])
                outwards = s * p.y[n + 1 + i] > 0 and s * q.y[n + 1 + i] < 0
                if g1 <= 0 and not outwards:
                    continue
                path = lambda z: s * (cubic(p, q, p.t + z * (q.t - p.t))[1 + i] - ends[s])
                last = next((z for z in x if path(z) > 0), 1.0 if g1 > 0 else None)
                if last is None and outwards:  # the summit lies between two of the samples
                    a, b = 0.0, 1.0
                    for _ in range(40):
                        mid = (a + b) / 2
                        if s * cubic(p, q, p.t + mid * (q.t - p.t))[n + 1 + i] > 0:
                            a = mid
                        else:
                            b = mid
                    last = a if path(a) > 0 else None
                if last is None:
                    continue
                first = 0.0
                for _ in range(48):
                    mid = (first + last) / 2
                    if path(mid) > 0:
                        last = mid
                    else:
                        first = mid
                if found is None or last < found[0]:
                    found = last, i, s
        return found and (p.t + found[0] * (q.t - p.t), found[1], found[2])

    y = np.concatenate([[sc.theta0], ask.start, np.zeros(n)])
    if not sc.frozen:
        settle(y)
    dt = ask.effort
    now = Point(0.0, y, rate(y, rests))
    history = deque([now], maxlen=4)
    rows = []
    todo = deque(float(t) for t in ask.times)
    while todo and todo[0] <= 0.0:
        todo.popleft()
        rows.append(y.copy())
    while todo:
        p = history[0]
        q = adams(history, dt) if len(history) == 4 else runge(p, dt)
        event = None
        hit = None if sc.frozen else crossing(p, q)
        if hit:
            when, i, s = hit
            event = "impact"
            for _ in range(6):  # on the true curve instead of the cubic
                q = runge(p, when - p.t)
                gap, speed = s * (q.y[1 + i] - ends[s]), s * q.y[n + 1 + i]
                if abs(gap) < 5e-15 or speed <= 0:
                    break
                when = min(max(when - gap / speed, p.t), p.t + dt)
        if not sc.frozen and rests.any():
            pressed = lambda z: (rests * push(z.y)[1])[rests != 0].min()
            if pressed(q) < 0:
                event = "release"
                a, b = 0.0, q.t - p.t
                for _ in range(44):
                    mid = (a + b) / 2
                    if pressed(runge(p, mid)) < 0:
                        b = mid
                    else:
                        a = mid
                q = runge(p, b)
        while todo and todo[0] <= q.t:
            rows.append(cubic(p, q, todo.popleft()))
        if event is None:
            history.appendleft(q)
            continue
        y = q.y.copy()
        if event == "impact":
            side = where(y)
            v = y[n + 1 :]
            v[(side * v > 0) & (rests == 0)] *= -sc.restitution
            settle(y)
        else:
            rests = np.where(rests * push(y)[1] < 0, 0, rests)
        history.clear()
        history.append(Point(q.t, y, rate(y, rests)))
    table = np.array(rows)
    r, v = table[:, 1 : n + 1], table[:, n + 1 :]
    centre, inertia = shape(r)
    return {
        "t": ask.times,
        "theta": table[:, 0],
        "omega": spin / inertia,
        "r": r,
        "v": v,
        "r_cm": centre,
        "inertia": inertia,
    }


solve.name = "Adams-Bashforth-Moulton"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 4
