"""The energy of a flight and what each term of its equation did to it, from sums alone.

Tracked is the mechanical energy of bottle and water in the frame of C_M, whatever the model believes:

    E = m/2 sum y_i'^2 - M/2 y_CM'^2 + L^2 / 2J,        sum y_i'^2 = n z'^2 + A'^2 U + 2 A' B' P + B'^2 V.

With s_i = y_i - y_CM, S = sum_free s_i = n (M_c/M) z, D = y_CM' = (a/M) z', K = m sum y_i'^2, Q = m sum s_i y_i' = J'/2
and F = (1 - kappa/omega^2) g cos(theta), a term T_i of y_i'' has the power m sum_free (y_i' - D) T_i:

                       without origin                              with origin
    drag               -d (K - M D^2) + d u D M_c                  -d K
    weight              F D M_c                                     F D M_b
    negative_spring    -kappa (Q - m D S)                          -kappa Q
    missing_origin     -omega^2 m D S                               0

u = D where drag is measured against C_M, else 0. On an immovable tube an impact costs m/2 (y'^2 after less before);
what the momentum of the tube left out adds to that is ``missing_recoil``.
"""

from __future__ import annotations

import math

import numpy as np

from ode_reference.flow.layout import AFTER, COUNT, END, INDEX
from ode_reference.flow.points import inertia_at, inertia_of
from ode_reference.flow.series import state_at
from slicemodel.compiled import inner

_NODES, _WEIGHTS = (0.5 * numbers for numbers in np.polynomial.legendre.leggauss(6))


@inner
def speeds_of(now, points, marks):
    """Return the sums of all velocities [m/s] and of their squares; slices at rest may have one within an instant."""
    total = now.free * now.dy_mean
    squares = total * now.dy_mean + now.dA * now.dA * now.U + 2.0 * now.dA * now.dB * now.P + now.dB * now.dB * now.V
    for k in range(now.hits):
        if marks[INDEX, k] < 0:
            total += points[COUNT, k] * points[END, k] * points[AFTER, k]
            squares += points[COUNT, k] * points[AFTER, k] * points[AFTER, k]
    return total, squares


@inner
def energy_of(now, points, marks):
    """Return E [J]."""
    total, squares = speeds_of(now, points, marks)
    axial = now.slice_mass * (squares - now.slice_mass * total * total / now.total_mass)
    return (axial + now.momentum * now.momentum / inertia_of(now)) / 2.0


@inner
def book_jump(now, before, after):
    """Return what an instant does to the energy; without recoil, book what the momentum of the tube would add."""
    lost = now.slice_mass / 2.0 * (after[1] - before[1])
    carried = now.slice_mass * now.slice_mass / 2.0 / now.total_mass * (before[0] * before[0] - after[0] * after[0])
    if now.recoil:
        return lost + carried
    now.work_missing_recoil += carried
    return lost


@inner
def book_step(now, table, x):
    """Book the works of the terms from the start of the step to its fraction ``x``, by Gauss's rule of order 12."""
    m, n, total = now.slice_mass, now.free, now.total_mass
    body, loose = total - m * n, 0.0 if now.origin else 1.0
    for k in range(len(_NODES)):
        theta, a, b, z, da, db, dz = state_at(now, table, x * (0.5 + _NODES[k]))
        omega = now.momentum / inertia_at(now, a, b, z)
        K = m * (n * dz * dz + da * da * now.U + 2.0 * da * db * now.P + db * db * now.V)
        Q = m * (a * da * now.U + (a * db + da * b) * now.P + b * db * now.V) + now.reduced_mass * z * dz
        D, S = m * n / total * dz, n * body / total * z
        F = now.gravity * math.cos(theta) * (1.0 - now.kappa / omega / omega)
        weight, u = x * now.h * _WEIGHTS[k], now.drag_on_centre * D
        now.work_drag -= weight * now.drag_rate * (K - loose * D * (total * D + u * body))
        now.work_weight += weight * F * D * (body if loose else now.bottle_mass)
        now.work_negative_spring -= weight * now.kappa * (Q - loose * m * D * S)
        now.work_missing_origin -= weight * omega * omega * loose * m * D * S
