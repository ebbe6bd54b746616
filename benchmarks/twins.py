"""Whether a fit's 95 % intervals hold drag and restitution in 95 of 100 cases: throws simulated, filmed and fitted.

    python benchmarks/twins.py                           100 twins by midpoint (Eq. 8), omega_0 and theta_0 known
    python benchmarks/twins.py --also omega0 theta0      four parameters fitted
    python benchmarks/twins.py --measured omega          from omega as the paper makes it of theta
    python benchmarks/twins.py --model eq8               Eq. 8 exactly, event by event
    python benchmarks/twins.py --model free-flight       with the momentum of the tube

Each twin has its own truth, drawn at random from the ranges printed, and its own camera noise: 1 mm in each coordinate
of cap and base at 240 frames/s; theta by Eq. 1. The noise is not told to the fit. Prints how many intervals hold the
truth and how wide they are.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np
from tqdm import tqdm

from flipproof.film.fit.compare import Interval, intervals
from flipproof.film.fit.estimate import Estimate, estimate
from flipproof.film.fit.problem import ALSO, SLICES, Measurement, Quantity, flights, pose
from flipproof.film.fit.reading import averaged_omega
from flipproof.film.fit.region import loss
from flipproof.film.tracker.kinematics import angle, direction
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

NEEDED = 0.90

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
    share = dict(zip(RANGES, np.random.default_rng([seed, 0]).uniform(size=len(RANGES)), strict=True))
    drawn = {name: low + (high - low) * share[name] for name, (low, high) in RANGES.items()}
    low, high = RANGES["damping_rate"]
    gamma = low * (high / low) ** share["damping_rate"]
    kept: dict[str, Any] = {name: drawn[name] for name in ("restitution", "omega0", "theta0", "duration")}
    throw = replace(Scenario(), water_mass=drawn["fill_fraction"] * Scenario().bottle.capacity, n_slices=slices, **kept)
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
    half = 0.5 * throw.bottle.length * direction(theta)
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
        return any(i.low <= getattr(self.truth, name) <= i.high for i in self.intervals if i.name == name)

    def width(self, name: str) -> float:
        """Return the interval's width in units of the true value (restitution: as it is)."""
        (width,) = (interval.high - interval.low for interval in self.intervals if interval.name == name)
        return width / self.truth.drag if name == "drag" else width


def fit_twin(seed: int, solver: str, *, slices: int, also: tuple[str, ...] = (), quantity: Quantity = "theta") -> Twin:
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
    averaged = partial(averaged_omega, points=AVERAGED) if quantity == "omega" else None
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


def main() -> int:
    """Fit the twins and print coverage and widths."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--twins", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--model", default="midpoint")
    parser.add_argument("--slices", type=int, default=SLICES)
    parser.add_argument("--also", nargs="+", choices=ALSO, default=[])
    parser.add_argument("--measured", choices=("theta", "omega"), default="theta")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=None, help="JSON file for every twin")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.twins)
    asked = {"slices": options.slices, "also": tuple(options.also), "quantity": options.measured}
    began = time.perf_counter()
    with ProcessPoolExecutor(options.jobs) as pool:
        twins = list(
            tqdm(pool.map(partial(fit_twin, solver=options.model, **asked), seeds), total=len(seeds), disable=None)
        )
    seconds, processor = time.perf_counter() - began, sum(os.times()[:4])

    print(f"{len(twins)} twins by {options.model}, {options.slices} slices, fitted to {options.measured}; truths from")
    for name, (low, high) in RANGES.items():
        print(f"    {name} in [{low:g}, {high:g}]")
    print(f"camera: {1e3 * CAMERA_NOISE:g} mm, {RATE:g} frames/s; not told to the fit")
    names = twins[0].estimate.problem.free
    held = {name: sum(twin.covers(name) for twin in twins) for name in names}
    both = sum(twin.covers("drag") and twin.covers("restitution") for twin in twins)
    for name in names:
        width = median(twin.width(name) for twin in twins)
        unit = "of the truth" if name == "drag" else {"omega0": "rad/s", "theta0": "rad"}.get(name, "")
        print(f"    {name:12} held in {held[name]} of {len(twins)}; median width of the interval {width:.4f} {unit}")
    print(f"    drag and restitution together held in {both} of {len(twins)}")
    missed = [twin.seed for twin in twins if twin.estimate.chi2 > twin.chi2_of_truth + 0.5]
    print(f"    lowest chi^2 not found (above that of the truth): {len(missed)} {missed or ''}")
    flights = median(twin.estimate.flights for twin in twins)
    print(f"    flights per fit: {flights:.0f}; {seconds:.0f} s, {processor:.0f} s of processor time")
    if options.out:
        rows = [
            {"seed": twin.seed, "chi2": twin.estimate.chi2, "chi2_of_truth": twin.chi2_of_truth,
             "temperature": twin.estimate.temperature,
             "roughness": twin.estimate.roughness,
             **{i.name: [getattr(twin.truth, i.name), i.value, i.low, i.high] for i in twin.intervals}}
            for twin in twins
        ]  # fmt: skip
        options.out.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    return 0 if both >= NEEDED * len(twins) else 1


if __name__ == "__main__":
    sys.exit(main())
