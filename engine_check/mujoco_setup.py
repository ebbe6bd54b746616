"""What the MuJoCo world was meant to hold, what it holds, and the comparison before the first step.

``intended`` works from the scenario alone and ``read_back`` from the compiled model and its data alone, so that a slip
in ``mujoco_world`` cannot hide in both. The mass matrix is the engine's own, J and L are formed from the masses, places
and velocities of its bodies.
"""

from __future__ import annotations

import math
from typing import Any, Final

import mujoco
import numpy as np

from engine_check.mujoco_world import TUBE, TUBE_DOFS, World, disable_flags
from engine_check.readback import both, differences, extremes, matched
from slicemodel import observables
from slicemodel.scenario import Scenario

SLIDES: Final = 2
"""Slide joints of the tube itself."""


def intended(scenario: Scenario, dt: float, moving: bool) -> dict[str, float]:
    """Return what the world must hold, from the scenario alone, SI units.

    A pair ``name.least`` and ``name.most`` bounds a value over all slices.
    """
    bottle, r = scenario.bottle, scenario.initial_positions()
    inertia = observables.initial_moment_of_inertia(scenario)
    centre = float(observables.centre_of_mass(scenario, r))
    offset = bottle.length / 2 - centre
    speed = math.hypot(*scenario.launch_velocity)
    n = scenario.n_slices if moving else 0
    meant = {
        "integrator": float(mujoco.mjtIntegrator.mjINT_RK4),
        "timestep": dt,
        "disable_flags": float(disable_flags()),
        "enable_flags": 0.0,
        "gravity_x": 0.0,
        "gravity_y": -scenario.gravity,
        "gravity_z": 0.0,
        "air": 0.0,
        "bodies": 1.0 + scenario.n_slices,
        "coordinates": float(TUBE_DOFS + n),
        "slide_joints": float(SLIDES + n),
        "hinges": 1.0,
        "shapes_actuators_constraints": 0.0,
        "total_mass": scenario.total_mass,
        "tube_mass": bottle.mass,
        "tube_moment": bottle.mass * (bottle.radius * bottle.radius / 2 + bottle.length * bottle.length / 12),
        "tube_damping": 0.0,
        "friction_stiffness_armature": 0.0,
        "angle": scenario.theta0,
        "angular_velocity": scenario.omega0,
        "velocity_x": scenario.launch_velocity[0],
        "velocity_y": scenario.launch_velocity[1],
        "centre_x": 0.0,
        "centre_y": 0.0,
        "inertia": inertia,
        "angular_momentum": inertia * scenario.omega0,
        # Of the whole about the tube's centre, which the hinge turns (parallel axes).
        "mass_matrix_hinge": inertia + scenario.total_mass * offset * offset,
        "mass_matrix_slide": scenario.total_mass,
        "kinetic_energy": (inertia * scenario.omega0**2 + scenario.total_mass * speed * speed) / 2,
    }
    meant |= both("slice_mass", scenario.slice_mass) | both("slice_moment", 0.0)
    meant |= {"slice_from_cap.least": float(r.min()), "slice_from_cap.most": float(r.max())}
    if moving:
        meant |= both("drag", scenario.drag) | both("drag_not_linear", 0.0)
        meant |= both("end_at_cap", scenario.r_min) | both("end_at_base", scenario.r_max) | both("limited", 0.0)
        meant |= both("mass_matrix_slice", scenario.slice_mass) | both("slice_speed", 0.0)
    return meant


