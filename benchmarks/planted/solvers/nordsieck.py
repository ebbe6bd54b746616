"""Eq. 8 (Newtonian rebound without recoil) by an almost Runge-Kutta method of order 4.

A general linear method that passes a Nordsieck vector of three values (y, h y', about h^2 y'') from step to step.
All steps have the same length. Positions and angle between the ends of a step are the quintic through place, speed and
acceleration there: it answers at the times asked and locates impacts and releases, after each of which the method
starts anew.
"""

import math

import numpy as np

GRID = np.linspace(0.0, 1.0, 9)[1:]
POWERS = GRID[:, None] ** np.arange(6)
SLOPES = np.zeros_like(POWERS)
SLOPES[:, 1:] = POWERS[:, :-1] * np.arange(1, 6)


class Water:
    """Slices in the bottle: y holds r (N), v (N) and theta; side is 1 on the base, -1 on the cap, 0 in flight."""

    def __init__(self, throw, start):
        bottle = throw.bottle
        self.n = len(start)
        self.m = throw.slice_mass
        self.share = throw.slice_mass / throw.total_mass
        self.bottle_mass = bottle.mass
        self.half = bottle.length / 2
        self.bottle_part = bottle.mass * self.half / throw.total_mass
        self.own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.rub = throw.drag / throw.slice_mass
        self.gravity = throw.gravity
        self.restitution = throw.restitution
        self.low, self.high = throw.r_min, throw.r_max
        self.near = 1e-11 * bottle.length
        self.rest_speed = max(1e-5 * abs(throw.omega0) * bottle.length, 1e-12)
        self.side = np.zeros(self.n, dtype=int)
        self.held = self.side != 0
        self.any_held = False
        self.ones = np.ones(self.n)
        self.momentum = self.inertia(start) * throw.omega0

    def centre(self, r):
        """Distance of the centre of mass from the cap, for r of shape (..., N)."""
        return self.share * (r @ self.ones) + self.bottle_part

    def inertia(self, r):
        """Moment of inertia about the centre of mass."""
        c = self.centre(r)
        x = r - c[..., None]
        return self.own + self.m * (x * x).sum(axis=-1) + self.bottle_mass * (self.half - c) ** 2

    def field(self, r, v, theta):
        """Centre of mass, omega, and the acceleration that all slices share, for r and v of shape (..., N)."""
        c = self.share * (r @ self.ones) + self.bottle_part
        x = r - c[..., None]
        off = self.half - c
        omega = self.momentum / (self.own + self.m * ((x * x) @ self.ones) + self.bottle_mass * off * off)
        drift = self.share * (v @ self.ones)
        return c, omega, self.rub * drift + self.gravity * np.cos(theta)

    def rate(self, y):
        """y' = (v, a, omega)."""
        n = self.n
        r, v = y[:n], y[n : 2 * n]
        c, omega, common = self.field(r, v, y[2 * n])
        a = omega * omega * (r - c) - self.rub * v + common
        if self.any_held:
            a[self.held] = 0.0
        out = np.empty_like(y)
        out[:n] = v
        out[n : 2 * n] = a
        out[2 * n] = omega
        return out

    def spin_up(self, y, omega):
        """omega' from J omega = const, J' = 2 m sum (r - r_CM) v."""
        n = self.n
        r, v = y[:n], y[n : 2 * n]
        c = self.share * (r @ self.ones) + self.bottle_part
        return -2.0 * self.m * ((r - c) @ v) * omega * omega / self.momentum

    def push(self, end, r, v, theta):
        """Acceleration that a slice at rest on the end would have, for r and v of shape (..., N)."""
        c, omega, common = self.field(r, v, theta)
        return omega * omega * (end - c) + common

    def hold(self, side):
        self.side = side
        self.held = side != 0
        self.any_held = bool(self.held.any())


def quintic(y0, f0, w0, y1, f1, w1, h, n):
    """Coefficients in s = (t - t_0)/h, (6, N + 1), of the places and the angle over a step."""
    c0, d = np.append(y0[:n], y0[2 * n]), np.append(y1[:n], y1[2 * n])
    c1, e = h * np.append(f0[:n], f0[2 * n]), h * np.append(f1[:n], f1[2 * n])
    c2, g = h * h / 2 * np.append(f0[n : 2 * n], w0), h * h * np.append(f1[n : 2 * n], w1)
    d, e, g = d - c0 - c1 - c2, e - c1 - 2 * c2, g - 2 * c2
    return np.array(
        [c0, c1, c2, 10 * d - 4 * e + g / 2, -15 * d + 7 * e - g, 6 * d - 3 * e + g / 2]
    )


