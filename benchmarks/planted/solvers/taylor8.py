"""Eq. 8: Taylor series of order 8 in every step, impacts and lost supports from the series itself; declares dt, order 8."""

import math

import numpy as np

ORDER = 8


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n, m, length, total = throw.n_slices, throw.slice_mass, bottle.length, throw.total_mass
    low, high = throw.r_min, throw.r_max
    ice = throw.frozen or high - low < 1e-12 * length
    near, slow = 1e-10 * length, 1e-5 * length * max(abs(throw.omega0), math.sqrt(throw.gravity / length))
    own = bottle.mass * (bottle.radius**2 / 2 + length**2 / 12)

    def inertia(r):
        c = (m * r.sum() + bottle.mass * length / 2) / total
        return own + m * ((r - c) ** 2).sum() + bottle.mass * (length / 2 - c) ** 2

    def series(theta, r0, v0, free):
        """Coefficients of theta, r, v, and of the acceleration that each slice would have if it were free."""
        th, r, v, a = np.zeros(ORDER + 1), np.zeros((ORDER + 1, n)), np.zeros((ORDER + 1, n)), np.zeros((ORDER + 1, n))
        x, cb = np.zeros((ORDER + 1, n)), np.zeros(ORDER + 1)
        J, w, ww = np.zeros(ORDER + 1), np.zeros(ORDER + 1), np.zeros(ORDER + 1)
        c, s = np.zeros(ORDER + 1), np.zeros(ORDER + 1)
        th[0], r[0], v[0] = theta, r0, v0
        c[0], s[0] = math.cos(theta), math.sin(theta)
        for k in range(ORDER + 1):
            centre = m * r[k].sum() / total + (bottle.mass * length / 2 / total if k == 0 else 0.0)
            x[k], cb[k] = r[k] - centre, (length / 2 if k == 0 else 0.0) - centre
            J[k] = m * np.sum(x[: k + 1] * x[k::-1]) + bottle.mass * np.dot(cb[: k + 1], cb[k::-1]) + (own if k == 0 else 0.0)
            w[k] = ((momentum if k == 0 else 0.0) - np.dot(w[:k], J[k:0:-1])) / J[0]
            ww[k] = np.dot(w[: k + 1], w[k::-1])
            if k > 0:
                j = np.arange(1, k + 1)
                c[k] = -np.dot(j * th[1 : k + 1], s[k - 1 :: -1] if k > 0 else s[:1]) / k
                s[k] = np.dot(j * th[1 : k + 1], c[k - 1 :: -1] if k > 0 else c[:1]) / k
            a[k] = ww[: k + 1] @ x[k::-1] + throw.gravity * c[k] - throw.drag / m * (v[k] - m * v[k].sum() / total)
            if k < ORDER:
                th[k + 1], r[k + 1], v[k + 1] = w[k] / (k + 1), free * v[k] / (k + 1), free * a[k] / (k + 1)
        return th, r, v, a

    def at(p, t):
        value = p[-1]
        for k in range(len(p) - 2, -1, -1):
            value = value * t + p[k]
        return value

    def settle():
        nonlocal side, free
        side = np.where(r > high - near, 1.0, np.where(r < low + near, -1.0, 0.0))
        r[side > 0], r[side < 0] = high, low
        v[side * v > 0] *= -throw.restitution
        a = series(theta, r, v, np.ones(n))[3][0]
        pressed = (side != 0) & (np.abs(v) < slow) & (side * a > 0)
        v[pressed] = 0.0
        free = np.where(pressed | ice, 0.0, 1.0)

    theta, r, v = throw.theta0, ask.start.copy(), np.zeros(n)
    momentum = inertia(r) * throw.omega0
    side, free = np.zeros(n), np.ones(n)
    settle()
    t, rows = 0.0, []
    for when in ask.times:
        while when - t > 1e-13:
            h = (when - t) / math.ceil((when - t) / ask.effort - 1e-9)
            P, R, V, A = series(theta, r, v, free)

            def event(d):
                x, u = at(R, d), at(V, d)
                out = (free > 0) & (((x > high) & (u > 0)) | ((x < low) & (u < 0)))
                gone = (free == 0) & (side * at(A, d) < 0) & (not ice)
                return bool(out.any() or gone.any())

            first, last = 0.0, h
            happens = False
            for part in np.linspace(0.0, h, 9)[1:]:
                if event(part):
                    last, happens = part, True
                    break
                first = part
            while happens and last - first > 1e-15:
                half = (first + last) / 2
                if half in (first, last):
                    break
                first, last = (first, half) if event(half) else (half, last)
            theta, r, v, t = float(at(P, last)), at(R, last), at(V, last), t + last
            if happens:
                settle()
        rows.append((theta, momentum / inertia(r), r.copy(), v.copy()))
    theta, omega, r, v = (np.array(column) for column in zip(*rows))
    return {"t": ask.times, "theta": theta, "omega": omega, "r": r, "v": v}


solve.name = "Taylor series of order 8"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 8
