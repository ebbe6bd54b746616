"""Bulirsch-Stoer: Richardson extrapolation (in h^2) of the semi-implicit midpoint rule, whose implicit part is the drag alone, which
can be inverted by hand; steps adapt to the tolerance, and an event is hit by repeating the step with the length that reaches it."""
import numpy as np

COUNTS = (2, 6, 10, 14, 18, 22)
NODES = np.linspace(0.125, 1.0, 8)


def solve(ask):
    sc, rtol = ask.scenario, min(max(float(ask.effort), 1e-13), 1e-2)
    n, length, mb, mw = sc.n_slices, sc.bottle.length, sc.bottle.mass, sc.water_mass
    share = mw / (mw + mb)                              # 1 - eps
    mi = mw / n
    rate = sc.drag / mi
    lo = 0.5 * mw / sc.bottle.capacity * length / n
    hi = length - lo
    bottle_j = mb * (sc.bottle.radius ** 2 / 2 + length ** 2 / 12)
    g, rest = sc.gravity, sc.restitution
    outputs = np.array(ask.times, float)

    def com(pos):
        return share * pos.mean(-1) + (1 - share) * length / 2

    def moment(pos):
        x = com(pos)
        return mi * ((pos - np.expand_dims(x, -1)) ** 2).sum(-1) + bottle_j + mb * (length / 2 - x) ** 2

    y = np.concatenate([np.array(ask.start, float), np.zeros(n), [sc.theta0]])
    spin = sc.omega0 * moment(y[:n])

    def answer(rows):
        rows = np.array(rows)
        pos = rows[:, :n]
        return {"t": outputs, "theta": rows[:, -1], "omega": spin / moment(pos), "r": pos, "v": rows[:, n:-1]}

    if sc.frozen or hi - lo < 1e-9 * length:
        return answer([np.concatenate([y[:-1], [sc.theta0 + sc.omega0 * t]]) for t in outputs])

    unit_a = sc.omega0 ** 2 * length + g                # natural units of acceleration, time and speed
    unit_t = np.sqrt(length / unit_a)
    scale = np.concatenate([np.full(n, length), np.full(n, length / unit_t), [1.0]])
    slack = 1e-12 * length
    pinned = np.zeros(n, int)                           # +1: rests on the base, -1: on the cap

    def end_push(state, wall):
        """Acceleration of a slice at rest on a wall."""
        pos = state[..., :n]
        return ((spin / moment(pos)) ** 2 * (wall - com(pos)) + g * np.cos(state[..., -1])
                + rate * share * state[..., n:-1].mean(-1))

    def slope(state):
        pos, vel = state[:n], state[n:-1]
        w = spin / moment(pos)
        acc = w * w * (pos - com(pos)) + g * np.cos(state[-1]) - rate * (vel - share * vel.mean())
        return np.concatenate([vel, np.where(pinned == 0, acc, 0.0), [w]])

    def undrag(b, h):
        """Solve (1 - h A) x = b, where A is the drag of the free slices."""
        if rate == 0.0:
            return b
        x, loose = b.copy(), pinned == 0
        part = b[n:-1][loose]
        z = h * rate
        total = part.sum() / (1 + z * (1 - share * len(part) / n))
        x[n:-1][loose] = (part + z * share * total / n) / (1 + z)
        return x

    def midpoint_rule(start, f0, size, count):
        h = size / count
        delta = undrag(h * f0, h)
        state = start + delta
        for _ in range(count - 1):
            delta = delta + 2 * undrag(h * slope(state) - delta, h)
            state = state + delta
        return state + undrag(h * slope(state) - delta, h)

    def extrapolate(start, f0, size):
        """The step's result, its error in units of the tolerance, and the column that was enough."""
        table, best = [], None
        for k, count in enumerate(COUNTS):
            row = [midpoint_rule(start, f0, size, count)]
            for j in range(k):
                ratio = (count / COUNTS[k - 1 - j]) ** 2
                row.append(row[j] + (row[j] - table[j]) / (ratio - 1))
            if k:
                err = np.max(np.abs(row[-1] - row[-2]) / scale) / rtol
                if not np.isfinite(err):
                    return row[-1], 1e9, k
                if best is None or err < best[1]:
                    best = (row[-1], err, k)
                if err <= 1.0:
                    return best
            table = row
        return best

    def dense(start, f0, stop, f1, size, x):
        """Quintic Hermite positions (and cubic velocities and theta) at the fractions x of a step."""
        x = np.asarray(x)[:, None]
        p0, u0, a0 = start[:n], size * start[n:-1], size ** 2 * f0[n:-1]
        p1, u1, a1 = stop[:n], size * stop[n:-1], size ** 2 * f1[n:-1]
        d, du, da = p1 - p0 - u0 - a0 / 2, u1 - u0 - a0, a1 - a0
        c3, c4, c5 = 10 * d - 4 * du + da / 2, -15 * d + 7 * du - da, 6 * d - 3 * du + da / 2
        pos = p0 + x * (u0 + x * (a0 / 2 + x * (c3 + x * (c4 + x * c5))))
        vel = (u0 + x * (a0 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5)))) / size
        th = start[-1] + x * size * f0[-1] + x * x * (3 * (stop[-1] - start[-1]) - size * (2 * f0[-1] + f1[-1])) \
            + x ** 3 * (size * (f0[-1] + f1[-1]) - 2 * (stop[-1] - start[-1]))
        return np.concatenate([pos, vel, th], axis=1)

    def excess(states):
        """How far each slice is beyond an end (negative inside); held slices never are."""
        pos = states[..., :n]
        return np.where(pinned == 0, np.maximum(pos - hi, lo - pos), -length)

    def lifted(states):
        """Greatest inward push on a held slice, in natural units (negative while all are pressed)."""
        worst = np.full(states.shape[:-1], -1.0)
        if (pinned > 0).any():
            worst = np.maximum(worst, -end_push(states, hi) / unit_a)
        if (pinned < 0).any():
            worst = np.maximum(worst, end_push(states, lo) / unit_a)
        return worst

    def settle(state):
        """Impacts, then who rests and who leaves, at this instant."""
        pos, vel = state[:n], state[n:-1]
        for side, wall in ((1, hi), (-1, lo)):
            hits = (pinned == 0) & (side * (pos - wall) >= -slack) & (side * vel > 0)
            pos[hits] = wall
            vel[hits] *= -rest
        for side, wall in ((1, hi), (-1, lo)):
            push = side * end_push(state, wall)
            there = (pos == wall)
            if push >= 0:
                pin = there & (pinned == 0) & (side * vel <= 0) & (vel ** 2 <= 4e-11 * length * push)
                vel[pin] = 0.0
                pinned[pin] = side
            else:
                pinned[there & (pinned == side)] = 0
        return state

    for wall in (lo, hi):
        y[:n][np.abs(y[:n] - wall) < 1e-10 * length] = wall
    y = settle(y)
    now, size, rows = 0.0, 0.02 * unit_t, []
    for target in outputs:
        while target - now > 1e-14 * max(target, unit_t):
            f0 = slope(y)
            trial = min(size, target - now, 0.25 / abs(f0[-1]), unit_t)
            new, err, k = extrapolate(y, f0, trial)
            factor = 0.85 * (0.7 / max(err, 1e-10)) ** (1.0 / (2 * k + 1))
            if err > 1.0:
                size = trial * min(max(factor, 0.1), 0.7)
                continue
            if trial >= 0.999 * size or factor < 1.0:
                size = trial * min(max(factor, 0.3), 4.0 if k < 4 else 1.5)
            f1 = slope(new)
            samples = dense(y, f0, new, f1, trial, NODES)
            samples[-1] = new
            over = excess(samples)
            happens = np.nonzero((over.max(1) > slack) | (lifted(samples) > 0))[0]
            if len(happens) == 0:
                y, now = settle(new), now + trial
                continue
            # the first event lies before `right`; `left` has none yet
            left, right, early, late = 0.0, NODES[happens[0]] * trial, y, None
            tau = right
            for attempt in range(80):
                state = new if tau == trial else extrapolate(y, f0, tau)[0]
                gap, vel, lift = excess(state), state[n:-1], float(lifted(state))
                outward = np.where(state[:n] > length / 2, vel, -vel)
                guess = None
                if lift <= 0:
                    near = (outward > 0) & (gap > -0.2 * length)
                    if gap.max() <= slack and (near & (gap >= -slack)).any():
                        right, late = tau, state                      # on the end, as exactly as can be
                        break
                    if near.any():
                        guess = tau + np.min(-gap[near] / outward[near])
                if gap.max() > slack or lift > 0:
                    right, late = tau, state
                    before = float(lifted(early))
                    if lift > 0 and before < 0 and attempt % 3 < 2:
                        guess = left + (right - left) * before / (before - lift) * (1 + 1e-8)
                else:
                    left, early = tau, state
                    if late is None:                                  # the interpolant erred: nothing happens yet
                        right, late = tau, state
                        break
                if right - left <= 1e-13 * unit_t:
                    break
                tau = guess if guess is not None and left < guess < right else 0.5 * (left + right)
            y, now = settle(late), now + right
        now = target
        rows.append(y.copy())
    return answer(rows)


solve.name = "bulirsch"
solve.equation = "eq8"
solve.refined_by = "rtol"
