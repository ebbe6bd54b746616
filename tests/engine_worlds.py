"""A throw in which no slip hides, faults of the worlds that pymunk flies, and the energy of what an engine flew."""

import pymunk

from slicemodel.scenario import Bottle, Scenario

THROW = Scenario(
    bottle=Bottle(length=0.25, radius=0.035, mass=0.03, capacity=0.8),
    water_mass=0.37,
    n_slices=7,
    drag=0.23,
    restitution=0.6,
    omega0=-13.0,
    theta0=0.7,
    duration=0.1,
    gravity=9.7,
    launch_velocity=(0.4, 1.7),
)
"""No field is zero and none equal to another."""


def space(world):
    return [world.space]


def caps(world):
    return list(world.tube.shapes)


def slice_shapes(world):
    return [shape for body in world.slices for shape in body.shapes]


def grooves(world):
    return [joint for joint in world.space.constraints if isinstance(joint, pymunk.GrooveJoint)]


def dampers(world):
    return [joint for joint in world.space.constraints if isinstance(joint, pymunk.DampedSpring)]


def with_all(parts, **values):
    """Return the fault that all these parts of a world have other values."""

    def fault(world):
        for part in parts(world):
            for name, value in values.items():
                setattr(part, name, value)

    return fault


def drag_against_the_lab(world):
    for damper in dampers(world):
        body, reach, drag = damper.b, damper.rest_length, damper.damping
        world.space.remove(damper)
        world.space.add(pymunk.DampedSpring(world.space.static_body, body, (0, reach), (0, 0), reach, 0.0, drag))


def caps_not_in_the_space(world):
    """They stay on the body, which is no place to look for what a slice can meet."""
    world.space.remove(*world.tube.shapes)


def energy(run):
    """Return it in the frame of the centre of mass [J]: rotation, slices along the axis, recoil of the tube."""
    scenario = run.scenario
    recoil = scenario.slice_mass * run.v.sum(axis=1) / scenario.total_mass
    axial = scenario.slice_mass * ((run.v - recoil[:, None]) ** 2).sum(axis=1) + scenario.bottle.mass * recoil**2
    return (run.inertia * run.omega**2 + axial) / 2
