"""Slices in a freely falling bottle: Strang splitting, extrapolated, with dense output of degree 8.

Places are measured from the middle of the tube: y = r - L/2, so that a free slice obeys

    y'' = omega^2 (y - y_c) - d y' - (alpha / M_c) sum_free y_j',        d = alpha / m

with M_c, y_c of the tube and of what rests in it. One step is split into a drift (velocities frozen) and a kick (places
frozen, velocities exact, drag included). The errors of that go in even powers of the substep, so that up to
2, 4, 6 and 8 substeps give order 8 at the middle and at the end. The place, velocity and acceleration at the start, the middle and
the end make a polynomial, whose Bernstein coefficients tell when a slice first reaches an end.
"""

import numpy as np
from numba import njit

SUBSTEPS = np.array([2, 4, 6, 8])
DEGREE = 8
REST = 0.99e-4
TOGETHER = 1e-10


def _hermite():
    """Matrix from (y, y', y'') at 1/2 and 1, less the known part, to the coefficients of s^3 .. s^8."""
    rows = []
    for s in (0.5, 1.0):
        k = np.arange(3, DEGREE + 1)
        rows += [s**k, k * s ** (k - 1.0), k * (k - 1) * s ** (k - 2.0)]
    return np.linalg.inv(np.array(rows))


def _bernstein():
    """Matrix from powers to Bernstein coefficients of the same degree, for every degree up to 8."""
    out = np.zeros((DEGREE + 1, DEGREE + 1, DEGREE + 1))
    choose = np.zeros((DEGREE + 1, DEGREE + 1))
    for n in range(DEGREE + 1):
        choose[n, 0] = 1.0
        for k in range(1, n + 1):
            choose[n, k] = choose[n - 1, k - 1] + choose[n - 1, k]
    for n in range(DEGREE + 1):
        for i in range(n + 1):
            for k in range(i + 1):
                out[n, i, k] = choose[i, k] / choose[n, k]
    return out


HERMITE = _hermite()
BERNSTEIN = _bernstein()


@njit
def turning(y, m, mass, shell, momentum):
    """Omega, by the conserved angular momentum, and the centre of mass from the middle of the tube."""
    first = second = 0.0
    for i in range(len(y) - 1):
        first += y[i]
        second += y[i] * y[i]
    centre = m * first / mass
    return momentum / (shell + m * second - mass * centre * centre), centre


@njit
def body(side, m, mass, reach):
    """Mass and centre of the tube with the slices at rest in it, and the number of the others."""
    free, lean = 0, 0
    for i in range(len(side)):
        if side[i] == 0:
            free += 1
        else:
            lean += side[i]
    heavy = mass - m * free
    return heavy, m * reach * lean / heavy, free


@njit
def acceleration(y, v, side, m, mass, shell, momentum, drag, heavy, y_c, out):
    """Accelerations of all free slices, and in the last place that of theta."""
    n = len(side)
    omega, centre = turning(y, m, mass, shell, momentum)
    total = change = 0.0
    for i in range(n):
        total += v[i]
        change += (y[i] - centre) * v[i]
    square = omega * omega
    back = drag * m * total / heavy
    for i in range(n):
        out[i] = square * (y[i] - y_c) - drag * v[i] - back if side[i] == 0 else 0.0
    inertia = momentum / omega
    out[n] = -omega * 2.0 * m * change / inertia


@njit
def split(y, v, side, free, m, mass, shell, momentum, drag, heavy, y_c, h, count, middle, last):
    """Fly ``count`` substeps over h; rows of middle and last: places with theta, velocities."""
    n = len(side)
    k = h / count
    place, speed = last[0], last[1]
    place[:] = y
    speed[:] = v
    fast = drag * mass / heavy
    keep, keep_mean = np.exp(-drag * k), np.exp(-fast * k)
    gain = -np.expm1(-drag * k) / drag if drag > 0.0 else k
    gain_mean = -np.expm1(-fast * k) / fast if drag > 0.0 else k
    for j in range(count):
        for i in range(n):
            place[i] += 0.5 * k * speed[i]
        omega, _ = turning(place, m, mass, shell, momentum)
        place[n] += k * omega
        square = omega * omega
        mean = push = 0.0
        for i in range(n):
            if side[i] == 0:
                mean += speed[i]
                push += square * (place[i] - y_c)
        if free > 0:
            mean /= free
            push /= free
        shift = keep_mean * mean + gain_mean * push - keep * mean - gain * push
        for i in range(n):
            if side[i] == 0:
                speed[i] = keep * speed[i] + gain * square * (place[i] - y_c) + shift
                place[i] += 0.5 * k * speed[i]
        if j == count // 2 - 1:
            middle[:] = last


