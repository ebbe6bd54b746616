"""Derivatives of a sampled signal as linear maps, so that the noise of the samples passes through them exactly.

Every map is a sparse matrix of shape (P, P) that acts on the samples of the frame grid. Missing samples split the grid
into segments; no map reaches from one segment into another.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import lil_array

from slicemodel.trajectory import FloatArray

BoolArray = NDArray[np.bool_]


def segments(present: BoolArray, starts: Sequence[int] = ()) -> list[tuple[int, int]]:
    """Return first and one past last index of every run of True; a run also ends before each of ``starts``."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], present, [False])).astype(np.int8)))
    found = []
    for begin, end in edges.reshape(-1, 2):
        bounds = [int(begin), *sorted(k for k in set(starts) if begin < k < end), int(end)]
        found += list(pairwise(bounds))
    return found


def interpolation(measured: BoolArray, most_gap: int) -> tuple[Any, BoolArray]:
    """Return the map that fills gaps of at most ``most_gap`` frames, and which samples it fills.

    A filled sample lies on the cubic through the two measured neighbours on either side of its gap; at the ends of the
    record on the polynomial through those that exist. Nothing is extrapolated.

    Returns
    -------
    map : sparse (P, P) - reads measured samples only; rows of longer gaps are empty
    filled : (P,)
    """
    points = np.flatnonzero(measured)
    fill = lil_array((len(measured), len(measured)))
    fill[points, points] = 1.0
    filled = np.zeros(len(measured), dtype=np.bool_)
    for left in np.flatnonzero(np.diff(points) > 1):
        before, after = int(points[left]), int(points[left + 1])
        if after - before - 1 > most_gap:
            continue
        near = [k for k in points[max(left - 1, 0) : left + 3] if before - most_gap - 1 <= k <= after + most_gap + 1]
        for k in range(before + 1, after):
            for j in near:
                others = np.array([other for other in near if other != j], dtype=np.float64)
                fill[k, j] = float(np.prod((k - others) / (j - others)))
            filled[k] = True
    return fill.tocsr(), filled


def local_polynomial(present: BoolArray, window: int, degree: int, derivative: int, starts: Sequence[int] = ()) -> Any:
    """Return the map to the value (0) or the first derivative per sample (1) of a local polynomial (Savitzky-Golay).

    The window stands in the middle where it can. Near the ends of a segment the polynomial of the outermost window is
    read off beside its middle, where it has one degree more: there a parabola misses a curved theta by some ten times
    what it misses in the middle, and the wider band says what that costs. A segment shorter than the window takes
    the largest odd one that fits; below 5 samples, which tell nothing about noise, its rows are empty. ``starts`` begin
    segments of their own.
    """
    operator = lil_array((len(present), len(present)))
    for begin, end in segments(present, starts):
        width = min(window, end - begin - (end - begin + 1) % 2)
        if width < 5:
            continue
        middle = width // 2
        weights = []
        for at in range(width):
            powers = np.vander(np.arange(width) - float(at), degree + (at != middle) + 1, increasing=True)
            weights.append(np.linalg.pinv(powers)[derivative])
        for k in range(begin, end):
            first = min(max(k - middle, begin), end - width)
            operator[k, first : first + width] = weights[k - first]
    return operator.tocsr()


def moving_average(present: BoolArray) -> Any:
    """Return the map to the paper's mean over 5 samples, fewer at the ends of a segment: as many on either side."""
    operator = lil_array((len(present), len(present)))
    for begin, end in segments(present):
        for k in range(begin, end):
            reach = min(2, k - begin, end - 1 - k)
            operator[k, k - reach : k + reach + 1] = 1.0 / (2 * reach + 1)
    return operator.tocsr()


def central_difference(present: BoolArray) -> Any:
    """Return the map to the central difference per sample, one-sided at the ends of a segment."""
    operator = lil_array((len(present), len(present)))
    for begin, end in segments(present):
        if end - begin < 2:
            continue
        for k in range(begin, end):
            left, right = max(k - 1, begin), min(k + 1, end - 1)
            operator[k, right] = 1.0 / (right - left)
            operator[k, left] = -1.0 / (right - left)
    return operator.tocsr()


def spread(operator: Any) -> FloatArray:
    """Return the standard deviation of what a map returns per unit of white noise in its samples; NaN in empty rows."""
    squares = np.asarray(operator.multiply(operator).sum(axis=1)).ravel()
    return np.where(squares > 0, np.sqrt(squares), np.nan)


def apply(operator: Any, samples: FloatArray) -> FloatArray:
    """Return the map of samples; NaN where its row is empty. Samples that no row reads may be NaN."""
    values = np.asarray(operator @ np.nan_to_num(samples)).ravel()
    return np.where(np.isfinite(spread(operator)), values, np.nan)


def noise(samples: FloatArray, measured: BoolArray, window: int) -> float:
    """Return the standard deviation of white noise in measured samples, from what a local cubic leaves of them.

    Robust: 1.4826 times the median of |residual| / sqrt(1 - h), h the weight of a sample in its own smoothed value, so
    that a kink (a release, a landing) does not count as noise.
    """
    smooth = local_polynomial(measured, window, 3, 0)
    own = np.asarray(smooth.diagonal())
    usable = np.isfinite(spread(smooth)) & (own < 1 - 1e-9)
    if not usable.any():
        return float("nan")
    residual = (samples - apply(smooth, samples))[usable] / np.sqrt(1 - own[usable])
    return float(1.4826 * np.median(np.abs(residual)))
