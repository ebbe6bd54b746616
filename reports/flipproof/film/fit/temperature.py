"""How much wider than the noise alone the intervals must be: by misfit, and by noise that neighbours share."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2 as distribution

from flipproof.film.fit.landscape import HUBER, Landscape
from slicemodel.trajectory import FloatArray


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
    row = taper * products
    return np.asarray(row[np.abs(lags[:, np.newaxis] - lags)])
