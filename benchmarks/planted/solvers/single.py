"""The midpoint rule in single precision; the angle alone is summed in double, for it grows."""

import math

import numpy as np

F = np.float32


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n = throw.n_slices
    half, e, g, k = F(bottle.length / 2), F(throw.restitution), F(throw.gravity), F(throw.drag / throw.slice_mass)
    # places count from the middle of the bottle, where single precision has its digits
    wall = F(bottle.length / 2 - throw.slice_height / 2)
    share = F(throw.slice_mass / throw.total_mass)
    own = F(bottle.mass / throw.total_mass * (bottle.radius**2 / 2 + bottle.length**2 / 12))

    def inertia(x):
        c = share * x.sum(dtype=F)
        return own + share * ((x - c) ** 2).sum(dtype=F) + (F(1) - F(n) * share) * c * c

    def rates(theta, x, v):
        omega = momentum / inertia(x)
        drift = v - share * v.sum(dtype=F)
        return omega, omega * omega * (x - share * x.sum(dtype=F)) + g * F(math.cos(theta)) - k * drift

    theta, x, v = throw.theta0, (ask.start - bottle.length / 2).astype(F), np.zeros(n, F)
    x = np.clip(x, -wall, wall)
    momentum = inertia(x) * F(throw.omega0)
    t, rows = 0.0, []
    for when in ask.times:
        count = math.ceil((when - t) / ask.effort - 1e-9)
        for _ in range(count):
            h = F((when - t) / count)
            turn, push = rates(theta, x, v)
            side = np.where(x >= wall, F(1), np.where(x <= -wall, F(-1), F(0)))
            move = (side == 0) | (side * v < 0) | (side * push <= 0)
            move &= not throw.frozen
            v = np.where(move, v, F(0))
            push = np.where(move, push, F(0))
            middle = v + h / F(2) * push
            turn, push = rates(theta + float(h / F(2) * turn), x + h / F(2) * v, middle)
            push = np.where(move, push, F(0))
            theta, x, v = theta + float(h * turn), np.where(move, x + h * middle, x), v + h * push
            side = np.sign(x)
            hit = (side * x > wall) & (side * v > 0)
            since = np.where(hit, (x - side * wall) / np.where(hit, v, F(1)), F(0))
            after = -e * v + (F(1) + e) * push * since
            after = np.where(np.abs(after) < np.abs(push) * h, F(0), after)
            x, v = np.where(hit, side * wall + after * since, x), np.where(hit, after, v)
        t = when
        rows.append((theta, momentum / inertia(x), half + x, v))
    theta, omega, r, v = (np.array(column) for column in zip(*rows))
    return {"t": ask.times, "theta": theta, "omega": omega, "r": r, "v": v}


solve.name = "midpoint rule in single precision"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 2
solve.precision = "float32"
