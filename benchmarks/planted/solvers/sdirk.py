"""Free flight by SDIRK 4(3) of Hairer and Wanner (five stages, L-stable), adaptive, with quintic Hermite interpolation.

Within a stage the slices move in a field that is linear once omega^2 is known; omega^2 itself is found from sums over the
slices alone, by iteration of one number. So a stage costs a few vector operations and no linear algebra.
"""

import math

import numpy as np

D = 0.25
TABLE = [[], [1 / 2], [17 / 50, -1 / 25], [371 / 1360, -137 / 2720, 15 / 544], [25 / 24, -49 / 48, 125 / 16, -85 / 12]]
ERROR = [25 / 24 - 59 / 48, -49 / 48 + 17 / 96, 125 / 16 - 225 / 32, 0.0, D]
PROBES = np.linspace(0.0, 1.0, 9)


class Flight:
    def __init__(self, sc, start):
        b = sc.bottle
        self.m, self.mb, self.alpha, self.e, self.total = sc.slice_mass, b.mass, sc.drag, sc.restitution, sc.total_mass
        self.gamma, self.half, self.length = sc.drag / sc.slice_mass, b.length / 2, b.length
        self.own = b.mass * (b.radius**2 / 2 + b.length**2 / 12)
        self.ends = ((1, sc.r_max), (-1, sc.r_min))
        self.touch, self.rest_speed = 1e-13 * b.length, 4e-5 * abs(sc.omega0) * b.length
        self.spin0 = self.inertia(start) * sc.omega0
        self.impacts = []

    def centre(self, r):
        return (self.m * r.sum() + self.mb * self.half) / self.total

    def inertia(self, r):
        c = self.centre(r)
        return self.m * ((r - c) ** 2).sum() + self.own + self.mb * (self.half - c) ** 2

    def body(self, r, rest):
        """The tube and what rests on it: mass, centre, moment of inertia about that centre; and which slices are free."""
        held = rest != 0
        mass = self.mb + self.m * held.sum()
        centre = (self.mb * self.half + self.m * r[held].sum()) / mass
        inertia = self.own + self.mb * (self.half - centre) ** 2 + self.m * ((r[held] - centre) ** 2).sum()
        return mass, centre, inertia, ~held

    def accelerations(self, r, v, body):
        """r'' of the free slices (0 for the others), omega and omega'."""
        mass, centre, _, free = body
        total = self.inertia(r)
        omega = self.spin0 / total
        a = free * (omega * omega * (r - centre) - self.gamma * v - self.alpha / mass * v.sum())
        change = 2 * self.m * ((r - self.centre(r)) * v).sum()
        return a, omega, -omega * change / total

    def stage(self, d, x, y, body):
        """Solve V = x + d A(R, V), y + d V = R - centre of the tube, for the free slices: V and omega."""
        mass, _, inertia, _ = body
        n = x.size
        kappa = self.alpha / mass
        mx, my = x.sum() / max(n, 1), y.sum() / max(n, 1)
        dx, dy = x - mx, y - my
        sxx, sxy, syy = dx.dot(dx), dx.dot(dy), dy.dot(dy)
        square = (self.spin0 / (inertia + self.m * (syy + n * my * my * (1 - self.m * n / self.total)))) ** 2
        for _ in range(80):
            q = 1 + d * self.gamma - d * d * square
            mean = (mx + d * square * my) / (q + d * kappa * n)
            b, c = d / q, 1 + d * d * square / q
            middle = my + d * mean
            spread = c * c * syy + 2 * b * c * sxy + b * b * sxx
            omega = self.spin0 / (inertia + self.m * (spread + n * middle * middle * (1 - self.m * n / self.total)))
            if not q > 0.1 or abs(omega * omega - square) <= 4e-16 * square:
                break
            square = omega * omega
        else:
            q = 0.0
        if not q > 0.1:
            return None
        return (dx + d * square * dy) / q + mean, omega

    def step(self, r, v, theta, h, body):
        """One SDIRK step: r, v, theta, r'' at the end and the error relative to the scales."""
        _, centre, _, free = body
        speeds, pushes, spins = [], [], []
        y0, v0 = r[free] - centre, v[free]
        for row in TABLE:
            x = v0 + h * sum((a * p for a, p in zip(row, pushes)), np.zeros(v0.size))
            y = y0 + h * sum((a * s for a, s in zip(row, speeds)), np.zeros(v0.size))
            found = self.stage(D * h, x, y, body)
            if found is None:
                return None
            speeds.append(found[0])
            pushes.append((found[0] - x) / (D * h))
            spins.append(found[1])
        weights = TABLE[-1] + [D]
        r1, v1, a1 = r.copy(), v.copy(), np.zeros(r.size)
        r1[free], v1[free], a1[free] = y + D * h * speeds[-1] + centre, speeds[-1], pushes[-1]
        theta1 = theta + h * sum(b * w for b, w in zip(weights, spins))
        off_r = abs(sum(c * s for c, s in zip(ERROR, speeds))).max(initial=0.0) / self.length
        off_v = abs(sum(c * p for c, p in zip(ERROR, pushes))).max(initial=0.0) / (self.length * abs(spins[-1]))
        off_theta = abs(sum(c * w for c, w in zip(ERROR, spins)))
        return r1, v1, theta1, a1, h * max(off_r, off_v, off_theta)


