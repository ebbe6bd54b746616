"""Free flight of a bottle with water slices: adaptive Dormand-Prince 5(4) with its continuous extension.

    Throw      the constants
    Contacts   which slices rest on an end; impulses
    Motion     right-hand side for a given set of resting slices
    Piece      one accepted step, with its polynomial
    Flight     the march
"""
from __future__ import annotations

import math

import numpy as np

A = [np.array(row) for row in (
    [1 / 5],
    [3 / 40, 9 / 40],
    [44 / 45, -56 / 15, 32 / 9],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
    [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84])]
ERROR = np.array([-71 / 57600, 0.0, 71 / 16695, -71 / 1920, 17253 / 339200, -22 / 525, 1 / 40])
DENSE = np.array([
    [1.0, -8048581381 / 2820520608, 8663915743 / 2820520608, -12715105075 / 11282082432],
    [0.0, 0.0, 0.0, 0.0],
    [0.0, 131558114200 / 32700410799, -68118460800 / 10900136933, 87487479700 / 32700410799],
    [0.0, -1754552775 / 470086768, 14199869525 / 1410260304, -10690763975 / 1880347072],
    [0.0, 127303824393 / 49829197408, -318862633887 / 49829197408, 701980252875 / 199316789632],
    [0.0, -282668133 / 205662961, 2019193451 / 616988883, -1453857185 / 822651844],
    [0.0, 40617522 / 29380423, -110615467 / 29380423, 69997945 / 29380423]])
SAMPLES = np.linspace(0.0, 1.0, 13)


class Throw:
    def __init__(self, scenario):
        bottle = scenario.bottle
        self.n = scenario.n_slices
        self.length = bottle.length
        self.tube = bottle.mass
        self.m = scenario.water_mass / self.n
        self.eps = bottle.mass / (bottle.mass + scenario.water_mass)
        self.own = bottle.mass * (bottle.radius ** 2 / 2 + bottle.length ** 2 / 12)
        self.alpha = scenario.drag
        self.e = scenario.restitution
        self.low, self.high = scenario.r_min, scenario.r_max
        self.omega0 = scenario.omega0
        self.theta0 = scenario.theta0
        self.rest_speed = 1e-5 * abs(scenario.omega0) * bottle.length
        self.touch = 1e-11 * bottle.length
        self.rigid = scenario.frozen or self.high - self.low < 1e-12 * self.length

    def r_cm(self, r):
        return (1 - self.eps) * r.mean(axis=-1) + self.eps * self.length / 2

    def inertia(self, r):
        centre = self.r_cm(r)
        slices = ((r - centre[..., None]) ** 2).sum(axis=-1)
        return self.m * slices + self.own + self.tube * (self.length / 2 - centre) ** 2


class Motion:
    """The slices with a given set of them at rest on the ends."""

    def __init__(self, throw, spin, r, resting):
        self.throw, self.spin = throw, spin                 # spin: angular momentum
        self.resting = resting
        self.free = ~resting
        self.body = throw.tube + throw.m * resting.sum()    # tube and what rests on it
        self.body_centre = (throw.tube * throw.length / 2 + throw.m * r[resting].sum()) / self.body

    def parts(self, y):
        n = self.throw.n
        return y[:n], y[n:2 * n], y[2 * n]

    def omega(self, r):
        return self.spin / self.throw.inertia(r)

    def pull(self, r, v):
        """omega and the acceleration relative to the tube of a slice without its own drag"""
        throw = self.throw
        omega = self.omega(r)
        reaction = throw.alpha / self.body * v[self.free].sum()
        return omega, omega ** 2 * (r - self.body_centre) - reaction

    def slope(self, y):
        n = self.throw.n
        r, v, _ = self.parts(y)
        omega, a = self.pull(r, v)
        out = np.empty_like(y)
        out[:n] = v
        out[n:2 * n] = np.where(self.free, a - self.throw.alpha / self.throw.m * v, 0.0)
        out[2 * n] = omega
        return out

    def outward(self, y):
        """(base, cap): outward acceleration that an end has to hold back, per unit mass"""
        r, v, _ = self.parts(y)
        omega, _ = self.pull(r, v)
        reaction = self.throw.alpha / self.body * v[self.free].sum()
        return (omega ** 2 * (self.throw.high - self.body_centre) - reaction,
                -(omega ** 2 * (self.throw.low - self.body_centre) - reaction))

    def step(self, y, k0, h):
        k = np.empty((7, len(y)))
        k[0] = k0
        for i, row in enumerate(A):
            last = y + h * (row @ k[:i + 1])
            k[i + 1] = self.slope(last)
        return last, k


