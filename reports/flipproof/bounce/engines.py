"""Three engines as their authors would write them for ``flipproof bounce``; settings are read back and printed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from flipproof.bounce.adapter import Adapter, AdapterError, FloatArray

RADIUS: Final = 0.1
"""Radius of the falling ball [m]; the adapters subtract it."""

Answer = tuple[FloatArray, FloatArray, FloatArray]


def adapter(name: str) -> Adapter:
    """Return a built-in adapter; an AdapterError says which package is missing."""
    build = {"pymunk": _pymunk, "mujoco": _mujoco, "box2d": _box2d}[name]
    try:
        return build()
    except ModuleNotFoundError as error:
        raise AdapterError(f"{name}: the package {error.name} is not installed") from None


def _trajectory(steps: int, dt: float, state: Callable[[], Any], step: Callable[[], Any]) -> Answer:
    """Return times, positions and velocities at release and after each step."""
    rows = [state()]
    for _ in range(steps):
        step()
        rows.append(state())
    positions, velocities = (np.array(column, dtype=float) for column in zip(*rows, strict=True))
    times: FloatArray = dt * np.arange(steps + 1, dtype=np.float64)
    return times, positions, velocities


def _pymunk() -> Adapter:
    import pymunk

    def space_of(gravity: float) -> Any:
        space = pymunk.Space()
        space.gravity, space.iterations, space.collision_slop = (0.0, -gravity), 60, 0.0
        return space

    def drop(height: float, speed: float, restitution: float, gravity: float, dt: float, duration: float) -> Answer:
        space = space_of(gravity)
        floor = pymunk.Poly(space.static_body, [(-50, -50), (50, -50), (50, 0), (-50, 0)])
        floor.elasticity, floor.friction = 1.0, 0.0  # the engine multiplies the two
        body = pymunk.Body(1.0, math.inf)
        ball = pymunk.Circle(body, RADIUS)
        ball.elasticity, ball.friction = restitution, 0.0
        body.position, body.velocity = (0.0, height + RADIUS), (0.0, speed)
        space.add(floor, body, ball)
        return _trajectory(
            round(duration / dt), dt, lambda: (body.position.y - RADIUS, body.velocity.y), lambda: space.step(dt)
        )

    space = space_of(9.81)
    settings = {name: getattr(space, name) for name in ("iterations", "collision_slop", "collision_bias")}
    return Adapter("pymunk", drop, {"version": pymunk.version, **settings})


def _box2d() -> Adapter:
    import Box2D

    iterations = 20

    def drop(height: float, speed: float, restitution: float, gravity: float, dt: float, duration: float) -> Answer:
        world = Box2D.b2World(gravity=(0, -gravity), doSleep=False)
        floor = world.CreateStaticBody(position=(0, -50))
        floor.CreateFixture(
            Box2D.b2FixtureDef(shape=Box2D.b2PolygonShape(box=(50, 50)), friction=0, restitution=0)
        )  # the engine takes the larger of the two
        body = world.CreateDynamicBody(
            position=(0, height + RADIUS), linearVelocity=(0, speed), fixedRotation=True, bullet=True
        )
        body.CreateFixture(
            Box2D.b2FixtureDef(shape=Box2D.b2CircleShape(radius=RADIUS), density=1, friction=0, restitution=restitution)
        )
        return _trajectory(
            round(duration / dt),
            dt,
            lambda: (body.position[1] - RADIUS, body.linearVelocity[1]),
            lambda: world.Step(dt, iterations, iterations),
        )

    world = Box2D.b2World()
    settings = {
        "version": Box2D.__version__,
        "iterations": iterations,
        "continuousPhysics": world.continuousPhysics,
        "b2_velocityThreshold": Box2D.b2_velocityThreshold
        if hasattr(Box2D, "b2_velocityThreshold")
        else "1 (compiled)",
    }
    return Adapter("box2d", drop, settings)


def _mujoco() -> Adapter:
    import mujoco

    stiffness = 1e5  # of the contact [1/s^2]; the damping for e follows from it

    def contact(restitution: float) -> str:
        bounces = restitution > 0
        ratio = abs(math.log(restitution)) / math.hypot(math.pi, math.log(restitution)) if bounces else 1.0
        return f'solref="-{stiffness!r} -{2 * ratio * stiffness**0.5!r}" solimp="0.99 0.99 0.001" condim="1"'

    def drop(height: float, speed: float, restitution: float, gravity: float, dt: float, duration: float) -> Answer:
        contact_xml = contact(restitution)
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{dt!r}" gravity="0 0 {-gravity!r}" integrator="implicitfast"/><worldbody>'
            f'<geom type="plane" size="5 5 1" {contact_xml}/>'
            f'<body pos="0 0 {height + RADIUS!r}"><joint type="slide" axis="0 0 1"/>'
            f'<geom type="sphere" size="{RADIUS}" mass="1" {contact_xml}/></body></worldbody></mujoco>'
        )
        data = mujoco.MjData(model)
        data.qvel[0] = speed
        return _trajectory(
            round(duration / dt), dt, lambda: (height + data.qpos[0], data.qvel[0]), lambda: mujoco.mj_step(model, data)
        )

    settings = {
        "version": mujoco.__version__,
        "integrator": "implicitfast",
        "solref": f"-{stiffness:g} and the damping that a linear spring needs for e",
        "solimp": "0.99 0.99 0.001",
    }
    return Adapter("mujoco", drop, settings)
