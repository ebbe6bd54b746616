"""One slice between the ends of the bottle: the closed-form step, its turning point, and when it reaches an end.

Positions are counted from the middle of the bottle, y = r - L/2: the two ends are one number, and sums of squares lose
no digits. x = y - y* is the distance from the centre of repulsion y*.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slicemodel.compiled import compiled, merged

SERIES = 0.5
"""Arguments below which sinh and cosh are summed up from their series; the first term left out is 5e-17 of the sum."""

ROUNDING = 4e-16
"""Rounding of a sum of two numbers, in units of the larger."""


class Map(NamedTuple):
    """The affine map of one step or several: y' = y + ((a - 1) y + b v + push), v' = c y + d v + pull.

    The centre of repulsion y* contributes push = (1 - a) y* and pull = -c y*.
    """

    a_minus_1: float
    b: float
    c: float
    d: float
    push: float
    pull: float


@merged
def moved(way, y, v):
    """Return y and v after the map ``way``: what moves the slice is summed up before it is added to y."""
    return y + (way.push + way.a_minus_1 * y + way.b * v), way.pull + way.c * y + way.d * v


@merged
def growth_rate_squared(form, constants, omega):
    """Return k^2 (module docstring of ``schemes.form``)."""
    return omega * omega + constants.gamma * constants.gamma if form.exact_roots else omega * omega


@compiled
def hyperbolic(y):
    """Return sinh(x) / x and (cosh(x) - 1) / x^2 of y = x^2, for small x by their series: no root and no quotient."""
    if y < SERIES * SERIES:
        odd = 1.0 / 5040.0 + y * (1.0 / 362880.0 + y * (1.0 / 39916800.0 + y * (1.0 / 6227020800.0)))
        even = 1.0 / 40320.0 + y * (1.0 / 3628800.0 + y * (1.0 / 479001600.0 + y * (1.0 / 87178291200.0)))
        odd, even = 1.0 / 6.0 + y * (1.0 / 120.0 + y * odd), 1.0 / 24.0 + y * (1.0 / 720.0 + y * even)
        return 1.0 + y * odd, 0.5 + y * even
    x = math.sqrt(y)
    half = math.sinh(0.5 * x) / x
    return math.sinh(x) / x, 2.0 * half * half


@merged
def step_map(form, constants, omega, centre, t):
    """Return the map of the closed-form step of any length t about a centre of repulsion."""
    fade_minus_1, fade = math.expm1(-constants.gamma * t), math.exp(-constants.gamma * t)
    return faded_map(form, constants, omega, centre, t, fade_minus_1, fade)


@merged
def faded_map(form, constants, omega, centre, dt, fade_minus_1, fade):
    """Return the map of a step (module docstring of ``schemes.form``; Eq. 9c, 9d), given E - 1 and E = exp(-gamma dt).

    a is close to 1 for a short step: a - 1 is formed without the subtraction, which would lose the digits that move the
    slice (E C - 1 = expm1(-gamma dt) + E (C - 1)).
    """
    gamma = constants.gamma
    k_squared = growth_rate_squared(form, constants, omega)
    y = k_squared * (dt * dt)
    odd, even = hyperbolic(y)
    cosh_minus_1 = y * even
    b = fade * dt * odd
    a_minus_1 = fade_minus_1 + (constants.gamma_position * b + fade * cosh_minus_1)
    c = (k_squared - gamma * gamma) * b
    signed = form.cosh_sign * fade
    d = signed + (form.sinh_sign * gamma * b + signed * cosh_minus_1)
    return Map(a_minus_1, b, c, d, -a_minus_1 * centre, -c * centre)


@compiled
def turning_time(gamma, omega, x, v):
    """Return when the velocity changes sign, or infinity: tanh(k t) = k v / (gamma v - omega^2 x), once at most."""
    k = math.sqrt(omega * omega + gamma * gamma)
    ratio = k * v / (gamma * v - omega * omega * x)
    return math.atanh(ratio) / k if 0.0 < ratio < 1.0 else math.inf


@merged
def first_guess(gamma, omega, x, v, way, end):
    """Return about when a slice moving towards ``end``, at last, has made ``way``: of constant force, then mended once.

    The series of the path to fourth order is off by (k t)^4 / 120 of the way, which one step of Newton squares.
    """
    force = omega * omega * x - 2.0 * gamma * v
    jerk = omega * omega * v - 2.0 * gamma * force
    snap = omega * omega * force - 2.0 * gamma * jerk
    root = end * math.sqrt(max(v * v + 2.0 * force * way, 0.0))
    t = 2.0 * way / (v + root) if end * v > 0.0 else (root - v) / force
    travelled = t * (v + t * (0.5 * force + t * (1.0 / 6.0 * jerk + t * (1.0 / 24.0 * snap))))
    speed = v + t * (force + t * (0.5 * jerk + t * (1.0 / 6.0 * snap)))
    return t - (travelled - way) / speed


@merged
def hit(form, constants, omega, x, v, way, end, high):
    """Return when the path has made ``way`` and goes on towards ``end``, before ``high``, and the velocity then.

    Newton's method on the closed form, kept inside the bracket. The way, not the place, is compared: it keeps its
    digits however short a hop is.
    """
    low = 0.0
    t = first_guess(constants.gamma, omega, x, v, way, end)
    if not low < t < high:
        t = high
    for _ in range(100):
        path = step_map(form, constants, omega, 0.0, t)
        pushed, flown = path.a_minus_1 * x, path.b * v
        gap = (pushed + flown) - way
        speed = path.c * x + path.d * v
        if gap * end > 0.0:
            high = t
        else:
            low = t
        shift = -gap / speed
        better = t + shift
        if not low <= better <= high:
            t = 0.5 * (low + high)
            continue
        force = omega * omega * (x + pushed + flown) - 2.0 * constants.gamma * speed
        # What Newton leaves is shift^2 force / (2 speed); what the gap cannot tell is the rounding of its terms.
        rounding = ROUNDING * (abs(pushed) + abs(flown))
        if shift * shift * abs(force) <= ROUNDING * abs(speed) * better or abs(gap) <= rounding:
            return better, speed + force * shift
        t = better
    return t, speed