@njit
def step(y, v, side, free, m, mass, shell, momentum, drag, heavy, y_c, h, length, pace, goal, table):
    """Extrapolate to table[0, 0] at the middle and table[0, 1] at the end, until the error reaches the goal.

    Returned are the error, in units of the scales, and the last level.
    """
    n = len(side)
    error = 0.0
    for a in range(len(SUBSTEPS)):
        split(y, v, side, free, m, mass, shell, momentum, drag, heavy, y_c, h, SUBSTEPS[a], table[a, 0], table[a, 1])
        for j in range(a, 0, -1):
            ratio = SUBSTEPS[a] / SUBSTEPS[j - 1]
            weight = 1.0 / (ratio * ratio - 1.0)
            if j == 1:
                error = 0.0
            for where in range(2):
                for kind in range(2):
                    for i in range(n + 1):
                        change = weight * (table[j, where, kind, i] - table[j - 1, where, kind, i])
                        table[j - 1, where, kind, i] = table[j, where, kind, i] + change
                        if j == 1 and where == 1:
                            unit = (length if kind == 0 else pace) if i < n else 1.0
                            error = max(error, abs(change) / unit)
        if a > 0 and error <= goal:
            return error, a
    return error, len(SUBSTEPS) - 1


@njit
def smooth(y, v, a, table, side, m, mass, shell, momentum, drag, heavy, y_c, h, poly):
    """Coefficients of the powers of s = t/h, 0 to 8, of all places and of theta."""
    n = len(side)
    acc = np.empty((2, n + 1))
    for where in range(2):
        omega, _ = turning(table[0, where, 0], m, mass, shell, momentum)
        table[0, where, 1, n] = omega
        acceleration(
            table[0, where, 0], table[0, where, 1], side, m, mass, shell, momentum, drag, heavy, y_c, acc[where]
        )
    rest = np.empty(6)
    for i in range(n + 1):
        poly[i, 0], poly[i, 1], poly[i, 2] = y[i], h * v[i], 0.5 * h * h * a[i]
        for where in range(2):
            s = 0.5 * (where + 1)
            rest[3 * where] = table[0, where, 0, i] - y[i] - s * (poly[i, 1] + s * poly[i, 2])
            rest[3 * where + 1] = h * table[0, where, 1, i] - poly[i, 1] - 2.0 * s * poly[i, 2]
            rest[3 * where + 2] = h * h * acc[where, i] - 2.0 * poly[i, 2]
        for k in range(6):
            total = 0.0
            for j in range(6):
                total += HERMITE[k, j] * rest[j]
            poly[i, 3 + k] = total


@njit
def read(poly, s, h, y, v):
    """Places and velocities at s in the step."""
    for i in range(len(poly)):
        a, b = poly[i, DEGREE], 0.0
        for k in range(DEGREE - 1, -1, -1):
            b = b * s + a
            a = a * s + poly[i, k]
        y[i], v[i] = a, b / h


