"""Free flight with recoil, as N + 1 bodies on the turning axis, each at its place from the common centre of mass.

The tube (its centre at y_b) and the slices (at y_i) swing freely about C_M; drag acts between each slice and the tube.
Slices that rest on an end move with the tube as one body.  SciPy's DOP853 integrates from one contact event to the next.
"""
import numpy as np
from scipy.integrate import DOP853

LOOKS = np.linspace(0.0, 1.0, 9)[1:]


class Flight:
    def __init__(self, ask):
        throw, bottle = ask.scenario, ask.scenario.bottle
        self.throw = throw
        self.n = len(ask.start)
        self.m, self.tube = throw.slice_mass, bottle.mass
        self.all = bottle.mass + self.n * throw.slice_mass
        self.half = bottle.length / 2
        self.own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.base, self.cap = throw.r_max - self.half, throw.r_min - self.half  # from the tube's centre
        speed = abs(throw.omega0) * bottle.length
        self.still = 5e-5 * speed
        self.touch = 1e-13 * bottle.length
        self.rtol = max(1e-3 * ask.effort, 1e-13)
        scale = np.full(2 * self.n + 3, bottle.length)
        scale[0], scale[2], scale[3 + self.n :] = 1.0, speed, speed
        self.atol = self.rtol * scale
        self.side = np.zeros(self.n, dtype=int)  # 1: rests on the base, -1: on the cap
        self.impacts = []
        z = ask.start - self.half
        self.side[z > self.base - 10 * self.touch] = 1
        self.side[z < self.cap + 10 * self.touch] = -1
        self.t = 0.0
        self.y = self.pack(throw.theta0, z, np.zeros(self.n))
        self.spin = self.inertia(self.y) * throw.omega0
        self.let_go()

    # state: theta, y_b, y_b', y_1 .. y_N, y_1' .. y_N'

    def pack(self, theta, z, v):
        """Return the state in which the slices have these places and speeds in the tube, and C_M stays at 0."""
        y_b, u_b = -self.m * z.sum() / self.all, -self.m * v.sum() / self.all
        return np.concatenate(([theta, y_b, u_b], z + y_b, v + u_b))

    def in_tube(self, y):
        """Return the slices' places from the tube's centre and their speeds in the tube."""
        return y[3 : 3 + self.n] - y[1], y[3 + self.n :] - y[2]

    def inertia(self, y):
        return self.own + self.tube * y[1] ** 2 + self.m * (y[3 : 3 + self.n] ** 2).sum(axis=0)

    def forces(self, y):
        """Return omega, the acceleration of tube and resting slices, and that of a free slice at each one's place."""
        omega = self.spin / self.inertia(y)
        places, speeds = y[3 : 3 + self.n], y[3 + self.n :]
        rests = self.side != 0
        drag = self.throw.drag * (speeds - y[2])
        pull = omega**2 * (self.tube * y[1] + self.m * places[rests].sum()) + drag[~rests].sum()
        a_tube = pull / (self.tube + self.m * np.count_nonzero(rests))
        return omega, a_tube, omega**2 * places - drag / self.m

    def rates(self, _, y):
        omega, a_tube, a_free = self.forces(y)
        rests = self.side != 0
        if self.throw.frozen:
            return np.concatenate(([omega], np.zeros(len(y) - 1)))
        u = np.where(rests, y[2], y[3 + self.n :])
        return np.concatenate(([omega, y[2], a_tube], u, np.where(rests, a_tube, a_free)))

    def pressed(self, y):
        """Return how strongly each end pushes its resting slices inward [m/s^2]; inf for free slices."""
        omega, a_tube, _ = self.forces(y)
        return np.where(self.side == 0, np.inf, self.side * (omega**2 * y[3 : 3 + self.n] - a_tube))

    def gaps(self, y):
        """Return how far each free slice is beyond the base, and beyond the cap; y may hold several states as columns."""
        z = y[3 : 3 + self.n] - y[1]
        gap = np.array([z - self.base, self.cap - z])
        gap[:, self.side != 0] = -np.inf
        return gap

    def happened(self, y):
        """Whether a free slice is beyond an end or a resting one is pulled away from its end."""
        if (self.gaps(y) > self.touch).any():
            return True
        return bool(self.throw.drag and self.side.any() and (self.pressed(y) < 0).any())

    def let_go(self):
        self.side[self.pressed(self.y) < 0] = 0

    def impulses(self, z, v):
        """Return the impulse on each slice by Newton's law with Moreau's condition."""
        s = np.where(z > self.base - 10 * self.touch, 1, np.where(z < self.cap + 10 * self.touch, -1, 0))
        need = self.m * (1 + self.throw.restitution) * s * v  # what each slice would take from a tube that cannot move
        active = (s != 0) & (need > 0)
        for _ in range(4 * self.n + 8):
            kick = (s * need)[active].sum() / (self.tube + self.m * np.count_nonzero(active))  # the tube's velocity
            wants = (s != 0) & (need - self.m * s * kick > 0)
            if (wants == active).all():
                break
            active = wants
        return s, np.where(active, need - self.m * s * kick, 0.0), kick

    def strike(self):
        """Let the slices that arrived at an end rebound, the tube recoil, and the slow ones lie down."""
        z, v = self.in_tube(self.y)
        z[self.side == 1], z[self.side == -1] = self.base, self.cap
        v[self.side != 0] = 0.0
        z = np.clip(z, self.cap, self.base)
        s, impulse, kick = self.impulses(z, v)
        after = v - s * impulse / self.m - kick
        lies = (s != 0) & (np.abs(after) < self.still)
        after[lies] = 0.0
        for i in np.flatnonzero((impulse > 0) & (s * v > self.still)):
            self.impacts.append((self.t, int(i), int(s[i]), v[i], after[i]))
        z = np.where(s > 0, self.base, np.where(s < 0, self.cap, z))
        self.side = np.where(lies, s, 0)
        self.y = self.pack(self.y[0], z, after)
        self.let_go()

    def first_event(self, dense, t0, t1):
        """Return when the first event of a step happens, or None."""
        before = t0
        for x in LOOKS:
            now = t0 + x * (t1 - t0)
            if self.happened(dense(now)):
                break
            before = now
        else:
            return None
        while True:
            middle = (before + now) / 2
            if not before < middle < now:
                return now
            if self.happened(dense(middle)):
                now = middle
            else:
                before = middle

    def run(self, times):
        rows, last = [], times[-1]
        while times[len(rows)] <= self.t:
            rows.append(self.y.copy())
            if len(rows) == len(times):
                return np.array(rows)
        pace = None
        while len(rows) < len(times):
            stepper = DOP853(self.rates, self.t, self.y, last, rtol=self.rtol, atol=self.atol, first_step=pace)
            event = None
            while stepper.status == "running" and event is None:
                stepper.step()
                if stepper.status == "failed":
                    raise RuntimeError(f"no step is small enough at t = {stepper.t}")
                dense = stepper.dense_output()
                event = self.first_event(dense, stepper.t_old, stepper.t)
                until = stepper.t if event is None else event
                while len(rows) < len(times) and times[len(rows)] <= until:
                    rows.append(dense(times[len(rows)]))
            if event is None:
                break
            self.t, self.y = event, dense(event)
            pace = min(stepper.h_abs, (last - event) / 2) or None
            if (self.gaps(self.y) > self.touch).any():
                self.strike()
            else:
                self.let_go()
        return np.array(rows)


def solve(ask):
    flight = Flight(ask)
    times = np.asarray(ask.times, dtype=float)
    y = flight.run(times).T
    inertia = flight.inertia(y)
    z, v = y[3 : 3 + flight.n] - y[1], y[3 + flight.n :] - y[2]
    r = np.clip(z + flight.half, ask.scenario.r_min, ask.scenario.r_max)
    return {
        "t": times,
        "theta": y[0],
        "omega": flight.spin / inertia,
        "r": r.T,
        "v": v.T,
        "r_cm": flight.half - y[1],
        "inertia": inertia,
        "impacts": flight.impacts,
    }


solve.equation = "free-flight"
solve.refined_by = "rtol"
solve.timeout = 300.0
