"""Bottle flip, eq. 8: Strang splitting into drift, turn and kick, raised to order 4 by Richardson extrapolation.

drift   r' = v                                    (everything else held)
turn    theta' = omega(r)                         (everything else held)
kick    v' = omega^2 (r - r_cm) + g cos(theta) - k (v - v_cm)    (exactly, by exponentials)

Effort: number of steps for the whole duration of the scenario.
"""
import numpy as np
from scipy.optimize import brentq


class Mass:
    """The masses and lengths of one throw."""

    def __init__(self, scenario):
        bottle = scenario.bottle
        self.count = scenario.n_slices
        self.slice = scenario.water_mass / self.count
        self.tube = bottle.mass
        self.total = bottle.mass + scenario.water_mass
        self.length = bottle.length
        self.tube_own = bottle.mass * (bottle.radius ** 2 / 2.0 + bottle.length ** 2 / 12.0)
        height = scenario.water_mass / bottle.capacity * bottle.length
        self.ends = (height / (2 * self.count), bottle.length - height / (2 * self.count))

    def centre(self, r):
        return (self.slice * np.sum(r) + self.tube * self.length / 2.0) / self.total

    def inertia(self, r):
        c = self.centre(r)
        return self.tube_own + self.tube * (self.length / 2.0 - c) ** 2 + self.slice * np.sum((r - c) ** 2)


class Phase:
    """Positions, speeds, angle at one moment; `held` is -1 or 1 for a slice resting at cap or base, else 0."""

    __slots__ = ("time", "r", "v", "theta", "held")

    def __init__(self, time, r, v, theta, held):
        self.time, self.r, self.v, self.theta, self.held = time, r, v, theta, held

    def copy(self):
        return Phase(self.time, self.r.copy(), self.v.copy(), self.theta, self.held.copy())


def phi1(z):
    """(1 - exp(-z)) / z."""
    return -np.expm1(-z) / z if z > 1e-300 else 1.0