def value(c, s):
    """Polynomial and slope at s, c from the lowest power."""
    p = q = 0.0
    for x in reversed(c):
        q = q * s + p
        p = p * s + x
    return p, q


def root(c, lo, hi):
    """Where the polynomial, negative at lo and positive at hi, passes 0: Newton's method inside a bracket."""
    s = 0.5 * (lo + hi)
    for _ in range(80):
        p, q = value(c, s)
        if p > 0.0:
            hi = s
        else:
            lo = s
        new = s - p / q if q > 0.0 else lo
        if not lo < new < hi:
            new = 0.5 * (lo + hi)
        if abs(new - s) < 1e-15 or hi - lo < 1e-15:
            return new
        s = new
    return s


def first_impact(water, coef):
    """Return s of the first passage of an end within the step; 2 if there is none."""
    n = water.n
    places = POWERS @ coef[:, :n]
    beyond = np.maximum(places - water.high, water.low - places) > water.near
    if water.any_held:
        beyond[:, water.held] = False
    best = 2.0
    rows = beyond.any(axis=1)
    if rows.any():
        k = int(rows.argmax())
        lo, best = (GRID[k - 1] if k else 0.0), float(GRID[k])
        for i in np.flatnonzero(beyond[k]):
            c, at_end = outward(water, coef[:, i], places[k, i] > water.half)
            if value(c, best)[0] < 0.0:
                continue
            if at_end and k == 0:
                c = c[2:] if c[1] == 0.0 else c[1:]
            best = min(best, root(c, lo, best))
    # slices that turn within the step may have passed the end between two samples
    start, stop = coef[1, :n], np.arange(1, 6) @ coef[1:, :n]
    turned = (start * stop < 0.0) & ~water.held
    for i in np.flatnonzero(turned) if turned.any() else ():
        c, at_end = outward(water, coef[:, i], start[i] > 0.0)
        if c[1] > 0.0 and not at_end:
            peak = root([-k * x for k, x in enumerate(c)][1:], 0.0, 1.0)
            if peak < best and value(c, peak)[0] > water.near:
                best = root(c, 0.0, peak)
    return best


def outward(water, column, at_base):
    """Polynomial of the distance beyond an end, and whether the slice begins on this end."""
    c = column.tolist()
    if at_base:
        c[0] -= water.high
    else:
        c = [-x for x in c]
        c[0] += water.low
    return c, c[0] == 0.0


def first_release(water, coef, h, before):
    """Return s and side of the first release of what rests within the step, at s < before; 2 and 0 if there is none."""
    n = water.n
    best, which = min(before, 2.0), 0
    for side, end in ((1, water.high), (-1, water.low)):
        if not (water.side == side).any():
            continue

        def pressed(powers, slopes):
            at = powers @ coef
            return side * water.push(end, at[..., :n], slopes @ coef[:, :n] / h, at[..., n])

        gone = pressed(POWERS, SLOPES) < 0.0
        if not gone.any():
            continue
        k = int(gone.argmax())
        lo, hi = (GRID[k - 1] if k else 0.0), GRID[k]
        for _ in range(48):
            s = 0.5 * (lo + hi)
            powers = s ** np.arange(6)
            slopes = np.append(0.0, powers[:-1] * np.arange(1, 6))
            if pressed(powers, slopes) < 0.0:
                hi = s
            else:
                lo = s
        if hi < best:
            best, which = float(hi), side
    return (best, which) if which else (2.0, 0)


def strike(water, y, t, impacts):
    """Rebound of every slice that has come to an end, and rest of the slow ones."""
    n = water.n
    r, v = y[:n], y[n : 2 * n]
    base = ~water.held & (r > water.high - water.near) & (v > 0.0)
    cap = ~water.held & (r < water.low + water.near) & (v < 0.0)
    r[base], r[cap] = water.high, water.low
    hit = base | cap
    for i in np.flatnonzero(hit):
        impacts.append((t, int(i), 1 if base[i] else -1, abs(v[i]), water.restitution * abs(v[i])))
    v[hit] *= -water.restitution
    slow = hit & (np.abs(v) < water.rest_speed)
    if slow.any():
        v[slow] = 0.0
        settle(water, y, slow & base, slow & cap)


