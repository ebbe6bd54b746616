"""Eq. 8 by exponential Hermite collocation.

The drag of Eq. 8 is linear, so it is integrated exactly. Everything else, the forcing

    F_i = omega^2 (r_i - r_CM) + g cos(theta),      v_i' = F_i - d (v_i - v_CM),      d = alpha / m,

is replaced by the cubic in time that has its values and slopes at both ends of a step. The state at the end is found by
fixed-point iteration. Inside a step the solution for this cubic is known in closed form, so that the same formula
answers at any time and locates rebounds and releases. Global order 4.
"""

import math

import numpy as np
from numba import njit

SWEEPS = 16
PIECES = 4


@njit
def powers(rate, tau, out):
    """out[k] = tau^k phi_k(-rate tau), k = 0..5, the k-fold integrals of exp(-rate t)."""
    x = rate * tau
    if x < 1.0:
        term, total, j = 1.0 / 120.0, 0.0, 5
        while abs(term) > 1e-19:
            total += term
            j += 1
            term *= -x / j
        out[5] = total
        out[4] = 1.0 / 24.0 - x * out[5]
        out[3] = 1.0 / 6.0 - x * out[4]
        out[2] = 0.5 - x * out[3]
        out[1] = 1.0 - x * out[2]
        out[0] = 1.0 - x * out[1]
    else:
        out[0] = math.exp(-x)
        out[1] = (1.0 - out[0]) / x
        out[2] = (1.0 - out[1]) / x
        out[3] = (0.5 - out[2]) / x
        out[4] = (1.0 / 6.0 - out[3]) / x
        out[5] = (1.0 / 24.0 - out[4]) / x
    scale = 1.0
    for k in range(6):
        out[k] *= scale
        scale *= tau


@njit
def bulk(r, v, par):
    """Centre of mass, its velocity, moment of inertia and its rate."""
    m, total, mb, length, own = par[0], par[1], par[2], par[3], par[4]
    sr = 0.0
    sv = 0.0
    for i in range(len(r)):
        sr += r[i]
        sv += v[i]
    c = (m * sr + 0.5 * mb * length) / total
    vc = m * sv / total
    inertia = own + mb * (0.5 * length - c) ** 2
    rate = 0.0
    for i in range(len(r)):
        s = r[i] - c
        inertia += m * s * s
        rate += 2.0 * m * s * v[i]
    return c, vc, inertia, rate


@njit
def forcing(r, v, theta, par, f, df, spin):
    """F and F' of every slice; rows N and N + 1 are a slice at rest on the cap and on the base."""
    n = len(r)
    g, momentum = par[6], par[7]
    c, vc, inertia, rate = bulk(r, v, par)
    omega = momentum / inertia
    domega = -omega * rate / inertia
    push = g * math.cos(theta)
    dpush = -g * math.sin(theta) * omega
    w2 = omega * omega
    dw2 = 2.0 * omega * domega
    for i in range(n):
        f[i] = w2 * (r[i] - c) + push
        df[i] = dw2 * (r[i] - c) + w2 * (v[i] - vc) + dpush
    for k in range(2):
        end = par[8 + k]
        f[n + k] = w2 * (end - c) + push
        df[n + k] = dw2 * (end - c) - w2 * vc + dpush
    spin[0] = omega
    spin[1] = domega
    return vc


@njit
def place(r0, v0, side, coef, mean, rates, tau, p, q, r, v):
    """State of all slices at tau after the start of the step, by the cubic forcing."""
    powers(rates[0], tau, p)
    powers(rates[1], tau, q)
    dr = (q[1] - p[1]) * mean[4]
    dv = (q[0] - p[0]) * mean[4]
    for k in range(4):
        dr += (q[k + 2] - p[k + 2]) * mean[k]
        dv += (q[k + 1] - p[k + 1]) * mean[k]
    for i in range(len(r0)):
        if side[i] == 0:
            a, b, c, d = coef[0, i], coef[1, i], coef[2, i], coef[3, i]
            r[i] = r0[i] + (p[1] * v0[i] + (a * p[2] + b * p[3] + c * p[4] + d * p[5]) + dr)
            v[i] = p[0] * v0[i] + (a * p[1] + b * p[2] + c * p[3] + d * p[4]) + dv
        else:
            r[i] = r0[i]
            v[i] = 0.0


@njit
def angle(theta, turn, tau):
    return theta + tau * (turn[0] + tau * (turn[1] / 2.0 + tau * (turn[2] / 6.0 + tau * turn[3] / 24.0)))


@njit
def averages(side, v0, coef, mean):
    """Means over the free slices: of the four coefficients, and of the velocities at the start."""
    for k in range(5):
        mean[k] = 0.0
    free = 0
    for i in range(len(side)):
        if side[i] == 0:
            free += 1
            for k in range(4):
                mean[k] += coef[k, i]
            mean[4] += v0[i]
    if free > 0:
        for k in range(5):
            mean[k] /= free
    return free


