"""A free bottle by the Runge-Kutta pair 5(4) of Tsitouras (2011), with adaptive steps and its dense output.

Places r and speeds v are measured in the bottle; its own motion follows, as the centre of mass stays where it is.
omega follows from the conserved angular momentum. Impacts move the tube; those at one time are solved together.
An impact or a release inside a step is first looked for on the dense output, then the step is taken again up to it.
"""

import math

import numpy as np
from numba import njit

C = np.array([0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0, 1.0])
A = np.zeros((7, 6))
A[1, :1] = [0.161]
A[2, :2] = [-0.008480655492356989, 0.335480655492357]
A[3, :3] = [2.8971530571054935, -6.359448489975075, 4.3622954328695815]
A[4, :4] = [5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525]
A[5, :5] = [5.86145544294642, -12.92096931784711, 8.159367898576159, -0.071584973281401, -0.028269050394068383]
A[6, :6] = [
    0.09646076681806523,
    0.01,
    0.4798896504144996,
    1.379008574103742,
    -3.290069515436081,
    2.324710524099774,
]
ERROR = np.array(
    [
        -0.00178001105222577714,
        -0.0008164344596567469,
        0.007880878010261995,
        -0.1447110071732629,
        0.5823571654525552,
        -0.45808210592918697,
        0.015151515151515152,
    ]
)
SAFETY, SHRINK, GROW = 0.9, 0.2, 5.0
WIDEST = 0.5  # widest step, in radians of turning
FINEST = 1e-14  # smallest relative tolerance of a step

M, TOTAL, BOTTLE, LENGTH, OWN, ALPHA, MOMENTUM, LOW, HIGH, REST, E = range(11)


@njit(error_model="numpy")
def turning(r, p):
    """Return omega = H / J."""
    n = r.size
    s = 0.0
    for i in range(n):
        s += r[i]
    x = (p[M] * s + p[BOTTLE] * 0.5 * p[LENGTH]) / p[TOTAL]
    s = 0.0
    for i in range(n):
        s += (r[i] - x) ** 2
    return p[MOMENTUM] / (p[M] * s + p[BOTTLE] * (p[OWN] + (0.5 * p[LENGTH] - x) ** 2))


@njit(error_model="numpy")
def carried(base, cap, dragging, p):
    """Return place of the centre of the tube with ``base`` and ``cap`` slices in it, and its acceleration by drag."""
    mass = p[BOTTLE] + p[M] * (base + cap)
    centre = (p[BOTTLE] * 0.5 * p[LENGTH] + p[M] * (base * p[HIGH] + cap * p[LOW])) / mass
    return centre, p[ALPHA] * dragging / mass


@njit(error_model="numpy")
def presses(r, v, base, cap, p):
    """Return the accelerations, in the bottle, of slices at base and cap that were let go now."""
    s = 0.0
    for i in range(v.size):
        s += v[i]
    centre, pulled = carried(base, cap, s, p)
    q = turning(r, p) ** 2
    return q * (p[HIGH] - centre) - pulled, q * (p[LOW] - centre) - pulled


@njit(error_model="numpy")
def rates(r, v, rest, base, cap, p, rd, vd):
    """Write r' and v'; return theta'."""
    s = 0.0
    for i in range(v.size):
        if rest[i] == 0:
            s += v[i]
    centre, pulled = carried(base, cap, s, p)
    omega = turning(r, p)
    q, d = omega * omega, p[ALPHA] / p[M]
    for i in range(v.size):
        if rest[i] == 0:
            rd[i] = v[i]
            vd[i] = q * (r[i] - centre) - d * v[i] - pulled
        else:
            rd[i] = 0.0
            vd[i] = 0.0
    return omega


