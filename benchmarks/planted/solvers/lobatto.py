"""Eq. 8 of the spinning bottle by Lobatto IIIA collocation with three stages (order 4).

Within a step omega, theta and C_M at the stages are iterated; with them fixed, Eq. 8 is linear and the same 4 x 4
system holds for every free slice.  Impacts and releases end a step; they are found by repeating it with other lengths.
"""
import numpy as np
from scipy.optimize import brentq

A = np.array([[0.0, 0.0, 0.0], [5 / 24, 1 / 3, -1 / 24], [1 / 6, 2 / 3, 1 / 6]])


class Throw:
    """The numbers of one throw, and the right-hand side of Eq. 8."""

    def __init__(self, ask):
        s, b = ask.scenario, ask.scenario.bottle
        self.m, self.total, self.mb, self.length = s.slice_mass, s.total_mass, b.mass, b.length
        self.own = b.mass * (b.radius**2 / 2 + b.length**2 / 12)
        self.g, self.d, self.e = s.gravity, s.drag / s.slice_mass, s.restitution
        self.lo, self.hi = s.r_min, s.r_max
        self.frozen = s.frozen or s.r_max - s.r_min < 1e-12 * b.length
        self.slow = 1e-5 * abs(s.omega0) * b.length
        self.tiny = 1e-13 * b.length
        self.momentum = self.inertia(ask.start) * s.omega0

    def centre(self, r):
        return (self.m * r.sum(axis=-1) + self.mb * self.length / 2) / self.total

    def inertia(self, r):
        c = self.centre(r)
        water = self.m * ((r - np.expand_dims(c, -1)) ** 2).sum(axis=-1)
        return water + self.own + self.mb * (self.length / 2 - c) ** 2

    def omega(self, r):
        return self.momentum / self.inertia(r)

    def common(self, theta, r, v):
        """The part of r'' that all slices share (omega^2 r_i and the drag on v_i are not in it)."""
        return -self.omega(r) ** 2 * self.centre(r) + self.d * self.m * v.sum(axis=-1) / self.total + self.g * np.cos(theta)

    def push(self, theta, r, v, rest):
        """Acceleration of the resting slices towards their end."""
        a = np.expand_dims(self.omega(r) ** 2, -1) * r + np.expand_dims(self.common(theta, r, v), -1)
        return rest * a


def collocate(p, state, rest, h):
    """The three stages (theta (3,), r (3, N), v (3, N)) of a step h, or None if the iteration fails."""
    theta0, r0, v0 = state
    free = (rest == 0) & (not p.frozen)
    theta, r, v = theta0 + np.array([0, 0.5, 1]) * h * p.omega(r0), np.tile(r0, (3, 1)), np.tile(v0, (3, 1))
    B, eye, last = h * A[1:, 1:], np.eye(2), np.inf
    for _ in range(80):
        omega, f = p.omega(r), p.common(theta, r, v)
        w = omega**2
        force0 = w[0] * r0 + f[0] - p.d * v0
        matrix = np.block([[eye, -B], [-B * w[1:], eye + p.d * B]])
        right = np.concatenate([r0 + h * A[1:, :1] * v0, v0 + h * A[1:, :1] * force0 + (B @ f[1:])[:, None]])
        new = np.linalg.solve(matrix, right)
        new_r = np.where(free, np.vstack([r0, new[:2]]), r0)
        new_v = np.where(free, np.vstack([v0, new[2:]]), 0.0)
        new_theta = theta0 + h * A @ omega
        change = np.abs(new_r - r).max() / p.length + np.abs(new_theta - theta).max()
        change += np.abs(new_v - v).max() / (p.length * (1 + abs(omega[0])))
        theta, r, v = new_theta, new_r, new_v
        if change < 1e-14 or (change < 1e-12 and change >= last):
            return theta, r, v
        last = change
    return None


