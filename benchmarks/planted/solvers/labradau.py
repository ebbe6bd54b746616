# Free flight in the laboratory: N slices and a tube on a line that turns about their common centre of mass.
# Units: length L, time 1/|omega_0|, mass of a slice.  Collocation at the three Radau points, order 5; the drag is
# linear and is solved exactly in the stages (one 3 x 3 matrix for the differences of the slices, one for tube
# against water), only the centrifugal part is iterated.
import numpy as np

ROOT = 6**0.5
NODES = np.array([(4 - ROOT) / 10, (4 + ROOT) / 10, 1.0])
RADAU = np.array([[(88 - 7 * ROOT) / 360, (296 - 169 * ROOT) / 1800, (-2 + 3 * ROOT) / 225],
                  [(296 + 169 * ROOT) / 1800, (88 + 7 * ROOT) / 360, (-2 - 3 * ROOT) / 225],
                  [(16 - ROOT) / 36, (16 + ROOT) / 36, 1 / 9]])
EYE = np.eye(3)
HAIR = 1e-13                     # a distance (of L) that counts as nothing
NEAR = 1e-11                     # slices nearer than this to an end at an impact are touching


class Bottle:
    """The throw in units of L, 1/|omega_0| and m."""

    def __init__(self, sc):
        L, w0 = sc.bottle.length, abs(sc.omega0)
        m = sc.water_mass / sc.n_slices
        self.L, self.w0, self.m = L, w0, m
        self.N = sc.n_slices
        self.M = sc.bottle.mass / m
        self.k = sc.drag / m / w0
        self.e = sc.restitution
        self.own = self.M * ((sc.bottle.radius / L)**2 / 2 + 1 / 12)
        self.half = 0.5 - sc.r_min / L             # the ends are at -half, +half from the middle of the tube
        self.slow = 1e-5
        self.sign = 1.0 if sc.omega0 > 0 else -1.0
        self.fixed = sc.frozen or self.half < 1e-12

    def J(self, s, sb):
        return (s**2).sum(axis=-1) + self.own + self.M * sb**2


class State:
    """positions and velocities along the axis from the centre of mass; theta in the direction of the spin"""

    def __init__(self, s, u, sb, ub, theta):
        self.s, self.u, self.sb, self.ub, self.theta = s, u, sb, ub, theta

    def rel(self):
        return self.s - self.sb, self.u - self.ub


def overshoot(x, half):
    return np.abs(x) - half


class Radau:
    def __init__(self, b, spin, state, rest):
        self.b, self.spin, self.rest = b, spin, rest
        self.free = ~rest
        self.nf = int(self.free.sum())
        self.mc = b.M + (b.N - self.nf)
        self.kappa = b.k * (1 + self.nf / self.mc)
        sc = (b.M * state.sb + state.s[rest].sum()) / self.mc
        self.offset = state.sb - sc                               # middle of the tube from the composite's centre
        self.seat = state.s[rest] - sc                            # resting slices from there
        self.cache = (None, None, None)

    def solves(self, h):
        if self.cache[0] != h:
            hA = h * RADAU
            self.cache = (h, np.linalg.inv(EYE + self.b.k * hA), np.linalg.inv(EYE + self.kappa * hA))
        return self.cache[1:]

    def omega(self, S, Sc):
        """at the stages: S (3, nf), Sc (3,)"""
        inertia = (S**2).sum(axis=1) + self.b.own + self.b.M * (Sc + self.offset)**2
        if self.seat.size:
            inertia = inertia + ((Sc[:, None] + self.seat)**2).sum(axis=1)
        return self.spin / inertia

    def step(self, state, h, depth=0):
        b, nf, mc = self.b, self.nf, self.mc
        if nf == 0:
            omega = self.spin / b.J(state.s, state.sb)
            return State(state.s, state.u, state.sb, state.ub, state.theta + h * omega)
        hA = h * RADAU
        inv_d, inv_c = self.solves(h)
        S0, U0 = state.s[self.free], state.u[self.free]
        mean0 = U0.mean()
        D0, C0 = U0 - mean0, mean0 - state.ub
        S = S0 + (h * NODES)[:, None] * U0
        last = np.inf
        for sweep in range(40):
            mean = S.sum(axis=1) / nf
            Sc = -nf * mean / mc
            omega = self.omega(S, Sc)
            w2 = (omega**2)[:, None]
            D = inv_d @ (D0 + hA @ (w2 * (S - mean[:, None])))
            C = inv_c @ (C0 + hA @ (omega**2 * (mean - Sc)))
            U = D + (mc / (mc + nf) * C)[:, None]
            new = S0 + hA @ U
            change = np.abs(new - S).max()
            S = new
            if change < 1e-15 or change >= last and change < 1e-13:
                break
            last = change
        else:
            if depth < 12:
                middle = self.step(state, h / 2, depth + 1)
                return self.step(middle, h / 2, depth + 1)
        sc = -S[2].sum() / mc
        ub = -nf / (mc + nf) * C[2]
        s, u = np.empty(b.N), np.empty(b.N)
        s[self.free], u[self.free] = S[2], U[2]
        s[self.rest], u[self.rest] = sc + self.seat, ub
        return State(s, u, sc + self.offset, ub, state.theta + hA[2] @ omega)

    def outward(self, state):
        """what the base and the cap have to hold back"""
        b = self.b
        omega2 = (self.spin / b.J(state.s, state.sb))**2
        sc = state.sb - self.offset
        drag = b.k * (state.u[self.free] - state.ub).sum() / self.mc
        return np.array([omega2 * (state.sb + b.half - sc) - drag, drag - omega2 * (state.sb - b.half - sc)])


