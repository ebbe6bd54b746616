"""A Runge-Kutta solver of Eq. 8 in one file, as somebody might write it without knowing flipproof.

    flipproof certify examples/foreign/rk4.py:Eq8
    flipproof place examples/foreign/rk4.py:Weightless
    flipproof explain examples/foreign/rk4.py:Eq8 examples/foreign/rk4.py:Weightless

A slice that has passed an end when a step is over is put back on the end with e times its speed: no impact is located.
"""

import numpy as np


class Eq8:
    """Slices slide along a tube that turns with omega = L / J; weight and drag act as in Eq. 8."""

    name = "naive RK4"
    equation = "eq8"
    refined_by = "dt"
    order = 4
    weight = 1.0  # of gravity that acts inside the bottle
    restitution = 1.0  # of the throw's restitution
    drag = 1.0  # of the throw's drag

    def solve(self, ask):
        """Answer at the times asked, with steps of at most ``ask.effort`` seconds."""
        throw, bottle = ask.scenario, ask.scenario.bottle
        n, m, total_mass = throw.n_slices, throw.slice_mass, throw.total_mass
        lowest, highest = throw.r_min, throw.r_max
        own_inertia = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)

        def centre_and_inertia(r):
            centre = (m * r.sum() + bottle.mass * bottle.length / 2) / total_mass
            inertia = m * ((r - centre) ** 2).sum() + own_inertia + bottle.mass * (bottle.length / 2 - centre) ** 2
            return centre, inertia

        momentum = centre_and_inertia(ask.start)[1] * throw.omega0

        def slope(y):
            theta, r, v = y[0], y[1 : n + 1], y[n + 1 :]
            centre, inertia = centre_and_inertia(r)
            omega = momentum / inertia
            a = omega**2 * (r - centre) + self.weight * throw.gravity * np.cos(theta)
            a = a - self.drag * throw.drag / m * (v - m * v.sum() / total_mass)
            rests = ((r >= highest) & (a > 0) & (v >= 0)) | ((r <= lowest) & (a < 0) & (v <= 0))
            still = rests | throw.frozen
            return np.concatenate([[omega], np.where(still, 0.0, v), np.where(still, 0.0, a)])

        def rebound(y):
            r, v = y[1 : n + 1], y[n + 1 :]  # views: what changes here changes y
            low, high = r < lowest, r > highest
            v[(high & (v > 0)) | (low & (v < 0))] *= -self.restitution * throw.restitution
            v[(low | high) & (np.abs(v) < 1e-3)] = 0.0
            r[:] = np.clip(r, lowest, highest)

        y = np.concatenate([[throw.theta0], ask.start, np.zeros(n)])
        t, rows = 0.0, []
        for when in ask.times:
            steps = int(np.ceil((when - t) / ask.effort - 1e-9))
            for _ in range(steps):
                h = (when - t) / steps
                k1 = slope(y)
                k2 = slope(y + h / 2 * k1)
                k3 = slope(y + h / 2 * k2)
                k4 = slope(y + h * k3)
                y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
                rebound(y)
            t = when
            rows.append(y)
        states = np.array(rows)
        r = states[:, 1 : n + 1]
        omega = np.array([momentum / centre_and_inertia(row)[1] for row in r])
        return {"t": ask.times, "theta": states[:, 0], "omega": omega, "r": r, "v": states[:, n + 1 :]}


class Weightless(Eq8):
    """The same without gravity."""

    name = "naive RK4, no gravity"
    equation = "eq8-weightless"
    weight = 0.0
