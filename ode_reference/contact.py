r"""Contact with the two ends: touching, rebound, rest and release.

      cap: side = -1                                        base: side = +1
      r = low = h/2N                                        r = high = L - h/2N
         |o  -->  v > 0 leaves                  v > 0 strikes  -->  o|
         |o  <--  a < 0 presses                 a > 0 presses  -->  o|

A slice is free (side 0) or rests on one side. With ``side`` as sign, side * v > 0 approaches and side * a > 0
presses, at either end. ``a`` is the acceleration of the model, so the model alone decides who rests.

    rebound  by the impact law, the position set exactly on the end
    rest     after a rebound slower than the rest speed u if the slice is pressed (side * a >= 0): v = 0, held.
             Restitution e < 1 under a steady push a makes infinitely many rebounds in finite time; the rest speed
             ends that sequence at most 2 u / (a (1 - e)) before its limit: flights of 2 u / a, 2 e u / a, ...
    release  as soon as side * a < 0, or at once where an impact throws the end out from under the slice

All slices at rest on one end have the same acceleration, so that only two groups decide: who stays is found
by trying the four choices. A choice is right if every group that stays is pressed and every group that leaves is not,
with the mass of the resting body that the choice itself makes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ode_reference.impacts import Law
from ode_reference.motion import BoolArray, Motion
from slicemodel.scenario import Scenario
from slicemodel.trajectory import BASE, CAP, FloatArray

SideArray = NDArray[np.int64]
FREE: Final = 0

TOUCH: Final = 64 * float(np.finfo(np.float64).eps)
"""Distance from an end, as a fraction of L, at which a slice touches it: positions carry a few units in the last
place of L."""

TOUCH_WITH_RECOIL: Final = 1e4 * float(np.finfo(np.float64).eps)
"""The same with recoil. There hits at the same time are one impact, and one after the other they are another; slices
that a symmetry keeps together, on one end or on opposite ones, part by round-off that grows while they fly."""


@dataclass(frozen=True, slots=True)
class Ends:
    """The two ends as a slice's centre meets them: ``low`` at the cap, ``high`` at the base [m].

    ``reach`` [m] is the distance at which an approaching slice touches an end.
    """

    low: float
    high: float
    reach: float

    @classmethod
    def of(cls, scenario: Scenario, *, recoil: bool) -> Ends:
        """Return the ends of the tube of ``scenario``."""
        share = TOUCH_WITH_RECOIL if recoil else TOUCH
        return cls(scenario.r_min, scenario.r_max, share * scenario.bottle.length)

    def beyond(self, side: int, r: FloatArray) -> FloatArray:
        """Return how far ``r`` lies beyond the end ``side`` [m], negative inside."""
        return r - self.high if side == BASE else self.low - r

    def struck(self, t: float, r: FloatArray, v: FloatArray, free: BoolArray) -> SideArray:
        """Return the end that each free slice touches while approaching, 0 where it does neither; shape (N,).

        Contact is also what the slice reaches within four units in the last place of the time.
        """
        reach = np.maximum(self.reach, 4 * np.spacing(t) * np.abs(v))
        at_base = free & (v > 0) & (self.high - r <= reach)
        at_cap = free & (v < 0) & (r - self.low <= reach)
        return np.where(at_base, BASE, np.where(at_cap, CAP, FREE))

    def touched(self, r: FloatArray) -> SideArray:
        """Return the end that each slice touches, whatever its velocity, 0 where none; shape (N,)."""
        return np.where(self.high - r <= self.reach, BASE, np.where(r - self.low <= self.reach, CAP, FREE))


class Outcome(NamedTuple):
    """The state after an event: ``y``, and the end that each slice rests on (``resting``).

    ``rebounded`` is the state after the impacts, before anything came to rest.
    """

    y: FloatArray
    rebounded: FloatArray
    resting: SideArray


def resolve(
    motion: Motion,
    y: FloatArray,
    struck: SideArray,
    resting: SideArray,
    ends: Ends,
    restitution: float,
    rest_speed: float,
    law: Law,
    lets_go: int = FREE,
) -> Outcome:
    """Return the state after all contacts of one instant, resolved together.

    The impact law acts on all touching slices, struck or at rest. Then, with the drag that the new velocities make
    (an impact changes r'_CM discontinuously), slow pressed slices come to rest and unpressed resting ones leave.

    With recoil, coming to rest is a perfectly inelastic impact of its own: all that stick share one impulse with the
    tube, which every other slice feels as a jump. Momentum is conserved; below the rest speed the impulse may pull.

    Parameters
    ----------
    motion : Motion - gives accelerations
    y : array, shape (2N + 1,) - the state before the event; not changed
    struck : array, shape (N,) - side that a free slice strikes now, else 0
    resting : array, shape (N,) - side that a slice rests on before the event, else 0
    ends : Ends
    restitution : float - e
    rest_speed : float [m/s]
    law : callable - of ``ode_reference.impacts``
    lets_go : int - the end whose push has just been found to vanish, even if round-off now calls it a push; else 0
    """
    n = len(struck)
    ratio = motion.throw.slice_mass / motion.throw.bottle_mass
    y = y.copy()
    r, v = y[1 : n + 1], y[n + 1 :]
    touching = np.flatnonzero(struck + resting)
    side = (struck + resting)[touching]
    r[touching] = np.where(side == BASE, ends.high, ends.low)
    if struck.any():
        after, gained = law(np.maximum(side * v[touching], 0.0), side, restitution, ratio)
        v -= gained
        v[touching] = side * after
    slow = np.where(np.abs(v[touching]) < rest_speed, side, FREE)
    groups = [(end, touching[slow == end]) for end in (BASE, CAP) if end != lets_go and (slow == end).any()]
    none_stays = Outcome(y, y, np.zeros(n, dtype=np.int64))
    first: Outcome | None = None
    for choice in list(product((True, False), repeat=len(groups)))[:-1]:
        stays: SideArray = np.zeros(n, dtype=np.int64)
        for (end, members), stay in zip(groups, choice, strict=True):
            stays[members] = end if stay else FREE
        settled = y.copy()
        settled[n + 1 :] = _stuck(v, stays, ratio if motion.model.switches.recoil else 0.0)
        _, a = motion.acceleration(settled, np.where(stays == FREE, 1.0, 0.0))
        pressed = [end * float(a[members[0]]) >= 0 for end, members in groups]
        if all(push for push, stay in zip(pressed, choice, strict=True) if stay):
            # Rounding at a group that is neither pressed nor pulled can spoil every choice in which all is right.
            first = first or Outcome(settled, y, stays)
            if pressed == list(choice):
                return Outcome(settled, y, stays)
    return first or none_stays


def _stuck(v: FloatArray, stays: SideArray, mass_ratio: float) -> FloatArray:
    """Return the velocities after the slices that stay have stopped relative to the tube, shape (N,) [m/s].

    Momentum of tube and sticking slices: the tube gains (m/M_b) sum v / (1 + n m/M_b), the sum over the n that stick.
    """
    sticking = stays != FREE
    loose = v[sticking]
    v = v - mass_ratio * float(loose.sum()) / (1.0 + mass_ratio * len(loose))
    v[sticking] = 0.0
    return v
