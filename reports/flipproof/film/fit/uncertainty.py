"""How well the data know a parameter: intervals, correlation, and an honest "cannot tell"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from flipproof.film.fit.estimate import Estimate
from slicemodel.trajectory import FloatArray

Verdict = Literal["told", "bounded above", "bounded below", "not told"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """One parameter, its estimate and its interval [SI].

    Parameters
    ----------
    value : float - estimate (lowest chi^2)
    low, high : float - ends of the interval
    deviation : float - standard deviation of what the data allow
    searched : (float, float) - admissible range that was searched
    verdict : whether the interval is bounded by the data on both sides, on one, or on neither
    """

    name: str
    value: float
    low: float
    high: float
    deviation: float
    searched: tuple[float, float]
    verdict: Verdict


def intervals(estimate: Estimate) -> tuple[Interval, ...]:
    """Return the interval of every free parameter; those of drag and restitution are to hold together in 95 % of cases.

    Counted on flights that the fitted equation had made (``benchmarks/twins.py``): "midpoint", "eq8" and "free-flight"
    hold it.

    Its ends are the farther of two: the quantiles of the cloud (1.25 % on either side, their distance from the median
    widened for roughness), and those of the profile likelihood (``Estimate.reach``). On a smooth landscape the two are
    one; on a rough one the first neglects small facets.
    """
    problem = estimate.problem
    low, high = problem.bounds()
    level = 0.975  # of one, so that those of drag and restitution hold together in 95 % (Bonferroni)
    tails = (1.0 - level) / 2.0, (1.0 + level) / 2.0
    found = []
    for k, name in enumerate(problem.free):
        middle, *tail = np.quantile(estimate.cloud[:, k], (0.5, *tails))
        ends = middle + np.sqrt(estimate.roughness) * (np.array(tail) - middle)
        ends = np.array([min(ends[0], estimate.reach[0, k]), max(ends[1], estimate.reach[1, k])])
        ends = np.clip(ends, low[k], high[k])
        # An end within 2 % of the searched range is that of the range; three quarters of it are not told.
        near = 0.02 * (high[k] - low[k])
        at_low, at_high = ends[0] - low[k] < near, high[k] - ends[1] < near
        ends[0], ends[1] = low[k] if at_low else ends[0], high[k] if at_high else ends[1]
        wide = ends[1] - ends[0] >= 0.75 * (high[k] - low[k])
        verdict: Verdict = "bounded below" if at_high else "bounded above" if at_low else "told"
        if wide or (at_low and at_high):
            verdict = "not told"
        found.append(
            Interval(
                name=name,
                value=problem.value(name, float(estimate.x[k])),
                low=problem.value(name, float(ends[0])),
                high=problem.value(name, float(ends[1])),
                deviation=float(np.std([problem.value(name, float(c)) for c in estimate.cloud[:, k]])),
                searched=(problem.value(name, float(low[k])), problem.value(name, float(high[k]))),
                verdict=verdict,
            )
        )
    return tuple(found)


def correlation(estimate: Estimate) -> FloatArray:
    """Return the correlation of the parameters over the cloud (K, K); 0 for a parameter that does not vary there."""
    values = np.array(
        [[estimate.problem.value(name, float(c)) for name, c in zip(estimate.problem.free, x, strict=True)]
         for x in estimate.cloud]
    )  # fmt: skip
    spread = values.std(axis=0)
    centred = np.where(spread > 0, (values - values.mean(axis=0)) / np.where(spread > 0, spread, 1.0), 0.0)
    return np.asarray(centred.T @ centred / len(values))
