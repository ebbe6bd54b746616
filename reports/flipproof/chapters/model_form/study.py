"""Numerical or physical? Does an error vanish with the step, or does a part of it stay: error(dt) = C dt^p + F.

A scheme that solves the equation it is held against has F = 0, and its error is a matter of step size. If F stays above
the numerical band, the two solve different equations (model form), or one of them has a bug. The fit is made to the
logarithm of the error: a rebound waits for the grid, so errors scatter by a *factor*, and small errors count as much as
large ones. A level is one datum, however many members it has: what its members have in common, a curve where C dt^p is
straight, then widens the intervals instead of passing for an F. Intervals are profile-likelihood intervals: a standard
error says nothing about an F that lies at its bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, least_squares
from scipy.stats import f as f_distribution

from flipproof.chapters.step_size.study import LEAST_COMMON
from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray

Verdict = Literal["step size", "model form", "undecided", "failure"]
Interval = tuple[float, float]

CONFIDENCE = 0.95
"""Probability that a stated interval holds the parameter, if the scatter is independent and log-normal."""

ORDERS: Interval = (0.2, 8.0)
"""Orders that the fit may find; below, C dt^p can no longer be told from F."""

ORDER_TOLERANCE = 0.25
"""An observed order further than this from the expected one is a failure, be it too low or too high."""

PHASE_FACTOR = 2.0
"""Impact phases alone change the error of a single run by up to this factor, up or down."""

ROUND_OFF = 1e-13
"""Errors below this fraction carry no order."""

CURVATURE = 0.25
"""An F below this share of the finest error may be the curve that higher orders bend into C dt^p: refine to tell."""

LEAST_SCATTER = 1e-6
"""Scatter of log(error) that even perfect data are given: the fit itself is no better."""

LEAST_LEVELS = 4
"""Step sizes that a fit of three parameters needs at the least."""

BAND = 1e-7
"""Numerical uncertainty of the reference as a fraction of the signal's scale."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelForm:
    """What stays of an error as the step goes to zero.

    Parameters
    ----------
    dt, error : arrays of one shape, (levels,) or (levels, members) - step [s] and error, as given
    coefficient, order, floor : float
        C [error / s^p], p and F of error = C dt^p + F; NaN if there is no fit.
    order_interval, floor_interval : (low, high)
        95 % profile intervals; NaN if there is no fit.
    scatter : float - standard deviation of the residuals of log(error), level by level
    expected_order, band : float - what the order was held against, and what F was
    verdict : {"step size", "model form", "undecided", "failure"}
    reason : str - the verdict in words
    """

    dt: FloatArray
    error: FloatArray
    coefficient: float
    order: float
    floor: float
    order_interval: Interval
    floor_interval: Interval
    scatter: float
    expected_order: float
    band: float
    verdict: Verdict
    reason: str

    def curve(self, dt: ArrayLike) -> FloatArray:
        """Return C dt^p + F."""
        return np.asarray(self.coefficient * np.asarray(dt, dtype=np.float64) ** self.order + self.floor)


def study_model_form(
    dt: ArrayLike,
    error: ArrayLike,
    *,
    expected_order: float = 1.0,
    band: float = BAND,
) -> ModelForm:
    """Decide whether an error is a matter of step size or of model form.

    Parameters
    ----------
    dt, error : array, shape (levels,) or (levels, members)
        Steps [s] and errors >= 0 against a reference; members are runs of nearly one step that differ in the phase of
        their impacts. A level's step is the geometric mean of its members'.
    expected_order : float
        Order that the scheme should have.
    band : float
        Numerical uncertainty of the reference, in the unit of ``error``; F below it is no difference.

    Returns
    -------
    ModelForm
        "model form" if F is above the band with confidence and no small part of the finest error seen; "step size" if
        F may be zero or such a small part, and the order is the expected one; "undecided" if the data do not reach far
        enough; "failure" if the error is not finite, oscillates, or falls at another order.
    """
    steps, errors = np.asarray(dt, dtype=np.float64), np.asarray(error, dtype=np.float64)
    if steps.shape != errors.shape or steps.ndim not in (1, 2):
        raise ValueError(f"dt has shape {steps.shape}, error {errors.shape}: one shape (levels[, members]) is needed")
    if not (np.all(np.isfinite(steps)) and np.all(steps > 0)):
        raise ValueError("dt holds steps that are not positive and finite")
    levels = _by_level(steps, errors)
    refusal = _refusal(levels)
    fit = None if refusal else _Fit.of(levels.dt, levels.error)
    if fit is None:
        nan = (math.nan, math.nan)
        verdict, reason = refusal or ("failure", "no fit of C Δt^p + F was found")
        parameters, intervals, scatter = (math.nan,) * 3, (nan, nan), math.nan
    else:
        parameters = (math.exp(fit.best[0]), float(fit.best[1]), float(fit.best[2]))
        intervals = (fit.interval(1), fit.interval(2))
        scatter = fit.scatter
        verdict, reason = _verdict(fit, intervals, levels, expected_order, band)
    return ModelForm(
        dt=steps,
        error=errors,
        coefficient=parameters[0],
        order=parameters[1],
        floor=parameters[2],
        order_interval=intervals[0],
        floor_interval=intervals[1],
        scatter=scatter,
        expected_order=expected_order,
        band=band,
        verdict=verdict,
        reason=reason,
    )


