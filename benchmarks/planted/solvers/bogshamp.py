"""Free flight with recoil by the pair of Bogacki and Shampine of order 5(4), with quintic output between the steps.

A state is one row: theta, the places of the slices from the middle of the tube, their speeds in the tube.
"""

from fractions import Fraction

import numpy as np
from numba import njit


def _table(text):
    return [[float(Fraction(word)) for word in line.split()] for line in text.strip().splitlines()]


_ROWS = _table(
    """
    0
    1/6
    2/27 4/27
    183/1372 -162/343 1053/1372
    68/297 -4/11 42/143 1960/3861
    597/22528 81/352 63099/585728 58653/366080 4617/20480
    174197/959244 -30942/79937 8152137/19744439 666106/1039181 -29421/29068 482048/414219
    587/8064 0 4440339/15491840 24353/124800 387/44800 2152/5985 7267/94080
    """
)
_FOURTH = _table("2479/34992 0 123/416 612941/3411720 43/1440 2272/6561 79937/1113912 3293/556956")[0]
TABLE = np.zeros((9, 8))
for _k, _row in enumerate(_ROWS):
    TABLE[_k, : len(_row)] = _row
TABLE[8] = TABLE[7] - np.array(_FOURTH)


@njit
def spin(y, n, q):
    """Angular velocity, centre of mass and moment of inertia of a state."""
    m, bottle, own, momentum = q[0], q[1], q[2], q[3]
    c = 0.0
    for i in range(n):
        c += y[1 + i]
    c *= m / (m * n + bottle)
    inertia = own + bottle * c * c
    for i in range(n):
        inertia += m * (y[1 + i] - c) ** 2
    return momentum / inertia, c, inertia


@njit
def held_body(y, n, at, q):
    """Mass and centre of the tube with the slices that rest in it, and the speeds of the free ones added up."""
    mass, moment, flow = q[1], 0.0, 0.0
    for i in range(n):
        if at[i] == 0:
            flow += y[1 + n + i]
        else:
            mass += q[0]
            moment += q[0] * y[1 + i]
    return mass, moment / mass, flow


@njit
def slope(y, n, at, q, out):
    omega = spin(y, n, q)[0]
    mass, middle, flow = held_body(y, n, at, q)
    drag = q[4]
    out[0] = omega
    for i in range(n):
        if at[i] == 0:
            out[1 + i] = y[1 + n + i]
            out[1 + n + i] = omega**2 * (y[1 + i] - middle) - drag / q[0] * y[1 + n + i] - drag / mass * flow
        else:
            out[1 + i] = 0.0
            out[1 + n + i] = 0.0


@njit
def pressure(y, n, at, end, q):
    """Acceleration towards an end that the contact takes from a slice at rest there."""
    mass, middle, flow = held_body(y, n, at, q)
    return end * (spin(y, n, q)[0] ** 2 * (end * q[5] - middle) - q[4] / mass * flow)


@njit
def rk_step(h, y, n, at, q, table, k, out):
    """One step from y, whose slope is k[0], into out, whose slope is then k[7]; returns the largest scaled error."""
    for s in range(1, 8):
        for j in range(2 * n + 1):
            total = 0.0
            for i in range(s):
                total += table[s, i] * k[i, j]
            out[j] = y[j] + h * total
        slope(out, n, at, q, k[s])
    worst = 0.0
    for j in range(2 * n + 1):
        total = 0.0
        for i in range(8):
            total += table[8, i] * k[i, j]
        scale = 1.0 if j == 0 else (q[7] if j <= n else q[8] * q[7])
        worst = max(worst, abs(h * total) / scale)
    return worst


@njit
def quintic(x, h, y0, d0, a0, y1, d1, a1):
    """Value and slope at x in [0, 1] of the polynomial with values, slopes and second derivatives at both ends."""
    c1, c2 = h * d0, h * h * a0 / 2
    p = y1 - y0 - c1 - c2
    s = h * d1 - c1 - 2 * c2
    b = h * h * a1 - 2 * c2
    c3, c4, c5 = 10 * p - 4 * s + b / 2, -15 * p + 7 * s - b, 6 * p - 3 * s + b / 2
    value = y0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
    return value, (c1 + x * (2 * c2 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5)))) / h


