"""Impulses of contacts with Coulomb friction in a given response matrix, compiled: sweeps of Gauss and Seidel.

Of the engines' landing only; nothing of the motion is known here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

MOST_SWEEPS = 5_000
CONVERGED = 1e-11
"""Change of a velocity in a sweep below which the sweeps end [m/s]."""

TOLERATED = 1e-3
"""The same after the last sweep: on two corners at once friction can be shared in many ways, and the sweeps
creep towards one of them."""


def kept_on_disk(function: Callable[..., Any]) -> Any:
    """Compile a function and keep the result on disk; without a writable place, in memory only."""
    try:
        return numba.njit(function, cache=True)
    except RuntimeError:
        return numba.njit(function)


@kept_on_disk
def impulses(response, free, bound, kinds, friction):
    """Return the impulses, shape (rows,), and whether they converged.

    Contact k takes one row (kind 0: a normal) or two (kind 1: a normal and a tangent). Normals: p >= 0, velocity
    free + response p >= bound, product 0. Tangents: |p_t| <= friction p_n, and no slip inside that cone.
    """
    rows = len(free)
    p = np.zeros(rows)
    u = free.copy()
    largest = 0.0
    for _ in range(MOST_SWEEPS):
        largest = 0.0
        k = 0
        for kind in kinds:
            new = max(p[k] + (bound[k] - u[k]) / response[k, k], 0.0)
            if kind == 1:
                new, along = with_friction(p, u, bound[k], response, k, friction)
                change = along - p[k + 1]
                p[k + 1] = along
                u += response[:, k + 1] * change
                largest = max(largest, abs(change) * response[k + 1, k + 1])
            change = new - p[k]
            p[k] = new
            u += response[:, k] * change
            largest = max(largest, abs(change) * response[k, k])
            k += 1 + kind
        if largest < CONVERGED:
            return p, True
    return p, largest < TOLERATED


@numba.njit
def with_friction(p, u, bound, response, k, friction):
    """Return normal and tangential impulse of the contact at rows k, k + 1, the others as they are."""
    nn, nt, tt = response[k, k], response[k, k + 1], response[k + 1, k + 1]
    normal_free = u[k] - nn * p[k] - nt * p[k + 1]
    slip_free = u[k + 1] - nt * p[k] - tt * p[k + 1]
    if normal_free >= bound:
        return 0.0, 0.0
    det = nn * tt - nt * nt
    normal = ((bound - normal_free) * tt + slip_free * nt) / det
    along = (-slip_free * nn - (bound - normal_free) * nt) / det
    if abs(along) <= friction * normal:
        return normal, along
    # On the edge of the cone; of its two sides friction opposes slip on one at most, for moderate coefficients.
    for side in (-1.0, 1.0):
        edge = nn + side * friction * nt
        if edge > 0.0:
            normal = (bound - normal_free) / edge
            if (slip_free + (nt + tt * side * friction) * normal) * side <= 0.0:
                return normal, side * friction * normal
    return (bound - normal_free) / nn, 0.0
