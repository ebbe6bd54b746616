"""When a bottle leaves the hand and when it lands.

A bottle flies as long as one parabola stays on its axis (``parabola``), whatever moves inside; a hand or a table pulls
it off. The flight is the longest stretch of frames for which that holds within noise. Landing is sharper than that:
an impact bends the tracks within one frame, so near the end of the stretch the frame is taken at which two pieces of
smooth motion meet best, if the jump in velocity there stands out of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flipproof.film.tracker.kinematics import MeasuredSpin
from flipproof.film.tracker.parabola import LEAST_POINTS, axis_equations, least_squares
from flipproof.film.tracker.smoothing import BoolArray
from slicemodel.trajectory import FloatArray

FLOOR: Final = 0.003
"""What a stretch may leave beside noise, as part of the bottle's length: so much do lenses and markers off the axis."""

LARGEST: Final = 0.03
"""Beyond this part of the length, nothing in the record flies."""

DEVIATIONS: Final = 3.5
"""Standard deviations by which the frame after the flight misses the parabola."""

LEAST_SIDE: Final = 4
"""Frames on either side of a landing or a release at the least, however slow the camera."""

Index = NDArray[np.int64]


class NoFlightError(ValueError):
    """No stretch of the record is free flight; the message says what to do."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flight:
    """The part of a record in which the bottle flies.

    Parameters
    ----------
    release, landing : [s] - times of the first and the last frame in flight
    inside : bool (P,) - frames from release to landing
    release_how, landing_how : how each was found, in words
    landed : False if the record ends in flight
    cuts : times of the last frames before the motion bends: in the hand and in flight [s]
    """

    release: float
    landing: float
    inside: BoolArray
    release_how: str
    landing_how: str
    landed: bool
    cuts: tuple[float, float]


def find_flight(
    spin: MeasuredSpin,
    *,
    release: float | None = None,
    landing: float | None = None,
    table_height: float | None = None,
    gravity: float | None = None,
) -> Flight:
    """Return the flight of a record; raise NoFlightError if none is found.

    Parameters
    ----------
    release, landing : [s] - given by the user instead of found; outside the record or with few frames: ValueError
    table_height : y of the table in the unit of the tracks; the landing is when the base comes down to it, and a base
        that never does is a ValueError
    gravity : in the unit of the tracks per s^2 if that is known, which tells flight from a hand more sharply
    """
    for name, given in (("release", release), ("landing", landing)):
        if given is not None and not spin.t[0] - spin.frame_time <= given <= spin.t[-1] + spin.frame_time:
            raise ValueError(f"{name} = {given:g} s is outside the record [{spin.t[0]:.4g}, {spin.t[-1]:.4g}] s")
    begin, end = -np.inf if release is None else release - 1e-9, np.inf if landing is None else landing + 1e-9
    points = np.flatnonzero(spin.measured & (spin.t >= begin) & (spin.t <= end)).astype(np.int64)
    if len(points) < LEAST_POINTS:
        raise ValueError(f"the given release and landing leave {len(points)} tracked frames; {LEAST_POINTS} are needed")
    first, last = int(points[0]), int(points[-1])
    landed = landing is not None
    if release is None or landing is None:
        first, last = _stretch(spin, points, gravity)
        landed = landed or last < int(points[-1])
    if landing is not None:
        landing_how = "given"
    elif table_height is not None:
        last, landing_how = _at_table(spin, first, last, table_height)
        landed = True
    elif landed:
        last, landing_how = _sharpened(spin, first, last)
    else:
        landing_how = "the record ends in flight"
    if release is not None:
        release_how = "given"
    elif first == points[0]:
        release_how = "the record begins in flight"
    else:
        first, release_how = _onset(spin, first, last, gravity)
    inside = np.zeros(len(spin.t), dtype=np.bool_)
    inside[first : last + 1] = True
    end = landing if landing is not None else float(spin.t[last])
    return Flight(
        release=release if release is not None else float(spin.t[first]),
        landing=end,
        inside=inside,
        release_how=release_how,
        landing_how=landing_how,
        landed=landed,
        cuts=(float(spin.t[first] - spin.frame_time), end),
    )


def _frames(spin: MeasuredSpin, time: float) -> int:
    """Return the frames of a time [s]: those here are 8 to 14 frames of 240 a second."""
    return max(int(time / spin.frame_time), LEAST_SIDE)


def _noise(spin: MeasuredSpin) -> tuple[float, float]:
    """Return the bottle's length and the noise across its axis, in the unit of the tracks."""
    apart = np.hypot(*(spin.base - spin.cap)[spin.measured].T)
    length = float(np.median(apart))
    return length, 0.8 * spin.theta_noise * length / np.sqrt(2.0)


