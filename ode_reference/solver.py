"""The driver: SciPy's steppers between events, our contact rules at them, one Trajectory out.

    |--- step ---|--- step ---|-- step --x            x: an event inside the step. The state there comes from
                                         |-- step --    the dense output; contacts are resolved; a new stepper
    t_0                                 t_x             starts, because the right-hand side has changed.

``scipy.integrate.solve_ivp`` stops at an event but cannot reset it, reports only the first of simultaneous ones,
and finds the start of the step again after a rebound; hence this loop over its stepper classes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import DOP853, LSODA, OdeSolver, Radau

from ode_reference.arguments import known_name, number_above, number_within
from ode_reference.contact import FREE, SideArray, Walls, resolve
from ode_reference.events import event_release, event_wall
from ode_reference.models import MODELS, Instant, Motion, Throw
from slicemodel.scenario import Scenario
from slicemodel.trajectory import BASE, CAP, FloatArray, Impacts, Trajectory, output_times

Stepper = Callable[..., OdeSolver[np.float64]]

METHODS: Final[Mapping[str, Stepper]] = MappingProxyType({"DOP853": DOP853, "LSODA": LSODA, "Radau": Radau})
"""Steppers by name: explicit Runge-Kutta of order 8, multistep of varying order, implicit Runge-Kutta of order 5."""

STEP_LIMIT: Final = 1_000_000
"""Most steps of one run; every event ends a step, so this bounds the events too."""

WATCH: Final = 10_000
"""Steps in which the time must advance by at least ``LEAST_ADVANCE`` of the duration."""

LEAST_ADVANCE: Final = 1e-7


def solve(
    scenario: Scenario,
    model: str = "eq8",
    rtol: float = 1e-10,
    atol: float = 1e-13,
    rest_speed: float = 1e-5,
    times: ArrayLike | None = None,
    *,
    method: str = "DOP853",
    max_step: float | None = None,
) -> Trajectory:
    """Integrate one equation of motion through all its rebounds, rests and releases.

    Parameters
    ----------
    scenario : Scenario
    model : str
        A name in ``ode_reference.MODELS``: "eq8" (Eq. 8 exactly as printed) or "published-limit" (what the
        published program solves as its time step goes to zero).
    rtol : float
        Relative tolerance of a step, in [1e-13, 1e-2].
    atol : float
        Absolute tolerance of a step, in (0, 1e-2], one number for [rad], [m] and [m/s].
    rest_speed : float
        Speed below which a slice that an end pushes back stays there, in [1e-8, 0.1] [m/s].
    times : array, shape (P,), optional
        Increasing output times in [0, duration] [s]; 1000 uniform ones by default. They do not change the
        steps. At the time of an impact the state just before it is returned.
    method : str
        A name in ``ode_reference.METHODS``.
    max_step : float, optional
        Longest step, at least duration / 1e6 [s]. By default 0.01 / |omega0|, within duration / 1e5 and
        duration: a short step leaves no slice the time to reverse more than twice in it, and keeps the
        dense output as accurate as the step itself.

    Returns
    -------
    Trajectory
        With ``impacts``, ``settings`` to repeat the run and ``diagnostics`` (counts of steps, evaluations,
        impacts, rests and releases; ``largest_snap`` [m], how far from the end an impact was located at most).
        Status "overflow" or "stalled" returns the output times reached and says where it stopped.

    Raises
    ------
    ValueError
        Naming the argument, its value and the admissible values.

    Accuracy
    --------
    With the defaults omega(t) of the paper's throw changes by less than 1e-7 omega_0 when rtol and rest_speed are
    cut tenfold, and agrees with the other methods and with an independent program to the same band (measured: 1e-13,
    1e-10, 1e-13; tests/ode_reference). Two velocity reversals of one slice are seen within a step, more are not.
    "Radau" has a dense output of order 3 only: longer steps than the default cost it accuracy at the events.
    """
    if not isinstance(scenario, Scenario):
        raise ValueError(f"scenario = {scenario!r} is not a slicemodel.Scenario")
    chosen = MODELS[known_name("model", model, MODELS)]
    stepper = METHODS[known_name("method", method, METHODS)]
    rtol = number_within("rtol", rtol, 1e-13, 1e-2)
    atol = number_above("atol", atol, 0.0, 1e-2)
    rest_speed = number_within("rest_speed", rest_speed, 1e-8, 0.1, unit=" m/s")
    duration = scenario.duration
    if max_step is None:
        max_step = min(max(0.01 / abs(scenario.omega0), 1e-5 * duration), duration)
    else:
        max_step = number_within("max_step", max_step, duration / STEP_LIMIT, unit=" s")
    moments = output_times(scenario, times)

    settings = {
        "model": chosen.name,
        "rtol": rtol,
        "atol": atol,
        "rest_speed": rest_speed,
        "method": method,
        "max_step": max_step,
    }
    # Overflow is a result here, reported as a status: it must not also appear as a warning.
    with np.errstate(all="ignore"):
        motion = Motion(Throw.of(scenario), chosen, np.zeros(scenario.n_slices, dtype=bool))
        run = _Run(scenario, motion, moments, rest_speed)
        run.integrate(stepper, rtol=rtol, atol=atol, max_step=max_step)
        return run.trajectory(settings)


class _Run:
    """One run in progress: the state, who rests where, and what has been recorded so far."""

    def __init__(self, scenario: Scenario, motion: Motion, moments: FloatArray, rest_speed: float) -> None:
        self.scenario = scenario
        self.motion = motion
        self.moments = moments
        self.rest_speed = rest_speed
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
        self.watched_from = 0.0
        self.status, self.message = "ok", ""

    # ------------------------------------------------------------------ the loop

    def integrate(self, stepper: Stepper, *, rtol: float, atol: float, max_step: float) -> None:
        """Advance to the duration, or to where the run must stop; ``status`` says which."""
        duration = self.scenario.duration
        self.motion.held = np.full(self.scenario.n_slices, self.immobile)
        now = self.motion.at(self.t, self.y)
        if self._overflowed(now):
            return
        self._record(0.0, None)
        if not self.immobile:
            self._meet(now, self.walls.touched(now.r))
        step_size = max_step
        while self.status == "ok" and duration - self.t > 4 * np.spacing(duration):
            # LSODA starts at order 1, where the step of a running integration is far too long: it chooses its own.
            first_step = None if stepper is LSODA else min(step_size, max_step, duration - self.t)
            solver = stepper(
                self.motion, self.t, self.y, duration, first_step=first_step, max_step=max_step, rtol=rtol, atol=atol
            )
            step_size = self._smooth_piece(solver)
        if self.status == "ok":
            self.states[self.recorded :] = self.y
            self.recorded = len(self.moments)

    def _smooth_piece(self, solver: OdeSolver[np.float64]) -> float:
        """Advance until the first event, the duration or a failure; return the last full step size [s]."""
        start = self.motion.at(self.t, self.y)
        step_size = 0.0
        while solver.status == "running" and self._passes():
            failure = _advance(solver)
            if failure is not None:
                if not self._overflowed(start):
                    self._stall(failure)
                break
            end = self.motion.at(float(solver.t), np.array(solver.y))
            if self._overflowed(end):
                break
            step_size = end.t - start.t
            if self._pass_step(solver, start, end):
                break
            start = end
        return step_size

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

    def _pass_step(self, solver: OdeSolver[np.float64], start: Instant, end: Instant) -> bool:
        """Take over one step up to its end or to its first event; return whether there was an event."""
        dense = solver.dense_output()

        def path(t: float) -> Instant:
            # The ends are exact: a dense output may miss them by round-off, and a bracket must not.
            if t == start.t:
                return start
            return end if t == end.t else self.motion.at(t, dense(t))

        wall = release = None
        reached = end
        if not self.immobile:
            wall = event_wall(start, end, path, ~self.motion.held, self.walls)
            reached = end if wall is None else wall[0]
            release = event_release(start, reached, path, self.resting)
            reached = reached if release is None else release
        self._record(reached.t, dense)
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
            self.motion, now, struck, self.resting, self.walls, self.scenario.restitution, self.rest_speed
        )
        speed = np.abs(now.v[hits])
        real = speed > 0
        self.impacts.append(
            (np.full(int(real.sum()), now.t), hits[real], side[real], speed[real], outcome.speed_after[real])
        )
        self.counts["impacts"] += int(real.sum())
        self.counts["rests"] += outcome.rests
        self.counts["releases"] += outcome.releases
        self.y, self.resting = outcome.y, outcome.resting
        self.motion.held = self.resting != FREE

    # ------------------------------------------------------------------ bookkeeping

    def _record(self, until: float, dense: Any) -> None:
        """Keep the states at the output times up to ``until``; without dense output the present state."""
        stop = int(np.searchsorted(self.moments, until, side="right"))
        if stop > self.recorded:
            chosen = slice(self.recorded, stop)
            self.states[chosen] = self.y if dense is None else dense(self.moments[chosen]).T
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
            diagnostics={**self.counts, "evaluations": self.motion.evaluations, "largest_snap": self.largest_snap},
        )


def _advance(solver: OdeSolver[np.float64]) -> str | None:
    """Make one step; return why it failed, or None."""
    try:
        message = solver.step()
    except ValueError as error:  # the linear algebra of the implicit method refuses inf and NaN
        return str(error)
    return message if solver.status == "failed" else None