@njit(error_model="numpy")
def step(h, theta, r, v, rest, base, cap, p, kt, kr, kv, r1, v1, a, error):
    """Take a step h; the first stage is given in kt, kr, kv. Return theta and the error over what a step may err."""
    n = r.size
    theta1 = theta
    for j in range(1, 7):
        theta1 = theta
        for l in range(j):
            theta1 += h * a[j, l] * kt[l]
        for i in range(n):
            x = y = 0.0
            for l in range(j):
                x += a[j, l] * kr[l, i]
                y += a[j, l] * kv[l, i]
            r1[i] = r[i] + h * x
            v1[i] = v[i] + h * y
        kt[j] = rates(r1, v1, rest, base, cap, p, kr[j], kv[j])
    z = 0.0
    for l in range(7):
        z += error[l] * kt[l]
    worst = abs(h * z)
    wide, fast = p[LENGTH], abs(kt[0]) * p[LENGTH]
    for i in range(n):
        x = y = 0.0
        for l in range(7):
            x += error[l] * kr[l, i]
            y += error[l] * kv[l, i]
        worst = max(worst, abs(h * x) / wide, abs(h * y) / fast)
    return theta1, worst


@njit(error_model="numpy")
def weights(x, b):
    """Write the weights of the seven stages at x of the step, in [0, 1]."""
    y = x * x
    b[0] = -1.0530884977290216 * x * (x - 1.3299890189751412) * (y - 1.4364028541716351 * x + 0.7139816917074209)
    b[1] = 0.1017 * y * (y - 2.1966568338249754 * x + 1.2949852507374631)
    b[2] = 2.490627285651252793 * y * (y - 2.38535645472061657 * x + 1.57803468208092486)
    b[3] = -16.54810288924490272 * (x - 1.21712927295533244) * (x - 0.61620406037800089) * y
    b[4] = 47.37952196281928122 * (x - 1.203071208372362603) * (x - 0.658047292653547382) * y
    b[5] = -34.87065786149660974 * (x - 1.2) * (x - 0.666666666666666667) * y
    b[6] = 2.5 * (x - 1.0) * (x - 0.6) * y


@njit(error_model="numpy")
def outside(x, h, i, sign, end, r, kr, b):
    """Return how far slice i is outside an end at x of the step, by the dense output."""
    weights(x, b)
    s = 0.0
    for l in range(7):
        s += b[l] * kr[l, i]
    return sign * (r[i] + h * s - end)


@njit(error_model="numpy")
def passing(h, i, sign, end, r, v, r1, v1, kr, b, tol):
    """Return where in (0, 1] slice i first passes an end, or 2 if it does not."""
    g0, d0, g1, d1 = sign * (r[i] - end), sign * h * v[i], sign * (r1[i] - end), sign * h * v1[i]
    # turning points of the cubic with these ends and slopes: between them the dense output is searched
    c2 = 3.0 * (g1 - g0) - 2.0 * d0 - d1
    c3 = 2.0 * (g0 - g1) + d0 + d1
    lower, upper, found = 0.0, 1.0, g1 > tol
    disc = c2 * c2 - 3.0 * c3 * d0
    if disc > 0.0:
        root = -c2 - math.copysign(math.sqrt(disc), c2)
        xa = root / (3.0 * c3) if c3 != 0.0 else -1.0
        xb = d0 / root if root != 0.0 else -1.0
        for x in (min(xa, xb), max(xa, xb)):
            if 0.0 < x < upper:
                if 2.0 * c2 + 6.0 * c3 * x > 0.0:
                    lower = x
                elif outside(x, h, i, sign, end, r, kr, b) > tol:
                    upper = x
                    found = True
    if not found:
        return 2.0
    for _ in range(46):
        x = 0.5 * (lower + upper)
        if outside(x, h, i, sign, end, r, kr, b) > 0.0:
            upper = x
        else:
            lower = x
    return upper