@dataclass(frozen=True, slots=True)
class _Levels:
    """Step and root-mean-square error of every level, the coarsest first, and the members of a level."""

    dt: FloatArray
    error: FloatArray
    members: int


def _by_level(dt: FloatArray, error: FloatArray) -> _Levels:
    steps = dt[:, np.newaxis] if dt.ndim == 1 else dt
    errors = error[:, np.newaxis] if error.ndim == 1 else error
    mean = np.exp(np.log(steps).mean(axis=1))
    order = np.argsort(-mean)
    return _Levels(mean[order], np.sqrt((errors[order] ** 2).mean(axis=1)), steps.shape[1])


def _refusal(levels: _Levels) -> tuple[Verdict, str] | None:
    """Return why these errors have no fit, or None."""
    if not np.all(np.isfinite(levels.error)):
        where = levels.dt[~np.isfinite(levels.error)][0]
        return "failure", f"the error at Δt = {where:.2g} s is not finite"
    if len(np.unique(levels.dt)) < LEAST_LEVELS:
        return "undecided", f"{len(np.unique(levels.dt))} step sizes; {LEAST_LEVELS} are needed for C, p and F"
    if levels.error.min() < ROUND_OFF:
        return "undecided", f"errors reach round-off ({levels.error.min():.1g}), where an order means nothing"
    # What impact phases may do to the quotient of two levels, less the more members are averaged.
    allowed = PHASE_FACTOR ** (2.0 / math.sqrt(levels.members))
    rise = levels.error[1:] / np.minimum.accumulate(levels.error)[:-1]
    k = int(rise.argmax())
    if rise[k] > allowed:
        return (
            "failure",
            f"oscillation: at Δt = {levels.dt[k + 1]:.2g} s the error is {rise[k]:.1f} times that of a coarser step",
        )
    return None


def _verdict(
    fit: _Fit,
    intervals: tuple[Interval, Interval],
    levels: _Levels,
    expected: float,
    band: float,
) -> tuple[Verdict, str]:
    (order_low, order_high), (floor_low, floor_high) = intervals
    finest = float(levels.error[-1])
    if fit.scatter > math.log(PHASE_FACTOR):
        return "failure", f"errors scatter {math.exp(fit.scatter):.1f}-fold about C Δt^p + F: they do not follow it"
    if floor_low > band and floor_high > CURVATURE * finest:
        low, high = f"{floor_low:.2g}", f"{floor_high:.2g}"
        left = low if low == high else f"{low} to {high}"
        return "model form", f"an error of {left} remains as Δt goes to zero (band {band:.1g})"
    if order_low > expected + ORDER_TOLERANCE:
        return "failure", f"order too high: {order_low:.2f} to {order_high:.2f}, not {expected:g}"
    if order_high < expected - ORDER_TOLERANCE:
        return "failure", f"order too low: {order_low:.2f} to {order_high:.2f}, not {expected:g}"
    if floor_high > finest:
        return "undecided", f"F may be as large as {floor_high:.2g}, the finest error is {finest:.2g}: refine further"
    order = float(fit.best[1])
    if abs(order - expected) > ORDER_TOLERANCE:
        return (
            "undecided",
            f"order {order:.2f} ({order_low:.2f} to {order_high:.2f}) instead of {expected:g}: add levels",
        )
    return "step size", f"order {order:.2f}; F at zero, at most {floor_high:.2g} where the finest error is {finest:.2g}"