def settle(b, spin, state):
    """which slices stay at rest on their end, and the motion that follows"""
    x, v = state.rel()
    still = (np.abs(overshoot(x, b.half)) < HAIR) & (np.abs(v) < 1e-13)
    ends = [still & (x > 0), still & (x < 0)]
    best = None
    for keep in ((True, True), (True, False), (False, True), (False, False)):
        if any(k and not end.any() for k, end in zip(keep, ends)):
            continue
        radau = Radau(b, spin, state, ends[0] & keep[0] | ends[1] & keep[1])
        force = radau.outward(state)
        fault = max([0.0] + [-f if k else f for f, k, end in zip(force, keep, ends) if end.any()])
        if best is None or fault < best[0]:
            best = fault, radau
    return best[1]


def strike(b, state):
    """the impact: impulses of all slices that touch an end, in the laboratory"""
    x, v = state.rel()
    touch = overshoot(x, b.half) > -NEAR
    side = np.sign(x)
    s, u = state.s.copy(), state.u.copy()
    sb, ub = state.sb, state.ub
    T = np.nonzero(touch)[0]
    want = (1 + b.e) * side[T] * v[T]                 # wanted change of the outward velocity
    active = want > 0
    for turn in range(len(T) * 4 + 60):
        # tube's change of velocity if the active ones push:  p_i = want_i - side_i dub,  M dub = sum side_i p_i
        dub = (side[T] * want)[active].sum() / (b.M + active.sum())
        should = want - side[T] * dub > 0
        if (should == active).all():
            break
        if turn < 40:
            active = should
        else:
            i = np.nonzero(should != active)[0][0]
            active[i] = should[i]
    p = np.where(active, want - side[T] * dub, 0.0)
    u[T] -= side[T] * p
    ub += dub
    # slow ones stay with the tube
    calm = T[np.abs(u[T] - ub) < b.slow]
    if calm.size:
        ub = (b.M * ub + u[calm].sum()) / (b.M + calm.size)
        u[calm] = ub
    # exactly on the ends
    s[T] = sb + side[T] * b.half
    return State(s, u, sb, ub, state.theta)


class Throw:
    def __init__(self, sc, start):
        b = self.b = Bottle(sc)
        x = np.asarray(start, dtype=float) / b.L - 0.5
        x = np.where(np.abs(overshoot(x, b.half)) < 1e-12, np.sign(x) * b.half, x)
        self.x, self.v = x, np.zeros(b.N)
        sb = -x.sum() / (b.M + b.N)
        self.state = State(x + sb, np.zeros(b.N), sb, 0.0, 0.0)
        self.spin = b.J(self.state.s, sb)
        self.t = 0.0
        self.hits = []

    def pieces(self, h_grid, last):
        """yields (start time, state, motion, length) of smooth pieces"""
        b = self.b
        radau = settle(b, self.spin, self.state)
        j = 0
        while self.t < last:
            goal = (j + 1) * h_grid
            h = goal - self.t
            if h < 1e-14 * goal:
                j += 1
                continue
            state = self.state
            new = radau.step(state, h)
            tau, event = h, None
            bound = first_bound(b, radau, state, new, h)
            if bound is not None:
                tau, new = locate(b, radau, state, *bound)
                event = "hit"
            if radau.rest.any():
                found = unseat(b, radau, state, new, tau)
                if found is not None:
                    tau, new, event = *found, "loose"
            yield self.t, tau, state, radau
            self.t = self.t + tau if event else goal
            if event is None:
                j += 1
            if event == "hit":
                x, v = new.rel()
                for i in np.nonzero((overshoot(x, b.half) > -NEAR) & (x * v > 0))[0]:
                    self.hits.append((self.t / b.w0, int(i), float(v[i] * b.L * b.w0)))
                new = strike(b, new)
            self.state = new
            if event:
                radau = settle(b, self.spin, new)


