"""The bottle as a MuJoCo tree in generalised coordinates, in the lab frame, centre of mass at the origin at release.

    y                 cap  +-------+  local (0, +L/2)      qpos = (x, y, theta, r_1 ... r_N): x, y of the tube's
    ^                      |  |    |  r = 0                centre by two slide joints, theta by a hinge about z
    |                      |  o    |  slide joint i:       (counter-clockwise; theta = 0: the bottle stands
    |  | g                 |  |    |  axis u_r from the    upright), r_i by a slide joint from the cap along
    |  v                   |  o    |  cap, damping alpha   u_r = (sin theta, -cos theta).
    +-------> x      base  +-------+  local (0, -L/2)      qvel = (x', y', omega, r_1' ... r_N')

A slice cannot leave the axis, so there is no constraint that could drift. The damping of a slide joint acts on slice
and tube, equal and opposite. A resting slice is held by a clutch: an armature (rotor inertia, which MuJoCo adds to the
joint's own entry of the mass matrix and nowhere else) so large that the joint does not accelerate. The tube
then carries the slice, its weight and inertia included, and the sign of the joint's vanishing
acceleration is the sign of the force that presses it on (``World.push``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from engine_check.mujoco_settings import CLUTCH, DISABLED, PLACEHOLDER_INERTIA
from engine_check.watch import State
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray

TUBE: Final = 1
"""Number of the tube among the engine's bodies; 0 is the world."""

TUBE_DOFS: Final = 3
"""Coordinates of the tube: x, y, theta. Those of the slices follow."""

FLATTEST: Final = 1e-6
"""Length over radius below which round-off breaks the inequality A + B >= C of the tube's moments of inertia."""

IMMOBILE: Final = 1e-12
"""Play between the ends below which a slice cannot move [L]: one slice as long as the tube."""


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """The compiled model, its data, and views of the slices' part in them.

    ``r``, ``v``, ``a`` are the slices' coordinates, speeds and accelerations, shape (N,), live and writable; of shape
    (0,) if nothing can move. ``low`` and ``high`` are the ends, as the model holds them [m].
    """

    model: Any
    data: Any
    slice_mass: float
    axis_origin: float
    low: float
    high: float
    r: FloatArray
    v: FloatArray
    a: FloatArray
    armature: FloatArray

    @property
    def movable(self) -> bool:
        """True if there are slide joints."""
        return len(self.r) > 0

    def clutch(self, resting: NDArray[np.int64]) -> None:
        """Hold the slices where ``resting`` is not 0 and let go of the others."""
        self.armature[:] = np.where(resting != 0, CLUTCH * self.slice_mass, 0.0)

    def state(self, now: float) -> State:
        """Return all bodies at the present coordinates, from the engine's own body frames and velocities."""
        model, data = self.model, self.data
        mujoco.mj_forward(model, data)
        at = data.xipos[TUBE:]
        # cvel is (rotation, translation) of each body at the centre of mass of its tree.
        spin, drift = data.cvel[TUBE:, :3], data.cvel[TUBE:, 3:]
        velocity = drift + np.cross(spin, at - data.subtree_com[TUBE])
        return State(
            t=now,
            angle=float(data.qpos[2]),
            omega=float(data.qvel[2]),
            x=at[:, :2].copy(),
            v=velocity[:, :2],
            masses=model.body_mass[TUBE:],
            axis_origin=self.axis_origin,
            spin_moment=float(model.body_inertia[TUBE, 2]),
            gravity_time=now,
        )


