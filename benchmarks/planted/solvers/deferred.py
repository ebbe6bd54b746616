"""Free flight with recoil by spectral deferred correction: five Chebyshev nodes a window, three sweeps (order 3).

Lengths are in bottles, masses in throws, times in durations. The state holds places and speeds of N slices and, as
body N, of the tube, all measured from the common centre of mass; theta follows by quadrature. Drag is implicit in the
sweeps. Contacts are sought in the windows' polynomials; impacts solve Moreau's condition for the impulse on the tube.
"""
import numpy as np
from numba import njit

LEAN = {"error_model": "numpy"}
NODES = (1 - np.cos(np.pi * np.arange(5) / 4)) / 2
FIT = np.linalg.inv(NODES[:, None] ** np.arange(5))  # values at the nodes -> coefficients of powers
Q = (NODES[:, None] ** np.arange(1, 6) / np.arange(1, 6)) @ FIT
SWEEPS = 3


def _lower_factor():
    """The lower triangle whose sweeps damp stiff drag at once: the transposed U of LU = Q' (no pivots)."""
    a = Q[1:, 1:].T.copy()
    for k in range(4):
        for i in range(k + 1, 4):
            a[i] -= a[i, k] / a[k, k] * a[k]
    full = np.zeros((5, 5))
    full[1:, 1:] = a.T
    return full


IMPLICIT = _lower_factor()
EXPLICIT = np.tril(np.tile(np.append(np.diff(NODES), 0.0), (5, 1)), -1)
FINE = np.linspace(0.0, 1.0, 33)
TOUCH = 1e-12


@njit(**LEAN)
def spin(s, c):
    """Inertia and omega."""
    n = s.size - 1
    inertia = c[2] + c[1] * s[n] ** 2
    for i in range(n):
        inertia += c[0] * s[i] ** 2
    return inertia, c[3] / inertia


@njit(**LEAN)
def pulls(s, q, mode, c, outward, dragged):
    """Centrifugal and drag accelerations of all bodies; omega is returned."""
    n = s.size - 1
    m, mb, d = c[0], c[1], c[4]
    omega = spin(s, c)[1]
    mass, moment, drag = mb, mb * s[n], 0.0
    for i in range(n):
        if mode[i] != 0:
            mass += m
            moment += m * s[i]
        else:
            drag += q[i] - q[n]
    for i in range(n + 1):
        if i < n and mode[i] == 0:
            outward[i] = omega**2 * s[i]
            dragged[i] = -d * (q[i] - q[n])
        else:
            outward[i] = omega**2 * moment / mass
            dragged[i] = m * d * drag / mass
    return omega


@njit(**LEAN)
def window(h, theta, s, q, mode, c):
    """Places, speeds and angles at the nodes of a window of length h."""
    n = s.size - 1
    m, d = c[0], c[4]
    mass, free = c[1], 0
    for i in range(n):
        if mode[i] != 0:
            mass += m
        else:
            free += 1
    S, V = np.empty((5, n + 1)), np.empty((5, n + 1))
    E, D, old = np.empty((5, n + 1)), np.empty((5, n + 1)), np.empty((5, n + 1))
    W = np.empty(5)
    for k in range(5):
        S[k], V[k] = s, q
        W[k] = pulls(S[k], V[k], mode, c, E[k], D[k])
    E1, D1 = np.empty((5, n + 1)), np.empty((5, n + 1))
    E1[0], D1[0] = E[0], D[0]
    for sweep in range(SWEEPS):
        old[:] = V
        for k in range(1, 5):
            for i in range(n + 1):
                x = 0.0
                for j in range(5):
                    x += Q[k, j] * (E[j, i] + D[j, i])
                for j in range(1, k):
                    x += EXPLICIT[k, j] * (E1[j, i] - E[j, i]) + IMPLICIT[k, j] * (D1[j, i] - D[j, i])
                V[k, i] = q[i] + h * (x - IMPLICIT[k, k] * D[k, i])
            # drag at this node, implicitly: first the sum of the speeds in the bottle, then each
            f = h * IMPLICIT[k, k]
            total = 0.0
            for i in range(n):
                if mode[i] == 0:
                    total += V[k, i] - V[k, n]
            total /= 1 + f * d * (1 + free * m / mass)
            tube = V[k, n]
            V[k, n] += f * d * m / mass * total
            for i in range(n):
                if mode[i] == 0:
                    V[k, i] = V[k, n] + (V[k, i] - tube - f * d * m / mass * total) / (1 + f * d)
                else:
                    V[k, i] = V[k, n]
            for i in range(n + 1):
                x = 0.0
                for j in range(5):
                    x += Q[k, j] * old[j, i]
                for j in range(1, k + 1):
                    x += IMPLICIT[k, j] * (V[j, i] - old[j, i])
                S[k, i] = s[i] + h * x
            W[k] = pulls(S[k], V[k], mode, c, E1[k], D1[k])
        E[:] = E1
        D[:] = D1
    angle = np.full(5, theta)
    for k in range(5):
        for j in range(5):
            angle[k] += h * Q[k, j] * W[j]
    return S, V, angle


