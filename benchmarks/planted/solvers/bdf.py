"""Eq. 8 by BDF2 with variable steps, begun and begun anew after every event by an SDIRK step of order 2.

State: theta, r, v of every slice; omega follows from the conserved angular momentum, J omega = J_0 omega_0. A stage
of either formula reads  y = Y + c f(y);  given omega it is linear in r and v, so that one number, omega, is iterated.
Rebounds and releases are located within a step: the step is taken again, up to the event.
"""

import math

import numpy as np
from numba import njit

GAMMA = 1.0 - math.sqrt(0.5)  # SDIRK of order 2, L-stable
GROWTH = 2.0  # a step longer than that many times the last begins anew
WIDEST = 0.5  # widest step, in radians of turning

M, TOTAL, BOTTLE, LENGTH, OWN, G, D, MOMENTUM, LOW, HIGH, REST, E = range(12)


@njit(error_model="numpy")
def centre_of_mass(r, p):
    s = 0.0
    for i in range(r.size):
        s += r[i]
    return (p[M] * s + p[BOTTLE] * 0.5 * p[LENGTH]) / p[TOTAL]


@njit(error_model="numpy")
def moment_of_inertia(r, p):
    x = centre_of_mass(r, p)
    s = 0.0
    for i in range(r.size):
        s += (r[i] - x) ** 2
    return p[M] * s + p[BOTTLE] * (p[OWN] + (0.5 * p[LENGTH] - x) ** 2)


@njit(error_model="numpy")
def drive(theta, r, v, p):
    """Return omega^2, r_CM and the part of the acceleration that all slices share."""
    s = 0.0
    for i in range(v.size):
        s += v[i]
    omega = p[MOMENTUM] / moment_of_inertia(r, p)
    shared = p[D] * p[M] * s / p[TOTAL] + p[G] * math.cos(theta)
    return omega * omega, centre_of_mass(r, p), shared


@njit(error_model="numpy")
def press(theta, r, v, p):
    """Return the accelerations of slices at rest on base and cap if these were let go."""
    q, x, shared = drive(theta, r, v, p)
    return q * (p[HIGH] - x) + shared, q * (p[LOW] - x) + shared


@njit(error_model="numpy")
def stage(c, theta, rr, vv, rest, guess, p, r1, v1):
    """Solve y = Y + c f(y) for r1, v1; return theta and omega. Slices at rest keep their places."""
    n = rr.size
    sr = sv = still = 0.0
    free = 0
    for i in range(n):
        if rest[i] == 0:
            sr += rr[i]
            sv += vv[i]
            free += 1
        else:
            still += rr[i]
            r1[i] = rr[i]
            v1[i] = 0.0
    share = p[M] / p[TOTAL]
    known = share * (sr + still) + p[BOTTLE] * 0.5 * p[LENGTH] / p[TOTAL]
    omega = guess
    before = gap_before = 0.0
    for turn in range(50):
        q = omega * omega
        weight = p[G] * math.cos(theta + c * omega)
        own = c * c * q - c * p[D]
        speed = share * (sv + c * q * (sr - free * known) + free * c * weight) / (1.0 - own + share * free * own)
        x = known + c * speed
        for i in range(n):
            if rest[i] == 0:
                v1[i] = (vv[i] + c * (q * (rr[i] - x) + p[D] * speed + weight)) / (1.0 - own)
                r1[i] = rr[i] + c * v1[i]
        new = p[MOMENTUM] / moment_of_inertia(r1, p)
        gap = new - omega
        if abs(gap) <= 4e-16 * abs(new):
            break
        if turn == 0 or gap == gap_before:
            following = new
        else:
            following = omega - gap * (omega - before) / (gap - gap_before)
        before, gap_before = omega, gap
        omega = following
    return theta + c * omega, new


