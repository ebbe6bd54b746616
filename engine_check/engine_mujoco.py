"""The run in MuJoCo: RK4 steps in C, impacts by us from the engine's mass matrix, at their own times.

    |-- step --|-- step --|-- step --x-- rest of step --|      x: a slice meets an end inside the step. Back to the
                                     |                         start of the step, a shorter step to the impact
               located, resolved, velocities jump              (``mujoco_hits``, ``mujoco_impacts``), then on.

Steps are taken many at a time while no slice is near an end, one at a time around impacts and releases.
theta, omega counter-clockwise positive; r, r' along the axis from the cap, relative to the tube: the engine's own
generalised coordinates.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from engine_check import watch
from engine_check.engines import Order, knobs_from
from engine_check.mujoco_settings import DISABLED, MujocoKnobs
from engine_check.watch import Bound, State
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, Trajectory

try:
    import mujoco
except ModuleNotFoundError as missing:
    raise RuntimeError('engine = "mujoco" needs MuJoCo: pip install "flipproof[mujoco]"') from missing

from engine_check.mujoco_hits import first_zero
from engine_check.mujoco_impacts import FREE, Contacts, IntArray
from engine_check.mujoco_log import no_log
from engine_check.mujoco_setup import verify
from engine_check.mujoco_world import TUBE_DOFS, World, build

LONGEST_LOOK: Final = 0.01
"""Most turning between two looks at the slices [rad]: their distances grow by at most e^0.01 in it."""

APPROACH: Final = 0.5
"""Share of the time to the nearest end, at present speeds, that is stepped without a look."""

MAX_EVENTS: Final = 10_000
"""Impacts within one step beyond which time is said not to pass [1]."""

BOUNDS: Final[Mapping[str, Bound]] = MappingProxyType(
    {
        "angular_momentum_drift": Bound(
            1e-3, "|L/L_0 - 1|", "1e-12 at 1e-4 s: only the truncation of RK4", "reduce dt"
        ),
        "linear_momentum_residual": Bound(
            1e-3, "|p - p_0 - M g t| / (M |omega_0| L)", "1e-12 at 1e-4 s: only the truncation of RK4", "reduce dt"
        ),
        "constraint_drift": Bound(
            1e-9, "largest distance of a slice from the axis / L", "generalised coordinates have no such drift", ""
        ),
        "omega_mismatch": Bound(
            1e-3, "|omega - L_0/J(positions)| / |omega_0|", "1e-12 at 1e-4 s: only the truncation of RK4", "reduce dt"
        ),
        "penetration": Bound(1e-9, "largest depth of a slice in an end / L", "impacts are located to 1e-12 L", ""),
    }
)
"""As ``watch.BOUNDS``, for an engine without constraint solver: what leaves these is a step that is too long."""


def run(scenario: Scenario, order: Order) -> Trajectory:
    """Throw the bottle in MuJoCo; the order as checked by ``engine_check.solve``.

    Impact law: simultaneous (``mujoco_impacts``); resting slices are held by the engine. ``impacts`` are real, in
    order of time; an output time that is an impact shows the state after it.

    Raises
    ------
    ValueError
        An explicit ``iterations`` (the impulses are exact: nothing is iterated), welded ice (there are no joints that
        could give), a knob that is unknown or out of range.
    SetupError
        If the engine did not receive what was meant.

    Accuracy
    --------
    Order 4 in dt where no slice comes to rest or is released in flight, impacts included, because they are located to
    the order of the step. Rests and releases are resolved to a step: bounces that would all end within ``rest_flight``
    dt are left out, a release between impacts waits for the end of its step (none occurred in twelve throws of 10 and
    50 slices; an impact releases at its own time), and a slice that grazes an end and returns within one step passes
    it (by at most a dt^2/8). Which slice rests when the tube is struck decides the order of later impacts: with drag,
    e < 1 and N = 50 omega differs from ``free-flight`` by 3e-5 to 7e-4 omega_0 at dt from 4e-4 to 2e-5 s, without
    order; ``free-flight`` itself moves as far with its rest speed.
    """
    settings = knobs_from(MujocoKnobs, order.knobs)
    if order.iterations is not None:
        raise ValueError(
            f"iterations = {order.iterations!r} has no meaning for engine = 'mujoco' (its impulses are exact); "
            "leave it out"
        )
    if scenario.frozen and order.ice != "rigid":
        raise ValueError(f"engine = 'mujoco' has no ice = {order.ice!r} (it has: rigid)")
    # A velocity whose square overflows is beyond MuJoCo's largest and ends the run with a status.
    with no_log(), np.errstate(over="ignore"):
        return _fly(scenario, order, settings)


def _fly(scenario: Scenario, order: Order, settings: MujocoKnobs) -> Trajectory:
    world = build(scenario, order.dt)
    setup = verify(world, scenario, order.dt)
    flight = _Flight(world, scenario, Contacts(world, scenario.restitution, settings.rest_flight * order.dt), setup)
    for when, count in order.intervals():
        if not flight.advance(when, count):
            break
    return flight.trajectory(
        {
            "engine": "mujoco",
            "mujoco_version": mujoco.__version__,
            "dt": order.dt,
            "iterations": None,
            "ice": order.ice if scenario.frozen else None,
            "slices": order.slices,
            "hits": None if scenario.frozen else "located",
            "points": len(order.times),
            "integrator": "RK4",
            "impact_law": "simultaneous",
            "disabled": ", ".join(DISABLED),
            **settings.to_mapping(),
        },
    )


class _StalledError(ArithmeticError):
    """Impacts follow each other without time passing."""


class _Flight:
    """One run: where it is, what was recorded, the largest residuals, and the verdict."""

    def __init__(self, world: World, scenario: Scenario, contacts: Contacts, setup: Mapping[str, float]) -> None:
        self._world, self._scenario, self._contacts, self._setup = world, scenario, contacts, setup
        self._option = world.model.opt
        self._qpos, self._qvel = world.data.qpos, world.data.qvel
        self._now = 0.0
        self._look = 1
        self._careful = 0
        self._steps, self._sizes = 0, list[float]()
        self._good: list[State] = []
        self._slices: list[tuple[FloatArray, FloatArray]] = []
        self._worst = dict.fromkeys(BOUNDS, 0.0)
        self._status, self._cause = "ok", ""
        if world.movable:
            contacts.resolve(0.0)

    # ------------------------------------------------------------------ stepping

    def advance(self, when: float, count: int) -> bool:
        """Take ``count`` equal steps to the output time ``when`` and record it; False if the run must stop."""
        start, taken = self._now, 0
        h = (when - start) / max(count, 1)
        if count:
            self._sizes.append(h)
        try:
            while taken < count:
                taken += self._some_steps(start + taken * h, h, count - taken)
        except _StalledError as stalled:
            self._status, self._cause = "stalled", str(stalled)
        except (ArithmeticError, np.linalg.LinAlgError) as broken:
            self._status, self._cause = "diverged", str(broken)
        self._steps += taken
        if self._status == "ok":
            self._now = when
            self._record()
        return self._status == "ok"

    def _some_steps(self, now: float, h: float, max_steps: int) -> int:
        """Take one step with all its impacts, or several if no slice meets an end; return how many."""
        if not self._world.movable:
            self._step(h, max_steps)
            return max_steps
        count = self._unwatched(h, max_steps)
        start = self._save()
        self._step(h, count)
        clean = not self._outside() and not (count > 1 and self._contacts.released())
        if clean and count > 1:
            self._look = count
            return count
        if count > 1:
            # Something happens among these steps: again, one by one.
            self._restore(start)
            self._look, self._careful = 0, count
            return 0
        self._careful = max(self._careful - 1, 0)
        self._look = int(clean)
        if not clean:
            self._restore(start)
            self._through_impacts(now, h)
        if self._contacts.released():
            self._contacts.resolve(now + h)
        return 1

    def _unwatched(self, h: float, max_steps: int) -> int:
        """Return how many steps can be taken without a look at the ends."""
        longest = min(2 * self._look, max_steps, int(LONGEST_LOOK / (abs(self._scenario.omega0) * h)))
        if self._careful or longest < 2:
            return 1
        world = self._world
        free = self._contacts.side == FREE
        gap = np.where(world.v > 0.0, world.high - world.r, world.r - world.low)[free]
        # A step's distance at rest: what a slice that has only begun to move may cover.
        reach = np.abs(world.v[free]) * h + world.axis_origin * (self._scenario.omega0 * h) ** 2
        return int(min(longest, max(1.0, APPROACH * float(np.min(gap / reach, initial=math.inf)))))

    def _through_impacts(self, now: float, h: float) -> None:
        """Go through one step of length ``h``, stopping at every impact."""
        contacts, left, events = self._contacts, h, 0
        while left > 0.0:
            start, part = self._save(), left
            self._step(part, 1)
            while self._outside(contacts.tolerance):
                out = contacts.beyond()
                earlier = self._first_hit(start, out, part)
                self._restore(start)
                if earlier > 0.0:
                    self._step(earlier, 1)
                if not earlier < part:
                    break
                part = earlier
            left -= part
            if contacts.striking():
                contacts.resolve(now + (h - left))
            elif part == 0.0:
                contacts.keep(out)
            else:
                continue
            events += 1
            if events > MAX_EVENTS:
                words = "reduce dt or raise rest_flight of engine_check.solve"
                raise _StalledError(f"{events} impacts within one step of {h:.3g} s; {words}")

    def _first_hit(self, start: tuple[FloatArray, FloatArray], out: IntArray, h: float) -> float:
        """Return the earliest time in [0, h] at which a slice met the end beyond which (``out``) it is now [s]."""
        world = self._world
        r, v = (part[TUBE_DOFS:] for part in start)
        first = h
        for i in np.flatnonzero(out).tolist():
            s = float(out[i])
            end = world.high if s > 0.0 else world.low
            gap = s * (end - float(r[i]))
            gaps = (gap if gap > self._contacts.tolerance else 0.0, s * (end - float(world.r[i])))
            first = min(first, first_zero(h, gaps, (-s * float(v[i]), -s * float(world.v[i]))))
        return first

    def _step(self, h: float, count: int) -> None:
        self._option.timestep = h
        mujoco.mj_step(self._world.model, self._world.data, count)
        # Beyond mjMAXVAL the next step would set everything back to the release.
        if not self._qvel @ self._qvel < mujoco.mjMAXVAL**2:
            raise ArithmeticError(f"a velocity exceeds MuJoCo's largest, {mujoco.mjMAXVAL:g}; reduce dt")

    def _outside(self, tolerance: float = 0.0) -> bool:
        world = self._world
        return bool(world.r.max() > world.high + tolerance or world.r.min() < world.low - tolerance)

    def _save(self) -> tuple[FloatArray, FloatArray]:
        return self._qpos.copy(), self._qvel.copy()

    def _restore(self, saved: tuple[FloatArray, FloatArray]) -> None:
        self._qpos[:], self._qvel[:] = saved

    # ------------------------------------------------------------------ bookkeeping

    def _record(self) -> None:
        """Keep the present state as an output point, unless an invariant exceeds its bound."""
        world, scenario = self._world, self._scenario
        state = world.state(self._now)
        if not state.finite:
            self._status, self._cause = "diverged", "the engine's numbers are no longer finite; reduce dt"
            return
        residuals = watch.measure(state, scenario, self._setup["angular_momentum"])
        self._worst = {name: max(worst, residuals[name]) for name, worst in self._worst.items()}
        self._cause = watch.first_left(residuals, BOUNDS)[1]
        if self._cause:
            self._status = "diverged"
            return
        r, v = scenario.initial_positions(), np.zeros(scenario.n_slices)
        if world.movable:
            r, v = world.r.copy(), np.where(self._contacts.side == FREE, world.v, 0.0)
        self._good.append(state)
        self._slices.append((r, v))

    def trajectory(self, settings: Mapping[str, Any]) -> Trajectory:
        """Return what was recorded up to the last good point."""
        scenario, good, contacts = self._scenario, self._good, self._contacts
        shape = (len(good), scenario.n_slices)
        bulk = [state.centre_and_inertia() for state in good]
        impacts = contacts.impacts()
        omega = np.array([state.omega for state in good])
        diagnostics: dict[str, Any] = {
            "steps": self._steps,
            "impacts": len(impacts),
            "rests": contacts.rests,
            "releases": contacts.releases,
            "largest_snap": contacts.largest_snap,
            **self._worst,
            "setup": dict(self._setup),
        }
        if scenario.frozen:
            diagnostics["ice_omega_drift"] = float(np.max(np.abs(omega / scenario.omega0 - 1.0), initial=0.0))
        return Trajectory(
            scenario=scenario,
            solver="engine_check",
            method="mujoco",
            t=np.array([state.t for state in good]),
            theta=np.array([state.angle for state in good]),
            omega=omega,
            r=np.array([r for r, _ in self._slices]).reshape(shape),
            v=np.array([v for _, v in self._slices]).reshape(shape),
            r_cm=np.array([centre for centre, _ in bulk]),
            inertia=np.array([inertia for _, inertia in bulk]),
            impacts=impacts,
            status=self._status,
            message=f"{self._status} after t = {self._now:.6g} s: {self._cause}" if self._cause else "",
            settings={
                **settings,
                "step": max(self._sizes, default=None),
                "step_least": min(self._sizes, default=None),
            },
            diagnostics=diagnostics,
        )