def first_hit(p, stages, rest, h):
    """The share of the step after which the first free slice passes an end, its number and end; None if none does."""
    _, r, v = stages
    x = np.linspace(0, 1, 9)[:, None]
    b, c = (-3 * v[0] + 4 * v[1] - v[2]) / 2, (2 * v[0] - 4 * v[1] + 2 * v[2]) / 3
    path = r[0] + h * x * (v[0] + x * (b + x * c))  # its slope meets v at the stages
    best = None
    for end, wall in ((1, p.hi), (-1, p.lo)):
        for i in np.flatnonzero((rest == 0) & (end * (path - wall) > p.tiny).any(axis=0)):
            poly = [h * c[i], h * b[i], h * v[0, i], r[0, i] - wall]
            while len(poly) > 1 and abs(poly[-1]) < p.tiny:  # starts on the end: not this root again
                poly.pop()
            for root in np.roots(poly):
                leaves = end * (v[0, i] + 2 * b[i] * root.real + 3 * c[i] * root.real**2) > 0
                if abs(root.imag) < 1e-9 and 0 < root.real <= 1 and leaves and (best is None or root.real < best[0]):
                    best = root.real, i, end
    return best


def advance(p, state, rest, h):
    """Step h, or up to the first impact or release; returns the step made and the new state."""
    stages = collocate(p, state, rest, h) if h > 0 else None
    if stages is None:
        return advance(p, state, rest, h / 2)
    tau, hit = h, first_hit(p, stages, rest, h)
    if hit:
        tau, i, wall = hit[0] * h, hit[1], p.hi if hit[2] > 0 else p.lo
        for _ in range(8):  # Newton, each time with a step that ends at the guess
            stages = collocate(p, state, rest, tau)
            miss, speed = stages[1][2, i] - wall, stages[2][2, i]
            if abs(miss) < 1e-15 * p.length or speed == 0:
                break
            tau = min(max(tau - miss / speed, tau / 2), h)
        stages = collocate(p, state, rest, tau)
    held = np.flatnonzero(rest)
    if held.size and not p.frozen:
        def least(x):
            q = collocate(p, state, rest, x)
            return p.push(q[0][2], q[1][2], q[2][2], rest)[held].min()

        loose = p.push(*stages, rest)[:, held].min(axis=1) < 0
        if loose[1:].any():
            early, late = (0.0, tau / 2) if loose[1] else (tau / 2, tau)
            tau = min(brentq(least, early, late, xtol=1e-14) + 1e-13, late)
            stages = collocate(p, state, rest, tau)
    theta, r, v = stages
    return tau, (theta[2], r[2], v[2])


def touch(p, t, state, rest, impacts):
    """Rebounds, rests and releases at the time t."""
    theta, r, v = state
    r, v, before = r.copy(), v.copy(), v.copy()
    at = (r >= p.hi - 10 * p.tiny) * 1 - (r <= p.lo + 10 * p.tiny) * 1
    struck = (at * v > 0) & (rest == 0)
    v[struck] *= -p.e
    slow = (at != 0) & (np.abs(v) <= p.slow)
    pressed = p.push(theta, r, np.where(slow, 0, v), at) > 0
    stay = slow & pressed & (struck | (rest != 0) | (before == 0))
    v[stay] = 0
    r = np.where(struck | stay, np.where(at > 0, p.hi, p.lo), r)
    impacts += [(t, i, at[i], abs(before[i]), abs(v[i])) for i in np.flatnonzero(struck)]
    return (theta, r, v), np.where(stay, at, 0)


def solve(ask):
    p, t, impacts, rows = Throw(ask), 0.0, [], []
    state = ask.scenario.theta0, np.array(ask.start, dtype=float), np.zeros(len(ask.start))
    rest = np.zeros(len(ask.start), dtype=int)
    if not p.frozen:
        state, rest = touch(p, t, state, rest, impacts)
    for when in ask.times:
        steps = int(np.ceil((when - t) / ask.effort - 1e-9))
        grid = np.linspace(t, when, steps + 1)[1:]
        for goal in grid:
            while t < goal:
                made, state = advance(p, state, rest, goal - t)
                t = goal if made >= goal - t else t + made
                if not p.frozen:
                    state, rest = touch(p, t, state, rest, impacts)
        theta, r, v = state
        rows.append((theta, p.omega(r), r, v, p.centre(r), p.inertia(r)))
    names = ("theta", "omega", "r", "v", "r_cm", "inertia")
    answer = {name: np.array(column) for name, column in zip(names, zip(*rows))}
    return {"t": ask.times, **answer, "impacts": impacts}


solve.name = "Eq. 8, Lobatto IIIA"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 4
solve.timeout = 600
