"""Eq. 8 by Taylor series: every step is a polynomial of order 14, impacts are roots of polynomials; no effort to set."""
import numpy as np

K = 14
EXACT = 1e-13
STAYS = 5e-5  # m/s
EDGE = 1e-11  # m
GRID = np.linspace(0.0, 1.0, 25)


def horner(c, x):
    """Value at x of the polynomial whose coefficients are the rows of c."""
    value = np.zeros_like(c[0] * x)
    for row in c[::-1]:
        value = value * x + row
    return value


def bisect(negative, a, b):
    """b of the smallest bracket (a, b] such that negative(b); negative(a) is taken to be false."""
    for _ in range(70):
        m = 0.5 * (a + b)
        if m <= a or m >= b:
            break
        a, b = (a, m) if negative(m) else (m, b)
    return b


class Series:
    def __init__(self, sc, start):
        b = sc.bottle
        self.n, self.m, self.mb = sc.n_slices, sc.slice_mass, b.mass
        self.mass = sc.total_mass
        self.half = b.length / 2
        self.I_tube = b.mass * (b.radius**2 / 2 + b.length**2 / 12)
        self.ends = {1: sc.r_max, -1: sc.r_min}
        self.e, self.g, self.rub = sc.restitution, sc.gravity, sc.drag / sc.slice_mass
        self.length = b.length
        self.speed = abs(sc.omega0) * b.length
        self.spin = sc.omega0 * self.inertia(np.array([start]))[0]

    def centre(self, r):
        return (self.m * r.sum(axis=1) + self.mb * self.half) / self.mass

    def inertia(self, r):
        c = self.centre(r)
        return self.I_tube + self.m * ((r - c[:, None]) ** 2).sum(axis=1) + self.mb * (self.half - c) ** 2

    def expand(self, theta, r, v, side):
        """Coefficients of theta, r, v and of the acceleration each slice would have if it were free."""
        n = self.n
        R, V, A = np.zeros((K + 1, n)), np.zeros((K + 1, n)), np.zeros((K, n))
        X, B = np.zeros((K, n)), np.zeros(K)  # from the common centre: slices, tube
        T, W, W2, I = np.zeros(K + 1), np.zeros(K), np.zeros(K), np.zeros(K)
        S, C = np.zeros(K + 1), np.zeros(K + 1)
        R[0], V[0], T[0] = r, v, theta
        S[0], C[0] = np.sin(theta), np.cos(theta)
        free = side == 0
        for k in range(K):
            tube = self.mb * self.half if k == 0 else 0.0
            c = (self.m * R[k].sum() + tube) / self.mass
            X[k] = R[k] - c
            B[k] = (self.half if k == 0 else 0.0) - c
            I[k] = self.m * (X[: k + 1] * X[k::-1]).sum() + self.mb * B[: k + 1] @ B[k::-1]
            if k == 0:
                I[0] += self.I_tube
                W[0] = self.spin / I[0]
            else:
                W[k] = -(I[1 : k + 1] @ W[k - 1 :: -1]) / I[0]
            W2[k] = W[: k + 1] @ W[k::-1]
            mean = self.m * V[k].sum() / self.mass
            A[k] = W2[: k + 1] @ X[k::-1] + self.g * C[k] - self.rub * (V[k] - mean)
            T[k + 1] = W[k] / (k + 1)
            S[k + 1] = C[: k + 1] @ W[k::-1] / (k + 1)
            C[k + 1] = -(S[: k + 1] @ W[k::-1]) / (k + 1)
            R[k + 1] = V[k] / (k + 1)
            V[k + 1] = np.where(free, A[k], 0.0) / (k + 1)
        return T, R, V, A

    def reach(self, T, R, V):
        """How far the series may be used: the last two terms stay below EXACT."""
        h = np.inf
        for k in (K - 1, K):
            size = max(abs(T[k]), np.abs(R[k]).max() / self.length, np.abs(V[k]).max() / self.speed)
            if size > 0:
                h = min(h, (EXACT / size) ** (1 / k))
        return h

    def first_impact(self, R, V, side, h):
        """Time and places of the first impact in (0, h], or None."""
        first = None
        x = h * GRID[:, None]
        r, v = horner(R[:, None, :], x[:, :, None])[:, 0], horner(V[:, None, :], x[:, :, None])[:, 0]
        for s in (1, -1):
            gap = s * (self.ends[s] - r)
            for i in np.flatnonzero(side == 0):
                c = -s * R[:, i]
                c[0] = s * (self.ends[s] - R[0, i])
                if c[0] == 0.0:
                    c = c[1:]  # it is leaving: divide by the time
                beyond = lambda z: horner(c, z) < 0
                below = np.flatnonzero(gap[1:, i] < 0)
                stop = x[1 + below[0], 0] if below.size else None
                for k in np.flatnonzero((s * v[:-1, i] > 0) & (s * v[1:, i] < 0)):
                    if stop is not None and x[k, 0] >= stop:
                        break
                    top = bisect(lambda z: s * horner(V[:, i], z) < 0, x[k, 0], x[k + 1, 0])
                    if beyond(top):
                        stop = top
                        break
                if stop is None:
                    continue
                safe = [z for z in x[:, 0] if z < stop and not beyond(z)]
                when = bisect(beyond, safe[-1] if safe else 0.0, stop)
                if first is None or when < first:
                    first = when
        return first

    def first_release(self, A, side, h):
        held = side != 0
        if not held.any():
            return None
        force = A[:, held] * side[held]
        for z in h * GRID[1:]:
            if horner(force, z).min() < 0:
                return bisect(lambda y: horner(force, y).min() < 0, z - h * GRID[1], z)
        return None