@njit
def spin_change(y, n, q):
    """d omega / dt"""
    omega, c, inertia = spin(y, n, q)
    change = 0.0
    for i in range(n):
        change += 2 * q[0] * (y[1 + i] - c) * y[1 + n + i]
    return -omega * change / inertia


@njit
def output(x, h, y, new, n, k, q):
    """theta, omega, centre and inertia inside a step."""
    between = np.zeros(2 * n + 1)
    theta = quintic(x, h, y[0], k[0, 0], spin_change(y, n, q), new[0], k[7, 0], spin_change(new, n, q))[0]
    for i in range(n):
        j = 1 + n + i
        between[1 + i] = quintic(x, h, y[1 + i], y[j], k[0, j], new[1 + i], new[j], k[7, j])[0]
    omega, c, inertia = spin(between, n, q)
    return theta, omega, c + q[6] / 2, inertia


@njit
def crossing(i, end, h, y, new, n, k, q):
    """First time in the step at which slice i passes an end, by bisection of its polynomial; -1 if it does not."""
    j = 1 + n + i
    starts_there = y[1 + i] == end * q[5]
    low, high = 0.0, 1.0
    if end * new[1 + i] <= q[5]:
        # it may have turned beyond the end: seek the top
        for _ in range(50):
            x = (low + high) / 2
            value, speed = quintic(x, h, y[1 + i], y[j], k[0, j], new[1 + i], new[j], k[7, j])
            if end * value > q[5] * (1 + 1e-14):
                high = x
                break
            if end * speed > 0:
                low = x
            else:
                high = x
        if not end * value > q[5] * (1 + 1e-14):
            return -1.0
        low = 0.0
    elif starts_there:
        low = high
        for _ in range(45):
            low /= 2
            value, speed = quintic(low, h, y[1 + i], y[j], k[0, j], new[1 + i], new[j], k[7, j])
            if end * value < q[5]:
                break
            high = low
    for _ in range(60):
        x = (low + high) / 2
        value, speed = quintic(x, h, y[1 + i], y[j], k[0, j], new[1 + i], new[j], k[7, j])
        if end * value > q[5]:
            high = x
        else:
            low = x
    return high * h


@njit
def first_hit(h, y, new, n, at, k, q, skip):
    """Time, slice and end of the first hit in a step by its polynomials; slice -1 if there is none."""
    best, who, where = h, -1, 0
    for i in range(n):
        if at[i] != 0 or i == skip:
            continue
        for end in (1, -1):
            over = end * new[1 + i] > q[5] * (1 + 1e-14) and end * new[1 + n + i] > 0
            turned = end * y[1 + n + i] > 0 and end * new[1 + n + i] < 0
            if over or turned:
                tau = crossing(i, end, h, y, new, n, k, q)
                if tau >= 0 and (who < 0 or tau < best):
                    best, who, where = tau, i, end
    return best, who, where


@njit
def go_to_hit(h, y, new, n, at, q, table, k, t_guess, who, end):
    """Steps of other lengths until slice ``who`` is on the end at the end of the step."""
    tau = t_guess
    for _ in range(6):
        rk_step(tau, y, n, at, q, table, k, new)
        gap, speed = end * new[1 + who] - q[5], end * new[1 + n + who]
        if abs(gap) < 1e-16 * q[6] or speed <= 0:
            break
        shift = gap / speed
        if abs(shift) < 1e-15 * tau:
            break
        tau = max(tau - shift, tau / 2)
    return tau


@njit
def go_to_release(h, y, new, n, at, q, table, k, end):
    """Length of the step at whose end the contact force has just changed its sign."""
    low, high = 0.0, h
    f_low, f_high = pressure(y, n, at, end, q), pressure(new, n, at, end, q)
    if f_low <= 0:
        return 0.0
    for count in range(80):
        tau = high - f_high * (high - low) / (f_high - f_low) if count % 3 else (low + high) / 2
        if not low < tau < high:
            break
        rk_step(tau, y, n, at, q, table, k, new)
        f = pressure(new, n, at, end, q)
        if f > 0:
            low, f_low = tau, f
        else:
            high, f_high = tau, f
        if high - low < 1e-15 * high:
            break
    rk_step(high, y, n, at, q, table, k, new)
    return high


