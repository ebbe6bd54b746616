"""Free flight without drag between two impacts: a central motion in a plane, whatever the number of slices is.

With z the mean of the free slices less the centre y_c of the tube and the slices that rest in it, a the mass of the
free slices, M_c and J_c mass and inertia of that body (y counts from the tube's centre), the vector

    X = (sqrt(m) (y_i - mean y), sqrt(a M_c / M) z)    obeys    X'' = omega^2 X,    J = J_c + |X|^2,    omega = L / J.

Its acceleration points along X: l^2 = |X|^2 |X'|^2 - (X . X')^2 is constant, and E = |X'|^2 / 2 + L^2 / 2J is. With
J' = 2 X . X' these two say

    J J'^2 = 4 [2 E J^2 - (L^2 + 2 E J_c + l^2) J + L^2 J_c].

From rest l = 0 and X = lambda X_0: every slice keeps its share, y_i - y_c = lambda (y_i - y_c)_0. With
cos(phi) = 1 / lambda and the parameter mu = J_c / J_0 of Legendre's integrals F and E the equation integrates to

    theta - theta_0 = F(phi | mu)            (so that lambda is Jacobi's function nc of theta - theta_0)
    omega_0 t       = tan(phi) sqrt(1 - mu sin(phi)^2) + F(phi | mu) - E(phi | mu).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ellipeinc, ellipkinc

from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray


def spread_from_rest(
    scenario: Scenario, points: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return t, theta, omega (P,), r and v (P, N) from release until shortly before the first slice meets an end.

    Slices that touch an end at release rest there. Where none can move there is one time, 0.

    Accuracy
    --------
    Round-off.
    """
    bottle, m, spin = scenario.bottle, scenario.slice_mass, scenario.omega0
    wall, y = scenario.r_max - bottle.length / 2, scenario.initial_positions() - bottle.length / 2
    free = np.abs(y) < wall * (1 - 1e-9)
    body = bottle.mass + m * np.count_nonzero(~free)
    centre = m * float(y[~free].sum()) / body
    away = np.where(free, y - centre, 0.0)
    moves = np.abs(away) > 1e-12 * bottle.length
    # J_c, and |X_0|^2 as the sum about y_c less what the centre of mass takes away.
    fixed = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12) + m * float((y[~free] ** 2).sum())
    fixed -= body * centre**2
    spread = m * float((away**2).sum()) - (m * float(away.sum())) ** 2 / scenario.total_mass
    phi: FloatArray = np.zeros(1)
    if moves.any():
        reach = np.where(away > 0, wall - centre, wall + centre)[moves] / np.abs(away[moves])
        phi = math.acos(1 / float(reach.min())) * np.linspace(0.0, 1.0, points + 1)[:-1]
    parameter = fixed / (fixed + spread)
    root = np.sqrt(1 - parameter * np.sin(phi) ** 2)
    turned = np.asarray(ellipkinc(phi, parameter), dtype=np.float64)
    t: FloatArray = np.asarray((np.tan(phi) * root + turned - ellipeinc(phi, parameter)) / spin, dtype=np.float64)
    stretch = 1 / np.cos(phi)
    omega = spin * (fixed + spread) / (fixed + spread * stretch**2)
    # d theta / d phi = 1 / root, d lambda / d phi = lambda tan(phi)
    rate = omega * root * stretch * np.tan(phi)
    r = bottle.length / 2 + np.where(free, centre, y) + stretch[:, None] * away
    return t, scenario.theta0 + turned, omega, r, rate[:, None] * away