@njit(**LEAN)
def press(s, q, mode, side, c):
    """Acceleration with which the slices that rest on this side are pressed on it."""
    n = s.size - 1
    m = c[0]
    mass, moment, drag, place = c[1], c[1] * s[n], 0.0, 0.0
    for i in range(n):
        if mode[i] != 0:
            mass += m
            moment += m * s[i]
        else:
            drag += q[i] - q[n]
        if mode[i] == side:
            place = s[i]
    return side * (spin(s, c)[1] ** 2 * (place - moment / mass) - m * c[4] * drag / mass)


@njit(**LEAN)
def first_rise(values, tol):
    """Smallest fraction of a window where the polynomial through the nodes' values exceeds tol."""
    a = np.zeros(5)
    for k in range(5):
        for j in range(5):
            a[k] += FIT[k, j] * values[j]
    before, older = 0.0, 0.0
    for k in range(33):
        x = FINE[k]
        y = a[0] + x * (a[1] + x * (a[2] + x * (a[3] + x * a[4])))
        hi = x
        if y <= tol and k > 1 and before > older and before >= y:  # a summit between three samples
            bend = older - 2 * before + y
            hi = FINE[k - 1] + (older - y) / (2 * bend) / 32
            y = a[0] + hi * (a[1] + hi * (a[2] + hi * (a[3] + hi * a[4])))
            if y <= tol:
                y = a[0] + x * (a[1] + x * (a[2] + x * (a[3] + x * a[4])))
        if y > tol:
            if k == 0:
                return 0.0
            lo = FINE[max(k - 2, 0)] if hi < x else FINE[k - 1]
            for halving in range(46):
                mid = (lo + hi) / 2
                z = a[0] + mid * (a[1] + mid * (a[2] + mid * (a[3] + mid * a[4])))
                if z > tol:
                    hi = mid
                else:
                    lo = mid
            return hi
        older, before = before, y
    return 2.0


@njit(**LEAN)
def foresee(h, S, V, mode, skip, c, queue):
    """Fill the queue with (fraction of the window, slice, side) of contacts, and of releases with N + 1 + side as slice."""
    n = S.shape[1] - 1
    tol = 1e-14
    values = np.empty(5)
    count = 0
    for i in range(n):
        if mode[i] != 0 or i == skip:
            continue
        for side in (1, -1):
            end = c[6] if side == 1 else c[5]
            top = -1.0
            for k in range(5):
                values[k] = side * (S[k, i] - S[k, n] - end)
                top = max(top, values[k])
            speed = side * (V[0, i] - V[0, n])
            if top < -0.3 and speed < 0.0:
                continue
            on = abs(values[0]) <= TOUCH
            if on and speed > 0.0:
                at = 0.0
            else:
                if on:  # it starts on this end: divide its distance by the time since
                    values[0] = h * speed
                    values[1:] /= NODES[1:]
                at = first_rise(values, tol)
            if at <= 1.0:
                queue[count, 0], queue[count, 1], queue[count, 2] = at, i, side
                count += 1
    for side in (1, -1):
        resting = False
        for i in range(n):
            resting = resting or mode[i] == side
        if resting and skip != n + 1 + side:
            for k in range(5):
                values[k] = -press(S[k], V[k], mode, side, c)
            at = first_rise(values, 1e-13 * c[7])
            if at <= 1.0:
                queue[count, 0], queue[count, 1], queue[count, 2] = at, n + 1 + side, side
                count += 1
    return count


@njit(**LEAN)
def tube_impulse(sides, closing, m, mb, e):
    """P of Moreau's condition: P = m sum s_j max(0, (1 + e) closing_j - s_j P / mb), by Newton's steps."""
    P, lo, hi = 0.0, -1e300, 1e300
    for turn in range(200):
        value, slope = P, 1.0
        for j in range(sides.size):
            pull = (1 + e) * closing[j] - sides[j] * P / mb
            if pull > 0.0:
                value -= m * sides[j] * pull
                slope += m / mb
        if value > 0.0:
            hi = P
        else:
            lo = P
        better = P - value / slope
        if not lo <= better <= hi:
            better = (lo + hi) / 2
        if better == P or abs(value) <= 1e-18:
            break
        P = better
    return P


