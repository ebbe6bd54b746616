"""Dormand-Prince 5(4) on (r, v, theta) with its quartic dense output; impacts and releases are roots of the dense output; rtol is declared."""
import numpy as np

C = np.array([0, 1/5, 3/10, 4/5, 8/9, 1, 1])
A = [np.array(row) for row in (
    [], [1/5], [3/40, 9/40], [44/45, -56/15, 32/9],
    [19372/6561, -25360/2187, 64448/6561, -212/729],
    [9017/3168, -355/33, 46732/5247, 49/176, -5103/18656],
    [35/384, 0, 500/1113, 125/192, -2187/6784, 11/84])]
E = np.array([-71/57600, 0, 71/16695, -71/1920, 17253/339200, -22/525, 1/40])
P = np.array([
    [1, -8048581381/2820520608, 8663915743/2820520608, -12715105075/11282082432],
    [0, 0, 0, 0],
    [0, 131558114200/32700410799, -68118460800/10900136933, 87487479700/32700410799],
    [0, -1754552775/470086768, 14199869525/1410260304, -10690763975/1880347072],
    [0, 127303824393/49829197408, -318862633887/49829197408, 701980252875/199316789632],
    [0, -282668133/205662961, 2019193451/616988883, -1453857185/822651844],
    [0, 40617522/29380423, -110615467/29380423, 69997945/29380423]])


class Throw:
    def __init__(self, ask):
        sc = self.sc = ask.scenario
        self.n, self.L, self.mb, self.m = sc.n_slices, sc.bottle.length, sc.bottle.mass, sc.slice_mass
        self.lo, self.hi, self.drag, self.e = sc.r_min, sc.r_max, sc.drag, sc.restitution
        self.eps = self.mb / (self.mb + sc.water_mass)
        self.i_tube = self.mb * (sc.bottle.radius**2 / 2 + self.L**2 / 12)
        self.v_rest = 1e-5 * abs(sc.omega0) * self.L
        r = np.clip(np.asarray(ask.start, float), self.lo, self.hi)
        self.spin = self.inertia(r) * sc.omega0
        self.y = np.concatenate([r, np.zeros(self.n), [sc.theta0]])
        self.stuck = np.zeros(self.n, int)          # +1 rests on the base, -1 on the cap
        self.hits = 0
        self.settle()

    def inertia(self, r):
        cm = (1 - self.eps) * r.mean() + self.eps * self.L / 2
        return self.m * ((r - cm)**2).sum() + self.i_tube + self.mb * (self.L / 2 - cm)**2

    def body(self):
        """Mass and centre of the tube with all that rests in it."""
        base, cap = (self.stuck > 0).sum(), (self.stuck < 0).sum()
        mc = self.mb + self.m * (base + cap)
        return mc, (self.mb * self.L / 2 + self.m * (base * self.hi + cap * self.lo)) / mc

    def rate(self, y):
        r, v = y[:self.n], y[self.n:-1]
        w = self.spin / self.inertia(r)
        mc, rc = self.mc, self.rc
        acc = w * w * (r - rc) - self.drag / self.m * v - self.drag / mc * v.sum()
        return np.concatenate([v, np.where(self.free, acc, 0.0), [w]])

    def pressing(self, y):
        """Acceleration that a resting slice would have were the end not there, at (base, cap); outward is positive."""
        w = self.spin / self.inertia(y[:self.n])
        push = self.drag / self.mc * y[self.n:-1][self.free].sum()
        return w * w * (self.hi - self.rc) - push, w * w * (self.rc - self.lo) + push

    def refresh(self):
        self.free = self.stuck == 0
        self.mc, self.rc = self.body()

    def settle(self):
        """Whatever lies still at an end rests there, if it is pressed on it."""
        r, v = self.y[:self.n], self.y[self.n:-1]
        slow = np.abs(v) <= self.v_rest
        self.stuck = np.where(slow & (r >= self.hi), 1, np.where(slow & (r <= self.lo), -1, 0))
        for _ in range(3):
            self.refresh()
            base, cap = self.pressing(self.y)
            let_go = ((self.stuck > 0) & (base < 0)) | ((self.stuck < 0) & (cap < 0))
            if not let_go.any():
                break
            self.stuck[let_go] = 0
        v[self.free] -= self.m * v[~self.free].sum() / self.mc    # the last bit of their momentum goes to the tube
        v[~self.free] = 0.0

    def collide(self):
        """All slices at an end at once; P solves P = sum s p(P), p = m max(0, s ((1+e) v - P/M_b)), linear between breakpoints."""
        r, v = self.y[:self.n], self.y[self.n:-1]
        s = np.where(r >= self.hi, 1.0, np.where(r <= self.lo, -1.0, 0.0))
        touch = s != 0
        a, st = (1 + self.e) * v[touch], s[touch]
        def pulses(total):
            return self.m * np.maximum(0.0, st * (a - total / self.mb))
        def excess(total):
            return total - (st * pulses(total)).sum()
        knots = np.unique(self.mb * a)
        values = np.array([excess(k) for k in knots])
        above = np.searchsorted(values, 0.0)
        left = knots[above - 1] if above > 0 else knots[0] - 1.0
        right = knots[above] if above < len(knots) else knots[-1] + 1.0
        fl, fr = excess(left), excess(right)
        total = left - fl * (right - left) / (fr - fl)
        p = np.zeros(self.n)
        p[touch] = pulses(total)
        v -= s * p / self.m + total / self.mb
        self.hits += 1

    def first_event(self, at, tiny):
        """Smallest x in (0, 1] where a slice is past an end or a contact force has turned round (None: nothing)."""
        def gap(x):
            y = at(x)
            r = y[:self.n][self.free]
            worst = max((r - self.hi).max(), (self.lo - r).max()) - tiny if len(r) else -1.0
            base, cap = self.pressing(y)
            if base < 0 and (self.stuck > 0).any() or cap < 0 and (self.stuck < 0).any():
                worst = max(worst, tiny)
            return worst
        left = 0.0
        for right in (0.25, 0.5, 0.75, 1.0):
            if gap(right) > 0:
                break
            left = right
        else:
            return None
        for _ in range(46):
            mid = 0.5 * (left + right)
            left, right = (left, mid) if gap(mid) > 0 else (mid, right)
        return right