@njit
def contacts(y, n, at, q):
    """Which slices without speed at an end rest there: the one choice whose forces all press."""
    base = np.zeros(n, np.bool_)
    cap = np.zeros(n, np.bool_)
    for i in range(n):
        base[i] = y[1 + i] == q[5] and y[1 + n + i] == 0
        cap[i] = y[1 + i] == -q[5] and y[1 + n + i] == 0
    any_base, any_cap = base.any(), cap.any()
    for choice in range(4):
        on_base, on_cap = choice in (0, 1), choice in (0, 2)
        if (on_base and not any_base) or (on_cap and not any_cap):
            continue
        for i in range(n):
            at[i] = 1 if base[i] and on_base else (-1 if cap[i] and on_cap else 0)
        good = True
        if any_base:
            good = (pressure(y, n, at, 1, q) > 0) == on_base
        if any_cap and good:
            good = (pressure(y, n, at, -1, q) > 0) == on_cap
        if good:
            break


@njit
def collide(t, y, n, at, hit, q, impacts):
    """Newton's law with recoil for all slices at an end, at once."""
    m, bottle, e = q[0], q[1], q[9]
    wish = np.zeros(n)
    side = np.zeros(n, np.int64)
    for i in range(n):
        side[i] = hit[i] if hit[i] != 0 else at[i]
        wish[i] = (1 + e) * y[1 + n + i]
    # the tube gains kick = P / M_b, with kick M_b = m sum s max(0, s (wish - kick)): piecewise linear, increasing
    low, high = min(0.0, wish.min()), max(0.0, wish.max())
    kick = 0.0
    for _ in range(200):
        kick = (low + high) / 2
        weight, push = bottle, 0.0
        for i in range(n):
            if side[i] * (wish[i] - kick) > 0:
                weight += m
                push += m * wish[i]
        guess = push / weight
        excess = kick * weight - push
        if excess > 0:
            high = kick
        else:
            low = kick
        if low <= guess <= high:
            # the same slices are pushed at the guess: it is the solution
            same = True
            for i in range(n):
                if (side[i] * (wish[i] - kick) > 0) != (side[i] * (wish[i] - guess) > 0):
                    same = False
            if same:
                kick = guess
                break
        if high - low <= 1e-16 * (abs(high) + abs(low)):
            break
    for i in range(n):
        before = y[1 + n + i]
        after = before - kick
        if side[i] != 0:
            after -= side[i] * max(0.0, side[i] * (wish[i] - kick))
            if abs(after) < q[10]:
                after = 0.0
        y[1 + n + i] = after
        if hit[i] != 0 and abs(before) > q[8] * q[6] / 100:
            impacts.append((t, i, hit[i], abs(before), abs(after)))