@dataclass(frozen=True, slots=True)
class _Fit:
    """Least squares of log(C dt^p + F) - log(error) in (log C, p, F)."""

    log_dt: FloatArray
    log_error: FloatArray
    best: FloatArray
    cost: float

    @classmethod
    def of(cls, dt: FloatArray, error: FloatArray) -> _Fit:
        """Return the best of fits from several starts: F nothing, a little, nearly all of the finest error."""
        log_dt, log_error = np.log(dt), np.log(error)
        smallest = float(error.min())
        trial = cls(log_dt, log_error, np.zeros(3), math.inf)
        starts = [np.array([0.0, p, share * smallest]) for p in (0.5, 1.0, 2.0) for share in (0.0, 0.3, 0.95)]
        for start in starts:
            start[0] = float(np.mean(log_error - start[1] * log_dt))
        best, cost = min((trial.minimum(start, None) for start in starts), key=lambda found: found[1])
        return cls(log_dt, log_error, best, cost)

    @property
    def freedom(self) -> int:
        return len(self.log_dt) - 3

    @property
    def scatter(self) -> float:
        return math.sqrt(self.cost / self.freedom)

    def minimum(self, start: FloatArray, fixed: int | None) -> tuple[FloatArray, float]:
        """Return the best parameters from ``start`` and their cost, with parameter ``fixed`` held."""
        largest = math.exp(float(self.log_error.max()))
        low = np.array([-690.0, ORDERS[0], 0.0])
        high = np.array([690.0, ORDERS[1], 2.0 * largest])
        moving = np.array([j for j in range(3) if j != fixed])
        # F is measured in its own size: near zero the finest error is the scale on which it matters.
        scale = np.array([1.0, 1.0, math.exp(float(self.log_error.min()))])

        def residuals(part: FloatArray) -> FloatArray:
            whole = start.copy()
            whole[moving] = part * scale[moving]
            with np.errstate(over="ignore"):
                return np.asarray(np.log(np.exp(whole[0] + whole[1] * self.log_dt) + whole[2]) - self.log_error)

        def slopes(part: FloatArray) -> FloatArray:
            whole = start.copy()
            whole[moving] = part * scale[moving]
            with np.errstate(over="ignore", divide="ignore"):
                step_error = np.exp(whole[0] + whole[1] * self.log_dt)
                share = 1.0 / (1.0 + whole[2] / step_error)
                columns = np.array([share, share * self.log_dt, scale[2] / (step_error + whole[2])])
            return np.asarray(columns[moving].T)

        bounds = (low[moving] / scale[moving], high[moving] / scale[moving])
        inside = np.clip(start[moving] / scale[moving], bounds[0], bounds[1])
        found = least_squares(residuals, inside, slopes, bounds=bounds, x_scale="jac", max_nfev=400)
        whole = start.copy()
        whole[moving] = found.x * scale[moving]
        return whole, float(2.0 * found.cost)

    def interval(self, j: int) -> Interval:
        """Return the values of parameter ``j`` that the data do not refuse, with the others fitted anew for each."""
        margin = float(f_distribution.ppf(CONFIDENCE, 1, self.freedom)) * max(self.scatter, LEAST_SCATTER) ** 2
        bounds = ((-690.0, 690.0), ORDERS, (0.0, 2.0 * math.exp(float(self.log_error.max()))))[j]

        def excess(value: float) -> float:
            costs = []
            for start in (self.best.copy(), np.array([self.best[0], self.best[1], 0.0])):
                start[j] = value
                # Follow the ridge: with another p or F, C must change too, or the search starts far off.
                if j != 0:
                    step_error = np.maximum(np.exp(self.log_error) - start[2], 1e-3 * np.exp(self.log_error))
                    start[0] = float(np.mean(np.log(step_error) - start[1] * self.log_dt))
                costs.append(self.minimum(start, j)[1])
            return min(costs) - self.cost - margin

        centre = float(self.best[j])
        width = max(abs(centre) * 1e-3, 1e-3) if j < 2 else max(centre, math.exp(float(self.log_error.min()))) * 1e-2
        return _edge(excess, centre, -width, bounds[0]), _edge(excess, centre, width, bounds[1])


def _edge(excess: Callable[[float], float], centre: float, width: float, bound: float) -> float:
    """Return where ``excess`` becomes positive, going out in growing strides; the bound if it never does."""
    inside = centre
    while True:
        outside = centre + width
        if not (outside - bound) * width < 0:  # also when a number is not one: the search must end
            outside = bound
        if excess(outside) > 0:
            if excess(inside) >= 0:  # the fit hangs at its best point; nothing nearer can be told apart
                return inside
            return float(brentq(excess, inside, outside, rtol=1e-4, xtol=1e-300))
        if outside == bound:
            return bound
        inside, width = outside, 3.0 * width


def study_signals(
    reference: Trajectory, runs: Sequence[Sequence[Trajectory]], *, expected_order: float = 1.0, band: float = BAND
) -> dict[str, ModelForm]:
    """Decide for omega, theta and r_CM of a scheme against an equation.

    Parameters
    ----------
    reference : Trajectory - on uniform times
    runs : levels of members, as ``plan_step_size`` plans them - grids that share times with the reference

    Returns
    -------
    dict
        Signal -> decision; errors are the largest over the shared times, of omega as a fraction of omega_0, of theta
        in rad, of r_CM as a fraction of L.
    """
    scales = {"omega": abs(reference.scenario.omega0), "theta": 1.0, "r_cm": reference.scenario.bottle.length}
    dt = np.array([[run.settings["dt"] for run in level] for level in runs])
    return {
        signal: study_model_form(
            dt,
            np.array([[_largest(reference, run, signal) / scale for run in level] for level in runs]),
            expected_order=expected_order,
            band=band,
        )
        for signal, scale in scales.items()
    }


def _largest(reference: Trajectory, run: Trajectory, signal: str) -> float:
    """Return the largest difference of a signal at the times that both grids hold; NaN if a run is not complete."""
    if not (reference.ok and run.ok):
        return math.nan
    fine, coarse = len(run.t) - 1, len(reference.t) - 1
    common = math.gcd(fine, coarse)
    if common < LEAST_COMMON:
        raise ValueError(f"{fine} steps and {coarse} reference intervals share only {common} intervals")
    difference = getattr(run, signal)[:: fine // common] - getattr(reference, signal)[:: coarse // common]
    return float(np.abs(difference).max())
