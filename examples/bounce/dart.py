"""DART by dartpy, for ``flipproof bounce examples/bounce/dart.py:engine``."""

from types import SimpleNamespace

import dartpy
import numpy as np

SIZE = 0.1
"""Radius of the ball [m]."""


def body(skeleton, pair, shape, restitution):
    """Return joint and body of a new skeleton with one shape; DART multiplies the two restitutions."""
    joint, made = pair(skeleton)
    node = made.createShapeNode(shape)
    node.createCollisionAspect()
    node.createDynamicsAspect().setRestitutionCoeff(restitution)
    return joint, made


def drop(height, speed, restitution, gravity, dt, duration):
    """Return t [s], y [m] and v [m/s] at every step."""
    dynamics, world = dartpy.dynamics, dartpy.simulation.World()
    world.setGravity([0, 0, -gravity])
    world.setTimeStep(dt)
    floor, ball = dynamics.Skeleton("floor"), dynamics.Skeleton("ball")
    weld, _ = body(floor, dynamics.Skeleton.createWeldJointAndBodyNodePair, dynamics.BoxShape([10, 10, 1]), 1.0)
    place = dartpy.math.Isometry3()
    place.set_translation([0, 0, -0.5])
    weld.setTransformFromParentBodyNode(place)
    slide, mass = body(
        ball, dynamics.Skeleton.createPrismaticJointAndBodyNodePair, dynamics.SphereShape(SIZE), restitution
    )
    slide.setAxis([0, 0, 1])
    mass.setMass(1.0)
    world.addSkeleton(floor)
    world.addSkeleton(ball)
    ball.setPositions([height + SIZE])
    ball.setVelocities([speed])
    rows = [(height, speed)]
    for _ in range(round(duration / dt)):
        world.step()
        rows.append((ball.getPositions()[0] - SIZE, ball.getVelocities()[0]))
    return dt * np.arange(len(rows)), *np.array(rows).T


engine = SimpleNamespace(drop=drop, settings={"version": dartpy.__version__})
