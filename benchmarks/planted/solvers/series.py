"""Eq. 8 by Taylor series in time: every quantity is an array of coefficients, found one after the other from the
equations; the steps are as long as the last coefficients allow. An impact is a root of a polynomial.

    r' = v,   v' = omega^2 (r - c) + g cos(theta) - alpha / m (v - v_c),   theta' = omega,   J omega = const
"""
import numpy as np

ORDER = 18
TOLERANCE = 1e-13
PARTS = 8  # each step is searched for impacts in so many parts


def value(series, t):
    total = 0.0 * series[-1]
    for a in series[::-1]:
        total = total * t + a
    return total


def root(series, a, b):
    """Root in [a, b] of a series that is not positive at a and positive at b."""
    for _ in range(60):
        mid = (a + b) / 2
        if value(series, mid) > 0:
            b = mid
        else:
            a = mid
    return b


def cauchy(a, b, k):
    """Coefficient k of the product of two series."""
    return sum(a[j] * b[k - j] for j in range(k + 1))


class Throw:
    def __init__(self, s, start):
        self.s, self.n, self.m, self.g, self.e = s, s.n_slices, s.water_mass / s.n_slices, s.gravity, s.restitution
        self.ice = s.frozen or s.r_max - s.r_min < 1e-12 * s.bottle.length
        self.M = s.water_mass + s.bottle.mass
        self.drag = s.drag / self.m
        self.ends = {1: s.r_max, -1: s.r_min}
        self.own = s.bottle.mass * (s.bottle.radius**2 / 2 + s.bottle.length**2 / 12)
        self.slow = 1e-5 * abs(s.omega0) * s.bottle.length
        self.weak = 1e-10 * s.omega0**2 * s.bottle.length  # a push so weak is none
        self.theta, self.r, self.v = s.theta0, np.array(start), np.zeros(self.n)
        self.rest = np.zeros(self.n, dtype=int)
        self.spin = 1.0
        self.spin = s.omega0 / self.series(0)["omega"][0]
        self.log = []
        self.settle()

    def series(self, order):
        """Coefficients of everything about now; what lies on an end keeps still."""
        s, n, m, K = self.s, self.n, self.m, order + 1
        r, v, x = np.zeros((K + 1, n)), np.zeros((K + 1, n)), np.zeros((K, n))
        theta, omega, omega2, J, c, d = (np.zeros(K + 1) for _ in range(6))
        sine, cosine, push = np.zeros(K), np.zeros(K), np.zeros((K, n))
        free = (self.rest == 0) & (not self.ice)
        r[0], v[0], theta[0] = self.r, self.v, self.theta
        for k in range(K):
            c[k] = (m * r[k].sum() + (s.bottle.mass * s.bottle.length / 2 if k == 0 else 0.0)) / self.M
            x[k] = r[k] - c[k]
            d[k] = (s.bottle.length / 2 if k == 0 else 0.0) - c[k]
            J[k] = (self.own if k == 0 else 0.0) + s.bottle.mass * cauchy(d, d, k)
            J[k] += m * np.einsum("ji,ji->", x[: k + 1], x[k::-1])
            omega[k] = ((self.spin if k == 0 else 0.0) - sum(J[j] * omega[k - j] for j in range(1, k + 1))) / J[0]
            omega2[k] = cauchy(omega, omega, k)
            if k == 0:
                sine[0], cosine[0] = np.sin(self.theta), np.cos(self.theta)
            else:
                turn = np.arange(1, k + 1) * theta[1 : k + 1]
                sine[k] = turn @ cosine[k - 1 :: -1] / k
                cosine[k] = -turn @ sine[k - 1 :: -1] / k
            centrifugal = omega2[: k + 1] @ x[k::-1]
            push[k] = centrifugal + self.g * cosine[k] - self.drag * (v[k] - m * v[k].sum() / self.M)
            theta[k + 1] = omega[k] / (k + 1)
            r[k + 1] = np.where(free, v[k] / (k + 1), 0.0)
            v[k + 1] = np.where(free, push[k] / (k + 1), 0.0)
        return {"r": r[:K], "v": v[:K], "theta": theta[:K], "omega": omega[:K], "c": c[:K], "J": J[:K], "push": push}

    def step_size(self, path):
        sizes = [np.inf]
        L, w = self.s.bottle.length, abs(path["omega"][0])
        for name, scale in (("r", L), ("v", w * L), ("theta", 1.0), ("omega", w)):
            for k in (ORDER - 1, ORDER):
                largest = np.abs(path[name][k]).max() / scale
                if largest > 0:
                    sizes.append((TOLERANCE / largest) ** (1 / k))
        return min(sizes)

    def settle(self):
        """What hardly moves at an end that it is pushed to stays there."""
        self.rest[:] = 0
        push = self.series(0)["push"][0]
        for end, place in self.ends.items():
            still = (self.r == place) & (np.abs(self.v) < self.slow) & (end * push > self.weak)
            self.rest[still], self.v[still] = end, 0.0

    def next_hit(self, path, h):
        """Time and end of the first impact in (0, h], the slices that make it, or None."""
        grid = h * np.arange(PARTS + 1) / PARTS
        r, v = (np.array([value(path[name], t) for t in grid]) for name in ("r", "v"))
        best = h, 0, None
        for end, place in self.ends.items():
            beyond = end * (r - place)
            turns = (end * v[:-1] > 0) & (end * v[1:] < 0)
            for i in np.flatnonzero((self.rest == 0) & ((beyond > 0).any(axis=0) | turns.any(axis=0))):
                gap = end * path["r"][:, i]
                gap[0] = end * (path["r"][0, i] - place)
                if gap[0] == 0.0:  # it starts on the end: that root is no impact
                    gap = gap[1:]
                for a, b, turning in zip(grid[:-1], grid[1:], turns[:, i]):
                    if turning and value(gap, b) <= 0:
                        b = root(-end * path["v"][:, i], a, b)
                    if value(gap, b) > 0:
                        at = root(gap, a, b)
                        if at < best[0]:
                            best = at, end, i
                        break
        return best

    def next_release(self, path, h):
        """First time in (0, h] at which a slice that rests is no longer pushed to its end."""
        held = np.flatnonzero(self.rest)
        for t in h * np.arange(1, PARTS + 1) / PARTS:
            away = [i for i in held if self.rest[i] * value(path["push"][:, i], t) < 0]
            if away:
                return min(root(-self.rest[i] * path["push"][:, i], t - h / PARTS, t) for i in away)
        return h

    def advance(self, path, h, now):
        """Follow the series for h or to the first event; return how far."""
        at, end, first = self.next_hit(path, h)
        release = self.next_release(path, at) if self.rest.any() else at
        if release < at:
            at, first = release, None
        self.r, self.v, self.theta = (value(path[name], at) for name in ("r", "v", "theta"))
        if first is not None:
            self.r[first] = self.ends[end]
            for i in np.flatnonzero((end * (self.r - self.ends[end]) > -1e-13) & (self.rest == 0)):
                self.r[i] = self.ends[end]
                if end * self.v[i] > 0:
                    self.log.append((now + at, i, end, end * self.v[i], self.e * end * self.v[i]))
                    self.v[i] *= -self.e
        if at < h:
            self.settle()
        return at


def solve(ask):
    throw, now = Throw(ask.scenario, ask.start), 0.0
    names = ("theta", "omega", "r", "v", "c", "J")
    rows = {name: [] for name in names}
    for when in ask.times:
        path, done = throw.series(ORDER), False
        while not done:
            h = min(throw.step_size(path), when - now)
            used = h
            if h > 0 and not throw.ice:
                used = throw.advance(path, h, now)
            elif h > 0:
                throw.theta = value(path["theta"], h)
            now, done = (when, True) if used == when - now else (now + used, False)
            path = throw.series(0 if done else ORDER)
        for name in names:
            rows[name].append(path[name][0])
    rows = {name: np.array(column) for name, column in rows.items()}
    fields = {"t": ask.times, "r_cm": rows.pop("c"), "inertia": rows.pop("J")}
    return fields | rows | {"impacts": [list(hit) for hit in throw.log]}


solve.name = "Taylor series"
solve.equation = "eq8"
solve.refined_by = None
solve.precision = "float64"
solve.order = None
