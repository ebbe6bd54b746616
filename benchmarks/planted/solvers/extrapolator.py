"""Free flight by Gragg-Bulirsch-Stoer extrapolation, with its own step and number of columns."""
import numpy as np
COUNTS = (2, 4, 6, 8, 10, 12, 14)  # substeps of the modified midpoint rule
NEAR, SLOW = 1e-11, 1e-3  # m: touching an end; m/s: what rebounds no faster stays

def extrapolate(f, y, h, scale, rtol):
    """Return the state after h, its estimated error over the tolerance, and the number of columns used."""
    f0, row, error = f(y), [], np.inf
    for j, n in enumerate(COUNTS):
        d, a, b = h / n, y, y + h / n * f0
        for _ in range(n - 1):
            a, b = b, a + 2 * d * f(b)
        new = [(a + b + d * f(b)) / 2]
        for k, old in enumerate(row):
            new.append(new[k] + (new[k] - old) / ((n / COUNTS[j - k - 1]) ** 2 - 1))
        if j > 0:
            error = float(np.max(np.abs(new[-1] - new[-2]) / scale)) / rtol
        if error < 1:
            break
        row = new
    return new[-1], error, j

def crossing(g0, d0, g1, d1):
    # first rising zero in (0, 1] of the cubic with these end values and slopes
    c3, c2 = 2 * (g0 - g1) + d0 + d1, 3 * (g1 - g0) - 2 * d0 - d1
    x = np.roots([c3, c2, d0] if g0 == 0 else [c3, c2, d0, g0])
    x = x.real[(abs(x.imag) < 1e-9) & (x.real > 0) & (x.real <= 1)]
    x = x[3 * c3 * x**2 + 2 * c2 * x + d0 > 0]
    return x.min() if x.size else (1.0 if g1 > 0 else None)

