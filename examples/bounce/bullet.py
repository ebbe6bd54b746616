"""Bullet by pybullet, for ``flipproof bounce examples/bounce/bullet.py:default examples/bounce/bullet.py:tuned``."""

from importlib.metadata import version

import numpy as np
import pybullet as bullet

SIZE = 0.1
"""Radius of the ball [m]."""

bullet.connect(bullet.DIRECT)


class Engine:
    """A ball over a plane, without sleep, damping and friction; Bullet multiplies the two restitutions."""

    def __init__(self, world, body):
        self.world, self.body = world, body
        self.settings = {"version": version("pybullet"), **world, **body}

    def drop(self, height, speed, restitution, gravity, dt, duration):
        """Return t [s], y [m] and v [m/s] at every step."""
        bullet.resetSimulation()
        bullet.setPhysicsEngineParameter(fixedTimeStep=dt, **self.world)
        bullet.setGravity(0, 0, -gravity)
        floor = bullet.createMultiBody(0, bullet.createCollisionShape(bullet.GEOM_PLANE))
        sphere = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=SIZE)
        ball = bullet.createMultiBody(1.0, sphere, basePosition=[0, 0, height + SIZE])
        for number, e in ((floor, 1.0), (ball, restitution)):
            bullet.changeDynamics(number, -1, restitution=e, linearDamping=0, lateralFriction=0, **self.body)
        bullet.changeDynamics(ball, -1, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING)
        bullet.resetBaseVelocity(ball, [0, 0, speed])
        rows = [(height, speed)]
        for _ in range(round(duration / dt)):
            bullet.stepSimulation()
            place, velocity = bullet.getBasePositionAndOrientation(ball)[0], bullet.getBaseVelocity(ball)[0]
            rows.append((place[2] - SIZE, velocity[2]))
        return dt * np.arange(len(rows)), *np.array(rows).T


default = Engine({}, {})
tuned = Engine({"restitutionVelocityThreshold": 0.0, "numSolverIterations": 100}, {"contactProcessingThreshold": 0.0})
