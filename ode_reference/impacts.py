r"""Impacts that move the tube: which impulses act when several slices touch the ends of a light bottle at once.

          cap: side s = -1                    base: s = +1
             |o <-                                -> o|        x = s v > 0 approaches, v = r' relative to the tube
             |<------------ M_b ------------------->  |        an impulse p >= 0 presses slice and end apart

An impulse p_i changes the velocity of slice i by -s_i p_i / m and that of the tube by +P / M_b, P = sum s_j p_j.
Relative to the tube, *every* slice jumps, touching or not:

    v_i+ = v_i- - s_i p_i / m - P / M_b

Momentum is conserved whatever the impulses are. They follow from the law of Newton and Moreau. A law takes the approach
speeds x and the sides of all touching slices, those at rest with x = 0 included; it returns the speeds after the impact
and the velocity P / M_b that the tube gains. docs/theory.md, section 3, says what another law would change.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from slicemodel.trajectory import FloatArray

Law = Callable[[FloatArray, NDArray[np.int64], float, float], tuple[FloatArray, float]]


def immovable(
    x: FloatArray, side: NDArray[np.int64], restitution: float, mass_ratio: float
) -> tuple[FloatArray, float]:
    """Return the rebound of a tube that does not move: x -> -e x for each slice alone (all rungs but the last)."""
    del side, mass_ratio
    return -restitution * x, 0.0


def simultaneous(
    x: FloatArray, side: NDArray[np.int64], restitution: float, mass_ratio: float
) -> tuple[FloatArray, float]:
    """Return the velocities after the impact by the law of Newton and Moreau.

    p_i >= 0,   w_i = -(x_i+ + e x_i-) >= 0,   p_i w_i = 0:  a slice that is pushed leaves with e times its approach
    speed, a slice that is not leaves at least as fast. With x_i+ = x_i- - p_i/m - s_i P/M_b this says

        p_i = m max(0, (1+e) x_i - s_i P/M_b),

    and inserted in P = sum s_i p_i, with V = P/M_b the velocity that the tube gains,

        V = (m/M_b) sum s_i max(0, (1+e) x_i - s_i V).

    The right side falls as V rises, so that there is one solution. It is piecewise linear with a corner where
    s_i V = (1+e) x_i; between the two corners around the solution the equation is linear and is solved exactly.

    Parameters
    ----------
    x : array, shape (K,) - approach speeds relative to the tube [m/s]
    side : array, shape (K,) - +1 on the base, -1 on the cap
    restitution : float - e
    mass_ratio : float - m / M_b

    Returns
    -------
    after : array, shape (K,) - x_i+, none positive [m/s]; exactly -e x_i where p_i > 0
    gained : float - V [m/s]

    Accuracy
    --------
    Round-off; K log K operations. Energy never grows for e <= 1: it changes by
    -(1-e)/(1+e) (1/2) (sum p_i^2 / m + P^2 / M_b), so that e = 1 conserves it however many slices touch.
    """
    corner = (1.0 + restitution) * x
    gained = _tube_velocity(corner, side, mass_ratio)
    pushed = corner - side * gained > 0.0
    # The complement of the formula for p: what is pushed leaves at e x exactly, the rest sees its end run away.
    return np.where(pushed, -restitution * x, np.minimum(x - side * gained, 0.0)), gained


def _tube_velocity(corner: FloatArray, side: NDArray[np.int64], mass_ratio: float) -> float:
    """Return the root V of f(V) = V - (m/M_b) sum s_i max(0, corner_i - s_i V), which rises at least as fast as V."""
    if len(corner) == 1:
        # One slice: p = (1+e) x / (1/m + 1/M_b).
        return float(side[0] * max(corner[0], 0.0) * mass_ratio / (1.0 + mass_ratio))
    # In V, a slice on the base is pushed below its corner, one on the cap above it. Far to the left exactly the base
    # is pushed; crossing a corner to the right drops a slice of the base or adds one of the cap.
    place = side * corner
    order = np.argsort(place, kind="stable")
    place, on_base = place[order], side[order] > 0
    on_cap = ~on_base
    base_sum, cap_sum = np.where(on_base, place, 0.0), np.where(on_cap, place, 0.0)
    # Pushed between corner k-1 and corner k: the base slices from k on, the cap slices before k; f(V) = V (1 + ratio
    # count) - ratio total, where on the cap the summand s max(0, corner - s V) is -(V - place).
    count = np.concatenate([[0], np.cumsum(on_cap)]) + np.concatenate([np.cumsum(on_base[::-1])[::-1], [0]])
    total = np.concatenate([[0.0], np.cumsum(cap_sum)]) + np.concatenate([np.cumsum(base_sum[::-1])[::-1], [0.0]])
    candidates = mass_ratio * total / (1.0 + mass_ratio * count)
    # f <= 0 at every corner left of the root: the root lies in the first interval whose candidate is not beyond its
    # right corner.
    inside = np.flatnonzero(candidates[:-1] <= place)
    return float(candidates[inside[0]] if inside.size else candidates[-1])
