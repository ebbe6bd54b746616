"""The tube around a curve: an early jump stays inside, a wrong level leaves it.

    omega |       ____ upper
          |  ____/  __
          |     ___/     lower
          +-------------------- t

At every time the tube reaches from the smallest to the largest value that the reference takes within dt of it, and
dy further. A steep flank may thus come up to dt earlier or later; a level may be off by at most dy.
"""

from __future__ import annotations

import numpy as np

from slicemodel.trajectory import FloatArray


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
