"""What the pymunk world was meant to hold, what it holds, and the comparison before the first step.

``intended`` works from the scenario alone and ``read_back`` from the built objects alone, so that a slip in
``pymunk_world`` cannot hide in both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product

import numpy as np
import pymunk

from engine_check import pymunk_rods as rods
from engine_check import pymunk_settings as fixed
from engine_check.pymunk_settings import PymunkKnobs, restitution_between_slices
from engine_check.pymunk_world import World
from engine_check.readback import both, differences, extremes, matched
from slicemodel import observables
from slicemodel.scenario import Scenario


def intended(
    scenario: Scenario, knobs: PymunkKnobs, iterations: int, ice: str, slices: str = "overlap"
) -> dict[str, float]:
    """Return what the world must hold, from the scenario alone, SI units.

    A pair ``name.least`` and ``name.most`` bounds a value over all slices.
    """
    bottle = scenario.bottle
    inertia = observables.initial_moment_of_inertia(scenario)
    one_body = scenario.frozen and ice == "rigid"
    tube_moment = bottle.mass * (bottle.radius * bottle.radius / 2 + bottle.length * bottle.length / 12)
    meant = {
        "iterations": float(iterations),
        "gravity_x": 0.0,
        "gravity_y": -scenario.gravity,
        "damping": fixed.DAMPING,
        "collision_slop": fixed.COLLISION_SLOP,
        "collision_bias": fixed.COLLISION_BIAS,
        "collision_persistence": float(fixed.COLLISION_PERSISTENCE),
        "sleep_time_threshold": math.inf,
        "bodies": 1.0 if one_body else 1.0 + scenario.n_slices,
        "total_mass": scenario.total_mass,
        "tube_mass": scenario.total_mass if one_body else bottle.mass,
        "tube_moment": inertia if one_body else tube_moment,
        "angle": scenario.theta0,
        "angular_velocity": scenario.omega0,
        "velocity_x": scenario.launch_velocity[0],
        "velocity_y": scenario.launch_velocity[1],
        "centre_x": 0.0,
        "centre_y": 0.0,
        "inertia": inertia,
        "angular_momentum": inertia * scenario.omega0,
    }
    if one_body:
        return meant
    meant |= both("slice_mass", scenario.slice_mass) | both("slice_moment", math.inf)
    meant |= {"joint_error_bias.most": knobs.error_bias, "joint_force_limit.least": math.inf}
    if scenario.frozen:
        return meant | {"welds": float(scenario.n_slices)}
    drag_count = float(scenario.n_slices if scenario.drag > 0.0 else 0)
    meant |= {"grooves": float(scenario.n_slices), "dampers": drag_count}
    between = restitution_between_slices(scenario, knobs, slices)
    meant |= {
        "slices_that_collide": 0.0,
        "caps_passed_through": 0.0,
        "caps": 2.0,
        "wall_shapes": float(scenario.n_slices),
    }
    if between is not None:
        meant |= rods.intended(scenario, between)
    meant |= both("elasticity_product", scenario.restitution)
    meant |= both("friction_product", fixed.FRICTION**2)
    meant |= both("groove_top", fixed.GROOVE_REACH * bottle.length)
    meant |= both("groove_bottom", -fixed.GROOVE_REACH * bottle.length)
    meant |= both("groove_off_axis", 0.0)
    meant |= both("contact_at_cap", scenario.r_min) | both("contact_at_base", scenario.r_max)
    meant |= both("cap_thickness", fixed.CAP_THICKNESS * bottle.length)
    if drag_count:
        meant |= both("drag", scenario.drag) | both("drag_stiffness", 0.0)
        meant |= both("drag_anchor", fixed.ANCHOR_DISTANCE * bottle.length) | both("drag_off_axis", 0.0)
    return meant


def read_back(world: World) -> dict[str, float]:
    """Return what the engine's objects hold, under the names of ``intended``."""
    space, tube = world.space, world.tube
    bodies = [body for body in space.bodies if body.body_type == pymunk.Body.DYNAMIC]
    mass = np.array([body.mass for body in bodies])
    x = np.array([tuple(body.position) for body in bodies])
    v = np.array([tuple(body.velocity) for body in bodies])
    spin = [(body.moment, body.angular_velocity) for body in bodies if math.isfinite(body.moment)]
    centre, drift = mass @ x / mass.sum(), mass @ v / mass.sum()
    dx, dv = x - centre, v - drift
    held = {
        "iterations": float(space.iterations),
        "gravity_x": space.gravity.x,
        "gravity_y": space.gravity.y,
        "damping": space.damping,
        "collision_slop": space.collision_slop,
        "collision_bias": space.collision_bias,
        "collision_persistence": float(space.collision_persistence),
        "sleep_time_threshold": space.sleep_time_threshold,
        "bodies": float(len(bodies)),
        "total_mass": float(mass.sum()),
        "tube_mass": tube.mass,
        "tube_moment": tube.moment,
        "angle": tube.angle,
        "angular_velocity": tube.angular_velocity,
        "velocity_x": float(drift[0]),
        "velocity_y": float(drift[1]),
        "centre_x": float(centre[0]),
        "centre_y": float(centre[1]),
        "inertia": float((mass * (dx**2).sum(axis=1)).sum() + sum(moment for moment, _ in spin)),
        "angular_momentum": float(
            (mass * (dx[:, 0] * dv[:, 1] - dx[:, 1] * dv[:, 0])).sum() + sum(moment * rate for moment, rate in spin)
        ),
    }
    if world.slices:
        held |= extremes("slice_mass", (body.mass for body in world.slices))
        held |= extremes("slice_moment", (body.moment for body in world.slices))
        held |= _read_joints(world)
        held |= _read_shapes(world)
    return held