def _equations(spin: MeasuredSpin, points: Index, gravity: float | None) -> tuple[FloatArray, FloatArray]:
    """Return the axis condition of some frames, without the column of g where gravity is known."""
    matrix, values = axis_equations(spin.t[points] - spin.t[points[0]], spin.cap[points], spin.base[points])
    return (matrix, values) if gravity is None else (matrix[:, :4], values - matrix[:, 4] * gravity)


def _stretch(spin: MeasuredSpin, points: Index, gravity: float | None) -> tuple[int, int]:
    """Return first and last frame of the longest stretch that one parabola fits."""
    length, noise = _noise(spin)
    matrix, values = _equations(spin, points, gravity)
    allowed = max(1.6 * noise, FLOOR * length)
    while (found := _longest(matrix, values, spin.theta[points], allowed)) is None:
        if allowed >= LARGEST * length:
            raise NoFlightError(
                "no stretch of the record is free flight: no parabola stays on the bottle's axis within "
                f"{LARGEST:.0%} of its length; check that y points up and that cap and base are not exchanged, or "
                "name release and landing"
            )
        allowed *= 1.5
    first, last = found
    for _ in range(4):
        trim = (last - first) // 7
        core = slice(first + trim, last + 1 - trim)
        off = _deviations(matrix, values, core, max(0.7 * noise, FLOOR * length / 3))
        wider = _walk(off, core.start, -1), _walk(off, core.stop - 1, +1)
        if wider == (first, last):
            break
        first, last = wider
    return int(points[first]), int(points[last])


def _longest(matrix: FloatArray, values: FloatArray, theta: FloatArray, allowed: float) -> tuple[int, int] | None:
    """Return the longest [first, last] whose best parabola leaves at most ``allowed``, None if there is none."""
    size, unknowns = matrix.shape
    whole = np.column_stack((matrix, values))
    products = np.zeros((size + 1, unknowns + 1, unknowns + 1))
    np.cumsum(whole[:, :, None] * whole[:, None, :], axis=0, out=products[1:])
    edges = np.unique(np.linspace(0, size, min(size + 1, 120)).astype(np.int64))
    first, after = (index.ravel() for index in np.meshgrid(edges, edges, indexing="ij"))
    enough = after - first >= max(2 * LEAST_POINTS, 12)
    first, after = first[enough], after[enough]
    # A bottle that does not turn has no parabola of its own.
    enough = np.abs(theta[after - 1] - theta[first]) >= 1.2
    first, after = first[enough], after[enough]
    if not len(first):
        return None
    sums = products[after] - products[first]
    a, b = sums[:, :-1, :-1], sums[:, :-1, -1]
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("kii->ki", a), 1e-300))
    scaled = a * scale[:, :, None] * scale[:, None, :] + 1e-11 * np.eye(unknowns)
    solution = np.linalg.solve(scaled, (b * scale)[..., None])[..., 0] * scale
    left = np.maximum(sums[:, -1, -1] - np.einsum("ki,ki->k", solution, b), 0.0)
    fits = left <= allowed * allowed * (after - first - unknowns)
    if not fits.any():
        return None
    best = np.lexsort((left, -(after - first)))
    k = int(best[fits[best]][0])
    return int(first[k]), int(after[k]) - 1


def _deviations(matrix: FloatArray, values: FloatArray, core: slice, least: float) -> FloatArray:
    """Return by how many standard deviations every frame misses the parabola of the frames in ``core``."""
    solution, _, rest = least_squares(matrix[core], values[core])
    noise = max(float(np.sqrt(rest @ rest / max(len(rest) - matrix.shape[1], 1))), least)
    spread = np.einsum("ki,ij,kj->k", matrix, np.linalg.pinv(matrix[core].T @ matrix[core]), matrix)
    return np.asarray(np.abs(values - matrix @ solution) / (noise * np.sqrt(1.0 + np.maximum(spread, 0.0))))


def _walk(off: FloatArray, start: int, step: int) -> int:
    """Return the last frame from ``start`` on before three of four frames are off."""
    k = start
    while 0 <= k + step < len(off):
        ahead = off[k + step :: step][:4]
        if (ahead > DEVIATIONS).sum() >= min(3, len(ahead)) and ahead[0] > DEVIATIONS:
            break
        k += step
    return k


