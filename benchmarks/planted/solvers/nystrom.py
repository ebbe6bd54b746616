"""Free flight by Nystroem's method of order 4 for N + 1 bodies on the axis, seen from the common centre of mass.

Bodies 0 to N - 1 are the slices, body N is the tube. s is a body's place along the axis, from C_M towards the base;
weight drops out. A tolerance governs the steps. The quintic through place, speed and acceleration at the ends of a step
answers at the times asked and locates impacts and releases. An impact changes the momenta of the bodies in contact.
"""

import numpy as np

COUNT = np.arange(6)
NODES = np.array([0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0])
BASIS = NODES[:, None] ** COUNT


def slopes_of(basis):
    """d/ds of the powers 0 to 5 of s, from the powers themselves."""
    out = np.zeros_like(basis)
    out[..., 1:] = basis[..., :-1] * COUNT[1:]
    return out


BASIS_SLOPES = slopes_of(BASIS)


class Flight:
    """One throw: bodies, contacts and the motion between two events."""

    def __init__(self, throw, start):
        bottle = throw.bottle
        self.n = n = len(start)
        self.length = bottle.length
        self.mass = np.append(np.full(n, throw.slice_mass), bottle.mass)
        self.drag = throw.drag
        self.bounce = 1.0 + throw.restitution
        self.top = throw.r_max - bottle.length / 2  # reach of a slice from the tube's middle
        self.tiny = 1e-11 * bottle.length
        self.speed = abs(throw.omega0) * bottle.length
        self.slow = max(5e-5 * self.speed, 1e-12)
        self.own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.s = np.append(start - bottle.length / 2, 0.0)
        self.s -= self.mass @ self.s / self.mass.sum()
        self.v = np.zeros(n + 1)
        self.theta = throw.theta0
        self.spin = (self.own + self.mass @ self.s**2) * throw.omega0
        self.side = np.zeros(n, dtype=int)
        self.fix(self.side)

    def fix(self, side):
        """Slices rest (side 1 on the base, -1 on the cap) or fly (0)."""
        self.side = side
        self.bound = np.append(side != 0, True)
        self.resting = bool(side.any())
        self.bound_mass = self.mass[self.bound]
        self.bound_total = self.bound_mass.sum()

    def loose(self, s, v):
        """Accelerations of the bodies if none were held, and omega; s and v have the shape (..., N + 1)."""
        omega = self.spin / (self.own + (s * s) @ self.mass)
        a = (omega * omega)[..., None] * s
        if self.drag:
            force = self.drag * (v[..., :-1] - v[..., -1:])
            a[..., :-1] -= force / self.mass[0]
            a[..., -1] += force.sum(axis=-1) / self.mass[-1]
        return a, omega

    def pull(self, s, v):
        """Accelerations of the bodies, and omega."""
        a, omega = self.loose(s, v)
        if self.resting:
            a[self.bound] = self.bound_mass @ a[self.bound] / self.bound_total
        return a, omega

    def omega_rate(self, s, v, omega):
        return -2.0 * (self.mass @ (s * v)) * omega * omega / self.spin

    def nystroem(self, h, a, omega):
        """One step of Nystroem's method; also the difference from an embedded method of order 3."""
        s, v = self.s, self.v
        middle = s + h / 2 * v + h * h / 8 * a
        a2, omega2 = self.pull(middle, v + h / 2 * a)
        a3, _ = self.pull(middle, v + h / 2 * a2)
        a4, omega4 = self.pull(s + h * v + h * h / 2 * a3, v + h * a3)
        s1 = s + h * v + h * h / 6 * (a + a2 + a3)
        v1 = v + h / 6 * (a + 2 * (a2 + a3) + a4)
        theta1 = self.theta + h / 6 * (omega + 4 * omega2 + omega4)
        a5, omega5 = self.pull(s1, v1)
        wrong = max(np.abs(a5 - a4).max() / self.speed, abs(omega5 - omega4)) * h / 6
        return s1, v1, theta1, a5, omega5, wrong

    def path(self, h, a, omega, after):
        """Coefficients (6, N + 2) of the quintics of s and theta in (t - t_0)/h."""
        s1, v1, theta1, a1, omega1, _ = after
        rate = self.omega_rate(self.s, self.v, omega)
        rate1 = self.omega_rate(s1, v1, omega1)
        c = np.empty((6, self.n + 2))
        c[0, :-1], c[0, -1] = self.s, self.theta
        c[1, :-1], c[1, -1] = h * self.v, h * omega
        c[2, :-1], c[2, -1] = h * h / 2 * a, h * h / 2 * rate
        x, y, z = np.empty((3, self.n + 2))
        x[:-1], x[-1] = s1, theta1
        y[:-1], y[-1] = h * v1, h * omega1
        z[:-1], z[-1] = h * h * a1, h * h * rate1
        x -= c[0] + c[1] + c[2]
        y -= c[1] + 2 * c[2]
        z -= 2 * c[2]
        c[3] = 10 * x - 4 * y + z / 2
        c[4] = -15 * x + 7 * y - z
        c[5] = 6 * x - 3 * y + z / 2
        return c

    # ------------------------------------------------------------------ events

    def next_impact(self, c):
        """First s in (0, 1] at which a flying slice passes an end; None if none does."""
        n = self.n
        way = c[:, :n] - c[:, n : n + 1]
        depth = np.abs(BASIS @ way) - self.top
        out = depth > self.tiny
        out[:, self.side != 0] = False
        moment = None
        when = out.any(axis=1)
        if when.any():
            k = int(np.argmax(when))
            upper, lower = float(NODES[k]), float(NODES[k - 1]) if k else 0.0
            ends = np.sign(BASIS[k] @ way)
            for i in np.flatnonzero(out[k]):
                p = self.beyond(way[:, i], ends[i])
                if moment is not None and np.polyval(p[::-1], moment) <= 0.0:
                    continue
                if k == 0 and abs(p[0]) < 1e-15 * self.length:
                    p = p[2:] if p[1] == 0.0 else p[1:]
                moment = passage(p, lower, upper if moment is None else moment)
        # a slice that turns back within the step may have passed the end between two nodes
        first, last = way[1], COUNT @ way
        turning = (first * last < 0.0) & (self.side == 0)
        if turning.any():
            for i in np.flatnonzero(turning):
                p = self.beyond(way[:, i], np.sign(first[i]))
                peak = passage(-(p * COUNT)[1:], 0.0, 1.0)
                if np.polyval(p[::-1], peak) > self.tiny and (moment is None or peak < moment):
                    moment = passage(p, 0.0, peak)
        return moment

    def beyond(self, way, end):
        """Polynomial of the depth beyond an end."""
        p = end * way
        p[0] -= self.top
        return p

    def pressure(self, s, v, side):
        """Acceleration at which slices at rest on an end are pressed on it; s and v have the shape (..., N + 1)."""
        a, _ = self.loose(s, v)
        heap = a[..., self.bound] @ self.bound_mass / self.bound_total
        first = int(np.argmax(self.side == side))
        return side * (a[..., first] - heap)

    def next_release(self, c, h, limit):
        """First s before limit at which slices at rest on an end lose its pressure, and the end."""
        found, bodies = (None, 0), c[:, : self.n + 1]
        for side in (1, -1):
            if not (self.side == side).any():
                continue
            off = self.pressure(BASIS @ bodies, BASIS_SLOPES @ bodies / h, side) < 0.0
            if not off.any():
                continue
            k = int(np.argmax(off))
            upper, lower = NODES[k], NODES[k - 1] if k else 0.0
            for _ in range(48):
                s = 0.5 * (upper + lower)
                basis = s**COUNT
                if self.pressure(basis @ bodies, slopes_of(basis) @ bodies / h, side) < 0.0:
                    upper = s
                else:
                    lower = s
            if limit is None or upper < limit:
                found, limit = (float(upper), side), float(upper)
        return found

    def collide(self, t, impacts):
        """Newton's law with Moreau's condition for all slices at an end, then rests."""
        n, m, tube = self.n, self.mass[0], self.mass[-1]
        y, u = self.s[:n] - self.s[n], self.v[:n] - self.v[n]
        u[self.side != 0] = 0.0
        end = np.where(y > 0.0, 1, -1)
        touch = (self.side != 0) | ((np.abs(y) > self.top - self.tiny) & (end * u >= 0.0))
        self.s[:n][touch] = self.s[n] + end[touch] * self.top
        who, sign, before = np.flatnonzero(touch), end[touch], u[touch]
        wish = self.bounce * before  # what the slice would have to lose if the tube stood still
        jump = tube_jump(wish, sign, m, tube)
        pulse = m * np.maximum(sign * (wish - jump), 0.0)
        self.v[who] -= sign * pulse / m
        self.v[n] += jump
        after = self.v[who] - self.v[n]
        for i, e, speed, rebound, p in zip(who, sign, before, after, pulse):
            if p > 0.0 and e * speed > 0.0:
                impacts.append((t, int(i), int(e), abs(float(speed)), abs(float(rebound))))
        calm = np.abs(after) < self.slow
        side = np.zeros(n, dtype=int)
        side[who[calm]] = sign[calm]
        self.rest(side)

    def rest(self, side):
        """Of the slices at rest at an end, hold those that it presses."""
        self.fix(side)
        v = self.v.copy()
        v[self.bound] = self.bound_mass @ v[self.bound] / self.bound_total
        for end in (1, -1):
            if (self.side == end).any() and self.pressure(self.s, v, end) < 0.0:
                side = np.where(side == end, 0, side)
        self.fix(side)
        if self.resting:
            self.v[self.bound] = self.bound_mass @ self.v[self.bound] / self.bound_total