@njit
def crossing(c, degree):
    """First s in [0, 1] at which the polynomial c, negative before, becomes positive; 2 if it does not."""
    b = np.zeros((64, DEGREE + 1))
    left, width = np.zeros(64), np.zeros(64)
    for i in range(degree + 1):
        for k in range(i + 1):
            b[0, i] += BERNSTEIN[degree, i, k] * c[k]
    left[0], width[0], top = 0.0, 1.0, 0
    while top >= 0:
        now = b[top]
        if now[0] > 0.0:
            return left[top]
        signs = 0
        for i in range(degree):
            signs += (now[i] > 0.0) != (now[i + 1] > 0.0)
        if signs == 0 or (signs > 1 and (width[top] < 1e-9 or top > 60)):
            top -= 1
            continue
        if signs == 1:
            lo, hi = left[top], left[top] + width[top]
            s = hi
            for _ in range(100):
                value, slope = c[degree], 0.0
                for k in range(degree - 1, -1, -1):
                    slope = slope * s + value
                    value = value * s + c[k]
                if value > 0.0:
                    hi = s
                else:
                    lo = s
                old = s
                s = s - value / slope if slope > 0.0 else lo
                if not (lo < s < hi):
                    s = 0.5 * (lo + hi)
                if abs(s - old) <= 2e-16 * s or hi - lo <= 2e-16 * hi:
                    break
            return s
        # de Casteljau: now becomes the right half, and what passes its first place is the left half
        half = 0.5 * width[top]
        start = b[top + 1]
        start[0] = now[0]
        for j in range(1, degree + 1):
            for i in range(degree - j + 1):
                now[i] = 0.5 * (now[i] + now[i + 1])
            start[j] = now[0]
        left[top + 1], width[top + 1] = left[top], half
        left[top], width[top] = left[top] + half, half
        top += 1
    return 2.0


@njit
def first_contact(poly, side, reach):
    """Earliest s in the step at which a free slice reaches an end; 2 if none does."""
    best, who, end = 2.0, -1, 0
    c = np.empty(DEGREE + 1)
    for i in range(len(side)):
        if side[i] != 0:
            continue
        far = 0.0
        for k in range(1, DEGREE + 1):
            far += abs(poly[i, k])
        for s in (1, -1):
            gap = s * poly[i, 0] - reach
            if gap + far < 0.0:
                continue
            skip = 0
            if gap >= 0.0:
                skip = 1
                while skip < DEGREE and poly[i, skip] == 0.0:
                    skip += 1
                if s * poly[i, skip] > 0.0:
                    return 0.0, i, s
            for k in range(skip, DEGREE + 1):
                c[k - skip] = s * poly[i, k]
            if skip == 0:
                c[0] = gap
            when = crossing(c, DEGREE - skip)
            if when < best:
                best, who, end = when, i, s
    return best, who, end


@njit
def pressure(y, v, side, end, m, mass, shell, momentum, drag, heavy, y_c, reach):
    """Acceleration toward an end of a slice at rest on it."""
    omega, _ = turning(y, m, mass, shell, momentum)
    total = 0.0
    for i in range(len(side)):
        if side[i] == 0:
            total += v[i]
    return end * (omega * omega * (end * reach - y_c) - drag * m * total / heavy)


@njit
def first_release(poly, h, side, m, mass, shell, momentum, drag, heavy, y_c, reach, y, v):
    """Earliest s at which an end no longer presses on what rests there; 2 if both do all the time."""
    best, which = 2.0, 0
    for end in (1, -1):
        found = False
        for i in range(len(side)):
            found = found or side[i] == end
        if not found:
            continue
        lo = 0.0
        for j in range(1, 5):
            hi = 0.25 * j
            read(poly, hi, h, y, v)
            if pressure(y, v, side, end, m, mass, shell, momentum, drag, heavy, y_c, reach) < 0.0:
                while hi - lo > 1e-15:
                    s = 0.5 * (lo + hi)
                    read(poly, s, h, y, v)
                    if pressure(y, v, side, end, m, mass, shell, momentum, drag, heavy, y_c, reach) < 0.0:
                        hi = s
                    else:
                        lo = s
                if hi < best:
                    best, which = hi, end
                break
            lo = hi
    return best, which


@njit
def tube_jump(ends, speeds, number, e, m, tube):
    """Velocity that the tube gains: tube V = m sum s max(0, s ((1 + e) u - V)), which has one solution.

    The right side falls in steps of slope m at V = (1 + e) u: walk through these until both sides are equal.
    """
    low, high = -np.inf, np.inf
    for j in range(number):
        knee = (1.0 + e) * speeds[j]
        total = -tube * knee
        for i in range(number):
            total += m * ends[i] * max(0.0, ends[i] * ((1.0 + e) * speeds[i] - knee))
        if total >= 0.0:
            low = max(low, knee)
        else:
            high = min(high, knee)
    # between two knees the same contacts push
    above, weight = 0.0, tube
    for i in range(number):
        knee = (1.0 + e) * speeds[i]
        pushes = knee >= high if ends[i] > 0 else knee <= low
        if pushes:
            above += m * knee
            weight += m
    return above / weight


