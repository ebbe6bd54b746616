"""The bottle as pymunk bodies, in the lab frame, with the centre of mass at the origin at release.

    y                 cap  +-------+  local (0, +L/2)      The tube's body angle *is* theta: at angle 0
    ^                      |  o    |                       its local axis cap -> base is (0, -1), the
    |                      |  |    |  groove, no friction  bottle stands upright. theta grows counter-
    |  | g                 |  o    |  o slices (points:    clockwise; u_r = (sin theta, -cos theta).
    |  v                   |  o    |    moment infinite)   r = L/2 + (x_slice - x_tube) . u_r
    +-------> x      base  +-------+  local (0, -L/2)

A slice is a circle of radius h/2N, so that its centre stays in [h/2N, L - h/2N] (Eq. 3a). Slices share one
filter group and pass through each other; if they must not, each carries a second circle (``pymunk_rods``).
The drag alpha acts between slice and tube wall.
The origin at the centre of mass keeps coordinates near 1 m, so that gravity costs no digits of omega.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import pymunk
import pymunk.batch

from engine_check import pymunk_rods as rods
from engine_check import pymunk_settings as fixed
from engine_check.pymunk_settings import PymunkKnobs, insertion_order, restitution_between_slices
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray

SLICE_GROUP: Final = 1
STATE_COLUMNS: Final = 6


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """The bodies of one throw. ``axis_origin`` is the distance of the first body's centre from the cap [m]."""

    space: pymunk.Space
    tube: pymunk.Body
    slices: tuple[pymunk.Body, ...]
    axis_origin: float
    masses: FloatArray
    spin_moment: float


def build(scenario: Scenario, knobs: PymunkKnobs, iterations: int, ice: str, slices: str = "overlap") -> World:
    """Return the world at release, t = 0: rigid rotation with omega_0 about the centre of mass.

    Bodies enter the space in a fixed order (``PymunkKnobs.shuffle``), which makes a run reproducible to the last bit.

    Parameters
    ----------
    ice : str
        "rigid" or "welded"; used if ``scenario.frozen``.
    slices : str
        "overlap" or "exclude" (``engine_check.engines.CONTACTS``); used if not.
    """
    space = pymunk.Space()
    space.iterations = iterations
    space.gravity = (0.0, -scenario.gravity)
    space.damping = fixed.DAMPING
    space.collision_slop = fixed.COLLISION_SLOP
    space.collision_bias = fixed.COLLISION_BIAS
    space.collision_persistence = fixed.COLLISION_PERSISTENCE
    # A sleeping body would stop moving; infinity switches sleeping off.
    space.sleep_time_threshold = math.inf

    bottle = scenario.bottle
    positions = scenario.initial_positions()
    first_moment = bottle.mass * bottle.length / 2 + scenario.slice_mass * positions.sum()
    centre = float(first_moment / scenario.total_mass)
    tube_moment = bottle.mass * (bottle.radius * bottle.radius / 2 + bottle.length * bottle.length / 12)

    if scenario.frozen and ice == "rigid":
        about_centre = tube_moment + bottle.mass * (bottle.length / 2 - centre) ** 2
        about_centre += scenario.slice_mass * float(((positions - centre) ** 2).sum())
        block = pymunk.Body(scenario.total_mass, about_centre)
        _throw(block, scenario, 0.0)
        space.add(block)
        return World(space, block, (), centre, np.array([scenario.total_mass]), about_centre)

    tube = pymunk.Body(bottle.mass, tube_moment)
    _throw(tube, scenario, bottle.length / 2 - centre)
    tube.angular_velocity = scenario.omega0
    space.add(tube)
    if not scenario.frozen:
        space.add(*_caps(tube, scenario))
    between = restitution_between_slices(scenario, knobs, slices)
    bodies = {}
    for index in insertion_order(scenario.n_slices, knobs.shuffle):
        position = positions[index]
        body = pymunk.Body(scenario.slice_mass, math.inf)
        _throw(body, scenario, float(position) - centre)
        # A point slice carries no spin of its own.
        body.angle = body.angular_velocity = 0.0
        space.add(body)
        bodies[index] = body
        if scenario.frozen:
            space.add(_weld(tube, body, scenario, knobs, float(position)))
        else:
            space.add(*_slide(tube, body, scenario, knobs))
            if between is not None:
                space.add(rods.neighbour_shape(body, index, scenario.slice_height / 2, between))
    masses = np.array([bottle.mass, *[scenario.slice_mass] * len(bodies)])
    in_order = tuple(bodies[index] for index in range(scenario.n_slices))
    return World(space, tube, in_order, bottle.length / 2, masses, tube_moment)


