"""Free flight with recoil by an embedded Runge-Kutta pair of Dormand and Prince with dense output, and events on that output."""
import numpy as np
from scipy.optimize import brentq

NODES = [
    [],
    [1 / 5],
    [3 / 40, 9 / 40],
    [44 / 45, -56 / 15, 32 / 9],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
    [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
]
ERROR = np.array([-71 / 57600, 0, 71 / 16695, -71 / 1920, 17253 / 339200, -22 / 525, 1 / 40])
DENSE = np.array([
    [1, -8048581381 / 2820520608, 8663915743 / 2820520608, -12715105075 / 11282082432],
    [0, 0, 0, 0],
    [0, 131558114200 / 32700410799, -68118460800 / 10900136933, 87487479700 / 32700410799],
    [0, -1754552775 / 470086768, 14199869525 / 1410260304, -10690763975 / 1880347072],
    [0, 127303824393 / 49829197408, -318862633887 / 49829197408, 701980252875 / 199316789632],
    [0, -282668133 / 205662961, 2019193451 / 616988883, -1453857185 / 822651844],
    [0, 40617522 / 29380423, -110615467 / 29380423, 69997945 / 29380423],
])


class Bottle:
    """The motion and its contacts; the state y is theta, r, v."""

    def __init__(self, throw, start):
        bottle = throw.bottle
        self.n, self.m, self.tube, self.total = len(start), throw.slice_mass, bottle.mass, throw.total_mass
        self.drag, self.e = throw.drag, throw.restitution
        self.middle = bottle.length / 2
        self.own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.top, self.bottom = throw.r_max, throw.r_min
        self.length, self.speed = bottle.length, abs(throw.omega0) * bottle.length
        self.slow = 2e-5 * self.speed
        self.window = 1e-9 / abs(throw.omega0)
        self.rest = np.zeros(self.n, dtype=int)
        self.momentum = throw.omega0 * self.inertia(np.array(start))[0]
        self.impacts = []
        for end in (self.top, self.bottom):
            start[np.abs(start - end) < 1e-12 * self.length] = end

    def split(self, y):
        return y[0], y[1:self.n + 1], y[self.n + 1:]

    def inertia(self, r):
        centre = (self.m * r.sum() + self.tube * self.middle) / self.total
        spread = self.m * ((r - centre) ** 2).sum()
        return self.own + spread + self.tube * (self.middle - centre) ** 2, centre

    def push(self, y, places, rest):
        """Acceleration without speed, in the bottle, of slices at the places; tube and resting slices are one body."""
        _, r, v = self.split(y)
        held = rest != 0
        body = self.tube + self.m * held.sum()
        centre = (self.tube * self.middle + self.m * r[held].sum()) / body
        omega = self.momentum / self.inertia(r)[0]
        return omega**2 * (places - centre) - self.drag / body * v[~held].sum()

    def slope(self, y):
        _, r, v = self.split(y)
        a = self.push(y, r, self.rest) - self.drag / self.m * v
        free = self.rest == 0
        return np.concatenate(([self.momentum / self.inertia(r)[0]], np.where(free, v, 0.0), np.where(free, a, 0.0)))

    def sides(self, r):
        return (r == self.top).astype(int) - (r == self.bottom).astype(int)

    def settle(self, y):
        """Which slices rest: on an end, without speed, and pressed. At most one end is not pressed."""
        _, r, v = self.split(y)
        rest = np.where(v == 0, self.sides(r), 0)
        for sign, end in ((1, self.top), (-1, self.bottom), (1, self.top)):
            if (rest == sign).any() and sign * self.push(y, end, rest) <= 0:
                rest[rest == sign] = 0
        self.rest = rest

    def strike(self, t, y):
        """Impacts of all that have arrived at an end, with the resting slices in the same linear complementarity problem."""
        _, r, v = self.split(y)
        arrived = np.zeros(self.n, dtype=bool)
        for sign, end in ((1, self.top), (-1, self.bottom)):
            here = (sign * v > 0) & (sign * (r - end) >= -self.window * sign * v - 1e-15 * self.length)
            r[here] = end
            arrived |= here
        if not arrived.any():
            return False
        before = v.copy()
        v[arrived & (np.abs(v) <= self.slow)] = 0.0
        s = self.sides(r)
        touching = s != 0
        e = np.where(self.e * np.abs(v) > self.slow, self.e, 0.0)
        want = (1 + e) * v

        def impulses(total):
            return np.where(touching, self.m * np.maximum(0.0, s * (want - total / self.tube)), 0.0)

        def excess(total):
            return total - (s * impulses(total)).sum()

        knots = np.unique(np.append(self.tube * want[touching], 0.0))
        values = np.array([excess(knot) for knot in knots])
        if values[0] > 0:
            low, high = knots[0] - 1.0, knots[0]
        elif values[-1] < 0:
            low, high = knots[-1], knots[-1] + 1.0
        else:
            k = max(1, int(np.searchsorted(values, 0.0)))
            low, high = (knots[k - 1], knots[k]) if len(knots) > 1 else (knots[0] - 1.0, knots[0])
        total = low - excess(low) * (high - low) / (excess(high) - excess(low))
        p = impulses(total)
        v -= s * p / self.m + total / self.tube
        v[touching & (((p > 0) & (e == 0)) | (np.abs(v) < 1e-9 * self.speed))] = 0.0
        for i in np.flatnonzero(arrived):
            self.impacts.append([t, i, s[i], before[i], v[i]])
        self.settle(y)
        return True

    def first_impact(self, y, series):
        """Fraction of the step at which the first slice arrives at an end; the series are powers 1 to 4 of it."""
        _, r, _ = self.split(y)
        rows, first = series[1:self.n + 1], 2.0
        for sign, end in ((1, self.top), (-1, self.bottom)):
            near = (self.rest == 0) & (np.abs(r - end) <= np.abs(rows).sum(axis=1) * (1 + 1e-9))
            for i in np.flatnonzero(near):
                poly = np.append(rows[i, ::-1], r[i] - end)
                slope = np.polyder(poly)
                for root in np.roots(poly[:-1] if r[i] == end else poly):
                    if abs(root.imag) < 1e-9 and 1e-12 < root.real <= 1 and sign * np.polyval(slope, root.real) > 0:
                        first = min(first, root.real)
        return first

    def first_release(self, dense):
        first, which = 2.0, 0
        for sign, end in ((1, self.top), (-1, self.bottom)):
            def force(x):
                return sign * self.push(dense(x), end, self.rest)
            if not (self.rest == sign).any():
                continue
            for low, high in ((0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0)):
                if force(high) < 0:
                    x = brentq(force, low, high, xtol=1e-15) if force(low) > 0 else low
                    if x < first:
                        first, which = x, sign
                    break
        return first, which


def solve(ask):
    throw, start = ask.scenario, np.array(ask.start, dtype=float)
    bottle = Bottle(throw, start)
    y = np.concatenate(([throw.theta0], start, np.zeros_like(start)))
    times, rows = np.asarray(ask.times, dtype=float), []
    if throw.frozen or throw.r_max - throw.r_min < 1e-12 * bottle.length:
        rows = [np.concatenate(([throw.theta0 + throw.omega0 * when], y[1:])) for when in times]
    else:
        bottle.settle(y)
        rtol = min(max(ask.effort, 3e-14), 1.0)
        scale = rtol * np.concatenate(([1.0], np.full(bottle.n, bottle.length), np.full(bottle.n, bottle.speed)))
        longest = min(throw.duration / 4, 0.5 / abs(throw.omega0))
        t, h = 0.0, longest
        while len(rows) < len(times):
            bottle.strike(t, y)
            k = [bottle.slope(y)]
            while True:
                for row in NODES[1:]:
                    new = y + h * sum(weight * slope for weight, slope in zip(row, k))
                    k.append(bottle.slope(new))
                error = h * np.abs((ERROR @ np.array(k)) / scale).max()
                if error <= 1 or h < 1e-13 * throw.duration:
                    break
                h *= max(0.2, 0.9 * error**-0.2)
                k = k[:1]
            series = h * (np.array(k).T @ DENSE)

            def dense(x):
                return y + series @ x ** np.arange(1, 5)

            x = bottle.first_impact(y, series)
            release, which = bottle.first_release(dense)
            part = min(x, release, 1.0)
            while len(rows) < len(times) and times[len(rows)] <= t + part * h:
                rows.append(dense((times[len(rows)] - t) / h))
            t, y = t + part * h, dense(part)
            if release == part and which:
                bottle.rest[bottle.rest == which] = 0
            h = min(longest, h * min(5.0, 0.9 * max(error, 1e-10) ** -0.2))
    n, rows = bottle.n, np.array(rows)
    r, v = rows[:, 1:n + 1], rows[:, n + 1:]
    inertia, centre = np.array([bottle.inertia(row) for row in r]).T
    answer = {"t": times, "theta": rows[:, 0], "omega": bottle.momentum / inertia, "r": r, "v": v, "r_cm": centre, "inertia": inertia}
    return {**answer, "impacts": np.array(bottle.impacts, dtype=float).reshape(-1, 5)}


solve.refined_by = "rtol"
solve.equation = "free-flight"
