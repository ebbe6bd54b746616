"""The run of Eq. 8's own world: forces in, one step of the engine, positions out, step after step.

    t_k:  x_k, v(t_k + h/2)  ->  x_k + h v  ->  omega, theta, F at t_k + h  ->  step  ->  x_(k+1), v(t_k + 3h/2)

Chipmunk's step moves positions first, with the velocities of the step before, and forms velocities afterwards
(``pymunk_settings``). A force has to be handed over before the step but acts after the positions have moved:
it is therefore worked out where the engine is about to hold the slices, which is a sum of two numbers of its own
(``prediction_gap`` states how far the engine then was from there). Velocities stand half a step ahead
of positions (leapfrog); those at an output time are the mean of the values before and after the step that arrives
there. theta, omega counter-clockwise positive; r, r' along the tube from the cap, x from its centre.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pymunk

from engine_check import watch
from engine_check.pymunk_rotating_setup import verify_held
from engine_check.pymunk_rotating_world import ForceLaw, Link, build_held
from engine_check.pymunk_settings import CAP_ELASTICITY, PymunkKnobs
from engine_check.solver import Order
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray, Trajectory

ITERATIONS: Final = 2
"""Sweeps of the impulse solver [1]: a slice hits a body that cannot move, so the first sweep is exact; the second is
for a slice so long that it touches both ends. More change the last digit at the most."""

OBEYED_KNOBS: Final = (
    "collision_bias",
    "collision_slop",
    "collision_persistence",
    "error_bias",
    "damping",
    "friction",
    "cap_thickness",
    "grid_offset",
)
"""Knobs that this world obeys, ``error_bias`` in welded ice; the others speak of joints and order in the free one."""

WATCH_STEPS: Final = 100
"""Most steps between two looks [1]."""

BANDS: Final[Mapping[str, watch.Band]] = MappingProxyType(
    {
        "off_axis": watch.Band(
            1e-9,
            "largest distance of a slice from its line along the tube / L",
            "no force acts across the tube and the caps are square to it up to round-off: 1e-15",
            "leave friction at 0",
        ),
        "penetration": watch.BANDS["penetration"],
    }
)
"""What must hold here. Angular momentum is no witness: omega is worked out from it."""


def run_rotating(scenario: Scenario, order: Order) -> Trajectory:
    """Throw the bottle in the frame that turns with it; the order as checked by ``engine_check.solve``.

    Returns
    -------
    Trajectory
        ``omega`` is J_0 omega_0 / J of the positions that the engine holds; ``theta`` its integral by the
        trapezoidal rule over the engine's steps.

    Raises
    ------
    ValueError
        If the slices are to exclude each other, hits are to be located, or a knob is set that nothing here obeys.
    SetupError
        If the engine did not receive what was meant.

    Accuracy
    --------
    Solves Eq. 8 as printed. Before the first impact order 2 in ``dt`` without drag, else order 1, because the drag
    takes velocities half a step old. From the first impact on order 1: an impact is seen at the next grid point, so
    that a slice sinks in by the share of v dt which the phase of the impact within the step leaves, and with e = 0
    stays there. The error of one run is therefore ragged, ``dt`` times what the phases happen to be; its mean over
    an ensemble of phases is smooth, and only that is worth extrapolating. Halving ``dt`` does not change all phases:
    a hit in the last step before an output time is answered there on every grid. ``grid_offset`` does.

    A slice at rest does not creep into its end, as it does in the free frame: there the turning of the tube, not a
    force, presses it on, and the contact answers that one step late; here a force does, and the
    contact cancels it within the step. Explicit drag needs alpha/m dt < 2. Output intervals that need unequal
    steps cost one order (``engine_pymunk``).
    """
    if order.slices != "overlap":
        raise ValueError(
            f"slices = {order.slices!r} is not offered in frame = 'rotating': the slices of Eq. 8 pass through each "
            "other; take slices = 'overlap' or frame = 'free'"
        )
    if order.hits == "located":
        raise ValueError("hits = 'located' is not offered in frame = 'rotating'; take hits = 'grid' or frame = 'free'")
    knobs = PymunkKnobs.from_overrides(order.knobs)
    for name, value in order.knobs.items():
        if name not in OBEYED_KNOBS:
            raise ValueError(
                f"{name} = {value!r} has no effect in frame = 'rotating'; leave it out, or take frame = 'free'"
            )
    iterations = ITERATIONS if order.iterations is None else order.iterations
    world = build_held(scenario, knobs, iterations, order.ice)
    flight = _Flight(scenario, world.space, Link(world), knobs.grid_offset)
    setup = verify_held(world, flight.law, scenario, knobs, iterations, order.ice)
    for when, count in order.legs():
        if count and not flight.advance(when, count):
            break
        flight.record()
    used = {name: value for name, value in knobs.to_mapping().items() if name in OBEYED_KNOBS}
    return flight.trajectory(
        settings={
            "engine": "pymunk",
            "pymunk_version": pymunk.version,
            "chipmunk_version": pymunk.chipmunk_version,
            "dt": order.dt,
            "iterations": iterations,
            "ice": order.ice if scenario.frozen else None,
            "frame": order.frame,
            "slices": order.slices,
            "hits": None if scenario.frozen else "grid",
            "points": len(order.times),
            **used,
            "cap_elasticity": CAP_ELASTICITY,
        },
        setup=setup,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """One output point; ``x``, ``v`` of shape (N,), ``centre`` x_CM, all from what the engine holds."""

    t: float
    theta: float
    omega: float
    x: FloatArray
    v: FloatArray
    centre: float
    inertia: float


class _Flight:
    """The bookkeeping of one run: the spin, what was recorded, the largest residuals, and the verdict."""

    def __init__(self, scenario: Scenario, space: pymunk.Space, link: Link, offset: float) -> None:
        self._scenario, self._space, self._link = scenario, space, link
        self._before = self._rows = link.read()
        self._lanes = self._rows[:, 1]
        self.t, self._theta = 0.0, scenario.theta0
        self._offset, self._lag = offset, 0.0
        self.law = ForceLaw.of(scenario, self._rows[:, 0])
        self._steps, self._sizes = 0, list[float]()
        self._worst = dict.fromkeys((*BANDS, "prediction_gap"), 0.0)
        self._points: list[_Point] = []
        self._cause = ""
        self._centre, self._omega = self.law.spin(self._rows[:, 0])
        self._push(self._rows[:, 0])

    def _push(self, x: FloatArray) -> None:
        link, v = self._link, self._rows[:, 2]
        link.push(self.law.forces(x, v, self._theta, self._centre, self._omega))

    def record(self) -> None:
        """Keep the present state as an output point; the grid point before it is ``lag`` earlier."""
        late = self._offset if self._sizes else 0.0
        x = self._rows[:, 0] + self._lag * self._rows[:, 2]
        v = (0.5 - late) * self._before[:, 2] + (0.5 + late) * self._rows[:, 2]
        centre, inertia = self.law.centre_and_inertia(x)
        omega = self.law.angular_momentum / inertia
        theta = self._theta + self._lag * (self._omega + omega) / 2
        self._points.append(_Point(self.t, theta, omega, x, v, centre, inertia))

    def advance(self, when: float, count: int) -> bool:
        """Take ``count`` equal steps to the output time ``when``; False if a band is left on the way."""
        start = self.t
        step = (when - start) / count
        # An exploding run may overflow; the watch reports it as not finite.
        with np.errstate(over="ignore", invalid="ignore"):
            if not self._sizes:
                # Slices start at rest: from the grid point, ``lag`` before release, they have hardly moved, and half a
                # step less that leaves them in place and their velocities in the middle of the first step.
                self._lag = self._offset * step
                self._theta -= self._lag * self._omega
                self._space.step(step / 2 - self._lag)
                self._rows = self._link.read()
            self._sizes.append(step)
            for taken in range(1, count + 1):
                predicted = self._one_step(step)
                if taken % WATCH_STEPS == 0 or taken == count:
                    self.t = when if taken == count else start + taken * step
                    self._cause = self._judge(predicted)
                    if self._cause:
                        return False
        return True

    def _one_step(self, step: float) -> FloatArray:
        x = self._rows[:, 0] + step * self._rows[:, 2]
        self._centre, omega = self.law.spin(x)
        self._theta += step * (self._omega + omega) / 2
        self._omega = omega
        self._push(x)
        self._space.step(step)
        self._before, self._rows = self._rows, self._link.read()
        self._steps += 1
        return x

    def _judge(self, predicted: FloatArray) -> str:
        if not np.isfinite(self._rows).all():
            return "the engine's numbers are no longer finite; reduce dt"
        length = self._scenario.bottle.length
        x, y = self._rows[:, 0], self._rows[:, 1]
        residuals = {
            "off_axis": float(np.abs(y - self._lanes).max()) / length,
            "penetration": max(0.0, float(np.abs(x).max()) - (self._scenario.r_max - length / 2)) / length,
            "prediction_gap": float(np.abs(x - predicted).max()) / length,
        }
        self._worst = {name: max(self._worst[name], value) for name, value in residuals.items()}
        return watch.first_left(residuals, BANDS)[1]

    def trajectory(self, *, settings: Mapping[str, Any], setup: Mapping[str, float]) -> Trajectory:
        """Return what was recorded up to the last good point."""
        scenario, points, half = self._scenario, self._points, self._scenario.bottle.length / 2
        shape = (len(points), scenario.n_slices)
        omega = np.array([point.omega for point in points])
        r = half + np.array([point.x for point in points]).reshape(shape)
        diagnostics: dict[str, Any] = {"steps": self._steps, **self._worst, "setup": dict(setup)}
        if scenario.frozen:
            diagnostics["ice_omega_drift"] = float(np.max(np.abs(omega / scenario.omega0 - 1.0), initial=0.0))
            diagnostics["ice_slice_drift"] = float(np.max(np.abs(r - scenario.initial_positions()), initial=0.0))
        return Trajectory(
            scenario=scenario,
            solver="engine_check",
            method="pymunk rotating",
            t=np.array([point.t for point in points]),
            theta=np.array([point.theta for point in points]),
            omega=omega,
            r=r,
            v=np.array([point.v for point in points]).reshape(shape),
            r_cm=half + np.array([point.centre for point in points]),
            inertia=np.array([point.inertia for point in points]),
            impacts=None,
            status="diverged" if self._cause else "ok",
            message=f"diverged at t = {self.t:.6g} s: {self._cause}" if self._cause else "",
            settings={
                **settings,
                "step": max(self._sizes, default=None),
                "step_least": min(self._sizes, default=None),
                "reads": self._link.how,
            },
            diagnostics=diagnostics,
        )
