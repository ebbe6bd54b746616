"""Free flight from Hamilton's function, by a Rosenbrock method with its exact Jacobian matrix and dense output.

The tube is eliminated: the momentum of all along the axis is zero, so the canonical momentum p of a slice is m times
its velocity in the frame of the centre of mass, and that of the body (tube and slices lying on its ends) is -sum p:

    H = sum p^2 / 2m + (sum p)^2 / 2M + L^2 / 2J(q)

with the angular momentum L, and q from the middle of the tube. Drag is a force on q. The rule is Shampine's set of
coefficients of Kaps and Rentrop (fourth order, three slopes, one matrix). Between the ends of a step everything is a
cubic of Hermite: what is reported, the instants of impacts, and those at which a slice comes off its end.
"""

import numpy as np
from scipy.linalg import lu_factor, lu_solve

GAMMA = 0.5
A21, A31, A32 = 2.0, 48.0 / 25.0, 6.0 / 25.0
C21, C31, C32 = -8.0, 372.0 / 25.0, 12.0 / 5.0
C41, C42, C43 = -112.0 / 125.0, -54.0 / 125.0, -2.0 / 5.0
B = (19.0 / 9.0, 0.5, 25.0 / 108.0, 125.0 / 108.0)
NEAR = 1e-11  # m
SLOW = 2e-5  # m/s


def hermite(x0, d0, x1, d1, h):
    """Return the coefficients, rising, of the cubic in [0, 1] with values x and time derivatives d at the ends."""
    return x0, h * d0, 3.0 * (x1 - x0) - h * (2.0 * d0 + d1), 2.0 * (x0 - x1) + h * (d0 + d1)


def cubic(c, x):
    return c[0] + x * (c[1] + x * (c[2] + x * c[3]))


def first_rise(c0, c1, c2, c3, inclusive=False):
    """Return the least x in (0, 1] at which a cubic rises through 0, or None; with ``inclusive`` it may begin at 0."""
    if inclusive:
        coefficients = [c3, c2, c1]
    else:
        coefficients = [c3, c2, c1, c0]
    roots = np.roots(coefficients)
    real = roots[np.abs(roots.imag) < 1e-10].real
    rising = [x for x in real if 0.0 < x <= 1.0 and c1 + x * (2.0 * c2 + 3.0 * c3 * x) > 0.0]
    return min(rising, default=None)