def quintic(h, x0, u0, a0, x1, u1, a1):
    """Coefficients, lowest first, of the polynomial on [0, 1] with the given values and derivatives."""
    b, c = h * u0, 0.5 * h * h * a0
    p, q, s = x1 - x0 - b - c, h * u1 - b - 2 * c, h * h * a1 - 2 * c
    return [x0, b, c, 10 * p - 4 * q + s / 2, -15 * p + 7 * q - s, 6 * p - 3 * q + s / 2]


def value(c, s):
    return c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))


def slope(c, s):
    return c[1] + s * (2 * c[2] + s * (3 * c[3] + s * (4 * c[4] + s * 5 * c[5])))


def first_hit(flight, path, rest):
    """(fraction, slice, end) of the first hit on the path."""
    best = (2.0, None, 0)
    for side, end in flight.ends:
        c = np.array([side * (path[0] - end)] + [side * p for p in path[1:]])
        at_end = c[0] >= -flight.touch
        c[0][at_end] = 0.0
        probes = PROBES[:, None]
        x, u = value(c, probes), slope(c, probes)
        tops = PROBES[:-1, None] + (PROBES[1] * u[:-1]) / np.where(u[:-1] > u[1:], u[:-1] - u[1:], 1.0)
        tops = np.where((u[:-1] > 0) & (u[1:] < 0), tops, PROBES[1:, None])
        out = np.maximum(value(c, tops), x[1:]) > flight.touch
        found = np.flatnonzero(out.any(axis=0) & (rest == 0))
        if not found.size:
            continue
        k = out[:, found].argmax(axis=0)
        found, k = found[k == k.min()], k.min()
        ci, inner = c[:, found], at_end[found]
        ci[:, inner] = np.vstack([ci[1:, inner], np.zeros(inner.sum())])  # divided by the time: the root at 0 is gone
        hi = np.where(x[k + 1, found] > flight.touch, PROBES[k + 1], tops[k, found])
        lo = np.full(found.size, PROBES[k])
        hi[inner & ((ci[0] > 0) | ((ci[0] == 0) & (ci[1] >= 0)))] = 0.0
        for _ in range(10):
            mid = 0.5 * (lo + hi)
            beyond = value(ci, mid) > 0
            lo, hi = np.where(beyond, lo, mid), np.where(beyond, mid, hi)
        for j in np.flatnonzero(lo <= hi.min())[:4]:
            low, high, cj = lo[j], hi[j], ci[:, j].tolist()
            root = 0.5 * (low + high)
            for _ in range(60):
                y, dy = value(cj, root), slope(cj, root)
                low, high = (low, root) if y > 0 else (root, high)
                guess = root - y / dy if dy > 0 else low
                guess = guess if low < guess < high else 0.5 * (low + high)
                if abs(guess - root) <= 4e-16 * root:
                    break
                root = guess
            if root < best[0]:
                best = (root, found[j], side)
    return best


def impulses(flight, v, contact):
    """Velocities after the impact of all slices in contact (contact = side, 0 for the others)."""
    touching = np.flatnonzero(contact)
    s, w = contact[touching], (1 + flight.e) * v[touching]
    push = lambda speed: flight.m * (s * np.maximum(s * (w - speed), 0.0)).sum() - flight.mb * speed
    corners = np.unique(np.append(w, 0.0))
    k = int(np.searchsorted([-push(c) for c in corners], 0.0))  # the tube's jump lies between corners k - 1 and k
    between = corners[k] if k == 0 else 0.5 * (corners[k - 1] + corners[min(k, corners.size - 1)])
    active = s * (w - between) > 0
    jump = flight.m * w[active].sum() / (flight.mb + flight.m * active.sum())
    after = v - jump
    after[touching[active]] -= w[active] - jump
    return after, touching[active]


