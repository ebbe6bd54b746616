"""A tolerance tube in (t, omega): an early bounce stays inside, a wrong level leaves it.

    omega |       ____ upper
          |  ____/  __
          |     ___/     lower
          +-------------------- t

At every time the tube reaches from the smallest to the largest value that the reference takes within dt of it, and
dy further. A steep flank may so come earlier or later by dt; a level may be off by dy and no more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flipproof.chapters.differences.study import first_crossing
from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """A run held against the tube around a reference: the share of the reference's time at which it is inside.

    It leaves the tube first at ``first_exit`` [s], None if it never does, and is at most ``largest`` outside [rad/s].
    """

    share: float
    first_exit: float | None
    largest: float
    words: str


def study_tube(reference: Trajectory, run: Trajectory, *, dt: float, dy: float) -> Tube:
    """Hold the omega of a run against the tube around that of the reference, both linear between their points.

    Time grids and lengths may differ; ``dt`` [s] and ``dy`` [rad/s] are not negative.
    """
    times = reference.t
    marks = np.concatenate([times, run.t, times - dt, times + dt])
    t = np.unique(marks[(marks >= times[0]) & (marks <= times[-1])])
    lower, upper = tube_around(times, reference.omega, t, dt, dy)
    value = np.interp(t, run.t, run.omega, left=math.nan, right=math.nan)
    outside = np.maximum(value - upper, lower - value)
    outside[np.isnan(outside)] = np.inf  # where the run does not exist
    inside = outside <= 0.0
    held = np.diff(t) * (inside[:-1] & inside[1:]) + np.diff(t) * (inside[:-1] ^ inside[1:]) / 2
    share = float(held.sum() / (t[-1] - t[0])) if len(t) > 1 else float(inside[0])
    first_exit = first_crossing(t, outside, 0.0)
    largest = float(np.maximum(outside[(t >= run.t[0]) & (t <= run.t[-1])], 0.0).max(initial=0.0))
    tube = f"the tube of ±{dt * 1e3:g} ms and ±{dy:.3g} around {reference.label} in omega"
    if first_exit is None:
        words = f"{run.label} stays in {tube}"
    else:
        words = f"{run.label} leaves {tube} at {first_exit * 1e3:.1f} ms, "
        words += f"is inside for {share:.1%} of the time and at most {largest:.3g} outside"
        words += f"; it ends at {run.t[-1] * 1e3:.1f} ms" if run.t[-1] < times[-1] else ""
    return Tube(share=share, first_exit=first_exit, largest=largest, words=words)


def tube_around(
    times: FloatArray, values: FloatArray, at: FloatArray, dt: float, dy: float
) -> tuple[FloatArray, FloatArray]:
    """Return lower and upper bound of the tube at the times ``at``.

    The reference is linear between its points, so over [t - dt, t + dt] it is extreme at a point within or at an end
    of that interval; both are taken, and the bounds are exact. Beyond its ends the reference has no values.
    """
    left, right = np.maximum(at - dt, times[0]), np.minimum(at + dt, times[-1])
    edges = np.interp(np.stack([left, right]), times, values)
    start, stop = np.searchsorted(times, left), np.searchsorted(times, right, side="right")
    some = stop > start
    bounds = []
    for extreme, sign in ((np.minimum, -1.0), (np.maximum, 1.0)):
        bound = extreme(edges[0], edges[1])
        # One more value lets reduceat take the interval that ends with the last point.
        windows = np.stack([start[some], stop[some]], axis=1).ravel()
        within = extreme.reduceat(np.append(values, values[-1]), windows)[::2]
        bound[some] = extreme(bound[some], within)
        bounds.append(bound + sign * dy)
    return bounds[0], bounds[1]
