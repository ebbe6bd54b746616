"""The smallest worlds in which an engine behaves unexpectedly: one or two bodies, no bottle, no ``engine_check``.

Lengths in metres, times in seconds; x to the right, y up. The engines are imported where a world is built.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from importlib import import_module
from typing import Any


def _disc(space: Any, at: tuple[float, float], velocity: tuple[float, float], radius: float, elastic: float) -> Any:
    """Add a disc of 1 kg that does not turn to a pymunk space; return its body."""
    import pymunk

    body = pymunk.Body(1.0, math.inf)
    body.position, body.velocity = at, velocity
    disc = pymunk.Circle(body, radius)
    disc.elasticity = elastic
    space.add(body, disc)
    return body


def rebound_of_two(first: float, second: float) -> float:
    """Return the speed of separation over the speed of approach of two discs with these elasticities."""
    import pymunk

    space = pymunk.Space()
    left = _disc(space, (-0.2, 0.0), (1.0, 0.0), 0.1, first)
    right = _disc(space, (0.2, 0.0), (-1.0, 0.0), 0.1, second)
    for _ in range(200):
        space.step(1e-3)
    return float(right.velocity.x - left.velocity.x) / 2.0


def groove_end(_: object) -> tuple[float, str]:
    """Return the largest speed back, over the speed before, of a mass that runs into the end of its groove; and how."""
    import pymunk

    space = pymunk.Space()
    body = _disc(space, (0.5, 0.0), (1.0, 0.0), 0.01, 1.0)
    space.add(pymunk.GrooveJoint(space.static_body, body, (0.0, 0.0), (1.0, 0.0), (0.0, 0.0)))
    back = 0.0
    for _ in range(1000):
        space.step(1e-3)
        back = max(back, -float(body.velocity.x))
    if not abs(body.position.x - 1.0) < 1e-3:
        raise LookupError(f"the mass is at {body.position.x:.3g} m, not at the groove's end")
    note = "one mass with elasticity 1 in a groove; the set-up check refuses a groove that ends inside the bottle"
    return back, note


def stagger(_: object) -> tuple[float, str]:
    """Return by how many steps the engine's velocity is ahead of its position, in free fall; and how that is measured.

    The slope of the positions at t_n is (x_n+1 - x_n-1) / 2 dt, exact for a parabola; the engine's velocity is larger
    by g times the time it is ahead.
    """
    import pymunk

    dt, weight = 1e-3, -9.81
    space = pymunk.Space()
    space.gravity = (0.0, weight)
    body = _disc(space, (0.0, 0.0), (0.0, 0.0), 0.1, 0.0)
    height, speed = [], []
    for _ in range(11):
        space.step(dt)
        height.append(float(body.position.y))
        speed.append(float(body.velocity.y))
    slope = (height[6] - height[4]) / (2.0 * dt)
    ahead = (speed[5] - slope) / (weight * dt)
    return ahead, "free fall: velocity against the slope of the positions; positive is ahead"


def depth_left(slop: float | None) -> tuple[float, float]:
    """Return ``collision_slop`` and how deep a disc lies in the floor it was dropped on [m]; None: as by default."""
    import pymunk

    space = pymunk.Space()
    space.gravity = (0.0, -9.81)
    if slop is not None:
        space.collision_slop = slop
    space.add(pymunk.Segment(space.static_body, (-1.0, -0.1), (1.0, -0.1), 0.1))
    body = _disc(space, (0.0, 0.05), (0.0, -2.0), 0.02, 0.0)
    for _ in range(200):
        space.step(1e-2)
    return float(space.collision_slop), 0.02 - float(body.position.y)


def speed_through_wall(dt: float) -> float:
    """Return the speed along the way over the speed before, of a disc thrown at an elastic wall 1 cm thick."""
    import pymunk

    space = pymunk.Space()
    wall = pymunk.Segment(space.static_body, (0.0, -1.0), (0.0, 1.0), 0.005)
    wall.elasticity = 1.0
    space.add(wall)
    body = _disc(space, (-1.03, 0.0), (5.0, 0.0), 0.005, 1.0)
    for _ in range(round(0.5 / dt)):
        space.step(dt)
    return float(body.velocity.x) / 5.0


def soft_limit(_: object) -> tuple[float, str]:
    """Return speed back over speed before of a mass at MuJoCo's joint limit; and how far it goes beyond, in words."""
    xml = (
        '<mujoco><option gravity="0 0 0" timestep="1e-4"/><worldbody><body>'
        '<joint type="slide" axis="1 0 0" limited="true" range="-1 0.1"/>'
        '<geom size="0.01" mass="1" contype="0" conaffinity="0"/></body></worldbody></mujoco>'
    )
    path = list(_mujoco_path(xml, speed=1.0, duration=0.5))
    beyond = max(x for x, _ in path) - 0.1
    return -min(v for _, v in path), f"hit at 1 m/s; the mass goes {beyond * 1e3:.1f} mm beyond the limit first"


def soft_contact(_: object) -> tuple[float, str]:
    """Return how deep a ball of 1 kg lies in MuJoCo's floor at rest [mm]; and how deep after landing, in words."""
    xml = (
        '<mujoco><option timestep="1e-4"/><worldbody><geom type="plane" size="1 1 0.1"/>'
        '<body pos="0 0 0.02"><joint type="slide" axis="0 0 1"/><geom size="0.02" mass="1"/></body>'
        "</worldbody></mujoco>"
    )
    path = list(_mujoco_path(xml, speed=-1.0, duration=1.0))
    deepest = -min(x for x, _ in path)
    return -path[-1][0] * 1e3, f"1 kg at rest under its weight; {deepest * 1e3:.1f} mm when it lands at 1 m/s"


def _mujoco_path(xml: str, *, speed: float, duration: float) -> Iterator[tuple[float, float]]:
    """Yield position and velocity of a model with one joint, step by step; ``speed`` is its velocity at the start."""
    mujoco = import_module("mujoco")
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qvel[0] = speed
    for _ in range(round(duration / model.opt.timestep)):
        mujoco.mj_step(model, data)
        yield float(data.qpos[0]), float(data.qvel[0])
