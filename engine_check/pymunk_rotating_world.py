"""Eq. 8's own world as pymunk bodies: the tube is held, the slices slide on a line, fictitious forces act on them.

        cap                  tube's centre    C_M                base
         |----o---------o---------+------------*------o--o---o----|     --> x, along u_r, from cap to base
       -L/2                     x = 0         x_CM               L/2        r = L/2 + x

theta is the angle of u_r from the downward vertical, counter-clockwise positive, and omega = theta'; forces and
velocities are positive toward the base. A slice is a circle of radius h/2N that touches nothing but the two end caps,
which are part of a static body. Nothing acts across the line, so that slices need no joint to stay on it, and each
has a line of its own, 2 h/N from the next: slices that would overlap stand side by side. The engine lists every pair of
shapes that overlap, even those that are to pass through each other: 500 slices on one line, most of them at rest on
an end, cost it 36 ms a step, and less than 0.1 ms in lanes.

The force. In the frame that turns with the tube about C_M, a slice at s = r - r_CM = x - x_CM feels

    the centrifugal force   -m omega x (omega x s u_r) = +m omega^2 s u_r       along the tube
    the Coriolis force      -2 m omega x r' u_r                                 across it: normal, and friction is 0
    the Euler force         -m omega' x s u_r                                   across it
    its weight              m (0, -g) . (sin theta, -cos theta) = +m g cos theta
    the drag of Eq. 8       -alpha (r' - r'_CM): against C_M, not against the wall

and Eq. 8 sets their sum equal to m r''. It has no more: neither the acceleration of its origin C_M in the tube nor the
recoil of the tube, which is held here. With x = r - L/2 the tube's centre is at the origin, so that
M x_CM = m sum x and M r'_CM = m sum x', and by Steiner's theorem, from the origin to C_M,

    J = I_tube + m sum x^2 - (m sum x)^2 / M,      I_tube = M_b (R^2/2 + L^2/12),      omega = J_0 omega_0 / J

(the angular momentum about C_M holds while the tube turns freely). Nothing else turns the bottle: its spin is
kinematic, worked out from where the engine holds the slices. Masses, motion and rebounds are the engine's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pymunk
import pymunk.batch

from engine_check.pymunk_settings import CAP_ELASTICITY, PymunkKnobs
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray

STATE_COLUMNS: Final = 4
LANE_PITCH: Final = 2.0
"""Distance of two lanes [h/N], the diameter of a slice: the engine adds a fifth of it to the boxes it compares."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldWorld:
    """The static tube and the slices; bodies enter the space in the order slices, tube."""

    space: pymunk.Space
    tube: pymunk.Body
    slices: tuple[pymunk.Body, ...]


def build_held(scenario: Scenario, knobs: PymunkKnobs, iterations: int, ice: str) -> HeldWorld:
    """Return the world at release, t = 0: all slices at rest in the tube.

    Parameters
    ----------
    ice : str
        Used if ``scenario.frozen``. "rigid": the slices are static, like the tube; "welded": each is pinned to it.
    """
    space = pymunk.Space()
    space.iterations = iterations
    # The weight turns with the tube: it comes with the other forces.
    space.gravity = (0.0, 0.0)
    space.damping = knobs.damping
    space.collision_slop = knobs.collision_slop
    space.collision_bias = knobs.collision_bias
    space.collision_persistence = knobs.collision_persistence
    # A sleeping body would stop moving; infinity switches sleeping off.
    space.sleep_time_threshold = math.inf

    tube = pymunk.Body(body_type=pymunk.Body.STATIC)
    slices = []
    for position, lane in zip(scenario.initial_positions().tolist(), lanes(scenario).tolist(), strict=True):
        if scenario.frozen and ice == "rigid":
            body = pymunk.Body(body_type=pymunk.Body.STATIC)
        else:
            body = pymunk.Body(scenario.slice_mass, math.inf)
        body.position = (position - scenario.bottle.length / 2, lane)
        space.add(body)
        slices.append(body)
    space.add(tube)
    if not scenario.frozen:
        space.add(*_caps(tube, scenario, knobs))
        space.add(*(_circle(body, scenario, knobs) for body in slices))
    elif ice == "welded":
        space.add(*(_pin(tube, body, knobs) for body in slices))
    return HeldWorld(space, tube, tuple(slices))


def lanes(scenario: Scenario) -> FloatArray:
    """Return the place of every slice across the tube, shape (N,) [m]."""
    n = scenario.n_slices
    return np.asarray((np.arange(n) - (n - 1) / 2) * LANE_PITCH * scenario.slice_height)


def _caps(tube: pymunk.Body, scenario: Scenario, knobs: PymunkKnobs) -> list[pymunk.Shape]:
    half = scenario.bottle.length / 2
    radius = knobs.cap_thickness * half
    half_width = scenario.n_slices * LANE_PITCH * scenario.slice_height / 2
    caps: list[pymunk.Shape] = []
    for side in (-1.0, 1.0):
        x = side * (half + radius)
        cap = pymunk.Segment(tube, (x, -half_width), (x, half_width), radius)
        cap.elasticity = CAP_ELASTICITY
        cap.friction = knobs.friction
        caps.append(cap)
    return caps


def _circle(body: pymunk.Body, scenario: Scenario, knobs: PymunkKnobs) -> pymunk.Shape:
    circle = pymunk.Circle(body, scenario.slice_height / 2)
    circle.elasticity = scenario.restitution
    circle.friction = knobs.friction
    return circle


