"""Eq. 8 by Picard iteration on Chebyshev pieces: each piece is a polynomial in time, cut at its first event."""

from dataclasses import dataclass
import numpy as np
from numpy.polynomial import chebyshev as cheb
from scipy.optimize import brentq

DEGREE = 12
NODES = -np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
FIT = np.linalg.inv(cheb.chebvander(NODES, DEGREE))  # values at the nodes -> coefficients
INTEGRAL = cheb.chebvander(NODES, DEGREE + 1) @ cheb.chebint(FIT, lbnd=-1, axis=0)  # values -> integrals from -1
SAMPLES = np.linspace(-1, 1, 41)
TOUCHING, AT_REST = 1e-10, 1e-4


@dataclass
class State:
    theta: float
    r: np.ndarray
    v: np.ndarray

    def at(self, x):  # a piece, whose fields hold one row a node, in other points of [-1, 1]
        weights = cheb.chebval(x, FIT).T
        return State(weights @ self.theta, weights @ self.r, weights @ self.v)


class Flight:
    def __init__(self, scenario, start, rtol):
        self.s, self.rtol, b = scenario, min(rtol, 1e-4), scenario.bottle  # coarser pieces miss their own ends
        self.low, self.high = scenario.r_min, scenario.r_max
        self.shell, self.speed = b.mass * (b.radius**2 / 2 + b.length**2 / 12), abs(scenario.omega0) * b.length
        self.now = State(scenario.theta0, start.copy(), np.zeros(len(start)))
        self.momentum = scenario.omega0 * self.inertia(start)[1]
        self.t, self.h, self.impacts = 0.0, 0.1 / abs(scenario.omega0), []
        self.settle()

    def inertia(self, r):
        s, middle = self.s, self.s.bottle.length / 2
        centre = (s.slice_mass * r.sum(-1) + s.bottle.mass * middle) / s.total_mass
        water = s.slice_mass * ((r - centre[..., None]) ** 2).sum(-1)
        return centre, self.shell + water + s.bottle.mass * (middle - centre) ** 2

    def law(self, y):  # angular velocity, and the acceleration that each slice would have if no end held it
        s = self.s
        centre, inertia = self.inertia(y.r)
        omega = self.momentum / inertia
        drift = s.slice_mass * y.v.sum(-1) / s.total_mass
        outward = (omega**2)[..., None] * (y.r - centre[..., None]) + s.gravity * np.cos(y.theta)[..., None]
        return omega, outward - s.drag / s.slice_mass * (y.v - drift[..., None])

    def piece(self, h):  # from a constant; return values at the nodes, and the error over the tolerance
        y, ones = self.now, np.ones(DEGREE + 1)
        p = State(ones * y.theta, np.outer(ones, y.r), np.outer(ones, y.v))
        for _ in range(40):
            omega, a = self.law(p)
            theta = y.theta + h / 2 * INTEGRAL @ omega
            v = y.v + h / 2 * INTEGRAL @ np.where(self.rest == 0, a, 0.0)
            change = np.abs(v - p.v).max() / self.speed + np.abs(theta - p.theta).max() / (1 + abs(y.theta))
            p = State(theta, y.r + h / 2 * INTEGRAL @ v, v)
            if change < 1e-13:
                break
        else:
            return p, np.inf
        tail = np.abs(FIT[-2:] @ p.v).max() / self.speed + np.abs(FIT[-2:] @ omega).max() / abs(self.s.omega0)
        return p, tail / self.rtol

    def settle(self):
        y = self.now
        side = (y.r > self.high - TOUCHING) * 1.0 - (y.r < self.low + TOUCHING)
        y.r[side > 0], y.r[side < 0] = self.high, self.low
        stays = (side != 0) & (np.abs(y.v) < AT_REST) & (side * self.law(y)[1] > -1e-7)
        y.v[stays] = 0.0
        self.rest = np.where(stays, side, 0.0)

    def push(self, y):
        return (self.rest * self.law(y)[1])[..., self.rest != 0].min(-1, initial=np.inf)

    def hits(self, p):  # points in (-1, 1] of a piece in which a slice comes to an end
        seen = p.at(SAMPLES)
        for side, end in ((1, self.high), (-1, self.low)):
            gap, speed = side * (seen.r - end), side * seen.v
            beyond = gap[1:] > 0
            turns = (speed[:-1] > 0) & (speed[1:] < 0) & (gap[:-1] > -0.01 * self.s.bottle.length)
            for i in np.flatnonzero((beyond | turns).any(0) & (self.rest == 0)):
                c = FIT @ (side * (p.r[:, i] - end))
                at = turns[:, i].nonzero()[0]
                tops = SAMPLES[at] + 0.05 * speed[at, i] / (speed[at, i] - speed[at + 1, i])
                outside = [x for x in [*SAMPLES[1:][beyond[:, i]], *tops] if cheb.chebval(x, c) > 0]
                if outside:  # divide by 1 + x: it may come from the end
                    f = lambda x: cheb.chebval(x, c) / (1 + x)
                    yield brentq(f, -1 + 1e-9, min(outside), xtol=1e-15) if f(-1 + 1e-9) < 0 else -1 + 1e-9

    def advance(self, limit):  # go on by one piece; return it and its length
        h = min(self.h, limit)
        while (result := self.piece(h))[1] > 1:
            h = self.h = 0.6 * h
        p, error = result
        if h == self.h and error < 0.01:
            self.h *= 1.3
        x = min(self.hits(p), default=1.0)
        hit, grid = x < 1, np.append(SAMPLES[SAMPLES < x], x)
        weak = np.flatnonzero(self.push(p.at(grid)) < -1e-7)
        if release := weak.size > 0:
            f, a, b = lambda x: self.push(p.at(x)), grid[max(weak[0] - 1, 0)], grid[weak[0]]
            x = brentq(f, a, b) if f(a) > 0 else a
        self.now = y = p.at(x)
        self.t += h * (x + 1) / 2
        if release:
            self.rest[self.rest * self.law(y)[1] < 1e-6] = 0.0
        elif hit:
            for side, near in ((1, y.r > self.high - TOUCHING), (-1, y.r < self.low + TOUCHING)):
                for i in np.flatnonzero(near & (self.rest == 0) & (side * y.v > 0)):
                    self.impacts.append((self.t, i, side, abs(y.v[i]), self.s.restitution * abs(y.v[i])))
                    y.v[i] *= -self.s.restitution
            self.settle()
        return p, h


class ChebyshevPicard:
    name = "Chebyshev-Picard pieces"
    equation, refined_by = "eq8", "rtol"

    def __call__(self, ask):
        s, t = ask.scenario, ask.times
        if s.frozen:
            still = np.tile(ask.start, (len(t), 1))
            return {"t": t, "theta": s.theta0 + s.omega0 * t, "omega": s.omega0 + 0 * t, "r": still, "v": 0 * still}
        flight, found = Flight(s, ask.start, ask.effort), []
        while len(found) < len(t):
            begin = flight.t
            p, h = flight.advance(s.duration - begin)
            ready = t[len(found) :][t[len(found) :] <= flight.t + 1e-13 * s.duration]
            found += [p.at(2 * (when - begin) / h - 1) for when in ready]
        theta, r, v = (np.array([getattr(y, name) for y in found]) for name in ("theta", "r", "v"))
        columns = np.array(flight.impacts).reshape(-1, 5).T
        impacts = dict(zip(("time", "slice", "end", "speed_before", "speed_after"), columns))
        return {"t": t, "theta": theta, "omega": flight.law(State(theta, r, v))[0], "r": r, "v": v, "impacts": impacts}


solve = ChebyshevPicard()