def _onset(spin: MeasuredSpin, first: int, last: int, gravity: float | None) -> tuple[int, str]:
    """Return the frame of the release: the onset before which a constant acceleration explains the frames best."""
    hand, near = _frames(spin, 0.0585), _frames(spin, 0.0334)
    frames = np.arange(len(spin.t))
    points = frames[spin.measured & (frames >= first - hand) & (frames <= last)]
    matrix, values = _equations(spin, points, gravity)
    cost = {}
    for k in range(max(first - near, int(points[0])), min(first + 2 * near, last - LEAST_POINTS) + 1):
        before = np.maximum(spin.t[k] - spin.t[points], 0.0)
        pull = 0.5 * matrix[:, :2] * (before * before)[:, None]
        _, _, rest = least_squares(np.column_stack((matrix, pull)), values)
        cost[k] = float(rest @ rest)
    k = min(cost, key=cost.__getitem__)
    noise = cost[k] / max(len(values) - matrix.shape[1] - 3, 1)
    likely = [frame for frame in cost if cost[frame] <= cost[k] + 4 * noise]
    margin = max(k - min(likely), max(likely) - k, 1)
    within = "1 frame" if margin == 1 else f"{margin} frames"
    return k, f"the onset from which the bottle's axis stays on one parabola, to within {within}"


def _sharpened(spin: MeasuredSpin, first: int, last: int) -> tuple[int, str]:
    """Return the frame near ``last`` at which the tracks bend most, if they do, else ``last``."""
    length, _ = _noise(spin)
    signal = np.column_stack((spin.theta * length, spin.cap, spin.base))
    known: BoolArray = np.asarray(~np.isnan(signal).any(axis=1))
    noise = max(spin.theta_noise, 1e-9) * length * np.array([1.0, *[np.sqrt(0.5)] * 4])
    side, near = _frames(spin, 0.0376), _frames(spin, 0.0334)
    found: dict[int, tuple[float, float]] = {}
    for k in range(max(last - 3 * near, first + side), min(last + near, len(spin.t) - side - 1) + 1):
        left, right = np.arange(k - side + 1, k + 1), np.arange(k + 1, k + side + 1)
        left, right = left[known[left]], right[known[right]]
        if min(len(left), len(right)) >= max(side - 2, LEAST_SIDE):
            found[k] = _bend(signal, noise, k + 0.5, left, right)
    sharpest = max(found, key=lambda k: found[k][1], default=last)
    jump = found[sharpest][1] if found else 0.0
    if jump < 2 * DEVIATIONS:
        return last, f"the last frame before the axis leaves the parabola by {DEVIATIONS:g} standard deviations"
    k = min((k for k in found if abs(k - sharpest) <= side // 2), key=lambda k: found[k][0])
    before, after = _rate(spin, np.arange(k - side + 1, k + 1)), _rate(spin, np.arange(k + 1, k + side + 1))
    return k, (
        f"the last frame before the tracks bend (by {min(jump, 999):.0f} standard deviations; omega from {before:.3g} "
        f"to {after:.3g} rad/s), near where the axis leaves the parabola"
    )


def _bend(signal: FloatArray, noise: FloatArray, middle: float, left: Index, right: Index) -> tuple[float, float]:
    """Return what two parabolas on either side leave, and the jump of velocity between them in standard deviations."""
    cost, jump = 0.0, 0.0
    for column, deviation in zip(signal.T, noise, strict=True):
        sides = []
        for index in (left, right):
            matrix = np.vander(index - middle, 3, increasing=True)
            solution = np.linalg.lstsq(matrix, column[index], rcond=None)[0]
            rest = column[index] - matrix @ solution
            cost += float(rest @ rest) / deviation**2
            sides.append((solution[1], np.linalg.inv(matrix.T @ matrix)[1, 1]))
        (before, before_spread), (after, after_spread) = sides
        jump = max(jump, abs(after - before) / (deviation * np.sqrt(before_spread + after_spread)))
    return cost, float(jump)


def _rate(spin: MeasuredSpin, index: Index) -> float:
    index = index[~np.isnan(spin.theta[index])]
    return float(np.polyfit(spin.t[index] - spin.t[index[0]], spin.theta[index], 1)[0])


def _at_table(spin: MeasuredSpin, first: int, last: int, height: float) -> tuple[int, str]:
    """Return the last frame before the base comes down to the table, within noise, nearest to the frame ``last``."""
    y = spin.base[:, 1]
    _, noise = _noise(spin)
    later = np.flatnonzero(~np.isnan(y) & (np.arange(len(y)) >= first))
    level = height + DEVIATIONS * noise
    coming = [int(k) for k, j in pairwise(later) if y[k] > level >= y[j]]
    if not coming:
        raise ValueError(
            f"table_height = {height:g}: the base never comes down to it; after the release its y is in "
            f"[{np.nanmin(y[later]):.4g}, {np.nanmax(y[later]):.4g}]"
        )
    nearest = min(coming, key=lambda k: abs(k - last))
    return nearest, f"the base comes down to the table at y = {height:g}"
