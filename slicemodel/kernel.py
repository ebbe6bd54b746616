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


REST_SPEED = 1e-6
"""In-step rebounds: a slice slower than this that its end pushes back stays there [m/s]; it would hop 1e-14 m."""

MOST_HITS = 1000
"""In-step rebounds of one slice in one step after which it is left at the end it hit."""


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


# ---------------------------------------------------------------------- the closed form of one slice


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
def path(form, constants, omega: float, x: float, v: float, t: float):  # type: ignore[no-untyped-def]
    """Return distance from the centre and velocity after time t, from distance x and velocity v."""
    a_minus_1, b, c, d = step_coefficients(form, constants, omega, t)
    return x + (a_minus_1 * x + b * v), c * x + d * v


@compiled
def turning_time(gamma: float, omega: float, x: float, v: float) -> float:
    """Return when the velocity changes sign, or infinity: tanh(k t) = k v / (gamma v - omega^2 x), once at most."""
    k = math.sqrt(omega * omega + gamma * gamma)
    ratio = k * v / (gamma * v - omega * omega * x)
    return math.atanh(ratio) / k if 0.0 < ratio < 1.0 else math.inf


@compiled
def hit_time(  # type: ignore[no-untyped-def]
    form, constants, omega: float, x: float, v: float, wall: float, low: float, high: float
):
    """Return when the path crosses ``wall`` between ``low`` and ``high``, which lie on its two sides.

    Newton's method on the closed form, kept inside the bracket; the path is monotone there.
    """
    side = path(form, constants, omega, x, v, high)[0] - wall
    t = high
    for _ in range(100):
        at, speed = path(form, constants, omega, x, v, t)
        gap = at - wall
        if gap * side > 0.0:
            high = t
        else:
            low = t
        better = t - gap / speed
        if not low < better < high:
            better = 0.5 * (low + high)
        if abs(better - t) <= 1e-16 + 4e-16 * t:
            return better
        t = better
    return t


# ---------------------------------------------------------------------- one step of all slices


@compiled
def logged(log, count: int, time: float, i: int, end: int, v: float):  # type: ignore[no-untyped-def]
    """Append a rebound (time, slice, end, velocity before); the log doubles when full, so that none is lost."""
    if count == len(log):
        longer = np.empty((2 * count, 4))
        longer[:count] = log
        log = longer
    log[count, 0] = time
    log[count, 1] = i
    log[count, 2] = end
    log[count, 3] = v
    return log, count + 1


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
def rebound_on_grid(  # type: ignore[no-untyped-def]
    time: float, r: FloatArray, r_new: FloatArray, v_new: FloatArray, form, restitution: float, frame, log, count: int
):
    """Apply [C.S.] to the slices past an end; return the log of rebounds and its length."""
    for i in range(len(r)):
        x = r_new[i]
        if form.strict:
            end = int(x > frame.r_max) - int(x < frame.r_min)
        else:
            end = int(x >= frame.r_max) - int(x <= frame.r_min)
        if end == 0:
            continue
        log, count = logged(log, count, time, i, end, v_new[i])
        v_new[i] *= -restitution
        if form.keeps_position:
            r_new[i] = r[i]
    return log, count


@compiled
def rebound_in_step(  # type: ignore[no-untyped-def]
    form, constants, frame, omega: float, centre: float, start: float, dt: float, i: int, r: float, v: float, log, count
):
    """Follow one slice through a step with its hits located by the closed form; return r, v, log and its length.

    Coefficients stay frozen over the whole step. A path turns at most once, so the stretch before the turning point and
    the one after it are each searched for the end the slice then moves to.
    """
    elapsed = 0.0
    gamma = constants.gamma
    for _ in range(MOST_HITS):
        x = r - centre
        left = dt - elapsed
        if abs(v) <= REST_SPEED and ((r == frame.r_max and x > 0.0) or (r == frame.r_min and x < 0.0)):
            return r, 0.0, log, count
        at_end, v_end = path(form, constants, omega, x, v, left)
        turn = turning_time(gamma, omega, x, v)
        end = 0
        low, high = 0.0, left
        if turn < left:
            farthest = centre + path(form, constants, omega, x, v, turn)[0]
            if (v > 0.0 and farthest > frame.r_max) or (v < 0.0 and farthest < frame.r_min):
                end, high = (1 if v > 0.0 else -1), turn
            else:
                low = turn
        if end == 0:
            end = int(centre + at_end > frame.r_max) - int(centre + at_end < frame.r_min)
        if end == 0:
            return centre + at_end, v_end, log, count
        wall = frame.r_max if end > 0 else frame.r_min
        tau = hit_time(form, constants, omega, x, v, wall - centre, low, high)
        v_hit = path(form, constants, omega, x, v, tau)[1]
        log, count = logged(log, count, start + elapsed + tau, i, end, v_hit)
        elapsed += tau
        r, v = wall, -constants.restitution * v_hit
    return r, 0.0, log, count


