"""Strang splitting (drag - kick - drift - kick - drag), order 2, fixed steps of dt, in axial lab coordinates of slices and tube; impacts inside the step."""
import numpy as np


def solve(ask):
    sc, times, dt = ask.scenario, np.asarray(ask.times, dtype=float), float(ask.effort)
    bottle = sc.bottle
    n, L, M, m = sc.n_slices, bottle.length, bottle.mass, sc.slice_mass
    top, bottom = sc.r_min, sc.r_max
    alpha, e = sc.drag, sc.restitution
    w0 = sc.omega0
    creep = 3e-5 * abs(w0) * L
    total = M + n * m
    I_own = M * (bottle.radius ** 2 / 2 + L * L / 12)

    # --- state: x, u of the slices, X, U of the tube's centre, all from the common centre of mass
    r = np.clip(np.array(ask.start, dtype=float), top, bottom)
    cm = (m * r.sum() + M * L / 2) / total
    x, X = r - cm, L / 2 - cm
    u, U = np.zeros(n), 0.0
    held = np.zeros(n, dtype=int)               # 0 free, 1 on the base, -1 on the cap
    angle, impacts = sc.theta0, 0

    def moment(x, X):
        return m * np.dot(x, x) + I_own + M * X * X
    spin = moment(x, X) * w0

    def carried():
        """mass of the tube with its load, and the load's offset from the tube's centre"""
        up, down = np.count_nonzero(held < 0), np.count_nonzero(held > 0)
        mass = M + m * (up + down)
        return mass, m * (up * (top - L / 2) + down * (bottom - L / 2)) / mass

    def rub(u, U, tau):
        """exact flow of the wall's drag: differences decay with alpha/m, the mean faster by the tube's recoil"""
        if alpha == 0 or k == 0:
            return u, U
        v = u[free] - U
        mean = v.mean()
        slow, fast = np.exp(-alpha / m * tau), np.exp(-(alpha / m + k * alpha / mass) * tau)
        v = (v - mean) * slow + mean * fast
        momentum = m * u[free].sum() + mass * U
        U = (momentum - m * v.sum()) / (mass + k * m)
        u = np.full(n, U)
        u[free] += v
        return u, U

    def step(tau):
        """one step of length tau from the present state; it changes nothing"""
        u1, U1 = rub(u, U, tau / 2)
        wa = spin / moment(x, X)
        kick = 0.5 * tau * wa * wa
        U1 = U1 + kick * (X + offset)
        u1 = np.where(free, u1 + kick * x, U1)
        x1, X1 = x + tau * u1, X + tau * U1
        wb = spin / moment(x1, X1)
        kick = 0.5 * tau * wb * wb
        U1 = U1 + kick * (X1 + offset)
        u1 = np.where(free, u1 + kick * x1, U1)
        u1, U1 = rub(u1, U1, tau / 2)
        return x1, u1, X1, U1, angle + 0.5 * tau * (wa + wb)

    def strain(state):
        """force per mass that holds (base, cap) slices back; negative: the end no longer presses"""
        x, u, X, U, _ = state
        w = spin / moment(x, X)
        pull = alpha / mass * (u[free] - U).sum()
        return w * w * (bottom - L / 2 - offset) - pull, w * w * (offset + L / 2 - top) + pull

    def trouble(state):
        """largest excursion past an end (m), or a token amount if a held slice should be let go"""
        rel = state[0][free] - state[2] + L / 2
        out = max(rel.max() - bottom, top - rel.min()) - slack if k else -1.0
        if alpha > 0 and k < n:
            base, cap = strain(state)
            if (base < 0 and (held > 0).any()) or (cap < 0 and (held < 0).any()):
                out = max(out, slack)
        return out

    def recount():
        free = held == 0
        mass, offset = carried()
        return free, np.count_nonzero(free), mass, offset

    def rest_or_go(x, u, X, U):
        nonlocal held, free, k, mass, offset
        rel, v = x - X + L / 2, u - U
        quiet = np.abs(v) <= creep
        held = (quiet & (rel >= bottom - touch)).astype(int) - (quiet & (rel <= top + touch))
        free, k, mass, offset = recount()
        for _ in range(2):
            base, cap = strain((x, u, X, U, angle))
            held[(held > 0) & (base < 0)] = 0
            held[(held < 0) & (cap < 0)] = 0
            free, k, mass, offset = recount()
        U = -m * u[free].sum() / mass if k else 0.0
        x = np.where(held > 0, X + bottom - L / 2, np.where(held < 0, X + top - L / 2, x))
        return x, np.where(free, u, U), U

    def clash(x, u, X, U):
        """Impulses p_i between the tube and each slice at an end, by active set"""
        rel, v = x - X + L / 2, u - U
        side = (rel >= bottom - touch).astype(float) - (rel <= top + touch)
        active = side * v > 0
        for _ in range(4 * n + 8):
            P = m * (1 + e) * v[active].sum() / (1 + m * np.count_nonzero(active) / M)
            want = side * ((1 + e) * v - P / M) > 1e-14 * L * abs(w0)
            if (want == active).all():
                break
            active = want
        p = np.where(active, m * side * ((1 + e) * v - P / M), 0.0)
        return u - side * p / m, U + (side * p).sum() / M

    slack, touch = 1e-13 * L, 1e-10 * L
    free, k, mass, offset = recount()
    if sc.frozen or bottom - top < 1e-12 * L:
        one = np.ones_like(times)
        return {"t": times, "theta": sc.theta0 + w0 * times, "omega": w0 * one, "r": np.outer(one, r)}
    x, u, U = rest_or_go(x, u, X, U)

    out_theta, out_omega, out_r = [], [], []
    t, grid, q = 0.0, 1, 0
    while True:
        target = grid * dt
        span = target - t
        new = step(span)
        event = trouble(new) > 0
        if event:                               # when inside the step? bracket, then regula falsi (Illinois)
            a, b, fa, fb = 0.0, span, None, trouble(new)
            for i in range(60):
                c = 0.5 * (a + b) if fa is None or i % 3 == 2 else (a * fb - b * fa) / (fb - fa)
                if not a < c < b:
                    c = 0.5 * (a + b)
                trial = step(c)
                fc = trouble(trial)
                if fc > 0:
                    b, fb, new = c, fc, trial
                else:
                    a, fa = c, fc
                if b - a < 1e-13 * dt or 0 < fb < slack:
                    break
            span = b
        while q < len(times) and (times[q] <= t + span):
            y = step(times[q] - t)
            out_theta.append(y[4])
            out_omega.append(spin / moment(y[0], y[2]))
            out_r.append(y[0] - y[2] + L / 2)
            q += 1
        if q == len(times):
            break
        x, u, X, U, angle = new
        if event:
            t += span
            rel, v = x - X + L / 2, u - U
            if (free & ((rel >= bottom - touch) & (v > 0) | (rel <= top + touch) & (v < 0))).any():
                u, U = clash(x, u, X, U)
                impacts += 1
            x, u, U = rest_or_go(x, u, X, U)
        else:
            t, grid = target, grid + 1
    return {"t": times, "theta": np.array(out_theta), "omega": np.array(out_omega), "r": np.array(out_r)}


solve.name = "axial lab coordinates, Strang"
solve.equation = "free-flight"
solve.refined_by = "dt"
solve.order = 2
