"""Richardson extrapolation: where a value goes as its step goes to zero, with its grid-convergence index."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from slicemodel.trajectory import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Richardson:
    """The limit of a value as the step goes to zero, from the three finest grids alone.

    Parameters
    ----------
    order : float - observed; NaN if it could not be found
    value : float - f_1 + (f_1 - f_2) / (r^p - 1), extrapolated to dt = 0
    gci : float - grid-convergence index of the finest grid, an uncertainty in the unit of the value
    ok : bool
    reason : str - why not, or how it was found
    """

    order: float = math.nan
    value: float = math.nan
    gci: float = math.nan
    ok: bool = False
    reason: str


def richardson(dt: Sequence[float], values: Sequence[float]) -> Richardson:
    """Extrapolate a value of first order to dt = 0 and give its grid-convergence index (ASME V&V 20).

        gci = 1.25 |f_2 - f_1| / (r^p - 1),   r = dt_2 / dt_1

    p comes from the three finest grids, (f_3 - f_2) / (f_2 - f_1) = (dt_3^p - dt_2^p) / (dt_2^p - dt_1^p). Fails if a
    value is not finite, if the values oscillate or part, or if p is more than 0.5 off 1.
    """
    if not np.all(np.isfinite(values)):
        return Richardson(reason="a value is not finite")
    finest = np.argsort(dt)[:3]
    h, f = np.asarray(dt)[finest], np.asarray(values)[finest]
    p = _order_of_three(h, f)
    if math.isnan(p):
        turns_back = (f[2] - f[1]) * (f[1] - f[0]) < 0
        return Richardson(
            reason="oscillation: the value turns back" if turns_back else "the values do not approach a limit"
        )
    gap = (f[0] - f[1]) / ((h[1] / h[0]) ** p - 1.0)
    ok = abs(p - 1.0) <= 0.5
    return Richardson(
        order=p,
        value=float(f[0] + gap),
        gci=float(1.25 * abs(gap)),
        ok=ok,
        reason="three finest grids" if ok else f"order too {'high' if p > 1.0 else 'low'}: {p:.2f}, not 1",
    )


def _order_of_three(h: FloatArray, f: FloatArray) -> float:
    """Return the order that three values show, or NaN."""
    fine, coarse = f[1] - f[0], f[2] - f[1]
    if fine == 0.0 or coarse * fine <= 0.0:
        return math.nan

    def excess(p: float) -> float:
        return float((h[2] ** p - h[1] ** p) / (h[1] ** p - h[0] ** p) - coarse / fine)

    low, high = 1e-3, 20.0
    return math.nan if excess(low) * excess(high) > 0.0 else float(brentq(excess, low, high))
