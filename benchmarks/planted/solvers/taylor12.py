"""Eq. 8 by power series in time: every step is a polynomial of degree DEGREE, and all events are roots of polynomials.

The coefficients follow from each other by the rules for products, quotients, sine and cosine of power series. The
steps are as long as the last two terms allow for the relative tolerance asked.
"""

import numpy as np
from scipy.optimize import brentq

DEGREE = 12
SAMPLES = np.linspace(0.0, 1.0, 17)[1:]
NEAR = 1e-11  # of the length of the bottle: this near to an end is on the end
CALM = 1e-5  # m/s: slower slices that are pressed to an end stay there
LONGEST = 0.05  # s


def horner(series, tau):
    """Return the sum of series[k] tau^k."""
    total = series[-1]
    for term in series[-2::-1]:
        total = total * tau + term
    return total


class Series:
    """The motion from one instant on, as power series."""

    def __init__(self, body, theta, r, v, side):
        n = len(r)
        self.theta = np.zeros(DEGREE + 1)
        self.r, self.v, self.a = np.zeros((DEGREE + 1, n)), np.zeros((DEGREE + 1, n)), np.zeros((DEGREE, n))
        self.theta[0], self.r[0], self.v[0] = theta, r, v
        if body.frozen:
            self.theta[1] = body.momentum / body.inertia(r)
            return
        free = side == 0
        x, d = np.zeros((DEGREE, n)), np.zeros(DEGREE)
        inertia, omega, square = np.zeros(DEGREE), np.zeros(DEGREE), np.zeros(DEGREE)
        sine, cosine = np.zeros(DEGREE), np.zeros(DEGREE)
        sine[0], cosine[0] = np.sin(theta), np.cos(theta)
        turning = np.zeros(DEGREE)
        for k in range(DEGREE):
            centre = body.share * self.r[k].sum() + (body.tube_part if k == 0 else 0.0)
            x[k] = self.r[k] - centre
            d[k] = (body.middle if k == 0 else 0.0) - centre
            inertia[k] = body.m * np.vdot(x[: k + 1], x[k::-1]) + body.tube_mass * (d[: k + 1] @ d[k::-1])
            if k == 0:
                inertia[0] += body.tube_inertia
                omega[0] = body.momentum / inertia[0]
            else:
                omega[k] = -(inertia[1 : k + 1] @ omega[k - 1 :: -1]) / inertia[0]
                sine[k] = turning[:k] @ cosine[k - 1 :: -1] / k
                cosine[k] = -(turning[:k] @ sine[k - 1 :: -1]) / k
            turning[k] = omega[k]
            self.theta[k + 1] = omega[k] / (k + 1)
            square[k] = omega[: k + 1] @ omega[k::-1]
            slip = self.v[k] - body.share * self.v[k].sum()
            self.a[k] = square[: k + 1] @ x[k::-1] + body.gravity * cosine[k] - body.rate * slip
            self.v[k + 1] = np.where(free, self.a[k] / (k + 1), 0.0)
            self.r[k + 1] = np.where(free, self.v[k] / (k + 1), 0.0)

    def reach(self, body, tolerance):
        """Return for how long the series may be trusted."""
        longest = LONGEST
        for k in (DEGREE - 1, DEGREE):
            size = max(np.abs(self.r[k]).max() / body.length, abs(self.theta[k]))
            if size > 0.0:
                longest = min(longest, 0.8 * (tolerance / size) ** (1.0 / k))
        return longest


