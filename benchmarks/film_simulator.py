"""Films of known truth, made without the estimator's formulas: only the turning of the bottle is the reference's.

A bottle is turned by a hand, thrown, filmed by a camera that is tilted and stands somewhere, clicked by a person who
misses, sometimes badly, and sometimes not at all; then it comes down on a table and stays there.
"""

from dataclasses import dataclass, replace

import numpy as np

import ode_reference
from flipproof.film.likelihood import Film
from slicemodel import Scenario


@dataclass
class Clip:
    """What was clicked, in metres of the picture, and what was true."""

    t: np.ndarray
    cap: np.ndarray
    base: np.ndarray
    truth: dict[str, float]

    def film(self) -> Film:
        """Return what the estimate takes."""
        values = np.array([self.cap, self.base])
        return Film(label="film", t=self.t, values=values, quantity="points", lines=np.arange(len(self.t)) + 1)


def film(
    rng: np.random.Generator, *, fps: float = 240.0, noise: float = 1e-3, tilt: float = 0.0, filling: float = 0.5,
    bad: int = 0, missing: int = 0, gamma: float = 6.0, e: float = 0.4, omega0: float = 18.0, slices: int = 20,
    duration: float = 0.5, model: str = "free-flight", theta0: float | None = None, hand: float = 0.3,
    swings: bool = False, flick: float = 0.0, softness: float = 0.0,
) -> Clip:  # fmt: skip
    """Return a clip; ``tilt`` in degrees, ``bad`` clicks and ``missing`` points fall on frames in flight.

    The hand accelerates steadily, or as ``swung`` says, or holds still and flicks the bottle away in ``flick`` seconds.
    The table stops the base at once, and the bottle falls upright; a soft one slows both by exp(-t / softness).
    """
    theta0 = float(rng.uniform(1.2, 1.9)) if theta0 is None else theta0
    scene = Scenario(water_mass=filling, omega0=omega0, theta0=theta0, restitution=e, duration=duration)
    scene = scene.with_slices(slices)
    scene = replace(scene, drag=2 * scene.slice_mass * gamma)
    release = hand + rng.random() / fps
    t = np.arange(0.0, release + duration + 0.25, 1 / fps)
    tau = t - release
    flying = (tau >= 0) & (tau <= duration)
    run = ode_reference.solve(scene, model, times=np.concatenate(([0.0], tau[flying], [duration])))
    length, g = scene.bottle.length, 9.81
    velocity = np.array([rng.uniform(-0.8, 0.8), rng.uniform(2.0, 2.8)])
    # In the hand: other accelerations, which end at the release; place, velocity and turning meet the flight.
    if flick:
        # Velocity and turning rise by s^2 (3 - 2 s): fastest halfway, and no more at the release.
        part = np.clip(1 + tau / flick, 0, 1)
        lag = flick * (0.5 - part + part**3 - part**4 / 2) + np.maximum(-tau - flick, 0)
        pull, twist = np.outer(lag, velocity), omega0 * lag
    elif swings:
        pull, twist = swung(rng, tau)
    else:
        steady, bend = rng.uniform(-1, 1, 2) * (15, 5) + (0, 15), rng.uniform(-80, 80)
        pull, twist = np.outer(tau**2, steady) / 2, bend * tau**2 / 2
    theta, mass = np.empty(len(t)), np.empty((len(t), 2))
    before, after = tau < 0, tau > duration
    theta[before] = theta0 + omega0 * tau[before] + twist[before]
    theta[flying] = run.theta[1:-1]
    mass[before] = np.outer(tau[before], velocity) + pull[before]
    mass[~before] = np.outer(tau[~before], velocity) - np.outer(tau[~before] ** 2, (0, g)) / 2
    r = np.full(len(t), run.r_cm[0])
    r[flying], r[after] = run.r_cm[1:-1], run.r_cm[-1]
    if after.any():  # the base stays where it touched; the bottle falls upright
        upright = 2 * np.pi * np.round(run.theta[-1] / (2 * np.pi))
        theta[after] = upright + (run.theta[-1] - upright) * np.exp(-(tau[after] - duration) / 0.15)
        touched = velocity * duration - np.array([0, g]) * duration**2 / 2
        touched = touched + (length - run.r_cm[-1]) * np.array([np.sin(run.theta[-1]), -np.cos(run.theta[-1])])
    axis = np.stack([np.sin(theta), -np.cos(theta)], axis=1)
    cap, base = mass - r[:, None] * axis, mass + (length - r)[:, None] * axis
    if after.any() and softness:
        lag, spin = softness * (1 - np.exp(-(tau[after] - duration) / softness)), run.omega[-1]
        across = np.array([np.cos(run.theta[-1]), np.sin(run.theta[-1])])
        sinking = velocity - np.array([0, g]) * duration + (length - run.r_cm[-1]) * spin * across
        turned = run.theta[-1] + spin * lag
        base[after] = touched + np.outer(lag, sinking)
        cap[after] = base[after] - length * np.stack([np.sin(turned), -np.cos(turned)], axis=1)
    elif after.any():
        base[after], cap[after] = touched, touched - length * axis[after]
    angle = np.radians(tilt)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    place = rng.uniform(-0.5, 0.5, 2)
    cap, base = (points @ turn.T + place + rng.normal(0, noise, points.shape) for points in (cap, base))
    inside = np.flatnonzero(flying)
    for _ in range(bad):
        points, k = (cap, base)[rng.integers(2)], rng.choice(inside)
        points[k] += rng.uniform(0.03, 0.15) * np.array([np.cos(s := rng.uniform(0, 6.28)), np.sin(s)])
    for _ in range(missing):
        (cap, base)[rng.integers(2)][rng.choice(inside)] = np.nan
    truth = {"gamma": gamma, "restitution": e, "omega0": omega0, "theta0": theta0, "release": release, "tilt": tilt,
             "touch": release + duration, "noise": noise, "g": g}  # fmt: skip
    return Clip(t, cap, base, truth)