def _pin(tube: pymunk.Body, body: pymunk.Body, knobs: PymunkKnobs) -> pymunk.Constraint:
    pin = pymunk.PivotJoint(tube, body, (body.position.x, body.position.y), (0.0, 0.0))
    pin.error_bias = knobs.error_bias
    return pin


@dataclass(frozen=True, slots=True)
class ForceLaw:
    """Eq. 8 and the spin of the bottle, as derived above; ``x``, ``v`` of shape (N,) [m], [m/s] throughout.

    Parameters
    ----------
    slice_mass, total_mass : float [kg]
    tube_moment : float - I_tube, of the empty bottle about its own centre [kg m^2]
    angular_momentum : float - J_0 omega_0 [kg m^2/s]
    weight : float - m g, of one slice [N]
    drag : float - alpha [kg/s]
    """

    slice_mass: float
    total_mass: float
    tube_moment: float
    angular_momentum: float
    weight: float
    drag: float

    @classmethod
    def of(cls, scenario: Scenario, released_at: FloatArray) -> ForceLaw:
        """Return the law of a bottle that turns with omega_0 while its slices are at ``released_at``, (N,) [m]."""
        bottle = scenario.bottle
        at_rest = cls(
            slice_mass=scenario.slice_mass,
            total_mass=scenario.total_mass,
            tube_moment=bottle.mass * (bottle.radius * bottle.radius / 2 + bottle.length * bottle.length / 12),
            angular_momentum=0.0,
            weight=scenario.slice_mass * scenario.gravity,
            drag=scenario.drag,
        )
        # The angular momentum needs J_0, which the other constants define.
        _, inertia = at_rest.centre_and_inertia(released_at)
        return replace(at_rest, angular_momentum=inertia * scenario.omega0)

    def centre_and_inertia(self, x: FloatArray) -> tuple[float, float]:
        """Return x_CM from the tube's centre [m] and J about C_M [kg m^2]."""
        first = self.slice_mass * float(x.sum())
        inertia = self.tube_moment + self.slice_mass * float(x.dot(x)) - first * first / self.total_mass
        return first / self.total_mass, inertia

    def spin(self, x: FloatArray) -> tuple[float, float]:
        """Return x_CM [m] and omega = J_0 omega_0 / J [rad/s]."""
        centre, inertia = self.centre_and_inertia(x)
        return centre, self.angular_momentum / inertia

    def forces(self, x: FloatArray, v: FloatArray, theta: float, centre: float, omega: float) -> FloatArray:
        """Return the force on every slice along the tube, shape (N,) [N]; ``centre`` is x_CM [m].

        F_i = m omega^2 (x_i - x_CM) + m g cos(theta) - alpha (x_i' - x'_CM)            (Eq. 8)
        """
        pull = self.slice_mass * omega * omega
        drift = self.slice_mass * float(v.sum()) / self.total_mass
        # What all slices share is one number, so that only two terms are arrays.
        shared = self.weight * math.cos(theta) - pull * centre + self.drag * drift
        return pull * x - self.drag * v + shared


class Link:
    """Passes forces to all slices and reads their states in one call each, 2 us for 50 slices against 36 us.

    ``pymunk.batch`` is experimental: what it writes and reads is first compared with one slice at a time, and if it
    fails, ``how`` is "single". Rows are slices in order of insertion, columns x, y, v_x, v_y.
    """

    def __init__(self, world: HeldWorld) -> None:
        self._world = world
        # One row more than slices: the tube is a body of the space as well.
        self._forces = np.zeros((len(world.slices) + 1, 2))
        self.how = "batch" if self._batch_works() else "single"
        self.push(np.zeros(len(world.slices)))

    def _batch_works(self) -> bool:
        try:
            fields = pymunk.batch.BodyFields
            self._read_fields, self._force_field = fields.POSITION | fields.VELOCITY, fields.FORCE
            self._inbox, self._outbox = pymunk.batch.Buffer(), pymunk.batch.Buffer()
            self._outbox.set_float_buf(self._forces.reshape(-1))
            trial = np.arange(1.0, len(self._forces))
            self._push_batch(trial)
            return np.array_equal(self._read_batch(), self._read_single()) and forces_held(self._world.slices) == [
                (force, 0.0) for force in trial.tolist()
            ]
        except (AttributeError, TypeError, ValueError):
            return False

    def _push_batch(self, forces: FloatArray) -> None:
        self._forces[:-1, 0] = forces
        pymunk.batch.set_space_bodies(self._world.space, self._force_field, self._outbox)

    def _read_batch(self) -> FloatArray:
        self._inbox.clear()
        pymunk.batch.get_space_bodies(self._world.space, self._read_fields, self._inbox)
        rows = np.frombuffer(self._inbox.float_buf(), dtype=np.float64)
        # The buffer is overwritten by the next read; the last row is the tube's.
        return rows.reshape(-1, STATE_COLUMNS)[:-1].copy()

    def _read_single(self) -> FloatArray:
        return np.array([(*body.position, *body.velocity) for body in self._world.slices], dtype=np.float64)

    def push(self, forces: FloatArray) -> None:
        """Let these forces along the tube, shape (N,) [N], act in the next step; the engine clears them after it."""
        if self.how == "batch":
            self._push_batch(forces)
            return
        for body, force in zip(self._world.slices, forces.tolist(), strict=True):
            body.force = (force, 0.0)

    def read(self) -> FloatArray:
        """Return the state of all slices, shape (N, 4)."""
        return self._read_batch() if self.how == "batch" else self._read_single()


def forces_held(slices: Sequence[pymunk.Body]) -> list[tuple[float, float]]:
    """Return the forces that wait to act on the slices, one slice at a time [N]."""
    return [(body.force.x, body.force.y) for body in slices]