class Contacts:
    def __init__(self, throw):
        self.throw = throw

    def gaps(self, r):
        """how far outside, and the side (+1 base, -1 cap)"""
        side = np.where(r > 0.5 * (self.throw.low + self.throw.high), 1.0, -1.0)
        return np.where(side > 0, r - self.throw.high, self.throw.low - r), side

    def settle(self, y, spin):
        """the motion that follows: which of the slices at rest on an end stay there"""
        n = self.throw.n
        r, v = y[:n], y[n:2 * n]
        base = (r == self.throw.high) & (v == 0.0)
        cap = (r == self.throw.low) & (v == 0.0)
        best = None
        for keep_base in ((True, False) if base.any() else (False,)):
            for keep_cap in ((True, False) if cap.any() else (False,)):
                resting = base & keep_base | cap & keep_cap
                motion = Motion(self.throw, spin, r, resting)
                at_base, at_cap = motion.outward(y)
                wrong = 0.0
                if base.any():
                    wrong = max(wrong, -at_base if keep_base else at_base)
                if cap.any():
                    wrong = max(wrong, -at_cap if keep_cap else at_cap)
                if best is None or wrong < best[0]:
                    best = wrong, motion
        return best[1]

    def impulse(self, side, v):
        """total impulse on the tube; the slices of side and v are in contact"""
        m, tube, e = self.throw.m, self.throw.tube, self.throw.e
        if not (side * v > 0).any():
            return 0.0

        def excess(total):
            return total - (side * self.single(side, v, total)).sum()

        knots = np.unique((1 + e) * v * tube)
        lo, hi = -1, len(knots)                             # excess(knots[lo]) < 0 <= excess(knots[hi])
        while hi - lo > 1:
            mid = (lo + hi) // 2
            if excess(knots[mid]) < 0:
                lo = mid
            else:
                hi = mid
        if lo < 0:
            point = knots[0] - tube * abs(knots[0]) - tube
        elif hi == len(knots):
            point = knots[-1] + tube * abs(knots[-1]) + tube
        else:
            point = 0.5 * (knots[lo] + knots[hi])
        push = (1 + e) * side * v - side * point / tube > 0
        return m * (1 + e) * v[push].sum() / (1 + m * push.sum() / tube)

    def single(self, side, v, total):
        throw = self.throw
        return throw.m * np.maximum(0.0, (1 + throw.e) * side * v - side * total / throw.tube)

    def collide(self, y, t, impacts):
        throw, n = self.throw, self.throw.n
        r, v = y[:n].copy(), y[n:2 * n].copy()
        gap, side = self.gaps(r)
        touching = gap >= -throw.touch
        r[touching & (side > 0)] = throw.high
        r[touching & (side < 0)] = throw.low
        s, before = side[touching], v[touching]
        for i in np.nonzero(touching & (side * v > 0))[0]:
            impacts.append((t, int(i), float(v[i])))
        total = self.impulse(s, before)
        v -= total / throw.tube
        v[touching] -= s * self.single(s, before, total) / throw.m
        slow = touching & (np.abs(v) < throw.rest_speed)
        if slow.any():                                      # they stay with the tube; momentum is kept
            shift = throw.m * v[slow].sum() / (throw.tube + throw.m * slow.sum())
            v -= shift
            v[slow] = 0.0
        return np.concatenate([r, v, y[2 * n:]])


class Piece:
    """One step and the polynomial in it."""

    def __init__(self, motion, y, h, k):
        self.motion, self.y, self.h, self.k = motion, y, h, k
        self.q = DENSE.T @ k

    def at(self, tau):
        x = tau / self.h
        return self.y + self.h * (np.array([x, x ** 2, x ** 3, x ** 4]) @ self.q)

    def exact(self, tau):
        return self.motion.step(self.y, self.k[0], tau)[0]


