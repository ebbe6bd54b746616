"""How far two curves are apart, branch by branch.

A jump cuts a curve into branches, which are smooth but for kinks. Jumps that both curves have, a moment apart, pair
their branches, and a value is compared with the other curve's branch of the same pair: linear between its rows, and on
from its last row, or back from its first, where the other curve has already jumped or has not yet. There, and nowhere
else, the moment between the two jumps counts, too, as the slope times its length. A jump without partner does not cut.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flipproof.curves.events import IndexArray, Matched, jumps, listed, match, median_step
from flipproof.curves.files import Curves
from slicemodel.trajectory import FloatArray

SAME_TIME: Final = 1e-12
"""Relative difference of times that printing and reading may cause."""

NEAR_TIME: Final = 1e-3
"""Fraction of a step by which two times may differ at the most and be one.

Where they do, the error of interpolation is what the slope changes meanwhile.
"""


def kept_rows(t: FloatArray, low: float, high: float) -> IndexArray:
    """Return which rows are compared: within the other's times, and of rows at one time the first and the last."""
    ends = (np.diff(t, prepend=-np.inf) > 0) | (np.diff(t, append=np.inf) > 0)
    return np.flatnonzero(ends & (t >= low) & (t <= high))


def on_common_times(
    t: FloatArray, values: FloatArray, times: FloatArray, other_values: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return common times, the first curve's values, the second's at these, and which are interpolated, (K,) each.

    At an event a curve has one value before and one after it; like is compared with like.
    """
    rows = kept_rows(t, times[0], times[-1])
    after = np.diff(t, append=np.inf)[rows] > 0
    t, values = t[rows], values[rows]
    tolerance = min(SAME_TIME * max(abs(times[0]), abs(times[-1])), NEAR_TIME * median_step(times))
    low, high = np.searchsorted(times, t - tolerance, "left"), np.searchsorted(times, t + tolerance, "right") - 1
    coincident = low <= high
    resampled = np.where(after, other_values[high], other_values[np.minimum(low, len(times) - 1)])
    resampled[~coincident] = np.interp(t[~coincident], times, other_values)
    return t, values, resampled, ~coincident


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """|second - first| of one column at the common times, (K,); ``error`` is that of interpolation."""

    t: FloatArray
    first: FloatArray
    second: FloatArray
    size: FloatArray
    error: FloatArray
    interpolated: int
    matched: Matched


def gap(first: Curves, second: Curves, column: str, *, shift: FloatArray, min_jump: float) -> Gap:
    """Return how far two curves are apart in a column.

    Parameters
    ----------
    shift : (P,) - by how much a jump may be early or late beyond one step of the output, at the times of the first
    min_jump : change of the column from which on it may be a jump

    Raises
    ------
    ValueError
        If they share fewer than 2 times.
    """
    values, other_values = first.columns[column], second.columns[column]
    t, left, right, interpolated = on_common_times(first.t, values, second.t, other_values)
    if len(t) < 2:
        raise ValueError(
            f"{first.label} ({first.t[0]:g} to {first.t[-1]:g}) has {len(t)} times within those of {second.label} "
            f"({second.t[0]:g} to {second.t[-1]:g}); at least 2 are needed"
        )
    if first.t_events is not None and second.t_events is not None:
        a, b = listed(first.t, values, first.t_events), listed(second.t, other_values, second.t_events)
    else:
        a, b = jumps(first.t, values, min_jump), jumps(second.t, other_values, min_jump)
    a, b = a.until(t[-1]), b.until(t[-1])
    matched, of_first, of_second = match(a, b, shift[a.row])
    branches = _Branches(second.t, other_values, b.row[of_second])
    side = np.searchsorted(a.row[of_first], kept_rows(first.t, second.t[0], second.t[-1]), "right")
    # The second shows at its rows only what the first would show there.
    seen = np.interp(t, second.t, np.interp(second.t, first.t, values))
    error = np.where(interpolated, np.maximum(branches.interpolation_error(t), np.abs(left - seen)), 0.0)
    size = np.abs(right - left)
    moved, other, slope, beyond = branches.at(t, side)
    right = np.where(moved, other, right)
    moments = np.abs(np.concatenate(([0.0], matched.shift, [0.0])))
    moment = np.maximum(moments[side], moments[side + 1])
    size = np.where(moved, np.maximum(0.0, np.abs(right - left) - np.where(beyond > 0.0, slope * moment, 0.0)), size)
    error = np.where(moved, branches.extrapolation_error(side, beyond), error)
    return Gap(
        t=t, first=left, second=right, size=size, error=error, interpolated=int(interpolated.sum()), matched=matched
    )


class _Branches:
    """Branches of a curve between cuts: linear between rows, and on beyond its first and last."""

    def __init__(self, t: FloatArray, values: FloatArray, cuts: IndexArray) -> None:
        """Cut before each row of ``cuts``."""
        self.t, self.values = t, values
        self.first, self.last = np.concatenate(([0], cuts)), np.concatenate((cuts, [len(t)])) - 1
        h, change = np.diff(t), np.diff(values)
        self.h = h
        self.slopes = np.divide(change, h, out=np.full(len(h), np.nan), where=h > 0.0)
        self.slopes[cuts - 1] = np.nan
        curvature = np.full(len(t), np.nan)
        curvature[1:-1] = 2.0 * np.abs(np.diff(self.slopes)) / np.maximum(t[2:] - t[:-2], np.finfo(float).tiny)
        valid = np.flatnonzero(np.isfinite(curvature))
        # Beside a cut the nearest row of the curve that has a curvature stands for it.
        self.curvature = _nearest(curvature, valid)

    def interpolation_error(self, at: FloatArray) -> FloatArray:
        """Estimate the error of linear interpolation: h^2 / 8 max |y''| of the interval's ends.

        Where y'' changes by more than half from row to row, the curve has a kink or a jump, or is not resolved: it may
        then go on from either end as it does in the interval beside.
        """
        last = len(self.h) - 1
        k = np.clip(np.searchsorted(self.t, at, "right") - 1, 0, last)
        near = self.curvature[np.clip(k[:, None] + np.arange(-1, 3), 0, last + 1)]
        error = self.h[k] ** 2 / 8.0 * near[:, 1:3].max(axis=1)
        changes = np.abs(np.nan_to_num(self.slopes[k, None] - self.slopes[np.clip(k[:, None] + [-1, 1], 0, last)]))
        astray = np.maximum((at - self.t[k]) * changes[:, 0], (self.t[k + 1] - at) * changes[:, 1])
        error = np.where(np.ptp(near, axis=1) > 0.5 * near.max(axis=1), np.maximum(error, astray), error)
        beside = np.minimum(at - self.t[k], self.t[k + 1] - at)
        by_time = beside * np.abs(np.nan_to_num(self.slopes[k]))
        return np.asarray(np.where(beside < NEAR_TIME * self.h[k], np.minimum(error, by_time), error))

    def at(self, t: FloatArray, side: IndexArray) -> tuple[NDArray[np.bool_], FloatArray, FloatArray, FloatArray]:
        """Return where a value is not that between two rows of the branch ``side``, and there the branch's value.

        Also its slope's size, and how far beyond the branch the time lies, 0 at its first and last row; (K,) each.
        """
        low, high = self.t[self.first[side]], self.t[self.last[side]]
        moved = (t <= low) & (side > 0) | (t >= high) & (side < len(self.first) - 1)
        end = np.where(t <= low, self.first[side], self.last[side])
        step = np.where(t <= low, self.first[side], self.last[side] - 1)  # the interval whose slope leads on
        slope = np.nan_to_num(self.slopes[np.clip(step, 0, len(self.slopes) - 1)])
        slope = np.where(self.first[side] == self.last[side], 0.0, slope)
        return moved, self.values[end] + slope * (t - self.t[end]), np.abs(slope), np.abs(t - self.t[end])

    def extrapolation_error(self, side: IndexArray, beyond: FloatArray) -> FloatArray:
        """Estimate the error of values that lie ``beyond`` a branch: |y''| d (d + h) / 2; one row does not lead on."""
        h = median_step(self.t)
        curvature = np.maximum(self.curvature[self.first[side]], self.curvature[self.last[side]])
        unknown = (self.first[side] == self.last[side]) & (beyond > NEAR_TIME * h)
        return np.where(unknown, np.inf, curvature * beyond * (beyond + h) / 2.0)


def _nearest(values: FloatArray, valid: IndexArray) -> FloatArray:
    """Return the values, each that is not valid replaced by the nearest that is; zeros if none is."""
    if not len(valid):
        return np.zeros(len(values))
    rows = np.arange(len(values))
    right = np.clip(np.searchsorted(valid, rows), 0, len(valid) - 1)
    left = np.maximum(right - 1, 0)
    nearer = np.where(np.abs(valid[left] - rows) < np.abs(valid[right] - rows), left, right)
    return np.asarray(values[valid[nearer]])
