"""Free flight of the spinning bottle in an inertial frame, Cartesian: a rigid tube and N points on its axis.

Every slice is held on the axis by a force across it (a Lagrange multiplier), and pushed along it by drag or contact.
Nothing is said about the angular momentum: it follows.  Classical Runge-Kutta, with a projection on the axis.
"""
import numpy as np

RATES = (0.0, 0.5, 0.5, 1.0)


class Body:
    def __init__(self, ask):
        s, b = ask.scenario, ask.scenario.bottle
        self.m, self.mb, self.length, self.n = s.slice_mass, b.mass, b.length, len(ask.start)
        self.mass = self.mb + self.n * self.m
        self.own = b.mass * (b.radius**2 / 2 + b.length**2 / 12)
        self.weight, self.alpha, self.e = np.array([0.0, -s.gravity]), s.drag, s.restitution
        self.top, self.bottom = s.r_min - b.length / 2, s.r_max - b.length / 2  # cap and base, from the middle
        self.stuck = s.frozen or self.bottom - self.top < 1e-12 * b.length
        self.hold = 5e-5 * abs(s.omega0) * b.length
        self.tiny = 1e-13 * b.length

    def wall(self, end):
        return np.where(end > 0, self.bottom, self.top)

    def pull(self, y, v, spin, rest):
        """Acceleration of the tube along its axis, without g: drag of the free slices, and what rests on the ends."""
        inside = rest != 0
        return (self.alpha * v[~inside].sum() + self.m * spin**2 * y[inside].sum()) / (self.mb + self.m * inside.sum())

    def pressed(self, y, v, spin, rest, end):
        """How hard a slice at rest on `end` would be pressed against it, per mass."""
        return end * (y * spin**2 - self.pull(y, v, spin, rest))


def axes(angle):
    """Unit vectors along the axis (cap to base) and across it; y points up, the angle is from straight down."""
    return np.array([np.sin(angle), -np.cos(angle)]), np.array([np.cos(angle), np.sin(angle)])


def inside(q, u):
    """Places and speeds of the slices along the axis, from the middle of the tube."""
    along, across = axes(q[0, 0])
    offset, slip = q[2:] - q[1], u[2:] - u[1]
    return offset @ along, slip @ along


def place(angle, spin, middle, drift, y, v):
    """Rows of q and of u = q': the angle (padded), the tube's middle, the slices."""
    along, across = axes(angle)
    points = middle + y[:, None] * along
    speeds = drift + v[:, None] * along + spin * y[:, None] * across
    return np.vstack([[angle, 0.0], middle, points]), np.vstack([[spin, 0.0], drift, speeds])


def forces(body, q, u, rest):
    """Accelerations u' from Newton's law, with the multipliers that keep the slices on the axis."""
    along, across = axes(q[0, 0])
    spin, (y, v) = u[0, 0], inside(q, u)
    # across the axis: a slice needs m (bend + y twist + 2 spin v), the tube feels the reaction
    moments = np.array([[body.mass, body.m * y.sum()], [body.m * y.sum(), body.own + body.m * (y**2).sum()]])
    coriolis = 2 * body.m * spin * np.array([v.sum(), (y * v).sum()])
    bend, twist = np.linalg.solve(moments, -coriolis)
    # along the axis: drag and contact
    pull = body.pull(y, v, spin, rest)
    own = np.where(rest == 0, -body.alpha / body.m * v, pull - y * spin**2)
    slices = own[:, None] * along + (bend + y * twist + 2 * spin * v)[:, None] * across
    return np.vstack([[twist, 0.0], pull * along + bend * across + body.weight, slices + body.weight])


def step(body, q, u, rest, h):
    """One step of the classical Runge-Kutta method, then the slices back onto the axis."""
    dq, du, sums = u, forces(body, q, u, rest), []
    for c in RATES:
        if sums:
            dq, du = u + c * h * sums[-1][1], forces(body, q + c * h * sums[-1][0], u + c * h * sums[-1][1], rest)
        sums.append((dq, du))
    q1, u1 = ((x + h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])) for x, k in zip((q, u), zip(*sums)))
    y, v = inside(q1, u1)
    y, v = np.where(rest != 0, inside(q, u)[0], y), np.where(rest != 0, 0.0, v)
    return place(q1[0, 0], u1[0, 0], q1[1], u1[1], y, v)


def crossing(body, start, stop, rest, h):
    """Guess of (share of the step, slice, end) of the first impact, on cubics through both ends of the step."""
    (y0, v0), (y1, v1) = start, stop
    a, b = 2 * (y0 - y1) + h * (v0 + v1), 3 * (y1 - y0) - h * (2 * v0 + v1)
    x = np.linspace(0, 1, 11)[:, None]
    found = []
    for end, wall in ((1, body.bottom), (-1, body.top)):
        beyond = end * (y0 + x * (h * v0 + x * (b + x * a)) - wall) > body.tiny
        for i in np.flatnonzero(beyond.any(axis=0) & (rest == 0)):
            cubic = [a[i], b[i], h * v0[i], y0[i] - wall]
            if abs(cubic[3]) < 10 * body.tiny:
                cubic.pop()  # leaves this end now: look for its return
            found += [
                (z.real, i, end)
                for z in np.roots(cubic)
                if abs(z.imag) < 1e-9 and 0 < z.real <= 1 and end * np.polyval([3 * a[i], 2 * b[i], h * v0[i]], z.real) > 0
            ]
    return min(found, default=None)


