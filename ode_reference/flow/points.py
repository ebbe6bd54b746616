"""The free slices as points (u, w) of a plane that one map moves, their moments, and how a slice enters and leaves."""

from __future__ import annotations

import math
from typing import Any

from ode_reference.flow import layout
from ode_reference.flow.layout import ESCAPED, INERTIA, PLACE, SIDE, SPEED, WRONSKIAN, IntArray
from slicemodel.compiled import inner
from slicemodel.trajectory import FloatArray

set_body = inner(layout.set_body)

ADMISSIBLE = 1e-9
"""Relative error of the Wronskian and of J beyond which a flight is given up; both are some 1e-15."""


@inner
def place_of(now: Any, u: float, w: float) -> float:
    """Return y = mean y + A (u - mean u) + B (w - mean w) [m]."""
    return now.y_mean + now.A * (u - now.mu) + now.B * (w - now.mw)  # type: ignore[no-any-return]


@inner
def speed_of(now: Any, u: float, w: float) -> float:
    """Return y' [m/s]."""
    return now.dy_mean + now.dA * (u - now.mu) + now.dB * (w - now.mw)  # type: ignore[no-any-return]


@inner
def inertia_of(now: Any) -> float:
    """Return J = J_c + m (A^2 U + 2 A B P + B^2 V) + (a M_c / M) z^2 [kg m^2]: a sum of squares."""
    spread = now.A * now.A * now.U + 2.0 * now.A * now.B * now.P + now.B * now.B * now.V
    z = now.y_mean - now.centre
    return now.body_inertia + now.slice_mass * spread + now.reduced_mass * z * z  # type: ignore[no-any-return]


@inner
def set_scales(now: Any) -> None:
    """Set omega, the fastest rate of the equations [1/s] and the magnitude of what their terms add up to [m/s^2]."""
    now.omega = now.momentum / inertia_of(now)
    spring = max(now.omega * now.omega, now.kappa)
    now.rate = max(math.sqrt(spring), now.drag_rate)
    now.thrust = 2.0 * now.wall * spring + now.gravity * (1.0 + now.kappa / now.omega / now.omega)


@inner
def start_map(now: Any) -> None:
    """Let the map start here: A = 1, A' = 0, B = 0, B' = 1."""
    now.A, now.dA, now.B, now.dB = 1.0, 0.0, 0.0, 1.0
    now.base_time = now.t


@inner
def mirror(points: FloatArray, marks: IntArray) -> None:
    """Give each free slice and its image at the other end one distance from the middle and one speed.

    What rounding parts them by grows as exp(theta), until their hits, which are one impact, become two.
    """
    n = points.shape[1]
    for i in range((n + 1) // 2):
        j = n - 1 - i
        if marks[SIDE, i] == 0 and marks[SIDE, j] == 0:
            for row in (PLACE, SPEED):
                points[row, i] = (points[row, i] - points[row, j]) / 2.0
                points[row, j] = -points[row, i]


@inner
def rebase(now: Any, points: FloatArray, marks: IntArray) -> None:
    """Move every free slice to where it is, make the moments anew and start the map here.

    Checks A B' - A' B = exp(-d t), J from the moments against J from the points, marks, and that no slice is outside.
    """
    n, outermost = points.shape[1], 0.0
    sum_u = sum_w = 0.0
    inertia = inertia_of(now)
    for i in range(n):
        if marks[SIDE, i] == 0:
            u, w = points[PLACE, i], points[SPEED, i]
            y, v = place_of(now, u, w), speed_of(now, u, w)
            points[PLACE, i], points[SPEED, i] = y, v
            sum_u += y
            sum_w += v
            outermost = max(outermost, abs(y))
    if now.mirrored and now.on_base == now.on_cap:
        mirror(points, marks)
        sum_u = sum_w = 0.0
    expected = math.exp(-now.drag_rate * (now.t - now.base_time))
    wronskian = abs((now.A * now.dB - now.dA * now.B) / expected - 1.0)
    start_map(now)
    if now.free == 0:
        now.U = now.P = now.V = 0.0
        return
    now.mu, now.mw = sum_u / now.free, sum_w / now.free
    now.y_mean, now.dy_mean = now.mu, now.mw
    U = P = V = 0.0
    for i in range(n):
        if marks[SIDE, i] == 0:
            a, b = points[PLACE, i] - now.mu, points[SPEED, i] - now.mw
            U += a * a
            P += a * b
            V += b * b
    now.U, now.P, now.V = U, P, V
    error = abs(inertia_of(now) / inertia - 1.0)
    now.wronskian_error = max(now.wronskian_error, wronskian)
    now.inertia_error = max(now.inertia_error, error)
    if not wronskian < ADMISSIBLE:
        now.status = WRONSKIAN
    elif not error < ADMISSIBLE:
        now.status = INERTIA
    elif outermost > now.wall * (1.0 + ADMISSIBLE):
        now.status = ESCAPED


@inner
def leave(now: Any, u: float, w: float) -> None:
    """Take a slice at (u, w) out of the moments of the free ones."""
    n = now.free
    now.free = n - 1
    if n == 1:
        now.U = now.P = now.V = 0.0
        return
    a, b = u - now.mu, w - now.mw
    f = n / (n - 1.0)
    now.U -= f * a * a
    now.P -= f * a * b
    now.V -= f * b * b
    now.y_mean -= (now.A * a + now.B * b) / (n - 1.0)
    now.dy_mean -= (now.dA * a + now.dB * b) / (n - 1.0)
    now.mu -= a / (n - 1.0)
    now.mw -= b / (n - 1.0)


@inner
def enter(now: Any, points: FloatArray, j: int, y: float, v: float) -> None:
    """Give slice j the point (u, w) that the map takes to place y and speed v now, and add it to the moments."""
    n = now.free
    now.free = n + 1
    if n == 0:
        start_map(now)
        points[PLACE, j], points[SPEED, j] = y, v
        now.y_mean = now.mu = y
        now.dy_mean = now.mw = v
        now.U = now.P = now.V = 0.0
        return
    dy, dv = y - now.y_mean, v - now.dy_mean
    wronskian = now.A * now.dB - now.dA * now.B
    a = (now.dB * dy - now.B * dv) / wronskian
    b = (now.A * dv - now.dA * dy) / wronskian
    points[PLACE, j], points[SPEED, j] = now.mu + a, now.mw + b
    f = n / (n + 1.0)
    now.U += f * a * a
    now.P += f * a * b
    now.V += f * b * b
    now.y_mean += dy / (n + 1.0)
    now.dy_mean += dv / (n + 1.0)
    now.mu += a / (n + 1.0)
    now.mw += b / (n + 1.0)
