r"""The flight seen from the lab, and the landing: definitions only, no equation of motion of the water.

        cap  o                          C_M falls as a point does (Eq. 2a, 2b):
              \    theta                    C_M(t) = C_M(0) + v_0 t - g t^2/2 e_y .
        C_M    x                        The bottle lies along u_r = (sin theta, -cos theta) through it:
                \                           cap = C_M - r_CM u_r ,  base = C_M + (L - r_CM) u_r .
    rim  +---o---+  base
    ================  table             The origin O is the place of the cap at release (section 2).

A bottle is a cylinder: it touches the table with the rim of its base or of its cap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from slicemodel.observables import centre_of_mass_at_rest, centre_of_mass_velocity, toppling_angle
from slicemodel.trajectory import FloatArray, Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class LabMotion:
    """Positions (x, y) in the lab from O [m], each of shape (P, 2): ends of the axis and centre of mass."""

    cap: FloatArray
    base: FloatArray
    centre: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """A flight at one instant.

    Parameters
    ----------
    time : float [s]
    theta : float [rad], omega : float [rad/s]
    r_cm : float - centre of mass from the cap [m]
    v_cm : float - its velocity in the bottle [m/s], positive towards the base
    toppling_angle : float - of the bottle with its water where it is [rad] (Eq. 13a)
    """

    time: float
    theta: float
    omega: float
    r_cm: float
    v_cm: float
    toppling_angle: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Landing:
    """First touch of a table: its ``height`` over O [m], the ``end`` that touches it, and the flight at that moment."""

    height: float
    end: Literal["base", "cap"]
    moment: Moment


def lab_motion(trajectory: Trajectory) -> LabMotion:
    """Return cap, base and centre of mass in the lab for the scenario's launch velocity (Eq. 2a, 2b).

    Eq. 2 has the centre of mass of the water alone, at L - h/2; here it is that of bottle and water.
    """
    scenario, t = trajectory.scenario, trajectory.t
    axis = _axis(trajectory.theta)
    velocity = np.asarray(scenario.launch_velocity)
    fall = np.array([0.0, -scenario.gravity / 2])
    # From the scenario, since the first output time need not be the release.
    release = centre_of_mass_at_rest(scenario) * _axis(np.array([scenario.theta0]))[0]
    centre = release + np.outer(t, velocity) + np.outer(t * t, fall)
    r_cm = trajectory.r_cm[:, np.newaxis]
    return LabMotion(cap=centre - r_cm * axis, base=centre + (scenario.bottle.length - r_cm) * axis, centre=centre)


def _axis(theta: FloatArray) -> FloatArray:
    """Return u_r, from cap to base, shape (P, 2)."""
    return np.stack((np.sin(theta), -np.cos(theta)), axis=1)


def moment_at(trajectory: Trajectory, time: float) -> Moment:
    """Return the flight at ``time``, by linear interpolation between its output times.

    A run stored as "summary" keeps no slice velocities: there v_cm is the derivative of r_cm by central differences,
    of second order in the spacing and smeared over two of them where slices strike an end.

    Raises
    ------
    ValueError
        If ``time`` is outside the flight.
    """
    t, scenario = trajectory.t, trajectory.scenario
    if not t[0] <= time <= t[-1]:
        raise ValueError(f"time = {time!r} s is outside [{t[0]:g}, {t[-1]:g}] s (the flight)")
    stored = len(trajectory.v) == len(t)
    v_cm = centre_of_mass_velocity(scenario, trajectory.v) if stored else np.gradient(trajectory.r_cm, t)
    signals = (trajectory.theta, trajectory.omega, trajectory.r_cm, v_cm)
    theta, omega, r_cm, v = (float(np.interp(time, t, values)) for values in signals)
    return Moment(
        time=float(time),
        theta=theta,
        omega=omega,
        r_cm=r_cm,
        v_cm=v,
        toppling_angle=float(toppling_angle(scenario, r_cm)),
    )


def next_upright(trajectory: Trajectory) -> Moment | None:
    """Return the flight where it first stands upright again; None if it does not turn that far.

    That is theta = 2 pi for a bottle released at pi/2 that turns forwards: where section 6 reads off r_CM.
    """
    turn = math.copysign(1.0, trajectory.scenario.omega0)
    turned = turn * trajectory.theta
    goal = math.tau * (math.floor(turn * trajectory.scenario.theta0 / math.tau) + 1)
    time = _first_rise(trajectory.t, turned - goal)
    return None if time is None else moment_at(trajectory, time)


def landing(trajectory: Trajectory, height: float) -> Landing | None:
    """Return where the bottle first comes down on a table; None if it does not during the run.

    Parameters
    ----------
    height : float
        Of the table over the place of the cap at release [m], finite. A bottle released below it has to rise over it
        first: it lands when its lowest point comes down through this height.

    Raises
    ------
    ValueError
        If the height is not finite.
    """
    if not math.isfinite(height):
        raise ValueError(f"height = {height!r} m is outside (-inf, inf)")
    motion = lab_motion(trajectory)
    rim = trajectory.scenario.bottle.radius * np.abs(np.sin(trajectory.theta))
    base, cap = motion.base[:, 1] - rim, motion.cap[:, 1] - rim
    time = _first_rise(trajectory.t, height - np.minimum(base, cap))
    if time is None:
        return None
    of_base, of_cap = (float(np.interp(time, trajectory.t, y)) for y in (base, cap))
    return Landing(height=height, end="base" if of_base <= of_cap else "cap", moment=moment_at(trajectory, time))


def _first_rise(t: FloatArray, values: FloatArray) -> float | None:
    """Return the first time at which the polygon comes up to zero from below, or None."""
    reached = np.flatnonzero((values[1:] >= 0.0) & (values[:-1] < 0.0))
    if not reached.size:
        return None
    k = int(reached[0])
    share = -values[k] / (values[k + 1] - values[k])
    return float(t[k] + share * (t[k + 1] - t[k]))