@njit(error_model="numpy")
def advance(h, last, theta, r, v, theta_p, r_p, v_p, omega, rest, p, rr, vv, r1, v1):
    """Take a step h from (theta, r, v), into r1 and v1; return theta and omega. ``last``: the step before, or 0."""
    n = r.size
    if last > 0.0 and h <= GROWTH * last:
        w = h / last
        new, old = (1.0 + w) ** 2 / (1.0 + 2.0 * w), w * w / (1.0 + 2.0 * w)
        for i in range(n):
            rr[i] = new * r[i] - old * r_p[i]
            vv[i] = new * v[i] - old * v_p[i]
            if rest[i] != 0:
                rr[i] = r[i]
        return stage(h * (1.0 + w) / (1.0 + 2.0 * w), new * theta - old * theta_p, rr, vv, rest, omega, p, r1, v1)
    c = GAMMA * h
    theta1, omega1 = stage(c, theta, r, v, rest, omega, p, r1, v1)
    ratio = (1.0 - GAMMA) / GAMMA
    for i in range(n):
        rr[i] = r[i] + ratio * (r1[i] - r[i])
        vv[i] = v[i] + ratio * (v1[i] - v[i])
    return stage(c, theta + ratio * (theta1 - theta), rr, vv, rest, omega1, p, r1, v1)


@njit(error_model="numpy")
def crossing(g0, d0, g1, d1, tol):
    """Return where in (0, 1] a cubic with these ends and slopes first rises beyond 0, or 2 if it does not."""
    c2 = 3.0 * (g1 - g0) - 2.0 * d0 - d1
    c3 = 2.0 * (g0 - g1) + d0 + d1
    lower, upper = 0.0, 1.0
    # turning points: d0 + 2 c2 x + 3 c3 x^2 = 0
    disc = c2 * c2 - 3.0 * c3 * d0
    found = g1 > tol
    if disc > 0.0:
        root = -c2 - math.copysign(math.sqrt(disc), c2)
        xa = root / (3.0 * c3) if c3 != 0.0 else -1.0
        xb = d0 / root if root != 0.0 else -1.0
        if xa > xb:
            xa, xb = xb, xa
        for x in (xa, xb):
            if 0.0 < x < upper:
                if 2.0 * c2 + 6.0 * c3 * x > 0.0:
                    lower = x
                elif g0 + x * (d0 + x * (c2 + x * c3)) > tol:
                    upper = x
                    found = True
    if not found:
        return 2.0
    for _ in range(50):
        x = 0.5 * (lower + upper)
        if g0 + x * (d0 + x * (c2 + x * c3)) > 0.0:
            upper = x
        else:
            lower = x
    return upper


@njit(error_model="numpy")
def first_event(h, r, v, r1, v1, rest, base0, cap0, base1, cap1, p, tol):
    """Return the earliest event's share of the step (2 if none) and its slice (-1: base lets go, -2: cap)."""
    earliest, who = 2.0, -3
    on_base = on_cap = False
    for i in range(r.size):
        if rest[i] == 0:
            if r1[i] > p[HIGH] + tol or (v[i] > 0.0 and v1[i] < 0.0):
                x = crossing(r[i] - p[HIGH], h * v[i], r1[i] - p[HIGH], h * v1[i], tol)
                if x < earliest:
                    earliest, who = x, i
            if r1[i] < p[LOW] - tol or (v[i] < 0.0 and v1[i] > 0.0):
                x = crossing(p[LOW] - r[i], -h * v[i], p[LOW] - r1[i], -h * v1[i], tol)
                if x < earliest:
                    earliest, who = x, i
        elif rest[i] > 0:
            on_base = True
        else:
            on_cap = True
    if on_base and base1 < 0.0:
        x = base0 / (base0 - base1) if base0 > 0.0 else 0.0
        if x < earliest:
            earliest, who = x, -1
    if on_cap and cap1 > 0.0:
        x = cap0 / (cap0 - cap1) if cap0 < 0.0 else 0.0
        if x < earliest:
            earliest, who = x, -2
    return earliest, who


