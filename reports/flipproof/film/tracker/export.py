"""A simulated throw as a camera would see it, and as a table for Tracker to lay over a video.

The video, for tests and examples in which the truth must be known, shows a throw with a hand before it, a table after
it and a camera's noise; it is always labelled synthetic.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slicemodel import Scenario, Trajectory
from slicemodel.landing import lab_motion, landing
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

    In the hand the centre of mass and the angle accelerate uniformly, by (-6, 24) m/s^2, far from free fall, and
    90 rad/s^2, and match the release in place and velocity. On the table the base stays where it is and the bottle
    rocks to the nearest upright position in some 0.03 s.
    """
    scenario = run.scenario
    length, gravity = scenario.bottle.length, scenario.gravity
    velocity = np.array(scenario.launch_velocity)
    flight = float(run.t[-1])
    tau = np.arange(-24, np.floor((flight + 0.12) * 240.0) + 1) / 240.0
    inside = np.clip(tau, 0.0, flight)
    theta = np.interp(inside, run.t, run.theta)
    r_cm = np.interp(inside, run.t, run.r_cm)
    in_hand, on_table = tau < 0, tau > flight
    theta[in_hand] += scenario.omega0 * tau[in_hand] + 0.5 * np.sign(scenario.omega0) * 90.0 * tau[in_hand] ** 2
    upright = 2 * np.pi * np.rint(theta[on_table][0] / (2 * np.pi))
    theta[on_table] = upright + (theta[on_table] - upright) * np.exp(-(tau[on_table] - flight) / 0.03)
    origin = centre_of_mass_at_rest(scenario) * np.array([np.sin(scenario.theta0), -np.cos(scenario.theta0)])
    acceleration = np.where(in_hand[:, None], (-6.0, 24.0), (0.0, -gravity))
    time = np.where(in_hand, tau, inside)[:, None]
    centre = origin + velocity * time + 0.5 * acceleration * time**2
    axis = direction(theta)
    cap = centre - r_cm[:, None] * axis
    base = cap + length * axis
    base[on_table] = base[int(on_table.argmax()) - 1]
    cap[on_table] = base[on_table] - length * axis[on_table]
    centre[on_table] = cap[on_table] + r_cm[on_table, None] * axis[on_table]
    return SyntheticVideo(
        t=tau - tau[0], cap=cap, base=base, centre=centre, release=float(-tau[0]), landing=float(flight - tau[0])
    )


def direction(theta: FloatArray) -> FloatArray:
    """Return the unit vectors of cap -> base at angles (P,), shape (P, 2)."""
    return np.column_stack((np.sin(theta), -np.cos(theta)))


def with_noise(points: FloatArray, deviation: float, seed: int) -> FloatArray:
    """Return points with independent Gaussian noise of a standard deviation in x and y."""
    return points + np.random.default_rng(seed).normal(0.0, deviation, points.shape)


def frame_times(scenario: Scenario, frame_rate: float) -> FloatArray:
    """Return the times of a camera's frames from release to landing [s], at a rate in [1, 1e5] per second."""
    if not 1 <= frame_rate <= 1e5:
        raise ValueError(f"frame_rate = {frame_rate!r} 1/s is outside [1, 100000]")
    max_frames = 1_000_000
    if scenario.duration * frame_rate > max_frames:
        raise ValueError(
            f"duration = {scenario.duration:g} s at {frame_rate:g} frames/s makes more than {max_frames} frames "
            f"(admissible: durations up to {max_frames / frame_rate:g} s)"
        )
    times = np.arange(int(scenario.duration * frame_rate * (1 + 1e-12)) + 1) / frame_rate
    return np.minimum(times, scenario.duration)


def at_times(run: Trajectory, times: FloatArray) -> Trajectory:
    """Return a run interpolated linearly at other times within it, without its slices."""
    empty = np.empty((0, run.scenario.n_slices))
    return replace(
        run, t=times, r=empty, v=empty, impacts=None,
        **{name: np.interp(times, run.t, getattr(run, name)) for name in ("theta", "omega", "r_cm", "inertia")},
    )  # fmt: skip


def until_landing(run: Trajectory, frames: Trajectory, height: float, start: float) -> tuple[Trajectory, str]:
    """Return the frames before the bottle lands on a table, and how it lands, in words; refuse if it does not.

    ``start`` is the time of the release in the video [s].
    """
    touchdown = landing(run, height)
    if touchdown is None:
        raise ValueError(
            f"height = {height:g} m: the bottle does not come down on such a table within {run.t[-1]:g} s; choose a "
            "longer duration in the scenario, or another height"
        )
    time = start + touchdown.moment.time
    text = f"a rim of the {touchdown.end} touches the table at t = {time:.4f} s, after the last row"
    return at_times(frames, frames.t[frames.t <= touchdown.moment.time]), text


def data_track_text(run: Trajectory, *, start: float = 0.0, origin: tuple[float, float] = (0.0, 0.0)) -> str:
    """Return cap, base and C_M of a run in the lab (Eq. 2) as the table of a data track in metres, with nine decimals.

    Parameters
    ----------
    start : time of the release in the video [s]
    origin : place of the cap at release on the video's axes [m]
    """
    motion = lab_motion(run)
    columns = [run.t + start]
    for points in (motion.cap, motion.base, motion.centre):
        columns += list((points + origin).T)
    rows = ["\t".join(("t", "xcap", "ycap", "xbase", "ybase", "xcm", "ycm"))]
    rows += ["\t".join(f"{value:.9f}" for value in row) for row in np.round(np.column_stack(columns), 9) + 0.0]
    return "\n".join(rows) + "\n"
