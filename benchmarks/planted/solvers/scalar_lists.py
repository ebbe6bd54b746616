"""Plain Python, one slice at a time: classical Runge-Kutta steps, rebounds by reflection at the end of a step."""

from math import ceil, cos


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    n, half = throw.n_slices, bottle.length / 2
    m, m_b = throw.water_mass / n, bottle.mass
    total = throw.water_mass + m_b
    slab = throw.water_mass / bottle.capacity * bottle.length / n
    low, high = slab / 2, bottle.length - slab / 2
    own = m_b * (bottle.radius**2 / 2 + bottle.length**2 / 12)
    e, g, k = throw.restitution, throw.gravity, throw.drag / m

    def centre_of(r):
        return (m * sum(r) + m_b * half) / total

    def inertia_of(r):
        c = centre_of(r)
        return own + m_b * (half - c) ** 2 + m * sum((x - c) ** 2 for x in r)

    def pushes(theta, r, v):
        c, omega = centre_of(r), momentum / inertia_of(r)
        pull = g * cos(theta) + k * m * sum(v) / total
        return omega, [omega * omega * (x - c) + pull - k * u for x, u in zip(r, v)]

    theta, r, v = throw.theta0, [float(x) for x in ask.start], [0.0] * n
    momentum = inertia_of(r) * throw.omega0
    t, answer = 0.0, {name: [] for name in ("theta", "omega", "r", "v")}
    for when in ask.times:
        count = ceil((when - t) / ask.effort - 1e-9)
        for _ in range(count):
            h = (when - t) / count
            w1, a1 = pushes(theta, r, v)
            if throw.frozen:
                theta += h * w1
                continue
            free = [
                not ((x >= high and u >= 0 and a > 0) or (x <= low and u <= 0 and a < 0)) for x, u, a in zip(r, v, a1)
            ]

            def along(f, rates, speeds):
                return [x + f * s if ok else x for x, s, ok in zip(rates, speeds, free)]

            v1 = [u if ok else 0.0 for u, ok in zip(v, free)]
            v2 = along(h / 2, v1, a1)
            w2, a2 = pushes(theta + h / 2 * w1, along(h / 2, r, v1), v2)
            v3 = along(h / 2, v1, a2)
            w3, a3 = pushes(theta + h / 2 * w2, along(h / 2, r, v2), v3)
            v4 = along(h, v1, a3)
            w4, a4 = pushes(theta + h * w3, along(h, r, v3), v4)
            theta += h / 6 * (w1 + 2 * w2 + 2 * w3 + w4)
            for i in range(n):
                if not free[i]:
                    v[i] = 0.0
                    continue
                a = (a1[i] + 2 * a2[i] + 2 * a3[i] + a4[i]) / 6
                r[i] += h / 6 * (v1[i] + 2 * v2[i] + 2 * v3[i] + v4[i])
                v[i] = v1[i] + h * a
                side = 1 if r[i] > high and v[i] > 0 else -1 if r[i] < low and v[i] < 0 else 0
                if side:
                    end = high if side > 0 else low
                    since = (r[i] - end) / v[i]
                    after = -e * (v[i] - a * since) + a * since
                    if abs(after) < abs(a) * h:
                        r[i], v[i] = end, 0.0
                    else:
                        r[i], v[i] = end + after * since, after
        t = when
        answer["theta"].append(theta)
        answer["omega"].append(momentum / inertia_of(r))
        answer["r"].append(list(r))
        answer["v"].append(list(v))
    return {"t": ask.times, **answer}


solve.name = "lists of numbers"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 4
