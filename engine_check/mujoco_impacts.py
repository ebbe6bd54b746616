r"""What happens at the ends of the tube: impacts, rests and releases, from the engine's own mass matrix M.

          cap: side s = -1                    base: s = +1
             |o <-                                -> o|        x = s r' > 0 approaches, u = -x >= 0 leaves
             |<------------- tube ---------------->   |        an impulse p >= 0 presses slice and end apart

An impulse s_i p_i on joint i changes all velocities by M^-1 e_i s_i p_i (e_i: the joint's unit vector), the recoil of
tube and of every other slice included. With B_ij = s_i e_i^T M^-1 e_j s_j over the touching slices, x+ = x - B p.

Law: simultaneous (Newton and Moreau). All slices that touch an end at one instant, those at rest with x = 0 included,
share one linear complementarity problem:

    p_i >= 0,   c_i = (B p)_i - b_i >= 0,   p_i c_i = 0,      b_i = (1 + e) x_i if x_i > 0, else x_i

so that a slice that is pushed leaves at e times its approach, and one that is not leaves at least as fast.
(For x_i < 0, a slice already leaving, the bound is "does not approach" instead of Newton's e x_i < 0, which would
let the tube overrun it.) Slices that strike one after the other are resolved one after the other, at their own times.

Rest. Contact forces obey the same problem with accelerations in place of speeds: forces f >= 0 that leave no outward
acceleration, B f - a >= 0. A slice stays where f_i > 0, held by the engine (``World.clutch``); it is released as soon
as the push on it turns inward. Slices that would end all remaining bounces within ``rest_time`` are stopped
together by impulses that may pull (a perfectly inelastic impact: momentum is conserved, energy falls).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from engine_check.mujoco_world import TUBE_DOFS, World
from slicemodel.trajectory import BASE, CAP, FloatArray, Impacts

TOUCH: Final = 1e-12
"""Distance from an end below which a slice touches it [L]: round-off of a located impact."""

FREE: Final = 0
BLOCK_ROUNDS: Final = 10
ROUND_OFF: Final = 1e-12

IntArray = NDArray[np.int64]


@dataclass(slots=True, eq=False)
class Contacts:
    """The ends of one world: who rests where (``side``, 0 if free), and what has happened so far.

    Parameters
    ----------
    restitution : float
        e.
    rest_time : float
        Time within which remaining bounces are not worth resolving [s].
    """

    world: World
    restitution: float
    rest_time: float
    side: IntArray = field(init=False)
    struck: list[tuple[float, int, int, float, float]] = field(default_factory=list)
    rests: int = 0
    releases: int = 0
    largest_snap: float = 0.0

    def __post_init__(self) -> None:
        self.side = np.zeros(len(self.world.r), dtype=np.int64)

    @property
    def tolerance(self) -> float:
        """Distance from an end below which a slice touches it [m]."""
        return TOUCH * 2.0 * self.world.axis_origin

    def released(self) -> bool:
        """Return whether the present push on some resting slice is inward; evaluates the forces."""
        if not self.side.any():
            return False
        mujoco.mj_forward(self.world.model, self.world.data)
        return bool(np.any(self.side * self.world.a < 0.0))

    def striking(self) -> bool:
        """Return whether a slice touches an end and approaches it."""
        world = self.world
        at_base = (world.high - world.r <= self.tolerance) & (world.v > 0.0)
        at_cap = (world.r - world.low <= self.tolerance) & (world.v < 0.0)
        return bool(np.any((at_base | at_cap) & (self.side == FREE)))

    def beyond(self) -> IntArray:
        """Return for each slice the side on which it is outside the tube, 0 if it is inside; shape (N,)."""
        world = self.world
        return np.asarray((world.r > world.high).astype(np.int64) * BASE + (world.r < world.low).astype(np.int64) * CAP)

    def keep(self, out: IntArray) -> None:
        """Hold slices that a step from their ends, without speed, would drive ``out``: nothing strikes, they rest."""
        still = (self.side == FREE) & (self.world.v == 0.0) & (out != 0)
        self.side = np.where(still, out, self.side)
        self.world.clutch(self.side)
        self.rests += int(np.count_nonzero(still))

    def resolve(self, now: float) -> None:
        """Resolve all contacts of the instant ``now`` [s]: impacts, then who rests."""
        world, model, data = self.world, self.world.model, self.world.data
        before = self.side
        self.side = np.zeros_like(before)
        world.clutch(self.side)
        touching, s = self._touching()
        if touching.size == 0:
            return
        # M without clutches, for the impulses; they do not change the positions, so it serves the rests, too.
        mujoco.mj_fwdPosition(model, data)
        # Stopped by its clutch a slice keeps a speed of about 1e-22 m/s, which is not an approach.
        world.v[before != FREE] = 0.0
        jumps, response = self._responses(touching, s)
        x = s * world.v[touching]
        after = x
        if np.any(x > 0.0):
            bound = np.where(x > 0.0, (1.0 + self.restitution) * x, x)
            impulse = complementary(response, bound)
            data.qvel[:] -= impulse @ jumps
            # The speeds in exact arithmetic, so that a slice at rest which is pushed keeps the speed 0.
            after = np.where(impulse > 0.0, x - bound, np.minimum(x - response @ impulse, 0.0))
            world.v[touching] = s * after
        mujoco.mj_forwardSkip(model, data, mujoco.mjtStage.mjSTAGE_POS, 1)
        members = self._slow(-after, s * world.a[touching], response)
        if members.size:
            self._stop(touching, s, members, jumps, response)
            self.side[touching[members]] = s[members].astype(np.int64)
            world.clutch(self.side)
        final = -s * world.v[touching]
        for k in np.flatnonzero(x > 0.0):
            self.struck.append((now, int(touching[k]), int(s[k]), float(x[k]), max(float(final[k]), 0.0)))
        self.rests += int(np.count_nonzero((before == FREE) & (self.side != FREE)))
        self.releases += int(np.count_nonzero((before != FREE) & (self.side == FREE)))

    def _touching(self) -> tuple[IntArray, FloatArray]:
        """Return the touching slices and their sides, and put them exactly on their ends."""
        world = self.world
        side = np.where(world.high - world.r <= self.tolerance, BASE, 0)
        side = np.where(world.r - world.low <= self.tolerance, CAP, side)
        touching = np.flatnonzero(side)
        end = np.where(side[touching] == BASE, world.high, world.low)
        snap = np.abs(world.r[touching] - end)
        self.largest_snap = max(self.largest_snap, float(snap.max(initial=0.0)))
        world.r[touching] = end
        return touching, side[touching].astype(np.float64)

    def _responses(self, touching: IntArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the rows M^-1 e_i s_i, shape (K, 3 + N), and B, shape (K, K), from the engine's factor of M."""
        world = self.world
        units = np.zeros((len(touching), world.model.nv))
        units[np.arange(len(touching)), TUBE_DOFS + touching] = s
        jumps = np.empty_like(units)
        mujoco.mj_solveM(world.model, world.data, jumps, units)
        return jumps, jumps[:, TUBE_DOFS + touching] * s

    def _slow(self, leaving: FloatArray, push: FloatArray, response: FloatArray) -> IntArray:
        """Return the places of those that are pressed and would end all bounces, 2 u/(a (1 - e)), in ``rest_time``.

        ``push`` is the outward acceleration if nothing rested. What rests on one end drives the tube against what
        touches the other, so that a is taken with the other members held: a_i = B_ii f_i.
        """
        members = np.arange(len(leaving))
        while members.size:
            force = complementary(response[np.ix_(members, members)], push[members])
            pressed, u = np.diag(response)[members] * force, leaving[members]
            ends = (u <= 0.0) | (2.0 * u < (1.0 - self.restitution) * self.rest_time * pressed)
            slow = members[ends & (force > 0.0)]
            if len(slow) == len(members):
                break
            members = slow
        return members

    def _stop(
        self, touching: IntArray, s: FloatArray, members: IntArray, jumps: FloatArray, response: FloatArray
    ) -> None:
        """Bring ``members`` to rest in the tube by one inelastic impact."""
        world = self.world
        x = (s * world.v[touching])[members]
        if x.any():
            impulse = np.linalg.solve(response[np.ix_(members, members)], x)
            world.data.qvel[:] -= impulse @ jumps[members]
        world.v[touching[members]] = 0.0

    def impacts(self) -> Impacts:
        """Return the impacts so far, in order of time."""
        columns = zip(*self.struck, strict=True) if self.struck else ([] for _ in range(5))
        time, which, end, before, after = (np.array(list(column)) for column in columns)
        return Impacts(time, which, end, before, after)


def complementary(matrix: FloatArray, bound: FloatArray) -> FloatArray:
    """Return p >= 0 with c = matrix p - bound >= 0 and p c = 0, for a symmetric positive definite matrix.

    Principal pivoting: guess which p are positive, solve for them, exchange all that have the wrong sign; if ten
    such rounds do not settle it, exchange only the last wrong one, which ends after finitely many (Murty 1974).

    Parameters
    ----------
    matrix : array, shape (K, K)
    bound : array, shape (K,)

    Returns
    -------
    array, shape (K,)
    """
    active = bound > 0.0
    slack = ROUND_OFF * float(np.max(np.abs(bound), initial=0.0))
    p = np.zeros_like(bound)
    for k in range(BLOCK_ROUNDS + 2 ** min(len(bound), 16)):
        p = np.zeros_like(bound)
        if active.any():
            p[active] = np.linalg.solve(matrix[np.ix_(active, active)], bound[active])
        wrong = np.where(active, p < 0.0, matrix @ p - bound < -slack)
        if not wrong.any():
            return p
        if k >= BLOCK_ROUNDS:
            wrong[: np.flatnonzero(wrong)[-1]] = False
        active ^= wrong
    raise ArithmeticError("the impulses of an impact could not be found; the state is not finite")