class Flight:
    def __init__(self, scenario, start):
        self.scenario = scenario
        self.mass = Mass(scenario)
        self.rate = scenario.drag / self.mass.slice
        self.bounce = scenario.restitution
        self.g = scenario.gravity
        r = np.array(start, dtype=float)
        self.momentum = self.mass.inertia(r) * scenario.omega0
        self.width = self.mass.ends[1] - self.mass.ends[0]
        self.hair = 2e-13 * self.mass.length
        self.crumb = 1e-10 * self.mass.length
        self.stuck = bool(scenario.frozen) or self.width <= 1e-9 * self.mass.length
        self.now = Phase(0.0, r, np.zeros(len(r)), float(scenario.theta0), np.zeros(len(r), dtype=np.int8))
        if not self.stuck:
            lo, hi = self.mass.ends
            self.now.r[r >= hi - self.hair] = hi
            self.now.r[r <= lo + self.hair] = lo
            self.hold_and_free(self.now)
        self.loose = self.now.held == 0

    # ---- the flows -------------------------------------------------------------------------------------------------
    def omega(self, r):
        return self.momentum / self.mass.inertia(r)

    def force(self, r, theta):
        w = self.omega(r)
        return w * w * (r - self.mass.centre(r)) + self.g * np.cos(theta)

    def strang(self, r, v, theta, h, fraction):
        r = r + 0.5 * h * v
        theta = theta + 0.5 * h * self.omega(r)
        push = self.force(r, theta)[self.loose]
        if self.rate > 0.0 and push.size:
            z = self.rate * h
            mean_push, mean_v = push.mean(), v[self.loose].mean()
            slow = z * (1.0 - fraction)
            new_mean = mean_v * np.exp(-slow) + mean_push * h * phi1(slow)
            own = (v[self.loose] - mean_v) * np.exp(-z) + (push - mean_push) * h * phi1(z)
            v = v.copy()
            v[self.loose] = new_mean + own
        else:
            v = v.copy()
            v[self.loose] += h * push
        theta = theta + 0.5 * h * self.omega(r)
        r = r + 0.5 * h * v
        return r, v, theta

    def advance(self, phase, h):
        """One extrapolated step; knows nothing of the ends."""
        # v_cm = fraction * mean speed of the loose slices
        fraction = self.mass.slice * np.count_nonzero(self.loose) / self.mass.total
        coarse = self.strang(phase.r, phase.v, phase.theta, h, fraction)
        half = self.strang(phase.r, phase.v, phase.theta, 0.5 * h, fraction)
        fine = self.strang(*half, 0.5 * h, fraction)
        r, v, theta = ((4.0 * f - c) / 3.0 for f, c in zip(fine, coarse))
        return Phase(phase.time + h, r, v, theta, phase.held)

    # ---- the ends --------------------------------------------------------------------------------------------------
    def pull_at_ends(self, phase):
        """What would accelerate a slice at rest at the cap and at the base."""
        w = self.omega(phase.r)
        v_cm = self.mass.slice * phase.v.sum() / self.mass.total
        rest = self.g * np.cos(phase.theta) + self.rate * v_cm
        c = self.mass.centre(phase.r)
        return tuple(w * w * (end - c) + rest for end in self.mass.ends)

    def hold_and_free(self, phase):
        """Slices at an end which would not rise by a hair's breadth are held; held ones that are pulled away are freed."""
        lo, hi = self.mass.ends
        cap, base = self.pull_at_ends(phase)
        if cap < 0.0:
            phase.held[(phase.held == 0) & (phase.r == lo) & (phase.v ** 2 < -2.0 * self.crumb * cap)] = -1
        if base > 0.0:
            phase.held[(phase.held == 0) & (phase.r == hi) & (phase.v ** 2 < 2.0 * self.crumb * base)] = 1
        phase.v[phase.held != 0] = 0.0
        for _ in range(2):
            cap, base = self.pull_at_ends(phase)
            if cap > 0.0:
                phase.held[phase.held < 0] = 0
            if base < 0.0:
                phase.held[phase.held > 0] = 0

    def outside(self, phase):
        """Largest distance beyond an end, over the loose slices (negative: all inside)."""
        if not self.loose.any():
            return -self.width
        r = phase.r[self.loose]
        lo, hi = self.mass.ends
        return float(max(r.max() - hi, lo - r.min()))

    def tug(self, phase):
        """Largest pull away from its end of a held slice."""
        cap, base = self.pull_at_ends(phase)
        tugs = [-1e300]
        if (phase.held < 0).any():
            tugs.append(cap)
        if (phase.held > 0).any():
            tugs.append(-base)
        return float(max(tugs))

    def moment(self, function, phase, h, sure=0.0):
        """The root of function(state after s) in s in (0, h]; positive at h."""
        late, early = h, 0.5 * h
        for _ in range(60):
            if function(self.advance(phase, early)) < sure:
                break
            late, early = early, 0.5 * early
        else:
            return late
        return brentq(lambda s: function(self.advance(phase, s)), early, late, xtol=1e-16 * h, rtol=1e-14)

    def sneaked(self, phase, after, h):
        """A slice that turned back within the step may have been beyond its end meanwhile: the time of its turning."""
        turned = self.loose & (phase.v * after.v < 0.0)
        if not turned.any():
            return None
        lo, hi = self.mass.ends
        v0, v1 = phase.v[turned], after.v[turned]
        s = h * v0 / (v0 - v1)
        peak = phase.r[turned] + 0.5 * v0 * s
        reach = 0.3 * np.abs(v0) * s
        near = ((v0 > 0.0) & (peak + reach > hi)) | ((v0 < 0.0) & (peak - reach < lo))
        for moment in np.sort(s[near]):
            if self.outside(self.advance(phase, moment)) > self.hair:
                return moment
        return None

    def piece(self, limit):
        """Step forward by at most `limit`, at most to the next event; returns the state after it."""
        phase = self.now
        after = self.advance(phase, limit)
        span, event = limit, None
        if self.outside(after) > self.hair:
            event = "impact"
            span = self.moment(self.outside, phase, limit)
        else:
            turn = self.sneaked(phase, after, limit)
            if turn is not None:
                event = "impact"
                span = self.moment(self.outside, phase, turn)
        if event:
            after = self.advance(phase, span)
        if self.tug(after) > 0.0:
            early = self.moment(self.tug, phase, span)
            if early <= span:
                event, span = "release", early
                after = self.advance(phase, span)
        after = after.copy()
        if event == "impact":
            self.collide(after)
        elif event == "release":
            cap, base = self.pull_at_ends(after)
            small = 1e-9 * (abs(cap) + abs(base))
            if cap > -small:
                after.held[after.held < 0] = 0
            if base < small:
                after.held[after.held > 0] = 0
        return span, after

    def collide(self, phase):
        lo, hi = self.mass.ends
        top = self.loose & (phase.r >= hi - 2 * self.hair)
        bottom = self.loose & (phase.r <= lo + 2 * self.hair)
        phase.r[top] = hi
        phase.r[bottom] = lo
        hit = (top & (phase.v > 0.0)) | (bottom & (phase.v < 0.0))
        phase.v[hit] = -self.bounce * phase.v[hit]
        self.hold_and_free(phase)

    # ---- the answer ------------------------------------------------------------------------------------------------
    def record(self, times, steps):
        theta = np.empty(len(times))
        omega, r_cm, inertia = np.empty_like(theta), np.empty_like(theta), np.empty_like(theta)

        def note(i, r, angle):
            theta[i], omega[i] = angle, self.omega(r)
            r_cm[i], inertia[i] = self.mass.centre(r), self.mass.inertia(r)

        if self.stuck:
            for i, t in enumerate(times):
                note(i, self.now.r, self.now.theta + self.omega(self.now.r) * t)
            return theta, omega, r_cm, inertia
        h = self.scenario.duration / steps
        i, index = 0, 0
        while i < len(times):
            if times[i] <= self.now.time:
                note(i, self.now.r, self.now.theta)
                i += 1
                continue
            index = max(index, int(self.now.time / h) - 1)
            while index * h <= self.now.time + 1e-9 * h:
                index += 1
            span, after = self.piece(index * h - self.now.time)
            while i < len(times) and times[i] < after.time:
                between = self.advance(self.now, times[i] - self.now.time)
                note(i, between.r, between.theta)
                i += 1
            self.now = after
            self.loose = after.held == 0
        return theta, omega, r_cm, inertia


def solve(ask):
    flight = Flight(ask.scenario, ask.start)
    times = np.asarray(ask.times, dtype=float)
    steps = max(1, int(round(float(ask.effort))))
    theta, omega, r_cm, inertia = flight.record(times, steps)
    return dict(t=times, theta=theta, omega=omega, r_cm=r_cm, inertia=inertia)


solve.name = "strang"
solve.equation = "eq8"
solve.refined_by = "steps"
solve.order = 4
solve.precision = "float64"
