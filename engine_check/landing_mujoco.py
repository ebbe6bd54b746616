r"""The landing in MuJoCo with rigid contacts: impulses from the engine's own mass matrix and Jacobians.

The world is that of ``mujoco_world``: a tree of joints with q = (x, y, theta, r_1 .. r_N), whose limits and contacts
are switched off. A step of Moreau and Jean: places by half a step; there the engine's accelerations (Coriolis, weight
and drag included), mass matrix M and Jacobian J of the contacts that are closed or overrun; impulses p; velocities;
places by the other half. With u = J v before and the free velocity f = J (v + a dt),

    u+ = f + J M^-1 J^T p,     0 <= p_n,   u_n+ >= max(-e u_n, 0),   product 0,     |p_t| <= mu p_n

e is the table's for a corner and the water's for a slice. Friction opposes slip. The law "in-turn" finds the impulses
of the corners first, without the slices, and then those of all contacts from the velocities that they leave.

Overrun gaps are answered at the end of the step in which they close: everything that closes within one step shares its
impulses, and things sink in by speed times step. Half the step certifies.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import mujoco
import numpy as np

from engine_check.landing import Watch, immovable, refuse_misplaced, stops
from engine_check.landing_impulses import impulses
from engine_check.mujoco_log import no_log
from engine_check.mujoco_setup import verify
from engine_check.mujoco_world import TUBE, TUBE_DOFS
from engine_check.mujoco_world import build as release
from engine_check.readback import differences, matched
from slicemodel.table import Table, Touch
from slicemodel.trajectory import FloatArray

CLOSED: Final = 1e-9
"""Gap up to which a slice rests or a corner touches [L]."""

SLOWEST_IMPACT: Final = 0.05
"""Speed at which a corner comes down [m/s] from which on the law "in-turn" takes it for an impact."""

quiet: Final = no_log


def build(touch: Touch, table: Table, dt: float, law: str | None, slices: str) -> World:
    """Return the world at the touch, read back."""
    return World(touch, table, dt, law, slices)


class World:
    """One bottle over a table, and what ``landing.landed`` asks of it."""

    def __init__(self, touch: Touch, table: Table, dt: float, law: str | None, slices: str) -> None:
        scenario = touch.scenario
        self.touch, self.table, self.dt, self.scenario = touch, table, dt, scenario
        self.in_turn, self.chain = law == "in-turn", slices == "exclude"
        self.rigid = immovable(scenario)
        self.ledger, self.saddle = 0.0, Watch(scenario).saddle
        if not self.rigid:
            refuse_misplaced(touch, slices)
        world = release(scenario, dt)
        setup = verify(world, scenario, dt)
        self.model, self.data = world.model, world.data
        bottle = scenario.bottle
        height = bottle.length / 2 * abs(math.cos(touch.theta)) + bottle.radius * abs(math.sin(touch.theta))
        self.data.qpos[:TUBE_DOFS] = 0.0, height, touch.theta
        self.data.qvel[:TUBE_DOFS] = *touch.velocity, touch.omega
        if not self.rigid:
            self.data.qpos[TUBE_DOFS:] = touch.r
            self.data.qvel[TUBE_DOFS:] = touch.v
        elif scenario.frozen:
            self._refuse_moved_ice()
        self.gradient, self.offset = self._gaps()
        half, radius = bottle.length / 2, bottle.radius
        self.corners = np.array([[x, y, 0.0] for y in (-half, half) for x in (-radius, radius)])
        self.jacobian = np.zeros((3, self.model.nv))
        self.settings: Mapping[str, object] = {"mujoco_version": mujoco.__version__, "method": "Moreau-Jean"}
        meant = {"lowest_corner": 0.0, "velocity_x": touch.velocity[0], "velocity_y": touch.velocity[1]}
        mujoco.mj_forward(self.model, self.data)
        held = {
            "lowest_corner": float(self._heights().min()),
            "velocity_x": self._middle_velocity()[0],
            "velocity_y": self._middle_velocity()[1],
        }
        self.setup = setup | matched(held, meant, differences(meant, held, dict.fromkeys(meant, 1.0)))

    def _refuse_moved_ice(self) -> None:
        """Raise ValueError for ice that is not where it froze: the engine's blocks are where they were at release."""
        if np.max(np.abs(self.touch.r - self.scenario.initial_positions())) > 1e-9 * self.scenario.bottle.length:
            raise ValueError("touch.r of a frozen scenario is not where its slices stand at release")

    def _middle_velocity(self) -> FloatArray:
        mujoco.mj_jac(self.model, self.data, self.jacobian, None, self.data.xpos[TUBE], TUBE)
        return np.asarray(self.jacobian @ self.data.qvel)

    def _heights(self) -> FloatArray:
        """Return the heights of the corners [m]."""
        return np.asarray(self.data.xpos[TUBE, 1] + self.corners @ self.data.xmat[TUBE, 3:6])

    def _corner(self, c: int) -> FloatArray:
        """Return the rows of a corner's Jacobian upwards and along x, shape (2, nv)."""
        place = self.data.xpos[TUBE] + self.data.xmat[TUBE].reshape(3, 3) @ self.corners[c]
        mujoco.mj_jac(self.model, self.data, self.jacobian, None, place, TUBE)
        return self.jacobian[[1, 0]]

    def _gaps(self) -> tuple[FloatArray, FloatArray]:
        """Return matrix and vector by which the gaps of the slices [m] follow from q."""
        n = 0 if self.rigid else self.scenario.n_slices
        unit = np.eye(self.model.nv)[TUBE_DOFS:]
        low, high = (np.array(places[:n]) for places in stops(self.scenario))
        if not self.chain or not n:
            return np.concatenate([-unit, unit]), np.concatenate([high, -low])
        between = np.full(n - 1, -self.scenario.slice_height)
        gradient = np.concatenate([-unit[:1], unit[:-1] - unit[1:], unit[-1:]])
        return gradient, np.concatenate([high[:1], between, -low[-1:]])

    def _contacts(self) -> tuple[FloatArray, FloatArray]:
        """Return the Jacobian of all contacts, and their kinds: 1 a corner (two rows), 0 a slice (one row)."""
        slack = CLOSED * self.scenario.bottle.length
        corners = [self._corner(c) for c in np.flatnonzero(self._heights() <= slack).tolist()]
        slices = self.gradient[self.gradient @ self.data.qpos + self.offset <= slack]
        kinds = np.repeat([1, 0], [len(corners), len(slices)])
        return np.concatenate([*corners, slices]), kinds

    def advance(self) -> str:
        """Make one step; return what left its band, or an empty string."""
        model, data, dt = self.model, self.data, self.dt
        before = data.qvel.copy()
        data.qpos[:] += before * dt / 2
        mujoco.mj_forward(model, data)
        # Coriolis forces at the mean of the velocities: once more, with those that the first evaluation gives.
        data.qvel[:] = before + data.qacc * dt / 2
        mujoco.mj_forward(model, data)
        free = before + data.qacc * dt
        rows, kinds = self._contacts()
        if len(kinds):
            solved = np.zeros_like(rows)
            mujoco.mj_solveM(model, data, solved, rows)
            response = rows @ solved.T
            stages = [(len(rows), kinds)]
            corners = 2 * int(kinds.sum())
            restitution = np.full(len(rows), self.scenario.restitution)
            restitution[:corners] = self.table.restitution
            # The corners alone take part in an impact of theirs, not in standing or sliding on the table.
            if self.in_turn and corners and (rows[:corners:2] @ before).min() <= -SLOWEST_IMPACT:
                stages.insert(0, (corners, kinds[kinds == 1]))
            for part, chosen in stages:
                bound = np.maximum(-restitution * (rows @ before), 0.0)[:part]
                own = np.ascontiguousarray(response[:part, :part])
                p, ok = impulses(own, (rows @ free)[:part], bound, chosen, self.table.friction)
                if not ok:
                    return "the impulses of a step have not converged"
                change = p @ solved[:part]
                # The work of impulses: their product with the mean of the velocities before and after.
                work = p @ (rows[:part] @ (free + change / 2))
                self.ledger = max(self.ledger, float(work) / self.saddle)
                free = free + change
                before = before + change
        data.qvel[:] = free
        data.qpos[:] += free * dt / 2
        return ""

    def pose(self) -> tuple[float, float, float]:
        """Return x, y of the middle of the tube [m] and theta [rad]."""
        x, y, theta = self.data.qpos[:TUBE_DOFS]
        return float(x), float(y), float(theta)

    def energy(self) -> float:
        """Return the energy over the table [J], from the engine's mass matrix and the places of its bodies."""
        model, data = self.model, self.data
        mujoco.mj_forward(model, data)
        momentum = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, momentum, data.qvel)
        height = float(model.body_mass[TUBE:] @ data.xipos[TUBE:, 1])
        return float(momentum @ data.qvel) / 2 + self.scenario.gravity * height