@njit
def step(r0, v0, side, theta, h, par, coef, mean, turn, rates, p, q, r1, v1, f1, df1):
    """Fill the cubics of the forcing, and of omega, for a step h; return its state at the end in r1, v1."""
    n = len(r0)
    spin = np.empty(2)
    forcing(r0, v0, theta, par, coef[0], coef[1], turn)
    coef[2, :] = 0.0
    coef[3, :] = 0.0
    turn[2] = turn[3] = 0.0
    free = averages(side, v0, coef, mean)
    rates[0] = par[5]
    rates[1] = par[5] * (1.0 - par[0] * free / par[1])
    place(r0, v0, side, coef, mean, rates, h, p, q, r1, v1)
    old = r1.copy()
    for sweep in range(SWEEPS):
        forcing(r1, v1, angle(theta, turn, h), par, f1, df1, spin)
        for i in range(n + 2):
            rise = (f1[i] - coef[0, i]) / h
            coef[2, i] = 2.0 * (3.0 * rise - 2.0 * coef[1, i] - df1[i]) / h
            coef[3, i] = 6.0 * (coef[1, i] + df1[i] - 2.0 * rise) / (h * h)
        rise = (spin[0] - turn[0]) / h
        turn[2] = 2.0 * (3.0 * rise - 2.0 * turn[1] - spin[1]) / h
        turn[3] = 6.0 * (turn[1] + spin[1] - 2.0 * rise) / (h * h)
        averages(side, v0, coef, mean)
        place(r0, v0, side, coef, mean, rates, h, p, q, r1, v1)
        change = 0.0
        for i in range(n):
            change = max(change, abs(r1[i] - old[i]))
            old[i] = r1[i]
        if change <= 4e-16 * par[3] and sweep > 0:
            break
    return free


@njit
def shift(i, v0, coef, mean, rates, tau, p, q):
    """How far slice i has gone at tau, and its velocity."""
    powers(rates[0], tau, p)
    powers(rates[1], tau, q)
    d = p[1] * v0[i] + (q[1] - p[1]) * mean[4]
    v = p[0] * v0[i] + (q[0] - p[0]) * mean[4]
    for k in range(4):
        d += coef[k, i] * p[k + 2] + mean[k] * (q[k + 2] - p[k + 2])
        v += coef[k, i] * p[k + 1] + mean[k] * (q[k + 1] - p[k + 1])
    return d, v


@njit
def turning(i, s, v0, coef, mean, rates, a, b, p, q):
    """Time in [a, b] at which the velocity of slice i changes sign."""
    inward = s * shift(i, v0, coef, mean, rates, a, p, q)[1] < 0.0
    for _ in range(60):
        mid = 0.5 * (a + b)
        if mid <= a or mid >= b:
            break
        if (s * shift(i, v0, coef, mean, rates, mid, p, q)[1] < 0.0) == inward:
            a = mid
        else:
            b = mid
    return a


@njit
def arrival(i, s, gap0, v0, coef, mean, rates, a, b, p, q):
    """Time in [a, b] at which slice i, still inside at a and outside at b, reaches the end s."""
    lo, hi = a, b
    tau = b
    for _ in range(80):
        d, v = shift(i, v0, coef, mean, rates, tau, p, q)
        gap = s * (gap0 + d)
        if gap > 0.0:
            hi = tau
        else:
            lo = tau
        new = tau - s * gap / v if v != 0.0 else hi
        if not (lo < new < hi):
            new = 0.5 * (lo + hi)
        if abs(new - tau) <= 1e-16 * tau or hi - lo <= 2e-16 * hi:
            tau = new
            break
        tau = new
    return tau


