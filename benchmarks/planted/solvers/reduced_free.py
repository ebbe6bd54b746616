"""Between two events all free slices obey one linear equation: x_i = A x_i0 + B v_i0 + P, seven unknowns for any N.

Lengths are shares of the bottle's length, measured from its middle; time is in units of 1 / rate.
"""

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

METHOD = DOP853
TOUCH = 1e-9
REST = 1e-4
SAMPLES = 8


class Flight:
    def __init__(self, throw, start, rtol):
        bottle = throw.bottle
        total = throw.water_mass + bottle.mass
        self.rtol = max(rtol, 3e-14)
        self.length = bottle.length
        self.rate = abs(throw.omega0)
        self.mu = throw.water_mass / throw.n_slices / total
        self.wall = 0.5 - throw.water_mass / bottle.capacity / throw.n_slices / 2
        self.own = bottle.mass / total * ((bottle.radius / bottle.length) ** 2 / 2 + 1 / 12)
        self.k = throw.drag * throw.n_slices / throw.water_mass / self.rate
        self.mu_b = bottle.mass / total
        self.e = throw.restitution
        self.frozen = throw.frozen or self.wall < TOUCH
        self.t, self.theta = 0.0, throw.theta0
        self.x = start / bottle.length - 0.5
        self.v = np.zeros(throw.n_slices)
        self.momentum = self.inertia() * throw.omega0 / self.rate
        self.settle(np.where(np.abs(self.x) > self.wall - TOUCH, np.sign(self.x), 0.0))

    def inertia(self):
        return self.own + self.mu * (self.x @ self.x) - (self.mu * self.x.sum()) ** 2

    def omega(self):
        return self.momentum / self.inertia()

    def hold(self, rest):
        """Slices that rest are one body with the tube."""
        self.rest = rest
        self.body = self.mu_b + self.mu * np.count_nonzero(rest)
        self.body_centre = self.mu * rest.sum() * self.wall / self.body

    def settle(self, side):
        slow = (side != 0) & (np.abs(self.v) < REST)
        while True:
            self.hold(np.where(slow, side, 0.0))
            moving = self.v[~slow].sum()
            a = self.omega() ** 2 * (self.x - self.body_centre) - self.k * self.mu / self.body * moving
            lifted = slow & (side * a <= 0)
            if not lifted.any():
                break
            slow = slow & ~lifted
        given = self.mu * self.v[slow].sum()
        self.v[slow] = 0.0
        self.v[~slow] -= given / self.body

    def impact(self):
        """Simultaneous impulses: every touching slice and the tube, found by halving the tube's change of velocity."""
        side = np.where(np.abs(self.x) > self.wall - TOUCH, np.sign(self.x), 0.0)
        self.x = np.where(side != 0, side * self.wall, self.x)
        self.v[self.rest != 0] = 0.0
        pressed = (side != 0) & (side * self.v >= 0)

        def impulses(change):
            return np.where(pressed, np.maximum(side * self.mu * ((1 + self.e) * self.v - change), 0.0), 0.0)

        low = -(1 + self.e) * np.abs(self.v).max()
        high = -low
        for _ in range(200):
            middle = (low + high) / 2
            if self.mu_b * middle < (side * impulses(middle)).sum():
                low = middle
            else:
                high = middle
        change = (low + high) / 2
        self.v = self.v - change - side * impulses(change) / self.mu
        self.settle(side)

    def fly(self, until):
        if self.frozen:
            self.theta += self.omega() * (until - self.t)
            self.t = until
        while until - self.t > 1e-13:
            self.leg(until)

    def leg(self, until):
        """Go on to the first event, to ``until``, or until the slices have spread a hundredfold."""
        mu, k, wall = self.mu, self.k, self.wall
        free = self.rest == 0
        x0, v0 = self.x[free], self.v[free]
        count, sx, sv, sxx, sxv, svv = len(x0), x0.sum(), v0.sum(), x0 @ x0, x0 @ v0, v0 @ v0
        fixed, fixed2 = mu * self.x[~free].sum(), mu * (self.x[~free] ** 2).sum()

        def field(y):
            theta, a, da, b, db, p, dp = y
            centre = mu * (a * sx + b * sv + count * p) + fixed
            second = mu * (a * a * sxx + 2 * a * b * sxv + b * b * svv + 2 * p * (a * sx + b * sv) + count * p * p)
            omega = self.momentum / (self.own + second + fixed2 - centre * centre)
            force = -omega * omega * self.body_centre - k * mu / self.body * (da * sx + db * sv + count * dp)
            return omega, force

        def rates(t, y):
            omega, force = field(y)
            _, a, da, b, db, p, dp = y
            w = omega * omega
            return [omega, da, w * a - k * da, db, w * b - k * db, dp, w * p - k * dp + force]

        def push(side, y):
            omega, force = field(y)
            return side * (omega * omega * side * wall + force)

        def found(function, left, right):
            """Return where a function that is positive at ``right`` became so."""
            span, low = right - left, left
            for _ in range(60):
                if function(low) < 0.0:
                    return brentq(function, low, right, xtol=1e-15)
                span /= 2
                low = left + span
            return left

        sides = [side for side in (1.0, -1.0) if (self.rest == side).any()]
        y = np.array([self.theta, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
        end = until - self.t
        stepper = METHOD(rates, 0.0, y, end, rtol=self.rtol, atol=self.rtol, max_step=0.2, first_step=min(1e-3, end))
        kind, at = None, end
        while stepper.status == "running" and kind is None:
            stepper.step()
            path = stepper.dense_output()
            times = np.linspace(stepper.t_old, stepper.t, SAMPLES + 1)
            ys = path(times)
            xs = np.outer(x0, ys[1]) + np.outer(v0, ys[3]) + ys[5]
            vs = np.outer(x0, ys[2]) + np.outer(v0, ys[4]) + ys[6]
            outside = np.abs(xs) > wall + 1e-13
            speeds = np.sign(xs) * vs
            turned = (speeds[:, :-1] > 0) & (speeds[:, 1:] < 0)
            y, at = stepper.y, stepper.t
            for j in range(SAMPLES):
                first = times[j + 1]
                for i in np.flatnonzero(outside[:, j + 1] | (turned[:, j] & ~outside[:, j])):
                    side = np.sign(xs[i, j + 1])

                    def gap(t):
                        z = path(t)
                        return side * (x0[i] * z[1] + v0[i] * z[3] + z[5]) - wall

                    right = times[j + 1]
                    if not outside[i, j + 1]:
                        right = brentq(lambda t: path(t)[2] * x0[i] + path(t)[4] * v0[i] + path(t)[6], times[j], right)
                        if gap(right) <= 1e-13:
                            continue
                    when = found(gap, times[j], right)
                    if when <= first:
                        first, kind = when, "impact"
                for side in sides:
                    if push(side, ys[:, j + 1]) < 0.0:
                        when = found(lambda t: -push(side, path(t)), times[j], times[j + 1])
                        if when < first or kind is None:
                            first, kind = when, side
                if kind is not None:
                    at, y = first, path(first)
                    break
            if abs(y[1]) > 100.0:
                break
        if stepper.status == "failed":
            raise RuntimeError("the step became too small")
        self.theta = y[0]
        self.x[free] = x0 * y[1] + v0 * y[3] + y[5]
        self.v[free] = x0 * y[2] + v0 * y[4] + y[6]
        self.t += at
        if kind == "impact":
            self.impact()
        elif kind is not None:
            self.hold(np.where(self.rest == kind, 0.0, self.rest))


def solve(ask):
    flight = Flight(ask.scenario, ask.start, ask.effort)
    rows = []
    for when in ask.times:
        flight.fly(when * flight.rate)
        rows.append((flight.theta, flight.omega() * flight.rate, flight.x.copy(), flight.v.copy()))
    theta, omega, x, v = (np.array(column) for column in zip(*rows))
    r = (x + 0.5) * flight.length
    return {"t": ask.times, "theta": theta, "omega": omega, "r": r, "v": v * flight.length * flight.rate}


solve.name = "seven equations of free flight"
solve.equation = "free-flight"
solve.refined_by = "rtol"
solve.timeout = 300.0
