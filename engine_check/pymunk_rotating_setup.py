"""What the world of the held tube was meant to hold, what it holds, and the comparison before the first step.

``intended`` works from the scenario and the shared definitions alone, ``read_back`` from the engine's objects and the
force law that will drive them, so that a slip in ``pymunk_rotating_world`` cannot hide in both. Forces are read where
they wait to act, one slice at a time.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pymunk

from engine_check.pymunk_rotating_world import ForceLaw, HeldWorld, forces_held
from engine_check.pymunk_settings import CAP_ELASTICITY, PymunkKnobs
from engine_check.readback import both, differences, extremes, matched
from slicemodel import observables
from slicemodel.scenario import Scenario


def intended(scenario: Scenario, knobs: PymunkKnobs, iterations: int, ice: str) -> dict[str, float]:
    """Return what the world must hold at release, SI units; ``name.least`` and ``name.most`` bound all slices."""
    n, rigid = scenario.n_slices, scenario.frozen and ice == "rigid"
    positions = scenario.initial_positions()
    centre = float(observables.centre_of_mass(scenario, positions))
    inertia = observables.initial_moment_of_inertia(scenario)
    # At release no slice moves in the tube, nor does C_M: no drag.
    weight = scenario.gravity * math.cos(scenario.theta0)
    forces = scenario.slice_mass * (scenario.omega0**2 * (positions - centre) + weight)
    meant = {
        "iterations": float(iterations),
        "gravity_x": 0.0,
        "gravity_y": 0.0,
        "damping": knobs.damping,
        "collision_slop": knobs.collision_slop,
        "collision_bias": knobs.collision_bias,
        "collision_persistence": float(knobs.collision_persistence),
        "sleep_time_threshold": math.inf,
        "moving_bodies": 0.0 if rigid else float(n),
        "static_bodies": 1.0 + n if rigid else 1.0,
        "shapes": 0.0 if scenario.frozen else n + 2.0,
        "constraints": float(n) if scenario.frozen and not rigid else 0.0,
        "tube_x": 0.0,
        "tube_angle": 0.0,
        "centre": centre,
        "inertia": inertia,
        "angular_momentum": inertia * scenario.omega0,
        "drag": scenario.drag,
        "lane_gap": 2 * scenario.slice_height if n > 1 else math.inf,
        "speed": 0.0,
        "force_across": 0.0,
        "force_total": float(forces.sum()),
        "force.least": float(forces.min()),
        "force.most": float(forces.max()),
        "position.least": float(positions.min()),
        "position.most": float(positions.max()),
    }
    if not rigid:
        meant |= both("slice_mass", scenario.slice_mass) | both("slice_moment", math.inf)
    if scenario.frozen:
        return meant if rigid else meant | {"pins": float(n), "pin_error_bias.most": knobs.error_bias}
    meant |= {"caps": 2.0, "circles": float(n), "caps_passed_through": 0.0, "lanes_beyond_caps": 0.0}
    meant |= both("elasticity_product", CAP_ELASTICITY * scenario.restitution)
    meant |= both("friction_product", knobs.friction**2)
    meant |= both("contact_at_cap", scenario.r_min) | both("contact_at_base", scenario.r_max)
    return meant | both("cap_thickness", knobs.cap_thickness * scenario.bottle.length)


def read_back(world: HeldWorld, law: ForceLaw, half_length: float) -> dict[str, float]:
    """Return what the engine's objects hold, under the names of ``intended``; ``half_length`` is L/2 [m]."""
    space, slices = world.space, world.slices
    x = np.array([body.position.x for body in slices])
    lanes = np.sort([body.position.y for body in slices])
    forces = forces_held(slices)
    along = np.array([force for force, _ in forces])
    centre, inertia = law.centre_and_inertia(x)
    static = [body for body in space.bodies if body.body_type == pymunk.Body.STATIC]
    pins = [c for c in space.constraints if isinstance(c, pymunk.PivotJoint) and c.a is world.tube]
    held = {
        "iterations": float(space.iterations),
        "gravity_x": space.gravity.x,
        "gravity_y": space.gravity.y,
        "damping": space.damping,
        "collision_slop": space.collision_slop,
        "collision_bias": space.collision_bias,
        "collision_persistence": float(space.collision_persistence),
        "sleep_time_threshold": space.sleep_time_threshold,
        "moving_bodies": float(len(space.bodies) - len(static)),
        "static_bodies": float(len(static)) if world.tube in static else math.nan,
        "shapes": float(len(space.shapes)),
        "constraints": float(len(space.constraints)),
        "tube_x": abs(world.tube.position.x) + abs(world.tube.position.y),
        "tube_angle": world.tube.angle,
        "centre": half_length + centre,
        "inertia": inertia,
        "angular_momentum": law.angular_momentum,
        "drag": law.drag,
        "lane_gap": float(np.diff(lanes).min(initial=math.inf)),
        "speed": max(body.velocity.length for body in slices),
        "force_across": max(abs(force) for _, force in forces),
        "force_total": float(along.sum()),
        "force.least": float(along.min()),
        "force.most": float(along.max()),
        "position.least": half_length + float(x.min()),
        "position.most": half_length + float(x.max()),
        "pins": float(len({c.b for c in pins})),
        "pin_error_bias.most": max((c.error_bias for c in pins), default=math.nan),
    }
    held |= extremes("slice_mass", (body.mass for body in slices))
    held |= extremes("slice_moment", (body.moment for body in slices))
    return held | _read_shapes(world, half_length)


