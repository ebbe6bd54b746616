"""What is read off slice positions: definitions only, no equation of motion.

These are the nouns that all solvers share. A solver that needs the centre of mass or the moment of
inertia inside its own equations computes them itself; the tests compare the two.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray


def centre_of_mass(scenario: Scenario, r: ArrayLike) -> FloatArray:
    """Distance of the centre of mass of bottle and water from the cap [m] (Eq. 10).

    Parameters
    ----------
    r : array, shape (..., N) - slice positions [m]

    Returns
    -------
    array, shape (...)
    """
    bottle = scenario.bottle
    water = np.asarray(r, dtype=np.float64).sum(axis=-1) * scenario.slice_mass
    return np.asarray((water + bottle.mass * bottle.length / 2) / scenario.total_mass)


def moment_of_inertia(scenario: Scenario, r: ArrayLike) -> FloatArray:
    """Moment of inertia of bottle and water about their centre of mass [kg m^2] (Eq. 11b, 11c).

    Parameters
    ----------
    r : array, shape (..., N) - slice positions [m]

    Returns
    -------
    array, shape (...)
    """
    positions = np.asarray(r, dtype=np.float64)
    r_cm = centre_of_mass(scenario, positions)
    water = scenario.slice_mass * ((positions - r_cm[..., np.newaxis]) ** 2).sum(axis=-1)
    bottle = scenario.bottle
    about_own_centre = bottle.mass * (bottle.radius * bottle.radius / 2 + bottle.length * bottle.length / 12)
    return np.asarray(water + about_own_centre + bottle.mass * (bottle.length / 2 - r_cm) ** 2)


def initial_moment_of_inertia(scenario: Scenario) -> float:
    """J_0 of the bottle at release, slices stacked on the base [kg m^2]."""
    return float(moment_of_inertia(scenario, scenario.initial_positions()))


def plateau(t: ArrayLike, omega: ArrayLike, omega0: float) -> float:
    """Mean of omega / omega_0 over the second half of the flight, by the trapezoidal rule.

    Parameters
    ----------
    t : array, shape (P,) [s]
    omega : array, shape (P,) [rad/s]
    omega0 : float [rad/s]

    Returns
    -------
    float
        Independent of the grid up to the rule's second-order error.
    """
    times, values = np.asarray(t, dtype=np.float64), np.asarray(omega, dtype=np.float64)
    middle = (times[0] + times[-1]) / 2
    late = times > middle
    grid = np.concatenate(([middle], times[late]))
    curve = np.concatenate(([np.interp(middle, times, values)], values[late]))
    return float(np.trapezoid(curve, grid) / (grid[-1] - grid[0]) / omega0)


def centre_of_mass_velocity(scenario: Scenario, v: ArrayLike) -> FloatArray:
    """Velocity of the centre of mass along the axis, in the bottle [m/s] (derivative of Eq. 10).

    Parameters
    ----------
    v : array, shape (..., N) - slice velocities in the bottle [m/s], positive towards the base

    Returns
    -------
    array, shape (...)
    """
    momentum = np.asarray(v, dtype=np.float64).sum(axis=-1) * scenario.slice_mass
    return np.asarray(momentum / scenario.total_mass)


def toppling_angle(scenario: Scenario, r_cm: ArrayLike) -> FloatArray:
    """Angle beyond which a bottle standing on its rim topples [rad] (Eq. 13a: tan theta_c = R / (L - r_CM)).

    Parameters
    ----------
    r_cm : array, any shape - centre of mass from the cap [m]
    """
    bottle = scenario.bottle
    return np.asarray(np.arctan2(bottle.radius, bottle.length - np.asarray(r_cm, dtype=np.float64)))
