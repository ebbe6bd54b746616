"""Coulomb's cone at one corner, and all impulses of one instant."""

from __future__ import annotations

import math

from ode_reference.landing.layout import CREEPING, MAX_POOLS, MAX_SWEEPS
from ode_reference.landing.pools import pool_flying, pool_tube, reached
from slicemodel.compiled import merged


@merged
def coulomb(demand, slip, nn, nt, tt, friction):
    """Return the normal and tangential impulse of one corner that would rise by ``-demand`` too little without them.

    Sticking if that lies in Coulomb's cone; else slipping to that side on which friction opposes it.
    """
    if demand <= 0.0:
        return 0.0, 0.0
    det = nn * tt - nt * nt
    normal, along = (demand * tt + slip * nt) / det, (-slip * nn - demand * nt) / det
    if normal >= 0.0 and abs(along) <= friction * normal:
        return normal, along
    for side in (1.0, -1.0):
        give = nn + side * friction * nt
        if give > 0.0:
            normal = demand / give
            along = side * friction * normal
            if side * (slip + nt * normal + tt * along) <= 0.0:
                return normal, along
    return demand / nn, 0.0


@merged
def respond(x, tube, start, s1, s2, sine, cosine, angle, closed, target, world, free, work, y, pn, pt):
    """Find all impulses of one instant, or of one step; return the tube's axial value, v_t, omega and whether solved.

    ``x``, ``tube``: what slices and tube would have without impulses, along the axis; ``start`` is added to it for the
    tube's velocity in the lab. ``free``: (v_t, omega) likewise. ``target``: least normal velocity of closed corners.
    ``sine``, ``cosine`` are of the axes; the corners are where they are at ``angle``.
    """
    m_all = world.tube + world.m * world.n
    a12, a22 = world.m * s1, world.tube_inertia + world.m * s2
    det = m_all * a22 - a12 * a12
    corners = 0
    for c in range(4):
        pn[c] = 0.0
        pt[c] = 0.0
        corners += closed[c]
    at_sine, at_cosine = (math.sin(angle), math.cos(angle)) if corners > 0 else (0.0, 1.0)
    axial, across, torque = 0.0, 0.0, 0.0
    expected = 0.0
    on_base, on_cap = 0, world.n
    if not world.rigid:
        on_base, on_cap = reached(closed, world.n)
        pool_flying(x, on_base, on_cap, closed, world, y, work[0], work[1], work[2])
    for outer in range(MAX_POOLS):
        if world.rigid:
            at, pooled = tube + axial / m_all, m_all
        else:
            pushed = tube + axial / world.tube
            at, pooled = pool_tube(x, pushed, on_base, on_cap, world, y, work[0], work[1], work[2])
        v_t = free[0] + (across * a22 - a12 * torque) / det
        omega = free[1] + (m_all * torque - a12 * across) / det
        if corners == 0 or (outer > 0 and abs(at - expected) <= 1e-12 * (1.0 + abs(at))):
            return at, v_t, omega, True
        v_r = start + at
        largest = 0.0
        for _ in range(MAX_SWEEPS):
            largest = 0.0
            for c in range(4):
                if not closed[c]:
                    continue
                a = world.half if c < 2 else -world.half
                b = world.radius if c % 2 == 0 else -world.radius
                # Row of the corner's velocity in (v_r, v_t, omega): (-cos, sin, up) upwards, (sin, cos, on) along x.
                up, on = a * at_sine + b * at_cosine, a * at_cosine - b * at_sine
                n_r, n_t, n_o = -cosine / pooled, (sine * a22 - a12 * up) / det, (m_all * up - a12 * sine) / det
                t_r, t_t, t_o = sine / pooled, (cosine * a22 - a12 * on) / det, (m_all * on - a12 * cosine) / det
                nn, tt = -cosine * n_r + sine * n_t + up * n_o, sine * t_r + cosine * t_t + on * t_o
                nt = sine * n_r + cosine * n_t + on * n_o
                rise = -cosine * v_r + sine * v_t + up * omega - nn * pn[c] - nt * pt[c]
                slip = sine * v_r + cosine * v_t + on * omega - nt * pn[c] - tt * pt[c]
                normal, along = coulomb(target[c] - rise, slip, nn, nt, tt, world.friction)
                more_n, more_t = normal - pn[c], along - pt[c]
                pn[c], pt[c] = normal, along
                v_r += n_r * more_n + t_r * more_t
                v_t += n_t * more_n + t_t * more_t
                omega += n_o * more_n + t_o * more_t
                axial += -cosine * more_n + sine * more_t
                across += sine * more_n + cosine * more_t
                torque += up * more_n + on * more_t
                largest = max(largest, abs(more_n) * nn, abs(more_t) * tt)
            if corners == 1:
                largest = 0.0  # its closed form is exact
            if largest < 1e-13:
                break
        if not largest < CREEPING:
            break
        expected = v_r - start
    return at, v_t, omega, False