def first_bound(b, radau, state, new, h):
    """(time, state) by which some slice is certainly outside, or None"""
    free = radau.free
    x0, v0 = state.rel()
    x1, v1 = new.rel()
    side = np.sign(x1)
    turn = free & (side * v0 > 0) & (side * v1 < 0)
    for i in np.nonzero(turn)[0]:
        # cubic through both ends
        q, sg = h, side[i]
        a0, d0, a1, d1 = sg * x0[i], sg * v0[i] * q, sg * x1[i], sg * v1[i] * q
        c2, c3 = 3 * (a1 - a0) - 2 * d0 - d1, 2 * (a0 - a1) + d0 + d1
        z = -d0 / (c2 - max(c2 * c2 - 3 * c3 * d0, 0.0)**0.5)
        if 0 < z < 1 and a0 + z * (d0 + z * (c2 + z * c3)) > b.half:
            top = radau.step(state, z * h)
            if overshoot(top.rel()[0], b.half)[free].max() > HAIR:
                h, new = z * h, top
                break
    if free.any() and overshoot(new.rel()[0], b.half)[free].max() > HAIR:
        return h, new
    return None


def locate(b, radau, state, hi, new):
    """the first contact of a free slice, by repeated steps of other lengths"""
    lo, tau = 0.0, hi
    free = radau.free
    for trial in range(60):
        x, v = new.rel()
        gap, speed = overshoot(x, b.half), np.sign(x) * v
        out = free & (gap > HAIR)
        going = free & (speed > 0)
        if out.any():
            hi, pick = tau, out & going
            guess = tau - (gap[pick] / speed[pick]).max() if pick.any() else lo
        elif (going & (gap > -HAIR)).any():
            break
        else:
            lo = tau
            guess = tau - (gap[going] / speed[going]).max() if going.any() else hi
        if not lo < guess < hi:
            guess = (lo + hi) / 2
            if not lo < guess < hi:
                break
        tau = guess
        new = radau.step(state, tau)
    return tau, new


def unseat(b, radau, state, new, hi):
    """(time, state) when an end no longer presses its slices, or None"""
    x, _ = state.rel()
    held = np.array([(radau.rest & (x > 0)).any(), (radau.rest & (x < 0)).any()])
    if radau.outward(new)[held].min() > 0:
        return None
    lo, flo = 0.0, max(radau.outward(state)[held].min(), 0.0)
    fhi = radau.outward(new)[held].min()
    for trial in range(70):
        if hi - lo < 1e-13 or fhi == 0:
            break
        tau = lo + (hi - lo) * (flo / (flo - fhi) if trial % 3 != 2 else 0.5)
        tau = min(max(tau, lo + 1e-3 * (hi - lo)), hi - 1e-3 * (hi - lo))
        middle = radau.step(state, tau)
        f = radau.outward(middle)[held].min()
        if f > 0:
            lo, flo = tau, f
        else:
            hi, fhi, new = tau, f, middle
    return hi, new


def solve(ask):
    sc = ask.scenario
    throw = Throw(sc, ask.start)
    b = throw.b
    times = np.asarray(ask.times, dtype=float) * b.w0
    T = sc.duration * b.w0
    steps = max(1, int(round(ask.effort)))
    x, v = np.empty((len(times), b.N)), np.zeros((len(times), b.N))
    theta = np.empty(len(times))
    row = 0
    if b.fixed:
        x[:], theta[:] = throw.x, times
    else:
        while row < len(times) and times[row] <= 0:
            x[row], theta[row] = throw.x, 0.0
            row += 1
        for t, tau, state, radau in throw.pieces(T / steps, times[-1]):
            while row < len(times) and times[row] <= t + tau:
                then = radau.step(state, times[row] - t)
                x[row], v[row] = then.rel()
                theta[row] = then.theta
                row += 1
        while row < len(times):                         # the last time, if rounding left it
            x[row], v[row] = throw.state.rel()
            theta[row] = throw.state.theta
            row += 1
    sb = -x.sum(axis=1) / (b.M + b.N)
    J = b.J(x + sb[:, None], sb)
    return {"t": np.asarray(ask.times, dtype=float),
            "theta": sc.theta0 + b.sign * theta,
            "omega": sc.omega0 * throw.spin / J,
            "r": (x + 0.5) * b.L,
            "v": v * b.L * b.w0,
            "r_cm": (0.5 - sb) * b.L,
            "inertia": J * b.m * b.L**2}


solve.name = "Radau collocation in the laboratory frame"
solve.equation = "free-flight"
solve.refined_by = "steps"
solve.order = 5
