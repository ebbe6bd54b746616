"""The order at which errors fall with the step, across events.

If events are handled on the grid only, the error of one run depends on where in its step the event falls: single runs
scatter by more than a factor of two. Each step is therefore an ensemble of runs with other phases, whose mean square
error has an order.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

ROUND_OFF: Final = 1e-13
"""Relative error at which an order means nothing."""


def observed_order(step: ArrayLike, error: ArrayLike, floor: float = ROUND_OFF) -> tuple[float, float]:
    """Fit log(rms error) = p log(step) + c over the levels; return p and its standard error.

    NaN for both if there are fewer than 3 levels, an error is not finite, or errors reach ``floor``.

    Parameters
    ----------
    step, error : (K,) or (K, M) - K levels of M phases each
    """
    step, error = (np.reshape(values, (len(np.asarray(values)), -1)) for values in (step, error))
    if len(step) < 3 or not np.all(np.isfinite(error)) or error.min() < floor:
        return math.nan, math.nan
    x = np.log(step).mean(axis=1)
    y = 0.5 * np.log((error**2).mean(axis=1))
    x = x - x.mean()
    slope = float((x @ y) / (x @ x))
    residual = y - y.mean() - slope * x
    variance = float(residual @ residual) / (len(x) - 2)
    return slope, float(np.sqrt(variance / (x @ x)))
