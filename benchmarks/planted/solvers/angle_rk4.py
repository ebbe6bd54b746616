"""Eq. 8 with the angle as the independent variable: the spin never changes sign, so time, places and velocities are
functions of the angle phi = |theta - theta0| turned since release,

    dt/dphi = J / |S|,   dr/dphi = v dt/dphi,   dv/dphi = (omega^2 (r - c) + g cos(theta) - alpha/m (v - v_c)) dt/dphi .

Runge-Kutta 4; impacts and answers are met by cutting a step to length. Written for one slice at a time.
"""
import math

REST = 2e-5  # of |omega0| L: a slice that rebounds more slowly stays on its end


class Turn:
    def __init__(self, throw, start):
        bottle = throw.bottle
        self.n = len(start)
        self.m, self.mb = throw.water_mass / self.n, bottle.mass
        self.mass = self.mb + throw.water_mass
        self.length = bottle.length
        room = throw.water_mass / bottle.capacity * bottle.length / self.n
        self.end = {1: bottle.length - room / 2, -1: room / 2}
        self.own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.g, self.e, self.ice = throw.gravity, throw.restitution, throw.frozen or self.end[1] - self.end[-1] < 1e-12
        self.k = throw.drag / self.m
        self.theta0, self.way = throw.theta0, math.copysign(1.0, throw.omega0)
        self.slow = REST * abs(throw.omega0) * bottle.length
        self.spin = abs(throw.omega0) * self.about(start)[1]
        self.phi = 0.0
        self.state = [0.0] + [float(r) for r in start] + [0.0] * self.n  # t, r..., v...
        self.rest = [0] * self.n
        self.hits = []
        for i in range(self.n):
            self.lie_down(i)

    def about(self, r):
        """Centre of mass and moment of inertia about it."""
        c = (self.mb * self.length / 2 + self.m * sum(r)) / self.mass
        j = self.own + self.mb * (self.length / 2 - c) ** 2
        for place in r:
            j += self.m * (place - c) ** 2
        return c, j

    def forces(self, phi, state):
        """|omega| and the accelerations in time."""
        n = self.n
        r, v = state[1 : n + 1], state[n + 1 :]
        c, j = self.about(r)
        omega = self.spin / j
        weight = self.g * math.cos(self.theta0 + self.way * phi)
        v_c = self.m * sum(v) / self.mass
        return omega, [omega * omega * (r[i] - c) + weight - self.k * (v[i] - v_c) for i in range(n)]

    def slope(self, phi, state):
        n = self.n
        omega, a = self.forces(phi, state)
        d = [1.0 / omega] + [0.0] * (2 * n)
        if not self.ice:
            for i in range(n):
                if not self.rest[i]:
                    d[1 + i] = state[1 + n + i] / omega
                    d[1 + n + i] = a[i] / omega
        return d

    def step(self, x):
        """State after turning x further."""
        at = self.state
        k1 = self.slope(self.phi, at)
        k2 = self.slope(self.phi + x / 2, [y + x / 2 * k for y, k in zip(at, k1)])
        k3 = self.slope(self.phi + x / 2, [y + x / 2 * k for y, k in zip(at, k2)])
        k4 = self.slope(self.phi + x, [y + x * k for y, k in zip(at, k3)])
        return [y + x / 6 * (a + 2 * b + 2 * c + d) for y, a, b, c, d in zip(at, k1, k2, k3, k4)]

    def lie_down(self, i):
        r, v = self.state[1 + i], self.state[1 + self.n + i]
        for side, place in self.end.items():
            if abs(r - place) < 1e-11 * self.length and abs(v) < self.slow:
                if side * self.forces(self.phi, self.state)[1][i] > 0:
                    self.rest[i], self.state[1 + i], self.state[1 + self.n + i] = side, place, 0.0

    def cut(self, quantity, x):
        """Angle in (0, x] at which a quantity of the state, positive at x, becomes so (Illinois method)."""
        a, fa, b, fb = 0.0, quantity(0.0, self.state), x, quantity(x, self.step(x))
        for _ in range(60):
            if fa >= 0 or b - a < 1e-15 + 1e-14 * b:
                break
            mid = (a * fb - b * fa) / (fb - fa)
            f = quantity(mid, self.step(mid))
            if f > 0:
                b, fb, fa = mid, f, fa / 2
            else:
                a, fa, fb = mid, f, fb / 2
            if f == 0:
                return mid
        return b if fa < 0 else a

    def earliest(self, x):
        """First event in the next step: its angle and what to do then."""
        new, what = self.step(x), None
        for i in range(self.n):
            v0, v1 = self.state[1 + self.n + i], new[1 + self.n + i]
            if self.rest[i]:

                def lifted(phi, state, i=i):
                    return -self.rest[i] * self.forces(self.phi + phi, state)[1][i]

                if lifted(x, new) > 0:
                    x, what = self.cut(lifted, x), ("leave", i, 0)
                    new = self.step(x)
                continue
            for side, place in self.end.items():
                bound = abs(self.state[1 + i] - place) < 1e-11 * self.length
                if bound and side * v0 > 0:
                    return 0.0, list(self.state), ("hit", i, side)

                def outside(phi, state, i=i, side=side, place=place, bound=bound):
                    if bound:  # it starts on this end
                        return side * (state[1 + i] - place) / phi if phi > 0 else min(side * v0, -1e-300)
                    return side * (state[1 + i] - place)

                far = x
                if side * v0 > 0 and side * v1 < 0:
                    far = self.cut(lambda phi, state: -side * state[1 + self.n + i], x)
                if outside(far, self.step(far) if far < x else new) > 0:
                    x, what = self.cut(outside, far), ("hit", i, side)
                    new = self.step(x)
        return x, new, what

    def advance(self, x):
        if self.ice:
            self.state, self.phi = self.step(x), self.phi + x
            return
        x, self.state, what = self.earliest(x)
        self.phi += x
        if what is None:
            return
        kind, i, side = what
        if kind == "leave":
            self.rest[i] = 0
            return
        speed = side * self.state[1 + self.n + i]
        self.state[1 + i] = self.end[side]
        if speed > 0:
            self.state[1 + self.n + i] = -side * self.e * speed
            self.hits.append([self.state[0], i, side, speed, self.e * speed])
        self.lie_down(i)

    def turn_until(self, when, dt):
        while when - self.state[0] > 1e-15:
            omega = self.spin / self.about(self.state[1 : self.n + 1])[1]
            x = omega * dt
            if self.step(x)[0] > when:
                x = self.cut(lambda phi, state: state[0] - when, x)
            self.advance(x)


def solve(ask):
    turn = Turn(ask.scenario, ask.start)
    n, dt = turn.n, ask.effort
    if turn.k > 0:
        dt = min(dt, 0.5 / turn.k)
    answer = {name: [] for name in ("theta", "omega", "r", "inertia")}
    for when in ask.times:
        turn.turn_until(float(when), dt)
        r = turn.state[1 : n + 1]
        inertia = turn.about(r)[1]
        answer["theta"].append(turn.theta0 + turn.way * turn.phi)
        answer["omega"].append(turn.way * turn.spin / inertia)
        answer["r"].append(r)
        answer["inertia"].append(inertia)
    return {"t": ask.times} | answer | {"impacts": turn.hits}


solve.name = "by the angle"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 4
