"""Eq. 8: scipy's Radau with event functions for ends and supports, restarted after each; declares rtol."""

import math

import numpy as np
from scipy.integrate import solve_ivp


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n, m, length, total = throw.n_slices, throw.slice_mass, bottle.length, throw.total_mass
    low, high = throw.r_min, throw.r_max
    rtol = max(ask.effort, 1e-12)
    slow = 1e-5 * length * max(abs(throw.omega0), math.sqrt(throw.gravity / length))
    own = bottle.mass * (bottle.radius**2 / 2 + length**2 / 12)
    ice = throw.frozen or high - low < 1e-12 * length

    def inertia(r):
        c = (m * r.sum() + bottle.mass * length / 2) / total
        return own + m * ((r - c) ** 2).sum() + bottle.mass * (length / 2 - c) ** 2

    def force(y):
        r, v = y[1 : n + 1], y[n + 1 :]
        omega = momentum / inertia(r)
        c = (m * r.sum() + bottle.mass * length / 2) / total
        return omega, omega**2 * (r - c) + throw.gravity * math.cos(y[0]) - throw.drag / m * (v - m * v.sum() / total)

    momentum = inertia(ask.start) * throw.omega0
    if ice:
        theta = throw.theta0 + throw.omega0 * ask.times
        still = np.tile(ask.start, (len(ask.times), 1))
        return {"t": ask.times, "theta": theta, "omega": np.full(len(theta), throw.omega0), "r": still, "v": 0 * still}

    def settle(y):
        r, v = y[1 : n + 1], y[n + 1 :]
        side = np.where(r > high - 1e-9 * length, 1.0, np.where(r < low + 1e-9 * length, -1.0, 0.0))
        r[side > 0], r[side < 0] = high, low
        v[side * v > 0] *= -throw.restitution
        rest = (side != 0) & (np.abs(v) < slow) & (side * force(y)[1] > 0)
        v[rest] = 0.0
        return side * rest

    y = np.concatenate([[throw.theta0], ask.start, np.zeros(n)])
    rest = settle(y)
    t, rows = 0.0, []
    for when in ask.times:
        while when - t > 1e-13:
            free = rest == 0

            def slope(_, z):
                omega, a = force(z)
                return np.concatenate([[omega], free * z[n + 1 :], free * a])

            def ends(_, z):
                r, v = z[1 : n + 1][free], z[n + 1 :][free]
                # a slice that has just left an end counts as inside as long as it moves away from it
                room = np.where(v > 0, high - r, np.where(v < 0, r - low, np.minimum(high - r, r - low)))
                return float(np.maximum(room, -1.0).min()) + 1e-13 if free.any() else 1.0

            def supports(_, z):
                return float((rest * force(z)[1])[~free].min()) if not free.all() else 1.0

            ends.terminal = supports.terminal = True
            ends.direction = supports.direction = -1
            step = min(0.15 / abs(throw.omega0), throw.duration / 10)
            run = solve_ivp(slope, (t, when), y, "Radau", rtol=rtol, atol=rtol * 1e-2, events=(ends, supports), max_step=step)
            if run.status < 0:
                raise RuntimeError(run.message)
            moved = run.t[-1] > t
            t, y = run.t[-1], run.y[:, -1].copy()
            if run.status == 1 or not moved:
                gone = rest * force(y)[1] <= 1e-9 * slow * abs(throw.omega0)
                lost = (rest != 0) & gone
                rest = settle(y)
                rest[lost] = 0.0
        rows.append(y.copy())
    rows = np.array(rows)
    omega = np.array([momentum / inertia(r) for r in rows[:, 1 : n + 1]])
    return {"t": ask.times, "theta": rows[:, 0], "omega": omega, "r": rows[:, 1 : n + 1], "v": rows[:, n + 1 :]}


solve.name = "Radau with events"
solve.equation = "eq8"
solve.refined_by = "rtol"
solve.timeout = 600.0
