"""Least squares on a rough landscape: a grid of starts, descents with wide difference quotients, a cooled population.

Each rebound puts a kink into theta(t) as a function of the parameters, and a rebound that waits for the grid a jump.
Difference quotients therefore reach over many kinks: about half the standard error of the estimate, never the square
root of round-off. Several starts, from a grid over drag and restitution, guard against side minima. What lies between
and beyond them is left to a population of points (``sampling``), and the lowest point that any of the three has seen is
descended from once more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from flipproof.film.fit.landscape import Landscape, Tick, loss
from flipproof.film.fit.problem import Problem
from flipproof.film.fit.profile import profile
from flipproof.film.fit.sampling import USUAL, Cloud, Effort, Points, cool, roughness
from flipproof.film.fit.temperature import fits, temperature
from slicemodel.trajectory import FloatArray

MISFIT: Final = 2.0
"""Typical residual, in standard deviations of the noise, beyond which the equation is taken not to fit."""

LIKELY: Final = 5.024
"""97.5 % point of chi^2 with one degree of freedom: two intervals that miss in 2.5 % each miss in 5 % together."""

NEARLY: Final = 30.0
"""chi^2 above the lowest up to which a descent's end seeds the population with its neighbourhood."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The best parameters found, and all others that the data allow.

    Parameters
    ----------
    problem : Problem
    x : (K,) - coordinates of the lowest chi^2
    chi2 : float - Huber's loss at ``x`` in units of the noise
    temperature : float - variance that the intervals rest on, in units of the noise's
    roughness : float - by what factor intervals are wider, squared, than on a smooth landscape
    minima : (M, K + 1) - end of each descent and Huber's loss there in units of the noise, best first
    cloud : (S, K) - coordinates that the data allow, equally weighted
    reach : (2, K) - lowest and highest of each coordinate at which chi^2, all others fitted, exceeds the lowest by no
        more than ``LIKELY * temperature * roughness``
    accepted : float - share of the population's last steps that were accepted
    flights : int - runs of the solver
    """

    problem: Problem
    x: FloatArray
    chi2: float
    temperature: float
    roughness: float
    minima: FloatArray
    cloud: FloatArray
    reach: FloatArray
    accepted: float
    flights: int

    @property
    def values(self) -> dict[str, float]:
        """Estimated parameters [SI] by name."""
        pairs = zip(self.problem.free, self.x, strict=True)
        return {name: self.problem.value(name, float(c)) for name, c in pairs}

    @property
    def freedom(self) -> int:
        """Values less parameters."""
        return self.problem.points - len(self.x)

    def residual(self) -> FloatArray:
        """Return measured minus predicted [rad or rad/s], shape (P,)."""
        return self.problem.measured.values - self.problem.predicted(self.x)


def estimate(
    problem: Problem,
    effort: Effort = USUAL,
    *,
    tick: Tick = lambda _: None,
    seed: int = 0,
) -> Estimate:
    """Return the least-squares estimate and the cloud of what else the data allow.

    Parameters
    ----------
    problem : Problem
    effort : Effort
    tick : callable - called with the number of flights made
    seed : int - of the population's random numbers
    """
    land = Landscape(problem, tick=tick)
    scanned, ends, residuals = _descents(land, effort)
    if effort.again and not _explained(residuals, problem):
        # Either the equation is wrong, or every descent ended in a side minimum: look between the starts.
        finer = replace(effort, drags=2 * effort.drags + 1, restitutions=2 * effort.restitutions + 1)
        more = _descents(land, replace(finer, starts=4 * effort.starts))
        scanned, ends, residuals = (np.concatenate(pair) for pair in zip((scanned, ends, residuals), more, strict=True))

    # What no parameter explains must not be weighed as if it were noise: it would all be outliers.
    residuals = land.residuals(ends)
    coarse = problem.coarse_steps()
    typical = float((1.4826 * np.median(np.abs(residuals), axis=1)).min())
    land = land.rescaled(typical if typical > MISFIT else 1.0)
    levels = loss(residuals / land.scale)
    order = np.argsort(levels)
    minima = np.column_stack((ends, levels))[order]

    best, lowest = minima[0, :-1], float(minima[0, -1])
    variance = temperature(land, best, coarse)
    cloud = cool(land, _seeds(land, minima, scanned, coarse), variance, effort, seed)
    best, lowest, steps = _polished(land, cloud, best, lowest, coarse)
    better = temperature(land, best, steps)
    if not 0.8 <= better / variance <= 1.25:
        variance = better
        cloud = cool(land, cloud.edge, variance, effort, seed + 1)
        best, lowest, steps = _polished(land, cloud, best, lowest, coarse)
    rough = roughness(cloud, variance, seed)
    reach, best, lowest = profile(land, cloud, best, lowest, LIKELY * variance * rough, steps, effort.pushes)
    return Estimate(
        problem=problem, x=best, chi2=float(loss(land.residual(best) * land.scale)),
        temperature=variance * land.scale**2, roughness=rough,
        minima=np.column_stack((ends, loss(residuals)))[order], cloud=cloud.likely.x, reach=reach,
        accepted=cloud.accepted, flights=land.flights,
    )  # fmt: skip


def _descents(land: Landscape, effort: Effort) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the points of a scan, where the descents from its best ended, and the residuals there."""
    everything = np.arange(len(land.problem.free))
    scanned = scan(land, effort)
    coarse = land.problem.coarse_steps()
    ends = np.array([land.descend(x, coarse, everything, 12)[0] for x in scanned[: effort.starts]])
    return scanned, ends, land.residuals(ends)