class Canonical:
    """State and equations of motion."""

    def __init__(self, throw, start):
        bottle = throw.bottle
        self.n = throw.n_slices
        self.m = throw.water_mass / self.n
        self.bottle_mass = bottle.mass
        self.total = bottle.mass + throw.water_mass
        self.middle = bottle.length / 2.0
        self.reach = self.middle * (1.0 - throw.water_mass / bottle.capacity / self.n)
        self.shell = bottle.mass * (bottle.radius**2 / 2.0 + bottle.length**2 / 12.0)
        self.alpha = throw.drag
        self.e = throw.restitution
        self.frozen = throw.frozen
        self.theta = throw.theta0
        self.q = np.array(start, dtype=float) - self.middle
        self.p = np.zeros(self.n)
        self.fix(np.ones(self.n) if self.frozen else np.zeros(self.n))
        self.spin = self.inertia(self.q[self.free])[1] * throw.omega0
        if not self.frozen:
            self.settle(self.touched())

    def fix(self, side):
        """Make one body of the tube and the slices with a side."""
        fixed = side != 0
        self.side, self.free = side, ~fixed
        self.body = self.bottle_mass + self.m * fixed.sum()
        self.fixed_first = self.m * self.q[fixed].sum()
        self.fixed_second = self.m * (self.q[fixed] ** 2).sum()

    def inertia(self, q):
        """Return the centre of mass, from the middle, and the moment of inertia about it; q are the free slices."""
        centre = (self.fixed_first + self.m * q.sum()) / self.total
        return centre, self.shell + self.fixed_second + self.m * (q @ q) - self.total * centre**2

    def slope(self, z):
        """Return the rates of theta, q, p of the free slices."""
        k = len(z) // 2
        q, p = z[1 : k + 1], z[k + 1 :]
        centre, inertia = self.inertia(q)
        omega = self.spin / inertia
        q_dot = p / self.m + p.sum() / self.body
        return np.concatenate([[omega], q_dot, self.m * omega**2 * (q - centre) - self.alpha * q_dot])

    def jacobian(self, z):
        """Return the matrix of the derivatives of ``slope``."""
        k = len(z) // 2
        centre, inertia = self.inertia(z[1 : k + 1])
        x = z[1 : k + 1] - centre
        omega = self.spin / inertia
        omega_q = -2.0 * self.m * omega / inertia * x
        to_speed = np.eye(k) / self.m + 1.0 / self.body
        matrix = np.zeros((2 * k + 1, 2 * k + 1))
        matrix[0, 1 : k + 1] = omega_q
        matrix[1 : k + 1, k + 1 :] = to_speed
        matrix[k + 1 :, 1 : k + 1] = self.m * (
            omega**2 * (np.eye(k) - self.m / self.total) + 2.0 * omega * np.outer(x, omega_q)
        )
        matrix[k + 1 :, k + 1 :] = -self.alpha * to_speed
        return matrix

    def step(self, z, f, h):
        """Return the state after h."""
        matrix = -self.jacobian(z)
        matrix[np.diag_indices_from(matrix)] += 1.0 / (GAMMA * h)
        factors = lu_factor(matrix, check_finite=False)

        def stage(right):
            return lu_solve(factors, right, check_finite=False)

        g1 = stage(f)
        g2 = stage(self.slope(z + A21 * g1) + C21 / h * g1)
        f3 = self.slope(z + A31 * g1 + A32 * g2)
        g3 = stage(f3 + (C31 * g1 + C32 * g2) / h)
        g4 = stage(f3 + (C41 * g1 + C42 * g2 + C43 * g3) / h)
        return z + B[0] * g1 + B[1] * g2 + B[2] * g3 + B[3] * g4

    # ---------------------------------------------------------------- ends

    def touched(self):
        return np.where(np.abs(self.q) >= self.reach - NEAR, np.sign(self.q), 0.0)

    def presses(self, z, f):
        """Return the acceleration with which each fixed slice presses on its end, at a state and its slope."""
        k = len(z) // 2
        centre, _ = self.inertia(z[1 : k + 1])
        tube = -f[k + 1 :].sum() / self.body
        fixed = ~self.free
        return self.side[fixed] * (f[0] ** 2 * (self.q[fixed] - centre) - tube)

    def pack(self):
        return np.concatenate([[self.theta], self.q[self.free], self.p[self.free]])

    def unpack(self, z):
        k = len(z) // 2
        self.theta = z[0]
        self.q[self.free], self.p[self.free] = z[1 : k + 1], z[k + 1 :]
        self.p[~self.free] = -self.m * z[k + 1 :].sum() / self.body

    def settle(self, touched):
        """Fix what touches an end, is slow and presses; the free slices keep their momenta."""
        speed = self.p / self.m + self.p.sum() / self.bottle_mass
        side = np.where(np.abs(speed) < SLOW, touched, 0.0)
        while True:
            self.fix(side)
            z = self.pack()
            pulled = self.presses(z, self.slope(z)) <= 0.0
            if not pulled.any():
                break
            side = side.copy()
            side[np.flatnonzero(side)[pulled]] = 0.0

    def release(self, z):
        """Let go of the slices that press no more."""
        pressing = self.presses(z, self.slope(z)) > 1e-7
        side = self.side.copy()
        side[np.flatnonzero(side)[~pressing]] = 0.0
        self.fix(side)

    def impact(self):
        """Throw back what moves against an end; U is what the tube gains by all of it at once."""
        touched = self.touched()
        self.q = np.where(touched != 0, touched * self.reach, self.q)
        speed = self.p / self.m + self.p.sum() / self.bottle_mass
        speed[self.side != 0] = 0.0
        hits = (touched != 0) & (touched * speed >= 0.0)
        s, v = touched[hits], speed[hits]

        def impulses(gain):
            return self.m * np.maximum(s * ((1.0 + self.e) * v - gain), 0.0)

        # mass * gain - (what the slices give) rises with the gain
        low = high = 0.0
        bound = (1.0 + self.e) * np.abs(v).max(initial=0.0)
        low, high = -bound, bound
        for _ in range(200):
            gain = 0.5 * (low + high)
            if self.bottle_mass * gain > (s * impulses(gain)).sum():
                high = gain
            else:
                low = gain
            if high - low < 1e-16:
                break
        self.p[hits] -= s * impulses(0.5 * (low + high))
        self.settle(touched)

    def next_event(self, z0, f0, z1, f1, h):
        """Return (x, kind) of the first event in a step, x in [0, 1], or None."""
        k, found = len(z0) // 2, None
        q0, d0, q1, d1 = z0[1 : k + 1], f0[1 : k + 1], z1[1 : k + 1], f1[1 : k + 1]
        for side in (1.0, -1.0):
            before, after = side * q0 - self.reach, side * q1 - self.reach
            suspects = (after > 0.0) | ((side * d0 > 0.0) & (side * d1 < 0.0) & (after > -0.2 * self.reach))
            for i in np.flatnonzero(suspects):
                c = hermite(before[i], side * d0[i], after[i], side * d1[i], h)
                x = first_rise(*c, inclusive=before[i] >= -NEAR and side * d0[i] <= 0.0)
                if x is None and after[i] > NEAR:
                    x = 1.0
                if x is not None and (found is None or x < found[0]):
                    found = x, "impact"
        if not self.free.all():
            ahead = self.presses(z1, f1)
            if ahead.min() < 0.0:
                x = self.lift_off(z0, f0, z1, f1, h)
                if found is None or x < found[0]:
                    found = x, "release"
        return found

    def lift_off(self, z0, f0, z1, f1, h):
        """Return where in the step a fixed slice first presses no more, by bisection along the cubic."""
        c = hermite(z0, f0, z1, f1, h)
        low, high = 0.0, 1.0
        if self.presses(z0, f0).min() <= 0.0:
            return 0.0
        while high - low > 1e-11:
            x = 0.5 * (low + high)
            z = cubic(c, x)
            if self.presses(z, self.slope(z)).min() < 0.0:
                high = x
            else:
                low = x
        return high


