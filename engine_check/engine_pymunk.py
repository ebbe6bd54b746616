"""The run in pymunk: steps in C, one look at the bodies per output time, a watch on what must hold.

    t_k:  x, angle known        ... step, step, step ...        t_k+1
          v before | v after  =  v(t_k - h/2) | v(t_k + h/2)    omega(t_k) = their mean

Chipmunk's velocities stand half a step ahead of its positions (leapfrog; ``pymunk_world.start_staggered``), so
velocities at an output time are the mean of those before and after the step that arrives there.
theta, omega counter-clockwise positive; r, r' along the axis from the cap, relative to the tube.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pymunk

from engine_check import pymunk_rods as rods
from engine_check import pymunk_settings as fixed
from engine_check import watch
from engine_check.engines import Order, knobs_from
from engine_check.pymunk_settings import PymunkKnobs, enough_iterations, restitution_between_slices
from engine_check.pymunk_setup import verify
from engine_check.pymunk_world import BatchReader, World, build, start_staggered
from engine_check.watch import State
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, Trajectory

WATCH_STEPS: Final = 100
"""Most steps between two looks [1]: an explosion grows a hundredfold in ten, and must be seen early."""

WELD_ORDER: Final = 2
"""Order in dt at which the drift of welded ice falls (joint errors are removed within one step: error_bias = 0)."""


def run(scenario: Scenario, order: Order) -> Trajectory:
    """Throw the bottle in pymunk; the order as checked by ``engine_check.solve``.

    Accuracy
    --------
    omega, theta, r: order 2 in dt before the first impact without drag if e = 1, else order 1, because

    - the damper acts on the velocity at the end of the step (error about gamma dt),
    - an impact is seen at the next grid point and sinks in by up to v dt; at an output time that is an
      impact, omega and r' are means over the jump,
    - a slice that rests on an end creeps into it at (1 - e) / (2 (1 + e)) omega^2 |r - L/2| dt (derived from
      Chipmunk's step: a contact, unlike a joint, is held at velocity level; the approach of one step,
      a dt, is answered by -e, which needs e = 1 to cancel the drift a dt/2). L stays exact. The creep dominates
      when slices rest at high omega: omega(0.5 s) of 0.1 kg, e = 0 is 0.7 % low at dt = 1e-4 s. Slices that
      exclude each other in a full bottle can do nothing else: |omega/omega_0 - 1| at 0.5 s is about 95 dt/s at
      e = 0.5 and 280 dt/s at e = 0, so that 1e-3 needs dt = 1e-5 s and 3e-6 s; at e = 1 it is 7e-4 at dt = 1e-4 s
      and N = 50.

    Output intervals that need unequal steps cost one order: a leapfrog whose step changes from h to h' has
    kicked its velocities for (h - h')/2 too long.
    """
    settings = knobs_from(PymunkKnobs, order.knobs)
    iterations = enough_iterations(scenario) if order.iterations is None else order.iterations
    ice, dt, times = order.ice, order.dt, order.times
    world = build(scenario, settings, iterations, ice, order.slices)
    setup = verify(world, scenario, settings, iterations, ice, order.slices)
    flight = _Flight(world, scenario, settings, setup["angular_momentum"], order.slices == "exclude")

    for when, count in order.intervals():
        if count == 0:
            flight.record()
        elif not flight.advance(when, count):
            break
    return flight.trajectory(
        method="pymunk",
        settings={
            "engine": "pymunk",
            "pymunk_version": pymunk.version,
            "chipmunk_version": pymunk.chipmunk_version,
            "dt": dt,
            "iterations": iterations,
            "ice": ice if scenario.frozen else None,
            "slices": order.slices,
            "hits": None if scenario.frozen else "grid",
            "points": len(times),
            **fixed.FIXED,
            **settings.to_mapping(),
            "slice_restitution": restitution_between_slices(scenario, settings, order.slices),
        },
        setup=setup,
    )


class _Flight:
    """The bookkeeping of one run: where it is, what was recorded, the largest residuals, and the verdict."""

    def __init__(
        self, world: World, scenario: Scenario, knobs: PymunkKnobs, angular_momentum: float, exclude: bool
    ) -> None:
        self._world, self._scenario, self._exclude = world, scenario, exclude
        self._offset = knobs.grid_offset
        self._angular_momentum = angular_momentum
        self._reader = BatchReader(world)
        rows = self._reader.read()
        self._state = self._centred(0.0, 0.0, rows, rows, 0.0, 0.0)
        self._steps, self._sizes = 0, list[float]()
        self._worst = dict.fromkeys((*watch.BOUNDS, *(rods.BOUNDS if exclude else ())), 0.0)
        self._good: list[State] = []
        self._cause, self._reason = "", ""

    def record(self) -> None:
        """Keep the present state as an output point."""
        self._good.append(self._state)

    def advance(self, when: float, count: int) -> bool:
        """Take ``count`` equal steps to the output time ``when`` and record it; False if a bound is exceeded."""
        start = self._state.t
        step = (when - start) / count
        if not self._sizes:
            start_staggered(self._world, step, self._offset * step)
        self._sizes.append(step)
        lag = self._offset * self._sizes[0]
        # Velocities were started for the first step: a later, different one leaves them ahead by half the change.
        ahead = (self._sizes[0] - step) / 2
        taken = 0
        while taken < count:
            chunk = min(WATCH_STEPS, count - taken)
            before = self._step(step, chunk)
            taken += chunk
            self._steps += chunk
            now = when if taken == count else start + taken * step
            self._state = self._centred(now, now + ahead, before, self._reader.read(), lag, step)
            self._cause = self._judge()
            if self._cause:
                return False
        self.record()
        return True

    def _step(self, step: float, count: int) -> FloatArray:
        """Take ``count`` steps, and return the state before the last."""
        for _ in range(count - 1):
            self._world.space.step(step)
        before = self._reader.read()
        self._world.space.step(step)
        return before

    def _centred(
        self, now: float, gravity_time: float, before: FloatArray, after: FloatArray, lag: float, step: float
    ) -> State:
        """Return the state ``lag`` after a grid point, from before and after the step that ends there."""
        # An exploding run may overflow here; the watch reports it as not finite.
        with np.errstate(over="ignore", invalid="ignore"):
            mean = (before + after) / 2
            if lag:
                mean = mean + lag / step * (after - before)
                after = np.hstack([after[:, :3] + lag * after[:, 3:], after[:, 3:]])
        world = self._world
        return State(
            t=now,
            angle=after[0, 2],
            omega=mean[0, 5],
            x=after[:, :2],
            v=mean[:, 3:5],
            masses=world.masses,
            axis_origin=world.axis_origin,
            spin_moment=world.spin_moment,
            gravity_time=gravity_time,
        )

    def _judge(self) -> str:
        if not self._state.finite:
            self._reason = "not_finite"
            return "the engine's numbers are no longer finite; raise iterations"
        with np.errstate(over="ignore", invalid="ignore"):
            residuals = watch.measure(self._state, self._scenario, self._angular_momentum)
            if self._exclude:
                residuals |= rods.measure(self._state, self._scenario)
            for name, value in residuals.items():
                self._worst[name] = max(self._worst[name], value)
            bounds = (watch.BOUNDS, rods.BOUNDS) if self._exclude else (watch.BOUNDS,)
            left = (watch.first_left(residuals, limits)[0] for limits in bounds)
            self._reason = next(filter(None, left), "")
            cause = watch.broken(residuals, fixed.CAP_THICKNESS)
            return cause or (rods.broken(residuals, self._scenario) if self._exclude else "")

    def trajectory(self, *, method: str, settings: Mapping[str, Any], setup: Mapping[str, float]) -> Trajectory:
        """Return what was recorded up to the last good point."""
        scenario, good = self._scenario, self._good
        axial = [state.along_axis() for state in good]
        bulk = [state.centre_and_inertia() for state in good]
        shape = (len(good), len(self._world.slices))
        r = np.array([r for r, _ in axial]).reshape(shape)
        v = np.array([v for _, v in axial]).reshape(shape)
        if not self._world.slices:
            # One rigid body: its slices are where they were put, by construction.
            r = np.tile(scenario.initial_positions(), (len(good), 1))
            v = np.zeros_like(r)
        omega = np.array([state.omega for state in good])
        diagnostics: dict[str, Any] = {"steps": self._steps, **self._worst, "setup": dict(setup)}
        if scenario.frozen:
            diagnostics |= _ice_drift(scenario, omega, r)
        message = f"diverged at t = {self._state.t:.6g} s: {self._cause}" if self._cause else ""
        return Trajectory(
            scenario=scenario,
            solver="engine_check",
            method=method,
            t=np.array([state.t for state in good]),
            theta=np.array([state.angle for state in good]),
            omega=omega,
            r=r,
            v=v,
            r_cm=np.array([centre for centre, _ in bulk]),
            inertia=np.array([inertia for _, inertia in bulk]),
            impacts=None,
            status="diverged" if self._cause else "ok",
            message=message,
            reason=self._reason,
            settings={
                **settings,
                "step": max(self._sizes, default=None),
                "step_least": min(self._sizes, default=None),
                "reads": self._reader.how,
            },
            diagnostics=diagnostics,
        )


def _ice_drift(scenario: Scenario, omega: FloatArray, r: FloatArray) -> dict[str, float]:
    return {
        "ice_omega_drift": float(np.max(np.abs(omega / scenario.omega0 - 1.0), initial=0.0)),
        "ice_slice_drift": float(np.max(np.abs(r - scenario.initial_positions()), initial=0.0)),
        "weld_order": WELD_ORDER,
    }