class Body:
    """What does not change during the flight."""

    def __init__(self, throw):
        bottle = throw.bottle
        n = throw.n_slices
        self.m = throw.water_mass / n
        self.tube_mass = bottle.mass
        self.length = bottle.length
        self.middle = bottle.length / 2
        whole = throw.water_mass + bottle.mass
        self.share = self.m / whole
        self.tube_part = bottle.mass * self.middle / whole
        self.tube_inertia = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        thickness = bottle.length * throw.water_mass / (bottle.capacity * n)
        self.ends = {-1: thickness / 2, +1: bottle.length - thickness / 2}
        self.rate = throw.drag / self.m
        self.gravity = throw.gravity
        self.e = throw.restitution
        self.frozen = throw.frozen
        self.momentum = 0.0

    def inertia(self, r):
        centre = self.share * r.sum() + self.tube_part
        return self.tube_inertia + self.m * ((r - centre) ** 2).sum() + self.tube_mass * (self.middle - centre) ** 2

    def sides(self, r):
        """Return on which end each slice is: 1 base, -1 cap, 0 neither."""
        near = NEAR * self.length
        return np.where(r >= self.ends[1] - near, 1, np.where(r <= self.ends[-1] + near, -1, 0))

    def first_impact(self, series, side, last):
        """Return when in (0, last] a free slice first passes an end, or None."""
        tau = last * SAMPLES
        place, speed = horner(series.r[:, None, :], tau[:, None]), horner(series.v[:, None, :], tau[:, None])
        first = None
        for sign, end in self.ends.items():
            for i in np.flatnonzero(side == 0):
                gap, rate = sign * (place[:, i] - end), sign * speed[:, i]
                if gap.max() <= 0.0 and not np.any((rate[:-1] > 0.0) & (rate[1:] < 0.0) & (gap[:-1] > -0.01)):
                    continue
                terms = sign * series.r[:, i]
                terms[0] -= sign * end
                if abs(terms[0]) <= NEAR * self.length:
                    terms = terms[1:]  # it begins on this end: that root is left out
                at = self.rise(terms, tau, sign * series.v[:, i])
                if at is not None and (first is None or at < first):
                    first = at
        return first

    def rise(self, terms, tau, speeds):
        """Return where in tau a gap rises through 0, even if it falls again before the next of the samples."""
        before = 0.0
        for t in tau:
            if horner(terms, t) > 0.0:
                return brentq(lambda x: horner(terms, x), before, t, xtol=1e-15) if horner(terms, before) < 0.0 else t
            if horner(speeds, before) > 0.0 > horner(speeds, t):
                turn = brentq(lambda x: horner(speeds, x), before, t, xtol=1e-15)
                if horner(terms, turn) > 0.0 > horner(terms, before):
                    return brentq(lambda x: horner(terms, x), before, turn, xtol=1e-15)
            before = t
        return None

    def first_release(self, series, side, last):
        """Return when in [0, last] a resting slice is first pulled off its end, or None."""
        first = None
        for i in np.flatnonzero(side):
            push = side[i] * series.a[:, i]
            before = 0.0
            for t in last * SAMPLES:
                if horner(push, t) < 0.0:
                    at = brentq(lambda x, p=push: horner(p, x), before, t, xtol=1e-15) if push[0] > 0.0 else 0.0
                    first = at if first is None else min(first, at)
                    break
                before = t
        return first

    def resting(self, theta, r, v):
        """Return on which end each slice rests, and stop those that do."""
        touched = self.sides(r)
        if self.frozen or not touched.any():
            return np.zeros(len(r), dtype=int)
        a = Series(self, theta, r, v, np.zeros(len(r), dtype=int)).a[0]
        rests = (touched != 0) & (np.abs(v) < CALM) & (touched * a > 0.0)
        v[rests] = 0.0
        return np.where(rests, touched, 0)


def solve(ask):
    """Answer one throw at the times asked, out of the series of each step."""
    throw = ask.scenario
    body = Body(throw)
    theta, r, v = throw.theta0, np.array(ask.start, dtype=float), np.zeros(throw.n_slices)
    body.momentum = throw.omega0 * body.inertia(r)
    side = body.resting(theta, r, v)
    now, row = 0.0, 0
    angles, places, speeds = [], [], []
    while row < len(ask.times):
        series = Series(body, theta, r, v, side)
        last = series.reach(body, ask.effort)
        impact = release = None
        if not body.frozen:
            impact = body.first_impact(series, side, last)
            last = last if impact is None else impact
            release = body.first_release(series, side, last)
            last = last if release is None else release
        while row < len(ask.times) and ask.times[row] <= now + last:
            tau = ask.times[row] - now
            angles.append(horner(series.theta, tau))
            places.append(horner(series.r, tau))
            speeds.append(horner(series.v, tau))
            row += 1
        theta, r, v = horner(series.theta, last), horner(series.r, last), horner(series.v, last)
        now += last
        if release is not None:
            pushes = side * horner(series.a, last)
            side = np.where((side != 0) & (pushes > 1e-9), side, 0)
        elif impact is not None:
            touched = body.sides(r)
            r = np.where(touched == 1, body.ends[1], np.where(touched == -1, body.ends[-1], r))
            v = np.where((side == 0) & (touched * v > 0.0), -body.e * v, v)
            side = body.resting(theta, r, v)
    places = np.array(places)
    omega = np.array([body.momentum / body.inertia(place) for place in places])
    r_cm = body.share * places.sum(axis=1) + body.tube_part
    return {"t": ask.times, "theta": angles, "omega": omega, "r": places, "v": np.array(speeds), "r_cm": r_cm}


solve.name = "power series"
solve.equation = "eq8"
solve.refined_by = "rtol"