@njit
def collide(y, v, side, first, first_end, e, rest, m, mass, shell, momentum, drag, reach, length, log, used, t):
    """Impacts of this instant, all together; then who of the slow ones stays, and who of the others leaves."""
    n = len(side)
    at = np.zeros(n, np.int64)
    ends, speeds = np.empty(n), np.empty(n)
    before = v[:n].copy()
    strike = np.zeros(n, np.bool_)
    number = 0
    for i in range(n):
        for s in (1, -1):
            gap = s * y[i] - reach
            arrives = s * v[i] > 0.0 and gap >= -TOGETHER * length
            if (i == first and s == first_end) or side[i] == s or arrives or (side[i] == 0 and gap >= 0.0):
                at[i] = s
                strike[i] = side[i] == 0 and s * v[i] > 0.0
                ends[number], speeds[number] = s, v[i]
                number += 1
                break
    tube = mass - m * n
    jump = tube_jump(ends, speeds, number, e, m, tube)
    for i in range(n):
        u = v[i]
        if at[i] != 0:
            s = at[i]
            u -= s * max(0.0, s * ((1.0 + e) * u - jump))
        v[i] = u - jump
    settle(y, v, side, at, rest, m, mass, shell, momentum, drag, reach)
    for i in range(n):
        if strike[i] and abs(before[i]) > rest:
            if used == len(log):
                more = np.empty((2 * used, 5))
                more[:used] = log
                log = more
            log[used, 0], log[used, 1], log[used, 2] = t, i, at[i]
            log[used, 3], log[used, 4] = abs(before[i]), abs(v[i])
            used += 1
    return log, used


@njit
def settle(y, v, side, at, rest, m, mass, shell, momentum, drag, reach):
    """Who of the slices at the ends (``at``) is slow and pressed stays there; the tube takes over its momentum."""
    n = len(side)
    slow = np.zeros(n, np.int64)
    for i in range(n):
        side[i] = 0
        if at[i] != 0 and abs(v[i]) < rest:
            slow[i] = at[i]
    for choice in range(4):
        base, cap = choice in (0, 1), choice in (0, 2)
        any_base = any_cap = False
        loose = 0.0
        for i in range(n):
            side[i] = 0
            if (base and slow[i] == 1) or (cap and slow[i] == -1):
                side[i] = slow[i]
                loose += v[i]
                any_base = any_base or slow[i] == 1
                any_cap = any_cap or slow[i] == -1
        heavy, y_c, _ = body(side, m, mass, reach)
        gained = m * loose / heavy
        trial = v.copy()
        for i in range(n):
            trial[i] = 0.0 if side[i] != 0 else v[i] - gained
        right = True
        if any_base:
            right = pressure(y, trial, side, 1, m, mass, shell, momentum, drag, heavy, y_c, reach) >= 0.0
        if any_cap and right:
            right = pressure(y, trial, side, -1, m, mass, shell, momentum, drag, heavy, y_c, reach) >= 0.0
        if right:
            for i in range(n):
                v[i] = trial[i]
                if side[i] != 0:
                    y[i] = side[i] * reach
            break


