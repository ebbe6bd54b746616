"""Everything the other way round: distances from the base in cm, grams, the angle clockwise. Heun's method."""

import math

import numpy as np

CM = 100.0  # cm in a metre
G = 1000.0  # grams in a kilogram


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n = throw.n_slices
    m, tube = G * throw.water_mass / n, G * bottle.mass
    length, radius = CM * bottle.length, CM * bottle.radius
    slab = length * throw.water_mass / bottle.capacity / n
    at_base, at_cap = slab / 2, length - slab / 2
    gravity, alpha, e = CM * throw.gravity, G * throw.drag, throw.restitution

    def centre(x):
        return (m * x.sum() + tube * length / 2) / (n * m + tube)

    def inertia(x):
        c = centre(x)
        return m * ((x - c) ** 2).sum() + tube * (radius**2 / 2 + length**2 / 12 + (length / 2 - c) ** 2)

    def slope(phi, x, u):
        spin = momentum / inertia(x)
        drag = alpha / m * (u - m * u.sum() / (n * m + tube))
        return spin, spin**2 * (x - centre(x)) - gravity * math.cos(phi) - drag

    phi, x, u = -throw.theta0, length - CM * ask.start, np.zeros(n)
    momentum = -inertia(x) * throw.omega0
    now, rows = 0.0, []
    for when in ask.times:
        parts = math.ceil((when - now) / ask.effort - 1e-9)
        h = (when - now) / max(parts, 1)
        for _ in range(parts):
            spin, a = slope(phi, x, u)
            held = (x <= at_base) & (u <= 0) & (a < 0) | (x >= at_cap) & (u >= 0) & (a > 0)
            if throw.frozen:
                held[:] = True
            u = np.where(held, 0.0, u)
            a = np.where(held, 0.0, a)
            u2 = u + h * a
            spin2, a2 = slope(phi + h * spin, x + h * u, u2)
            a = np.where(held, 0.0, (a + a2) / 2)
            phi, x, u = phi + h * (spin + spin2) / 2, x + h * (u + u2) / 2, u + h * a
            for end, outward in ((at_base, -1), (at_cap, 1)):
                over = (outward * (x - end) > 0) & (outward * u > 0)
                late = (x[over] - end) / u[over]
                back = -e * (u[over] - a[over] * late) + a[over] * late
                back[np.abs(back) < np.abs(a[over]) * h] = 0.0
                x[over], u[over] = end + back * late, back
        now = when
        rows.append([-phi, -momentum / inertia(x), (length - x) / CM, -u / CM, (length - centre(x)) / CM])
    theta, omega, r, v, r_cm = (np.array(column) for column in zip(*rows))
    return {"t": ask.times, "theta": theta, "omega": omega, "r": r, "v": v, "r_cm": r_cm}


solve.name = "Heun in cm, from the base, clockwise"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 2