def build(scenario: Scenario, dt: float) -> World:
    """Return the world at release, t = 0: rigid rotation with omega_0 about the centre of mass.

    Raises
    ------
    ValueError
        For velocities beyond the range of MuJoCo, and for masses and moments of inertia below it.
    """
    fastest = max(abs(scenario.omega0), *(abs(speed) for speed in scenario.launch_velocity), abs(scenario.theta0))
    if not fastest < mujoco.mjMAXVAL:
        raise ValueError(
            f"omega0, theta0 or launch_velocity = {fastest:g} is outside (-{mujoco.mjMAXVAL:g}, {mujoco.mjMAXVAL:g}), "
            "the range of MuJoCo"
        )
    bottle, min_value = scenario.bottle, mujoco.mjMINVAL
    for words, value, above in (
        ("bottle.mass [kg]", bottle.mass, min_value),
        ("bottle.mass * bottle.radius^2 [kg m^2]", bottle.mass * bottle.radius**2, min_value),
        ("bottle.length / bottle.radius", bottle.length / bottle.radius, FLATTEST),
        ("water_mass / n_slices [kg]", scenario.slice_mass, min_value),
    ):
        if not value > above:
            raise ValueError(f"{words} = {value:g} is outside ({above:g}, inf), the range of MuJoCo")
    moving = not scenario.frozen and scenario.r_max - scenario.r_min > IMMOBILE * scenario.bottle.length
    spec = _options(scenario, dt)
    _bodies(spec, scenario, moving)
    model = spec.compile()
    model.body_inertia[TUBE + 1 :] = 0.0
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    _release(data, scenario, moving)
    slices = slice(TUBE_DOFS, None)
    low, high = model.jnt_range[TUBE_DOFS] if moving else (scenario.r_min, scenario.r_max)
    return World(
        model=model,
        data=data,
        slice_mass=scenario.slice_mass,
        axis_origin=scenario.bottle.length / 2,
        low=float(low),
        high=float(high),
        r=data.qpos[slices],
        v=data.qvel[slices],
        a=data.qacc[slices],
        armature=model.dof_armature[slices],
    )


def _options(scenario: Scenario, dt: float) -> Any:
    spec = mujoco.MjSpec()
    compiler, option = spec.compiler, spec.option
    compiler.degree = False
    compiler.autolimits = False
    compiler.boundmass = compiler.boundinertia = 0.0
    compiler.balanceinertia = False
    compiler.settotalmass = -1.0
    compiler.fusestatic = False
    compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    option.timestep = dt
    option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    option.gravity = (0.0, -scenario.gravity, 0.0)
    option.density = option.viscosity = 0.0
    option.wind = (0.0, 0.0, 0.0)
    option.disableflags = disable_flags()
    option.enableflags = 0
    return spec


def disable_flags() -> int:
    """Return ``DISABLED`` as the engine's bit field."""
    return sum(int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")) for name in DISABLED)


def _bodies(spec: Any, scenario: Scenario, moving: bool) -> None:
    bottle, joint = scenario.bottle, mujoco.mjtJoint
    across = bottle.mass * (bottle.radius * bottle.radius / 2 + bottle.length * bottle.length / 12)
    tube = spec.worldbody.add_body(name="tube", mass=bottle.mass, explicitinertial=True)
    tube.ipos = (0.0, 0.0, 0.0)
    tube.inertia = (across, bottle.mass * bottle.radius * bottle.radius, across)
    tube.add_joint(name="x", type=joint.mjJNT_SLIDE, axis=(1.0, 0.0, 0.0))
    tube.add_joint(name="y", type=joint.mjJNT_SLIDE, axis=(0.0, 1.0, 0.0))
    tube.add_joint(name="theta", type=joint.mjJNT_HINGE, axis=(0.0, 0.0, 1.0))
    for i, place in enumerate(scenario.initial_positions()):
        from_cap = 0.0 if moving else place
        body = tube.add_body(name=f"slice {i}", pos=(0.0, bottle.length / 2 - from_cap, 0.0), explicitinertial=True)
        body.mass, body.ipos = scenario.slice_mass, (0.0, 0.0, 0.0)
        body.inertia = (PLACEHOLDER_INERTIA,) * 3
        if moving:
            body.add_joint(
                name=f"r {i}",
                type=joint.mjJNT_SLIDE,
                axis=(0.0, -1.0, 0.0),
                damping=(scenario.drag, 0.0, 0.0),
                range=(scenario.r_min, scenario.r_max),
                limited=mujoco.mjtLimited.mjLIMITED_FALSE,
            )


def _release(data: Any, scenario: Scenario, moving: bool) -> None:
    bottle, r = scenario.bottle, scenario.initial_positions()
    centre = (bottle.mass * bottle.length / 2 + scenario.slice_mass * float(r.sum())) / scenario.total_mass
    offset = bottle.length / 2 - centre
    sine, cosine = math.sin(scenario.theta0), math.cos(scenario.theta0)
    drift_x, drift_y = scenario.launch_velocity
    data.qpos[:TUBE_DOFS] = offset * sine, -offset * cosine, scenario.theta0
    data.qvel[:TUBE_DOFS] = (
        drift_x + scenario.omega0 * offset * cosine,
        drift_y + scenario.omega0 * offset * sine,
        scenario.omega0,
    )
    if moving:
        data.qpos[TUBE_DOFS:] = r
        data.qvel[TUBE_DOFS:] = 0.0
