"""How fast a small difference grows."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slicemodel.trajectory import FloatArray


class Growth(NamedTuple):
    """Exponential growth rate of a difference [1/s] with its standard error; NaN if it cannot be fitted.

    ``power``: a power of the time since the first row describes it better.
    """

    rate: float = math.nan
    error: float = math.nan
    power: bool = False

    @property
    def clear(self) -> bool:
        """True if the rate differs from zero by more than three standard errors.

        With as few windows as are fitted, noise alone does so in 5 of 100 cases.
        """
        return abs(self.rate) > 3.0 * self.error


def fit_growth(t: FloatArray, size: FloatArray, stop: float = math.inf) -> Growth:
    """Fit |difference| = A exp(rate t) up to ``stop``, robustly.

    A difference changes sign and jumps, so single points and least squares say little. The interval is divided
    into twelve windows with the median of log |difference| in each, and the rate is the median of the slopes between
    all pairs of them (Theil and Sen). Its standard error is that of a straight line whose scatter is the median
    absolute residual, scaled to a normal distribution. Points below round-off or not finite are left out.
    """
    windows, min_points = 12, 4
    size = np.abs(size)
    usable = (t <= stop) & np.isfinite(size) & (size > 1e-14)
    times, logs = t[usable], np.log(size[usable])
    if len(times) < min_points:
        return Growth()
    edges = np.linspace(times[0], times[-1], windows + 1)
    window = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, windows - 1)
    filled = np.unique(window)
    if len(filled) < min_points:
        return Growth()
    x = np.array([times[window == w].mean() for w in filled])
    y = np.array([np.median(logs[window == w]) for w in filled])
    rate, scatter = _line(x, y)
    power = _line(np.log(x - t[0]), y)[1] < scatter
    error = math.sqrt(len(x) / (len(x) - 2)) * scatter / math.sqrt(float(((x - x.mean()) ** 2).sum()))
    return Growth(rate, error, power)


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return the median slope between all pairs of points, and the scatter about a line with it."""
    i, j = np.triu_indices(len(x), 1)
    slope = float(np.median((y[j] - y[i]) / (x[j] - x[i])))
    residual = y - slope * x
    return slope, 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