class Flight:
    """One throw on its way."""

    def __init__(self, ask):
        throw, bottle = ask.scenario, ask.scenario.bottle
        self.length, self.mass, self.time = bottle.length, throw.total_mass, throw.duration
        self.start = np.array(ask.start, dtype=float)
        self.n = n = self.start.size
        m, mb = throw.slice_mass / self.mass, bottle.mass / self.mass
        own = mb * ((bottle.radius / bottle.length) ** 2 / 2 + 1 / 12)
        ends = throw.r_min / self.length - 0.5, throw.r_max / self.length - 0.5
        rate = throw.omega0 * self.time
        self.c = np.array([m, mb, own, 1.0, throw.drag / throw.slice_mass * self.time, *ends, rate**2])
        y = self.start / self.length - 0.5
        for end in ends:
            y[np.abs(y - end) <= TOUCH] = end
        tube = -m * y.sum()
        self.s, self.q = np.append(y + tube, tube), np.zeros(n + 1)
        self.c[3] = spin(self.s, self.c)[0] * rate
        self.e, self.slow = float(throw.restitution), 2e-5 * abs(rate)
        self.theta, self.t = float(throw.theta0), 0.0
        self.mode, self.impacts, self.queue = np.zeros(n, dtype=np.int64), [], np.empty((2 * n + 2, 3))
        self.rigid = throw.frozen or ends[1] - ends[0] <= TOUCH
        if not self.rigid:
            self.settle(self.contacts())

    def contacts(self):
        """Side of the end that each slice touches, else 0."""
        y = self.s[:-1] - self.s[-1]
        return np.where(np.abs(y - self.c[6]) <= TOUCH, 1, np.where(np.abs(y - self.c[5]) <= TOUCH, -1, 0))

    def settle(self, touching):
        """Let the slow slices on the ends rest where they are pressed on them."""
        speed = self.q[:-1] - self.q[-1]
        held = (touching != 0) & (np.abs(speed) <= self.slow)
        m, mb = self.c[0], self.c[1]
        if held.any():  # they share the tube's speed, without a change of momentum
            joint = (mb * self.q[-1] + m * self.q[:-1][held].sum()) / (mb + m * held.sum())
            self.q[:-1][held] = joint
            self.q[-1] = joint
        at = np.where(held, touching, 0)
        for base, cap in ((1, 1), (1, 0), (0, 1), (0, 0)):
            mode = np.where((at == 1) & (base == 1), 1, np.where((at == -1) & (cap == 1), -1, 0))
            fits = True
            for side, kept in ((1, base), (-1, cap)):
                if (at == side).any():
                    force = self.push(mode, at, side)
                    fits = fits and (force > 0 if kept else force <= 0)
            if fits:
                break
        self.mode = mode

    def push(self, mode, at, side):
        """Outward acceleration in the bottle that slices at a side have, or would have without contact."""
        m, mb, d = self.c[0], self.c[1], self.c[4]
        rests = mode != 0
        speed = self.q[:-1] - self.q[-1]
        mass = mb + m * rests.sum()
        centre = (mb * self.s[-1] + m * self.s[:-1][rests].sum()) / mass
        place = self.s[:-1][at == side][0]
        omega = spin(self.s, self.c)[1]
        return side * (omega**2 * (place - centre) - m * d * speed[~rests].sum() / mass)

    def window(self, h):
        return window(h, self.theta, self.s, self.q, self.mode, self.c)

    def accept(self, h, nodes):
        S, V, angle = nodes
        self.s, self.q, self.theta = S[4].copy(), V[4].copy(), float(angle[4])
        self.t += h
        for i in np.flatnonzero(self.mode):  # rounding must not lift them
            self.s[i] = self.s[-1] + (self.c[6] if self.mode[i] > 0 else self.c[5])
            self.q[i] = self.q[-1]

    def fly(self, goal, steps):
        """Go on to the time goal in windows of at most 1 / steps."""
        count = max(1, int(np.ceil((goal - self.t) * steps - 1e-9)))
        begin = self.t
        for k in range(1, count + 1):
            line = begin + (goal - begin) * k / count
            while line - self.t > 1e-14:
                self.piece(line - self.t)
            self.t = line

    def piece(self, h):
        """One window, or its part before the first event, and that event."""
        turning = abs(spin(self.s, self.c)[1])
        if h * turning > 2.0:  # sweeps need windows of less than a third of a turn
            h = 2.0 / turning
        nodes = self.window(h)
        skip, event = -9, None
        for _ in range(40):
            found = foresee(h, nodes[0], nodes[1], self.mode, skip, self.c, self.queue)
            if not found:
                break
            k = int(np.argmin(self.queue[:found, 0]))
            at, skip, side = self.queue[k, 0], int(self.queue[k, 1]), int(self.queue[k, 2])
            h, nodes, reached = self.aim(h * at, h, skip, side)
            if reached:
                event = skip, side
            else:  # the shorter window, more exact than the longer one, does not get there
                skip, event = -9, None
        self.accept(h, nodes)
        if event is not None:
            self.handle(*event)

    def aim(self, h, longest, body, side):
        """Shorten or lengthen a window until the event is at its end."""
        release = body >= self.n
        nodes = self.window(h)
        known = None
        reached = h == 0.0
        for _ in range(12):
            if h == 0.0:
                break
            S, V, _angle = nodes
            if release:
                value = press(S[4], V[4], self.mode, side, self.c)
                if known is None:
                    start = press(S[3], V[3], self.mode, side, self.c)
                    slope = (value - start) / (h * (1 - NODES[3]))
                else:
                    slope = (value - known[1]) / (h - known[0]) if h != known[0] else 0.0
                known = h, value
                reached = abs(value) <= 1e-9 * self.c[7]
            else:
                value = S[4, body] - S[4, -1] - (self.c[6] if side > 0 else self.c[5])
                slope = V[4, body] - V[4, -1]
                reached = abs(value) <= TOUCH
            if value == 0.0 or slope == 0.0:
                break
            better = h - value / slope
            if not 0 <= better <= longest or abs(better - h) <= 1e-16:
                break
            h, nodes = better, self.window(better)
        return h, nodes, reached

    def handle(self, body, side):
        if body >= self.n:
            self.mode[self.mode == side] = 0
            return
        touching = self.contacts()
        touching[body] = side
        self.strike(touching)
        self.settle(touching)

    def strike(self, touching):
        """All slices on the ends and the tube exchange impulses at once."""
        who = np.flatnonzero(touching)
        sides = touching[who].astype(float)
        m, mb = self.c[0], self.c[1]
        before = self.q[who] - self.q[-1]
        closing = sides * before
        P = tube_impulse(sides, closing, m, mb, self.e)
        p = m * np.maximum(0.0, (1 + self.e) * closing - sides * P / mb)
        self.s[who] = self.s[-1] + np.where(sides > 0, self.c[6], self.c[5])
        self.q[who] -= sides * p / m
        self.q[-1] += P / mb
        after = self.q[who] - self.q[-1]
        unit = self.length / self.time
        for i, side, old, new, hit in zip(who, sides, before, after, p):
            if hit > 0 and side * old > 2 * self.slow:
                self.impacts.append((self.t * self.time, i, side, old * unit, new * unit))

    def row(self):
        y = self.s[:-1] - self.s[-1]
        v = (self.q[:-1] - self.q[-1]) * (self.length / self.time)
        inertia, omega = spin(self.s, self.c)
        r = (y + 0.5) * self.length
        return self.theta, omega / self.time, (0.5 - self.s[-1]) * self.length, inertia * self.mass * self.length**2, r, v


