r"""The landing in pymunk: a box on a thick segment, masses in grooves inside it, the engine's own contacts.

     cap wall  #########       slice i carries two circles: one meets the base wall only, one the cap wall only.
               |  (i)  |       "staggered": their radii are the slice's distances from its two stops, so that one
               |       |       pair of walls makes two stops of its own for every slice.
     base wall #########       "exclude": both radii are h/2N, and a third circle meets the neighbours.
    ===== table: a segment 1 m thick =====

Elasticities multiply, so that walls and table carry 1, slices e and the bottle e_table; friction likewise. A body's
angle is theta: its local axis from cap to base is (0, -1).

Contact needs depth: two shapes that touch to round-off may or may not count. Slices that rest in the touch are put
``DEPTH`` into what they rest on, less than the slop that is never pushed back; by it they are in contact at the first
step, so that bottle and water strike together. The gap is read back.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import nullcontext
from typing import Final

import numpy as np
import pymunk

from engine_check import pymunk_rods as rods
from engine_check.landing import immovable, refuse_misplaced, stops
from engine_check.readback import differences, matched
from slicemodel.table import Table, Touch

DEPTH: Final = 1e-7
"""Depth by which resting slices are put into what they rest on [m]."""

RESTING: Final = 1e-9
"""Gap up to which a slice of a touch rests [L]."""

SLOP: Final = 1e-6
"""Penetration that is left alone [m]."""

TABLE, BOX, BASE_WALL, CAP_WALL, TO_BASE, TO_CAP = (1 << k for k in range(8, 14))
"""Categories of shapes, beside those of ``pymunk_rods``."""

GROOVE_REACH: Final = 2.0
ANCHOR: Final = 10.0
WALL: Final = 0.5
"""Reach of grooves, anchor of dampers and thickness of walls [L]; reasons as in ``pymunk_settings.PymunkKnobs``."""

LARGEST_DRIFT: Final = 1e-2
"""Distance of a slice from the axis [L] beyond which the world is given up."""


def enough_iterations(n_slices: int, mass_ratio: float, slices: str) -> int:
    """Return the iterations of the engine's solver in which an impact on the table is found.

    An impact has no impulses of the step before to start from. Where slices meet each other it has to pass up a stack
    of them, of which the light bottle is one end: at N = 6, M_w / M_b = 21 and a corner hit of 3.3 m/s, omega after it
    is -3.218 rad/s with 100 iterations and -3.0941 with 1000, and with the impulses in closed form.
    """
    if slices == "exclude":
        return max(200, math.ceil(8 * n_slices * mass_ratio))
    return max(120, math.ceil(mass_ratio * math.sqrt(n_slices)))


quiet: Final = nullcontext
"""pymunk writes no file."""


def build(touch: Touch, table: Table, dt: float, law: str | None, slices: str) -> World:
    """Return the world at the touch, read back."""
    del law  # the engine has one
    return World(touch, table, dt, slices)


class World:
    """One bottle over a table, and what ``landing.landed`` asks of it."""

    ledger = None

    def __init__(self, touch: Touch, table: Table, dt: float, slices: str) -> None:
        scenario = touch.scenario
        self.touch, self.dt, self.scenario = touch, dt, scenario
        self.rigid = immovable(scenario)
        if not self.rigid:
            refuse_misplaced(touch, slices)
        self.sine, self.cosine = math.sin(touch.theta), math.cos(touch.theta)
        self.space = pymunk.Space()
        self.space.gravity = (0.0, -scenario.gravity)
        self.space.iterations = enough_iterations(scenario.n_slices, scenario.water_mass / scenario.bottle.mass, slices)
        self.space.collision_slop, self.space.collision_bias, self.space.collision_persistence = SLOP, 1.0, 1
        self.space.damping = 1.0
        self.bodies: list[pymunk.Body] = []
        self.tube = self._tube(table)
        if not self.rigid:
            self._slices(slices)
        self.settings: Mapping[str, object] = {"iterations": self.space.iterations, "pymunk_version": pymunk.version}
        self.setup = self._read_back(table)

    # ------------------------------------------------------------------ building

    def _place(self, r: float) -> tuple[float, float]:
        """Return the place of a point on the axis, ``r`` from the cap, at the touch [m]."""
        bottle = self.scenario.bottle
        height = bottle.length / 2 * abs(self.cosine) + bottle.radius * abs(self.sine)
        along = r - bottle.length / 2
        return along * self.sine, height - along * self.cosine

    def _velocity(self, r: float, v: float) -> tuple[float, float]:
        """Return the velocity of a point on the axis that slides in the bottle with ``v`` [m/s]."""
        vx, vy = self.touch.velocity
        swing = (r - self.scenario.bottle.length / 2) * self.touch.omega
        return vx + v * self.sine + swing * self.cosine, vy - v * self.cosine + swing * self.sine

    def _tube(self, table: Table) -> pymunk.Body:
        scenario, bottle = self.scenario, self.scenario.bottle
        half = bottle.length / 2
        own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        mass, moment, centre = bottle.mass, own, half
        if self.rigid:
            r, m = self.touch.r, scenario.slice_mass
            mass = scenario.total_mass
            centre = (bottle.mass * half + m * float(r.sum())) / mass
            moment = own + bottle.mass * (half - centre) ** 2 + m * float(((r - centre) ** 2).sum())
        tube = pymunk.Body(mass, moment)
        tube.center_of_gravity = (0.0, half - centre)
        # The angle first: the engine turns the centre of gravity about the place that it holds at the time.
        tube.angle = self.touch.theta
        tube.position = self._place(half)
        tube.velocity, tube.angular_velocity = self._velocity(centre, 0.0), self.touch.omega
        radius = bottle.radius
        box = pymunk.Poly(tube, [(-radius, -half), (radius, -half), (radius, half), (-radius, half)])
        box.elasticity, box.friction = table.restitution, table.friction
        box.filter = pymunk.ShapeFilter(categories=BOX, mask=TABLE)
        top = pymunk.Segment(self.space.static_body, (-100.0, -0.5), (100.0, -0.5), 0.5)
        top.elasticity = top.friction = 1.0
        top.filter = pymunk.ShapeFilter(categories=TABLE, mask=BOX)
        self.space.add(tube, box, top)
        self.box = box
        return tube

    def _slices(self, slices: str) -> None:
        scenario, length, rod = self.scenario, self.scenario.bottle.length, self.scenario.slice_height
        half, thick = length / 2, WALL * length
        for side, own, other in ((-1, BASE_WALL, TO_BASE), (1, CAP_WALL, TO_CAP)):
            y = side * (half + thick / 2)
            wall = pymunk.Segment(self.tube, (-length, y), (length, y), thick / 2)
            wall.elasticity, wall.friction = 1.0, 0.0
            wall.filter = pymunk.ShapeFilter(categories=own, mask=other)
            self.space.add(wall)
        low, high = stops(scenario)
        for i, (r, v) in enumerate(zip(self._pressed(slices, low, high), self.touch.v.tolist(), strict=True)):
            body = pymunk.Body(scenario.slice_mass, math.inf)
            body.position, body.velocity = self._place(r), self._velocity(r, v)
            self.space.add(body)
            exclude = slices == "exclude"
            for radius, own, other in (
                (rod / 2 if exclude else length - high[i], TO_BASE, BASE_WALL),
                (rod / 2 if exclude else low[i], TO_CAP, CAP_WALL),
            ):
                circle = pymunk.Circle(body, radius)
                circle.elasticity, circle.friction = scenario.restitution, 0.0
                circle.filter = pymunk.ShapeFilter(categories=own, mask=other)
                self.space.add(circle)
            if exclude:
                self.space.add(rods.neighbour_shape(body, i, rod / 2, scenario.restitution, 0.0))
            reach = GROOVE_REACH * length
            groove = pymunk.GrooveJoint(self.tube, body, (0.0, reach), (0.0, -reach), (0.0, 0.0))
            groove.error_bias = 0.0
            self.space.add(groove)
            if scenario.drag > 0.0:
                anchor = (0.0, ANCHOR * length)
                self.space.add(pymunk.DampedSpring(self.tube, body, anchor, (0.0, 0.0), 0.0, 0.0, scenario.drag))
            self.bodies.append(body)

    def _pressed(self, slices: str, low: list[float], high: list[float]) -> list[float]:
        """Return the places of all slices, those at rest ``DEPTH`` deep in what they rest on."""
        near, rod = RESTING * self.scenario.bottle.length, self.scenario.slice_height
        r = self.touch.r.tolist()
        placed = list(r)
        if slices == "staggered":
            for i, place in enumerate(r):
                if high[i] - place <= near:
                    placed[i] = high[i] + DEPTH
                elif place - low[i] <= near:
                    placed[i] = low[i] - DEPTH
            return placed
        wall, n = self.scenario.bottle.length - rod / 2, len(r)
        for i in range(n):
            floor = wall if i == 0 else r[i - 1] - rod
            if floor - r[i] <= near:
                placed[i] = (wall if i == 0 else placed[i - 1] - rod) + DEPTH
        if r[-1] - rod / 2 <= near:
            placed[-1] = rod / 2 - DEPTH
        return placed

    def _read_back(self, table: Table) -> dict[str, float]:
        """Return what the world holds, or raise SetupError where it is not what was meant."""
        scenario, touch = self.scenario, self.touch
        theta = self.pose()[2]
        meant = {
            "total_mass": scenario.total_mass,
            "angle": touch.theta,
            "angular_velocity": touch.omega,
            "velocity_x": touch.velocity[0],
            "velocity_y": touch.velocity[1],
            "restitution": table.restitution,
            "friction": table.friction,
            "gravity": scenario.gravity,
            "lowest_corner": 0.0,
            "energy": self._meant_energy(),
        }
        middle = self.tube.velocity_at_local_point((0.0, 0.0))
        top = next(shape for shape in self.space.static_body.shapes)
        corners = [self.tube.local_to_world(corner)[1] for corner in self.box.get_vertices()]
        held = {
            "total_mass": self.tube.mass + sum(body.mass for body in self.bodies),
            "angle": theta,
            "angular_velocity": self.tube.angular_velocity,
            "velocity_x": middle[0],
            "velocity_y": middle[1],
            "restitution": self.box.elasticity * top.elasticity,
            "friction": self.box.friction * top.friction,
            "gravity": -self.space.gravity[1],
            "lowest_corner": min(corners),
            "energy": self.energy(at_start=True),
        }
        scales = {"lowest_corner": 1.0, "angular_velocity": 1.0, "velocity_x": 1.0, "velocity_y": 1.0, "angle": 1.0}
        # Slices put into contact by DEPTH have that much more or less potential energy.
        scales["energy"] = 1e12 * 2 * DEPTH * scenario.n_slices * scenario.total_mass * (scenario.gravity + 1e3)
        return matched(held, meant, differences(meant, held, scales))

    def _meant_energy(self) -> float:
        scenario, bottle = self.scenario, self.scenario.bottle
        parts = [(scenario.slice_mass, r, v) for r, v in zip(self.touch.r.tolist(), self.touch.v.tolist(), strict=True)]
        parts.append((bottle.mass, bottle.length / 2, 0.0))
        total = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12) * self.touch.omega**2 / 2
        for mass, r, v in parts:
            vx, vy = self._velocity(r, v)
            total += mass * ((vx * vx + vy * vy) / 2 + scenario.gravity * self._place(r)[1])
        return total

    # ------------------------------------------------------------------ running

    def advance(self) -> str:
        """Make one step; return what left its band, or an empty string."""
        self.space.step(self.dt)
        return ""

    def pose(self) -> tuple[float, float, float]:
        """Return x, y of the middle of the tube [m] and theta [rad]."""
        x, y = self.tube.position
        return x, y, self.tube.angle

    def energy(self, at_start: bool = False) -> float:
        """Return the energy over the table [J]; NaN if a slice left the axis.

        The engine's velocities stand half a step ahead of its places: half a step of gravity is taken off.
        """
        g, back = self.scenario.gravity, 0.0 if at_start else self.scenario.gravity * self.dt / 2
        tube = self.tube
        centre, velocity = tube.local_to_world(tube.center_of_gravity), tube.velocity
        total = tube.mass * ((velocity[0] ** 2 + (velocity[1] + back) ** 2) / 2 + g * centre[1])
        total += tube.moment * tube.angular_velocity**2 / 2
        x, y = tube.position
        sine, cosine = math.sin(tube.angle), math.cos(tube.angle)
        for body in self.bodies:
            place, speed = body.position, body.velocity
            if abs((place[0] - x) * cosine + (place[1] - y) * sine) > LARGEST_DRIFT * self.scenario.bottle.length:
                return math.nan
            total += body.mass * ((speed[0] ** 2 + (speed[1] + back) ** 2) / 2 + g * place[1])
        return float(np.float64(total))