def passage(p, lower, upper):
    """Root of a polynomial (lowest power first) that is negative at lower and positive at upper."""
    p = [float(x) for x in p]
    s = upper
    for _ in range(100):
        f = g = 0.0
        for x in p[::-1]:
            g = g * s + f
            f = f * s + x
        if f > 0.0:
            upper = s
        else:
            lower = s
        new = s - f / g if g > 0.0 else lower
        if not lower < new < upper:
            new = 0.5 * (lower + upper)
        if abs(new - s) < 1e-15:
            break
        s = new
    return new


def tube_jump(wish, sign, m, tube):
    """Root of tube * jump = sum of sign * impulse, piecewise linear and monotonic in jump."""

    def excess(jump):
        return tube * jump - m * (sign * np.maximum(sign * (wish - jump[:, None]), 0.0)).sum(axis=1)

    knots = np.unique(np.append(wish, 0.0))
    f = excess(knots)
    k = int(np.searchsorted(f, 0.0))
    if k < len(f) and f[k] == 0.0:
        return float(knots[k])
    if k == 0 or k == len(f):  # outside all knots: cannot be with 0 among them, but for rounding
        return float(knots[min(k, len(f) - 1)])
    left, right = knots[k - 1], knots[k]
    return float(left - f[k - 1] * (right - left) / (f[k] - f[k - 1]))


