"""The free slices as points (u, w) of a plane that one map moves, their moments, and how a slice enters and leaves."""

from __future__ import annotations

import math

from ode_reference.flow import layout
from ode_reference.flow.layout import ESCAPED, INERTIA, PLACE, SIDE, SPEED, WRONSKIAN
from slicemodel.compiled import inner

set_body = inner(layout.set_body)

ADMISSIBLE = 1e-9
"""Relative error of the Wronskian and of J beyond which a flight is given up; both are some 1e-15."""


@inner
def where(now, points, j):
    """Return y = mean y + A (u - mean u) + B (w - mean w) [m] and y' [m/s] of slice j."""
    a, b = points[PLACE, j] - now.mu, points[SPEED, j] - now.mw
    return now.y_mean + now.A * a + now.B * b, now.dy_mean + now.dA * a + now.dB * b


@inner
def inertia_at(now, a, b, z):
    """Return J = J_c + m (A^2 U + 2 A B P + B^2 V) + (a M_c / M) z^2 [kg m^2]: a sum of squares."""
    spread = a * a * now.U + 2.0 * a * b * now.P + b * b * now.V
    return now.body_inertia + now.slice_mass * spread + now.reduced_mass * z * z


@inner
def inertia_of(now):
    """Return J of the present state."""
    return inertia_at(now, now.A, now.B, now.y_mean - now.centre)


@inner
def set_scales(now):
    """Set omega, the fastest rate of the equations [1/s] and the magnitude of what their terms add up to [m/s^2]."""
    now.omega = now.momentum / inertia_of(now)
    spring = max(now.omega * now.omega, now.kappa)
    now.rate = max(math.sqrt(spring), now.drag_rate)
    now.thrust = 2.0 * now.wall * spring + now.gravity * (1.0 + now.kappa / now.omega / now.omega)


@inner
def mirror(points, marks):
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
def rebase(now, points, marks):
    """Move every free slice to where it is, make the moments anew and start the map here.

    Checks A B' - A' B = exp(-d t), J from the moments against J from the points, and that no slice is outside.
    """
    inertia, expected = inertia_of(now), math.exp(-now.drag_rate * (now.t - now.base_time))
    wronskian, outermost = abs((now.A * now.dB - now.dA * now.B) / expected - 1.0), 0.0
    for i in range(points.shape[1]):
        if marks[SIDE, i] == 0:
            points[PLACE, i], points[SPEED, i] = where(now, points, i)
            outermost = max(outermost, abs(points[PLACE, i]))
    now.A, now.dA, now.B, now.dB = 1.0, 0.0, 0.0, 1.0
    now.base_time, now.free = now.t, 0
    symmetric = now.mirrored and now.on_base == now.on_cap
    if symmetric:
        mirror(points, marks)
    for i in range(points.shape[1]):
        if marks[SIDE, i] == 0:
            enter(now, points, i, points[PLACE, i], points[SPEED, i])
    if symmetric:
        now.y_mean = now.dy_mean = now.mu = now.mw = 0.0
    error = abs(inertia_of(now) / inertia - 1.0)
    now.wronskian_error, now.inertia_error = max(now.wronskian_error, wronskian), max(now.inertia_error, error)
    if not wronskian < ADMISSIBLE:
        now.status = WRONSKIAN
    elif not error < ADMISSIBLE:
        now.status = INERTIA
    elif outermost > now.wall * (1.0 + ADMISSIBLE) + now.tolerance:
        now.status = ESCAPED


@inner
def count(now, points, j, sign):
    """Add slice j to the mean and the moments of the free ones (+1), or take it out of them (-1)."""
    n, a, b = now.free, points[PLACE, j] - now.mu, points[SPEED, j] - now.mw
    now.free += sign
    if n == 0 or now.free == 0:
        now.U = now.P = now.V = 0.0
        return
    share = sign / now.free
    now.U += n * share * a * a
    now.P += n * share * a * b
    now.V += n * share * b * b
    now.mu += share * a
    now.mw += share * b
    now.y_mean += share * (now.A * a + now.B * b)
    now.dy_mean += share * (now.dA * a + now.dB * b)


@inner
def enter(now, points, j, y, v):
    """Give slice j the point (u, w) that the map takes to place y and speed v now, and add it to the free ones."""
    if now.free == 0:
        now.y_mean, now.dy_mean, now.mu, now.mw = y, v, y, v
    dy, dv = y - now.y_mean, v - now.dy_mean
    wronskian = now.A * now.dB - now.dA * now.B
    points[PLACE, j] = now.mu + (now.dB * dy - now.B * dv) / wronskian
    points[SPEED, j] = now.mw + (now.A * dv - now.dA * dy) / wronskian
    count(now, points, j, 1)
