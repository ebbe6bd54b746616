r"""The landing in MuJoCo with its own soft contacts: a box on a plane, slices in slide joints with limits.

A contact and a joint limit are one spring and damper here, x'' = -b x' - k x while x < 0, in acceleration per unit of
the effective mass, with k = wn^2 and b = 2 zeta wn (direct ``solref``). They last pi/wn, half a millisecond, so that
bottle and water push on each other and on the table for a while: that is neither of the two rigid laws, but a third
model. ``zeta`` is found by a drop in the engine at the same step; the textbook's relation between zeta and the
restitution is for a spring that may pull, and misses.

Slices have two stops each ("staggered"): joint limits know no neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Final

import mujoco
import numpy as np

from engine_check.landing import immovable, refuse_misplaced, stops
from engine_check.mujoco_log import no_log
from engine_check.readback import differences, matched
from slicemodel.table import Table, Touch

STIFFNESS: Final = 6000.0
"""wn, natural frequency of a contact [rad/s]: stiffer ones need shorter steps, softer ones sink in by v/wn."""

IMPEDANCE: Final = "0.9999 0.9999 0.001 0.5 2"
"""``solimp``: nearly all of the constraint's force at any depth, so that the spring is linear."""

HIGHEST_RATIO: Final = 3.0
"""Largest damping ratio of a contact: with steps of 2e-5 s and less it rebounds with 0.02, the least there."""

MISSED: Final = 1e-3
"""Largest difference between the restitution asked for and that of a drop."""

quiet: Final = no_log

TUBE: Final = 1
TUBE_DOFS: Final = 3
HEAD: Final = (
    '<mujoco><compiler boundmass="0" boundinertia="0" balanceinertia="true" inertiafromgeom="false" '
    'autolimits="false"/>'
    '<option timestep="{dt!r}" gravity="0 {down!r} 0" integrator="implicitfast" cone="elliptic" impratio="10" '
    'iterations="100" tolerance="1e-12"><flag autoreset="disable"/></option>'
)


def _solref(zeta: float) -> str:
    return f"{-(STIFFNESS**2)!r} {-2 * zeta * STIFFNESS!r}"


@lru_cache
def damping_ratio(restitution: float, dt: float, contact: bool) -> float:
    """Return the damping ratio at which a drop in the engine, with the step ``dt``, rebounds with ``restitution``.

    The rebound falls with the damping ratio until the damping of one step alone turns the velocity back; beyond, it
    rises. The ratio returned lies where it falls.

    Raises
    ------
    ValueError
        If no drop with that step rebounds with ``restitution``, to within ``MISSED``.
    """
    zeta = _on_falling_branch(restitution, dt, contact)
    if not abs(_rebound(zeta, dt, contact) - restitution) <= MISSED:
        least, most = (_rebound(end, dt, contact) for end in (_on_falling_branch(0.0, dt, contact), 0.0))
        raise ValueError(
            f"{'table' if contact else 'scenario'}.restitution = {restitution!r} is outside [{least:.3g}, {most:.3g}], "
            f"with which soft contacts rebound at dt = {dt:g} s"
        )
    return zeta


@lru_cache
def _on_falling_branch(restitution: float, dt: float, contact: bool) -> float:
    """Return the damping ratio of ``restitution``; without one, the end of the branch that comes nearest."""
    low, high = 0.0, HIGHEST_RATIO
    for _ in range(40):
        middle = (low + high) / 2
        rebound = _rebound(middle, dt, contact)
        more = rebound > restitution and _rebound(middle + 1e-3, dt, contact) < rebound
        low, high = (middle, high) if more else (low, middle)
    return (low + high) / 2


