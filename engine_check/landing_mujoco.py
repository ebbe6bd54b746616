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

import mujoco
import numpy as np

from engine_check.landing import Watch, immovable, refuse_misplaced, stops
from engine_check.landing_impulses import impulses
from engine_check.mujoco_setup import verify
from engine_check.mujoco_world import TUBE, TUBE_DOFS
from engine_check.mujoco_world import build as release
from engine_check.readback import differences, matched
from slicemodel.table import Table, Touch
from slicemodel.trajectory import FloatArray

CLOSED = 1e-9
"""Gap up to which a slice rests or a corner touches [L]."""


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
        low, high = stops(scenario)
        self.low, self.high = np.array(low), np.array(high)
        half, radius = bottle.length / 2, bottle.radius
        self.corners = np.array([[x, y, 0.0] for y in (-half, half) for x in (-radius, radius)])
        self.jacobian = np.zeros((3, self.model.nv))
        self.settings: Mapping[str, object] = {"mujoco_version": mujoco.__version__, "method": "Moreau-Jean"}
        meant = {"lowest_corner": 0.0, "velocity_x": touch.velocity[0], "velocity_y": touch.velocity[1]}
        mujoco.mj_forward(self.model, self.data)
        held = {
            "lowest_corner": min(self._corner(c)[0] for c in range(4)),
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

    def _corner(self, c: int) -> tuple[float, FloatArray]:
        """Return the height of a corner [m] and the rows of its Jacobian upwards and along x, shape (2, nv)."""
        place = self.data.xpos[TUBE] + self.data.xmat[TUBE].reshape(3, 3) @ self.corners[c]
        mujoco.mj_jac(self.model, self.data, self.jacobian, None, place, TUBE)
        return float(place[1]), self.jacobian[[1, 0]].copy()

    def _contacts(self) -> tuple[FloatArray, list[int]]:
        """Return the Jacobian of all contacts, and their kinds: 1 a corner (two rows), 0 a slice (one row)."""
        rows: list[FloatArray] = []
        kinds: list[int] = []
        slack = CLOSED * self.scenario.bottle.length
        for c in range(4):
            height, both = self._corner(c)
            if height <= slack:
                rows += [both[0], both[1]]
                kinds.append(1)
        if not self.rigid:
            for gap, row in self._gaps():
                if gap <= slack:
                    rows.append(row)
                    kinds.append(0)
        return np.array(rows).reshape(-1, self.model.nv), kinds

    def _gaps(self) -> list[tuple[float, FloatArray]]:
        """Return every gap of a slice [m] with its gradient."""
        r, n, nv = self.data.qpos[TUBE_DOFS:], len(self.low), self.model.nv
        unit = np.eye(nv)[TUBE_DOFS:]
        if not self.chain:
            return [(self.high[i] - r[i], -unit[i]) for i in range(n)] + [
                (r[i] - self.low[i], unit[i]) for i in range(n)
            ]
        rod = self.scenario.slice_height
        between = [(r[i - 1] - r[i] - rod, unit[i - 1] - unit[i]) for i in range(1, n)]
        return [(self.high[0] - r[0], -unit[0]), *between, (r[n - 1] - self.low[n - 1], unit[n - 1])]

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
        if kinds:
            solved = np.zeros_like(rows)
            mujoco.mj_solveM(model, data, solved, rows)
            response = rows @ solved.T
            corners = np.repeat([kind == 1 for kind in kinds], [1 + kind for kind in kinds])
            restitution = np.where(corners, self.table.restitution, self.scenario.restitution)
            for part in [corners, np.ones_like(corners)] if self.in_turn else [np.ones_like(corners)]:
                if not part.any():
                    continue
                # The corners alone take part in an impact of theirs, not in standing on the table.
                if self.in_turn and not part.all() and (rows @ before)[corners].min() > -0.05:
                    continue
                chosen = [kind for kind in kinds if kind == 1] if not part.all() else kinds
                bound = np.maximum(-restitution * (rows @ before), 0.0)[part]
                p, ok = impulses(
                    response[np.ix_(part, part)], (rows @ free)[part], bound, np.array(chosen), self.table.friction
                )
                if not ok:
                    return "the impulses of a step have not converged"
                change = p @ solved[part]
                # The work of impulses: their product with the mean of the velocities before and after.
                work = p @ (rows[part] @ (free + change / 2))
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
