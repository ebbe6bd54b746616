r"""A good solver of free flight, written so that mistakes can be planted in it one at a time.

    cap r = 0 |  o  o    o  | base r = L       state y = (theta, r_1 ... r_N, v_1 ... v_N); omega = L / J

Slices and the body of tube and resting slices (mass M_c, centre r_c), from Newton's equations in the frame of C_M:

    r_i'' = omega^2 (r_i - r_c) - (alpha / m) v_i - (alpha / M_c) sum_free v_j

Runge-Kutta steps of order 4, every rebound located inside its step, impacts by Newton and Moreau: impulses p_i with
v_i+ = v_i- - s_i p_i / m - (sum_j s_j p_j) / M_b and p_i >= 0, -s_i (v_i+ + e v_i-) >= 0, product 0 (s = +1 base, -1
cap). It shares no code with ``ode_reference``.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from flipproof.foreign.contract import Ask
from slicemodel.compiled import kept_on_disk
from slicemodel.trajectory import FloatArray

IntArray = NDArray[np.int64]

SMOOTH = "kind slope acceleration weight drag_of_body drag_on body turning spin inertia centre"
"""Parts of the smooth motion; of a solver in which no mistake spoils one of them, ``_advanced`` makes the steps."""


@kept_on_disk()
def _advanced(y, h, held, moving, body_mass, m, mb, length, own_inertia, momentum, drag):  # type: ignore[no-untyped-def]
    """Return the state after a step of Runge and Kutta: what the parts do one by one, 40 times as fast."""
    n = len(held)
    slope, total = np.zeros(2 * n + 1), np.zeros(2 * n + 1)
    for weight, share in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
        now = y + weight * h * slope
        r, v = now[1 : n + 1], now[n + 1 :]
        c = (m * r.sum() + mb * length / 2) / (m * n + mb)
        omega = momentum / (m * ((r - c) ** 2).sum() + own_inertia + mb * (length / 2 - c) ** 2)
        centre = (mb * length / 2 + m * (held * r).sum()) / body_mass
        dragged = drag / body_mass * ((1 - held) * v).sum()
        slope[0] = omega
        slope[1 : n + 1] = moving * v
        slope[n + 1 :] = moving * (omega * omega * (r - centre) - drag / m * v - dragged)
        total += share * slope
    return y + h / 6 * total


@kept_on_disk()
def _met(y, new, first, last, h, side, ends):  # type: ignore[no-untyped-def]
    """Return when, by the cubic between states ``h`` apart, a free slice first passes an end, and which pass which."""
    inside = slice(1, len(side) + 1)
    start, begin, mean = y[inside], first[inside], (new - y)[inside] / h
    square, cube = (3 * mean - 2 * begin - last[inside]) / h, (begin + last[inside] - 2 * mean) / h**2
    low, high = 0.0, h
    past = np.zeros(len(side), np.int64)
    for halving in range(43):
        t = (low + high) / 2 if halving < 42 else high
        r = start + t * (begin + t * (square + t * cube))
        past = ((r > ends[1]).astype(np.int64) - (r < ends[0])) * (side == 0)
        low, high = (low, t) if past.any() else (t, high)
    return high, past


class Subject:
    """The solver as it should be. Each part that a mistake may spoil is a method of its own."""

    name = "planted: none"
    equation = "free-flight"
    refined_by = "dt"
    precision = "float64"
    order: ClassVar[float] = 4.0
    rest_speed = 1e-3
    kind: type = np.float64
    smooth_as_here = True

    def __init_subclass__(cls) -> None:
        cls.smooth_as_here = all(getattr(cls, part) is getattr(Subject, part) for part in SMOOTH.split())

    def begin(self, ask: Ask) -> None:
        """Take over the constants of a throw."""
        s, bottle = ask.scenario, ask.scenario.bottle
        self.n, self.m, self.mb = s.n_slices, self.slice_mass(ask), bottle.mass
        self.length, self.low, self.high = bottle.length, s.r_min, s.r_max
        self.drag, self.e, self.g = s.drag, s.restitution, s.gravity
        self.own_inertia = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.frozen = s.frozen
        self.ask = ask
        self.impacts = 0
        self.hold(np.zeros(self.n, dtype=np.int64))
        self.momentum = self.inertia(np.array(ask.start)) * s.omega0

    def hold(self, side: IntArray) -> None:
        """Let slices rest: side 1 on the base, -1 on the cap, 0 free. Masks are made here, not once a slope."""
        self.side = side
        self.held = (side != 0).astype(self.kind)
        self.free = 1 - self.held
        self.moving = self.free * (not self.frozen)
        self.body_mass = self.mb + self.m * int(np.count_nonzero(side))

    def slice_mass(self, ask: Ask) -> float:
        """Return m [kg]."""
        return ask.scenario.slice_mass

    def start(self, ask: Ask) -> FloatArray:
        """Return the state at release."""
        return np.concatenate([[ask.scenario.theta0], ask.start, np.zeros(self.n)]).astype(self.kind)

    def centre(self, r: FloatArray) -> float:
        """Return r_CM [m] (Eq. 10)."""
        return float((self.m * r.sum() + self.mb * self.length / 2) / (self.m * self.n + self.mb))

    def inertia(self, r: FloatArray) -> float:
        """Return J about C_M [kg m^2] (Eq. 11b, 11c)."""
        c = self.centre(r)
        from_centre = r - c
        return float(self.m * (from_centre @ from_centre) + self.own_inertia + self.mb * (self.length / 2 - c) ** 2)

    def spin(self, y: FloatArray) -> float:
        """Return omega [rad/s]."""
        return self.momentum / self.inertia(y[1 : self.n + 1])

    def turning(self, omega: float) -> float:
        """Return theta' [rad/s]."""
        return omega

    def body(self, r: FloatArray) -> tuple[float, float]:
        """Return mass [kg] and centre [m] of the tube and what rests in it."""
        return self.body_mass, float((self.mb * self.length / 2 + self.m * (self.held @ r)) / self.body_mass)

    def drag_on(self, v: FloatArray) -> FloatArray:
        """Return the acceleration of each slice by its own drag [m/s^2]."""
        return -(self.drag / self.m) * v

    def drag_of_body(self, v: FloatArray, mass: float) -> float:
        """Return the acceleration of the slices against the body by what drags on it [m/s^2]."""
        return float(-(self.drag / mass) * (self.free @ v))

    def weight(self, _y: FloatArray, _omega: float) -> float:
        """Return the acceleration by weight in the bottle's frame; in free flight there is none [m/s^2]."""
        return 0.0

    def acceleration(self, y: FloatArray, omega: float) -> FloatArray:
        """Return r'' of all slices as if they were free [m/s^2]."""
        r, v = y[1 : self.n + 1], y[self.n + 1 :]
        mass, centre = self.body(r)
        return omega * omega * (r - centre) + self.drag_on(v) + self.drag_of_body(v, mass) + self.weight(y, omega)

    def slope(self, y: FloatArray) -> FloatArray:
        """Return y'."""
        omega = self.spin(y)
        rates: FloatArray = np.empty(len(y), self.kind)
        rates[0] = self.turning(omega)
        rates[1 : self.n + 1] = self.moving * y[self.n + 1 :]
        rates[self.n + 1 :] = self.moving * self.acceleration(y, omega)
        return rates

    def advance(self, y: FloatArray, h: float) -> FloatArray:
        """Return the state after one smooth step."""
        if self.smooth_as_here:
            body = (self.body_mass, self.m, self.mb, self.length, self.own_inertia, self.momentum, self.drag)
            return _advanced(y, h, self.held, self.moving, *body)  # type: ignore[no-any-return]
        k1 = self.slope(y)
        k2 = self.slope(y + h / 2 * k1)
        k3 = self.slope(y + h / 2 * k2)
        k4 = self.slope(y + h * k3)
        return np.asarray(y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), dtype=self.kind)

    def restitution(self, _speed: float, _side: int) -> float:
        """Return e of an impact at a speed [m/s] on one end."""
        return self.e

    def recoil(self) -> float:
        """Return 1 / M_b, what an impulse does to the tube [1/kg]."""
        return 1.0 / self.mb

    def impulses(self, v: FloatArray, touching: IntArray, sides: IntArray) -> FloatArray:
        """Return the velocities after an impact [m/s].

        With R = 1 / M_b, P = sum_i s_i p_i and d_i = (1 + e) v_i-: p_i = m max(0, s_i (d_i - R P)). Newton's method
        finds P after as many steps as there are contacts, at most.
        """
        rates = np.array([self.restitution(abs(v[i]), int(s)) for i, s in zip(touching, sides, strict=True)])
        wanted = -rates * v[touching]
        change, on, moved = v[touching] - wanted, np.ones(len(touching), dtype=bool), 0.0
        for _ in range(2 * len(touching) + 2):
            whole = self.m * float(change[on].sum()) / (1.0 + self.recoil() * self.m * int(on.sum()))
            moved, before, on = self.recoil() * whole, on, sides * (change - self.recoil() * whole) > 0
            if np.array_equal(on, before):
                break
        new = v - moved
        new[touching[on]] = wanted[on]
        return new

    def meet(self, y: FloatArray, striking: IntArray) -> FloatArray:
        """Return the state after the slices ``striking`` (-1, 0, 1 each) have met their ends."""
        contact = striking + self.side
        touching = np.flatnonzero(contact)
        sides = contact[touching]
        y = y.copy()
        y[1 + touching] = np.where(sides > 0, self.high, self.low)
        v = self.impulses(y[self.n + 1 :].astype(float), touching, sides)
        slow = touching[np.abs(v[touching]) < self.rest_speed]
        side = np.zeros(self.n, dtype=np.int64)
        side[slow] = contact[slow]
        self.hold(side)
        ratio = self.m * self.recoil()
        y[self.n + 1 :] = v - ratio * float(v[slow].sum()) / (1 + ratio * len(slow))  # they stop against the tube
        y[self.n + 1 + slow] = 0.0
        return self.let_go(y)

    def let_go(self, y: FloatArray) -> FloatArray:
        """Release the slices that their end no longer presses, unless it would press them again as soon as they go."""
        held = self.side
        if held.any():
            omega = self.spin(y)
            going = held * self.acceleration(y, omega) < 0
            if going.any():
                self.hold(np.where(going, 0, held))
                back = going & (held * self.acceleration(y, omega) >= 0)
                self.hold(np.where(going & ~back, 0, held))
        return y

    def struck(self, y: FloatArray) -> IntArray:
        """Return which end each free slice has passed: 1 base, -1 cap, 0 none."""
        r = y[1 : self.n + 1]
        past = (r > self.high).astype(np.int64) - (r < self.low)
        return np.where(self.side == 0, past, 0)

    def step(self, y: FloatArray, h: float) -> FloatArray:
        """Return the state after a step with all its rebounds, each at its own time."""
        while self.impacts < 500 + 100 * self.n:  # a mistake may cause impacts without end
            new = self.advance(y, h)
            if self.frozen or not self.struck(new).any():
                return self.let_go(new)
            when, striking = _met(y, new, self.slope(y), self.slope(new), h, self.side, (self.low, self.high))
            self.impacts += 1
            y, h = self.meet(self.advance(y, when), striking), h - when
        return self.advance(y, h)

    def steps(self, span: float, dt: float) -> int:
        """Return the steps that lead over ``span`` [s]."""
        return max(1, int(np.ceil(span / dt * (1 - 1e-9))))

    def solve(self, ask: Ask) -> dict[str, FloatArray]:
        """Answer at the times asked."""
        self.begin(ask)
        y = self.start(ask)
        if not self.frozen:
            r = y[1 : self.n + 1]
            self.hold(np.where(r >= self.high - 1e-12, 1, np.where(r <= self.low + 1e-12, -1, 0)))
            y = self.let_go(y)
        t, rows, spins = 0.0, [], []
        for when in ask.times:
            if when > t:
                count = self.steps(when - t, float(ask.effort or 1e-4))
                for _ in range(count):
                    y = self.step(y, (when - t) / count)
                t = float(when)
            rows.append(y.copy())
            spins.append(self.spin(y))
        states = np.array(rows)
        _, r, v = np.split(states, [1, self.n + 1], axis=1)
        return {"t": ask.times, "theta": states[:, 0], "omega": np.array(spins), "r": r, "v": v}
