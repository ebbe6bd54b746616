"""The scheme of the paper with its two sign errors mended, made second order: within a step omega, theta and r_CM are held at their
mid-step values, and then the motion of a slice is known in closed form (two exponentials). Impacts are found on that closed form."""
from math import cosh, exp, sinh
import numpy as np
from scipy.optimize import brentq


class Bottle:
    """Numbers of one throw."""

    def __init__(self, sc):
        b = sc.bottle
        self.n = sc.n_slices
        self.m = sc.water_mass / sc.n_slices
        self.gamma = sc.drag / (2 * self.m)
        self.eps = b.mass / (b.mass + sc.water_mass)
        self.length, self.g, self.e = b.length, sc.gravity, sc.restitution
        half = sc.water_mass / b.capacity * b.length / sc.n_slices / 2
        self.walls = {-1: half, 1: b.length - half}
        self.shell, self.own = b.mass, b.mass * (b.radius**2 / 2 + b.length**2 / 12)
        self.still = sc.frozen or self.walls[1] - self.walls[-1] < 1e-12 * b.length
        self.slow = 2e-5 * abs(sc.omega0) * b.length

    def centre(self, r):
        return (1 - self.eps) * np.mean(r) + self.eps * self.length / 2

    def inertia(self, r):
        c = self.centre(r)
        water = self.m * np.sum((r - c) ** 2)
        return water + self.own + self.shell * (self.length / 2 - c) ** 2

    def field(self, r, theta):
        """Angular velocity, and the point on the axis where a slice feels nothing."""
        omega = self.momentum / self.inertia(r)
        return omega, self.centre(r) - self.g * np.cos(theta) / omega**2


def glide(x, v, omega, gamma, tau):
    """Distance from the neutral point and velocity after tau."""
    fade, ch, sh = exp(-gamma * tau), cosh(omega * tau), sinh(omega * tau) / omega
    return fade * (x * ch + (v + gamma * x) * sh), fade * (v * ch + ((omega**2 - gamma**2) * x - gamma * v) * sh)


def first_meeting(b, x, v, omega, neutral, tau):
    """(time, side) of the first meeting with an end within tau, or None. The velocity has at most one zero."""
    def gap(s, side):
        return side * (glide(x, v, omega, b.gamma, s)[0] + neutral - b.walls[side])

    def speed(s):
        return glide(x, v, omega, b.gamma, s)[1]

    found = []
    turns = v != 0 and speed(tau) * v < 0
    turn = brentq(speed, 0.0, tau) if turns else 0.0
    for side in (-1, 1):
        if v * side > 0:                        # goes to this end at first: the farthest point is the turn or the end of the step
            far = turn if turns else tau
            if gap(far, side) > 0:
                found.append((brentq(gap, 0.0, far, args=(side,)) if gap(0.0, side) < 0 else 0.0, side))
        elif gap(tau, side) > 0:                # goes away, then comes to it
            found.append((brentq(gap, turn, tau, args=(side,)) if gap(turn, side) < 0 else turn, side))
    return min(found) if found else None


def bounce(b, i, r, v, omega, neutral, tau, t, log):
    """A slice through a stretch of time in which it may meet the ends; returns r, v and the end on which it rests (0: none)."""
    while True:
        hit = first_meeting(b, r - neutral, v, omega, neutral, tau)
        if hit is None:
            x, v = glide(r - neutral, v, omega, b.gamma, tau)
            return x + neutral, v, 0
        s, side = hit
        before = glide(r - neutral, v, omega, b.gamma, s)[1]
        r, v, tau, t = b.walls[side], -b.e * before, tau - s, t + s
        pressed = side * (omega**2 - b.gamma**2) * (r - neutral) > 0
        if abs(v) < b.slow:
            v = 0.0
        if log is not None:
            log.append((t, i, side, before, v))
        if v == 0 and pressed or tau <= 0:
            return r, v, side if v == 0 else 0


def flow(b, r, v, rest, omega, neutral, tau, t=0.0, log=None):
    """All slices through tau with omega and the neutral point fixed."""
    if b.still:
        return r, v, rest
    force = (omega**2 - b.gamma**2) * (r - neutral)
    held = (rest != 0) & (rest * force > 0)                             # pressed against its end
    x, w = glide(r - neutral, v, omega, b.gamma, tau)
    new_r, new_v, new_rest = np.where(held, r, x + neutral), np.where(held, 0.0, w), np.where(held, rest, 0)
    low, high = b.walls[-1], b.walls[1]
    back = (v * w < 0) & ((r + v * tau > high) | (r + v * tau < low))
    for i in np.flatnonzero(~held & ((new_r > high) | (new_r < low) | back)):
        new_r[i], new_v[i], new_rest[i] = bounce(b, i, float(r[i]), float(v[i]), omega, neutral, tau, t, log)
    return new_r, new_v, new_rest


def advance(b, state, h, t=0.0, log=None):
    """One step of the midpoint rule."""
    r, v, rest, theta = state
    omega, neutral = b.field(r, theta)
    middle = flow(b, r, v, rest, omega, neutral, h / 2)
    omega, neutral = b.field(middle[0], theta + omega * h / 2)
    return (*flow(b, r, v, rest, omega, neutral, h, t, log), theta + h * omega)


def solve(ask):
    sc = ask.scenario
    b = Bottle(sc)
    r = np.array(ask.start, float)
    if not b.still:
        r = np.clip(r, b.walls[-1], b.walls[1])
    b.momentum = b.inertia(r) * sc.omega0
    rest = np.where(r >= b.walls[1] - 1e-12 * b.length, 1, np.where(r <= b.walls[-1] + 1e-12 * b.length, -1, 0))
    state = (r, np.zeros(b.n), rest, sc.theta0)
    steps = max(1, int(np.ceil(sc.duration / ask.effort - 1e-9)))
    h = sc.duration / steps
    due = np.minimum((np.asarray(ask.times) / h).astype(int), steps - 1)    # the step in which each answer lies
    log, rows = [], []
    for k in range(due[-1] + 1):
        for p in np.flatnonzero(due == k):
            part = ask.times[p] - k * h
            rows.append(advance(b, state, part) if part > 0 else state)
        state = advance(b, state, h, k * h, log)
    r = np.array([row[0] for row in rows])
    inertia = np.array([b.inertia(q) for q in r])
    log = [row for row in log if row[0] <= ask.times[-1]]
    return {"t": np.array(ask.times, float), "theta": np.array([row[3] for row in rows]), "omega": b.momentum / inertia, "r": r,
            "v": np.array([row[1] for row in rows]), "r_cm": np.array([b.centre(q) for q in r]), "inertia": inertia,
            "impacts": np.array(log, float).reshape(-1, 5)}


solve.name = "limiter: closed form within steps, midpoint rule, signs mended"
solve.equation = "signs-limit"
solve.refined_by = "dt"
solve.order = 2
