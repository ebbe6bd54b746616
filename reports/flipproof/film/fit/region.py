"""chi^2 over the parameters of a fit: asked for, descended, and filled evenly where it exceeds the lowest by little.

Kinks and jumps of chi^2 make its curvature at the minimum a poor guide to how far the data allow a parameter to go, and
side minima too narrow for a grid lie within that reach. So a box along the principal axes of the best points is filled
evenly (Halton's sequence) and drawn anew around what is low enough, until it holds all of that and little more. Points
of the last box stand for the same volume each: weighed by exp(-chi^2 / 2T) they are the posterior under a flat prior,
and the farthest of them below a bound of chi^2 are the ends of a profile likelihood.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.optimize import least_squares
from scipy.stats import chi2 as distribution
from scipy.stats.qmc import Halton

from flipproof.film.fit.problem import Problem
from slicemodel.trajectory import FloatArray

HUBER: Final = 3.0
"""Residuals beyond this many standard deviations count linearly (Huber's loss), so that a slipped marker does not
decide; within it nothing changes."""

DESCENT: Final = 12
"""Trial points of a descent from the scan, at the most; each may take difference quotients, too."""

Tick = Callable[[int], object]


class Landscape:
    """chi^2 of a problem, and how often it was asked for; ``tick`` is called with the number of flights made.

    Residuals are divided by ``problem.noise * scale`` before the loss. ``seconds`` are those that a search may take;
    ``complete`` is True until something was left out for want of them.
    """

    def __init__(self, problem: Problem, *, tick: Tick = lambda _: None, seconds: float = math.inf) -> None:
        self.problem, self.tick = problem, tick
        self.low, self.high = problem.bounds()
        self.scale, self.flights = 1.0, 0
        self.seconds, self.began, self.complete = seconds, perf_counter(), True

    def affords(self, flights: int) -> bool:
        """Return whether there is time for so many more flights and a last descent; if not, the search is incomplete.

        They are taken to last as long as those that were made.
        """
        if math.isinf(self.seconds):
            return True
        took = perf_counter() - self.began
        more = flights + DESCENT * (1 + 2 * len(self.low))
        enough = took + took / max(1, self.flights) * more <= self.seconds
        self.complete = self.complete and enough
        return enough

    def residuals(self, points: FloatArray) -> FloatArray:
        """Return the residuals at many points (M, K) in standard deviations, shape (M, P)."""
        rows = self.problem.residuals(points)
        self.flights += len(points)
        self.tick(len(points))
        return np.asarray(rows / self.scale)

    def residual(self, x: FloatArray) -> FloatArray:
        """Return the residuals at ``x`` in standard deviations, shape (P,)."""
        return np.asarray(self.residuals(x[np.newaxis])[0])

    def jacobian(self, x: FloatArray, steps: FloatArray) -> FloatArray:
        """Return d residual / d x by central difference quotients over ``steps``, at bounds one-sided, shape (P, K)."""
        up = np.minimum(x + np.diag(steps), self.high)
        down = np.maximum(x - np.diag(steps), self.low)
        above, below = np.split(self.residuals(np.concatenate((up, down))), 2)
        return np.asarray((above - below).T / np.diag(up - down))

    def descend(self, x: FloatArray, steps: FloatArray, flights: int) -> tuple[FloatArray, float]:
        """Minimise chi^2 from ``x``; return where it ended, and chi^2 there.

        ``steps`` (K,) are those of the difference quotients, ``flights`` the trial points at the most.
        """
        # The solver wants its start strictly inside.
        margin = 1e-9 * (self.high - self.low)
        found = least_squares(
            self.residual, np.clip(x, self.low + margin, self.high - margin), bounds=(self.low, self.high),
            jac=partial(self.jacobian, steps=steps), x_scale=steps, loss="huber", f_scale=HUBER, ftol=1e-5,
            xtol=1e-5, gtol=1e-8, max_nfev=flights,
        )  # fmt: skip
        return np.asarray(found.x), 2.0 * float(found.cost)


def loss(residuals: FloatArray) -> FloatArray:
    """Return the sum of Huber's loss over the last axis: squares up to ``HUBER``, straight lines beyond."""
    size = np.abs(residuals)
    return np.asarray(np.where(size <= HUBER, size * size, 2.0 * HUBER * size - HUBER * HUBER).sum(axis=-1))


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Points of the landscape that were flown.

    Parameters
    ----------
    x : (S, K) - coordinates
    rows : (S, P) - residuals at each
    chi2 : (S,) - Huber's loss of each
    """

    x: FloatArray
    rows: FloatArray
    chi2: FloatArray

    @classmethod
    def flown(cls, land: Landscape, x: FloatArray) -> Points:
        """Fly at the coordinates ``x``."""
        rows = land.residuals(x)
        return cls(x=x, rows=rows, chi2=loss(rows))

    def with_more(self, other: Points) -> Points:
        """Return these points and those of ``other``."""
        pairs = (self.x, other.x), (self.rows, other.rows), (self.chi2, other.chi2)
        x, rows, chi2 = (np.concatenate(pair) for pair in pairs)
        return Points(x=x, rows=rows, chi2=chi2)

    def below(self, level: float, fewest: int, first: int = 0) -> Points:
        """Return the points from ``first`` on of chi^2 up to ``level``, and at least the ``fewest`` lowest of them."""
        x, rows, chi2 = self.x[first:], self.rows[first:], self.chi2[first:]
        low = chi2 <= max(level, np.sort(chi2)[min(fewest, len(chi2)) - 1])
        return Points(x=x[low], rows=rows[low], chi2=chi2[low])

    def drawn(self, temperature: float, count: int = 2000) -> NDArray[np.intp]:
        """Return indices of ``count`` points, each as often as exp(-chi^2 / 2T) says (systematic resampling)."""
        weights = np.exp(-0.5 * (self.chi2 - self.chi2.min()) / temperature)
        ladder = (np.arange(count) + 0.5) / count
        return np.minimum(np.searchsorted(np.cumsum(weights) / weights.sum(), ladder), len(weights) - 1)


@dataclass(frozen=True, slots=True)
class Box:
    """A box along the principal axes of some points: ``centre + axes @ u`` with u from ``low`` to ``high``."""

    centre: FloatArray
    axes: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def around(cls, x: FloatArray, least: FloatArray) -> Box:
        """Return the box around points (S, K), whose standard deviations count as ``least`` (K,) or more.

        On either side it reaches beyond them by 15 % of their extent.
        """
        centre = np.asarray(x.mean(axis=0), dtype=np.float64)
        axes = np.asarray(np.linalg.cholesky(np.cov(x.T) + np.diag(least**2)), dtype=np.float64)
        low, high = _extent(centre, axes, x)
        reach = 0.15 * (high - low)
        return cls(centre, axes, low - reach, high + reach)

    def at(self, shares: FloatArray) -> FloatArray:
        """Return coordinates at shares (S, K) of the box, from 0 to 1."""
        return np.asarray(self.centre + (self.low + (self.high - self.low) * shares) @ self.axes.T)

    def fits(self, x: FloatArray) -> bool:
        """Return whether points (S, K) lie inside and reach over half of every edge."""
        low, high = _extent(self.centre, self.axes, x)
        edge = self.high - self.low
        inside = (low >= self.low + 0.02 * edge) & (high <= self.high - 0.02 * edge)
        return bool((inside & (high - low >= 0.5 * edge)).all())


def _extent(centre: FloatArray, axes: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    u = np.linalg.solve(axes, (x - centre).T)
    return np.asarray(u.min(axis=1)), np.asarray(u.max(axis=1))


def explored(land: Landscape, seeds: Points, within: float, count: int) -> Points:
    """Return ``count`` points or more, spread evenly over where chi^2 exceeds its lowest value by at most ``within``.

    They are fewer, and less even, if there is no time for more. ``seeds`` are the points to begin with; at least 12 for
    each parameter tell where a box lies.
    """
    dimensions = len(land.low)
    sequence, least = Halton(dimensions, scramble=False), 1e-12 * (land.high - land.low)
    fewest = 12 * dimensions
    pool, box, first = seeds, None, 0
    for _ in range(40):
        level = float(pool.chi2.min()) + within
        near = pool.below(level, fewest).x
        if box is None or not box.fits(near):
            box, first = Box.around(near, least), len(pool.x)
        elif (pool.chi2[first:] <= level).sum() >= count:
            break
        x = box.at(sequence.random(count))
        pool = pool.with_more(Points.flown(land, x[((x >= land.low) & (x <= land.high)).all(axis=1)]))
        if len(pool.x) > first and not land.affords(count):
            break
    return pool.below(float(pool.chi2.min()) + within, fewest, first)


# ---------------------------------------------------------------------- how much wider than noise intervals are


def temperature(land: Landscape, x: FloatArray, steps: FloatArray) -> float:
    """Return the variance that intervals must rest on, in units of that of the residuals' scale.

    Independent noise that the equation explains: chi^2 per degree of freedom, which says what the noise really is.
    Otherwise (a misfit, or an omega whose neighbours share noise) the ratio of two variances of an estimate: the one
    that the residuals' own autocovariance gives (sandwich formula) and the one that independent residuals would have;
    the larger of those of drag and restitution, and at least the first.
    """
    residual = np.clip(land.residual(x), -HUBER, HUBER)
    freedom = len(residual) - len(x)
    independent = float(residual @ residual) / freedom
    correlated = land.problem.measured.quantity == "omega"
    if not correlated and fits(land.scale**2 * independent * freedom, freedom):
        return independent
    slopes = land.jacobian(x, steps)
    # A prior as wide as the bounds keeps the curvature invertible where the data say nothing.
    inverse = np.linalg.inv(slopes.T @ slopes + np.diag((land.high - land.low) ** -2.0))
    meat = slopes.T @ autocovariance(residual) @ slopes
    shared = np.diag(inverse @ meat @ inverse) / np.diag(inverse)
    return max(independent, float(shared[:2].max()))


def fits(chi2: float, freedom: int) -> bool:
    """Return whether noise alone makes a chi^2 this large more often than in one of a thousand cases."""
    return bool(distribution.sf(chi2, freedom) > 0.001)


def autocovariance(residual: FloatArray) -> FloatArray:
    """Return the covariance matrix of the residuals, the same for equal lags, tapered to 0 (Bartlett), shape (P, P)."""
    count = len(residual)
    reach = max(1, round(4.0 * (count / 100.0) ** (2.0 / 9.0)) * 3)
    lags = np.arange(count)
    taper = np.clip(1.0 - lags / (reach + 1.0), 0.0, None)
    products = np.array([residual[: count - k] @ residual[k:] / count if taper[k] else 0.0 for k in lags])
    return np.asarray(toeplitz(taper * products))


def roughness(region: Points, variance: float, seed: int) -> float:
    """Return by what factor a fit on this landscape lowers chi^2 more than one on a smooth one, at least 1.

    A fit of K parameters on a smooth landscape lowers the chi^2 of the truth by K on average; one that may choose among
    facets lowers it by more, and the likelihood ratio that bounds an interval has to grow alike (Bartlett's
    correction). Found by simulation: points of the region in turn are the truth, noise is drawn anew, and the lowest
    chi^2 among all flown points is looked up, once with what was flown there and once with the plane through it; no
    flight is made.

    ``variance`` is that of the noise in units of the residuals'.
    """
    rng = np.random.default_rng(seed)
    plane = np.column_stack((np.ones(len(region.x)), region.x - region.x.mean(axis=0)))
    smooth = plane @ np.linalg.lstsq(plane, region.rows, rcond=None)[0]
    truths = region.drawn(variance, 400)
    noise = np.sqrt(variance) * rng.normal(size=(len(truths), region.rows.shape[1]))
    rough, even = (_fall(rows, truths, noise) for rows in (region.rows, smooth))
    return max(1.0, rough / even) if even > 0 else 1.0


def _fall(rows: FloatArray, truths: NDArray[np.intp], noise: FloatArray) -> float:
    """Return by how much the lowest of all ``rows`` is below the truth's on average when noise is added to a truth."""
    true = rows[truths]
    apart = (true**2).sum(axis=1)[:, None] - 2.0 * true @ rows.T + (rows**2).sum(axis=1)
    along = noise @ rows.T - (noise * true).sum(axis=1)[:, None]
    return float(-np.min(apart + 2.0 * along, axis=1).mean())
