"""Free flight as a multibody program does it: mass matrix and forces in the lab, impacts as a complementarity problem.

Coordinates are the middle of the tube (x, y), its angle, and the places q of the slices measured from that middle
towards the base. Neither momentum nor angular momentum is put in by hand. The low-storage Runge-Kutta rule of Carpenter
and Kennedy (fourth order, five stages) goes from entry to entry of a calendar that holds the ticks of the clock and the
times at which to report.
"""

import heapq

import numpy as np
from scipy.optimize import brentq

STAGE_A = (
    0.0,
    -567301805773 / 1357537059087,
    -2404267990393 / 2016746695238,
    -3550918686646 / 2091501179385,
    -1275806237668 / 842570457699,
)
STAGE_B = (
    1432997174477 / 9575080441755,
    5161836677717 / 13612068292357,
    1720146321549 / 2090206949498,
    3134564353537 / 4481467310338,
    2277821191437 / 14882151754819,
)
TOUCH = 1e-11  # m
DEEP = 1e-13  # m
STICK = 2e-5  # m/s
TICK, REPORT = 0, 1


class Multibody:
    """A tube and the slices in it; ``side`` says which slices are fixed to it, and to which end."""

    def __init__(self, throw, start):
        tube = throw.bottle
        self.n = n = throw.n_slices
        self.m = throw.water_mass / n
        self.tube_mass = tube.mass
        self.total = tube.mass + throw.water_mass
        self.middle = tube.length / 2
        self.limit = self.middle - throw.water_mass / tube.capacity * tube.length / (2 * n)
        self.own = tube.mass * (tube.radius**2 / 2 + tube.length**2 / 12)
        self.drag = throw.drag
        self.e = throw.restitution
        self.gravity = np.array([0.0, -throw.gravity])
        self.frozen = throw.frozen
        self.launch = np.array(throw.launch_velocity)
        self.now = 0.0

        q = np.asarray(start, dtype=float) - self.middle
        u, along = self.axes(throw.theta0)
        offset = self.m * q.sum() / self.total
        self.y = np.concatenate(
            [-offset * u, [throw.theta0], q, self.launch - offset * throw.omega0 * along, [throw.omega0], np.zeros(n)]
        )
        self.matrix = np.zeros((n + 3, n + 3))
        self.matrix[0, 0] = self.matrix[1, 1] = self.total
        self.diagonal = np.arange(3, n + 3)
        self.side = np.zeros(n)
        if self.frozen:
            self.side[:] = 1.0
        else:
            self.stick()

    @staticmethod
    def axes(theta):
        """Return the direction from cap to base, and that in which the base turns."""
        sine, cosine = np.sin(theta), np.cos(theta)
        return np.array([sine, -cosine]), np.array([cosine, sine])

    def parts(self, y):
        """Return q and its rate."""
        n = self.n
        return y[3 : n + 3], y[n + 6 :]

    # ---------------------------------------------------------------- dynamics

    def rates(self, y, side):
        """Return the time derivative of the state while the slices with a side are fixed to the tube."""
        n, m = self.n, self.m
        q, q_dot = self.parts(y)
        omega = y[n + 5]
        u, along = self.axes(y[2])
        matrix, force = self.matrix, np.empty(n + 3)
        first = m * q.sum()
        matrix[0:2, 2] = matrix[2, 0:2] = first * along
        matrix[2, 2] = self.own + m * (q @ q)
        matrix[0:2, 3:] = m * u[:, None]
        matrix[3:, 0:2] = m * u
        matrix[self.diagonal, self.diagonal] = m
        coriolis = 2.0 * m * omega * q_dot
        force[0:2] = self.total * self.gravity - coriolis.sum() * along + first * omega**2 * u
        force[2] = first * (self.gravity @ along) - coriolis @ q
        force[3:] = m * omega**2 * q + m * (self.gravity @ u) - self.drag * q_dot
        fixed = 3 + np.flatnonzero(side)
        if fixed.size:
            matrix[fixed, 0:2] = 0.0
            matrix[fixed, fixed] = 1.0
            force[fixed] = 0.0
        return np.concatenate([y[n + 3 :], np.linalg.solve(matrix, force)])

    def presses(self, y, side):
        """Return the force with which each fixed slice presses on its end; infinite for the others."""
        n = self.n
        q, _ = self.parts(y)
        u, _ = self.axes(y[2])
        tube = self.rates(y, side)[n + 3 : n + 5]
        inertial = self.m * (y[n + 5] ** 2 * q + (self.gravity - tube) @ u)
        return np.where(side != 0, side * inertial, np.inf)

    def leap(self, h):
        """Return the state h later, if nothing happens before."""
        y = self.y.copy()
        register = np.zeros_like(y)
        for a, b in zip(STAGE_A, STAGE_B, strict=True):
            register *= a
            register += h * self.rates(y, self.side)
            y += b * register
        return y

    # ---------------------------------------------------------------- contacts

    def excess(self, y):
        """Return how far each free slice is beyond the end that is nearer to it, and how fast it goes there."""
        q, q_dot = self.parts(y)
        return np.where(self.side == 0, np.abs(q) - self.limit, -np.inf), np.sign(q) * q_dot

    def touched(self):
        q, _ = self.parts(self.y)
        return np.where(np.abs(q) >= self.limit - TOUCH, np.sign(q), 0.0)

    def contact_time(self, h, y):
        """Return when in (0, h] the first slice meets an end, or None; ``y`` is the state after h."""
        depth, speed = self.excess(y)
        speed_before = self.excess(self.y)[1]
        turned = (depth <= 0.0) & (depth > -self.limit) & (speed_before > 0.0) & (speed < 0.0)
        at = h
        if turned.any() and not (depth > DEEP).any():
            i = int(np.argmax(np.where(turned, depth, -np.inf)))
            at = h * speed_before[i] / (speed_before[i] - speed[i])
            depth, speed = self.excess(self.leap(at))
        if not (depth > DEEP).any():
            return None
        for _ in range(12):
            beyond = depth > DEEP
            if not beyond.any():
                break
            back = np.where(beyond, depth / np.maximum(speed, 1e-9), 0.0)
            i = int(np.argmax(back))
            for _ in range(10):
                at = min(max(at - depth[i] / max(speed[i], 1e-9), 0.0), h)
                depth, speed = self.excess(self.leap(at))
                if abs(depth[i]) < DEEP:
                    break
        return at

    def lift_time(self, h, y):
        """Return when in [0, h] the first fixed slice stops pressing, or None."""
        if self.presses(y, self.side).min() >= 0.0:
            return None
        if self.presses(self.y, self.side).min() <= 0.0:
            return 0.0
        return brentq(lambda tau: self.presses(self.leap(tau), self.side).min(), 0.0, h, xtol=1e-14)

    def strike(self):
        """Find the impulses p >= 0 after which no slice at an end approaches it faster than restitution lets it."""
        q, q_dot = self.parts(self.y)
        touched = self.touched()
        q[:] = np.where(touched != 0, touched * self.limit, q)
        q_dot[self.side != 0] = 0.0
        at = np.flatnonzero((touched != 0) & (touched * q_dot >= 0.0))
        s = touched[at]
        wanted = (1.0 + self.e) * s * q_dot[at]
        answer = np.outer(s, s) / self.tube_mass + np.eye(len(at)) / self.m
        acts = wanted > 0.0
        p = np.zeros(len(at))
        for _ in range(4 * len(at) + 4):
            p[:] = 0.0
            p[acts] = np.linalg.solve(answer[np.ix_(acts, acts)], wanted[acts])
            lacking = wanted - answer @ p
            better = np.where(acts, p > 0.0, lacking > 1e-12)
            if (better == acts).all():
                break
            acts = better
        kick = (s @ p) / self.tube_mass
        u, _ = self.axes(self.y[2])
        self.y[self.n + 3 : self.n + 5] += kick * u
        q_dot -= kick
        q_dot[at] -= s * p / self.m
        self.side = np.zeros(self.n)
        self.stick()

    def stick(self):
        """Fix the slices that lie still on an end and press on it; their last momentum goes to the tube."""
        _, q_dot = self.parts(self.y)
        side = np.where(np.abs(q_dot) < STICK, self.touched(), 0.0)
        while side.any():
            pulled = self.presses(self.y, side) <= 0.0
            if not pulled.any():
                break
            side[pulled] = 0.0
        fixed = side != 0
        passed_on = self.m * q_dot[fixed].sum() / (self.tube_mass + self.m * fixed.sum())
        u, _ = self.axes(self.y[2])
        self.y[self.n + 3 : self.n + 5] += passed_on * u
        q_dot -= passed_on
        q_dot[fixed] = 0.0
        self.side = side

    def lift(self):
        """Let go of whatever hardly presses."""
        self.side = np.where(self.presses(self.y, self.side) > 1e-8 * self.m, self.side, 0.0)

    # ---------------------------------------------------------------- calendar

    def go_until(self, when):
        """Go on to a time, event by event."""
        while when - self.now > 1e-14:
            h = when - self.now
            y = self.leap(h)
            contact = lift = None
            if not self.frozen:
                contact = self.contact_time(h, y)
                if contact is not None:
                    h = contact
                    y = self.leap(h)
                lift = self.lift_time(h, y) if self.side.any() else None
                if lift is not None:
                    h = lift
                    y = self.leap(h)
            self.y = y
            self.now += h
            if lift is not None:
                self.lift()
            elif contact is not None:
                self.strike()

    def centre_of_mass(self):
        """Return the place of the centre of mass on the axis: it flies on a parabola from the origin."""
        parabola = self.launch * self.now + self.gravity * self.now**2 / 2
        u, _ = self.axes(self.y[2])
        return self.middle + (parabola - self.y[0:2]) @ u

    def inertia(self):
        """Return the moment of inertia about the centre of mass, by Steiner from the middle of the tube."""
        q, _ = self.parts(self.y)
        offset = self.m * q.sum() / self.total
        return self.own + self.m * (q @ q) - self.total * offset**2


def solve(ask):
    """Answer one throw; ``ask.effort`` is the number of ticks of the flight."""
    body = Multibody(ask.scenario, ask.start)
    tick = ask.scenario.duration / ask.effort
    calendar = [(float(when), REPORT, k) for k, when in enumerate(ask.times)]
    calendar.append((tick, TICK, 1))
    heapq.heapify(calendar)
    rows = {name: [] for name in ("theta", "omega", "r_cm", "inertia", "r", "v")}
    while len(rows["theta"]) < len(ask.times):
        when, kind, k = heapq.heappop(calendar)
        body.go_until(when)
        if kind == TICK:
            heapq.heappush(calendar, ((k + 1) * tick, TICK, k + 1))
            continue
        q, q_dot = body.parts(body.y)
        rows["theta"].append(body.y[2])
        rows["omega"].append(body.y[body.n + 5])
        rows["r_cm"].append(body.centre_of_mass())
        rows["inertia"].append(body.inertia())
        rows["r"].append(q + body.middle)
        rows["v"].append(q_dot.copy())
    return {"t": ask.times, **{name: np.array(row) for name, row in rows.items()}}


solve.name = "multibody in the lab"
solve.equation = "free-flight"
solve.refined_by = "steps"
solve.order = 4
