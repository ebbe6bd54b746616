r"""Rods in a free tube: what slices do that cannot pass through each other, from event to event.

     cap                                             base
      |  gap n  [n-1]  gap n-1  ...  [1] gap 1 [0] gap 0 |   --> u_r
      |         x_{n-1}              x_1       x_0        |
      |<-------------------- L ------------------------->|   centre of the tube x_b, rods of length h/N

Places x are measured along the axis from C_M, which falls, so that gravity has gone; u = x'. With p_j >= 0 the force
that opens gap j, written once for all bodies, x = (x_0 .. x_{n-1}, x_b), masses M = diag(m .. m, M_b):

    gaps     g = G x + g_0:   g_j = x_{j-1} - x_j - h/N,   g_0 = x_b + L/2 - x_0 - h/2N,   g_n likewise at the cap
    flight   M x'' = omega^2 M x + drag + G^T p,   drag on rod i -alpha (u_i - u_b), on the tube their reactions
    spin     theta' = omega = J_0 omega_0 / J,     J = sum m x_i^2 + M_b (x_b^2 + R^2/2 + L^2/12)

Closed gaps hold by their p, found so that G x'' = 0 there; a gap opens when its p has fallen to zero. An impact is
Newton's law on all gaps that are zero at that instant at once, with one restitution for ends and one for rods:

    w = G u,   w+ = w + A p,   A = G M^-1 G^T,   p >= 0,   w+ + e w >= 0,   the product of the last two 0

which is the minimum of |M^-1/2 G^T p - d|^2 over p >= 0 where d is any vector with G M^-1/2 d = -(1 + e) w.

Nothing here is shared with ``ode_reference.models``: there the places are relative to the tube and slices pass
through each other. Meant for few rods; the exact motion at e = 0 without drag is ``rod_stacks``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import nnls

from slicemodel.scenario import Scenario
from slicemodel.trajectory import BASE, CAP, FloatArray, Impacts, Trajectory, output_times

BoolArray = NDArray[np.bool_]

MAX_EVENTS: Final = 100_000
"""Events of one run at the most; a rebound that takes twice its rest speed to end costs about ten."""

TOUCHING: Final = 1e-12
"""Gap that counts as none [L]; the root of a gap leaves 1e-15, the lowest rebound rises 1e-12 m."""

LONGEST_TURN: Final = 0.02
"""Longest step, as the angle by which the bottle turns in it at release [rad]: a gap that closes and opens again
within one step is missed."""

OVERLAPPING: Final = 1e-6
"""Overlap that no root leaves [L]."""

SHORTEST_STOP: Final = 0.2
"""Longest step in times in which the drag stops the water: a gap opens at release and closes again as fast."""

SLACK: Final = 1e-9
"""Push that counts as none [M_w omega^2 L]: at the instant of a release its root leaves 1e-12."""


class Tube:
    """The constants of one throw as the equations above name them."""

    def __init__(self, scenario: Scenario, rod_restitution: float) -> None:
        bottle, n = scenario.bottle, scenario.n_slices
        self.n, self.length = n, bottle.length
        self.mass = np.array([*[scenario.slice_mass] * n, bottle.mass])
        self.own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        self.drag = scenario.drag
        # Row j of G: gap j grows with whatever is on its base side and shrinks with what is on its cap side.
        self.gaps_of = np.zeros((n + 1, n + 1))
        for j in range(n + 1):
            self.gaps_of[j, j - 1 if j else n] += 1.0
            self.gaps_of[j, j if j < n else n] -= 1.0
        rod = scenario.slice_height
        self.offset = np.array([bottle.length / 2 - rod / 2, *[-rod] * (n - 1), bottle.length / 2 - rod / 2])
        e = scenario.restitution
        self.restitution = np.array([e, *[rod_restitution] * (n - 1), e])
        self.coupling = self.gaps_of / self.mass @ self.gaps_of.T
        start = np.array([*scenario.initial_positions(), bottle.length / 2])
        self.start = start - self.mass @ start / self.mass.sum()
        self.angular_momentum = self.inertia(self.start) * scenario.omega0

    def inertia(self, x: FloatArray) -> float:
        """Return J [kg m^2] for places ``x``, shape (n + 1,)."""
        return float(self.mass @ (x * x)) + self.own

    def gaps(self, x: FloatArray) -> FloatArray:
        """Return the gaps [m], base first, shape (n + 1,)."""
        return np.asarray(self.gaps_of @ x + self.offset)

    def free_acceleration(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """Return x'' [m/s^2] if no gap pushed, shape (n + 1,)."""
        rub = self.drag * (u - u[-1])
        rub[-1] = -rub[:-1].sum()
        return np.asarray((self.angular_momentum / self.inertia(x)) ** 2 * x - rub / self.mass)

    def push(self, x: FloatArray, u: FloatArray, closed: BoolArray) -> FloatArray:
        """Return the forces p [N] that keep the ``closed`` gaps closed, 0 at the others, shape (n + 1,)."""
        p = np.zeros(self.n + 1)
        if closed.any():
            opening = (self.gaps_of @ self.free_acceleration(x, u))[closed]
            p[closed] = np.linalg.solve(self.coupling[np.ix_(closed, closed)], -opening)
        return p

    def thrust(self, demand: FloatArray, where: BoolArray) -> FloatArray:
        """Return p >= 0 with A p >= ``demand`` and p (A p - demand) = 0 on the gaps ``where``, shape (n + 1,)."""
        p = np.zeros(self.n + 1)
        if where.any():
            matrix = (self.gaps_of[where] / np.sqrt(self.mass)).T
            target = np.linalg.lstsq(matrix.T, demand[where], rcond=None)[0]
            p[where] = nnls(matrix, target)[0]
        return p

    def pushed(self, p: FloatArray) -> FloatArray:
        """Return M^-1 G^T p: what forces (impulses) p do to the accelerations (velocities)."""
        return np.asarray(self.gaps_of.T @ p / self.mass)


def solve(
    scenario: Scenario,
    rod_restitution: float | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-13,
    rest_speed: float = 1e-4,
    times: ArrayLike | None = None,
) -> Trajectory:
    """Throw a bottle, not full and not of ice, whose slices are few rods of length h/N that cannot overlap.

    Two rods meet with ``rod_restitution`` (None: the scenario's); a gap slower than ``rest_speed`` [m/s] stays closed
    where it is pressed. ``impacts`` are those on the two ends. 1e-9 omega_0 against ``rod_stacks`` at e = 0, no drag.
    """
    between = scenario.restitution if rod_restitution is None else rod_restitution
    flight = _Flight(scenario, Tube(scenario, between), rest_speed, {"rtol": rtol, "atol": atol, "method": "DOP853"})
    moments = output_times(scenario, times)
    return flight.trajectory(moments, flight.states(moments))


class _Flight:
    """One run in progress: the state y = (theta, x, u), which gaps are closed, and what has been counted."""

    def __init__(self, scenario: Scenario, tube: Tube, rest_speed: float, options: dict[str, Any]) -> None:
        self.scenario, self.tube, self.rest_speed, self.options = scenario, tube, rest_speed, options
        self.t = 0.0
        self.y = np.concatenate([[scenario.theta0], tube.start, np.zeros(tube.n + 1)])
        self.closed: BoolArray = np.zeros(tube.n + 1, dtype=bool)
        self.rebounding: BoolArray = np.zeros(tube.n + 1, dtype=bool)
        self.hits: list[tuple[float, int, int, float, float]] = []
        self.counts = {"events": 0, "rod_impacts": 0}
        stopping = scenario.drag * (1 / scenario.slice_mass + scenario.n_slices / scenario.bottle.mass)
        self.longest_step = LONGEST_TURN / abs(scenario.omega0)
        if stopping * self.longest_step > SHORTEST_STOP:
            self.longest_step = SHORTEST_STOP / stopping

    def split(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return x and u of a state."""
        return y[1 : self.tube.n + 2], y[self.tube.n + 2 :]

    def slope(self, t: float, y: FloatArray) -> FloatArray:
        """Return dy/dt with the gaps closed that are."""
        del t
        tube = self.tube
        x, u = self.split(y)
        omega = tube.angular_momentum / tube.inertia(x)
        a = tube.free_acceleration(x, u) + tube.pushed(tube.push(x, u, self.closed))
        return np.concatenate([[omega], u, a])

    def states(self, moments: FloatArray) -> FloatArray:
        """Advance to the duration; return the states at the output times, shape (P, 2n + 3)."""
        kept = [self.y for moment in moments if moment == 0.0]
        self._meet()
        while self.t < self.scenario.duration:
            if self.counts["events"] >= MAX_EVENTS:
                raise ArithmeticError(f"rods: {MAX_EVENTS} events by t = {self.t:.9g} s")
            kept += self._leg(moments)
        return np.array(kept).reshape(-1, len(self.y))

    def _leg(self, moments: FloatArray) -> list[FloatArray]:
        """Integrate up to the next event; return the states at the output times on the way."""
        stop = self._half_rebound()
        inside = moments[(moments > self.t) & (moments <= stop)]
        events = [self._event(j) for j in range(self.tube.n + 1)]
        run = solve_ivp(
            self.slope, (self.t, stop), self.y, events=events, dense_output=True,
            max_step=self.longest_step, **self.options,
        )  # fmt: skip
        if run.status < 0:
            raise ArithmeticError(f"rods: {run.message} at t = {run.t[-1]:.9g} s")
        self.t, self.y = float(run.t[-1]), run.y[:, -1].copy()
        if (deepest := self.tube.gaps(self.split(self.y)[0]).min()) < -OVERLAPPING * self.tube.length:
            raise ArithmeticError(f"rods overlap by {-deepest:.2g} m at t = {self.t:.9g} s: the step missed an impact")
        self.rebounding[:] = False
        if run.status == 1:
            self._meet()
        path = run.sol
        assert path is not None  # asked for with dense_output
        return [np.asarray(path(moment)) for moment in inside if moment <= self.t]

    def _half_rebound(self) -> float:
        """Return how far to integrate: half of the shortest rebound that has just begun, else to the duration.

        A gap that starts at zero may close again before the first step ends, and its root would be the start. It is
        not watched while it still opens; half-way it is as wide as it gets.
        """
        stop = self.scenario.duration
        if not self.rebounding.any():
            return stop
        w = self.tube.gaps_of @ self.split(self.y)[1]
        a = self.tube.gaps_of @ self.split(self.slope(self.t, self.y))[1]
        self.rebounding &= a < 0
        until_top = -w[self.rebounding] / a[self.rebounding]
        return min(stop, self.t + float(np.min(until_top, initial=np.inf)))

    def _event(self, j: int) -> Callable[[float, FloatArray], float]:
        """Return what falls through zero when gap ``j`` closes, or, if it is closed, opens."""

        def event(t: float, y: FloatArray) -> float:
            del t
            x, u = self.split(y)
            if self.closed[j]:
                return float(self.tube.push(x, u, self.closed)[j])
            return 1.0 if self.rebounding[j] else float(self.tube.gaps(x)[j])

        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
        return event

    def _meet(self) -> None:
        """Resolve all contacts of this instant: impacts, then who stays closed."""
        tube = self.tube
        self.counts["events"] += 1
        x, u = self.split(self.y)
        touching = self.closed | (tube.gaps(x) <= TOUCHING * tube.length)
        w = tube.gaps_of @ u
        struck = touching & ~self.closed & (w < 0)
        if struck.any():
            u += tube.pushed(tube.thrust(-(1.0 + tube.restitution) * w, touching))
        slow = touching & (tube.gaps_of @ u < self.rest_speed)
        needed = tube.thrust(-(tube.gaps_of @ tube.free_acceleration(x, u)), slow)
        scale = self.scenario.water_mass * tube.length * (tube.angular_momentum / tube.inertia(x)) ** 2
        self.closed = needed > SLACK * scale
        if self.closed.any():
            matrix = tube.coupling[np.ix_(self.closed, self.closed)]
            for values, wrong in ((u, tube.gaps_of @ u), (x, tube.gaps(x))):
                p = np.zeros(tube.n + 1)
                p[self.closed] = np.linalg.solve(matrix, -wrong[self.closed])
                values += tube.pushed(p)
        self.rebounding = touching & ~self.closed & (tube.gaps_of @ u > 0)
        self._note(struck, w, tube.gaps_of @ u)

    def _note(self, struck: BoolArray, before: FloatArray, after: FloatArray) -> None:
        for j in np.flatnonzero(struck).tolist():
            if j in (0, self.tube.n):
                end = BASE if j == 0 else CAP
                self.hits.append((self.t, 0 if j == 0 else self.tube.n - 1, end, -before[j], max(after[j], 0.0)))
            else:
                self.counts["rod_impacts"] += 1

    def trajectory(self, t: FloatArray, states: FloatArray) -> Trajectory:
        """Return what was recorded, with places relative to the cap and velocities relative to the tube."""
        tube, n = self.tube, self.tube.n
        x, u = states[:, 1 : n + 2], states[:, n + 2 :]
        inertia = np.array([tube.inertia(row) for row in x])
        columns = list(zip(*self.hits, strict=True)) or [()] * 5
        gaps = x @ tube.gaps_of.T + tube.offset
        return Trajectory(
            scenario=self.scenario,
            solver="ode_reference",
            method="rods",
            t=t,
            theta=states[:, 0],
            omega=tube.angular_momentum / inertia,
            r=tube.length / 2 + x[:, :n] - x[:, n:],
            v=u[:, :n] - u[:, n:],
            r_cm=tube.length / 2 - x[:, n],
            inertia=inertia,
            impacts=Impacts(*(np.array(column) for column in columns)),
            diagnostics={
                **self.counts,
                "largest_overlap": max(0.0, -float(gaps.min(initial=0.0))),
                "largest_momentum": float(np.max(np.abs(u @ tube.mass), initial=0.0)),
            },
        )