@njit(error_model="numpy")
def impulse(r, v, p, tol):
    """Return P, the sum of the impulses on the tube, by bracketed Newton steps: P grows, the forces on it shrink."""
    ratio = p[M] / p[BOTTLE]
    lower, upper, total = -1e300, 1e300, 0.0
    for _ in range(200):
        active, push = 0, 0.0
        for i in range(r.size):
            sign = 1.0 if r[i] >= p[HIGH] - tol else (-1.0 if r[i] <= p[LOW] + tol else 0.0)
            if sign != 0.0 and sign * (1.0 + p[E]) * v[i] - sign * total / p[BOTTLE] > 0.0:
                active += 1
                push += p[M] * (1.0 + p[E]) * v[i]
        gap = total * (1.0 + active * ratio) - push
        if gap > 0.0:
            upper = total
        else:
            lower = total
        following = push / (1.0 + active * ratio)
        if following == total:
            break
        if not lower <= following <= upper:
            following = 0.5 * (lower + upper)
        total = following
    return total


@njit(error_model="numpy")
def collide(t, r, v, p, tol, impacts, count):
    """Change the speeds by an impact of all that stands at an end; return the table of impacts and its length."""
    n = r.size
    for i in range(n):
        if r[i] >= p[HIGH] - tol:
            r[i] = p[HIGH]
        elif r[i] <= p[LOW] + tol:
            r[i] = p[LOW]
    for again in range(100):
        striking = False
        for i in range(n):
            striking = striking or (r[i] == p[HIGH] and v[i] > 0.0) or (r[i] == p[LOW] and v[i] < 0.0)
        if not striking:
            break
        tube = impulse(r, v, p, tol) / p[BOTTLE]
        for i in range(n):
            before, after = v[i], v[i] - tube
            end = 1 if r[i] == p[HIGH] else (-1 if r[i] == p[LOW] else 0)
            if end != 0 and end * (1.0 + p[E]) * before - end * tube > 0.0:
                after = -p[E] * before
                if end * before > 0.0:
                    if count == impacts.shape[0]:
                        longer = np.zeros((2 * count, 5))
                        for row in range(count):
                            for column in range(5):
                                longer[row, column] = impacts[row, column]
                        impacts = longer
                    impacts[count, 0] = t
                    impacts[count, 1] = i
                    impacts[count, 2] = end
                    impacts[count, 3] = abs(before)
                    impacts[count, 4] = abs(after)
                    count += 1
            v[i] = after
    # the slow ones stay on their end; they and the tube keep their common momentum
    held, s = 0, 0.0
    for i in range(n):
        if (r[i] == p[HIGH] or r[i] == p[LOW]) and abs(v[i]) < p[REST]:
            held += 1
            s += p[M] * v[i]
    shift = s / (p[BOTTLE] + p[M] * held)
    for i in range(n):
        if (r[i] == p[HIGH] or r[i] == p[LOW]) and abs(v[i]) < p[REST]:
            v[i] = 0.0
        else:
            v[i] -= shift
    return impacts, count


@njit(error_model="numpy")
def contacts(r, v, rest, p, who):
    """Find which slices rest on their ends; return the numbers on base and cap.

    ``who``: -1 and -2 let base and cap go, whatever rounding makes of a force that vanishes; -9 holds.
    """
    n = r.size
    on_base = on_cap = 0
    for i in range(n):
        if v[i] == 0.0 and r[i] == p[HIGH]:
            on_base += 1
        elif v[i] == 0.0 and r[i] == p[LOW]:
            on_cap += 1
    base = cap = 0
    for choice in range(4):
        base = on_base if choice == 0 or choice == 1 else 0
        cap = on_cap if choice == 0 or choice == 2 else 0
        if (who == -1 and base > 0) or (who == -2 and cap > 0):
            continue
        at_base, at_cap = presses(r, v, base, cap, p)
        fits_base = on_base == 0 or (base > 0) == (at_base >= 0.0) or (who == -1 and base == 0)
        fits_cap = on_cap == 0 or (cap > 0) == (at_cap <= 0.0) or (who == -2 and cap == 0)
        if (fits_base and fits_cap) or who == -9:
            break
    for i in range(n):
        rest[i] = 0
        if v[i] == 0.0 and r[i] == p[HIGH] and base > 0:
            rest[i] = 1
        elif v[i] == 0.0 and r[i] == p[LOW] and cap > 0:
            rest[i] = -1
    return base, cap


