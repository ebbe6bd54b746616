"""Eq. 8 by the implicit Hermite-Obreshkov rule of two derivatives (order 4); drag is solved exactly, the rest iterated.

What happens inside a step is read off Bernstein polynomials (quintic for places, cubic for contact forces), then
polished by shorter steps. Answers between grid lines come from the quintic.
"""
import numpy as np
from numba import njit

OPEN = {"error_model": "numpy"}


@njit(**OPEN)
def frame(r, v, p):
    """Centre of mass and its speed, inertia, omega and its derivative."""
    m, mb, total, length, own, momentum = p[0], p[1], p[2], p[3], p[4], p[5]
    rc = (m * r.sum() + mb * length / 2) / total
    vc = m * v.sum() / total
    inertia = own + mb * (length / 2 - rc) ** 2
    growth = 0.0
    for i in range(r.size):
        inertia += m * (r[i] - rc) ** 2
        growth += 2 * m * (r[i] - rc) * v[i]
    omega = momentum / inertia
    return rc, vc, inertia, omega, -omega * growth / inertia


@njit(**OPEN)
def undamped(theta, r, v, p):
    """Acceleration without drag, and its derivative."""
    g = p[6]
    rc, vc, inertia, omega, spin = frame(r, v, p)
    push = omega**2 * (r - rc) + g * np.cos(theta)
    jerk = 2 * omega * spin * (r - rc) + omega**2 * (v - vc) - g * np.sin(theta) * omega
    return omega, spin, push, jerk


@njit(**OPEN)
def motion(theta, r, v, rest, p):
    """omega, omega', and every slice's acceleration and jerk; those of a resting slice are what it would have."""
    d, share = p[7], p[0] / p[2]
    omega, spin, a, j = undamped(theta, r, v, p)
    a -= d * (v - share * v.sum())
    ac = 0.0
    for i in range(r.size):
        if rest[i] == 0:
            ac += share * a[i]
    for i in range(r.size):
        j[i] -= d * ((a[i] if rest[i] == 0 else 0.0) - ac)
    return omega, spin, a, j


@njit(**OPEN)
def advance(h, theta, r, v, rest, p, omega, spin, a, j):
    """One step: converged?, theta, r, v, omega, omega', a, j at its end."""
    d, share, length = p[7], p[0] / p[2], p[3]
    n = r.size
    free = 0
    for i in range(n):
        if rest[i] == 0:
            free += 1
    kappa = 1 - free * share
    r1, v1 = r.copy(), v.copy()
    for i in range(n):
        if rest[i] == 0:
            r1[i] += h * v[i] + h**2 / 2 * a[i]
            v1[i] += h * a[i] / (1 + h * d)
    theta1 = theta + h * omega + h**2 / 2 * spin
    good = False
    last = 1e300
    for sweep in range(60):
        omega1, spin1, push, jerk = undamped(theta1, r1, v1, p)
        right, pushes = 0.0, 0.0
        for i in range(n):
            if rest[i] == 0:
                right += v[i] + h / 2 * (a[i] + push[i]) + h**2 / 12 * (j[i] - jerk[i] + d * kappa * push[i])
                pushes += push[i]
        speeds = right / (1 + h * d * kappa / 2 + (h * d * kappa) ** 2 / 12)
        vc = share * speeds
        ac = share * (pushes - d * kappa * speeds)
        change = 0.0
        for i in range(n):
            if rest[i] == 0:
                f = push[i] + d * vc
                w = v[i] + h / 2 * (a[i] + f) + h**2 / 12 * (j[i] - jerk[i] + d * (f - ac))
                w /= 1 + h * d / 2 + (h * d) ** 2 / 12
                x = r[i] + h / 2 * (v[i] + w) + h**2 / 12 * (a[i] - (f - d * w))
                change = max(change, abs(x - r1[i]), h * abs(w - v1[i]))
                r1[i], v1[i] = x, w
        turned = theta + h / 2 * (omega + omega1) + h**2 / 12 * (spin - spin1)
        change = max(change, length * abs(turned - theta1))
        theta1 = turned
        if change <= 4e-16 * length or (change < 1e-13 * length and change >= last):
            good = True
            break
        if not change < 1e3 * length:
            break
        last = change
    omega1, spin1, a1, j1 = motion(theta1, r1, v1, rest, p)
    return good, theta1, r1, v1, omega1, spin1, a1, j1