def _throw(body: pymunk.Body, scenario: Scenario, offset: float) -> None:
    """Place ``body`` at ``offset`` from the centre of mass along the axis, in rigid rotation."""
    sine, cosine = math.sin(scenario.theta0), math.cos(scenario.theta0)
    body.position = (offset * sine, -offset * cosine)
    drift_x, drift_y = scenario.launch_velocity
    body.velocity = (drift_x + scenario.omega0 * offset * cosine, drift_y + scenario.omega0 * offset * sine)
    body.angle = scenario.theta0
    body.angular_velocity = scenario.omega0


def _caps(tube: pymunk.Body, scenario: Scenario) -> list[pymunk.Shape]:
    length, half_width = scenario.bottle.length, scenario.bottle.radius
    radius = fixed.CAP_THICKNESS * length / 2
    caps: list[pymunk.Shape] = []
    for side in (-1.0, 1.0):
        y = side * (length / 2 + radius)
        cap = pymunk.Segment(tube, (-half_width, y), (half_width, y), radius)
        cap.elasticity = fixed.CAP_ELASTICITY
        cap.friction = fixed.FRICTION
        rods.meets_walls_only(cap)
        caps.append(cap)
    return caps


def _slide(
    tube: pymunk.Body, body: pymunk.Body, scenario: Scenario, knobs: PymunkKnobs
) -> list[pymunk.Shape | pymunk.Constraint]:
    circle = pymunk.Circle(body, scenario.slice_height / 2)
    circle.elasticity = scenario.restitution
    circle.friction = fixed.FRICTION
    rods.meets_walls_only(circle, SLICE_GROUP)
    reach = fixed.GROOVE_REACH * scenario.bottle.length
    groove = pymunk.GrooveJoint(tube, body, (0.0, reach), (0.0, -reach), (0.0, 0.0))
    groove.error_bias = knobs.error_bias
    parts: list[pymunk.Shape | pymunk.Constraint] = [circle, groove]
    if scenario.drag > 0.0:
        anchor = (0.0, fixed.ANCHOR_DISTANCE * scenario.bottle.length)
        parts.append(pymunk.DampedSpring(tube, body, anchor, (0.0, 0.0), anchor[1], 0.0, scenario.drag))
    return parts


def _weld(
    tube: pymunk.Body, body: pymunk.Body, scenario: Scenario, knobs: PymunkKnobs, position: float
) -> pymunk.Constraint:
    # A pivot is the whole weld of a point mass: it has no orientation that a gear could hold.
    weld = pymunk.PivotJoint(tube, body, (0.0, scenario.bottle.length / 2 - position), (0.0, 0.0))
    weld.error_bias = knobs.error_bias
    return weld


def start_staggered(world: World, step: float, lag: float = 0.0) -> None:
    """Go to the first point of the grid, ``lag`` before release; velocities stand half a step after it.

    Chipmunk moves positions with the velocities left by the step before, then forms the forces at the new
    positions. Its velocities therefore belong half a step *ahead* of its positions (leapfrog), and a run
    that starts from v(0) is off by g dt/2 from the start. Going back by v dt/2 and letting the engine take
    a half step brings the positions home and leaves v(dt/2), with the engine's own forces. With a lag the positions
    end in x(0) - v(0) lag, the velocities in v(dt/2 - lag).
    """
    for body in (world.tube, *world.slices):
        x, y = body.position
        u, v = body.velocity
        body.position = (x - u * step / 2, y - v * step / 2)
        body.angle -= body.angular_velocity * step / 2
    world.space.step(step / 2 - lag)


class BatchReader:
    """Reads the tube and all slices, in this order; columns are x, y, angle, v_x, v_y, angular velocity.

    One call reads all bodies, in the order in which they were added. Where that is another order, as in a run whose
    slices are shuffled, or where the experimental ``pymunk.batch`` differs from single reads, each is read by itself.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self.how = "single"
        try:
            self._fields = (
                pymunk.batch.BodyFields.POSITION
                | pymunk.batch.BodyFields.ANGLE
                | pymunk.batch.BodyFields.VELOCITY
                | pymunk.batch.BodyFields.ANGULAR_VELOCITY
            )
            self._buffer = pymunk.batch.Buffer()
            agrees = np.array_equal(self._read_batch(), read_single(world))
        except (AttributeError, TypeError, ValueError):
            agrees = False
        if agrees:
            self.how = "batch"

    def _read_batch(self) -> FloatArray:
        self._buffer.clear()
        pymunk.batch.get_space_bodies(self._world.space, self._fields, self._buffer)
        rows = np.frombuffer(self._buffer.float_buf(), dtype=np.float64)
        # The buffer is overwritten by the next read.
        return rows.reshape(-1, STATE_COLUMNS).copy()

    def read(self) -> FloatArray:
        """Return the state of all bodies, shape (1 + N, 6)."""
        return self._read_batch() if self.how == "batch" else read_single(self._world)


def read_single(world: World) -> FloatArray:
    """Return the state of all bodies, shape (1 + N, 6), one property at a time."""
    return np.array(
        [(*body.position, body.angle, *body.velocity, body.angular_velocity) for body in (world.tube, *world.slices)],
        dtype=np.float64,
    )
