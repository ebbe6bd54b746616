"""Richardson extrapolation: where a value goes as its step goes to zero, with its grid-convergence index."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from slicemodel.trajectory import FloatArray

ORDER_TOLERANCE = 0.5
"""Difference from the expected order beyond which there is no limit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Richardson:
    """The limit of a value as the step goes to zero, from the finest grids alone.

    Parameters
    ----------
    order : float - observed; the expected one if there are two grids; NaN if it could not be found
    value : float - f_1 + (f_1 - f_2) / (r^p - 1), extrapolated to dt = 0
    gci : float - grid-convergence index of the finest grid, an uncertainty in the unit of the value
    ok : bool
    reason : str - why not, or how it was found
    """

    order: float
    value: float
    gci: float
    ok: bool
    reason: str


def richardson(dt: ArrayLike, values: ArrayLike, *, expected_order: float = 1.0) -> Richardson:
    """Extrapolate a value to dt = 0 and give its grid-convergence index (ASME V&V 20).

        gci = S |f_2 - f_1| / (r^p - 1),   r = dt_2 / dt_1,   S = 1.25 for three or more grids, 3 for two

    p comes from the three finest grids, (f_3 - f_2) / (f_2 - f_1) = (dt_3^p - dt_2^p) / (dt_2^p - dt_1^p). Fails if a
    value is not finite, if the values oscillate or part, or if p is more than
    ``ORDER_TOLERANCE`` off the expected order.
    """
    steps, found = np.asarray(dt, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if steps.shape != found.shape or steps.ndim != 1 or len(np.unique(steps)) < max(2, len(steps)):
        raise ValueError("dt and values must be one-dimensional, of one length, with two or more different steps")
    if not np.all(np.isfinite(found)):
        return _no_limit("a value is not finite")
    order = np.argsort(steps)
    h, f = steps[order], found[order]
    if len(h) == 2:
        p, safety, how = expected_order, 3.0, "two grids, order taken for granted"
    else:
        p, safety, how = _order_of_three(h[:3], f[:3]), 1.25, "three finest grids"
        if math.isnan(p):
            product = (f[2] - f[1]) * (f[1] - f[0])
            return _no_limit(
                "oscillation: the value turns back" if product < 0 else "the values do not approach a limit"
            )
    gap = (f[0] - f[1]) / ((h[1] / h[0]) ** p - 1.0)
    if abs(p - expected_order) > ORDER_TOLERANCE:
        word = "high" if p > expected_order else "low"
        how = f"order too {word}: {p:.2f}, not {expected_order:g}"
    return Richardson(
        order=p,
        value=float(f[0] + gap),
        gci=float(safety * abs(gap)),
        ok=abs(p - expected_order) <= ORDER_TOLERANCE,
        reason=how,
    )


def _no_limit(reason: str) -> Richardson:
    return Richardson(order=math.nan, value=math.nan, gci=math.nan, ok=False, reason=reason)


def _order_of_three(h: FloatArray, f: FloatArray) -> float:
    """Return the order that three values show, or NaN."""
    fine, coarse = f[1] - f[0], f[2] - f[1]
    if fine == 0.0 or coarse * fine <= 0.0:
        return math.nan

    def excess(p: float) -> float:
        return float((h[2] ** p - h[1] ** p) / (h[1] ** p - h[0] ** p) - coarse / fine)

    low, high = 1e-3, 20.0
    if excess(low) * excess(high) > 0.0:
        return math.nan
    return float(brentq(excess, low, high))
