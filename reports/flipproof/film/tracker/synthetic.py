"""A video that never was: a simulated throw with a hand before it, a table after it and a camera's noise on it.

For tests and examples, where the truth must be known; always labelled synthetic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flipproof.film.tracker.kinematics import direction
from slicemodel import Trajectory
from slicemodel.observables import centre_of_mass_at_rest
from slicemodel.trajectory import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SyntheticVideo:
    """True motion of a throw in the lab; arrays of shape (P,), points (P, 2) [m].

    ``t`` counts from the first frame; ``release`` and ``landing`` are times on it [s].
    """

    t: FloatArray
    cap: FloatArray
    base: FloatArray
    centre: FloatArray
    release: float
    landing: float


def synthetic_video(run: Trajectory) -> SyntheticVideo:
    """Return what a camera of 240 frames/s without noise would see: 0.1 s of hand, the flight, 0.12 s of table.

    In the hand the centre of mass and the angle accelerate evenly, by (-6, 24) m/s^2, far from free fall, and
    90 rad/s^2, and meet the release in place and velocity. On the table the base stays where it is and the bottle rocks
    to the nearest upright position in some 0.03 s.
    """
    scenario = run.scenario
    length, gravity = scenario.bottle.length, scenario.gravity
    velocity = np.array(scenario.launch_velocity)
    flight = float(run.t[-1])
    tau = np.arange(-24, np.floor((flight + 0.12) * 240.0) + 1) / 240.0
    inside = np.clip(tau, 0.0, flight)
    theta = np.interp(inside, run.t, run.theta)
    r_cm = np.interp(inside, run.t, run.r_cm)
    held, down = tau < 0, tau > flight
    theta[held] += scenario.omega0 * tau[held] + 0.5 * np.sign(scenario.omega0) * 90.0 * tau[held] ** 2
    upright = 2 * np.pi * np.rint(theta[down][0] / (2 * np.pi))
    theta[down] = upright + (theta[down] - upright) * np.exp(-(tau[down] - flight) / 0.03)
    origin = centre_of_mass_at_rest(scenario) * np.array([np.sin(scenario.theta0), -np.cos(scenario.theta0)])
    acceleration = np.where(held[:, None], (-6.0, 24.0), (0.0, -gravity))
    clock = np.where(held, tau, inside)[:, None]
    centre = origin + velocity * clock + 0.5 * acceleration * clock**2
    axis = direction(theta)
    cap = centre - r_cm[:, None] * axis
    base = cap + length * axis
    base[down] = base[int(down.argmax()) - 1]
    cap[down] = base[down] - length * axis[down]
    centre[down] = cap[down] + r_cm[down, None] * axis[down]
    return SyntheticVideo(
        t=tau - tau[0], cap=cap, base=base, centre=centre, release=float(-tau[0]), landing=float(flight - tau[0])
    )


def with_noise(points: FloatArray, deviation: float, seed: int) -> FloatArray:
    """Return points with independent Gaussian noise of a standard deviation in x and y."""
    return points + np.random.default_rng(seed).normal(0.0, deviation, points.shape)