def read_back(world: World) -> dict[str, float]:
    """Return what the engine's model and data hold, under the names of ``intended``."""
    model, option = world.model, world.model.opt
    state = world.state(0.0)
    velocity, momentum = state.masses @ state.v / state.masses.sum(), state.angular_momentum()
    centre = state.masses @ state.x / state.masses.sum()
    _, inertia = state.centre_and_inertia()
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, world.data, matrix)
    kinds = model.jnt_type
    loose = (model.dof_frictionloss, model.dof_armature, model.jnt_stiffness, model.jnt_stiffnesspoly)
    held = {
        "integrator": float(option.integrator),
        "timestep": option.timestep,
        "disable_flags": float(option.disableflags),
        "enable_flags": float(option.enableflags),
        "gravity_x": float(option.gravity[0]),
        "gravity_y": float(option.gravity[1]),
        "gravity_z": float(option.gravity[2]),
        "air": _largest(option.density, option.viscosity, option.wind),
        "bodies": float(model.nbody - TUBE),
        "coordinates": float(model.nv),
        "slide_joints": float(np.count_nonzero(kinds == mujoco.mjtJoint.mjJNT_SLIDE)),
        "hinges": float(np.count_nonzero(kinds == mujoco.mjtJoint.mjJNT_HINGE)),
        "shapes_actuators_constraints": float(model.ngeom + model.nu + model.neq + model.ntendon),
        "total_mass": float(model.body_mass[TUBE:].sum()),
        "tube_mass": float(model.body_mass[TUBE]),
        "tube_moment": float(model.body_inertia[TUBE, 2]),
        "tube_damping": _largest(model.dof_damping[:TUBE_DOFS], model.dof_dampingpoly[:TUBE_DOFS]),
        "friction_stiffness_armature": _largest(*loose),
        "angle": state.angle,
        "angular_velocity": state.omega,
        "velocity_x": float(velocity[0]),
        "velocity_y": float(velocity[1]),
        "centre_x": float(centre[0]),
        "centre_y": float(centre[1]),
        "inertia": inertia,
        "angular_momentum": momentum,
        "mass_matrix_hinge": float(matrix[2, 2]),
        "mass_matrix_slide": float(matrix[0, 0]) if matrix[0, 0] == matrix[1, 1] else math.nan,
        "kinetic_energy": float(world.data.qvel @ matrix @ world.data.qvel) / 2,
    }
    held |= extremes("slice_mass", model.body_mass[TUBE + 1 :])
    held |= extremes("slice_moment", np.abs(model.body_inertia[TUBE + 1 :]).ravel())
    held |= extremes("slice_from_cap", state.along_axis()[0])
    if world.movable:
        held |= _read_slides(world, matrix)
    return held


def _read_slides(world: World, matrix: Any) -> dict[str, float]:
    model, slices = world.model, slice(TUBE_DOFS, None)
    held = extremes("drag", model.dof_damping[slices])
    held |= extremes("drag_not_linear", np.abs(model.dof_dampingpoly[slices]).ravel())
    held |= extremes("end_at_cap", model.jnt_range[slices, 0])
    held |= extremes("end_at_base", model.jnt_range[slices, 1])
    held |= extremes("limited", model.jnt_limited[slices])
    held |= extremes("mass_matrix_slice", np.diag(matrix)[slices])
    return held | extremes("slice_speed", world.v)


def verify(world: World, scenario: Scenario, dt: float) -> dict[str, float]:
    """Return the world as read back, or refuse it.

    Raises
    ------
    SetupError
        Naming every value that differs from what was meant, with both numbers.
    """
    held = read_back(world)
    meant = intended(scenario, dt, world.movable)
    return matched(held, meant, differences(meant, held, _scales(scenario)))


def _scales(scenario: Scenario) -> dict[str, float]:
    length = scenario.bottle.length
    speed = abs(scenario.omega0) * length + math.hypot(*scenario.launch_velocity)
    lengths = ("centre_x", "centre_y", "slice_from_cap.least", "slice_from_cap.most")
    return dict.fromkeys(lengths, length) | dict.fromkeys(("velocity_x", "velocity_y"), speed)


def _largest(*values: Any) -> float:
    """Return the largest magnitude; NaN if one is NaN."""
    return float(np.max(np.abs(np.concatenate([np.ravel(value) for value in values]))))
