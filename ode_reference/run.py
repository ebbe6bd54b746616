"""The driver: SciPy's steppers between events, our contact rules at them, one Trajectory out.

    |--- step ---|--- step ---|-- step --x            x: an event inside the step. The state there comes from
                                         |-- step --    the dense output; contacts are resolved; a new stepper
    t_0                                 t_x             starts, because the right-hand side has changed.

``scipy.integrate.solve_ivp`` stops at an event but cannot reset it, reports only the first of simultaneous ones,
and finds the start of the step again after a rebound; hence this loop over its stepper classes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ode_reference.contact import FREE, SideArray, Walls, resolve
from ode_reference.energy import Ledger, nodes
from ode_reference.events import event_release, event_wall
from ode_reference.impacts import Law
from ode_reference.motion import Instant, Motion
from ode_reference.steppers import Dense, Stepper
from slicemodel.scenario import Scenario
from slicemodel.trajectory import BASE, CAP, FloatArray, Impacts, Trajectory

STEP_LIMIT: Final = 1_000_000
"""Most steps of one run; every event ends a step, so this bounds the events too."""

WATCH: Final = 10_000
"""Steps in which the time must advance by at least ``LEAST_ADVANCE`` of the duration."""

LEAST_ADVANCE: Final = 1e-7


class Run:
    """One run in progress: the state, who rests where, and what has been recorded so far."""

    def __init__(
        self, scenario: Scenario, motion: Motion, moments: FloatArray, rest_speed: float, law: Law, energy: bool
    ) -> None:
        self.scenario = scenario
        self.motion = motion
        self.moments = moments
        self.rest_speed = rest_speed
        self.law = law
        self.walls = Walls.between(scenario.r_min, scenario.r_max, scenario.bottle.length)
        n = scenario.n_slices
        self.t = 0.0
        self.y = np.concatenate([[scenario.theta0], scenario.initial_positions(), np.zeros(n)])
        self.resting: SideArray = np.zeros(n, dtype=np.int64)
        # Ice, or a single slice as long as the tube: nothing can move.
        self.immobile = scenario.frozen or self.walls.high - self.walls.low <= self.walls.tolerance
        self.states = np.empty((len(moments), 2 * n + 1))
        self.recorded = 0
        self.impacts: list[tuple[NDArray[Any], ...]] = []
        self.counts = {"steps": 0, "impacts": 0, "rests": 0, "releases": 0}
        self.largest_snap = 0.0
        self.ledger = Ledger(motion, self.y) if energy else None
        self.watched_from = 0.0
        self.status, self.message = "ok", ""

    # ------------------------------------------------------------------ the loop

    def integrate(self, stepper: Stepper) -> None:
        """Advance to the duration, or to where the run must stop; ``status`` says which."""
        duration = self.scenario.duration
        self.motion.hold(np.full(self.scenario.n_slices, self.immobile))
        now = self.motion.at(self.t, self.y)
        if self._overflowed(now):
            return
        self._record(0.0, None)
        if not self.immobile:
            self._meet(now, self.walls.touched(now.r))
        while self.status == "ok" and duration - self.t > 4 * np.spacing(duration):
            self._smooth_piece(stepper)
        if self.status == "ok":
            self.states[self.recorded :] = self.y
            self.recorded = len(self.moments)

    def _smooth_piece(self, stepper: Stepper) -> None:
        """Advance until the first event, the duration or a failure."""
        start = self.motion.at(self.t, self.y)
        if self._overflowed(start):
            return
        stepper.start(start)
        while self.t < self.scenario.duration and self._passes():
            end = stepper.step()
            if isinstance(end, str):
                self._stall(end)
                break
            if self._overflowed(end) or self._pass_step(stepper, start, end):
                break
            start = end

    def _passes(self) -> bool:
        """Count one more step; return False, and note the stall, if time has ceased to pass."""
        self.counts["steps"] += 1
        steps = self.counts["steps"]
        if steps % WATCH == 0:
            if self.t - self.watched_from < LEAST_ADVANCE * self.scenario.duration or steps >= STEP_LIMIT:
                self._stall(f"time hardly passes after {steps} steps")
                return False
            self.watched_from = self.t
        return True

    def _pass_step(self, stepper: Stepper, start: Instant, end: Instant) -> bool:
        """Take over one step up to its end or to its first event; return whether there was an event."""
        path = _Path(self.motion, start, end, stepper)
        wall = release = None
        reached = end
        if not self.immobile:
            wall = event_wall(start, end, path, ~self.motion.held, self.walls)
            reached = end if wall is None else wall[0]
            release = event_release(start, reached, path, self.resting)
            reached = reached if release is None else release
        self._record(reached.t, path)
        if self.ledger is not None and reached.t > start.t:
            self.ledger.smooth(start.t, reached.t, path.dense(nodes(start.t, reached.t)))
        self.t, self.y = reached.t, reached.y
        if wall is None and release is None:
            return False
        struck = self.walls.struck(reached, ~self.motion.held)
        if wall is not None and reached is wall[0]:
            # Located there, even if round-off now calls it a hair away from contact or from approach.
            middle = (self.walls.low + self.walls.high) / 2
            struck[wall[1]] = BASE if reached.r[wall[1]] > middle else CAP
        self._meet(reached, struck)
        return True

    def _meet(self, now: Instant, struck: SideArray) -> None:
        """Resolve the contacts of one instant and take over the state after them."""
        hits = np.flatnonzero(struck)
        side = struck[hits]
        ends = np.where(side == BASE, self.walls.high, self.walls.low)
        if hits.size:
            self.largest_snap = max(self.largest_snap, float(np.max(np.abs(now.r[hits] - ends))))
        outcome = resolve(
            self.motion, now, struck, self.resting, self.walls, self.scenario.restitution, self.rest_speed, self.law
        )
        speed = np.abs(now.v[hits])
        real = speed > 0
        self.impacts.append(
            (np.full(int(real.sum()), now.t), hits[real], side[real], speed[real], outcome.speed_after[real])
        )
        self.counts["impacts"] += int(real.sum())
        self.counts["rests"] += outcome.rests
        self.counts["releases"] += outcome.releases
        if self.ledger is not None:
            self.ledger.jump("impacts", now.y, outcome.rebounded)
            self.ledger.jump("rests", outcome.rebounded, outcome.y)
        self.y, self.resting = outcome.y, outcome.resting
        self.motion.hold(self.resting != FREE)

    # ------------------------------------------------------------------ bookkeeping

    def _record(self, until: float, path: _Path | None) -> None:
        """Keep the states at the output times up to ``until``; without a path the present state."""
        stop = self.recorded
        while stop < len(self.moments) and self.moments[stop] <= until:
            stop += 1
        if stop > self.recorded:
            chosen = slice(self.recorded, stop)
            self.states[chosen] = self.y if path is None else path.dense(self.moments[chosen]).T
            self.recorded = stop

    def _overflowed(self, now: Instant) -> bool:
        """Note and return whether the state or its acceleration has left the floating-point range."""
        if np.isfinite(now.y).all() and np.isfinite(now.a).all():
            return False
        self.status = "overflow"
        self.message = (
            f"{self.motion.model.name}: a number exceeded the floating-point range after t = {self.t:.9g} s; "
            f"omega0 = {self.scenario.omega0:g} rad/s, drag = {self.scenario.drag:g} kg/s and "
            f"gravity = {self.scenario.gravity:g} m/s^2 cannot be computed together"
        )
        return True

    def _stall(self, why: str) -> None:
        recent = np.concatenate([slices for _, slices, *_ in self.impacts[-20:]]) if self.impacts else np.zeros(0)
        who = ", ".join(str(int(i)) for i in np.unique(recent)) or "none"
        self.status = "stalled"
        self.message = (
            f"{self.motion.model.name}: {why.rstrip('.')} at t = {self.t:.9g} s; slices of the last impacts: {who}; "
            f"if they chatter, raise rest_speed (now {self.rest_speed:g} m/s), else check omega0, gravity and drag"
        )

    def trajectory(self, settings: Mapping[str, Any]) -> Trajectory:
        """Return what has been recorded, with omega, r_CM and J of each recorded state."""
        n = self.scenario.n_slices
        states = self.states[: self.recorded]
        axis = [self.motion.throw.about_centre_of_mass(y[1 : n + 1]) for y in states]
        inertia = np.array([j for _, _, j in axis])
        columns = zip(*self.impacts, strict=True) if self.impacts else [()] * 5
        impacts = Impacts(*(np.concatenate([np.zeros(0), *column]) for column in columns))
        return Trajectory(
            scenario=self.scenario,
            solver="ode_reference",
            method=self.motion.model.name,
            t=self.moments[: self.recorded],
            theta=states[:, 0],
            omega=self.motion.throw.angular_momentum / inertia,
            r=states[:, 1 : n + 1],
            v=states[:, n + 1 :],
            r_cm=np.array([r_cm for r_cm, _, _ in axis]),
            inertia=inertia,
            impacts=impacts,
            status=self.status,
            message=self.message,
            settings=settings,
            diagnostics={
                **self.counts,
                "evaluations": self.motion.evaluations,
                "largest_snap": self.largest_snap,
                "grazes": grazes(impacts, self.rest_speed),
                **({} if self.ledger is None else {"energy": self.ledger.closed(self.y)}),
            },
        )


def grazes(impacts: Impacts, rest_speed: float) -> int:
    """Return how many contacts were slower than the rest speed by slices that had left their last one twice as fast.

    Such a contact might as well have been missed, and its time is uncertain as 1 / speed: where there is one, omega(t)
    need not converge as fast as its settings promise. A rebound that comes back at the speed it left with is none.
    """
    order = np.lexsort((impacts.time, impacts.slice))
    slices, before, after = impacts.slice[order], impacts.speed_before[order], impacts.speed_after[order]
    same = slices[1:] == slices[:-1]
    left = np.concatenate([[np.inf], np.where(same, after[:-1], np.inf)])[: len(before)]
    return int(np.count_nonzero((before < rest_speed) & (left > 2 * rest_speed)))


class _Path:
    """The states of one step; its dense output is made when somebody first looks inside the step."""

    __slots__ = ("_dense", "end", "motion", "start", "stepper")

    def __init__(self, motion: Motion, start: Instant, end: Instant, stepper: Stepper) -> None:
        self.motion, self.start, self.end, self.stepper = motion, start, end, stepper
        self._dense: Dense | None = None

    @property
    def dense(self) -> Dense:
        if self._dense is None:
            self._dense = self.stepper.dense_output()
        return self._dense

    def __call__(self, t: float) -> Instant:
        # The ends are exact: a dense output may miss them by round-off, and a bracket must not.
        if t == self.start.t:
            return self.start
        return self.end if t == self.end.t else self.motion.at(t, self.dense.state(t))

    def of_slice(self, t: float, i: int) -> tuple[float, float]:
        for known in (self.start, self.end):
            if t == known.t:
                return float(known.r[i]), float(known.v[i])
        return self.dense.of_slice(t, i)