def settle(flight, r, v, rest, candidates):
    """Let the candidates rest that are pressed against their end; the tube takes over their momentum."""
    rest = np.where(candidates != 0, candidates, 0)
    for _ in range(3):
        body = flight.body(r, rest)
        omega = flight.spin0 / flight.inertia(r)
        pull = omega**2 * (r - body[1]) - flight.alpha / body[0] * v[rest == 0].sum()
        rest = np.where(rest * pull > 0, rest, 0)
    held = rest != 0
    jump = flight.m * v[held].sum() / (flight.mb + flight.m * held.sum())
    return np.where(held, 0.0, v - jump), rest


def solve(ask):
    sc, times = ask.scenario, np.asarray(ask.times, float)
    r = np.array(ask.start, float)
    flight, n = Flight(sc, r), sc.n_slices
    v, theta, t, rows = np.zeros(n), float(sc.theta0), 0.0, []
    candidates = np.zeros(n, int)
    for side, end in flight.ends:
        candidates[abs(r - end) <= 1e-12 * flight.length] = side
        r[candidates == side] = end
    stuck = sc.frozen or sc.r_max - sc.r_min <= 1e-12 * flight.length
    if stuck:
        rows = [(r, v, sc.theta0 + sc.omega0 * x) for x in times]
    else:
        v, rest = settle(flight, r, v, None, candidates)
    rtol = min(max(ask.effort, 1e-13), 1e-1)
    h = min(0.02 / abs(sc.omega0), sc.duration)
    a0 = None
    while len(rows) < times.size:
        body = flight.body(r, rest)
        a, omega, alpha = flight.accelerations(r, v, body)
        a0 = a if a0 is None else a0
        done = flight.step(r, v, theta, h, body)
        if done is None:
            h /= 2
            continue
        r1, v1, theta1, a1, error = done
        if error > rtol and h > 1e-13 * abs(1 / omega):
            h *= max(0.2, 0.9 * (rtol / error) ** 0.25)
            continue
        _, omega1, alpha1 = flight.accelerations(r1, v1, body)
        path = quintic(h, r, v, a0, r1, v1, a1)
        angle = quintic(h, theta, omega, alpha, theta1, omega1, alpha1)
        part, i, side = first_hit(flight, path, rest)
        stop = min(part, 1.0)

        def at(s):
            return value(path, s), np.where(rest == 0, slope(path, s) / h, 0.0)

        def pressing(s, k):
            x, u = at(s)
            w = flight.spin0 / flight.inertia(x)
            return rest[k] * (w * w * (x[k] - body[1]) - flight.alpha / body[0] * u.sum())

        loose = []
        for end in (1, -1):
            for k in np.flatnonzero(rest == end)[:1]:
                if pressing(stop, k) < 0:
                    lo, hi = 0.0, stop
                    while hi - lo > 1e-14 and pressing(0.0, k) > 0:
                        mid = 0.5 * (lo + hi)
                        lo, hi = (lo, mid) if pressing(mid, k) < 0 else (mid, hi)
                    stop, loose = (lo if lo == 0.0 else hi), [end]
        t_stop = t + stop * h
        while len(rows) < times.size and times[len(rows)] <= t_stop:
            s = (times[len(rows)] - t) / h
            rows.append((*at(s), value(angle, s)))
        whole = stop == 1.0 and not loose and i is None
        if whole:
            r, v, theta, a0 = r1, v1, theta1, a1
        else:
            (r, v), theta, a0 = at(stop), value(angle, stop), None
        t = t_stop
        if loose:
            rest = np.where(rest == loose[0], 0, rest)
        elif i is not None:
            r[i] = dict(flight.ends)[side]
            contact = rest.copy()
            for end, wall in flight.ends:
                here = (rest == 0) & (end * (r - wall) >= -flight.touch)
                r[here], contact[here] = wall, end
            after, hit = impulses(flight, v, contact)
            flight.impacts += [(t, k, contact[k], abs(v[k]), abs(after[k])) for k in hit if contact[k] * v[k] > 0]
            slow = (contact != 0) & (abs(after) < flight.rest_speed)
            v, rest = settle(flight, r, after, rest, np.where(slow, contact, 0))
        if whole:
            h *= min(4.0, max(0.2, 0.9 * (rtol / max(error, 1e-30)) ** 0.25))
    r, v = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    inertia = np.array([flight.inertia(x) for x in r])
    return {
        "t": times, "theta": np.array([row[2] for row in rows]), "omega": flight.spin0 / inertia, "r": r, "v": v,
        "r_cm": np.array([flight.centre(x) for x in r]), "inertia": inertia,
        "impacts": np.array([row for row in flight.impacts if row[0] <= times[-1]]).reshape(-1, 5),
    }


solve.name = "SDIRK 4(3)"
solve.equation = "free-flight"
solve.refined_by = "rtol"