@njit(error_model="numpy")
def first_event(h, r, v, r1, v1, rest, base, cap, press0, press1, kr, p, b, tol):
    """Return the earliest event's share of the step (2 if none) and its slice (-1: base lets go, -2: cap)."""
    earliest, who = 2.0, -3
    for i in range(r.size):
        if rest[i] == 0:
            if r1[i] > p[HIGH] + tol or (v[i] > 0.0 and v1[i] < 0.0):
                x = passing(h, i, 1.0, p[HIGH], r, v, r1, v1, kr, b, tol)
                if x < earliest:
                    earliest, who = x, i
            if r1[i] < p[LOW] - tol or (v[i] < 0.0 and v1[i] > 0.0):
                x = passing(h, i, -1.0, p[LOW], r, v, r1, v1, kr, b, tol)
                if x < earliest:
                    earliest, who = x, i
    if base > 0 and press1[0] < 0.0:
        x = press0[0] / (press0[0] - press1[0]) if press0[0] > 0.0 else 0.0
        if x < earliest:
            earliest, who = x, -1
    if cap > 0 and press1[1] > 0.0:
        x = press0[1] / (press0[1] - press1[1]) if press0[1] < 0.0 else 0.0
        if x < earliest:
            earliest, who = x, -2
    return earliest, who


