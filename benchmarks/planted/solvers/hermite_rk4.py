"""Eq. 8 by the classical Runge-Kutta rule on an even grid of steps.

A trial step is looked through with its cubic Hermite polynomial; the first landing or release found in it by bisection
ends it there.  Output times do not disturb the grid: each is reached by a shorter step of its own.
"""
import numpy as np

HALVINGS = 50


class Tube:
    """The numbers of a throw and the right side of Eq. 8; a state is (theta, r_1 .. r_N, v_1 .. v_N)."""

    def __init__(self, throw, start):
        bottle = throw.bottle
        self.n = len(start)
        self.m = throw.slice_mass
        self.mass = bottle.mass
        self.total = throw.total_mass
        self.middle = bottle.length / 2
        self.own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.gravity = throw.gravity
        self.rate = throw.drag / throw.slice_mass
        self.ends = np.array([[throw.r_max], [throw.r_min]])
        self.bounce = throw.restitution
        self.hold = 2e-5 * abs(throw.omega0) * bottle.length
        self.slack = 1e-14 * bottle.length
        self.spin = self.centre_and_inertia(start)[1] * throw.omega0

    def centre_and_inertia(self, r):
        centre = (self.m * r.sum() + self.mass * self.middle) / self.total
        water = self.m * ((r - centre) ** 2).sum()
        return centre, self.own + water + self.mass * (self.middle - centre) ** 2

    def split(self, y):
        return y[0], y[1 : self.n + 1], y[self.n + 1 :]

    def motion(self, y):
        """Return omega and what every slice's acceleration would be if it were free."""
        theta, r, v = self.split(y)
        centre, inertia = self.centre_and_inertia(r)
        omega = self.spin / inertia
        drift = self.m * v.sum() / self.total
        a = omega**2 * (r - centre) - self.rate * (v - drift) + self.gravity * np.cos(theta)
        return omega, a

    def slope(self, y, free):
        omega, a = self.motion(y)
        return np.concatenate(([omega], np.where(free, y[self.n + 1 :], 0.0), np.where(free, a, 0.0)))

    def step(self, y, h, free, k1):
        k2 = self.slope(y + h / 2 * k1, free)
        k3 = self.slope(y + h / 2 * k2, free)
        k4 = self.slope(y + h * k3, free)
        return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def landing(self, y0, y1, h, free):
        """Return, for each end and slice, the part of the step after which the slice reaches that end; inf: it does not."""
        _, r0, v0 = self.split(y0)
        _, r1, v1 = self.split(y1)
        sign = np.array([[1.0], [-1.0]])
        gap0, gap1 = sign * (r0 - self.ends), sign * (r1 - self.ends)
        rise0, rise1 = sign * v0 * h, sign * v1 * h
        c2 = 3 * (gap1 - gap0) - 2 * rise0 - rise1
        c3 = 2 * (gap0 - gap1) + rise0 + rise1

        def beyond(x):
            return gap0 + x * (rise0 + x * (c2 + x * c3)) > self.slack

        with np.errstate(all="ignore"):  # the polynomial's maximum may lie beyond an end that both grid points miss
            top = rise0 / (np.sqrt(c2**2 - 3 * c3 * rise0) - c2)
        inside = (top > 0) & (top < 1)
        top = np.where(inside, top, 1.0)
        high = np.where(beyond(top), top, 1.0)
        strikes = beyond(high) & free
        if not strikes.any():
            return np.full_like(high, np.inf)
        low = np.zeros_like(high)
        for _ in range(HALVINGS):
            x = (low + high) / 2
            out = beyond(x)
            low, high = np.where(out, low, x), np.where(out, x, high)
        return np.where(strikes, high, np.inf)

    def release(self, y0, y1, h, side, k0):
        """Return the part of the step after which a resting slice is no longer pressed (inf: never), and which are not."""
        rests = side != 0
        if not (self.pressure(y1, side)[rests] < 0).any():
            return np.inf, np.zeros(self.n, dtype=bool)
        k1 = self.slope(y1, ~rests)

        def state(x):
            inner = (1 - x) ** 2 * ((1 + 2 * x) * y0 + x * h * k0)
            return inner + x**2 * ((3 - 2 * x) * y1 + (x - 1) * h * k1)

        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            x = (low + high) / 2
            if (self.pressure(state(x), side)[rests] < 0).any():
                high = x
            else:
                low = x
        return high, rests & (self.pressure(state(high), side) < 0)

    def pressure(self, y, side):
        return side * self.motion(y)[1]

    def rebound(self, y, side, struck, t, impacts):
        """Throw back the slices that struck an end, or lay them down there."""
        _, r, v = self.split(y)  # views
        for row, end in ((0, 1), (1, -1)):
            for i in np.flatnonzero(struck[row]):
                before, r[i] = v[i], self.ends[row, 0]
                v[i] = -self.bounce * before
                if abs(v[i]) < self.hold:
                    v[i], side[i] = 0.0, end
                impacts.append((t, i, end, before, v[i]))

    def settle(self, y, side):
        """Let go of what is not pressed against its end."""
        side[self.pressure(y, side) < 0] = 0


def solve(ask):
    throw, times = ask.scenario, np.asarray(ask.times, dtype=float)
    tube = Tube(throw, ask.start)
    if throw.frozen:
        return ice(tube, throw, times, ask.start)
    y = np.concatenate(([throw.theta0], ask.start, np.zeros(tube.n)))
    near = 1e-12 * throw.bottle.length
    side = np.where(ask.start > throw.r_max - near, 1, np.where(ask.start < throw.r_min + near, -1, 0))
    tube.settle(y, side)
    steps = max(1, int(np.ceil(ask.effort - 1e-9)))
    t, impacts, rows = 0.0, [], []
    for k in range(1, steps + 1):
        grid = throw.duration * k / steps
        if len(rows) == len(times):
            break
        while t < grid:
            h, free = grid - t, side == 0
            k0 = tube.slope(y, free)
            trial = tube.step(y, h, free, k0)
            reach = tube.landing(y, trial, h, free)
            let_go, leaving = tube.release(y, trial, h, side, k0)
            part = min(reach.min(), let_go)
            happens = part <= 1.0
            until = t + part * h if happens else grid
            while len(rows) < len(times) and (times[len(rows)] < until or (k == steps and until == grid)):
                rows.append(tube.step(y, times[len(rows)] - t, free, k0))
            if not happens:
                y, t = trial, until
                continue
            y, t = tube.step(y, part * h, free, k0), until
            y[1 : tube.n + 1] = np.clip(y[1 : tube.n + 1], throw.r_min, throw.r_max)
            if reach.min() <= let_go:
                tube.rebound(y, side, reach <= part * (1 + 1e-12), t, impacts)
            else:
                side[leaving] = 0
            tube.settle(y, side)
    return answer(tube, times, np.array(rows), impacts)


def answer(tube, times, rows, impacts):
    n = tube.n
    r = np.clip(rows[:, 1 : n + 1], tube.ends[1, 0], tube.ends[0, 0])
    centre, inertia = np.array([tube.centre_and_inertia(row) for row in r]).T
    out = {"t": times, "theta": rows[:, 0], "omega": tube.spin / inertia, "r": r, "v": rows[:, n + 1 :]}
    return out | {"r_cm": centre, "inertia": inertia, "impacts": impacts}


def ice(tube, throw, times, start):
    rows = np.zeros((len(times), 2 * tube.n + 1))
    rows[:, 0] = throw.theta0 + throw.omega0 * times
    rows[:, 1 : tube.n + 1] = start
    return answer(tube, times, rows, [])


solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 4
solve.timeout = 300.0