@compiled
def advance(  # type: ignore[no-untyped-def]
    form,
    constants,
    frame,
    r,
    v,
    r_new,
    v_new,
    omega: float,
    centre: float,
    start: float,
    end: float,
    dt: float,
    log,
    count,
):
    """Write one step of all slices with their rebounds to ``r_new``, ``v_new``; return the log and its length."""
    reached = move(r, v, r_new, v_new, step_coefficients(form, constants, omega, dt), centre, frame)
    if form.in_step:
        for i in range(len(r)):
            # A dip through an end and back leaves no trace at the end of the step but a reversed velocity.
            if r_new[i] <= frame.r_min or r_new[i] >= frame.r_max or v[i] * v_new[i] < 0.0:
                r_new[i], v_new[i], log, count = rebound_in_step(
                    form, constants, frame, omega, centre, start, dt, i, r[i], v[i], log, count
                )
    elif reached:
        log, count = rebound_on_grid(end, r, r_new, v_new, form, constants.restitution, frame, log, count)
    return log, count


@compiled
def centre_of_repulsion(  # type: ignore[no-untyped-def]
    form, constants, r_cm: float, v_cm: float, theta: float, omega: float
):
    """Return r* (module docstring of ``schemes.form``)."""
    pull = constants.gravity * math.cos(theta)
    if form.follows_cm:
        pull += 2.0 * constants.gamma * v_cm
    return r_cm - pull / (omega * omega)


# ---------------------------------------------------------------------- the whole flight


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
def fly(form, constants, frame, r, v, t, dt: float) -> Run:  # type: ignore[no-untyped-def]
    """Advance the slices over the uniform grid ``t`` of step ``dt``.

    ``r`` and ``v`` have shape (rows, N) with the start in row 0. Step k is written to row k modulo rows:
    ``rows = len(t)`` keeps everything, ``rows = 2`` only what the next step needs.
    """
    rows, n = r.shape
    steps = len(t)
    theta, omega, r_cm, inertia = np.empty(steps), np.empty(steps), np.empty(steps), np.empty(steps)
    log, count = np.empty((1024, 4)), 0
    unread = np.empty((1024, 4))
    r_end, v_end = np.empty(n), np.empty(n)
    escape_step = escape_slice = -1
    middle = frame.length / 2
    water_share = (1.0 - constants.bottle_share) / n

    first, second, speed = moments(r[0], v[0], middle)
    theta[0], omega[0] = frame.theta0, frame.omega0
    r_cm[0] = middle + water_share * first
    inertia[0] = inertia_about(frame, n, first, second, water_share * first)
    momentum = inertia[0] * frame.omega0
    points = 1

    for k in range(1, steps):
        now, new = (k - 1) % rows, k % rows
        w = omega[k - 1]
        if frame.frozen:
            r[new] = r[now]
            v[new] = 0.0
        else:
            centre = centre_of_repulsion(form, constants, r_cm[k - 1], water_share * speed, theta[k - 1], w)
            if form.midpoint:
                # A step as the exact step would make it predicts the end. Means over the step are then known up to
                # second order, that of v_CM from the way of C_M, because v_CM itself jumps at an impact.
                unread, _ = advance(
                    form, constants, frame, r[now], v[now], r_end, v_end, w, centre, 0.0, 0.0, dt, unread, 0
                )
                end_first, end_second, _ = moments(r_end, v_end, middle)
                way = water_share * (end_first - first)
                mid_theta = theta[k - 1] + 0.5 * dt * w
                w = 0.5 * (w + momentum / inertia_about(frame, n, end_first, end_second, water_share * end_first))
                centre = centre_of_repulsion(form, constants, r_cm[k - 1] + 0.5 * way, way / dt, mid_theta, w)
            log, count = advance(
                form, constants, frame, r[now], v[now], r[new], v[new], w, centre, t[k - 1], t[k], dt, log, count
            )
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
        omega[k] = momentum / inertia[k]
        theta[k] = theta[k - 1] + w * dt
        if not (math.isfinite(omega[k]) and math.isfinite(theta[k]) and math.isfinite(second + speed)):
            break
        points = k + 1

    return Run(
        theta[:points],
        omega[:points],
        r_cm[:points],
        inertia[:points],
        log[:count],
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