def _read_joints(world: World) -> dict[str, float]:
    constraints = list(world.space.constraints)
    grooves = [c for c in constraints if isinstance(c, pymunk.GrooveJoint) and c.a is world.tube]
    dampers = [c for c in constraints if isinstance(c, pymunk.DampedSpring) and c.a is world.tube]
    welds = [c for c in constraints if isinstance(c, pymunk.PivotJoint) and c.a is world.tube]
    joints = [*grooves, *welds]
    held = {
        "grooves": float(len({c.b for c in grooves})),
        "dampers": float(len({c.b for c in dampers})),
        "welds": float(len({c.b for c in welds})),
        "joint_error_bias.most": max((c.error_bias for c in joints), default=math.nan),
        "joint_force_limit.least": min((c.max_force for c in constraints), default=math.nan),
    }
    held |= extremes("groove_top", (c.groove_a.y for c in grooves))
    held |= extremes("groove_bottom", (c.groove_b.y for c in grooves))
    held |= extremes("groove_off_axis", (abs(c.groove_a.x) + abs(c.groove_b.x) + c.anchor_b.length for c in grooves))
    held |= extremes("drag", (c.damping for c in dampers))
    held |= extremes("drag_stiffness", (c.stiffness for c in dampers))
    held |= extremes("drag_anchor", (c.anchor_a.y for c in dampers))
    return held | extremes("drag_off_axis", (abs(c.anchor_a.x) + c.anchor_b.length for c in dampers))


def _read_shapes(world: World) -> dict[str, float]:
    half = world.axis_origin
    # The space's own list: a body keeps shapes that no space holds, and those meet nothing.
    caps = [s for s in world.space.shapes if isinstance(s, pymunk.Segment) and s.body is world.tube]
    circles = rods.wall_circles(world.slices)
    pairs = list(product(caps, circles))
    # The inner face of a cap, as a distance from the cap end of the tube (the local axis points the other way).
    upper = [(half - (s.a.y - s.radius), s.radius) for s in caps if s.a.y > 0]
    lower = [(half - (s.a.y + s.radius), s.radius) for s in caps if s.a.y <= 0]
    held = {
        "caps_passed_through": float(sum(a.filter.rejects_collision(b.filter) for a, b in pairs)),
        "caps": float(len(caps)),
        "wall_shapes": float(len(circles)),
        **rods.read_back(world.tube, world.slices),
    }
    held |= extremes("elasticity_product", (a.elasticity * b.elasticity for a, b in pairs))
    held |= extremes("friction_product", (a.friction * b.friction for a, b in pairs))
    held |= extremes("contact_at_cap", (face + s.radius for (face, _), s in product(upper, circles)))
    held |= extremes("contact_at_base", (face - s.radius for (face, _), s in product(lower, circles)))
    return held | extremes("cap_thickness", (2 * radius for _, radius in (*upper, *lower)))


def verify(
    world: World, scenario: Scenario, knobs: PymunkKnobs, iterations: int, ice: str, slices: str = "overlap"
) -> dict[str, float]:
    """Return the world as read back, or refuse it.

    Raises
    ------
    SetupError
        Naming every value that differs from what was meant, with both numbers; and geometry in which the
        engine cannot do what is asked (a groove or an anchor that ends inside the tube).
    """
    held = read_back(world)
    meant = intended(scenario, knobs, iterations, ice, slices)
    problems = differences(meant, held, _scales(scenario))
    if world.slices and not scenario.frozen:
        problems += _dead_stops(held, scenario)
    return matched(held, meant, problems)


def _scales(scenario: Scenario) -> dict[str, float]:
    """Return sizes against which a value that should be zero is judged."""
    length = scenario.bottle.length
    speed = abs(scenario.omega0) * length + math.hypot(*scenario.launch_velocity)
    lengths = ("centre_x", "centre_y", "contact_at_cap", "contact_at_base")
    lengths_of_slices = tuple(f"{name}.{bound}" for name in lengths[2:] for bound in ("least", "most"))
    return dict.fromkeys((*lengths, *lengths_of_slices), length) | dict.fromkeys(("velocity_x", "velocity_y"), speed)


def _dead_stops(held: Mapping[str, float], scenario: Scenario) -> list[str]:
    half = scenario.bottle.length / 2
    problems = []
    for name, inward in (("groove_top.least", 1.0), ("groove_bottom.most", -1.0), ("drag_anchor.least", 1.0)):
        if name in held and not inward * held[name] > half:
            problems.append(f"{name} = {held[name]!r} m ends inside the tube (needed: beyond {inward * half:g} m)")
    return problems