def solve(ask):
    flight = Flight(ask)
    times = np.array(ask.times, dtype=float)
    steps = float(ask.effort) if ask.effort else 1000.0
    rows = []
    for when in times:
        if flight.rigid:
            flight.theta = ask.scenario.theta0 + ask.scenario.omega0 * when
        else:
            flight.fly(when / flight.time, steps)
        rows.append(flight.row())
    names = ("theta", "omega", "r_cm", "inertia", "r", "v")
    answer = {name: np.array(column) for name, column in zip(names, zip(*rows))}
    return {"t": times, "impacts": flight.impacts} | answer


solve.name = "spectral deferred correction"
solve.equation = "free-flight"
solve.refined_by = "steps"
solve.order = 3
solve.timeout = 180.0  # compiling takes its time on a busy machine


def _warm():
    c = np.array([0.1, 0.8, 0.1, 1.0, 1.0, -0.4, 0.4, 1.0])
    s, q, mode = np.array([0.1, 0.2, -0.0375]), np.zeros(3), np.array([0, 0])
    S, V, angle = window(0.01, 0.0, s, q, mode, c)
    foresee(0.01, S, V, mode, -9, c, np.empty((6, 3)))
    tube_impulse(np.ones(1), np.ones(1), 0.1, 0.8, 0.5)


_warm()
