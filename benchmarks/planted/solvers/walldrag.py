"""The thrown bottle by equation (8), the drag of every slice being against the wall: r'' = g cos + w^2 (r - r_CM) - (alpha/m) r'.

Adaptive Dormand-Prince 5(4) steps. A step in which a slice reaches an end (or leaves a rest) is cut there: the time is found on a
quintic through r, r' and r'' at both ends of the step, and the step is taken again up to that time.
"""
import numpy as np

A = ((), (1 / 5,), (3 / 40, 9 / 40), (44 / 45, -56 / 15, 32 / 9), (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
     (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656), (35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84))
ERR = (71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)


class Tube:
    """The bottle with its slices; the state is y = (r_1..r_N, v_1..v_N, theta)."""

    def __init__(self, sc, start):
        bottle = sc.bottle
        self.n, self.e, self.g = sc.n_slices, sc.restitution, sc.gravity
        self.length, self.radius, self.shell = bottle.length, bottle.radius, bottle.mass
        self.m = sc.water_mass / self.n
        self.rate = sc.drag / self.m                                    # of the drag, 1/s
        self.eps = bottle.mass / (bottle.mass + sc.water_mass)
        height = sc.water_mass / bottle.capacity * bottle.length
        self.cap, self.base = height / (2 * self.n), bottle.length - height / (2 * self.n)
        self.pinned = sc.frozen or self.base - self.cap < 1e-12 * self.length
        if not self.pinned:
            start = np.clip(start, self.cap, self.base)
        self.momentum = self.inertia(start) * sc.omega0
        self.slow = 1e-4 * abs(sc.omega0) * self.length                 # slower bounces end in a rest
        self.scale = np.concatenate([np.full(self.n, self.length), np.full(self.n, abs(sc.omega0) * self.length), [1.0]])
        self.side = np.zeros(self.n)                                    # +1 rests on the base, -1 on the cap, 0 moves
        self.y = np.concatenate([start, np.zeros(self.n), [sc.theta0]])
        near = np.where(start > self.base - 1e-12 * self.length, 1.0, np.where(start < self.cap + 1e-12 * self.length, -1.0, 0.0))
        self.side = np.where(near * self.force(self.y) > 0, near, 0.0)

    def centre(self, r):
        return (1 - self.eps) * r.mean() + self.eps * self.length / 2

    def inertia(self, r):
        c = self.centre(r)
        shell = self.radius**2 / 2 + self.length**2 / 12 + (self.length / 2 - c) ** 2
        return self.m * np.sum((r - c) ** 2) + self.shell * shell

    def omega(self, y):
        return self.momentum / self.inertia(y[:self.n])

    def force(self, y):
        """Acceleration that each slice would have if it were free."""
        r, v = y[:self.n], y[self.n:-1]
        w = self.omega(y)
        return self.g * np.cos(y[-1]) + w**2 * (r - self.centre(r)) - self.rate * v

    def slope(self, y):
        out = np.empty_like(y)
        free = self.side == 0 if not self.pinned else np.zeros(self.n, bool)
        out[:self.n] = np.where(free, y[self.n:-1], 0.0)
        out[self.n:-1] = np.where(free, self.force(y), 0.0)
        out[-1] = self.omega(y)
        return out

    def step(self, y, k0, h):
        """One Dormand-Prince step: the new state, its slope, the error in units of the scale."""
        k = [k0]
        for row in A[1:]:
            stage = y + h * sum(a * s for a, s in zip(row, k) if a)
            k.append(self.slope(stage))
        error = h * sum(c * s for c, s in zip(ERR, k) if c)
        return stage, k[-1], np.max(np.abs(error) / self.scale)

    def event(self, y0, k0, y1, k1, h):
        """Earliest event of a step: (time after its start, mask of the slices, the end each of them meets)."""
        n = self.n
        when, end = np.full(n, np.inf), self.side.copy()
        if self.pinned:
            return np.inf, None, end
        held = self.side != 0
        if held.any():                                                  # let go when the acceleration turns inward
            p0, p1 = self.side * self.force(y0), self.side * self.force(y1)
            go = held & (p1 < 0)
            when[go] = h * np.clip(p0[go] / (p0[go] - p1[go]), 0, 1)
        for s, wall in ((1.0, self.base), (-1.0, self.cap)):
            d0, d1 = s * (y0[:n] - wall), s * (y1[:n] - wall)
            u0, u1 = s * h * y0[n:-1], s * h * y1[n:-1]
            touch = np.flatnonzero(~held & ((d1 > 0) | ((u0 > 0) & (u1 < 0) & (d0 + u0 > 0))))
            if not touch.size:
                continue
            a0, a1 = s * h * h * k0[n:-1][touch], s * h * h * k1[n:-1][touch]
            d0, d1, u0, u1 = d0[touch], d1[touch], u0[touch], u1[touch]
            c = np.array([6 * (d1 - d0) - 3 * (u0 + u1) - (a0 - a1) / 2,
                          -15 * (d1 - d0) + 8 * u0 + 7 * u1 + 1.5 * a0 - a1,
                          10 * (d1 - d0) - 6 * u0 - 4 * u1 - 1.5 * a0 + a1 / 2, a0 / 2, u0, d0])
            slope = c[:5] * np.array([5, 4, 3, 2, 1])[:, None]
            top = np.where(d1 > 0, 1.0, bisect(-slope, np.ones(len(d0))))   # a slice may go out and come back within a step
            out = np.polyval(c, top) > 0
            first = d0 >= 0                                             # starts at the wall: that is not the meeting looked for
            c[:, first] = np.vstack([np.zeros(first.sum()), c[:5, first]])
            x = bisect(c[:, out], top[out])
            when[touch[out]], end[touch[out]] = x * h, s
        tau = when.min()
        return tau, when <= tau + 1e-13 * h, end

    def happen(self, t, y, who, end, log):
        """Bounce the slices that met an end at time t, free those whose rest is over."""
        n, push = self.n, self.force(y)
        for i in np.flatnonzero(who):
            if self.side[i]:
                if self.side[i] * push[i] < 1e-9 * (self.g + self.scale[n] * abs(self.omega(y))):
                    self.side[i] = 0.0
                continue
            before = y[n + i]
            y[i], y[n + i] = (self.base if end[i] > 0 else self.cap), -self.e * before
            push_there = push[i] + self.rate * before                   # at the wall, standing still
            if abs(y[n + i]) < self.slow and end[i] * push_there > 0:
                y[n + i], self.side[i] = 0.0, end[i]
            log.append((t, i, end[i], before, y[n + i]))


def bisect(c, top):
    """Where the polynomials c, negative first, become positive below top."""
    low, high = np.zeros_like(top), top.copy()
    for _ in range(46):
        mid = (low + high) / 2
        up = np.polyval(c, mid) > 0
        low, high = np.where(up, low, mid), np.where(up, mid, high)
    return high


def solve(ask):
    sc, rtol = ask.scenario, ask.effort
    tube = Tube(sc, np.array(ask.start, float))
    y, t, log, rows = tube.y, 0.0, [], []
    k, h = tube.slope(y), 0.01 / (abs(sc.omega0) + tube.rate + 1 / sc.duration)
    for target in ask.times:
        while target - t > 1e-14 * sc.duration:
            step = min(h, target - t)
            if tube.side.any():                                         # do not step over a rest that ends and begins again
                step = min(step, 0.05 / abs(tube.omega(y)))
            y1, k1, error = tube.step(y, k, step)
            error = max(error / rtol, 1e-6)
            if error > 1:
                h = step * max(0.2, 0.9 * error**-0.2)
                continue
            tau, who, end = tube.event(y, k, y1, k1, step)
            if tau <= step:
                y, k, _ = tube.step(y, k, tau)
                t += tau
                tube.happen(t, y, who, end, log)
                k = tube.slope(y)
            else:
                y, k, t = y1, k1, t + step
                grown = step * min(5.0, 0.9 * error**-0.2)
                h = grown if step == h else max(h, grown)
        rows.append(y.copy())
    rows = np.array(rows)
    r, n = rows[:, :tube.n], tube.n
    return {"t": np.array(ask.times, float), "theta": rows[:, -1], "omega": np.array([tube.omega(y) for y in rows]), "r": r,
            "v": rows[:, n:-1], "r_cm": np.array([tube.centre(q) for q in r]), "inertia": np.array([tube.inertia(q) for q in r]),
            "impacts": np.array(log, float).reshape(-1, 5)}


solve.name = "walldrag: equation (8) with wall drag, Dormand-Prince, impacts located"
solve.equation = "eq8-wall"
solve.refined_by = "rtol"
