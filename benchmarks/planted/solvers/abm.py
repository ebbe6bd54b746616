"""Eq. 8 in plain Python: one record per slice, Adams-Bashforth-Moulton of third order with steps of any length.

A step predicts with the two last slopes (Adams-Bashforth) and corrects with three (Adams-Moulton). The slope before is
forgotten wherever the motion has a kink, and the next step is one of Kutta's third order rule. The instant of an impact
is the length of step at which the foremost slice just reaches its end.
"""

import math
from dataclasses import dataclass

CONTACT = 1e-10  # m: nearer to an end than this is on it
BEYOND = 1e-13  # m: farther beyond an end than this is an impact
RESTING = 1e-4  # m/s: a slice that leaves its end more slowly stays there
PULL = 1e-9  # m/s^2: the least pull that lifts a slice off its end


@dataclass
class Slice:
    """A point of water: place from the cap [m], velocity [m/s], and the end it rests on (1 base, -1 cap, 0 none)."""

    r: float
    v: float = 0.0
    end: int = 0


@dataclass
class Memory:
    """The slope at the start of the last step, and how long that step was."""

    slope: list[float]
    h: float


class Bottle:
    """Everything that flies."""

    def __init__(self, throw, start):
        tube = throw.bottle
        self.count = throw.n_slices
        self.m = throw.water_mass / self.count
        self.tube_mass = tube.mass
        self.mass = tube.mass + throw.water_mass
        self.half = 0.5 * tube.length
        half_height = 0.5 * tube.length * throw.water_mass / tube.capacity / self.count
        self.ends = {1: tube.length - half_height, -1: half_height}
        self.tube_inertia = tube.mass * (tube.radius**2 / 2 + tube.length**2 / 12)
        self.e = throw.restitution
        self.g = throw.gravity
        self.rate = throw.drag / self.m
        self.frozen = throw.frozen
        self.clock = 0.0
        self.theta = throw.theta0
        self.slices = [Slice(float(r)) for r in start]
        self.spin = throw.omega0 * self.inertia([s.r for s in self.slices])
        self.memory = None
        if not self.frozen:
            self.lay_down()

    # ---------------------------------------------------------------- what the positions say

    def centre(self, places):
        return (self.m * sum(places) + self.tube_mass * self.half) / self.mass

    def inertia(self, places):
        centre = self.centre(places)
        total = self.tube_inertia + self.tube_mass * (self.half - centre) ** 2
        for r in places:
            total += self.m * (r - centre) ** 2
        return total

    def omega(self, places):
        return self.spin / self.inertia(places)

    # ---------------------------------------------------------------- equation of motion

    def state(self):
        return [self.theta, *(s.r for s in self.slices), *(s.v for s in self.slices)]

    def pulls(self, y):
        """Return omega and the acceleration of every slice as if none were held."""
        places, speeds = y[1 : self.count + 1], y[self.count + 1 :]
        omega = self.omega(places)
        centre = self.centre(places)
        drift = self.m * sum(speeds) / self.mass
        weight = self.g * math.cos(y[0])
        square = omega * omega
        rate = self.rate
        return omega, [square * (r - centre) + weight - rate * (v - drift) for r, v in zip(places, speeds, strict=True)]

    def slope(self, y):
        omega, a = self.pulls(y)
        if self.frozen:
            return [omega, *[0.0] * (2 * self.count)]
        for i, s in enumerate(self.slices):
            if s.end:
                a[i] = 0.0
        return [omega, *y[self.count + 1 :], *a]

    def trial(self, y, f, h):
        """Return the state a step of length h later; f is the slope at y."""
        last = self.memory
        if last is None or last.h < 0.01 * h:
            f2 = self.slope([a + 0.5 * h * b for a, b in zip(y, f, strict=True)])
            f3 = self.slope([a + h * (2.0 * c - b) for a, b, c in zip(y, f, f2, strict=True)])
            return [a + h / 6.0 * (b + 4.0 * c + d) for a, b, c, d in zip(y, f, f2, f3, strict=True)]
        w = h / last.h
        guess = [a + h * ((1.0 + 0.5 * w) * b - 0.5 * w * c) for a, b, c in zip(y, f, last.slope, strict=True)]
        ahead = self.slope(guess)
        k = last.h / h
        new = (3.0 * k + 2.0) / (6.0 * (k + 1.0))
        now = (3.0 * k + 1.0) / (6.0 * k)
        old = 1.0 / (6.0 * k * (k + 1.0))
        return [a + h * (new * d + now * b - old * c) for a, b, c, d in zip(y, f, last.slope, ahead, strict=True)]

    # ---------------------------------------------------------------- ends of the tube

    def gaps(self, y):
        """Return how far beyond its nearest end each moving slice is, as (gap, slice, end)."""
        found = []
        for i, s in enumerate(self.slices):
            if s.end == 0:
                r = y[1 + i]
                end = 1 if r > self.half else -1
                found.append((end * (r - self.ends[end]), i, end))
        return found

    def worst(self, y):
        return max((gap for gap, _, _ in self.gaps(y)), default=-1.0)

    def least_push(self, y):
        """Return the least acceleration that presses a resting slice to its end; 1 if none rests."""
        _, a = self.pulls(y)
        return min((s.end * a[i] for i, s in enumerate(self.slices) if s.end), default=1.0)

    def turned_beyond(self, y0, y1, h):
        """Return the time at which a slice turned beyond an end inside the step, or None."""
        first = None
        for gap, i, end in self.gaps(y1):
            v0, v1 = end * y0[1 + self.count + i], end * y1[1 + self.count + i]
            if gap <= 0.0 and v0 > 0.0 > v1:
                at = h * v0 / (v0 - v1)
                if gap + 0.5 * (h - at) * -v1 > BEYOND and (first is None or at < first):
                    first = at
        return first

    def time_of(self, y, f, h, excess):
        """Return the length of step in (0, h] at which excess(y, length) rises through 0, by the Illinois rule."""
        low, high = h, h
        value_high = excess(self.trial(y, f, h), h)
        value_low = value_high
        for _ in range(60):
            low *= 0.5
            value_low = excess(self.trial(y, f, low), low)
            if value_low <= 0.0:
                break
            high, value_high = low, value_low
        else:
            return low
        side = 0
        for _ in range(80):
            at = high - value_high * (high - low) / (value_high - value_low)
            value = excess(self.trial(y, f, at), at)
            if abs(value) * at < 1e-14 or high - low < 1e-15:
                return at
            if value > 0.0:
                high, value_high = at, value
                if side == 1:
                    value_low *= 0.5
                side = 1
            else:
                low, value_low = at, value
                if side == -1:
                    value_high *= 0.5
                side = -1
        return at

    def touching(self, s):
        for end, place in self.ends.items():
            if abs(s.r - place) <= CONTACT:
                return end
        return 0

    def rebound(self):
        """Throw back whatever is on an end and moves towards it."""
        for s in self.slices:
            end = self.touching(s)
            if end and s.end == 0:
                s.r = self.ends[end]
                if end * s.v > 0.0:
                    s.v *= -self.e

    def lay_down(self):
        """Let slices rest that are slow, on an end, and pressed to it."""
        _, a = self.pulls(self.state())
        for i, s in enumerate(self.slices):
            end = self.touching(s)
            if end and s.end == 0 and abs(s.v) < RESTING and end * a[i] > 0.0:
                s.end, s.v = end, 0.0

    def lift(self, least):
        """Let go of the slices that are pressed to their ends by no more than ``least``."""
        _, a = self.pulls(self.state())
        for i, s in enumerate(self.slices):
            if s.end and s.end * a[i] <= least:
                s.end = 0
                self.memory = None

    # ---------------------------------------------------------------- marching

    def move(self, h):
        """Go on by h, or less if something happens before."""
        if not self.frozen:
            self.lift(-PULL)
        y = self.state()
        f = self.slope(y)
        after = self.trial(y, f, h)
        kind = ""
        if not self.frozen:
            turn = self.turned_beyond(y, after, h)
            if turn is not None:
                h = turn
                after = self.trial(y, f, h)
            if self.worst(after) > BEYOND:
                kind = "impact"
                h = self.time_of(y, f, h, lambda z, tau: self.worst(z) / tau)
                after = self.trial(y, f, h)
            if self.least_push(after) < -PULL:
                kind = "lift"
                h = self.time_of(y, f, h, lambda z, tau: -self.least_push(z))
                after = self.trial(y, f, h)
        self.theta = after[0]
        for i, s in enumerate(self.slices):
            s.r, s.v = after[1 + i], after[1 + self.count + i]
        self.clock += h
        self.memory = Memory(f, h)
        if kind == "impact":
            self.rebound()
            self.lay_down()
            self.memory = None
        elif kind == "lift":
            self.lift(1e-6)

    def fly_to(self, when, dt):
        while when - self.clock > 1e-13:
            left = when - self.clock
            self.move(left / math.ceil(left / dt - 1e-9))


def solve(ask):
    """Answer one throw."""
    bottle = Bottle(ask.scenario, ask.start)
    answer = {name: [] for name in ("t", "theta", "omega", "r", "v")}
    for when in ask.times:
        bottle.fly_to(float(when), ask.effort)
        places = [s.r for s in bottle.slices]
        answer["t"].append(float(when))
        answer["theta"].append(bottle.theta)
        answer["omega"].append(bottle.omega(places))
        answer["r"].append(places)
        answer["v"].append([s.v for s in bottle.slices])
    return answer


solve.name = "Adams, slice by slice"
solve.equation = "eq8"
solve.refined_by = "dt"
solve.order = 3