def _explained(residuals: FloatArray, problem: Problem) -> bool:
    """Return whether noise alone explains the lowest of some residuals (M, P)."""
    return fits(float(loss(residuals).min()), problem.points - len(problem.free))


def _seeds(land: Landscape, minima: FloatArray, scanned: FloatArray, coarse: FloatArray) -> Points:
    """Return points to begin a population with: scan, descents, and what lies around the lowest of them."""
    rng = np.random.default_rng(len(scanned))
    points = [scanned, minima[:, :-1]]
    for *x, level in minima:
        if level <= minima[0, -1] + NEARLY:
            around = np.array(x) + rng.normal(size=(8, len(x))) * coarse
            points.append(np.clip(around, land.low, land.high))
    return Points.flown(land, np.concatenate(points))


def _polished(
    land: Landscape, cloud: Cloud, best: FloatArray, lowest: float, coarse: FloatArray
) -> tuple[FloatArray, float, FloatArray]:
    """Return the lowest point known after a descent from the cloud's lowest, its chi^2 and the steps used."""
    steps = np.clip(0.5 * cloud.likely.x.std(axis=0), coarse / 40.0, coarse)
    first = cloud.likely.lowest
    if cloud.likely.chi2[first] < lowest:
        best, lowest = cloud.likely.x[first], float(cloud.likely.chi2[first])
    x, level = land.descend(best, steps, np.arange(len(best)), 8)
    return (x, level, steps) if level < lowest else (best, lowest, steps)


def scan(land: Landscape, effort: Effort) -> FloatArray:
    """Return the points of a grid over drag and restitution (M, K), local minima of the grid first, then by chi^2.

    At each point the other coordinates have been fitted by two Gauss-Newton steps with one set of difference quotients.
    """
    counts = (effort.drags, effort.restitutions)
    axes = [np.linspace(land.low[k], land.high[k], count + 2)[1:-1] for k, count in enumerate(counts)]
    pairs = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    others = np.tile(land.problem.start()[2:], (len(pairs), 1))
    points, level = _levelled(land, np.column_stack((pairs, others)))
    grid = np.pad(level.reshape(counts), 1, constant_values=np.inf)
    shifts = [(i, j) for i in (0, 1, 2) for j in (0, 1, 2) if (i, j) != (1, 1)]
    beside = np.min([grid[i : counts[0] + i, j : counts[1] + j] for i, j in shifts], axis=0).ravel()
    return np.asarray(points[np.lexsort((level, level > beside))])


def _levelled(land: Landscape, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points with all coordinates but drag and restitution fitted, and chi^2 there."""
    others = np.arange(2, points.shape[1])
    if not others.size:
        return points, land.many(points)
    steps = land.problem.coarse_steps()
    moved = np.repeat(points, len(others), axis=0)
    moved[np.arange(len(moved)), np.tile(others, len(points))] += np.tile(steps[others], len(points))
    residuals = land.residuals(points)
    slopes = (land.residuals(moved).reshape(len(points), len(others), -1) - residuals[:, np.newaxis]) / steps[
        others, np.newaxis
    ]
    best, lowest = points, loss(residuals)
    for _ in range(2):
        moves = [np.linalg.lstsq(j.T, -r, rcond=None)[0] for j, r in zip(slopes, residuals, strict=True)]
        points = points.copy()
        points[:, others] = np.clip(points[:, others] + moves, land.low[others], land.high[others])
        residuals = land.residuals(points)
        level = loss(residuals)
        best, lowest = np.where((level < lowest)[:, np.newaxis], points, best), np.minimum(level, lowest)
    return best, lowest
