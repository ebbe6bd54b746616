"""Eq. 8: symplectic splitting (drift, kick with exact drag, drift), rebounds inside the drift; bare theta and omega; declares steps, order 2."""

import math

import numpy as np


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n, m, half = throw.n_slices, throw.slice_mass, bottle.length / 2
    share = m / throw.total_mass
    wall = half - throw.slice_height / 2
    own = (bottle.radius**2 / 2 + bottle.length**2 / 12) * bottle.mass / throw.total_mass
    rate, e = throw.drag / m, throw.restitution
    ice = throw.frozen or wall < 1e-12 * half

    def inertia(x):  # over the whole mass, x from the middle of the bottle
        return own + share * (x @ x) - (share * x.sum()) ** 2

    def push(theta, x):
        omega = momentum / inertia(x)
        return omega * omega * (x - share * x.sum()) + throw.gravity * math.cos(theta)

    def kick(u, a, h):
        """u' = a - rate (u - share sum u) exactly, for constant a; resting slices have neither."""
        if rate == 0.0:
            return u + h * a
        k = len(u)
        mean, mean_a = u.mean(), a.mean()
        slow = rate * (1.0 - k * share)
        grow = math.exp(-rate * h)
        new_mean = mean * math.exp(-slow * h) - mean_a * math.expm1(-slow * h) / slow
        return new_mean + (u - mean) * grow - (a - mean_a) * math.expm1(-rate * h) / rate

    theta, x, v = throw.theta0, ask.start - half, np.zeros(n)
    x = np.clip(x, -wall, wall)
    momentum = inertia(x) * throw.omega0
    t, rows = 0.0, []
    for when in ask.times:
        count = math.ceil((when - t) * ask.effort / throw.duration - 1e-9)
        for _ in range(count):
            h = (when - t) / count
            if ice:
                theta += h * momentum / inertia(x)
                continue
            a = push(theta, x) - rate * (v - share * v.sum())
            side = np.where(x >= wall, 1.0, np.where(x <= -wall, -1.0, 0.0))
            go = ~((side != 0) & (side * v >= 0) & (side * a >= 0))
            v[~go] = 0.0
            theta += h / 2 * momentum / inertia(x)
            x[go] += h / 2 * v[go]
            f = push(theta, np.clip(x, -wall, wall))
            if go.any():
                v[go] = kick(v[go], f[go], h)
            x[go] += h / 2 * v[go]
            a = f - rate * (v - share * v.sum())
            for i in np.flatnonzero(go & (np.abs(x) > wall) & (x * v > 0)):
                s = math.copysign(1.0, x[i])
                # the parabola through the end of the step, back to the wall
                gap, speed, pull = s * x[i] - wall, s * v[i], s * a[i]
                disc = speed * speed - 2 * pull * gap
                since = 2 * gap / (speed + math.sqrt(disc)) if disc > 0 else gap / speed
                since = min(since, h)
                hit = speed - pull * since
                after = -e * hit
                pull += rate * (1.0 - share) * (hit - after)  # the drag turns round with the speed
                back, end = after * since + pull * since**2 / 2, after + pull * since
                if back >= 0.0 or abs(after) < abs(pull) * h:
                    back, end = 0.0, 0.0
                x[i], v[i] = s * (wall + back), s * end
            theta += h / 2 * momentum / inertia(np.clip(x, -wall, wall))
        t = when
        rows.append((theta, momentum / inertia(x)))
    theta, omega = np.array(rows).T
    return {"t": ask.times, "theta": theta, "omega": omega}


solve.name = "Strang splitting, bare"
solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 2
