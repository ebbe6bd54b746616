"""Eq. 8 on a uniform grid of `steps` steps: in each step omega, theta, centre and mean velocity are frozen at a predicted
mid-step and every slice moves by the exact solution of its linear equation

    r'' = omega^2 (r - c) + g cos(theta) - 2 gamma (v - v_c),        2 gamma = alpha / m .

A slice found past an end at a grid point is mirrored there with restitution. No impact is located. Positions of single
slices are not reported; the answers between grid points are interpolated.
"""
import numpy as np


class Water:
    def __init__(self, throw, start):
        bottle = throw.bottle
        self.n = throw.n_slices
        self.m = throw.water_mass / self.n
        self.mb = bottle.mass
        self.total = self.mb + self.n * self.m
        self.half = bottle.length / 2
        thickness = bottle.length * throw.water_mass / (bottle.capacity * self.n)
        self.reach = self.half - thickness / 2  # of a slice from the middle of the bottle
        self.own = self.mb * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.gamma = throw.drag / (2 * self.m)
        self.g = throw.gravity
        self.e = throw.restitution
        self.spin = self.inertia(np.array(start) - self.half) * throw.omega0

    def centre(self, y):
        """Centre of mass of bottle and water, from the middle of the bottle."""
        return self.m * y.sum() / self.total

    def inertia(self, y):
        c = self.centre(y)
        return self.own + self.m * (y * y).sum() - self.total * c * c

    def frozen(self, y, v, theta):
        """What is held constant over a step: omega, and the force of a slice at y = 0 per mass."""
        omega = self.spin / self.inertia(y)
        v_c = self.m * v.sum() / self.total
        push = self.g * np.cos(theta) + 2 * self.gamma * v_c - omega**2 * self.centre(y)
        return omega, push

    def move(self, y, v, omega, push, h):
        """Exact motion over h from (y, v): y + v b + f q with the response b to a kick and q to a steady force."""
        k = np.sqrt(omega**2 + self.gamma**2)
        fast = k + self.gamma
        slow = omega**2 / fast
        grow, fade = np.exp(slow * h), np.exp(-fast * h)
        b = (grow - fade) / (2 * k)
        b_dot = (slow * grow + fast * fade) / (2 * k)
        q = (np.expm1(slow * h) / slow + np.expm1(-fast * h) / fast) / (2 * k)
        f = push + omega**2 * y
        return y + v * b + f * q, v * b_dot + f * b, f

    def rebound(self, y, v, f, lying, h):
        """Mirror what is past an end; what lies there, or is too slow to leave for longer than a step, stays."""
        side = np.where(y > self.reach, 1.0, np.where(y < -self.reach, -1.0, 0.0))
        out = side != 0
        excess = y - side * self.reach
        stays = out & (lying | (self.e * np.abs(v) <= side * f * h))
        y = np.where(out, side * self.reach - self.e * excess, y)
        v = np.where(out & (side * v > 0), -self.e * v, v)
        y[stays] = (side * self.reach)[stays]
        v[stays] = 0.0
        return y, v

    def step(self, y, v, theta, h):
        lying = (np.abs(y) >= self.reach * (1 - 1e-12)) & (v == 0.0)
        omega, push = self.frozen(y, v, theta)
        y_mid, v_mid, _ = self.move(y, v, omega, push, h / 2)
        theta_mid = theta + omega * h / 2
        caught = np.abs(y_mid) > self.reach
        y_mid = np.clip(y_mid, -self.reach, self.reach)
        v_mid[caught & lying] = 0.0
        omega, push = self.frozen(y_mid, v_mid, theta_mid)
        y, v, f = self.move(y, v, omega, push, h)
        y, v = self.rebound(y, v, f, lying, h)
        return y, v, theta + omega * h


def hermite(t, grid, values, slopes):
    """Cubic through the values with these slopes."""
    k = np.clip(np.searchsorted(grid, t, side="right") - 1, 0, len(grid) - 2)
    h = grid[k + 1] - grid[k]
    s = (t - grid[k]) / h
    left = (1 + 2 * s) * (1 - s) ** 2 * values[k] + s * (1 - s) ** 2 * h * slopes[k]
    right = s * s * (3 - 2 * s) * values[k + 1] - s * s * (1 - s) * h * slopes[k + 1]
    return left + right


def solve(ask):
    throw = ask.scenario
    water = Water(throw, ask.start)
    steps = max(int(round(ask.effort)), 1)
    h = throw.duration / steps
    grid = np.linspace(0.0, throw.duration, steps + 1)
    y = np.array(ask.start, dtype=float) - water.half
    v = np.zeros(water.n)
    theta = np.empty(steps + 1)
    inertia = np.empty(steps + 1)
    centre = np.empty(steps + 1)
    theta[0], inertia[0], centre[0] = throw.theta0, water.inertia(y), water.centre(y)
    for k in range(1, steps + 1):
        if throw.frozen or water.reach <= 0.0:
            theta[k] = theta[k - 1] + throw.omega0 * h
        else:
            y, v, theta[k] = water.step(y, v, theta[k - 1], h)
        inertia[k], centre[k] = water.inertia(y), water.centre(y)
    inertia_then = np.interp(ask.times, grid, inertia)
    return {
        "t": ask.times,
        "theta": hermite(ask.times, grid, theta, water.spin / inertia),
        "omega": water.spin / inertia_then,
        "r_cm": np.interp(ask.times, grid, centre) + water.half,
        "inertia": inertia_then,
    }


solve.name = "exact step, coefficients of the mid-step, rebounds on the grid"
solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 2
solve.precision = "float64"
