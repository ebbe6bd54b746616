"""What is read off slice positions: definitions only, no equation of motion.

These are the nouns that all solvers share. A solver that needs the centre of mass or the moment of
inertia inside its own equations computes them itself; the tests compare the two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from slicemodel.scenario import Scenario, ScenarioError, not_whole
from slicemodel.trajectory import FloatArray, Impacts

PLATEAU_POINTS: Final = 21
"""Points of the paper's average: its "at least 20" around the minimum, the same number on either side of it."""

PLATEAU_SHARE: Final = 0.02
"""The same window as a share of the flight: 20 of the paper's 1000 steps, 10 ms of its 0.5 s."""

TOGETHER: Final = 1e-9
"""Impacts that follow each other no later than this share an instant [s]."""


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
    start = int(np.searchsorted(times, middle, side="right"))
    grid = np.concatenate(([middle], times[start:]))
    curve = np.concatenate(([np.interp(middle, times, values)], values[start:]))
    return float(np.trapezoid(curve, grid) / (grid[-1] - grid[0]) / omega0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plateau:
    """omega_f / omega_0 as read off one window: ``level`` [1], and the window's ``begin`` and ``end`` [s]."""

    level: float
    begin: float
    end: float


def plateau_of_points(t: ArrayLike, omega: ArrayLike, omega0: float, points: int = PLATEAU_POINTS) -> Plateau:
    """Mean of omega / omega_0 over the grid points around its minimum: the paper's omega_f (section 5, Fig. 7b).

    The window holds as many points on either side of the minimum; at an end of the flight it is shifted inwards.
    Its width in time depends on the grid: twice the points halve it.

    Parameters
    ----------
    t : array, shape (P,) [s]
    omega : array, shape (P,) [rad/s]
    omega0 : float [rad/s]
    points : int
        Points of the mean, in [1, P].

    Raises
    ------
    ValueError
        If the grid has fewer points.
    """
    times, values = np.asarray(t, dtype=np.float64), np.asarray(omega, dtype=np.float64) / omega0
    problem = not_whole("points", points, 1, len(times))
    if problem:
        raise ValueError(problem)
    first = int(np.clip(int(values.argmin()) - points // 2, 0, len(times) - points))
    window = slice(first, first + points)
    return Plateau(level=float(values[window].mean()), begin=float(times[window][0]), end=float(times[window][-1]))


def plateau_of_width(t: ArrayLike, omega: ArrayLike, omega0: float, width: float) -> Plateau:
    """Lowest mean of omega / omega_0 over any window of ``width`` seconds of the flight.

    What ``plateau_of_points`` becomes without its grid: the mean is taken over time, and the window lies where the
    mean, not one point, is lowest. So the level moves by no more than the curve does, even where two minima compete.

    Parameters
    ----------
    t : array, shape (P,) [s]
    omega : array, shape (P,) [rad/s]
    omega0 : float [rad/s]
    width : float
        In (0, t[-1] - t[0]] [s].

    Raises
    ------
    ValueError
        If the width is not positive or exceeds the flight.

    Accuracy
    --------
    Exact for the polygon through the points, hence second order in the spacing of the grid.
    """
    times, values = np.asarray(t, dtype=np.float64), np.asarray(omega, dtype=np.float64) / omega0
    span = float(times[-1] - times[0])
    if not 0.0 < width <= span:
        raise ValueError(f"width = {width!r} s is outside (0, {span:g}] s (the flight)")
    last_start = times[-1] - width
    # Between two of these starts neither edge of the window passes a point of the polygon.
    starts = np.unique(np.clip(np.concatenate((times, times - width)), times[0], last_start))
    slope = np.interp(starts + width, times, values) - np.interp(starts, times, values)
    # There the mean is a parabola of the start, lowest where its slope passes from falling to rising.
    turns = np.flatnonzero((slope[:-1] < 0.0) & (slope[1:] > 0.0))
    share = slope[turns] / (slope[turns] - slope[turns + 1])
    starts = np.concatenate((starts, starts[turns] + share * np.diff(starts)[turns]))
    means = (_integral(times, values, starts + width) - _integral(times, values, starts)) / width
    best = int(means.argmin())
    return Plateau(level=float(means[best]), begin=float(starts[best]), end=float(starts[best] + width))


def _integral(times: FloatArray, values: FloatArray, until: FloatArray) -> FloatArray:
    """Return the integral of the polygon through the points from times[0] to each of ``until``."""
    areas = np.concatenate(([0.0], np.cumsum(np.diff(times) * (values[1:] + values[:-1]) / 2)))
    before = np.clip(np.searchsorted(times, until, side="right") - 1, 0, len(times) - 1)
    remainder = until - times[before]
    return np.asarray(areas[before] + remainder * (values[before] + np.interp(until, times, values)) / 2)


def centre_of_mass_at_rest(scenario: Scenario) -> float:
    """Distance of the centre of mass from the cap while all water rests on the base [m] (Eq. 3e with Eq. 4a)."""
    length = scenario.bottle.length
    epsilon = scenario.bottle.mass / scenario.total_mass
    return (1 - epsilon / 2) * length - (1 - epsilon) * scenario.fill_fraction * length / 2


def release_angular_velocity(scenario: Scenario, speed: float | None = None) -> float:
    """Angular velocity of a bottle swung about its cap at release [rad/s] (section 5: omega_0 = v_0 / r_CM(0)).

    Parameters
    ----------
    speed : float, optional
        Of the centre of mass [m/s], finite and >= 0; that of ``scenario.launch_velocity`` by default.

    Raises
    ------
    ScenarioError
        If the speed is negative or not finite.
    """
    speed = math.hypot(*scenario.launch_velocity) if speed is None else speed
    if not 0.0 <= speed < math.inf:
        raise ScenarioError(f"speed = {speed!r} m/s is outside [0, inf)")
    return speed / centre_of_mass_at_rest(scenario)


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


def static_toppling_angle(scenario: Scenario) -> float:
    """Angle beyond which the bottle topples while all water rests on its base [rad] (Eq. 13b with Eq. 4a)."""
    return float(toppling_angle(scenario, centre_of_mass_at_rest(scenario)))


def grazes(impacts: Impacts, rest_speed: float) -> int:
    """Return how many contacts were slower than the rest speed by slices that had left their last one twice as fast.

    Such a contact might as well have been missed, and its time is uncertain as 1 / speed: where there is one, omega(t)
    depends on the last digits. A rebound that comes back at the speed it left with is none.
    """
    order = np.lexsort((impacts.time, impacts.slice))
    slices, before, after = impacts.slice[order], impacts.speed_before[order], impacts.speed_after[order]
    same = slices[1:] == slices[:-1]
    left = np.concatenate([[np.inf], np.where(same, after[:-1], np.inf)])[: len(before)]
    return int(np.count_nonzero((before < rest_speed) & (left > 2 * rest_speed)))


def opposite_hits(impacts: Impacts) -> int:
    """Return how many instants saw both ends struck; impacts no more than ``TOGETHER`` apart share an instant."""
    if len(impacts) == 0:
        return 0
    begins = np.concatenate([[0], np.flatnonzero(np.diff(impacts.time) > TOGETHER) + 1])
    return int(np.count_nonzero(np.minimum.reduceat(impacts.end, begins) != np.maximum.reduceat(impacts.end, begins)))