class FreeFlight:
    refined_by = "rtol"
    equation = "free-flight"
    name = "free flight, Nystroem 4(3) for bodies on the axis"

    def solve(self, ask):
        throw = ask.scenario
        times = np.asarray(ask.times, dtype=float)
        flight = Flight(throw, np.array(ask.start, dtype=float))
        n = flight.n
        table = np.empty((len(times), 2 * n + 3))
        impacts = []
        if throw.frozen or flight.top <= 1e-9 * flight.length:
            table[:, : n + 1] = flight.s
            table[:, n + 1 : -1] = 0.0
            table[:, -1] = throw.theta0 + throw.omega0 * times
            return self.answer(flight, times, table, impacts)
        tolerance = max(ask.effort or 1e-6, 1e-14)
        longest = throw.duration / 5
        y = flight.s[:n] - flight.s[n]
        flight.rest(np.where(np.abs(y) > flight.top - flight.tiny, np.where(y > 0.0, 1, -1), 0))
        h = min(longest, 0.3 * tolerance**0.25 / abs(throw.omega0))
        t, filled = 0.0, 0
        a, omega = flight.pull(flight.s, flight.v)
        while filled < len(times):
            after = flight.nystroem(h, a, omega)
            wrong = after[-1] / tolerance
            if wrong > 1.0:
                h *= max(0.2, 0.9 * wrong**-0.25)
                continue
            c = flight.path(h, a, omega, after)
            moment, loose = flight.next_impact(c), 0
            if flight.resting and flight.drag:
                release, loose = flight.next_release(c, h, moment)
                moment = release if loose else moment
            stop = t + h * (1.0 if moment is None else moment)
            upto = int(np.searchsorted(times, stop, side="right"))
            if upto > filled:
                basis = ((times[filled:upto] - t) / h)[:, None] ** COUNT
                at = basis @ c
                table[filled:upto, : n + 1], table[filled:upto, -1] = at[:, : n + 1], at[:, -1]
                table[filled:upto, n + 1 : -1] = slopes_of(basis) @ c[:, : n + 1] / h
                filled = upto
            t = stop
            if moment is None:
                flight.s, flight.v, flight.theta, a, omega, _ = after
            else:
                basis = moment**COUNT
                at = basis @ c
                flight.s, flight.theta = at[: n + 1], float(at[-1])
                flight.v = slopes_of(basis) @ c[:, : n + 1] / h
                if loose:
                    flight.fix(np.where(flight.side == loose, 0, flight.side))
                else:
                    flight.collide(t, impacts)
                a, omega = flight.pull(flight.s, flight.v)
            h = min(longest, h * min(2.0, 0.9 * max(wrong, 1e-8) ** -0.25))
        return self.answer(flight, times, table, impacts)

    def answer(self, flight, times, table, impacts):
        n = flight.n
        s, v, theta = table[:, : n + 1], table[:, n + 1 : -1], table[:, -1]
        inertia = flight.own + (s * s) @ flight.mass
        return {
            "t": times,
            "theta": theta,
            "omega": flight.spin / inertia,
            "r": s[:, :n] - s[:, n:] + flight.length / 2,
            "v": v[:, :n] - v[:, n:],
            "r_cm": flight.length / 2 - s[:, n],
            "inertia": inertia,
            "impacts": impacts,
        }


solve = FreeFlight()