class Throw:
    def __init__(self, s, start, rtol):
        b = s.bottle
        self.n, self.m, self.mb, self.e, self.drag = s.n_slices, s.slice_mass, b.mass, s.restitution, s.drag
        self.mid, self.shell = b.length / 2, b.mass * (b.radius**2 / 2 + b.length**2 / 12)
        self.reach = (b.length - s.slice_height) / 2
        self.end = {1: self.mid + self.reach, -1: self.mid - self.reach}
        self.t, self.y, self.hits = 0.0, np.concatenate(([s.theta0], start, np.zeros(self.n))), []
        scale = np.repeat([1.0, b.length, b.length * abs(s.omega0)], [1, self.n, self.n])
        self.step = lambda h: extrapolate(self.slope, self.y, h, scale, rtol)
        self.spin = self.inertia(start)[0] * s.omega0
        self.h = 0.05 / abs(s.omega0)
        self.settle(self.touched())

    def inertia(self, r):
        c = (self.m * r.sum() + self.mb * self.mid) / (self.mb + self.m * self.n)
        return self.shell + self.m * ((r - c) ** 2).sum() + self.mb * (self.mid - c) ** 2, c

    def bind(self, at):  # slices with at = 1 (base) or -1 (cap) belong to the tube
        self.at, self.loose = at, at == 0
        self.mass = self.mb + self.m * np.abs(at).sum()
        self.centre = self.mid + self.m * self.reach * at.sum() / self.mass

    def pull(self, y):
        r, v = y[1 : self.n + 1], y[self.n + 1 :]
        omega = self.spin / self.inertia(r)[0]
        return omega, omega**2 * (r - self.centre) - self.drag * (v / self.m + v.sum() / self.mass)

    def slope(self, y):
        omega, a = self.pull(y)
        return np.concatenate(([omega], y[self.n + 1 :] * self.loose, a * self.loose))

    def touched(self):
        r = self.y[1 : self.n + 1]
        return (r > self.end[1] - NEAR).astype(int) - (r < self.end[-1] + NEAR)

    def settle(self, side):
        r, v = self.y[1 : self.n + 1], self.y[self.n + 1 :]
        r[side == 1], r[side == -1] = self.end[1], self.end[-1]
        rests, leaves, old = (side != 0) & (abs(v) < SLOW), True, v.copy()
        while np.any(leaves):
            v[:] = np.where(rests, 0.0, old)
            self.bind(np.where(rests, side, 0))
            leaves = rests & (side * self.pull(self.y)[1] <= -1e-7)
            rests = rests & ~leaves
        v[~rests] -= self.m * old[rests].sum() / self.mass  # the tube takes over what they had

    def strike(self):
        side, v = self.touched(), self.y[self.n + 1 :]
        i = np.flatnonzero((side != 0) & (side * v >= 0))
        before, total, last = v[i].copy(), 0.0, None  # one joint impulse of all that push the tube
        while total != last:
            active = side[i] * ((1 + self.e) * before - total / self.mb) > 0
            last, total = total, (1 + self.e) * before[active].sum() / (1 / self.m + active.sum() / self.mb)
        v -= total / self.mb
        v[i[active]] = -self.e * before[active]
        self.hits += [(self.t, k, side[k], abs(u), abs(v[k])) for k, u in zip(i, before) if u != 0]
        self.settle(side)

    def first_hit(self, y1, h):
        r0, v0, r1, v1 = (y[p : p + self.n] for y in (self.y, y1) for p in (1, self.n + 1))
        found = []  # fraction of the step, slice, side
        for s, end in self.end.items():
            g0, g1 = s * (r0 - end), s * (r1 - end)
            for i in np.flatnonzero(self.loose & ((g1 > 0) | ((s * v0 > 0) & (s * v1 < 0)))):
                x = crossing(g0[i], s * h * v0[i], g1[i], s * h * v1[i])
                found += [(x, i, s)] if x is not None else []
        return min(found, default=None)

    def push(self, y):
        return (self.at * self.pull(y)[1])[~self.loose].min(initial=np.inf)

    def advance(self, limit):
        h, error = 2 * min(self.h, limit, 0.3 / abs(self.pull(self.y)[0])), np.inf
        while error > 1:
            h = h / 2
            y, error, j = self.step(h)
        self.h = h * min(5.0, 0.9 * max(error, 1e-9) ** (-1 / (2 * j + 1)))
        if hit := self.first_hit(y, h):
            top, h, (_, i, s) = h, hit[0] * h, hit
            for _ in range(5):
                y = self.step(h)[0]
                gap, speed = s * (y[1 + i] - self.end[s]), s * y[1 + self.n + i]
                if abs(gap) < 1e-14 or speed <= 0:
                    break
                h = min(max(h - gap / speed, 0.0), top)
        if release := self.push(y) < -1e-7:
            low = 0.0
            while h - low > 1e-12:
                half = (low + h) / 2
                low, h = (half, h) if self.push(self.step(half)[0]) > 0 else (low, half)
            y = self.step(h)[0]
            self.bind(np.where(self.at * self.pull(y)[1] < 1e-6, 0, self.at))
        self.t, self.y = self.t + h, y
        if hit and not release:
            self.strike()

def solve(ask):
    s, n, rows, throw = ask.scenario, ask.scenario.n_slices, [], Throw(ask.scenario, ask.start, ask.effort)
    for when in ask.times:
        while not s.frozen and when - throw.t > 1e-13:
            throw.advance(when - throw.t)
        rows.append(throw.y.copy())
    rows = np.array(rows)
    theta, r, v = rows[:, 0] + (s.omega0 * ask.times if s.frozen else 0.0), rows[:, 1 : n + 1], rows[:, n + 1 :]
    inertia, r_cm = np.array([throw.inertia(x) for x in r]).T
    known = dict(t=ask.times, theta=theta, omega=throw.spin / inertia, r=r, v=v, r_cm=r_cm, inertia=inertia)
    return known | {"impacts": throw.hits}

vars(solve).update(name="Gragg-Bulirsch-Stoer, free flight", equation="free-flight", refined_by="rtol")