@njit
def fly(times, duration, rtol, y, n, q, table, out):
    """Fill the rows theta, omega, centre, inertia of out; returns the impacts."""
    impacts = [(0.0, 0, 0, 0.0, 0.0) for _ in range(0)]
    at = np.zeros(n, np.int64)
    hit = np.zeros(n, np.int64)
    new = y.copy()
    k = np.zeros((8, 2 * n + 1))
    for i in range(n):
        for end in (1, -1):
            if end * y[1 + i] > q[5] - 1e-12 * q[6]:
                y[1 + i] = end * q[5]
    contacts(y, n, at, q)
    slope(y, n, at, q, k[0])
    t, row, h_next = 0.0, 0, 0.01 / q[8]
    last = times[-1]
    stiff = q[4] * (1 / q[0] + n / q[1]) + 1e-300
    while row < times.size and times[row] <= 0:
        omega, c, inertia = spin(y, n, q)
        out[0, row], out[1, row], out[2, row], out[3, row] = y[0], omega, c + q[6] / 2, inertia
        row += 1
    while row < times.size:
        # slices that another impact has sent out of the end on which they are
        hit[:] = 0
        for i in range(n):
            if at[i] == 0 and abs(y[1 + i]) >= q[5] and y[1 + i] * y[1 + n + i] > 0:
                hit[i] = 1 if y[1 + i] > 0 else -1
        if hit.any():
            collide(t, y, n, at, hit, q, impacts)
            contacts(y, n, at, q)
            slope(y, n, at, q, k[0])
            continue
        h = min(h_next, 0.6 / abs(k[0, 0]), 2 / stiff)
        final = t + h >= last - 1e-14 * duration
        if final:
            h = last - t
        error = rk_step(h, y, n, at, q, table, k, new) / rtol
        factor = 5.0 if error < 1e-4 else max(0.2, min(5.0, 0.9 * error**-0.2))
        h_next = h * factor
        if error > 1 and h > 1e-13 * duration:
            continue
        who, who_end, freed = -1, 0, 0
        for _ in range(n + 6):
            tau, i, end = first_hit(h, y, new, n, at, k, q, who)
            if i >= 0:
                who, who_end, freed = i, end, 0
                h = go_to_hit(h, y, new, n, at, q, table, k, tau, i, end)
                continue
            side = 0
            for i in range(n):
                if at[i] != 0 and at[i] != freed and side == 0 and pressure(new, n, at, at[i], q) < 0:
                    side = at[i]
            if side == 0:
                break
            who, who_end, freed = -1, 0, side
            h = go_to_release(h, y, new, n, at, q, table, k, side)
        event = who >= 0 or freed != 0
        ends = last if final and not event else t + h
        while row < times.size and times[row] <= ends:
            x = (times[row] - t) / h if h > 0 else 1.0
            theta, omega, c, inertia = output(x, h, y, new, n, k, q)
            out[0, row], out[1, row], out[2, row], out[3, row] = theta, omega, c, inertia
            row += 1
        if event and h_next > h:
            h_next = max(h_next, 1e-6 / q[8])
        t = ends
        y[:] = new
        k[0] = k[7]
        if event:
            hit[:] = 0
            for i in range(n):
                side = 1 if y[1 + i] > 0 else -1
                if at[i] == 0 and (i == who or (side * y[1 + i] > q[5] * (1 - 1e-14) and side * y[1 + n + i] > 0)):
                    hit[i] = side
                    y[1 + i] = side * q[5]
            if hit.any():
                collide(t, y, n, at, hit, q, impacts)
            contacts(y, n, at, q)
            slope(y, n, at, q, k[0])
    return impacts


class FreeFlight:
    name = "5(4) with recoil"
    equation = "free-flight"
    refined_by = "rtol"

    def solve(self, ask):
        throw, tube = ask.scenario, ask.scenario.bottle
        n = len(ask.start)
        times = np.array(ask.times, dtype=float)
        out = np.zeros((4, len(times)))
        y = np.concatenate(([throw.theta0], np.array(ask.start) - tube.length / 2, np.zeros(n)))
        m = throw.water_mass / n
        own = tube.mass * (tube.radius**2 / 2 + tube.length**2 / 12)
        reach = (tube.length - throw.water_mass / tube.capacity * tube.length / n) / 2
        q = np.array(
            [
                m,
                tube.mass,
                own,
                1.0,
                throw.drag,
                reach,
                tube.length,
                tube.length,
                abs(throw.omega0),
                throw.restitution,
                2e-5 * abs(throw.omega0) * tube.length,
            ]
        )
        q[3] = throw.omega0 * spin(y, n, q)[2]
        impacts = []
        if throw.frozen or reach < 1e-12 * tube.length:
            omega, centre, inertia = spin(y, n, q)
            out[0], out[1], out[2], out[3] = throw.theta0 + omega * times, omega, centre + tube.length / 2, inertia
        else:
            impacts = fly(times, throw.duration, max(ask.effort, 1e-15), y, n, q, TABLE, out)
        columns = list(zip(*impacts)) or [()] * 5
        return {
            "t": times,
            "theta": out[0],
            "omega": out[1],
            "r_cm": out[2],
            "inertia": out[3],
            "impacts": dict(zip(("time", "slice", "end", "speed_before", "speed_after"), map(np.array, columns))),
        }


solve = FreeFlight()