@njit
def fly(start, times, duration, rtol, theta, m, mass, shell, momentum, drag, e, reach, length, pace):
    n, points = len(start), len(times)
    y, v, a = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1)
    y[:n], y[n] = start, theta
    y1, v1 = np.empty(n + 1), np.empty(n + 1)
    side, at = np.zeros(n, np.int64), np.zeros(n, np.int64)
    for i in range(n):
        for s in (1, -1):
            if abs(s * y[i] - reach) <= 1e-12 * length:
                y[i] = s * reach
                at[i] = s
    rest = REST * pace
    settle(y, v, side, at, rest, m, mass, shell, momentum, drag, reach)
    table = np.empty((len(SUBSTEPS), 2, 2, n + 1))
    poly = np.empty((n + 1, DEGREE + 1))
    out = np.empty((3, points))
    log, used, answered, t = np.empty((256, 5)), 0, 0, 0.0
    last = max(duration, times[-1])
    h = 0.05 * min(1.0 / abs(pace / length), duration)
    goal = max(rtol, 1e-14)
    usual, struck = 0.1 * duration, 0.0
    while answered < points:
        heavy, y_c, free = body(side, m, mass, reach)
        v[n], _ = turning(y, m, mass, shell, momentum)
        acceleration(y, v, side, m, mass, shell, momentum, drag, heavy, y_c, a)
        rate = max(abs(v[n]), drag * mass / heavy)
        h = min(h, 0.25 * duration)
        cut = t + 1.000001 * h >= last
        try_h = last - t if cut else h
        error, level = step(
            y, v, side, free, m, mass, shell, momentum, drag, heavy, y_c, try_h, length, pace, goal, table
        )
        factor = 0.9 * (goal / error) ** (1.0 / (2 * level + 1)) if error > 0.0 else 4.0
        if error > goal and try_h * rate > 1e-3:
            h = try_h * max(0.2, factor)
            continue
        smooth(y, v, a, table, side, m, mass, shell, momentum, drag, heavy, y_c, try_h, poly)
        s, who, end = first_contact(poly, side, reach)
        released, which = first_release(poly, try_h, side, m, mass, shell, momentum, drag, heavy, y_c, reach, y1, v1)
        stop = min(s, released, 1.0)
        now = t + stop * try_h if stop < 1.0 or not cut else last
        while answered < points and (times[answered] <= now or stop == 1.0 and cut):
            read(poly, min(max((times[answered] - t) / try_h, 0.0), stop), try_h, y1, v1)
            omega, centre = turning(y1, m, mass, shell, momentum)
            out[0, answered], out[1, answered], out[2, answered] = y1[n], omega, centre
            answered += 1
        read(poly, stop, try_h, y1, v1)
        for i in range(n + 1):
            if i == n or side[i] == 0:
                y[i], v[i] = y1[i], v1[i]
        t = now
        if not cut or error > goal:
            h = try_h * min(4.0, max(0.2, factor))
        if stop < 1.0:
            # where impacts are frequent it saves time not to look far beyond the next
            usual += 0.1 * (t - struck - usual)
            struck = t
            h = min(h, 4.0 * usual)
        if released < s and released <= 1.0:
            for i in range(n):
                if side[i] == which:
                    side[i] = 0
        elif s <= 1.0:
            y[who] = end * reach
            log, used = collide(
                y, v, side, who, end, e, rest, m, mass, shell, momentum, drag, reach, length, log, used, t
            )
    return out, log[:used]


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    times, start = np.array(ask.times, dtype=float), np.array(ask.start, dtype=float)
    n = len(start)
    m, mass = throw.water_mass / n, throw.water_mass + bottle.mass
    length = bottle.length
    height = throw.water_mass / bottle.capacity * length / n
    reach = (length - height) / 2
    shell = bottle.mass * (bottle.radius**2 / 2 + length**2 / 12)
    y = start - length / 2
    centre = m * y.sum() / mass
    momentum = throw.omega0 * (shell + m * (y**2).sum() - mass * centre**2)
    if throw.frozen or reach <= 1e-12 * length:
        theta = throw.theta0 + throw.omega0 * times
        omega, r_cm = np.full(len(times), float(throw.omega0)), np.full(len(times), length / 2 + centre)
        log = np.empty((0, 5))
    else:
        rtol = ask.effort if ask.effort is not None else 1e-9
        (theta, omega, y_cm), log = fly(
            y, times, throw.duration, rtol, throw.theta0, m, mass, shell, momentum, throw.drag / m,
            throw.restitution, reach, length, abs(throw.omega0) * length,
        )  # fmt: skip
        r_cm = length / 2 + y_cm
    return {"t": times, "theta": theta, "omega": omega, "r_cm": r_cm, "impacts": log}


solve.refined_by = "rtol"