def solve(ask):
    """Answer one throw: steps of ``ask.effort`` from event to event, and reports from inside the steps."""
    body = Canonical(ask.scenario, ask.start)
    points = len(ask.times)
    theta, omega, r_cm, inertia = (np.empty(points) for _ in range(4))
    now, row = 0.0, 0
    z = body.pack()
    f = body.slope(z)
    while row < points:
        h = ask.effort
        ahead = body.step(z, f, h)
        slope_ahead = body.slope(ahead)
        event = None if body.frozen else body.next_event(z, f, ahead, slope_ahead, h)
        used = 1.0 if event is None else event[0]
        way = hermite(z, f, ahead, slope_ahead, h)
        while row < points and ask.times[row] <= now + used * h:
            at = cubic(way, (ask.times[row] - now) / h)
            k = len(at) // 2
            theta[row] = at[0]
            r_cm[row], inertia[row] = body.inertia(at[1 : k + 1])
            omega[row] = body.spin / inertia[row]
            row += 1
        now += used * h
        if event is None:
            z, f = ahead, slope_ahead
            continue
        at = cubic(way, used)
        body.unpack(at)
        if event[1] == "impact":
            body.impact()
        else:
            body.release(at)
        z = body.pack()
        f = body.slope(z)
    return {"t": ask.times, "theta": theta, "omega": omega, "r_cm": r_cm + body.middle, "inertia": inertia}


solve.name = "Hamilton and Rosenbrock"
solve.equation = "free-flight"
solve.refined_by = "dt"
solve.order = 4