@njit
def first_impact(r0, v0, side, coef, mean, rates, h, par, p, q):
    """Time and slice of the first contact within the step, or h and -1."""
    best, who, where = h, -1, 0
    pp = np.empty((PIECES + 1, 6))
    qq = np.empty((PIECES + 1, 6))
    for j in range(PIECES + 1):
        powers(rates[0], h * j / PIECES, pp[j])
        powers(rates[1], h * j / PIECES, qq[j])
    push = abs(mean[4]) + h * (abs(mean[0]) + h * (abs(mean[1]) / 2 + h * (abs(mean[2]) / 6 + h * abs(mean[3]) / 24)))
    for i in range(len(r0)):
        if side[i] != 0:
            continue
        own = abs(coef[0, i]) + h * (abs(coef[1, i]) / 2 + h * (abs(coef[2, i]) / 6 + h * abs(coef[3, i]) / 24))
        reach = h * (abs(v0[i]) + h * own + 2.0 * push)
        for k in range(2):
            s = 2.0 * k - 1.0
            gap0 = r0[i] - par[8 + k]
            if s * gap0 + reach < 0.0:
                continue
            if s * gap0 >= 0.0 and s * v0[i] > 0.0:
                if who < 0 or best > 0.0:
                    best, who, where = 0.0, i, k
                continue
            va, ta = v0[i], 0.0
            for j in range(1, PIECES + 1):
                tb = h * j / PIECES
                if ta >= best:
                    break
                d = pp[j, 1] * v0[i] + (qq[j, 1] - pp[j, 1]) * mean[4]
                vb = pp[j, 0] * v0[i] + (qq[j, 0] - pp[j, 0]) * mean[4]
                for c in range(4):
                    d += coef[c, i] * pp[j, c + 2] + mean[c] * (qq[j, c + 2] - pp[j, c + 2])
                    vb += coef[c, i] * pp[j, c + 1] + mean[c] * (qq[j, c + 1] - pp[j, c + 1])
                when = -1.0
                if s * (gap0 + d) > 0.0:
                    start = ta
                    if s * va < 0.0:
                        start = turning(i, s, v0, coef, mean, rates, ta, tb, p, q)
                    when = arrival(i, s, gap0, v0, coef, mean, rates, start, tb, p, q)
                elif s * va > 0.0 and s * vb < 0.0:
                    top = turning(i, s, v0, coef, mean, rates, ta, tb, p, q)
                    if s * (gap0 + shift(i, v0, coef, mean, rates, top, p, q)[0]) > 0.0:
                        when = arrival(i, s, gap0, v0, coef, mean, rates, ta, top, p, q)
                if when >= 0.0:
                    if when < best:
                        best, who, where = when, i, k
                    break
                ta, va = tb, vb
    return best, who, where


@njit
def pressed(k, coef, mean, rates, tau, n, p, q):
    """Acceleration toward the end k of a slice that is at rest on it, at tau in the step."""
    powers(rates[1], tau, q)
    v = q[0] * mean[4]
    for c in range(4):
        v += mean[c] * q[c + 1]
    f = coef[0, n + k] + tau * (coef[1, n + k] + tau * (coef[2, n + k] / 2.0 + tau * coef[3, n + k] / 6.0))
    # d v_CM, and v_CM is the share 1 - rates[1] / rates[0] of the mean velocity
    return (2.0 * k - 1.0) * (f + (rates[0] - rates[1]) * v)


@njit
def first_release(resting, coef, mean, rates, h, n, p, q):
    """Time and end of the first release within the step, or h and -1."""
    best, which = h, -1
    for k in range(2):
        if resting[k] == 0:
            continue
        a = 0.0
        for j in range(1, PIECES + 1):
            b = h * j / PIECES
            if pressed(k, coef, mean, rates, b, n, p, q) < 0.0:
                for _ in range(60):
                    mid = 0.5 * (a + b)
                    if mid <= a or mid >= b:
                        break
                    if pressed(k, coef, mean, rates, mid, n, p, q) < 0.0:
                        b = mid
                    else:
                        a = mid
                if b < best:
                    best, which = b, k
                break
            a = b
    return best, which


@njit
def thrust(r, v, theta, par, k):
    """Acceleration toward the end k of a slice at rest on it, from the state."""
    c, vc, inertia, _ = bulk(r, v, par)
    omega = par[7] / inertia
    a = omega * omega * (par[8 + k] - c) + par[6] * math.cos(theta) + par[5] * vc
    return (2.0 * k - 1.0) * a


@njit
def let_go(r, v, side, theta, par, resting):
    """Release what is not pressed onto its end."""
    for k in range(2):
        if resting[k] > 0 and thrust(r, v, theta, par, k) < 0.0:
            for i in range(len(r)):
                if side[i] == 2 * k - 1:
                    side[i] = 0
            resting[k] = 0


@njit
def bounce(t, r, v, side, theta, par, resting, first, where, log, used):
    """Rebound of slice ``first`` from the end ``where`` and of all others that arrive at the same time; who is slow and pressed stays."""
    e, rest, length = par[10], par[11], par[3]
    struck = np.zeros(len(r), np.int64)
    for i in range(len(r)):
        if side[i] != 0:
            continue
        for k in range(2):
            s = 2 * k - 1
            arrives = s * v[i] > 0.0 and s * (r[i] - par[8 + k]) >= -2e-15 * length
            if arrives or (i == first and k == where):
                before = abs(v[i])
                r[i] = par[8 + k]
                v[i] = -s * e * before
                struck[i] = s
                if before > rest:
                    if used == len(log):
                        more = np.empty((2 * used, 5))
                        more[:used] = log
                        log = more
                    log[used, 0], log[used, 1], log[used, 2] = t, i, s
                    log[used, 3], log[used, 4] = before, abs(v[i])
                    used += 1
    for k in range(2):
        s = 2 * k - 1
        slow = 0
        for i in range(len(r)):
            if struck[i] == s and abs(v[i]) < rest:
                slow += 1
        if slow > 0 and thrust(r, v, theta, par, k) >= 0.0:
            for i in range(len(r)):
                if struck[i] == s and abs(v[i]) < rest:
                    side[i] = s
                    v[i] = 0.0
            resting[k] += slow
    return log, used