def solve(ask):
    f, rtol, times = Throw(ask), float(ask.effort), np.asarray(ask.times, float)
    sc, n = f.sc, f.n
    scale = np.concatenate([np.full(n, f.L), np.full(n, abs(sc.omega0) * f.L), [1.0]]) * rtol
    t, h, rows, tiny = 0.0, min(0.01 / abs(sc.omega0), sc.duration), [], 1e-13 * f.L
    locked = sc.frozen or f.hi - f.lo <= 1e-12 * f.L
    if locked:
        f.stuck[:] = 1
        f.refresh()
        rows = [np.concatenate([f.y[:-1], [sc.theta0 + sc.omega0 * x]]) for x in times]
    k0 = f.rate(f.y)
    while len(rows) < len(times):
        K = np.empty((7, len(f.y)))
        K[0] = k0
        for i in range(1, 7):
            K[i] = f.rate(f.y + h * (A[i] @ K[:i]))
        y_new = f.y + h * (A[6] @ K[:6])
        error = np.abs(h * (E @ K) / scale).max()
        if error > 1:
            h *= max(0.2, 0.9 * error**-0.2)
            continue
        Q, y_old = h * (P.T @ K), f.y
        def at(x):
            return y_old + x * (Q[0] + x * (Q[1] + x * (Q[2] + x * Q[3])))
        x = f.first_event(at, tiny)
        end = t + (h if x is None else x * h)
        while len(rows) < len(times) and (times[len(rows)] <= end or end >= sc.duration):
            rows.append(at(min((times[len(rows)] - t) / h, 1.0)))
        t = end
        if x is None:
            f.y, k0 = y_new, K[6]
        else:
            f.y = at(x)
            r, v = f.y[:n], f.y[n:-1]
            r[f.stuck > 0], r[f.stuck < 0] = f.hi, f.lo
            r[r >= f.hi - 1e-10 * f.L], r[r <= f.lo + 1e-10 * f.L] = f.hi, f.lo
            if (f.free & ((r >= f.hi) & (v > 0) | (r <= f.lo) & (v < 0))).any():
                f.collide()
            f.settle()
            k0 = f.rate(f.y)
        h *= min(5.0, 0.9 * max(error, 1e-10)**-0.2)
        h = min(h, 0.5 / abs(sc.omega0))
    Y = np.array(rows)
    r = Y[:, :n]
    inertia = np.array([f.inertia(x) for x in r])
    return dict(t=times, theta=Y[:, -1], omega=f.spin / inertia, r=r, v=Y[:, n:-1], inertia=inertia,
                r_cm=(1 - f.eps) * r.mean(axis=1) + f.eps * f.L / 2)


solve.name = "root finder"
solve.equation = "free-flight"
solve.refined_by = "rtol"
