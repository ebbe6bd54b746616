"""Free flight by Dormand and Prince's pair with own step control and its dense output; omega is a state of its own."""
import numpy as np

C = np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1])
A = [
    [],
    [1 / 5],
    [3 / 40, 9 / 40],
    [44 / 45, -56 / 15, 32 / 9],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
    [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
]
E = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
D = np.array(
    [
        -12715105075 / 11282082432,
        0,
        87487479700 / 32700410799,
        -10690763975 / 1880347072,
        701980252875 / 199316789632,
        -1453857185 / 822651844,
        69997945 / 29380423,
    ]
)
REST_SPEED = 1e-3
TOGETHER = 1e-11


class Machine:
    def __init__(self, sc, start, rtol):
        self.n = sc.n_slices
        self.ms = sc.water_mass / self.n
        self.mb = sc.bottle.mass
        self.M = self.mb + sc.water_mass
        self.mid = sc.bottle.length / 2
        d = sc.slice_height / 2
        self.cap, self.base = d, sc.bottle.length - d
        self.Iown = self.mb * (6 * sc.bottle.radius**2 + sc.bottle.length**2) / 12
        self.e = sc.restitution
        self.drag = sc.drag
        self.rtol = rtol
        n = self.n
        self.R, self.V = slice(2, 2 + n), slice(2 + n, 2 + 2 * n)
        self.y = np.concatenate(([sc.theta0, sc.omega0], start, np.zeros(n)))
        self.t = 0.0
        self.h = 1e-3 / abs(sc.omega0)
        self.hmax = 0.25 / abs(sc.omega0)
        speed = abs(sc.omega0) * sc.bottle.length
        self.floor = np.concatenate(
            ([0.1, 0.1 * abs(sc.omega0)], np.full(n, 0.1 * sc.bottle.length), np.full(n, 0.1 * speed))
        )
        self.rest = np.zeros(n, dtype=int)
        self.body()

    def body(self):
        """Mass and centre of the tube together with what rests in it."""
        base, cap = np.count_nonzero(self.rest > 0), np.count_nonzero(self.rest < 0)
        self.bm = self.mb + self.ms * (base + cap)
        self.bc = (self.mb * self.mid + self.ms * (base * self.base + cap * self.cap)) / self.bm
        self.moving = self.rest == 0

    def cm(self, r):
        return (self.ms * r.sum(-1) + self.mb * self.mid) / self.M

    def inertia(self, r):
        c = self.cm(r)
        return self.Iown + self.ms * ((r - np.asarray(c)[..., None]) ** 2).sum(-1) + self.mb * (self.mid - c) ** 2

    def pull(self, y):
        """Acceleration of every slice relative to the tube, as if none were held."""
        w, r, v = y[1], y[self.R], y[self.V]
        return w * w * (r - self.bc) - self.drag * (v / self.ms + v.sum() / self.bm)

    def f(self, y):
        w, r, v = y[1], y[self.R], y[self.V]
        c = self.cm(r)
        growth = 2 * self.ms * ((r - c) * v).sum()
        dy = np.zeros_like(y)
        dy[0] = w
        dy[1] = -w * growth / self.inertia(r)
        dy[self.R] = v
        dy[self.V] = np.where(self.moving, self.pull(y), 0.0)
        return dy

    def attempt(self, h):
        K = np.empty((7, len(self.y)))
        K[0] = self.f(self.y)
        for s in range(1, 7):
            Y = self.y + h * (np.array(A[s]) @ K[:s])
            K[s] = self.f(Y)
        scale = self.floor + np.maximum(abs(self.y), abs(Y))
        error = np.sqrt(np.mean((h * (E @ K) / scale) ** 2)) / self.rtol
        return Y, K, error

    def step(self, limit):
        """One accepted step that does not go beyond ``limit``; returns its end, its length and its stages."""
        h = min(self.h, self.hmax, limit - self.t)
        rejected = False
        while True:
            Y, K, error = self.attempt(h)
            factor = 0.9 * max(error, 1e-10) ** -0.2
            if error <= 1.0:
                if h >= 0.99 * min(self.h, self.hmax) or factor < 1:
                    self.h = h * min(factor, 1.0 if rejected else 5.0)
                return Y, h, K
            h *= max(factor, 0.2)
            self.h = h
            rejected = True

    def between(self, Y, h, K):
        """Return the dense output as a function of x in [0, 1]."""
        y0, dy = self.y, Y - self.y
        b = h * K[0] - dy
        c = dy - h * K[6] - b
        d = h * (D @ K)

        def u(x):
            x = np.asarray(x)[..., None]
            return y0 + x * (dy + (1 - x) * (b + x * (c + (1 - x) * d)))

        return u

    def outside(self, y):
        r = y[..., self.R]
        return self.moving & ((r > self.base) | (r < self.cap))

    def strike(self, u):
        """First x in (0, 1] at which a slice is outside, or None."""
        xs = np.linspace(0, 1, 21)[1:]
        ys = u(xs)
        where = self.outside(ys).any(axis=1)
        if where.any():
            k = int(where.argmax())
            a, b = (xs[k - 1] if k else 0.0), xs[k]
        else:
            v = np.concatenate((u(np.array([0.0]))[:, self.V], ys[:, self.V]))
            r = np.concatenate((u(np.array([0.0]))[:, self.R], ys[:, self.R]))
            turning = (v[:-1] * v[1:] < 0) & self.moving & (np.sign(v[:-1]) == np.sign(r[:-1] - self.mid))
            grid = np.concatenate(([0.0], xs))
            for k, i in np.argwhere(turning):
                a, b = grid[k], grid[k + 1]
                for _ in range(50):
                    m = (a + b) / 2
                    a, b = (m, b) if u(m)[self.V][i] * v[k, i] > 0 else (a, m)
                if self.outside(u(a))[i]:
                    a, b = grid[k], a
                    break
            else:
                return None
        for _ in range(60):
            m = (a + b) / 2
            if self.outside(u(m)).any():
                b = m
            else:
                a = m
        return b

    def pressure(self, y):
        return (self.rest * self.pull(y))[self.rest != 0].min()

    def unstick(self, u, until):
        """First x at which a resting slice is pulled off, or None."""
        if self.moving.all() or self.pressure(u(until)) >= 0:
            return None
        a, b = 0.0, until
        for _ in range(60):
            m = (a + b) / 2
            if self.pressure(u(m)) < 0:
                b = m
            else:
                a = m
        return b

    def at_end(self):
        r = self.y[self.R]
        return (r >= self.base - TOGETHER).astype(int) - (r <= self.cap + TOGETHER).astype(int)

    def blow(self):
        """Impulses of all slices at the ends at once: the set of those that act grows and shrinks until it fits."""
        v, side = self.y[self.V], self.at_end()
        v[~self.moving] = 0.0
        near = (side != 0) & (side * v >= 0)
        acts = near & (v != 0)
        for _ in range(50):
            # the tube's change of speed, if just these act: dv = (1+e) sum v / (mb/ms + count)
            dv = (1 + self.e) * v[acts].sum() / (self.mb / self.ms + acts.sum())
            wanted = near & (side * ((1 + self.e) * v - dv) > 0)
            if (wanted == acts).all():
                break
            acts = wanted
        self.y[self.V] = np.where(acts, -self.e * v, v - dv)
        self.calm(side)

    def calm(self, side):
        """Slow slices at the ends come to rest and hand their momentum to the tube."""
        r, v = self.y[self.R], self.y[self.V]
        r[side > 0], r[side < 0] = self.base, self.cap
        slow = (side != 0) & (abs(v) < REST_SPEED)
        had = v.copy()
        while True:
            v[:] = np.where(slow, 0.0, had)
            self.rest = np.where(slow, side, 0)
            self.body()
            loose = slow & (side * self.pull(self.y) < 0)
            if not loose.any():
                break
            slow = slow & ~loose
        v[self.moving] -= self.ms * had[slow].sum() / self.bm

    def release(self):
        while not self.moving.all():
            loose = (self.rest != 0) & (self.rest * self.pull(self.y) < 0)
            if not loose.any():
                break
            self.rest = np.where(loose, 0, self.rest)
            self.body()


def solve(ask):
    sc = ask.scenario
    m = Machine(sc, np.asarray(ask.start, float), ask.effort)
    n = m.n
    times = np.asarray(ask.times, float)
    rows = np.empty((len(times), 2 + 2 * n))
    if sc.frozen:
        rows[:] = m.y
        rows[:, 0] = sc.theta0 + sc.omega0 * times
    else:
        m.calm(m.at_end())
        k = int(np.searchsorted(times, 0.0, side="right"))
        rows[:k] = m.y
        end = times[-1]
        while k < len(times):
            Y, h, K = m.step(end)
            u = m.between(Y, h, K)
            x, kind = 1.0, None
            hit = m.strike(u)
            if hit is not None:
                x, kind = hit, "hit"
            off = m.unstick(u, x)
            if off is not None:
                x, kind = off, "off"
            t1 = m.t + x * h
            if kind is None and end - t1 < 1e-15:
                t1 = end
            last = int(np.searchsorted(times, t1, side="right"))
            if last > k:
                rows[k:last] = u((times[k:last] - m.t) / h)
                k = last
            m.y = u(x) if kind else Y
            m.t = t1
            if kind == "hit":
                m.blow()
            elif kind == "off":
                m.release()
            if kind and end - m.t < 1e-14:
                rows[k:] = m.y
                k = len(times)
    r = rows[:, m.R]
    return {
        "t": times,
        "theta": rows[:, 0],
        "omega": rows[:, 1],
        "r": r,
        "v": rows[:, m.V],
        "r_cm": m.cm(r),
        "inertia": m.inertia(r),
    }


solve.name = "Dormand-Prince with dense output"
solve.equation = "free-flight"
solve.refined_by = "rtol"