def solve(ask):
    sc = ask.scenario
    q = Series(sc, ask.start)
    n = q.n
    theta, r, v = sc.theta0, np.array(ask.start, float), np.zeros(n)
    times = [float(t) for t in ask.times]
    thetas, places, speeds, impacts = [], [], [], []

    def ends_of(r):
        return np.where(r >= q.ends[1] - EDGE, 1, np.where(r <= q.ends[-1] + EDGE, -1, 0))

    def settle(theta, r, v):
        at = ends_of(r)
        for s in (1, -1):
            r[at == s] = q.ends[s]
        quiet = (at != 0) & (np.abs(v) < STAYS)
        v[quiet] = 0.0
        A = q.expand(theta, r, v, np.where(quiet, at, 0))[3]
        return np.where(quiet & (at * A[0] >= 0), at, 0)

    side = np.ones(n, int) if sc.frozen else settle(theta, r, v)
    t = 0.0
    while len(thetas) < len(times):
        T, R, V, A = q.expand(theta, r, v, side)
        h = min(q.reach(T, R, V), max(times[-1] - t, 1e-9))
        hit = let = None
        if not sc.frozen:
            hit = q.first_impact(R, V, side, h)
            if hit is not None:
                h = hit
            let = q.first_release(A, side, h)
            if let is not None:
                h = let
        while len(thetas) < len(times) and (times[len(thetas)] <= t + h or t + h >= times[-1]):
            z = times[len(thetas)] - t
            thetas.append(horner(T, z))
            places.append(horner(R, z))
            speeds.append(horner(V, z))
        theta, r, v = horner(T, h), horner(R, h), horner(V, h)
        t += h
        if let is not None:
            side = np.where(side * horner(A, h) < 0, 0, side)
        elif hit is not None:
            at = ends_of(r)
            struck = (at * v > 0) & (side == 0)
            for i in np.flatnonzero(struck):
                impacts.append((t, int(i), int(at[i]), abs(v[i]), q.e * abs(v[i])))
            v = np.where(struck, -q.e * v, v)
            side = settle(theta, r, v)
    places, speeds = np.array(places), np.array(speeds)
    inertia = q.inertia(places)
    return {
        "t": ask.times,
        "theta": np.array(thetas),
        "omega": q.spin / inertia,
        "r": places,
        "v": speeds,
        "r_cm": q.centre(places),
        "inertia": inertia,
        "impacts": impacts,
    }


solve.name = "Taylor series of order 14"
solve.equation = "eq8"