@njit(error_model="numpy")
def settle(theta, r, v, rest, p, tol, who):
    """Put at rest what stands at an end and is pressed there, let go what is not; return both accelerations.

    ``who``: -1 and -2 let base and cap go, whatever rounding makes of a force that vanishes; -9 holds.
    """
    base, cap = press(theta, r, v, p)
    if who == -1 or (who == -9 and base < 0.0):
        base = -0.0 if who == -9 else -1e-300
    if who == -2 or (who == -9 and cap > 0.0):
        cap = 0.0 if who == -9 else 1e-300
    for i in range(r.size):
        if v[i] == 0.0 and r[i] >= p[HIGH] - tol and base >= 0.0:
            rest[i] = 1
            r[i] = p[HIGH]
        elif v[i] == 0.0 and r[i] <= p[LOW] + tol and cap <= 0.0:
            rest[i] = -1
            r[i] = p[LOW]
        else:
            rest[i] = 0
    return base, cap


@njit(error_model="numpy")
def rebound(t, r, v, rest, p, tol, impacts, count):
    """Turn round what stands at an end and moves out, and record it; return the table of impacts and its length."""
    for i in range(r.size):
        if rest[i] != 0:
            continue
        end = 0
        if r[i] >= p[HIGH] - tol and v[i] > 0.0:
            end = 1
            r[i] = p[HIGH]
        elif r[i] <= p[LOW] + tol and v[i] < 0.0:
            end = -1
            r[i] = p[LOW]
        if end == 0:
            continue
        if count == impacts.shape[0]:
            longer = np.zeros((2 * count, 5))
            for row in range(count):
                for column in range(5):
                    longer[row, column] = impacts[row, column]
            impacts = longer
        after = -p[E] * v[i]
        if abs(after) < p[REST]:
            after = 0.0
        impacts[count, 0] = t
        impacts[count, 1] = i
        impacts[count, 2] = end
        impacts[count, 3] = abs(v[i])
        impacts[count, 4] = abs(after)
        count += 1
        v[i] = after
    return impacts, count


@njit(error_model="numpy")
def copy(source, target):
    for i in range(source.size):
        target[i] = source[i]


@njit(error_model="numpy")
def answer(k, r, v, r_out, v_out):
    for i in range(r.size):
        r_out[k, i] = r[i]
        v_out[k, i] = v[i]


