"""Contact with the two ends: touching, rebound, rest and release.

      cap: side = -1                                        base: side = +1
      r = low = h/2N                                        r = high = L - h/2N
         |o  -->  v > 0 leaves                  v > 0 strikes  -->  o|
         |o  <--  a < 0 presses                 a > 0 presses  -->  o|

A slice is free (side 0) or rests on one side. With ``side`` as sign, side * v > 0 approaches and side * a > 0
presses, at either end. ``a`` is the acceleration of the model, so the model alone decides who rests.

    rebound  v -> -e v, the position set exactly on the end
    rest     after a rebound slower than the rest speed if the slice is pressed (side * a >= 0): v = 0, held.
             Restitution below 1 under a steady push makes infinitely many rebounds in finite time; the
             rest speed ends that sequence a time of about 2 (rest speed) / a before its limit.
    release  as soon as side * a < 0
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ode_reference.models import BoolArray, Instant, Motion
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

    ``speed_after`` has one entry per struck slice, in the order of the slices [m/s].
    """

    y: FloatArray
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
) -> Outcome:
    """Return the state after all contacts of one instant, resolved together.

    Every struck slice rebounds; then, with the drag that the new velocities make (an impact changes r'_CM
    discontinuously), slow pressed ones come to rest and unpressed resting ones are released. The rebound is
    that of a tube too massive to recoil, which is what the paper assumes at any mass.

    Parameters
    ----------
    motion : Motion - gives accelerations
    now : Instant - the state before the event; not changed
    struck : array, shape (N,) - side that a free slice strikes now, else 0
    resting : array, shape (N,) - side that a slice rests on before the event, else 0
    walls : Walls
    restitution : float - e
    rest_speed : float [m/s]
    """
    n = len(struck)
    y = now.y.copy()
    r, v = y[1 : n + 1], y[n + 1 :]
    hits = np.flatnonzero(struck)
    side = struck[hits]
    r[hits] = np.where(side == BASE, walls.high, walls.low)
    v[hits] *= -restitution
    resting = resting.copy()

    _, a = motion.acceleration(y, resting != FREE)
    slow = (np.abs(v[hits]) < rest_speed) & (side * a[hits] >= 0)
    stopped = hits[slow]
    v[stopped] = 0.0
    resting[stopped] = side[slow]

    if stopped.size:
        _, a = motion.acceleration(y, resting != FREE)
    leaving = resting * a < 0
    resting[leaving] = FREE
    return Outcome(y, resting, np.abs(v[hits]), int(stopped.size), int(np.count_nonzero(leaving)))