def settle(water, y, base, cap):
    """Let those slices at an end rest that are pressed on it."""
    n = water.n
    side = water.side.copy()
    for chosen, sign, end in ((base, 1, water.high), (cap, -1, water.low)):
        if chosen.any() and sign * water.push(end, y[:n], y[n : 2 * n], y[2 * n]) >= 0.0:
            side[chosen] = sign
    water.hold(side)


def solve(ask):
    throw = ask.scenario
    times = np.asarray(ask.times, dtype=float)
    start = np.array(ask.start, dtype=float)
    water = Water(throw, start)
    n = water.n
    if throw.frozen or water.high - water.low <= 1e-9 * water.half:
        return answer(water, times, throw.theta0 + throw.omega0 * times, np.tile(start, (len(times), 1)), None, [])

    h = throw.duration / (ask.effort or 200)
    h /= (1.0 + (0.5 * water.rub * h) ** 4) ** 0.25  # strong drag needs short steps
    y = np.concatenate([start, np.zeros(n), [throw.theta0]])
    at_base, at_cap = start > water.high - water.near, start < water.low + water.near
    y[:n][at_base], y[:n][at_cap] = water.high, water.low
    settle(water, y, at_base, at_cap)

    theta, places, speeds, impacts = np.empty(len(times)), np.empty((len(times), n)), np.empty((len(times), n)), []
    t, done, fresh = 0.0, 0, True
    while done < len(times):
        if fresh:
            f = water.rate(y)
            w = water.spin_up(y, f[2 * n])
            z = h * (water.rate(y + h * f) - f)
            fresh = False
        f1 = water.rate(y + h * f + z / 2)
        f2 = water.rate(y + h / 16 * (7 * f + f1) + z / 16)
        f3 = water.rate(y + h * (2 * f2 - 0.25 * (3 * f + f1)) - z / 4)
        new = y + h / 6 * (f + 4 * f2 + f3)
        f4 = water.rate(new)
        w4 = water.spin_up(new, f4[2 * n])
        coef = quintic(y, f, w, new, f4, w4, h, n)

        s = first_impact(water, coef)
        freed = 0
        if water.any_held:
            moment, freed = first_release(water, coef, h, s)
            s = moment if freed else s
        stop = t + h * min(s, 1.0)
        upto = int(np.searchsorted(times, stop, side="right"))
        if upto > done:
            x = (times[done:upto] - t) / h
            powers = x[:, None] ** np.arange(6)
            at = powers @ coef
            places[done:upto], theta[done:upto] = at[:, :n], at[:, n]
            speeds[done:upto] = (powers[:, :5] * np.arange(1, 6)) @ coef[1:, :n] / h
            done = upto
        t = stop
        if s > 1.0:
            z = h * (2 * f4 - f - (f1 + 2 * f3) / 3)
            y, f, w = new, f4, w4
            continue
        powers = s ** np.arange(6)
        at = powers @ coef
        speed = (powers[:5] * np.arange(1, 6)) @ coef[1:, :n] / h
        y = np.concatenate([at[:n], speed, at[n:]])
        y[:n][water.held] = np.where(water.side > 0, water.high, water.low)[water.held]
        y[n : 2 * n][water.held] = 0.0
        if freed:
            water.hold(np.where(water.side == freed, 0, water.side))
        else:
            strike(water, y, t, impacts)
        fresh = True
    return answer(water, times, theta, places, speeds, impacts)


def answer(water, times, theta, places, speeds, impacts):
    inertia = water.inertia(places)
    return {
        "t": times,
        "theta": theta,
        "omega": water.momentum / inertia,
        "r": places,
        "v": np.zeros_like(places) if speeds is None else speeds,
        "r_cm": water.centre(places),
        "inertia": inertia,
        "impacts": impacts,
    }


solve.refined_by = "steps"
solve.order = 4
solve.equation = "eq8"
solve.name = "Eq. 8, almost Runge-Kutta of order 4"