def _read_shapes(world: HeldWorld, half_length: float) -> dict[str, float]:
    # The space's own list: a body keeps shapes that no space holds, and those meet nothing.
    caps = [s for s in world.space.shapes if isinstance(s, pymunk.Segment) and s.body is world.tube]
    bodies = set(world.slices)
    carried = [(s.body.position.y, s) for s in world.space.shapes if isinstance(s, pymunk.Circle) and s.body in bodies]
    circles = [circle for _, circle in carried]
    pairs = list(product(caps, circles))
    held = {
        "caps": float(len(caps)),
        "circles": float(len(circles)),
        "caps_passed_through": float(sum(a.filter.rejects_collision(b.filter) for a, b in pairs)),
        "lanes_beyond_caps": float(sum(not cap.a.y < lane < cap.b.y for cap, (lane, _) in product(caps, carried))),
    }
    at_cap = [cap.a.x + cap.radius + half_length for cap in caps if cap.a.x < 0]
    at_base = [cap.a.x - cap.radius + half_length for cap in caps if cap.a.x >= 0]
    held |= extremes("elasticity_product", (a.elasticity * b.elasticity for a, b in pairs))
    held |= extremes("friction_product", (a.friction * b.friction for a, b in pairs))
    held |= extremes("contact_at_cap", (face + circle.radius for face, circle in product(at_cap, circles)))
    held |= extremes("contact_at_base", (face - circle.radius for face, circle in product(at_base, circles)))
    return held | extremes("cap_thickness", (2 * cap.radius for cap in caps))


def verify_held(
    world: HeldWorld, law: ForceLaw, scenario: Scenario, knobs: PymunkKnobs, iterations: int, ice: str
) -> dict[str, float]:
    """Return the world as read back, or refuse it.

    Raises
    ------
    SetupError
        Naming every value that differs from what was meant, with both numbers.
    """
    held = read_back(world, law, scenario.bottle.length / 2)
    meant = intended(scenario, knobs, iterations, ice)
    return matched(held, meant, differences(meant, held, _scales(scenario)))


def _scales(scenario: Scenario) -> dict[str, float]:
    """Return sizes against which a value that may be zero is judged."""
    length = scenario.bottle.length
    force = scenario.slice_mass * (scenario.omega0**2 * length + scenario.gravity)
    places = ("contact_at_cap.least", "contact_at_cap.most", "position.least", "position.most")
    return (
        {"force_total": scenario.n_slices * force}
        | dict.fromkeys(("force.least", "force.most"), force)
        | (dict.fromkeys(places, length))
    )