@njit(error_model="numpy")
def fly(times, start, dt, theta0, p):
    n, points = start.size, times.size
    theta_out, omega_out = np.zeros(points), np.zeros(points)
    r_out, v_out = np.zeros((points, n)), np.zeros((points, n))
    impacts, count = np.zeros((64, 5)), 0
    work = np.zeros((10, n))
    r, v, r_p, v_p, r1, v1 = work[0], work[1], work[2], work[3], work[4], work[5]
    r2, v2, rr, vv = work[6], work[7], work[8], work[9]
    copy(start, r)
    copy(start, r_p)
    rest = np.zeros(n, dtype=np.int64)
    tol = 1e-14 * p[LENGTH]
    t, theta, theta_p, last = 0.0, theta0, theta0, 0.0
    omega = p[MOMENTUM] / moment_of_inertia(r, p)
    base, cap = settle(theta, r, v, rest, p, tol, 0)
    k = stuck = 0
    while k < points and times[k] <= 0.0:
        theta_out[k], omega_out[k] = theta, omega
        answer(k, r, v, r_out, v_out)
        k += 1
    final = times[points - 1]
    while k < points:
        h = min(dt, final - t)
        if abs(omega) * h > WIDEST:
            h = WIDEST / abs(omega)
        whole = h
        event = False
        for trial in range(60):
            theta1, omega1 = advance(h, last, theta, r, v, theta_p, r_p, v_p, omega, rest, p, rr, vv, r1, v1)
            base1, cap1 = press(theta1, r1, v1, p)
            x, who = first_event(h, r, v, r1, v1, rest, base, cap, base1, cap1, p, tol)
            if who < 0 and stuck > n + 9:
                x = 2.0  # rounding: a force about 0 lets go and catches at once; it holds for a step
            if x > 1.0:
                # nobody is outside; does somebody stand at an end?
                for i in range(n):
                    if rest[i] == 0:
                        out = (r1[i] >= p[HIGH] - tol and v1[i] > 0.0) or (r1[i] <= p[LOW] + tol and v1[i] < 0.0)
                        event = event or out
                break
            small = 1e-15 * whole + 3e-16 * final
            if who < 0 and (h - x * h <= 100.0 * small or trial > 40):
                event = True
                break
            if x * h <= small or trial == 59:
                # at once: the event is now
                event = True
                h = 0.0
                theta1, omega1 = theta, omega
                copy(r, r1)
                copy(v, v1)
                if who >= 0 and v[who] != 0.0:
                    r1[who] = p[HIGH] if v[who] > 0.0 else p[LOW]
                break
            h *= x
        arrived = final if h == final - t else t + h
        while k < points and times[k] <= arrived:
            if times[k] == arrived:
                theta_out[k], omega_out[k] = theta1, omega1
                answer(k, r1, v1, r_out, v_out)
            else:
                side = times[k] - t
                theta_out[k], omega_out[k] = advance(
                    side, last, theta, r, v, theta_p, r_p, v_p, omega, rest, p, rr, vv, r2, v2
                )
                inside = True
                for i in range(n):
                    if r2[i] > p[HIGH] or r2[i] < p[LOW]:
                        r2[i] = min(max(r2[i], p[LOW]), p[HIGH])
                        inside = False
                if not inside:
                    omega_out[k] = p[MOMENTUM] / moment_of_inertia(r2, p)
                answer(k, r2, v2, r_out, v_out)
            k += 1
        if not event:
            theta_p, last = theta, h
            copy(r, r_p)
            copy(v, v_p)
            base, cap = base1, cap1
            stuck = 0
        t, theta, omega = arrived, theta1, omega1
        copy(r1, r)
        copy(v1, v)
        if event:
            impacts, count = rebound(t, r, v, rest, p, tol, impacts, count)
            stuck = stuck + 1 if h == 0.0 else 0
            base, cap = settle(theta, r, v, rest, p, tol, -9 if stuck > n + 9 else min(who, 0) if x <= 1.0 else 0)
            omega = p[MOMENTUM] / moment_of_inertia(r, p)
            last = 0.0
    return theta_out, omega_out, r_out, v_out, impacts, count


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    times = np.array(ask.times, dtype=float)
    start = np.array(ask.start, dtype=float)
    p = np.zeros(12)
    p[M], p[TOTAL], p[BOTTLE], p[LENGTH] = throw.slice_mass, throw.total_mass, bottle.mass, bottle.length
    p[OWN] = bottle.radius**2 / 2 + bottle.length**2 / 12
    p[G], p[D] = throw.gravity, throw.drag / throw.slice_mass
    p[LOW], p[HIGH], p[E] = throw.r_min, throw.r_max, throw.restitution
    p[REST] = 8e-5 * abs(throw.omega0) * bottle.length
    p[MOMENTUM] = moment_of_inertia(start, p) * throw.omega0
    if throw.frozen:
        theta, omega = throw.theta0 + throw.omega0 * times, np.full(times.size, throw.omega0)
        r, v = np.tile(start, (times.size, 1)), np.zeros((times.size, start.size))
        impacts, count = np.zeros((0, 5)), 0
    else:
        theta, omega, r, v, impacts, count = fly(times, start, float(ask.effort), throw.theta0, p)
    r_cm = (p[M] * r.sum(axis=1) + p[BOTTLE] * p[LENGTH] / 2) / p[TOTAL]
    inertia = p[M] * ((r - r_cm[:, None]) ** 2).sum(axis=1) + p[BOTTLE] * (p[OWN] + (p[LENGTH] / 2 - r_cm) ** 2)
    return {
        "t": times,
        "theta": theta,
        "omega": omega,
        "r": r,
        "v": v,
        "r_cm": r_cm,
        "inertia": inertia,
        "impacts": [tuple(row) for row in impacts[:count].tolist()],
    }


solve.refined_by = "dt"
solve.order = 2
solve.equation = "eq8"
solve.timeout = 300.0
