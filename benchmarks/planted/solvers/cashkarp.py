"""Free flight with recoil: Cash-Karp 5(4) with variable steps; impacts and releases by repeated steps (safeguarded Newton)."""
import numpy as np

A = [np.array(row) for row in (
    [], [1 / 5], [3 / 40, 9 / 40], [3 / 10, -9 / 10, 6 / 5], [-11 / 54, 5 / 2, -70 / 27, 35 / 27],
    [1631 / 55296, 175 / 512, 575 / 13824, 44275 / 110592, 253 / 4096])]
B5 = np.array([37 / 378, 0, 250 / 621, 125 / 594, 0, 512 / 1771])
B4 = np.array([2825 / 27648, 0, 18575 / 48384, 13525 / 55296, 277 / 14336, 1 / 4])
DB = B5 - B4


def solve(ask):
    throw, bottle = ask.scenario, ask.scenario.bottle
    m, total, Mb, L = throw.slice_mass, throw.total_mass, bottle.mass, bottle.length
    lo, hi, e, alpha = throw.r_min, throw.r_max, throw.restitution, throw.drag
    d = alpha / m
    own = Mb * (bottle.radius**2 / 2 + L**2 / 12)
    n = len(ask.start)
    scale = max(abs(throw.omega0) * L, 1e-9 * L)
    rest_speed = 2e-5 * scale
    near = 1e-13 * L
    rtol = max(1e-3 if ask.effort is None else float(ask.effort), 2e-14)

    def centre_inertia(r):
        c = (m * r.sum() + Mb * L / 2) / total
        x = r - c
        return c, own + m * (x @ x) + Mb * (L / 2 - c) ** 2

    y = np.concatenate([np.array(ask.start, float), np.zeros(n), [throw.theta0]])
    y[:n][np.abs(y[:n] - hi) < 1e-10 * L] = hi
    y[:n][np.abs(y[:n] - lo) < 1e-10 * L] = lo
    H = centre_inertia(y[:n])[1] * throw.omega0
    weights = np.concatenate([np.full(n, 1 / L), np.full(n, 1 / scale), [1.0]])

    base = np.zeros(n, bool)  # at rest on the base
    cap = np.zeros(n, bool)  # at rest on the cap
    free = np.ones(n)
    Mc, rc = Mb, L / 2

    def body():
        nonlocal Mc, rc, free
        nb, nc = int(base.sum()), int(cap.sum())
        Mc = Mb + m * (nb + nc)
        rc = (Mb * L / 2 + m * (nb * hi + nc * lo)) / Mc
        free = (~(base | cap)).astype(float)

    def rhs(y):
        r, v = y[:n], y[n:2 * n]
        w = H / centre_inertia(r)[1]
        out = np.empty_like(y)
        out[:n] = v
        out[n:2 * n] = free * (w * w * (r - rc) - d * v - alpha / Mc * v.sum())
        out[2 * n] = w
        return out

    def press(y):
        """What presses resting slices outward: at the base, at the cap."""
        w = H / centre_inertia(y[:n])[1]
        common = alpha / Mc * y[n:2 * n].sum()
        return w * w * (hi - rc) - common, -(w * w * (lo - rc) - common)

    K = np.empty((6, 2 * n + 1))

    def step(y, h, first):
        K[0] = first
        for i in range(1, 6):
            K[i] = rhs(y + h * (A[i] @ K[:i]))
        return y + h * (B5 @ K)

    def settle(y):
        """Which of the slices that are on an end without speed stay there."""
        r, v = y[:n], y[n:2 * n]
        base[:] = (r == hi) & (v == 0)
        cap[:] = (r == lo) & (v == 0) & ~base
        body()
        if base.any() and press(y)[0] <= 0:
            base[:] = False
            body()
        if cap.any() and press(y)[1] <= 0:
            cap[:] = False
            body()

    def outside(y):
        return np.where(free > 0, np.maximum(y[:n] - hi, lo - y[:n]), -1.0)

    impacts = []

    def strike(t, y):
        r, v = y[:n], y[n:2 * n]
        moving = free > 0
        at_base = base | (moving & (r >= hi - near) & ((v > 0) | (r >= hi)))
        at_cap = cap | (moving & (r <= lo + near) & ((v < 0) | (r <= lo)))
        r[at_base], r[at_cap] = hi, lo
        s = at_base.astype(float) - at_cap
        at = s != 0
        push = (1 + e) * s[at] * v[at]  # without the recoil
        sign = s[at]
        x = 0.0  # speed that the tube gains
        active = push - sign * x > 0
        for _ in range(4 * n + 8):
            new = m * (sign[active] @ push[active]) / (Mb + m * active.sum())
            now = push - sign * new > 0
            x = new
            if (now == active).all():
                break
            active = now
        else:
            a, b = -np.abs(push).max() * (n + 1), np.abs(push).max() * (n + 1)
            for _ in range(200):
                x = (a + b) / 2
                if Mb * x - m * (sign @ np.maximum(push - sign * x, 0)) > 0:
                    b = x
                else:
                    a = x
        before = v.copy()
        p = np.zeros(n)
        p[at] = m * np.maximum(push - sign * x, 0)
        v -= s * p / m + x
        resting = (base | cap) & (np.abs(v) < 1e-12 * scale)
        v[resting] = 0.0
        v[at & (p > 0) & (np.abs(before) < 1e-300)] = 0.0
        held = at & (np.abs(v) < rest_speed)
        v[held] = 0.0
        for i in np.flatnonzero((p > 0) & (s * before > 0)):
            impacts.append([t, i, s[i], before[i], v[i]])

    def advance(y, h):
        """A step, cut at its first event: its length, state, error and whether an event ends it."""
        first = rhs(y)
        new = step(y, h, first)
        error = np.abs(h * (DB @ K) * weights).max() / rtol
        if error > 1 and h > 1e-12 * throw.duration:
            return h, None, error, False
        event = False
        v0 = y[n:2 * n]
        for _ in range(60):
            out = outside(new)
            turned = (free > 0) & (v0 * new[n:2 * n] < 0) & (out <= near)
            if not (out > near).any() and turned.any():
                v1 = new[n:2 * n]
                for i in np.flatnonzero(turned):
                    z = v0[i] / (v0[i] - v1[i])
                    top = (y[i] * (1 - z) ** 2 * (1 + 2 * z) + new[i] * z * z * (3 - 2 * z)
                           + h * z * (1 - z) * ((1 - z) * v0[i] - z * v1[i]))
                    if max(top - hi, lo - top) > near:
                        trial = step(y, h * z, first)
                        if outside(trial)[i] > near:
                            h, new = h * z, trial
                            break
                out = outside(new)
            if (out > near).any():
                index = np.flatnonzero(out > near)
                # first guess: straight back at the final speed
                back = out[index] / np.maximum(np.abs(new[n + index]), 1e-300)
                i = index[back.argmax()]
                side = 1.0 if new[i] > hi else -1.0
                wall = hi if side > 0 else lo
                a, b, s, state = 0.0, h, h, new
                for _ in range(100):
                    gap, speed = side * (state[i] - wall), side * state[n + i]
                    if abs(gap) <= near / 4 or b - a < 4e-16 * h:
                        break
                    if gap > 0:
                        b = s
                    else:
                        a = s
                    s = s - gap / speed if speed > 0 else -1.0
                    if not a < s < b:
                        s = (a + b) / 2
                    state = step(y, s, first)
                h, new, event = s, state, True
                new[i] = wall
                continue
            gone = [bool(group.any()) and value <= 0 for group, value in zip((base, cap), press(new))]
            if any(gone):
                k = 0 if gone[0] else 1
                a, b, fa, fb, state = 0.0, h, press(y)[k], press(new)[k], new
                side = 0
                for _ in range(100):
                    if b - a <= 1e-14 * h or fb > -1e-14 * fa:
                        break
                    s = b - fb * (b - a) / (fb - fa)
                    if not a < s < b:
                        s = (a + b) / 2
                    trial = step(y, s, first)
                    f = press(trial)[k]
                    if f <= 0:
                        b, fb, state = s, f, trial
                        if side == -1:
                            fa /= 2
                        side = -1
                    else:
                        a, fa = s, f
                        if side == 1:
                            fb /= 2
                        side = 1
                h, new, event = b, state, True
                continue
            break
        return h, new, error, event

    t, rows = 0.0, []
    widest = 1.0 / max(abs(throw.omega0), 1e-9)
    h = min(widest, throw.duration / 4) * min(1.0, rtol**0.2)
    if not throw.frozen:
        settle(y)
    for when in ask.times:
        if throw.frozen:
            y[2 * n] = throw.theta0 + throw.omega0 * when
            t = when
        while when - t > 1e-14 * throw.duration:
            trial = min(h, when - t)
            last = trial == when - t
            done, new, error, event = advance(y, trial)
            factor = min(4.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2))
            if new is None:
                h = trial * factor
                continue
            if not last or factor < 1:
                h = min(widest, trial * factor)
            y = new
            t = when if last and not event else t + done
            if event:
                strike(t, y)
                settle(y)
        c, J = centre_inertia(y[:n])
        rows.append((y[2 * n], H / J, y[:n].copy(), y[n:2 * n].copy(), c, J))
    theta, omega, r, v, c, J = (np.array(column) for column in zip(*rows))
    return {"t": np.array(ask.times, float), "theta": theta, "omega": omega, "r": r, "v": v, "r_cm": c, "inertia": J,
            "impacts": np.array(impacts, float).reshape(-1, 5)}


solve.refined_by = "rtol"
solve.equation = "free-flight"
solve.timeout = 120
