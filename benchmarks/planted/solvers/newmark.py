"""Newmark's average-acceleration rule: within a tick every slice flies on a parabola whose acceleration is the mean of those at
the tick's two ends (found implicitly). An agenda of predicted impacts, lift-offs, reports and ticks drives the clock."""
import heapq
import math

import numpy as np

IMPACT, LIFT, TICK, REPORT = range(4)


class Throw:
    def __init__(self, scenario, start):
        self.n = scenario.n_slices
        self.slice_kg = scenario.water_mass / self.n
        bottle = scenario.bottle
        self.bottle_kg, self.length = bottle.mass, bottle.length
        self.total_kg = bottle.mass + scenario.water_mass
        self.own = self.bottle_kg * (bottle.radius ** 2 / 2 + self.length ** 2 / 12)
        self.damping = scenario.drag / self.slice_kg
        self.gravity, self.bounce = scenario.gravity, scenario.restitution
        thick = scenario.water_mass / bottle.capacity * self.length / self.n
        self.ends = {-1: thick / 2, +1: self.length - thick / 2}
        self.near = 1e-12 * self.length
        self.pos = np.array(start, dtype=float)
        for end in self.ends.values():
            self.pos[np.abs(self.pos - end) < 1e-10 * self.length] = end
        self.vel = np.zeros(self.n)
        self.angle, self.clock = scenario.theta0, 0.0
        self.momentum = scenario.omega0 * self.moment(self.pos)

    # -- the whole ---------------------------------------------------------------------------------------------------
    def balance(self, pos):
        return (self.slice_kg * pos.sum() + self.bottle_kg * self.length / 2) / self.total_kg

    def flow(self, vel):
        return self.slice_kg * vel.sum() / self.total_kg

    def moment(self, pos):
        c = self.balance(pos)
        away = pos - c
        return self.slice_kg * (away @ away) + self.own + self.bottle_kg * (self.length / 2 - c) ** 2

    def spin(self, pos):
        return self.momentum / self.moment(pos)

    def pressure(self, side, pos, vel, angle, spin):
        """Acceleration towards the end `side` of a slice that lies there."""
        a = spin ** 2 * (self.ends[side] - self.balance(pos)) + self.gravity * math.cos(angle) + self.damping * self.flow(vel)
        return side * a

    # -- one tick ----------------------------------------------------------------------------------------------------
    def lying(self, side):
        return (self.pos == self.ends[side]) & (self.vel == 0)

    def average(self, loose, h):
        """The mean acceleration of the loose slices over the next h; also spin and angle after it."""
        spin0 = self.spin(self.pos)
        a0 = np.where(loose, spin0 ** 2 * (self.pos - self.balance(self.pos)) + self.gravity * math.cos(self.angle)
                      - self.damping * (self.vel - self.flow(self.vel)), 0.0)
        p, q = self.pos + h * self.vel + h * h / 4 * a0, self.vel + h / 2 * a0
        bp, bq = self.balance(p), self.flow(q)
        part, count = self.slice_kg / self.total_kg, loose.sum()
        spin1, angle1 = spin0, self.angle + h * spin0
        for _ in range(25):
            stiff, drag = spin1 ** 2 * h * h / 4, self.damping * h / 2
            known = np.where(loose, spin1 ** 2 * (p - bp) + self.gravity * math.cos(angle1) - self.damping * (q - bq), 0.0)
            diag = 1 - stiff + drag
            total = known.sum() / (diag - part * count * (drag - stiff))
            a1 = np.where(loose, (known + part * (drag - stiff) * total) / diag, 0.0)
            before = spin1
            spin1 = self.spin(p + h * h / 4 * a1)
            angle1 = self.angle + h * (spin0 + spin1) / 2
            if abs(spin1 - before) <= 1e-14 * abs(spin1):
                break
        return (a0 + a1) / 2, spin0, spin1, angle1

    def plan(self, h):
        lain = {side: self.lying(side) for side in (-1, 1)}
        spin = self.spin(self.pos)
        self.held = {side: lain[side] & (self.pressure(side, self.pos, self.vel, self.angle, spin) >= 0) for side in (-1, 1)}
        self.acc, spin0, spin1, angle1 = self.average(~(self.held[-1] | self.held[1]), h)
        again = {side: lain[side] & ~self.held[side] & (side * self.acc > 0) for side in (-1, 1)}
        if again[-1].any() or again[1].any():
            self.held = {side: self.held[side] | again[side] for side in (-1, 1)}
            self.acc, spin0, spin1, angle1 = self.average(~(self.held[-1] | self.held[1]), h)
        self.loose = ~(self.held[-1] | self.held[1])
        return spin0, spin1, angle1

    def arrivals(self):
        """For every slice the time until its parabola first meets an end (inf: never), and that end."""
        when, which = np.full(self.n, np.inf), np.zeros(self.n, int)
        for side in (-1, 1):
            d, v, a = side * (self.ends[side] - self.pos), side * self.vel, side * self.acc
            d = np.maximum(d, 0.0)
            root = np.sqrt(np.maximum(v * v + 2 * a * d, 0.0))
            with np.errstate(divide="ignore", invalid="ignore"):
                t = np.where(v > 0, 2 * d / (v + root), np.where(a > 0, (root - v) / a, np.inf))
            t[(v * v + 2 * a * d < 0) | ~self.loose] = np.inf
            sooner = t < when
            when[sooner], which[sooner] = t[sooner], side
        return when, which

    def look(self, x, spin0):
        """Positions, velocities and angle a time x into the tick."""
        pos = self.pos + x * self.vel + x * x / 2 * self.acc
        return pos, self.vel + x * self.acc, self.angle + x * (spin0 + self.spin(pos)) / 2

    def move(self, x, spin0, meeting=None):
        self.pos, self.vel, self.angle = self.look(x, spin0)
        if meeting is not None:
            self.pos[meeting[0]] = self.ends[meeting[1]]
        self.clock += x

    def impacts(self):
        struck = {}
        for side, end in self.ends.items():
            struck[side] = self.loose & (side * (self.pos - end) >= -self.near) & (side * self.vel > 0)
            self.pos[struck[side]] = end
        self.vel[struck[-1] | struck[1]] *= -self.bounce
        spin = self.spin(self.pos)
        for side in (-1, 1):
            p = self.pressure(side, self.pos, self.vel, self.angle, spin)
            if p > 0:
                self.vel[struck[side] & (self.vel ** 2 / (2 * p) < 1e-10 * self.length)] = 0.0

    def until(self, stop, reports, told):
        """Run to the clock reading `stop`; `told` receives angle and spin at each report time on the way."""
        while self.clock < stop:
            h = stop - self.clock
            spin0, spin1, angle1 = self.plan(h)
            agenda = [(h, TICK, 0, 0)]
            when, which = self.arrivals()
            for i in np.nonzero(when <= h)[0]:
                agenda.append((when[i], IMPACT, int(i), int(which[i])))
            ahead, ahead_v, _ = self.look(h, spin0)
            for side in (-1, 1):
                if self.held[side].any():
                    p0 = self.pressure(side, self.pos, self.vel, self.angle, spin0)
                    p1 = self.pressure(side, ahead, ahead_v, angle1, spin1)
                    if p0 > 0 > p1:
                        agenda.append((max(h * p0 / (p0 - p1), 0.01 * h), LIFT, 0, side))
            heapq.heapify(agenda)
            first = agenda[0][0]
            while reports and (reports[0] - self.clock < first or reports[0] <= self.clock):
                pos, _, angle = self.look(max(reports[0] - self.clock, 0.0), spin0)
                told.append((angle, self.spin(pos)))
                reports.pop(0)
            x, kind, who, side = heapq.heappop(agenda)
            if kind == TICK:
                self.move(h, spin0)
                self.clock = stop
                self.impacts()
            elif kind == LIFT:
                self.plan(x)
                self.move(x, spin0)
                self.impacts()
            else:
                self.plan(x)
                again, towards = self.arrivals()
                if towards[who] == side and abs(again[who] - x) <= 0.2 * x:
                    x = min(again[who], h)
                self.move(x, spin0, (who, side))
                self.impacts()


def solve(ask):
    sc = ask.scenario
    times = np.asarray(ask.times, float)
    world = Throw(sc, ask.start)
    if sc.frozen or world.ends[1] - world.ends[-1] < 1e-9 * world.length:
        return {"t": times, "theta": sc.theta0 + sc.omega0 * times, "omega": np.full(len(times), float(sc.omega0))}
    ticks = max(int(ask.effort), min(math.ceil(sc.duration * world.damping), 50000), 1)
    reports, told, tick = list(times), [], 0
    while reports:
        if reports[0] <= world.clock:
            told.append((world.angle, world.spin(world.pos)))
            reports.pop(0)
            continue
        tick += 1
        world.until(sc.duration * tick / ticks, reports, told)
    told = np.array(told)
    return {"t": times, "theta": told[:, 0], "omega": told[:, 1]}


solve.name = "newmark"
solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 2