def swung(rng: np.random.Generator, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what a hand adds to an even motion before the release: to C_M (P, 2) [m] and to theta (P,) [rad].

    One of three hands: steady accelerations; accelerations that swing with periods of 0.15 to 0.6 s, whatever they are
    at the release; and such that fade before it, as of a hand that has done its work.
    """
    size = np.array([15.0, 15.0, 80.0])  # of accelerations [m/s^2], [m/s^2], [rad/s^2]
    level, swing = rng.uniform(-1, 1, (2, 3)) * size
    phase, period = rng.uniform(0, 2 * np.pi, 3), rng.uniform(0.15, 0.6, 3)
    kind, t = rng.integers(3), tau[:, None]
    added = level * t**2 / 2
    if kind > 0:
        rate = 2 * np.pi / period
        added += swing / rate**2 * (np.cos(phase) - rate * t * np.sin(phase) - np.cos(rate * t + phase))
    if kind == 2:
        added *= 1 - np.exp(-((t / 0.05) ** 2))
    added[:, 1] += 7.5 * tau**2
    return added[:, :2], added[:, 2]


def spoiled(rng: np.random.Generator, film: Film) -> Film:
    """Return a ``Film`` with cells changed at random: noise, jumps, runs lost, axes or ends exchanged, slow motion."""
    values, t = film.values.copy(), film.t.copy()
    for _ in range(rng.integers(1, 4)):
        kind, frames = rng.integers(7), np.flatnonzero(rng.random(len(t)) < rng.uniform(0.02, 0.4))
        if kind == 0:
            values[rng.integers(2), frames] += rng.normal(0, 0.1, (len(frames), 2))
        elif kind == 1:
            values[rng.integers(2), frames] = np.nan
        elif kind == 2:
            values = values[::-1].copy()
        elif kind == 3:
            values[..., rng.integers(2)] *= -1
        elif kind == 4:
            t = t * rng.uniform(0.2, 8.0)
        elif kind == 5:
            values *= rng.choice([0.01, 0.9, 1.1, 100.0])
        else:
            k = int(rng.integers(len(t)))
            values[:, k:] += rng.normal(0, 0.2, 2)
    return replace(film, values=values, t=t)


def noise(rng: np.random.Generator, film: Film) -> Film:
    """Return a ``Film`` of nothing: a random walk, white noise or points that stand still."""
    steps = rng.normal(0, 10.0 ** rng.uniform(-4, 0), film.values.shape)
    walk = np.cumsum(steps, axis=1) if rng.random() < 0.5 else steps
    return replace(film, values=walk)
