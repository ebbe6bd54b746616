import math

import numpy as np


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n, length = throw.n_slices, bottle.length
    m, m_b = throw.water_mass / n, bottle.mass
    total = throw.water_mass + m_b
    slab = throw.water_mass / bottle.capacity * length / n
    low, high = slab / 2, length - slab / 2
    own = m_b * (bottle.radius**2 / 2 + length**2 / 12)

    def observe(r):
        centre = (m * r.sum() + m_b * length / 2) / total
        return centre, own + m * ((r - centre) ** 2).sum() + m_b * (length / 2 - centre) ** 2

    def rates(theta, r, v):
        centre, inertia = observe(r)
        omega = momentum / inertia
        v_centre = m * v.sum() / total
        a = omega**2 * (r - centre) + throw.gravity * math.cos(theta) - throw.drag / m * (v - v_centre)
        return omega, v, a

    def at_rest(r, v, a):
        return throw.frozen | ((r >= high) & (v >= 0) & (a > 0)) | ((r <= low) & (v <= 0) & (a < 0))

    theta, r, v = throw.theta0, ask.start.copy(), np.zeros(n)
    momentum = observe(r)[1] * throw.omega0
    longest = throw.duration / ask.effort
    t, rows = 0.0, []
    for when in ask.times:
        count = math.ceil((when - t) / longest - 1e-9)
        for _ in range(count):
            h = (when - t) / count
            turn, speed, push = rates(theta, r, v)
            still = at_rest(r, v, push)
            speed, push = np.where(still, 0.0, speed), np.where(still, 0.0, push)
            turn, speed, push = rates(theta + h / 2 * turn, r + h / 2 * speed, v + h / 2 * push)
            speed, push = np.where(still, 0.0, speed), np.where(still, 0.0, push)
            theta, r, v = theta + h * turn, r + h * speed, v + h * push
            for end, beyond, out in ((high, r - high, v > 0), (low, low - r, v < 0)):
                hit = (beyond > 0) & out
                since = np.where(hit, (r - end) / np.where(hit, v, 1.0), 0.0)  # how long ago it passed the end
                after = -throw.restitution * v + (1 + throw.restitution) * push * since
                slow = hit & (np.abs(after) < np.abs(push) * h)  # it would come back within two steps
                v = np.where(slow, 0.0, np.where(hit, after, v))
                r = np.where(slow, end, np.where(hit, end + after * since, r))
        t = when
        centre, inertia = observe(r)
        rows.append((theta, momentum / inertia, r, v, centre, inertia))
    theta, omega, r, v, r_cm, inertia = (np.array(column) for column in zip(*rows))
    return {"t": ask.times, "theta": theta, "omega": omega, "r": r, "v": v, "r_cm": r_cm, "inertia": inertia}


solve.name = "midpoint rule with reflection"
solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 2
