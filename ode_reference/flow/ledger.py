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
from typing import Any

import numpy as np

from ode_reference.flow.points import inertia_of
from ode_reference.flow.series import THETA, A, B, Z, slope, value
from slicemodel.compiled import inner
from slicemodel.trajectory import FloatArray

_NODES, _WEIGHTS = (0.5 * numbers for numbers in np.polynomial.legendre.leggauss(6))


@inner
def squares_of(now: Any) -> float:
    """Return the sum of the squared velocities [m^2/s^2]."""
    groups = now.on_base * now.base_speed * now.base_speed + now.on_cap * now.cap_speed * now.cap_speed
    inner = now.dA * now.dA * now.U + 2.0 * now.dA * now.dB * now.P + now.dB * now.dB * now.V
    return groups + now.free * now.dy_mean * now.dy_mean + inner  # type: ignore[no-any-return]


@inner
def energy_of(now: Any) -> float:
    """Return E [J]; no slice at rest may have a speed."""
    m, drift = now.slice_mass, now.slice_mass * now.free * now.dy_mean / now.total_mass
    axial = m * squares_of(now) - now.total_mass * drift * drift
    return (axial + now.momentum * now.momentum / inertia_of(now)) / 2.0  # type: ignore[no-any-return]


@inner
def book_jump(now: Any, stage: int) -> None:
    """Book the change of energy since the last call: 0 nothing, 1 the impacts, 2 the slices that came to rest."""
    if now.ledger == 0:
        return
    m, squares = now.slice_mass, squares_of(now)
    total = now.free * now.dy_mean + now.on_base * now.base_speed + now.on_cap * now.cap_speed
    if stage > 0:
        lost = m / 2.0 * (squares - now.squares)
        carried = -m * m / 2.0 / now.total_mass * (total * total - now.speeds * now.speeds)
        if now.recoil == 0:
            now.work_recoil += carried
        else:
            lost += carried
        if stage == 1:
            now.work_impacts += lost
        else:
            now.work_rests += lost
    now.squares, now.speeds = squares, total


@inner
def book_step(now: Any, table: FloatArray, x: float) -> None:
    """Book the works of the terms from the start of the step to its fraction ``x``, by Gauss's rule of order 12."""
    if now.ledger == 0 or x == 0.0:
        return
    m, p, n, total = now.slice_mass, now.order, now.free, now.total_mass
    body = total - m * n
    for k in range(len(_NODES)):
        at, weight = x * (0.5 + _NODES[k]), x * now.h * _WEIGHTS[k]
        a, b, z = value(table, A, p, at), value(table, B, p, at), value(table, Z, p, at)
        da, db, dz = slope(table, A, p, at) / now.h, slope(table, B, p, at) / now.h, slope(table, Z, p, at) / now.h
        spread = a * a * now.U + 2.0 * a * b * now.P + b * b * now.V
        omega = now.momentum / (now.body_inertia + m * spread + now.reduced_mass * z * z)
        K = m * (n * dz * dz + da * da * now.U + 2.0 * da * db * now.P + db * db * now.V)
        Q = m * (a * da * now.U + (a * db + da * b) * now.P + b * db * now.V) + now.reduced_mass * z * dz
        D, S = m * n / total * dz, n * body / total * z
        force = now.gravity * math.cos(value(table, THETA, p - 1, at)) * (1.0 - now.kappa / omega / omega)
        if now.origin:
            now.work_drag -= weight * now.drag_rate * K
            now.work_weight += weight * force * D * now.bottle_mass
            now.work_spring -= weight * now.kappa * Q
        else:
            u = now.drag_on_centre * D
            now.work_drag -= weight * now.drag_rate * (K - total * D * D - u * D * body)
            now.work_weight += weight * force * D * body
            now.work_spring -= weight * now.kappa * (Q - m * D * S)
            now.work_origin -= weight * omega * omega * m * D * S
