"""Taylor series in time of theta, A, B and z: order chosen per step, the series itself is the solution in the step."""

from __future__ import annotations

import math

from slicemodel.compiled import inner

MAX_ORDER = 30
"""Highest order; a step whose terms do not vanish by then is made shorter."""

TRUNCATION = 1e-17
"""Terms below this, twice in a row, end the series: of A, of B times the rate, of z over the wall, and of theta."""

ROWS = 14
A, B, Z, THETA, OMEGA, SQUARE, J, FORCE, PULL, U_A, V_B, COS, SIN, SHARE = range(ROWS)
"""Rows of the table: k^2 is SQUARE, f is FORCE, k^2 z is PULL, 1 - kappa J^2/L^2 is SHARE."""


@inner
def product(table, first, second, k):
    """Return the coefficient k of the product of two rows."""
    total = 0.0
    for j in range(k + 1):
        total += table[first, j] * table[second, k - j]
    return total


@inner
def expand(now, table, h):
    """Fill the table with Taylor coefficients times h^k; return whether the series ends before MAX_ORDER.

    Sets ``order``, and the sums of the magnitudes of what A, B and z have beyond the straight line.
    """
    table[A, 0], table[A, 1] = now.A, h * now.dA
    table[B, 0], table[B, 1] = now.B, h * now.dB
    table[Z, 0], table[Z, 1] = now.y_mean - now.centre, h * now.dy_mean
    table[THETA, 0], table[COS, 0], table[SIN, 0] = now.theta, math.cos(now.theta), math.sin(now.theta)
    weight = now.weight if now.free > 0 else 0.0
    small, now.h = 0, h
    now.rest_A = now.rest_B = now.rest_z = 0.0
    for k in range(MAX_ORDER - 1):
        unit, p = 1.0 if k == 0 else 0.0, k + 1
        # J, omega = L/J and k^2 = omega^2 - kappa.
        table[U_A, k] = now.U * table[A, k] + now.P * table[B, k]
        table[V_B, k] = now.P * table[A, k] + now.V * table[B, k]
        spread = product(table, A, U_A, k) + product(table, B, V_B, k)
        table[J, k] = now.slice_mass * spread + now.reduced_mass * product(table, Z, Z, k) + unit * now.body_inertia
        table[OMEGA, k] = 0.0
        table[OMEGA, k] = (unit * now.momentum - product(table, J, OMEGA, k)) / table[J, 0]
        table[SQUARE, k] = product(table, OMEGA, OMEGA, k) - unit * now.kappa
        table[THETA, p] = h * table[OMEGA, k] / p
        # f = (1 - kappa J^2/L^2) g cos(theta), and cos(theta) by the rate of theta.
        table[FORCE, k] = table[COS, p] = table[SIN, p] = 0.0
        if now.gravity != 0.0:
            table[SHARE, k] = unit - now.kappa / now.momentum / now.momentum * product(table, J, J, k)
            table[FORCE, k] = now.gravity * product(table, SHARE, COS, k)
            for j in range(1, p + 1):
                table[COS, p] -= j * table[THETA, j] * table[SIN, p - j] / p
                table[SIN, p] += j * table[THETA, j] * table[COS, p - j] / p
        # A'' = k^2 A - d A', B likewise, z'' = c k^2 z - d_z z' + W f.
        table[PULL, k] = product(table, SQUARE, Z, k)
        share, drag, p = h * h / (p * (p + 1)), h / (p + 1), p + 1
        table[A, p] = share * product(table, SQUARE, A, k) - drag * now.drag_rate * table[A, p - 1]
        table[B, p] = share * product(table, SQUARE, B, k) - drag * now.drag_rate * table[B, p - 1]
        pull = now.spring * table[PULL, k] + weight * table[FORCE, k]
        table[Z, p] = share * pull - drag * now.damping * table[Z, p - 1]
        now.order = p
        now.rest_A += abs(table[A, p])
        now.rest_B += abs(table[B, p])
        now.rest_z += abs(table[Z, p])
        size = max(abs(table[A, p]), now.rate * abs(table[B, p]))
        size = max(size, abs(table[Z, p]) / now.wall, abs(table[THETA, p - 1]))
        small = small + 1 if size < TRUNCATION else 0
        if small == 2:
            return True
    return False


@inner
def value(table, row, order, x):
    """Return the polynomial in a row at ``x``, a fraction of the step, and its derivative with respect to ``x``."""
    power_sum = slope = 0.0
    for k in range(order, -1, -1):
        slope = slope * x + power_sum
        power_sum = power_sum * x + table[row, k]
    return power_sum, slope


@inner
def state_at(now, table, x):
    """Return theta, A, B, z and the derivatives in time of the last three at the fraction ``x`` of the step."""
    a, da = value(table, A, now.order, x)
    b, db = value(table, B, now.order, x)
    z, dz = value(table, Z, now.order, x)
    return value(table, THETA, now.order - 1, x)[0], a, b, z, da / now.h, db / now.h, dz / now.h
