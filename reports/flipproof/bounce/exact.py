"""The exact answer: a body under gravity over a floor."""

from __future__ import annotations

import math

import numpy as np

from flipproof.bounce.adapter import FloatArray


def dropped(
    height: float, speed: float, restitution: float, gravity: float, t: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return y [m] and v [m/s], shape (P,) each, at increasing times t [s]; after the last impact the body rests.

    Between impacts y = h + u s - g s^2 / 2; an impact of speed w leaves e w. With g > 0 and e < 1 the impacts end at a
    finite time, after which y = v = 0.
    """
    y, v = np.zeros(len(t)), np.zeros(len(t))
    start, h, u = 0.0, height, speed
    for _ in range(100_000):
        fall = _time_to_floor(h, u, gravity)
        inside = (t >= start) & (t <= start + fall)
        s = t[inside] - start
        y[inside], v[inside] = h + u * s - gravity * s * s / 2, u - gravity * s
        if start + fall >= t[-1]:
            break
        start, h, u = start + fall, 0.0, restitution * math.sqrt(u * u + 2 * gravity * h)
        if u < 1e-12:
            break
    return y, v


def _time_to_floor(h: float, u: float, gravity: float) -> float:
    """Return when a body at height h with upward speed u reaches the floor; infinity if never."""
    if gravity == 0:
        return h / -u if u < 0 else math.inf
    return (u + math.sqrt(u * u + 2 * gravity * h)) / gravity


def rest_time(height: float, restitution: float, gravity: float) -> float:
    """Return when a body dropped at rest has made its last impact: sqrt(2 h / g) (1 + e) / (1 - e) [s]."""
    return math.sqrt(2 * height / gravity) * (1 + restitution) / (1 - restitution)
