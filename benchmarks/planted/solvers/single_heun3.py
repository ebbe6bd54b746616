"""Eq. 8: Heun's third-order steps in float32, with its rounding carried along, the angle in double; declares dt, order 3, float32."""

import math

import numpy as np

F = np.float32


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n = throw.n_slices
    half, unit = bottle.length / 2, F(bottle.length)
    wall = F((half - throw.slice_height / 2) / bottle.length)  # lengths are shares of the bottle's
    share = F(throw.slice_mass / throw.total_mass)
    own = F(bottle.mass / throw.total_mass * ((bottle.radius / bottle.length) ** 2 / 2 + 1 / 12))
    g, e, k = F(throw.gravity / bottle.length), F(throw.restitution), F(throw.drag / throw.slice_mass)
    ice = throw.frozen or wall <= 0

    def inertia(x):
        return own + share * (x @ x) - (share * x.sum()) ** 2

    def rates(theta, x, v):
        omega = momentum / inertia(x)
        a = omega * omega * (x - share * x.sum()) + g * F(math.cos(theta)) - k * (v - share * v.sum())
        return omega, a

    theta, x, v = throw.theta0, ((ask.start - half) / bottle.length).astype(F), np.zeros(n, F)
    x = np.clip(x, -wall, wall)
    momentum = inertia(x) * F(throw.omega0)
    lost_x, lost_v = np.zeros(n, F), np.zeros(n, F)
    t, rows = 0.0, []
    for when in ask.times:
        count = math.ceil((when - t) / ask.effort - 1e-9)
        for _ in range(count):
            h = F((when - t) / count)
            w1, a1 = rates(theta, x, v)
            side = np.where(x >= wall, F(1), np.where(x <= -wall, F(-1), F(0)))
            go = ~((side != 0) & (side * v >= 0) & (side * a1 >= 0)) & (not ice)
            one = go.astype(F)
            v = v * one
            v1, a1 = v, a1 * one
            v2 = v + h / F(3) * a1
            w2, a2 = rates(theta + float(h / F(3) * w1), x + h / F(3) * v1, v2)
            a2 = a2 * one
            v3 = v + F(2) * h / F(3) * a2
            w3, a3 = rates(theta + float(F(2) * h / F(3) * w2), x + F(2) * h / F(3) * v2, v3)
            a3 = a3 * one
            theta += float(h / F(4) * (w1 + F(3) * w3))
            dx, dv = h / F(4) * (v1 + F(3) * v3) * one - lost_x * one, h / F(4) * (a1 + F(3) * a3) - lost_v * one
            new_x, new_v = x + dx, v + dv
            lost_x, lost_v = ((new_x - x) - dx) * one, ((new_v - v) - dv) * one
            old, x, v = (x, v), new_x, new_v
            for i in np.flatnonzero(go & (np.abs(x) > wall) & (x * v > 0)):
                s = F(math.copysign(1.0, x[i]))
                gap, speed, pull = s * x[i] - wall, s * v[i], s * a3[i]
                disc = speed * speed - F(2) * pull * gap
                since = F(2) * gap / (speed + F(math.sqrt(disc))) if disc > 0 else gap / speed
                since = min(since, h)
                hit = speed - pull * since
                after = -e * hit
                pull = pull + k * (F(1) - share) * (hit - after)  # the drag turns round with the speed
                back, end = after * since + pull * since * since / F(2), after + pull * since
                if back >= 0 or abs(after) < abs(pull) * h:
                    back = end = F(0)
                x[i], v[i] = s * (wall + back), s * end
                lost_x[i] = lost_v[i] = F(0)
        t = when
        rows.append((theta, float(momentum / inertia(x)), half + unit * x, unit * v))
    theta, omega, r, v = (np.array(column) for column in zip(*rows))
    return {"t": ask.times, "theta": theta, "omega": omega, "r": r, "v": v}


solve.name = "Heun 3 in single precision"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 3
solve.precision = "float32"
