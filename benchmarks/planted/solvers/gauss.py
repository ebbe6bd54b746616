"""Eq. 8 by Gauss collocation with three stages, order 6, on an even grid of steps that impacts and releases split.

Inside, depths x are measured from the base in bottle lengths and times in 1 / |omega_0|; u = dx/dtau.
An output between two points of the grid is a step of its own from the point before it.
"""

import math

import numpy as np

Q = math.sqrt(15)
NODES = np.array([5 - Q, 5, 5 + Q]) / 10
STAGES = np.array(
    [
        [5 / 36, 2 / 9 - Q / 15, 5 / 36 - Q / 30],
        [5 / 36 + Q / 24, 2 / 9, 5 / 36 - Q / 24],
        [5 / 36 + Q / 30, 2 / 9 + Q / 15, 5 / 36],
    ]
)
WEIGHTS = np.array([5, 8, 5]) / 18
POWERS = np.linalg.inv(np.vander(NODES, increasing=True)) / np.array([[1], [2], [3]])


def gauss(f, y, h):
    """Return the state after h and the coefficients of the cubic in between."""
    k = np.tile(f(y), (3, 1))
    for _ in range(60):
        last, k = k, f(y + h * (STAGES @ k))
        if np.abs(k - last).max() < 1e-14:
            break
    return y + h * (WEIGHTS @ k), h * (POWERS @ k)


def solve(ask):
    s, b, n = ask.scenario, ask.scenario.bottle, ask.scenario.n_slices
    length, rate = b.length, abs(s.omega0)
    water, shell = s.slice_mass / s.total_mass, b.mass / s.total_mass
    own = shell * ((b.radius / length) ** 2 / 2 + 1 / 12)
    weight, rub = s.gravity / (length * rate**2), s.drag / (s.slice_mass * rate)
    reach = (1 - s.fill_fraction / n) / 2  # of a slice from the middle, either way
    slow, tiny = 1e-4 / (length * rate), 1e-7 / (length * rate**2)
    rest = np.zeros(n)  # 1: rests on the base, -1: on the cap

    def shape(x):
        centre = water * x.sum(axis=-1) + shell / 2
        about = x - centre[..., None]
        return about, own + water * (about**2).sum(axis=-1) + shell * (0.5 - centre) ** 2

    def law(y):
        x, u = y[..., 1 : n + 1], y[..., n + 1 :]
        about, inertia = shape(x)
        spin = math.copysign(start_inertia, s.omega0) / inertia
        slip = u - water * u.sum(axis=-1)[..., None]
        return spin, spin[..., None] ** 2 * about - weight * np.cos(y[..., :1]) - rub * slip

    def slope(y):
        spin, a = law(y)
        free = (rest == 0) & (not s.frozen)
        return np.concatenate((spin[..., None], y[..., n + 1 :] * free, a * free), axis=-1)

    def beyond(y, side):
        """How far beyond an end, and how fast towards it."""
        return side * (0.5 - y[1 : n + 1]) - reach, -side * y[n + 1 :]

    def push(y):
        return (-rest * law(y)[1])[rest != 0].min(initial=math.inf)

    def settle(y):
        """Stop what is slow at an end and pressed on it."""
        x, u = y[1 : n + 1], y[n + 1 :]
        side = np.where(beyond(y, 1)[0] > -4e-10, 1.0, np.where(beyond(y, -1)[0] > -4e-10, -1.0, 0.0))
        x[side != 0] = 0.5 - side[side != 0] * reach
        stays = (side != 0) & (np.abs(u) < slow) & (-side * law(y)[1] > -tiny)
        u[stays] = 0.0
        rest[:] = np.where(stays, side, 0.0)

    def impact(y, y1, cubic):
        """Return (fraction of the step, slice, side) of the first impact, or None."""
        found = []
        for side in (1.0, -1.0):
            (g0, w0), (g1, w1) = beyond(y, side), beyond(y1, side)
            for i in np.flatnonzero((rest == 0) & ((g1 > 0) | ((w0 > 0) & (w1 < 0)))):
                c1, c2, c3 = -side * cubic[:, 1 + i]
                touching = abs(g0[i]) < 1e-15
                roots = np.roots([c3, c2, c1] if touching else [c3, c2, c1, g0[i]])
                real = roots.real[np.abs(roots.imag) < 1e-10]
                rising = c1 + 2 * c2 * real + 3 * c3 * real**2 > 0
                found += [(c, i, side) for c in real[rising] if 0 < c <= 1 + 1e-9]
        return min(found, default=None)

    y = np.concatenate(([s.theta0], 1 - ask.start / length, np.zeros(n)))
    start_inertia = shape(y[1 : n + 1])[1]
    settle(y)
    t, times, rows = 0.0, ask.times * rate, []
    for grid in np.linspace(0.0, s.duration * rate, int(ask.effort) + 1)[1:]:
        while t < grid and len(rows) < len(times):
            h = full = grid - t
            y1, cubic = gauss(slope, y, h)
            hit = None if s.frozen else impact(y, y1, cubic)
            if hit:
                part, i, side = hit
                h *= part
                for _ in range(5):  # Newton
                    y1 = gauss(slope, y, h)[0]
                    gap, speed = (q[i] for q in beyond(y1, side))
                    if abs(gap) < 1e-14 or speed <= 0:
                        break
                    h = min(max(h - gap / speed, 0.0), full)
            release = push(y1) < -tiny
            if release:
                low = 0.0
                for _ in range(45):
                    half = (low + h) / 2
                    low, h = (half, h) if push(gauss(slope, y, half)[0]) > 0 else (low, half)
                y1 = gauss(slope, y, h)[0]
            while len(rows) < len(times) and times[len(rows)] <= t + h:
                rows.append(gauss(slope, y, times[len(rows)] - t)[0])
            t, y = t + h if h < full else grid, y1
            if release:
                rest[-rest * law(y)[1] < 10 * tiny] = 0.0
            elif hit:
                for end in (1.0, -1.0):
                    gap, speed = beyond(y, end)
                    y[n + 1 :][(gap > -4e-10) & (speed > 0)] *= -s.restitution
                settle(y)
    rows = np.array(rows)
    x, u = rows[:, 1 : n + 1], rows[:, n + 1 :]
    inertia = shape(x)[1]
    answer = {"t": ask.times, "theta": rows[:, 0], "omega": s.omega0 * start_inertia / inertia}
    answer |= {"r": length * (1 - x), "v": -length * rate * u}
    r_cm = length * (1 - water * x.sum(axis=1) - shell / 2)
    return answer | {"r_cm": r_cm, "inertia": inertia * s.total_mass * length**2}


solve.name = "Gauss collocation, eq. 8"
solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 6