@njit(**OPEN)
def first_above(b, degree, tol):
    """Smallest place in [0, 1] where the Bernstein polynomial b exceeds tol; 2 if there is none."""
    stack = np.empty((64, 6))
    left = np.empty(64)
    depth = np.empty(64, np.int64)
    stack[0], left[0], depth[0] = b, 0.0, 0
    top = 1
    while top > 0:
        top -= 1
        c = stack[top].copy()
        lo, level = left[top], depth[top]
        if c[: degree + 1].max() <= tol:
            continue
        if c[0] > tol or level == 44:
            return lo
        half = c.copy()
        for k in range(1, degree + 1):
            for i in range(degree, k - 1, -1):
                half[i] = (half[i - 1] + half[i]) / 2
        # half is now the left part; the right part follows by the same averages from the other side
        right = c.copy()
        for k in range(1, degree + 1):
            for i in range(degree + 1 - k):
                right[i] = (right[i] + right[i + 1]) / 2
        stack[top], left[top], depth[top] = right, lo + 0.5 ** (level + 1), level + 1
        stack[top + 1], left[top + 1], depth[top + 1] = half, lo, level + 1
        top += 2
    return 2.0


@njit(**OPEN)
def next_event(h, r, v, a, j, r1, v1, a1, j1, rest, skip, p):
    """Fraction of the step and slice of its first impact or release; slice -1 if there is none."""
    length, lower, upper, scale = p[3], p[8], p[9], p[12]
    tol = 1e-15 * length
    best, who = 2.0, -1
    b = np.zeros(6)
    for i in range(r.size):
        if i == skip:
            continue
        if rest[i] != 0:
            b[0], b[1] = -rest[i] * a[i], -rest[i] * (a[i] + h * j[i] / 3)
            b[2], b[3] = -rest[i] * (a1[i] - h * j1[i] / 3), -rest[i] * a1[i]
            if b[:4].max() > 1e-14 * scale:
                at = first_above(b, 3, 1e-14 * scale)
                if at < best:
                    best, who = at, i
            continue
        for side in (1, -1):
            end = upper if side == 1 else lower
            b[0] = side * (r[i] - end)
            b[1] = b[0] + side * h * v[i] / 5
            b[2] = b[0] + side * (2 * h * v[i] / 5 + h**2 * a[i] / 20)
            b[5] = side * (r1[i] - end)
            b[3] = b[5] + side * (-2 * h * v1[i] / 5 + h**2 * a1[i] / 20)
            b[4] = b[5] - side * h * v1[i] / 5
            if b.max() <= tol:
                continue
            degree = 5
            if r[i] == end:  # it starts on this end: divide by the time since
                for k in range(1, 6):
                    b[k - 1] = 5 * b[k] / k
                b[5] = 0.0
                degree = 4
            at = first_above(b, degree, tol)
            if at < best:
                best, who = at, i
    return best, who


@njit(**OPEN)
def settle(theta, r, v, rest, p):
    """Slices without speed on an end rest where they are pressed on it."""
    for i in range(r.size):
        if (r[i] == p[9] or r[i] == p[8]) and v[i] == 0.0:
            rest[i] = 1 if r[i] == p[9] else -1
    omega, spin, a, j = motion(theta, r, v, rest, p)
    for i in range(r.size):
        if rest[i] * a[i] < 0 or (rest[i] != 0 and a[i] == 0.0):
            rest[i] = 0


