"""A bottle flip with plain Python lists: Kutta's third-order rule on a fixed grid, impacts by regula falsi."""
from math import cos

CAP, BASE = -1, 1
SLOW = 5e-5      # m/s, a slice slower than this does not bounce any more
CLOSE = 2e-11    # m, two slices that reach an end within this distance reach it together


def solve(ask):
    s = ask.scenario
    b = s.bottle
    n = s.n_slices
    m = s.water_mass / n
    alpha = s.drag
    e = s.restitution
    g = s.gravity
    all_mass = b.mass + s.water_mass
    thick = s.water_mass / b.capacity * b.length / n
    end_of = {CAP: 0.5 * thick, BASE: b.length - 0.5 * thick}
    own_inertia = b.mass * (6 * b.radius**2 + b.length**2) / 12

    def r_cm_of(r):
        return (m * sum(r) + b.mass * b.length / 2) / all_mass

    def inertia_of(r):
        c = r_cm_of(r)
        water = 0.0
        for ri in r:
            water += m * (ri - c) * (ri - c)
        return own_inertia + water + b.mass * (b.length / 2 - c) ** 2

    J = inertia_of([float(x) for x in ask.start]) * s.omega0

    def accelerations(theta, r, v):
        c = r_cm_of(r)
        vc = m * sum(v) / all_mass
        w = J / inertia_of(r)
        push = g * cos(theta)
        return w, [w * w * (r[i] - c) + push - alpha / m * (v[i] - vc) for i in range(n)]

    def rates(theta, r, v, held):
        w, a = accelerations(theta, r, v)
        return w, [0.0 if held[i] else v[i] for i in range(n)], [0.0 if held[i] else a[i] for i in range(n)]

    def kutta(state, held, h):
        theta, r, v = state
        w1, p1, q1 = rates(theta, r, v, held)
        r2 = [r[i] + h / 2 * p1[i] for i in range(n)]
        v2 = [v[i] + h / 2 * q1[i] for i in range(n)]
        w2, p2, q2 = rates(theta + h / 2 * w1, r2, v2, held)
        r3 = [r[i] + h * (2 * p2[i] - p1[i]) for i in range(n)]
        v3 = [v[i] + h * (2 * q2[i] - q1[i]) for i in range(n)]
        w3, p3, q3 = rates(theta + h * (2 * w2 - w1), r3, v3, held)
        return (
            theta + h / 6 * (w1 + 4 * w2 + w3),
            [r[i] + h / 6 * (p1[i] + 4 * p2[i] + p3[i]) for i in range(n)],
            [v[i] + h / 6 * (q1[i] + 4 * q2[i] + q3[i]) for i in range(n)],
        )

    def too_far(state, held):
        """How far the worst slice is out of the bottle (negative: all are inside)."""
        worst = -b.length
        for i in range(n):
            if not held[i]:
                worst = max(worst, state[1][i] - end_of[BASE], end_of[CAP] - state[1][i])
        return worst

    def weakest(state, held):
        """Smallest force per mass with which a resting slice presses on its end."""
        if not any(held):
            return 1.0
        w, a = accelerations(*state)
        return min(held[i] * a[i] for i in range(n) if held[i])

    def bounce(state):
        """All slices at an end that move outwards turn round; the slow ones stay there if they are pressed."""
        theta, r, v = state
        r, v, at = r[:], v[:], [0] * n
        for i in range(n):
            for side in (CAP, BASE):
                if side * (r[i] - end_of[side]) > -CLOSE:
                    at[i] = side
                    r[i] = end_of[side]
                    if side * v[i] > 0:
                        v[i] = -e * v[i]
                    if abs(v[i]) < SLOW:
                        v[i] = 0.0
        w, a = accelerations(theta, r, v)
        held = [at[i] if at[i] != 0 and v[i] == 0.0 and at[i] * a[i] >= 0 else 0 for i in range(n)]
        return (theta, r, v), held

    def advance(state, held, h):
        """Go on by exactly h, through whatever happens on the way."""
        left = h
        while left > 0:
            new = kutta(state, held, left)
            used, hit, let_go = left, False, False
            lo, f_lo = 0.0, too_far(state, held)
            hi, f_hi = left, too_far(new, held)
            if f_hi <= 0:
                # somebody may have been outside and come back
                for i in range(n):
                    v0, v1 = state[2][i], new[2][i]
                    if not held[i] and v0 * v1 < 0:
                        at = left * v0 / (v0 - v1)
                        middle = kutta(state, held, at)
                        if too_far(middle, held) > 0 and at < hi:
                            hi, f_hi = at, too_far(middle, held)
            if f_hi > 0:
                hit = True
                last = 0
                for _ in range(200):
                    if f_hi < 1e-14 or hi - lo < 1e-15:
                        break
                    if f_lo < 0 and last < 3:
                        at = lo + (hi - lo) * f_lo / (f_lo - f_hi)
                        at = min(max(at, lo + 0.001 * (hi - lo)), hi - 0.001 * (hi - lo))
                    else:
                        at = 0.5 * (lo + hi)
                        last = 0
                    f = too_far(kutta(state, held, at), held)
                    if f > 0:
                        last = last + 1 if last >= 0 else 0
                        hi, f_hi = at, f
                    else:
                        last = last + 1
                        lo, f_lo = at, f
                used = hi
                new = kutta(state, held, used)
            if weakest(new, held) < 0:
                lo, hi = 0.0, used
                while hi - lo > 1e-14:
                    at = 0.5 * (lo + hi)
                    if weakest(kutta(state, held, at), held) < 0:
                        hi = at
                    else:
                        lo = at
                    if at in (lo, hi) and hi - lo <= 1e-14 * max(1.0, used):
                        break
                hit, let_go = False, True
                used = hi
                new = kutta(state, held, used)
            state = new
            if hit:
                state, held = bounce(state)
            if let_go:
                w, a = accelerations(*state)
                held = [held[i] if held[i] * a[i] >= 0 else 0 for i in range(n)]
            left = left - used
        return state, held

    start = (s.theta0, [float(x) for x in ask.start], [0.0] * n)
    if s.frozen:
        state, held = start, [BASE] * n
    else:
        state, held = bounce(start)

    h = s.duration / ask.effort
    done = 0  # whole steps so far
    answer = {"t": ask.times, "theta": [], "omega": [], "r": [], "v": [], "r_cm": [], "inertia": []}
    for t in ask.times:
        while (done + 1) * h <= t:
            if s.frozen:
                state = (state[0] + h * s.omega0, state[1], state[2])
            else:
                state, held = advance(state, held, h)
            done += 1
        rest = t - done * h
        if s.frozen:
            now = (state[0] + rest * s.omega0, state[1], state[2])
        else:
            now, _ = advance(state, held, rest)
        answer["theta"].append(now[0])
        answer["r"].append(now[1])
        answer["v"].append(now[2])
        inertia = inertia_of(now[1])
        answer["omega"].append(J / inertia)
        answer["r_cm"].append(r_cm_of(now[1]))
        answer["inertia"].append(inertia)
    return answer


solve.name = "plain lists, Kutta 3"
solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 3