class Flight:
    def __init__(self, scenario, start, rtol):
        self.throw = Throw(scenario)
        self.contacts = Contacts(self.throw)
        self.rtol = rtol
        r = np.array(start, dtype=float)
        for end in (self.throw.low, self.throw.high):
            r[np.abs(r - end) < 1e-12 * self.throw.length] = end
        n = self.throw.n
        self.spin = self.throw.inertia(r) * self.throw.omega0
        self.y = np.concatenate([r, np.zeros(n), [self.throw.theta0]])
        self.t = 0.0
        self.impacts = []
        unit = np.empty(2 * n + 1)
        unit[:n] = self.throw.length
        unit[n:2 * n] = abs(self.throw.omega0) * self.throw.length
        unit[2 * n] = 1.0
        self.tolerance = rtol * unit
        self.h_max = 0.6 / abs(self.throw.omega0)
        self.h = 0.02 / abs(self.throw.omega0)

    def first_outside(self, piece):
        """end of a part of the step that is sure to contain the first impact, or None"""
        n, free = self.throw.n, piece.motion.free
        x = SAMPLES[:, None] ** np.arange(1, 5)
        ys = piece.y + piece.h * (x @ piece.q)
        ys[-1] = piece.y + piece.h * (A[-1] @ piece.k[:6])
        r, v = ys[:, :n], ys[:, n:2 * n]
        gap, side = self.contacts.gaps(r)
        for j in range(1, len(SAMPLES)):
            width = piece.h * (SAMPLES[j] - SAMPLES[j - 1])
            v0, v1 = side[j] * v[j - 1], side[j] * v[j]
            turn = free & (v0 > 0) & (v1 < 0)
            if turn.any():
                tau = width * v0[turn] / (v0[turn] - v1[turn])
                over = gap[j - 1][turn] + 0.5 * v0[turn] * tau > 0
                if over.any():
                    peak = piece.h * SAMPLES[j - 1] + tau[over].min()
                    top, _ = self.contacts.gaps(piece.at(peak)[:n])
                    if (top[free] > 1e-13 * self.throw.length).any():
                        return peak
            if (gap[j][free] > 1e-13 * self.throw.length).any():
                return piece.h * SAMPLES[j]
        return None

    def locate(self, state, free, hi, guess):
        """time and state of the first contact of a free slice in (0, hi]; Newton in a bracket"""
        n, tiny = self.throw.n, 1e-13 * self.throw.length
        lo, tau = 0.0, guess
        for _ in range(60):
            y = state(tau)
            gap, side = self.contacts.gaps(y[:n])
            speed = side * y[n:2 * n]
            out, ahead = free & (gap > tiny), free & (speed > 0)
            if out.any():
                hi = tau
                both = out & ahead
                new = tau - (gap[both] / speed[both]).max() if both.any() else 0.5 * (lo + hi)
            elif (ahead & (gap >= -tiny)).any():
                break
            else:
                lo = tau
                new = tau + (-gap[ahead] / speed[ahead]).min() if ahead.any() else 0.5 * (lo + hi)
            if not lo < new < hi:
                new = 0.5 * (lo + hi)
            if new in (lo, hi):
                break
            tau = new
        return tau, y

    def release(self, piece, end, hi):
        """first time in (0, hi] at which the pressure on an end (0 base, 1 cap) is gone"""
        lo = 0.0
        for _ in range(80):
            mid = 0.5 * (lo + hi)
            if not lo < mid < hi or hi - lo < 1e-13 * piece.h:
                break
            if piece.motion.outward(piece.at(mid))[end] > 0:
                lo = mid
            else:
                hi = mid
        return hi

    def run(self, times):
        throw, n = self.throw, self.throw.n
        rows = np.empty((len(times), 2 * n + 1))
        filled = 0
        while filled < len(times) and times[filled] <= 0.0:
            rows[filled] = self.y
            filled += 1
        if throw.rigid:
            rows[filled:] = self.y
            rows[filled:, 2 * n] = throw.theta0 + throw.omega0 * times[filled:]
            return rows
        motion = self.contacts.settle(self.y, self.spin)
        k0 = motion.slope(self.y)
        while filled < len(times):
            # an accepted step
            while True:
                h = min(self.h, self.h_max)
                end, k = motion.step(self.y, k0, h)
                error = np.max(np.abs(h * (ERROR @ k)) / self.tolerance)
                self.h = h * min(5.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2))
                if error <= 1.0:
                    break
            piece = Piece(motion, self.y, h, k)

            # what ends it early
            tau, event = h, None
            bound = self.first_outside(piece)
            if bound is not None:
                event = "impact"
                guess, _ = self.locate(piece.at, motion.free, bound, bound)
                tau, end = self.locate(piece.exact, motion.free, h, guess)
            for number, group in enumerate((throw.high, throw.low)):
                held = motion.resting & (self.y[:n] == group)
                if held.any() and motion.outward(piece.at(tau))[number] <= 0:
                    event, tau = "release", self.release(piece, number, tau)
                    end = piece.exact(tau)

            # answers
            while filled < len(times) and times[filled] <= self.t + tau:
                rows[filled] = piece.at(times[filled] - self.t)
                filled += 1

            self.t += tau
            if event is None:
                self.y, k0 = end, k[6]
                continue
            self.y = self.contacts.collide(end, self.t, self.impacts) if event == "impact" else end
            motion = self.contacts.settle(self.y, self.spin)
            k0 = motion.slope(self.y)
        return rows


def solve(ask):
    times = np.asarray(ask.times, dtype=float)
    flight = Flight(ask.scenario, ask.start, ask.effort)
    rows = flight.run(times)
    n = flight.throw.n
    r, v, theta = rows[:, :n], rows[:, n:2 * n], rows[:, 2 * n]
    inertia = flight.throw.inertia(r)
    return {"t": times, "theta": theta, "omega": flight.spin / inertia, "r": r, "v": v,
            "r_cm": flight.throw.r_cm(r), "inertia": inertia}


solve.name = "Dormand-Prince with located impacts"
solve.equation = "free-flight"
solve.refined_by = "rtol"