@njit
def fly(start, times, duration, steps, theta, par):
    n, points = len(start), len(times)
    r, v = start.copy(), np.zeros(n)
    side = np.zeros(n, np.int64)
    resting = np.zeros(2, np.int64)
    length = par[3]
    for k in range(2):
        for i in range(n):
            if abs(r[i] - par[8 + k]) <= 1e-12 * length:
                r[i] = par[8 + k]
                side[i] = 2 * k - 1
                resting[k] += 1
    let_go(r, v, side, theta, par, resting)
    coef = np.zeros((4, n + 2))
    mean, turn, rates = np.zeros(5), np.zeros(4), np.zeros(2)
    p, q = np.empty(6), np.empty(6)
    r1, v1, f1, df1 = np.empty(n), np.empty(n), np.empty(n + 2), np.empty(n + 2)
    out = np.empty((4, points))
    out_r, out_v = np.empty((points, n)), np.empty((points, n))
    log, used, answered, t = np.empty((256, 5)), 0, 0, 0.0
    for number in range(1, steps + 1):
        until = duration * number / steps if number < steps else max(duration, times[-1])
        while t < until:
            h = until - t
            step(r, v, side, theta, h, par, coef, mean, turn, rates, p, q, r1, v1, f1, df1)
            tau, who, where = first_impact(r, v, side, coef, mean, rates, h, par, p, q)
            release, which = first_release(resting, coef, mean, rates, h, n, p, q)
            if which >= 0 and release < tau:
                tau, who = release, -1
            else:
                which = -1
            now = t + tau if who >= 0 or which >= 0 else until
            while answered < points and times[answered] <= now:
                dt = min(max(times[answered] - t, 0.0), tau)
                place(r, v, side, coef, mean, rates, dt, p, q, out_r[answered], out_v[answered])
                c, _, inertia, _ = bulk(out_r[answered], out_v[answered], par)
                out[0, answered] = angle(theta, turn, dt)
                out[1, answered] = par[7] / inertia
                out[2, answered] = c
                out[3, answered] = inertia
                answered += 1
            place(r, v, side, coef, mean, rates, tau, p, q, r1, v1)
            r[:], v[:] = r1, v1
            theta = angle(theta, turn, tau)
            t = now
            if which >= 0:
                for i in range(n):
                    if side[i] == 2 * which - 1:
                        side[i] = 0
                resting[which] = 0
            if who >= 0:
                log, used = bounce(t, r, v, side, theta, par, resting, who, where, log, used)
                let_go(r, v, side, theta, par, resting)
    return out, out_r, out_v, log[:used]


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    count = len(ask.start)
    times = np.array(ask.times, dtype=float)
    start = np.array(ask.start, dtype=float)
    m = throw.water_mass / count
    total = throw.water_mass + bottle.mass
    half = 0.5 * throw.water_mass / bottle.capacity * bottle.length / count
    low, high = half, bottle.length - half
    own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    speed = abs(throw.omega0) * bottle.length
    par = np.array(
        [m, total, bottle.mass, bottle.length, own, throw.drag / m, throw.gravity, 0.0, low, high]
        + [throw.restitution, 5e-5 * speed]
    )
    c, _, inertia, _ = bulk(start, np.zeros(count), par)
    par[7] = inertia * throw.omega0
    if throw.frozen or high - low <= 1e-12 * bottle.length:
        same = np.ones(len(times))
        theta, omega, r_cm = throw.theta0 + throw.omega0 * times, throw.omega0 * same, c * same
        r, v, log = np.tile(start, (len(times), 1)), np.zeros((len(times), count)), np.empty((0, 5))
        inertia = inertia * same
    else:
        steps = max(1, round(ask.effort)) if ask.effort else 1000
        out, r, v, log = fly(start, times, throw.duration, steps, throw.theta0, par)
        theta, omega, r_cm, inertia = out
    names = ("time", "slice", "end", "speed_before", "speed_after")
    return {
        "t": times,
        "theta": theta,
        "omega": omega,
        "r_cm": r_cm,
        "inertia": inertia,
        "r": r,
        "v": v,
        "impacts": dict(zip(names, log.T)),
    }


solve.name = "exponential Hermite collocation"
solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 4
