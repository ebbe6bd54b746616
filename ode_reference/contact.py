"""Contact with the two ends: touching, rebound, rest and release.

      cap: side = -1                                        base: side = +1
      r = low = h/2N                                        r = high = L - h/2N
         |o  -->  v > 0 leaves                  v > 0 strikes  -->  o|
         |o  <--  a < 0 presses                 a > 0 presses  -->  o|

A slice is free (side 0) or rests on one side. With ``side`` as sign, side * v > 0 approaches and side * a > 0
presses, at either end. ``a`` is the acceleration of the model, so the model alone decides who rests.

    rebound  by the impact law, the position set exactly on the end
    rest     after a rebound slower than the rest speed if the slice is pressed (side * a >= 0): v = 0, held.
             Restitution below 1 under a steady push makes infinitely many rebounds in finite time; the
             rest speed ends that sequence a time of about 2 (rest speed) / a before its limit.
    release  as soon as side * a < 0, or at once where an impact throws the end out from under the slice

All slices at rest on one end have the same acceleration, so that only two groups decide: who stays is found
by trying the four choices. A choice is right if every group that stays is pressed and every group that leaves is not,
with the mass of the resting body that the choice itself makes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ode_reference.impacts import Law
from ode_reference.motion import BoolArray, Instant, Motion
from slicemodel.trajectory import BASE, CAP, FloatArray

SideArray = NDArray[np.int64]
FREE: Final = 0


@dataclass(frozen=True, slots=True)
class Walls:
    """The two ends as a slice's centre meets them: ``low`` at the cap, ``high`` at the base [m].

    ``tolerance`` [m] is the distance below which round-off cannot tell contact from no contact.
    """

    low: float
    high: float
    tolerance: float

    @classmethod
    def between(cls, low: float, high: float, length: float) -> Walls:
        """Return the walls of a tube of ``length`` [m]; positions carry a few units in the last place of it."""
        return cls(low, high, 64 * float(np.finfo(np.float64).eps) * length)

    def gap(self, side: int, r: float) -> float:
        """Return the distance of a slice at ``r`` from the end ``side`` [m], negative beyond it."""
        return self.high - r if side == BASE else r - self.low

    def struck(self, now: Instant, free: BoolArray) -> SideArray:
        """Return the end that each free slice touches while approaching, 0 where it does neither; shape (N,).

        Two slices that strike at the same time are located at times that differ by round-off: contact is
        also what the slice reaches within four units in the last place of the time.
        """
        reach = np.maximum(self.tolerance, 4 * np.spacing(now.t) * np.abs(now.v))
        at_base = free & (now.v > 0) & (self.high - now.r <= reach)
        at_cap = free & (now.v < 0) & (now.r - self.low <= reach)
        return np.where(at_base, BASE, np.where(at_cap, CAP, FREE))

    def touched(self, r: FloatArray) -> SideArray:
        """Return the end that each slice touches, whatever its velocity, 0 where none; shape (N,)."""
        return np.where(self.high - r <= self.tolerance, BASE, np.where(r - self.low <= self.tolerance, CAP, FREE))


@dataclass(frozen=True, slots=True)
class Outcome:
    """The state after an event: ``y``, the end each slice rests on (``resting``), and how many came to rest or left.

    ``rebounded`` is the state after the impacts, before anything came to rest; ``speed_after`` has one entry per
    struck slice, in the order of the slices [m/s].
    """

    y: FloatArray
    rebounded: FloatArray
    resting: SideArray
    speed_after: FloatArray
    rests: int
    releases: int


def resolve(
    motion: Motion,
    now: Instant,
    struck: SideArray,
    resting: SideArray,
    walls: Walls,
    restitution: float,
    rest_speed: float,
    law: Law,
) -> Outcome:
    """Return the state after all contacts of one instant, resolved together.

    The impact law acts on all touching slices, struck or at rest. Then, with the drag that the new velocities make
    (an impact changes r'_CM discontinuously), slow pressed slices come to rest and unpressed resting ones leave.

    With recoil, coming to rest is a perfectly inelastic impact of its own: all that stick share one impulse with the
    tube, which every other slice feels as a jump. Momentum is conserved; below the rest speed the impulse may pull.

    Parameters
    ----------
    motion : Motion - gives accelerations
    now : Instant - the state before the event; not changed
    struck : array, shape (N,) - side that a free slice strikes now, else 0
    resting : array, shape (N,) - side that a slice rests on before the event, else 0
    walls : Walls
    restitution : float - e
    rest_speed : float [m/s]
    law : callable - of ``ode_reference.impacts``
    """
    n = len(struck)
    ratio = motion.throw.slice_mass / motion.throw.bottle_mass
    y = now.y.copy()
    r, v = y[1 : n + 1], y[n + 1 :]
    contact = struck + resting
    touching = np.flatnonzero(contact)
    side = contact[touching]
    r[touching] = np.where(side == BASE, walls.high, walls.low)
    if struck.any():
        after, gained = law(side * v[touching], side, restitution, ratio, rest_speed)
        v -= gained
        v[touching] = side * after
    mass_ratio = ratio if motion.model.switches.recoil else 0.0
    stays = np.zeros(n, dtype=np.int64)
    slow = np.abs(v[touching]) < rest_speed
    rebounded = y
    if slow.any():
        stays = _staying(motion, y, np.where(slow, side, FREE), touching, mass_ratio)
        y = y.copy()
        y[n + 1 :] = _stuck(v, stays, mass_ratio)
    speed_after = np.abs(y[n + 1 :][struck != FREE])
    rests = int(np.count_nonzero((stays != FREE) & (resting == FREE)))
    releases = int(np.count_nonzero((stays == FREE) & (resting != FREE)))
    return Outcome(y, rebounded, stays, speed_after, rests, releases)


def _stuck(v: FloatArray, stays: SideArray, mass_ratio: float) -> FloatArray:
    """Return the velocities after the slices that stay have stopped relative to the tube, shape (N,) [m/s].

    Momentum of tube and sticking slices: the tube gains (m/M_b) sum v / (1 + n m/M_b), the sum over the n that stick.
    """
    sticking = stays != FREE
    loose = v[sticking]
    v = v.copy()
    if loose.any():
        v -= mass_ratio * float(loose.sum()) / (1.0 + mass_ratio * len(loose))
    v[sticking] = 0.0
    return v


def _staying(
    motion: Motion, y: FloatArray, slow: SideArray, touching: NDArray[np.int64], mass_ratio: float
) -> SideArray:
    """Return the end on which each of the slow touching slices stays, 0 where none; shape (N,).

    Parameters
    ----------
    y : array, shape (2N + 1,) - the state after the impact
    slow : array, shape (K,) - for each touching slice its side if it is slow, else 0
    touching : array, shape (K,)
    mass_ratio : float - m / M_b, 0 without recoil
    """
    n = (len(y) - 1) // 2
    groups = [(side, touching[slow == side]) for side in (BASE, CAP)]
    groups = [(side, members) for side, members in groups if members.size]
    pressed_only: SideArray | None = None
    for choice in product((True, False), repeat=len(groups)):
        stays: SideArray = np.zeros(n, dtype=np.int64)
        for (side, members), stay in zip(groups, choice, strict=True):
            if stay:
                stays[members] = side
        if not any(choice):
            break
        trial = y.copy()
        trial[n + 1 :] = _stuck(y[n + 1 :], stays, mass_ratio)
        _, a = motion.acceleration(trial, np.where(stays == FREE, 1.0, 0.0))
        push = [side * float(a[members[0]]) for side, members in groups]
        if all(force >= 0 for force, stay in zip(push, choice, strict=True) if stay):
            if all(force < 0 for force, stay in zip(push, choice, strict=True) if not stay):
                return stays
            pressed_only = stays if pressed_only is None else pressed_only
    # Rounding at a group that is neither pressed nor pulled can spoil every strict choice.
    return np.zeros(n, dtype=np.int64) if pressed_only is None else pressed_only
