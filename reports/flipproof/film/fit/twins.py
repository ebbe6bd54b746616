"""Twin experiments: a simulated throw, filmed by a camera with noise, fitted as if it were measured.

The camera sees cap and base, each coordinate with its own noise; Eq. 1 turns them into theta.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from flipproof.film.fit.estimate import Estimate, estimate
from flipproof.film.fit.landscape import loss
from flipproof.film.fit.problem import Measurement, Quantity, flights, pose
from flipproof.film.fit.reading import Averaged
from flipproof.film.fit.uncertainty import Interval, intervals
from flipproof.film.tracker.kinematics import angle
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

RATE: Final = 240.0
"""Frames per second of the paper's camera."""

CAMERA_NOISE: Final = 1e-3
"""Standard deviation of one coordinate of one marker [m]."""

AVERAGED: Final = 5
"""Points that the paper's omega is averaged over."""

RANGES: Final = {
    "fill_fraction": (0.25, 0.75),
    "damping_rate": (1.0, 10.0),
    "restitution": (0.1, 0.9),
    "omega0": (15.0, 25.0),
    "theta0": (1.2, 1.9),
    "duration": (0.4, 0.55),
}
"""Where truths are drawn from; the damping rate [1/s] evenly in its logarithm, everything else evenly."""


def draw_truth(seed: int, slices: int) -> Scenario:
    """Return a throw drawn at random from ``RANGES``."""
    base = Scenario()
    share = np.random.default_rng([seed, 0]).uniform(size=len(RANGES))
    drawn = {name: low + (high - low) * u for (name, (low, high)), u in zip(RANGES.items(), share, strict=True)}
    low, high = RANGES["damping_rate"]
    gamma = low * (high / low) ** share[list(RANGES).index("damping_rate")]
    throw = replace(
        base,
        water_mass=drawn["fill_fraction"] * base.bottle.capacity,
        n_slices=slices,
        restitution=drawn["restitution"],
        omega0=drawn["omega0"],
        theta0=drawn["theta0"],
        duration=drawn["duration"],
    )
    return replace(throw, drag=2.0 * throw.slice_mass * gamma)


def film(throw: Scenario, solver: str, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what a camera of ``RATE`` and ``CAMERA_NOISE`` sees of a simulated throw.

    Returns
    -------
    t : (P,) - [s]
    cap, base : (P, 2) - x and y of the markers [m], the centre of the bottle at rest (Eq. 1 takes differences only)
    """
    t = np.arange(int(np.floor(throw.duration * RATE)) + 1) / RATE
    whole = replace(throw, duration=float(t[-1]))
    theta = flights([whole], solver, t)[0][0]
    half = 0.5 * throw.bottle.length * np.column_stack((np.sin(theta), -np.cos(theta)))
    grain = np.random.default_rng([seed, 1]).normal(0.0, CAMERA_NOISE, (2, len(t), 2))
    return t, -half + grain[0], half + grain[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """One twin experiment and what its fit said.

    Parameters
    ----------
    seed : int
    truth : Scenario
    chi2_of_truth : float - in units of the noise, for comparison with ``estimate.chi2``
    estimate : Estimate
    intervals : tuple of Interval
    """

    seed: int
    truth: Scenario
    chi2_of_truth: float
    estimate: Estimate
    intervals: tuple[Interval, ...]

    def covers(self, name: str) -> bool:
        """Return whether the interval of a parameter holds the truth."""
        interval = self._of(name)
        return bool(interval.low <= getattr(self.truth, name) <= interval.high)

    def width(self, name: str) -> float:
        """Return the interval's width in units of the true value (restitution: as it is)."""
        interval = self._of(name)
        scale = abs(getattr(self.truth, name)) if name == "drag" else 1.0
        return (interval.high - interval.low) / scale

    def _of(self, name: str) -> Interval:
        return next(interval for interval in self.intervals if interval.name == name)


def fit_twin(
    seed: int,
    solver: str,
    *,
    slices: int,
    also: tuple[str, ...] = (),
    quantity: Quantity = "theta",
) -> Twin:
    """Draw a truth, film it, forget it, and fit the film with the equation that made it.

    Parameters
    ----------
    seed : int - of truth and camera
    solver : str
    slices : int
    also : names from ``ALSO`` that are fitted; others are known exactly
    quantity : "theta" from Eq. 1, or "omega" as the paper makes it of theta
    """
    truth = draw_truth(seed, slices)
    t, cap, base = film(truth, solver, seed)
    theta = np.unwrap(angle(cap, base))
    averaged = Averaged(points=AVERAGED) if quantity == "omega" else None
    measured = Measurement(
        label=f"twin {seed}",
        t=t,
        values=theta if averaged is None else averaged(t, theta),
        quantity=quantity,
        operator=averaged,
    )
    # What is fitted must not be known: the fit starts from a throw that says nothing of it.
    known = replace(truth, drag=0.0, restitution=0.5)
    problem = pose(measured, known, solver, also=also, slices=slices)
    found = estimate(problem, seed=seed)
    here = np.array([problem.coordinate(name, getattr(truth, name)) for name in problem.free])
    return Twin(
        seed=seed,
        truth=truth,
        chi2_of_truth=float(loss(problem.residuals(here[np.newaxis])[0])),
        estimate=found,
        intervals=intervals(found),
    )
