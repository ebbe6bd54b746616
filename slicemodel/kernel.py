"""The compiled loop: one pass over the time grid that every scheme feeds with its switches.

All compiled functions live in this one file: numba's cache does not notice a change in a helper elsewhere.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np

from slicemodel.trajectory import FloatArray


def compiled(function: Callable[..., Any]) -> Any:
    """Compile for speed with reproducible sums (no fastmath); without a writable cache, compile in memory."""
    try:
        return numba.njit(function, cache=True, error_model="numpy", nogil=True)
    except RuntimeError as error:
        logging.getLogger(__name__).warning("compiling %s in memory: %s", function.__name__, error)
        return numba.njit(function, error_model="numpy", nogil=True)


class Frame(NamedTuple):
    """Geometry and masses that do not change during a flight (SI)."""

    length: float
    r_min: float
    r_max: float
    slice_mass: float
    bottle_mass: float
    bottle_inertia: float
    omega0: float
    theta0: float
    frozen: bool


class Run(NamedTuple):
    """What the loop returns: arrays over the grid, rebounds, where it stopped, where a slice escaped (or -1)."""

    theta: FloatArray
    omega: FloatArray
    r_cm: FloatArray
    inertia: FloatArray
    rebounds: FloatArray
    points: int
    escape_step: int
    escape_slice: int


@compiled
def step_coefficients(  # type: ignore[no-untyped-def]
    form, constants, omega: float, dt: float
):
    """Return a - 1, b, c, d of the closed-form step (module docstring of ``schemes.form``; Eq. 9c, 9d).

    a is close to 1 for a short step: a - 1 is formed without the subtraction, which would lose the digits that move
    the slice (E C - 1 = expm1(-gamma dt) C + 2 sinh(k dt / 2)^2).
    """
    gamma = constants.gamma
    k = math.sqrt(omega * omega + gamma * gamma) if form.exact_roots else omega
    decay = math.exp(-gamma * dt)
    cosh = math.cosh(k * dt)
    sinh = decay * math.sinh(k * dt)
    half = math.sinh(0.5 * k * dt)
    a_minus_1 = math.expm1(-gamma * dt) * cosh + 2.0 * half * half + constants.gamma_position / k * sinh
    b = sinh / k
    c = (k * k - gamma * gamma) / k * sinh
    d = form.cosh_sign * decay * cosh + form.sinh_sign * gamma / k * sinh
    return a_minus_1, b, c, d


@compiled
def move(  # type: ignore[no-untyped-def]
    r: FloatArray, v: FloatArray, r_new: FloatArray, v_new: FloatArray, coefficients, centre: float, frame
) -> bool:
    """Write the step of every slice to ``r_new``, ``v_new``; return whether any reached an end."""
    a_minus_1, b, c, d = coefficients
    r_min, r_max = frame.r_min, frame.r_max
    reached = 0
    for i in range(len(r)):
        x = r[i] - centre
        moved = r[i] + (a_minus_1 * x + b * v[i])
        v_new[i] = c * x + d * v[i]
        r_new[i] = moved
        reached += int(moved <= r_min) | int(moved >= r_max)
    return reached > 0


@compiled
def rebound(  # type: ignore[no-untyped-def]
    k: int, r: FloatArray, r_new: FloatArray, v_new: FloatArray, form, restitution: float, frame, log, logged: int
):
    """Apply [C.S.] to the slices past an end, log each as (step, slice, end, velocity); return the log and its length.

    The log doubles when full, so a run of any length keeps every rebound.
    """
    for i in range(len(r)):
        x = r_new[i]
        if form.strict:
            end = int(x > frame.r_max) - int(x < frame.r_min)
        else:
            end = int(x >= frame.r_max) - int(x <= frame.r_min)
        if end == 0:
            continue
        if logged == len(log):
            longer = np.empty((2 * logged, 4))
            longer[:logged] = log
            log = longer
        log[logged, 0] = k
        log[logged, 1] = i
        log[logged, 2] = end
        log[logged, 3] = v_new[i]
        logged += 1
        v_new[i] *= -restitution
        if form.keeps_position:
            r_new[i] = r[i]
    return log, logged


@compiled
def first_outside(r: FloatArray, length: float) -> int:
    """Return the first slice outside [0, length], or -1."""
    for i in range(len(r)):
        if r[i] < 0.0 or r[i] > length:
            return i
    return -1


@compiled
def moments(r: FloatArray, v: FloatArray, about: float):  # type: ignore[no-untyped-def]
    """Return sums over slices of (r - about), (r - about)^2 and v.

    Four explicit partial sums each: they run side by side and always add up in the same order.
    """
    n = len(r)
    a0 = a1 = a2 = a3 = 0.0
    b0 = b1 = b2 = b3 = 0.0
    c0 = c1 = c2 = c3 = 0.0
    for i in range(0, n - 3, 4):
        x0, x1, x2, x3 = r[i] - about, r[i + 1] - about, r[i + 2] - about, r[i + 3] - about
        a0, a1, a2, a3 = a0 + x0, a1 + x1, a2 + x2, a3 + x3
        b0, b1, b2, b3 = b0 + x0 * x0, b1 + x1 * x1, b2 + x2 * x2, b3 + x3 * x3
        c0, c1, c2, c3 = c0 + v[i], c1 + v[i + 1], c2 + v[i + 2], c3 + v[i + 3]
    for i in range(n - n % 4, n):
        x = r[i] - about
        a0, b0, c0 = a0 + x, b0 + x * x, c0 + v[i]
    return (a0 + a1) + (a2 + a3), (b0 + b1) + (b2 + b3), (c0 + c1) + (c2 + c3)


@compiled
def inertia_about(frame, n: int, first: float, second: float, offset: float):  # type: ignore[no-untyped-def]
    """Return J (Eq. 11b to 11d) about a point ``offset`` from the middle, from sums taken about the middle."""
    water = frame.slice_mass * (second - offset * (2.0 * first - n * offset))
    return water + frame.bottle_inertia + frame.bottle_mass * offset * offset


@compiled
def fly(form, constants, frame, r, v, steps: int, dt: float) -> Run:  # type: ignore[no-untyped-def]
    """Advance the slices over a uniform grid of ``steps`` points.

    ``r`` and ``v`` have shape (rows, N) with the start in row 0. Step k is written to row k modulo rows:
    ``rows = steps`` keeps everything, ``rows = 2`` only what the next step needs.
    """
    rows, n = r.shape
    theta, omega, r_cm, inertia = np.empty(steps), np.empty(steps), np.empty(steps), np.empty(steps)
    log, logged = np.empty((1024, 4)), 0
    escape_step = escape_slice = -1
    middle = frame.length / 2
    water_share = (1.0 - constants.bottle_share) / n

    first, second, speed = moments(r[0], v[0], middle)
    theta[0], omega[0] = frame.theta0, frame.omega0
    r_cm[0] = middle + water_share * first
    inertia[0] = inertia_about(frame, n, first, second, water_share * first)
    points = 1

    for k in range(1, steps):
        now, new = (k - 1) % rows, k % rows
        w = omega[k - 1]
        if frame.frozen:
            r[new] = r[now]
            v[new] = 0.0
        else:
            centre = r_cm[k - 1] - constants.gravity / (w * w) * math.cos(theta[k - 1])
            if form.follows_cm:
                centre -= 2.0 * constants.gamma / (w * w) * (water_share * speed)
            coefficients = step_coefficients(form, constants, w, dt)
            if move(r[now], v[now], r[new], v[new], coefficients, centre, frame):
                log, logged = rebound(k, r[now], r[new], v[new], form, constants.restitution, frame, log, logged)
                if not form.keeps_position and escape_step < 0:
                    escape_slice = first_outside(r[new], frame.length)
                    escape_step = k if escape_slice >= 0 else -1

        # A lagged program weighs the slices of the step before, about the centre of mass it knew then.
        lagged_first, lagged_second = first, second
        first, second, speed = moments(r[new], v[new], middle)
        if form.lagged:
            r_cm[k] = middle + water_share * lagged_first
            inertia[k] = inertia_about(frame, n, lagged_first, lagged_second, r_cm[k - 1] - middle)
        else:
            r_cm[k] = middle + water_share * first
            inertia[k] = inertia_about(frame, n, first, second, water_share * first)
        omega[k] = inertia[0] * frame.omega0 / inertia[k]
        theta[k] = theta[k - 1] + w * dt
        if not (math.isfinite(omega[k]) and math.isfinite(theta[k]) and math.isfinite(second + speed)):
            break
        points = k + 1

    return Run(
        theta[:points],
        omega[:points],
        r_cm[:points],
        inertia[:points],
        log[:logged],
        points,
        escape_step,
        escape_slice,
    )


def start(r0: FloatArray, rows: int) -> tuple[FloatArray, FloatArray]:
    """Return fresh r and v of shape (rows, N) with the slices at ``r0`` at rest in row 0."""
    r = np.empty((rows, len(r0)))
    v = np.empty((rows, len(r0)))
    r[0] = r0
    v[0] = 0.0
    return r, v