def kick(body, y, v, spin, end, rest):
    """Speeds after impulses on all slices at an end (Newton, Moreau), the tube's jump along the axis, and who rests."""
    touching, stays = end != 0, np.zeros(body.n, dtype=bool)
    while True:
        aim = np.where(stays, v, (1 + body.e) * v)  # the tube's jump at which a slice needs no impulse
        knots = np.sort(aim[touching])
        gap = aim[touching] - knots[:, None]
        s = end[touching]
        load = np.where(stays[touching], gap, s * np.maximum(s * gap, 0)).sum(axis=1)
        k = np.searchsorted(body.mb * knots - body.m * load, 0.0)
        upper, lower = knots[k] if k < len(knots) else np.inf, knots[k - 1] if k else -np.inf
        struck = touching & (stays | np.where(end > 0, aim >= upper, aim <= lower))
        jump = body.m * aim[struck].sum() / (body.mb + body.m * struck.sum())
        after = np.where(stays, 0.0, np.where(struck, -body.e * v, v - jump))
        slow = touching & ~stays & (np.abs(after) < body.hold)
        more = slow & (body.pressed(y, after, spin, end * stays, end) > 0)
        if not more.any():
            return after, jump, np.where(stays, end, 0)
        stays |= more


def contact(body, t, q, u, rest, impacts):
    """Impacts, rests and releases at the time t."""
    y, v = inside(q, u)
    spin = u[0, 0]
    end = (y > body.bottom - 10 * body.tiny) * 1 - (y < body.top + 10 * body.tiny) * 1
    hits = (rest == 0) & (end * v > 1e-9 * body.hold)
    lost = (rest != 0) & (body.pressed(y, v, spin, rest, end) <= 0)
    fresh = (end != 0) & (rest == 0) & (np.abs(v) <= 1e-9 * body.hold) & (body.pressed(y, v, spin, rest, end) > 0)
    y = np.where(hits | fresh, body.wall(end), y)
    drift = u[1]
    rest = np.where(lost, 0, np.where(fresh, end, rest))
    if hits.any():
        after, jump, rest = kick(body, y, v, spin, end, rest)
        drift = drift + jump * axes(q[0, 0])[0]
        impacts += [(t, i, end[i], abs(v[i]), abs(after[i])) for i in np.flatnonzero(hits)]
        v = after
    return *place(q[0, 0], spin, q[1], drift, y, v), rest


def move(body, q, u, rest, h):
    """Step h, or less (impact, release, stability); returns the step made."""
    h = min(h, 2 / (body.alpha / body.m * body.mass / body.mb + 2 * abs(u[0, 0]) + 1e-9))  # a longer one is unstable
    first, new = inside(q, u), step(body, q, u, rest, h)
    y, v = inside(*new)
    tau = h
    hit = crossing(body, first, (y, v), rest, h)
    if hit:
        share, i, end = hit
        tau = share * h
        for _ in range(8):
            new = step(body, q, u, rest, tau)
            y, v = inside(*new)
            if abs(y[i] - body.wall(end)) < 1e-15 * body.length or v[i] == 0:
                break
            tau = float(np.clip(tau - (y[i] - body.wall(end)) / v[i], tau / 2, h))
        new = step(body, q, u, rest, tau)

    def grip(x):
        """The weakest contact of a resting slice after a step x."""
        some = step(body, q, u, rest, x)
        return body.pressed(*inside(*some), some[1][0, 0], rest, rest)[rest != 0].min()

    if rest.any() and not body.stuck:
        marks = tau * np.array([0, 0.5, 1])
        late = next((k for k in (1, 2) if grip(marks[k]) < 0), 0)
        if late:
            a, b = marks[late - 1 : late + 1]
            while b - a > 1e-14 * h:
                a, b = (a, (a + b) / 2) if grip((a + b) / 2) < 0 else ((a + b) / 2, b)
                if (a + b) / 2 in (a, b):
                    break
            tau, new = b, step(body, q, u, rest, b)
    return tau, *new


def solve(ask):
    body, s = Body(ask), ask.scenario
    y = np.array(ask.start, dtype=float) - body.length / 2
    rest = np.ones(body.n, dtype=int) if body.stuck else np.zeros(body.n, dtype=int)
    along, across = axes(s.theta0)
    offset = body.m * y.sum() / body.mass  # C_M, from the tube's middle; it starts at the origin, at rest
    q, u = place(s.theta0, s.omega0, -offset * along, -offset * s.omega0 * across, y, np.zeros(body.n))
    t, impacts, rows = 0.0, [], []
    if not body.stuck:
        q, u, rest = contact(body, t, q, u, rest, impacts)
    for when in ask.times:
        count = int(np.ceil((when - t) * ask.effort / s.duration - 1e-9))
        for goal in np.linspace(t, when, count + 1)[1:]:
            while t < goal:
                made, q, u = move(body, q, u, rest, goal - t)
                t = goal if made >= goal - t else t + made
                if not body.stuck:
                    q, u, rest = contact(body, t, q, u, rest, impacts)
        y, v = inside(q, u)
        centre = body.length / 2 + body.m * y.sum() / body.mass
        r = y + body.length / 2
        inertia = body.own + body.m * ((r - centre) ** 2).sum() + body.mb * (body.length / 2 - centre) ** 2
        rows.append((q[0, 0], u[0, 0], r, v, centre, inertia))
    names = ("theta", "omega", "r", "v", "r_cm", "inertia")
    return {"t": ask.times, **{k: np.array(x) for k, x in zip(names, zip(*rows))}, "impacts": impacts}


solve.name = "free flight, Cartesian"
solve.equation = "switches:111111"
solve.refined_by = "steps"
solve.order = 4
solve.timeout = 600