@njit(error_model="numpy")
def fly(times, start, rtol, theta0, p, a, error):
    n, points = start.size, times.size
    theta_out, omega_out = np.zeros(points), np.zeros(points)
    r_out, v_out = np.zeros((points, n)), np.zeros((points, n))
    impacts, count = np.zeros((64, 5)), 0
    work, kr, kv, kt = np.zeros((5, n)), np.zeros((7, n)), np.zeros((7, n)), np.zeros(7)
    r, v, r1, v1, place = work[0], work[1], work[2], work[3], work[4]
    rest = np.zeros(n, dtype=np.int64)
    b, press0, press1 = np.zeros(7), np.zeros(2), np.zeros(2)
    tol = 1e-14 * p[LENGTH]
    t, theta = 0.0, theta0
    for i in range(n):
        r[i] = start[i]
        if r[i] >= p[HIGH] - tol:
            r[i] = p[HIGH]
        elif r[i] <= p[LOW] + tol:
            r[i] = p[LOW]
    base, cap = contacts(r, v, rest, p, 0)
    kt[0] = rates(r, v, rest, base, cap, p, kr[0], kv[0])
    press0[0], press0[1] = presses(r, v, base, cap, p)
    final = times[points - 1]
    proposed = 0.01 / abs(kt[0])
    k = stuck = 0
    while k < points and times[k] <= 0.0:
        theta_out[k], omega_out[k] = theta, kt[0]
        for i in range(n):
            r_out[k, i] = r[i]
        k += 1
    while k < points:
        h = min(proposed, final - t, WIDEST / abs(kt[0]))
        theta1, worst = step(h, theta, r, v, rest, base, cap, p, kt, kr, kv, r1, v1, a, error)
        factor = GROW if worst == 0.0 else min(GROW, max(SHRINK, SAFETY * (rtol / worst) ** 0.2))
        if not worst <= rtol and h > 1e-13 * final:
            proposed = h * (factor if factor < 1.0 else SHRINK)
            continue
        proposed = h * factor if h == proposed or factor < 1.0 else proposed
        small = 1e-15 * h + 3e-16 * final
        event, who = False, 0
        for trial in range(60):
            press1[0], press1[1] = presses(r1, v1, base, cap, p)
            x, who = first_event(h, r, v, r1, v1, rest, base, cap, press0, press1, kr, p, b, tol)
            if who < 0 and stuck > n + 9:
                x = 2.0  # rounding: a force about 0 lets go and catches at once; it holds for a step
            if x > 1.0:
                who = 0
                for i in range(n):
                    if rest[i] == 0:
                        out = (r1[i] >= p[HIGH] - tol and v1[i] > 0.0) or (r1[i] <= p[LOW] + tol and v1[i] < 0.0)
                        event = event or out
                break
            if who < 0 and (h - x * h <= 100.0 * small or trial > 40):
                event = True
                break
            if x * h <= small or trial == 59:
                event = True
                h = 0.0
                theta1 = theta
                for i in range(n):
                    r1[i] = r[i]
                    v1[i] = v[i]
                if who >= 0 and v[who] != 0.0:
                    r1[who] = p[HIGH] if v[who] > 0.0 else p[LOW]
                break
            h *= x
            theta1, worst = step(h, theta, r, v, rest, base, cap, p, kt, kr, kv, r1, v1, a, error)
        arrived = final if h == final - t else t + h
        while k < points and times[k] <= arrived:
            x = (times[k] - t) / h if h > 0.0 else 0.0
            weights(x, b)
            z = 0.0
            for l in range(7):
                z += b[l] * kt[l]
            theta_out[k] = theta + h * z
            for i in range(n):
                y = z = 0.0
                for l in range(7):
                    y += b[l] * kr[l, i]
                    z += b[l] * kv[l, i]
                place[i] = min(max(r[i] + h * y, p[LOW]), p[HIGH])
                r_out[k, i] = place[i]
                v_out[k, i] = v[i] + h * z
            omega_out[k] = turning(place, p)
            k += 1
        t, theta = arrived, theta1
        for i in range(n):
            r[i] = r1[i]
            v[i] = v1[i]
        if event:
            stuck = stuck + 1 if h == 0.0 else 0
            impacts, count = collide(t, r, v, p, tol, impacts, count)
            base, cap = contacts(r, v, rest, p, who if stuck <= n + 9 else -9)
            kt[0] = rates(r, v, rest, base, cap, p, kr[0], kv[0])
            press0[0], press0[1] = presses(r, v, base, cap, p)
        else:
            kt[0] = kt[6]
            for i in range(n):
                kr[0, i] = kr[6, i]
                kv[0, i] = kv[6, i]
            press0[0], press0[1] = press1[0], press1[1]
            stuck = 0
    return theta_out, omega_out, r_out, v_out, impacts, count


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    times = np.array(ask.times, dtype=float)
    start = np.array(ask.start, dtype=float)
    p = np.zeros(11)
    p[M], p[TOTAL], p[BOTTLE], p[LENGTH] = throw.slice_mass, throw.total_mass, bottle.mass, bottle.length
    p[OWN] = bottle.radius**2 / 2 + bottle.length**2 / 12
    p[ALPHA] = throw.drag
    p[LOW], p[HIGH], p[E] = throw.r_min, throw.r_max, throw.restitution
    p[REST] = 8e-5 * abs(throw.omega0) * bottle.length
    p[MOMENTUM] = 1.0
    p[MOMENTUM] = throw.omega0 / turning(start, p)
    if throw.frozen or throw.omega0 == 0.0:
        theta, omega = throw.theta0 + throw.omega0 * times, np.full(times.size, throw.omega0)
        r, v = np.tile(start, (times.size, 1)), np.zeros((times.size, start.size))
        impacts, count = np.zeros((0, 5)), 0
    else:
        rtol = max(float(ask.effort), FINEST)
        theta, omega, r, v, impacts, count = fly(times, start, rtol, throw.theta0, p, A, ERROR)
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


solve.refined_by = "rtol"
solve.timeout = 300.0
