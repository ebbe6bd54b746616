"""The physics engine Box2D as a solver for flipproof, in a package of its own.

    pip install .                  here; then, anywhere:
    flipproof certify box2d        100 units a metre
    flipproof certify box2d-si     1 unit a metre: impacts slower than 1 m/s do not rebound

A tube with a wall at each end flies freely; every slice is a small disc on a line of the tube (a wheel joint with next
to no spring), and does not turn, so that it has no inertia of its own. Slices meet the walls and not each other. Drag
acts along the tube, on the slice and back on the tube, as a force of each step.
"""

import math
from typing import ClassVar

import numpy as np
from Box2D import b2CircleShape, b2Filter, b2FixtureDef, b2MassData, b2PolygonShape, b2Vec2, b2World

SKIN = 0.01
"""Distance [units] by which Box2D lets a polygon keep others off."""

ITERATIONS = (60, 20)
"""Iterations of the velocities and of the positions: a tube lighter than its slices needs many."""


NO_SPRING = 1e-6
"""Frequency of the wheel joint's spring [Hz], too low to act. At 0, Box2D 2.3.10 reads memory that it never set."""


class Box2D:
    """Box2D at 100 units a metre."""

    name = "box2d"
    equation = "free-flight"
    refined_by = "dt"
    precision = "float32"
    order = 1
    scale = 100.0  # units a metre
    timeout = 300.0
    expected_failures: ClassVar = {
        "order-before-impacts": "the slice that rests on the base is pressed with 49 m/s^2 and gains 1 unit/s, Box2D's "
        "velocity threshold, in 0.2 ms: in longer steps it rebounds, in shorter ones it rests, and errors change by a "
        "factor of four in between; with e = 0, and on either side, the order is 1"
    }

    def solve(self, ask):
        """Answer at the times asked, with steps of at most ``ask.effort`` seconds."""
        throw = ask.scenario
        world, tube, slices = self.build(throw, ask.start)
        t, rows = 0.0, [self.read(throw, ask.start, tube, slices)]
        for when in ask.times[1:] if ask.times[0] == 0.0 else ask.times:
            steps = max(1, math.ceil((when - t) / ask.effort - 1e-9))
            for _ in range(steps):
                self.drag(throw, tube, slices)
                world.Step((when - t) / steps, *ITERATIONS)
                world.ClearForces()
            t = when
            rows.append(self.read(throw, ask.start, tube, slices))
        states = np.array(rows[-len(ask.times) :])
        n = throw.n_slices
        return {
            "t": ask.times, "theta": states[:, 0], "omega": states[:, 1], "r": states[:, 2 : n + 2],
            "v": states[:, n + 2 :],
        }  # fmt: skip

    def build(self, throw, start):
        """Return the world, the tube and the slices at release; frozen water is part of the tube."""
        bottle, s = throw.bottle, self.scale
        world = b2World(gravity=(0.0, -throw.gravity * s), doSleep=False)
        axis = np.array([math.cos(throw.theta0), math.sin(throw.theta0)])
        middle = bottle.length / 2
        centre = (throw.slice_mass * start.sum() + bottle.mass * middle) / throw.total_mass

        def velocity(r):  # of a point of a rigid body that turns about its centre of mass
            return s * (np.array(throw.launch_velocity) + throw.omega0 * (r - centre) * np.array([-axis[1], axis[0]]))

        def body(r, **more):
            return world.CreateDynamicBody(
                position=tuple(s * (r - middle) * axis), linearVelocity=tuple(velocity(r)), linearDamping=0.0,
                angularDamping=0.0, allowSleep=False, **more,
            )  # fmt: skip

        tube = body(middle, angle=throw.theta0, angularVelocity=throw.omega0)
        radius, thick = 0.02 * s, 0.05 * s
        for wall in (throw.r_min - middle, throw.r_max - middle):
            side = math.copysign(1.0, wall)
            shape = b2PolygonShape(
                box=(thick, 4 * thick, b2Vec2(side * (s * abs(wall) + radius + SKIN + thick), 0.0), 0.0)
            )
            tube.CreateFixture(b2FixtureDef(shape=shape, density=0.0, friction=0.0, restitution=0.0))
        own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12)
        if throw.frozen:
            about = own + bottle.mass * (middle - centre) ** 2 + throw.slice_mass * ((start - centre) ** 2).sum()
            tube.massData = b2MassData(
                mass=throw.total_mass, center=(s * (centre - middle), 0.0),
                I=s**2 * (about + throw.total_mass * (centre - middle) ** 2),
            )  # fmt: skip
            tube.linearVelocity = tuple(velocity(centre))
            return world, tube, []
        tube.massData = b2MassData(mass=bottle.mass, center=(0.0, 0.0), I=s**2 * own)
        slices = []
        for r in start:
            disc = body(r, fixedRotation=True)
            disc.CreateFixture(
                b2FixtureDef(
                    shape=b2CircleShape(radius=radius), density=1.0, friction=0.0, restitution=throw.restitution,
                    filter=b2Filter(groupIndex=-1),
                )
            )  # fmt: skip
            disc.massData = b2MassData(mass=throw.slice_mass, center=(0.0, 0.0), I=0.0)
            disc.fixedRotation = True
            world.CreateWheelJoint(
                bodyA=tube, bodyB=disc, anchor=disc.position, axis=tuple(axis), frequencyHz=NO_SPRING, dampingRatio=0.0,
                collideConnected=True,
            )  # fmt: skip
            slices.append(disc)
        return world, tube, slices

    def drag(self, throw, tube, slices):
        """Apply the drag of every slice against the tube, and its reaction."""
        if not throw.drag:
            return
        c, s = math.cos(tube.angle), math.sin(tube.angle)
        vx, vy = tube.linearVelocity
        total = 0.0
        for disc in slices:
            wx, wy = disc.linearVelocity
            force = -throw.drag * (c * (wx - vx) + s * (wy - vy))
            disc.ApplyForceToCenter((force * c, force * s), True)
            total += force
        tube.ApplyForceToCenter((-total * c, -total * s), True)

    def read(self, throw, start, tube, slices):
        """Return theta, omega, r and v."""
        n = throw.n_slices
        if not slices:
            return [tube.angle, tube.angularVelocity, *start, *[0.0] * n]
        c, s = math.cos(tube.angle), math.sin(tube.angle)
        (x, y), (vx, vy) = tube.position, tube.linearVelocity
        r = [throw.bottle.length / 2 + (c * (d.position[0] - x) + s * (d.position[1] - y)) / self.scale for d in slices]
        v = [(c * (d.linearVelocity[0] - vx) + s * (d.linearVelocity[1] - vy)) / self.scale for d in slices]
        return [tube.angle, tube.angularVelocity, *r, *v]


class Box2DSI(Box2D):
    """Box2D at 1 unit a metre, as its manual would have it; its velocity threshold is then 1 m/s."""

    name = "box2d-si"
    scale = 1.0
    expected_failures: ClassVar = {
        "restitution": "impacts slower than 1 unit/s do not rebound in Box2D",
        "equation": "free flight in which slow impacts do not rebound is no equation of the ladder",
    }