@njit(**OPEN)
def march(theta, r, dt, asked, p):
    n, length, lower, upper, bounce, slow = r.size, p[3], p[8], p[9], p[10], p[11]
    v, rest = np.zeros(n), np.zeros(n, np.int64)
    table = np.empty((asked.size, 4 + 2 * n))
    hits = np.empty((256, 5))
    count, k, line, t = 0, 0, 1, 0.0
    for i in range(n):
        if abs(r[i] - upper) <= 1e-12 * length:
            r[i] = upper
        elif abs(r[i] - lower) <= 1e-12 * length:
            r[i] = lower
    settle(theta, r, v, rest, p)
    while k < asked.size:
        h = line * dt - t
        if h <= 1e-13 * dt:
            line += 1
            continue
        omega, spin, a, j = motion(theta, r, v, rest, p)
        good, theta1, r1, v1, omega1, spin1, a1, j1 = advance(h, theta, r, v, rest, p, omega, spin, a, j)
        while not good:
            h /= 2
            good, theta1, r1, v1, omega1, spin1, a1, j1 = advance(h, theta, r, v, rest, p, omega, spin, a, j)
            if h < 1e-9 * dt:
                break
        target = -1
        for attempt in range(50):
            at, who = next_event(h, r, v, a, j, r1, v1, a1, j1, rest, target, p)
            if who < 0:
                break
            longest, target, h = h, who, h * at
            reached = False
            for polish in range(12):
                good, theta1, r1, v1, omega1, spin1, a1, j1 = advance(h, theta, r, v, rest, p, omega, spin, a, j)
                if rest[who] != 0:
                    miss, slope = a1[who], j1[who]
                    reached = h == 0.0 or abs(miss) <= 1e-9 * p[12]
                else:
                    miss, slope = r1[who] - (upper if v1[who] > 0 else lower), v1[who]
                    reached = h == 0.0 or abs(miss) <= 1e-13 * length
                if miss == 0.0 or slope == 0.0:
                    break
                shorter = h - miss / slope
                if not 0 <= shorter <= longest or shorter == h or abs(shorter - h) < 1e-16 * t:
                    break
                h = shorter
            if not reached:  # the shorter step, more exact than the longer one, does not get there
                target = -1
        # the answers that fall in this step
        while k < asked.size and asked[k] <= t + h + 1e-12 * dt:
            x = min(1.0, max(0.0, (asked[k] - t) / h)) if h > 0 else 1.0
            y = x - 1
            c1, c2 = x * y**3 * (1 + 3 * x) * -1.0, -(x**2) * y**3 / 2
            e1, e2 = x**3 * y * (4 - 3 * x), x**3 * y**2 / 2
            c0, e0 = -(y**3) * (6 * x**2 + 3 * x + 1), x**3 * (6 * x**2 - 15 * x + 10)
            place, speed = r.copy(), v.copy()
            for i in range(n):
                if rest[i] == 0:
                    place[i] = c0 * r[i] + e0 * r1[i] + h * (c1 * v[i] + e1 * v1[i]) + h**2 * (c2 * a[i] + e2 * a1[i])
                    b0 = 30 * x**2 * y**2 * (r1[i] - r[i]) / h if h > 0 else 0.0
                    b1 = y**2 * (1 - 3 * x) * (1 + 5 * x) * v[i] + x**2 * (5 * x - 6) * (2 - 3 * x) * v1[i]
                    b2 = x * y**2 * (2 - 5 * x) / 2 * a[i] + x**2 * y * (5 * x - 3) / 2 * a1[i]
                    speed[i] = b0 + b1 + h * b2
            rc, vc, inertia, spun, unused = frame(place, speed, p)
            turned = c0 * theta + e0 * theta1 + h * (c1 * omega + e1 * omega1) + h**2 * (c2 * spin + e2 * spin1)
            table[k, 0], table[k, 1], table[k, 2], table[k, 3] = turned, spun, rc, inertia
            table[k, 4 : 4 + n] = place
            table[k, 4 + n :] = speed
            k += 1
        t += h
        theta, r, v = theta1, r1, v1
        if target < 0:
            if abs(line * dt - t) <= 1e-12 * dt:
                line += 1
            continue
        if rest[target] != 0:
            side = rest[target]
            for i in range(n):
                if rest[i] == side:
                    rest[i] = 0
            continue
        for i in range(n):
            if rest[i] != 0:
                continue
            side = 1 if v[i] > 0 else -1
            end = upper if side == 1 else lower
            if v[i] != 0.0 and (i == target or side * (r[i] - end) > -1e-13 * length):
                before = v[i]
                r[i] = end
                v[i] = -bounce * before
                if abs(v[i]) < slow:
                    v[i] = 0.0
                if abs(before) > 2 * slow:
                    if count == len(hits):
                        hits = np.concatenate((hits, np.empty_like(hits)))
                    hits[count, 0], hits[count, 1], hits[count, 2] = t, i, side
                    hits[count, 3], hits[count, 4] = before, v[i]
                    count += 1
        settle(theta, r, v, rest, p)
    return table, hits[:count]


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    start, times = np.array(ask.start, dtype=float), np.array(ask.times, dtype=float)
    n, m, length = start.size, throw.slice_mass, bottle.length
    own = bottle.mass * (bottle.radius**2 / 2 + length**2 / 12)
    still = np.zeros(n)
    p = np.array(
        [m, bottle.mass, throw.total_mass, length, own, 1.0, throw.gravity, throw.drag / m, throw.r_min, throw.r_max]
        + [throw.restitution, 4e-6 * abs(throw.omega0) * length, throw.omega0**2 * length + throw.gravity]
    )
    centre, unused, inertia, unused, unused = frame(start, still, p)
    p[5] = inertia * throw.omega0
    if throw.frozen or throw.r_max - throw.r_min <= 1e-12 * length:
        shape = (times.size, n)
        return {
            "t": times,
            "theta": throw.theta0 + throw.omega0 * times,
            "omega": np.full(times.size, float(throw.omega0)),
            "r": np.broadcast_to(start, shape).copy(),
            "v": np.zeros(shape),
            "r_cm": np.full(times.size, centre),
            "inertia": np.full(times.size, inertia),
            "impacts": [],
        }
    dt = ask.effort if ask.effort else throw.duration / 1000
    table, hits = march(float(throw.theta0), start, float(dt), times, p)
    return {
        "t": times,
        "theta": table[:, 0],
        "omega": table[:, 1],
        "r_cm": table[:, 2],
        "inertia": table[:, 3],
        "r": table[:, 4 : 4 + n],
        "v": table[:, 4 + n :],
        "impacts": hits,
    }


solve.name = "Hermite-Obreshkov"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 4
solve.timeout = 180.0  # compiling takes its time on a busy machine

march(0.0, np.array([0.1, 0.15]), 0.01, np.array([0.01]), np.array([1, 1, 3, 0.2, 0.1, 1, 1, 1, 0.05, 0.15, 0.5, 0, 1.0]))
