r"""Angle and angular velocity of a bottle from its tracked cap and base.

y                       theta: angle of cap -> base from the downward vertical,
^     cap               tan theta = (x_B - x_C) / (y_C - y_B)                 (Eq. 1)
|       \                by the signs of both, so that the whole circle is told apart;
+---> x   base          omega = d theta/dt > 0 turns counter-clockwise. y is up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from flipproof.film.tracker import smoothing
from flipproof.film.tracker.smoothing import BoolArray, apply, spread
from flipproof.film.tracker.table import TrackTable
from slicemodel.trajectory import FloatArray

WINDOW: Final = 11
"""Frames of the Savitzky-Golay derivative."""

MOST_GAP: Final = 3
"""Longest gap in frames over which theta is interpolated."""

MOST_FRAMES: Final = 20_000
"""Frames of a record at the most: 80 s at 240 frames/s; a flip lasts half a second."""

Numbers = np.ndarray[tuple[int], np.dtype[np.int64]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredSpin:
    """Angle and angular velocity on the uniform frame grid of a video; arrays have shape (P,).

    Parameters
    ----------
    t : [s] - frame times, uniform step ``frame_time``
    theta : [rad] - angle of cap -> base from the downward vertical, unwrapped; NaN inside long gaps
    omega : [rad/s] - Savitzky-Golay derivative of theta; NaN inside long gaps
    band : [rad/s] - one standard deviation of ``omega`` from the noise of theta; neighbours share their noise
    omega_paper, band_paper : [rad/s] - five-point average, then central differences (section 3); its deviation
    interpolated : bool - theta was interpolated over a short gap
    measured : bool - both cap and base were tracked in this frame
    theta_noise : float [rad] - standard deviation of one measured theta, independent from frame to frame
    frame_time : float [s]
    cap, base : shape (P, 2) - tracked positions in the file's length unit; NaN where missing
    lines : int - the file's line of the frame, 0 where it has none
    notes : what was done, in words
    """

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    band: FloatArray
    omega_paper: FloatArray
    band_paper: FloatArray
    interpolated: BoolArray
    measured: BoolArray
    theta_noise: float
    frame_time: float
    cap: FloatArray
    base: FloatArray
    lines: Numbers
    notes: tuple[str, ...] = ()


def omega_from_tracks(
    table: TrackTable,
    *,
    cap: str,
    base: str,
    window: int = WINDOW,
    most_gap: int = MOST_GAP,
    time_unit: float = 1.0,
    cuts: Sequence[float] = (),
) -> MeasuredSpin:
    """Return theta (Eq. 1) and omega of a bottle whose cap and base were tracked.

    Parameters
    ----------
    cap, base : names of the two tracks
    window : odd number of frames of the Savitzky-Golay derivative
    most_gap : longest gap in frames that is interpolated
    time_unit : the file's time unit in seconds
    cuts : times [s] of frames after which the motion may bend, as of a ``Flight``; the derivative does not reach across

    Raises
    ------
    ValueError
        If a track is unknown or both are one, frames are uneven, cap and base coincide, the two were tracked together
        in too few frames, or the bottle may turn unseen in a gap; the message says which and what to do.
    """
    if window < 5 or window % 2 == 0:
        raise ValueError(f"window = {window} is not an odd number of frames in [5, inf)")
    if most_gap < 0:
        raise ValueError(f"most_gap = {most_gap} is outside [0, inf) frames")
    tracks = table.track(cap), table.track(base)
    if tracks[0] is tracks[1]:
        raise ValueError(f"cap and base are both {cap!r}; two tracks are needed")
    frame_time, frames, how = frame_grid(table)
    ends = np.full((2, frames[-1] + 1, 2), np.nan)
    ends[:, frames] = [track.points() for track in tracks]
    lines = np.zeros(frames[-1] + 1, dtype=np.int64)
    lines[frames] = table.lines
    measured: BoolArray = np.asarray(~np.isnan(ends).any(axis=(0, 2)))
    if measured.sum() < window:
        raise ValueError(
            f"{table.source}: {cap} and {base} were tracked together in {measured.sum()} frames; {window} are needed"
        )
    t = (table.t[0] + frame_time * np.arange(len(lines))) * time_unit
    raw = angle(*ends)
    if np.isnan(raw[measured]).any():
        k = int(np.flatnonzero(np.isnan(raw) & measured)[0])
        raise ValueError(f"{table.source}, line {lines[k]}: cap and base are at one point; correct it in Tracker")
    dt = frame_time * time_unit
    fill, filled = smoothing.interpolation(measured, most_gap)
    theta = apply(fill, unwrapped(raw, t, dt, table.source))
    present = measured | filled
    noise = smoothing.noise(theta, measured, window)
    if not noise >= 0.0:
        raise ValueError(
            f"{table.source}: no run of frames with both {cap} and {base} is long enough to tell the noise; track more "
            "frames in a row"
        )
    starts = [int(np.rint((cut - t[0]) / dt)) + 1 for cut in cuts]
    smooth = smoothing.local_polynomial(present, window, 2, 1, starts)
    paper = smoothing.central_difference(present) @ smoothing.moving_average(present)
    notes = [how, f"omega is the derivative of a local polynomial of degree 2 over {window} frames"]
    if filled.any():
        notes.append(
            f"theta was interpolated in {filled.sum()} frames (gaps of at most {most_gap}): cubic through two measured "
            "neighbours on either side"
        )
    if not present.all():
        notes.append(f"{(~present).sum()} frames lie in longer gaps and have no theta")
    return MeasuredSpin(
        t=t,
        theta=theta,
        omega=apply(smooth, theta) / dt,
        band=spread(smooth @ fill) * noise / dt,
        omega_paper=apply(paper, theta) / dt,
        band_paper=spread(paper @ fill) * noise / dt,
        interpolated=filled,
        measured=measured,
        theta_noise=noise,
        frame_time=dt,
        cap=ends[0],
        base=ends[1],
        lines=lines,
        notes=tuple(notes),
    )


def angle(cap: FloatArray, base: FloatArray) -> FloatArray:
    """Return the angle of cap -> base, both (P, 2), from the downward vertical (Eq. 1), shape (P,) in (-pi, pi] [rad].

    NaN where a point is missing or both are one.
    """
    x, y = (base - cap).T
    return np.where(np.hypot(x, y) > 0, np.arctan2(x, -y), np.nan)


def direction(theta: FloatArray) -> FloatArray:
    """Return the unit vectors of cap -> base at angles (P,), shape (P, 2)."""
    return np.column_stack((np.sin(theta), -np.cos(theta)))


def frame_grid(table: TrackTable) -> tuple[float, Numbers, str]:
    """Return the frame time, the frame number of every row, and how the times were read.

    Rows may be missing. The frame time is the slope of a straight line through the times over their frame numbers, so
    that times printed with few digits do not spoil it. Steps that are no multiples of one frame time are refused: a
    camera with variable frame rate.
    """
    t = table.t
    if len(t) < 2:
        raise ValueError(f"{table.source}: has {len(t)} row; a motion needs more")
    steps = np.diff(t)
    usual = float(np.median(steps))
    # The mean of the single steps, because the median of times with few digits is one of two rounded values.
    slope, start = float(steps[steps < 1.5 * usual].mean()), float(t[0])
    frames = np.zeros(len(t), dtype=np.int64)
    for _ in range(2):
        apart = np.rint(steps / slope)
        if apart.min() < 1 or apart.sum() >= MOST_FRAMES:
            k = int(np.argmax(np.abs(steps / usual - 1)))
            raise ValueError(
                f"{table.source}, line {table.lines[k + 1]}: the time steps from {t[k]:g} to {t[k + 1]:g} where "
                f"{usual:g} is usual; export every frame of one clip, at most {MOST_FRAMES} frames"
            )
        frames[1:] = np.cumsum(apart)
        slope, start = (float(value) for value in np.polyfit(frames, t, 1))
    missed = np.abs(t - (start + slope * frames))
    # E notation drops zeros of its own: what most times are rounded to, all may be. A time may miss its frame by what
    # its digits leave open, up to a fifth of the frame time, and by a fiftieth of it whatever its digits.
    printed = 1.1 * np.maximum(table.resolution, np.median(table.resolution))
    excess = missed - np.maximum(np.minimum(printed, 0.2 * slope), 0.02 * slope)
    worst = int(excess.argmax())
    if excess[worst] > 0:
        raise ValueError(
            f"{table.source}, line {table.lines[worst]}: the time {t[worst]:g} misses its frame by "
            f"{missed[worst] / slope:.0%} of the frame time {slope:g}; frames are uneven: record with a constant frame "
            "rate, and export times with more digits"
        )
    return slope, frames, f"times are frame numbers times {slope:.7g}, the mean time between frames"


def unwrapped(raw: FloatArray, t: FloatArray, frame_time: float, source: str) -> FloatArray:
    """Return an angle without jumps of 2 pi: every value takes the turn nearest to what the rate so far predicts.

    ``raw`` (P,) holds angles in any turn [rad], NaN where missing. A gap that is so long at the known rate that the
    number of turns is a guess is refused.
    """
    theta = raw.copy()
    known = np.flatnonzero(~np.isnan(raw))
    for n, k in enumerate(known[1:], start=1):
        before = int(known[n - 1])
        recent = known[max(0, n - 5) : n]
        recent = recent[recent > before - 10]
        rate = float(np.polyfit(recent - before, theta[recent], 1)[0]) if len(recent) > 1 else 0.0
        expected = theta[before] + rate * (k - before)
        theta[k] += 2 * np.pi * np.rint((expected - theta[k]) / (2 * np.pi))
        if k - before > 1 and abs(rate) * (k - before) > np.pi:
            raise ValueError(
                f"{source}: between t = {t[before]:.4g} s and {t[k]:.4g} s the bottle turns unseen by about "
                f"{abs(rate) * (k - before):.1f} rad ({abs(rate) / frame_time:.3g} rad/s), which leaves the number of "
                "turns open; track frames in between"
            )
    return theta
