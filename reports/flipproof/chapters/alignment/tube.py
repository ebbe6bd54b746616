"""A tolerance tube in (t, y): an early bounce stays inside, a wrong level leaves it.

        y |       ____ upper
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
from numpy.typing import ArrayLike

from flipproof.chapters.differences.study import first_crossing
from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray

SIGNALS = ("omega", "theta", "r_cm", "inertia", "r")
"""What of a trajectory can be held against a tube; "r" is the path of one slice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """A curve held against the tube around a reference, over the time of the reference.

    Parameters
    ----------
    first, second : str
        Labels of the reference and of the run.
    signal : str
        What is compared, such as "omega"; in its own SI unit.
    dt : float [s], dy : float
    t : (P,) [s]
        Times of both curves, and those at which the tube bends.
    reference, lower, upper : (P,)
    value : (P,)
        The run's curve; NaN where it does not exist.
    ended : float or None
        Where a run that does not last as long as the reference ends [s].
    share : float
        Share of the time at which the run is inside.
    first_exit : float or None
        When the run first leaves the tube [s]; None if it never does.
    largest : float
        Largest distance outside the tube where the run exists, 0 if it is inside; infinite if a value is not finite.
    """

    first: str
    second: str
    signal: str
    dt: float
    dy: float
    t: FloatArray
    reference: FloatArray
    lower: FloatArray
    upper: FloatArray
    value: FloatArray
    ended: float | None
    share: float
    first_exit: float | None
    largest: float

    @property
    def inside(self) -> bool:
        """The verdict: True if the run is in the tube as long as the reference lasts."""
        return self.first_exit is None

    @property
    def words(self) -> str:
        """The verdict in words."""
        tube = f"the tube of ±{self.dt * 1e3:g} ms and ±{self.dy:.3g} around {self.first}"
        if self.first_exit is None:
            return f"{self.second} stays in {tube} in {self.signal}"
        words = f"{self.second} leaves {tube} in {self.signal} at {self.first_exit * 1e3:.1f} ms, "
        words += f"is inside for {self.share:.1%} of the time and at most {self.largest:.3g} outside"
        return words + (f"; it ends at {self.ended * 1e3:.1f} ms" if self.ended is not None else "")


def study_tube(
    reference: Trajectory,
    run: Trajectory,
    *,
    dt: float,
    dy: float,
    signal: str = "omega",
    of_slice: int = 0,
) -> Tube:
    """Hold one signal of a run against the tube around the same signal of the reference.

    Parameters
    ----------
    reference, run : Trajectory
        Time grids and lengths may differ.
    dt : float [s], dy : float, in the unit of the signal
    signal : str
        One of SIGNALS.
    of_slice : int
        The slice whose path is compared if the signal is "r".

    Raises
    ------
    ValueError
        If the signal is unknown, a tolerance is negative or a run has no slice paths.
    """
    curves = [signal_of(one, signal, of_slice) for one in (reference, run)]
    return hold_against_tube(
        reference.t,
        curves[0],
        run.t,
        curves[1],
        dt=dt,
        dy=dy,
        labels=(reference.label, run.label),
        signal=f"r of slice {of_slice}" if signal == "r" else signal,
    )


def signal_of(run: Trajectory, signal: str, of_slice: int = 0) -> FloatArray:
    """Return one signal of a run, shape (P,)."""
    if signal not in SIGNALS:
        raise ValueError(f"signal = {signal!r} is unknown; known: {', '.join(SIGNALS)}")
    if signal != "r":
        return np.asarray(getattr(run, signal))
    if not 0 <= of_slice < run.scenario.n_slices:
        raise ValueError(f"of_slice = {of_slice} is outside [0, {run.scenario.n_slices - 1}]")
    if len(run.r) == 0:
        raise ValueError(f"{run.label} was stored without slice paths, so signal = 'r' cannot be compared")
    return run.r[:, of_slice]


def hold_against_tube(
    times: FloatArray,
    reference: FloatArray,
    run_times: FloatArray,
    run: ArrayLike,
    *,
    dt: float,
    dy: float,
    labels: tuple[str, str] = ("reference", "run"),
    signal: str = "y",
) -> Tube:
    """Hold a curve, linear between its points, against the tube around another; see ``study_tube``."""
    if not (dt >= 0 and dy >= 0):
        raise ValueError(f"dt = {dt!r} s and dy = {dy!r} must not be negative")
    marks = np.concatenate([times, run_times, times - dt, times + dt])
    t = np.unique(marks[(marks >= times[0]) & (marks <= times[-1])])
    lower, upper = tube_around(times, reference, t, dt, dy)
    value = np.interp(t, run_times, np.asarray(run, dtype=np.float64), left=math.nan, right=math.nan)
    exists = (t >= run_times[0]) & (t <= run_times[-1])
    outside = np.maximum(value - upper, lower - value)
    # Written so that NaN is outside: a value that is none agrees with nothing.
    outside[~np.isfinite(outside)] = np.inf
    inside = outside <= 0.0
    held = np.diff(t) * (inside[:-1] & inside[1:]) + np.diff(t) * (inside[:-1] ^ inside[1:]) / 2
    return Tube(
        first=labels[0],
        second=labels[1],
        signal=signal,
        dt=dt,
        dy=dy,
        t=t,
        reference=np.interp(t, times, reference),
        lower=lower,
        upper=upper,
        value=value,
        ended=float(run_times[-1]) if run_times[-1] < times[-1] else None,
        share=float(held.sum() / (t[-1] - t[0])) if len(t) > 1 else float(inside[0]),
        first_exit=first_crossing(t, outside, 0.0),
        largest=float(np.maximum(outside[exists], 0.0).max(initial=0.0)),
    )


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
