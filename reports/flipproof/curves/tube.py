"""The tube around a curve: an early jump stays inside, a wrong level leaves it.

    omega |       ____ upper
          |  ____/  __
          |     ___/     lower
          +-------------------- t

At every time the tube reaches from the smallest to the largest value that the reference takes within dt of it, and
dy further. A steep flank may thus come up to dt earlier or later; a level may be off by at most dy.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flipproof.curves.growth import first_crossing
from slicemodel.trajectory import FloatArray


class Held(NamedTuple):
    """A curve compared with the tube around another: the share of the other's time that it spends inside.

    It first leaves the tube at ``first_exit``, None if never, and is outside by ``largest`` at most.
    """

    share: float
    first_exit: float | None
    largest: float


def hold(times: FloatArray, values: FloatArray, at: FloatArray, curve: FloatArray, *, dt: float, dy: float) -> Held:
    """Compare a curve (``at``, ``curve``) with the tube around (``times``, ``values``), both linear between points.

    ``dt`` and ``dy`` are not negative; where the curve does not exist it counts as outside.
    """
    corners = np.concatenate([times, at, times - dt, times + dt])
    t = np.unique(corners[(corners >= times[0]) & (corners <= times[-1])])
    lower, upper = tube_around(times, values, t, dt, dy)
    value = np.interp(t, at, curve, left=math.nan, right=math.nan)
    outside = np.maximum(value - upper, lower - value)
    outside[np.isnan(outside)] = np.inf  # where the run does not exist
    inside = outside <= 0.0
    durations = np.diff(t) * (inside[:-1] & inside[1:]) + np.diff(t) * (inside[:-1] ^ inside[1:]) / 2
    share = float(durations.sum() / (t[-1] - t[0])) if len(t) > 1 else float(inside[0])
    first_exit = first_crossing(t, outside, 0.0)
    largest = float(np.maximum(outside[(t >= at[0]) & (t <= at[-1])], 0.0).max(initial=0.0))
    return Held(share, first_exit, largest)


def tube_around(
    times: FloatArray, values: FloatArray, at: FloatArray, dt: float, dy: float
) -> tuple[FloatArray, FloatArray]:
    """Return lower and upper bound of the tube at the times ``at``.

    The reference is linear between its points, so over [t - dt, t + dt] it is extreme at a point within or at an end
    of that interval; both are used, and the bounds are exact. Beyond its ends the reference has no values.
    """
    left, right = np.maximum(at - dt, times[0]), np.minimum(at + dt, times[-1])
    edges = np.interp(np.stack([left, right]), times, values)
    start, stop = np.searchsorted(times, left), np.searchsorted(times, right, side="right")
    nonempty = stop > start
    bounds = []
    for extreme, sign in ((np.minimum, -1.0), (np.maximum, 1.0)):
        bound = extreme(edges[0], edges[1])
        # One more value lets reduceat take the interval that ends with the last point.
        windows = np.stack([start[nonempty], stop[nonempty]], axis=1).ravel()
        within = extreme.reduceat(np.append(values, values[-1]), windows)[::2]
        bound[nonempty] = extreme(bound[nonempty], within)
        bounds.append(bound + sign * dy)
    return bounds[0], bounds[1]