def _rebound(zeta: float, dt: float, contact: bool) -> float:
    """Return the speed after over the speed before of a mass that meets a plane, or a joint's limit, at 1 m/s."""
    plane = (
        f'<geom type="plane" size="0 0 1" zaxis="0 1 0" solref="{_solref(zeta)}" solimp="{IMPEDANCE}" priority="1"/>'
    )
    box = '<geom type="box" size="0.05 0.05 0.05"/>'
    limit = f'limited="true" range="0.05 10" solreflimit="{_solref(zeta)}" solimplimit="{IMPEDANCE}"'
    model = mujoco.MjModel.from_xml_string(
        HEAD.format(dt=dt, down=0.0)
        + f"<worldbody>{plane if contact else ''}<body>"
        + f'<joint type="slide" axis="0 1 0" {"" if contact else limit}/>'
        + '<inertial pos="0 0 0" mass="0.5" diaginertia="1 1 1"/>'
        + f"{box if contact else ''}</body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = 0.05 + 0.25 * dt, -1.0
    for _ in range(math.ceil(20.0 / STIFFNESS / dt)):
        mujoco.mj_step(model, data)
    return max(float(data.qvel[0]), 0.0)


def build(touch: Touch, table: Table, dt: float, law: str | None, slices: str) -> World:
    """Return the world at the touch, read back."""
    del law, slices  # one of each
    return World(touch, table, dt)


class World:
    """One bottle over a table, and what ``landing.landed`` asks of it."""

    ledger = None

    def __init__(self, touch: Touch, table: Table, dt: float) -> None:
        scenario, bottle = touch.scenario, touch.scenario.bottle
        self.scenario = scenario
        self.rigid = immovable(scenario)
        if not self.rigid:
            refuse_misplaced(touch, "staggered")
        on_table = damping_ratio(table.restitution, dt, True)
        # Water that cannot move has no limits to strike.
        in_water = 0.0 if self.rigid else damping_ratio(scenario.restitution, dt, False)
        self.model = mujoco.MjModel.from_xml_string(self._text(touch, table, dt, on_table, in_water))
        self.data = mujoco.MjData(self.model)
        height = bottle.length / 2 * abs(math.cos(touch.theta)) + bottle.radius * abs(math.sin(touch.theta))
        self.data.qpos[:TUBE_DOFS] = 0.0, height, touch.theta
        self.data.qvel[:TUBE_DOFS] = *touch.velocity, touch.omega
        if not self.rigid:
            self.data.qpos[TUBE_DOFS:], self.data.qvel[TUBE_DOFS:] = touch.r, touch.v
        self.settings: Mapping[str, object] = {
            "mujoco_version": mujoco.__version__,
            "stiffness": STIFFNESS,
            "damping_ratio_table": on_table,
            "damping_ratio_water": None if self.rigid else in_water,
        }
        self.setup = self._read_back(touch, table, dt)

    def _text(self, touch: Touch, table: Table, dt: float, on_table: float, in_water: float) -> str:
        scenario, bottle = touch.scenario, touch.scenario.bottle
        half, radius, m = bottle.length / 2, bottle.radius, scenario.slice_mass
        own = bottle.mass * (radius**2 / 2 + bottle.length**2 / 12)
        low, high = stops(scenario)
        parts = [
            HEAD.format(dt=dt, down=-scenario.gravity),
            f'<worldbody><geom type="plane" size="0 0 1" zaxis="0 1 0" friction="{table.friction!r} 0 0" condim="3" '
            f'solref="{_solref(on_table)}" solimp="{IMPEDANCE}" priority="1"/>',
            '<body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>',
            '<joint type="hinge" axis="0 0 1"/>',
            f'<inertial pos="0 0 0" mass="{bottle.mass!r}" diaginertia="{own!r} {own!r} {own!r}"/>',
            f'<geom type="box" size="{radius!r} {half!r} {radius!r}"/>',
        ]
        for i, place in enumerate(touch.r.tolist()):
            joint = (
                ""
                if self.rigid
                else f'<joint type="slide" axis="0 -1 0" limited="true" range="{low[i]!r} {high[i]!r}" '
                f'damping="{scenario.drag!r}" solreflimit="{_solref(in_water)}" solimplimit="{IMPEDANCE}"/>'
            )
            parts.append(
                f'<body pos="0 {half - (place if self.rigid else 0.0)!r} 0">{joint}'
                f'<inertial pos="0 0 0" mass="{m!r}" diaginertia="1e-12 1e-12 1e-12"/></body>'
            )
        return "".join(parts) + "</body></worldbody></mujoco>"

    def _read_back(self, touch: Touch, table: Table, dt: float) -> dict[str, float]:
        mujoco.mj_forward(self.model, self.data)
        model, scenario = self.model, self.scenario
        n = 0 if self.rigid else scenario.n_slices
        meant = {
            "total_mass": scenario.total_mass,
            "gravity": scenario.gravity,
            "timestep": dt,
            "friction": table.friction,
            "coordinates": float(TUBE_DOFS + n),
            "limits": float(n),
            "drag": scenario.drag if n else 0.0,
            "centre": float(
                (scenario.slice_mass * touch.r.sum() + scenario.bottle.mass * scenario.bottle.length / 2)
                / scenario.total_mass
            ),
        }
        axis = np.array([math.sin(touch.theta), -math.cos(touch.theta)])
        middle = self.data.xpos[TUBE, :2]
        mean = self.model.body_mass[TUBE:] @ self.data.xipos[TUBE:, :2] / self.model.body_mass[TUBE:].sum()
        held = {
            "total_mass": float(model.body_mass.sum()),
            "gravity": -float(model.opt.gravity[1]),
            "timestep": float(model.opt.timestep),
            "friction": float(model.geom_friction[0, 0]),
            "coordinates": float(model.nv),
            "limits": float(np.count_nonzero(model.jnt_limited)),
            "drag": _linear(model.dof_damping[-1]) if n else 0.0,
            "centre": float((mean - middle) @ axis) + scenario.bottle.length / 2,
        }
        return matched(held, meant, differences(meant, held, {"centre": scenario.bottle.length, "drag": 1e-9}))

    def advance(self) -> str:
        """Make one step; return what left its band, or an empty string."""
        mujoco.mj_step(self.model, self.data)
        return ""

    def pose(self) -> tuple[float, float, float]:
        """Return x, y of the middle of the tube [m] and theta [rad]."""
        x, y, theta = self.data.qpos[:TUBE_DOFS]
        return float(x), float(y), float(theta)

    def energy(self) -> float:
        """Return the energy over the table [J], that of the springs of contacts left out."""
        model, data = self.model, self.data
        mujoco.mj_forward(model, data)
        momentum = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, momentum, data.qvel)
        return float(momentum @ data.qvel) / 2 + self.scenario.gravity * float(
            model.body_mass[TUBE:] @ data.xipos[TUBE:, 1]
        )


def _linear(damping: Any) -> float:
    """Return the linear coefficient of a damping, which newer engines hold as a polynomial."""
    return float(np.atleast_1d(damping)[0])
