"""What the data leave possible: points of parameter space, as many where chi^2 is low as exp(-chi^2 / 2T) says.

Kinks and jumps of chi^2 make its curvature at the minimum a poor guide to how far the data allow a parameter to go, and
side minima too narrow for a grid lie within that reach. So a population of points is cooled: at a high temperature T
it covers what the scan found, then T falls step by step to the temperature of the noise, and at each step the points
are drawn again by weight and moved by Metropolis steps along differences of other points (differential evolution Monte
Carlo, ter Braak 2006), which needs no derivative and follows any valley. Before the data every coordinate of the search
is equally likely within its bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flipproof.film.fit.landscape import Landscape, loss
from slicemodel.trajectory import FloatArray

COARSEST: Final = 60
"""Temperatures at the most."""

HALF: Final = 0.5
"""Share of the points that a step of cooling leaves effective."""

AIM: Final = (0.15, 0.40)
"""Shares of accepted steps between which the length of a step is left alone."""

WARM: Final = 2.5
"""Temperature of the population that looks for the edge of what is likely, in units of the last."""

JUMP: Final = 0.1
"""Share of steps of full length, from one valley to another."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How many flights a fit may cost.

    Parameters
    ----------
    drags, restitutions : int - points of the scan along each
    starts : int - descents
    points : int - of the population
    moves : int - Metropolis steps of a point at each temperature
    keep : int - steps at the last temperature, each of which is kept
    again : bool - whether to start again from a finer scan if no descent explains the measurement
    pushes : int - trials at each end of an interval
    """

    drags: int = 9
    restitutions: int = 6
    starts: int = 4
    points: int = 120
    moves: int = 2
    keep: int = 8
    again: bool = True
    pushes: int = 10


USUAL: Final = Effort()
"""What a fit may cost unless another effort is asked for."""


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

    @classmethod
    def joined(cls, parts: Sequence[Points]) -> Points:
        """Return all points of ``parts``."""
        x, rows, chi2 = ([getattr(part, name) for part in parts] for name in ("x", "rows", "chi2"))
        return cls(x=np.concatenate(x), rows=np.concatenate(rows), chi2=np.concatenate(chi2))

    def taken(self, chosen: NDArray[np.intp]) -> Points:
        """Return the points of the indices ``chosen``."""
        return Points(x=self.x[chosen], rows=self.rows[chosen], chi2=self.chi2[chosen])

    @property
    def lowest(self) -> int:
        """Index of the lowest chi^2."""
        return int(np.argmin(self.chi2))


@dataclass(frozen=True, slots=True, kw_only=True)
class Cloud:
    """A cooled population.

    Parameters
    ----------
    likely : Points - equally weighted
    edge : Points - of a last population at ``WARM`` times the temperature, which reaches beyond what is likely
    accepted : float - share of the last steps that were accepted
    """

    likely: Points
    edge: Points
    accepted: float


def cool(land: Landscape, seeds: Points, final: float, effort: Effort, seed: int) -> Cloud:
    """Return a population at temperature ``final``.

    Parameters
    ----------
    land : Landscape
    seeds : Points - to begin with
    final : float - temperature at the end: 1 if the residuals are all noise and the noise is known
    effort : Effort - points, moves at each temperature, moves at the end
    seed : int
    """
    rng = np.random.default_rng(seed)
    temperature = _next(seeds.chi2, np.inf, final)
    chosen = rng.choice(len(seeds.x), effort.points, p=_weights(seeds.chi2, np.inf, temperature))
    points = seeds.taken(chosen)
    length, share = 1.0, 0.0
    for _ in range(COARSEST):
        for _ in range(effort.moves):
            points, share = _move(land, rng, points, temperature, length)
            length = _adapted(length, share)
        if temperature == final:
            break
        cooler = _next(points.chi2, temperature, final)
        points = points.taken(_resampled(rng, _weights(points.chi2, temperature, cooler)))
        temperature = cooler
    kept, warm, shares = [], [], []
    for _ in range(effort.keep):
        points, share = _move(land, rng, points, temperature, length)
        kept.append(points)
        shares.append(share)
    for _ in range(max(1, effort.keep // 2)):
        points, _ = _move(land, rng, points, WARM * temperature, length)
        warm.append(points)
    return Cloud(likely=Points.joined(kept), edge=Points.joined(warm), accepted=float(np.mean(shares)))


def _adapted(length: float, share: float) -> float:
    if share < AIM[0]:
        return max(0.7 * length, 0.05)
    return min(1.3 * length, 2.0) if share > AIM[1] else length


def _weights(chi2: FloatArray, hot: float, cold: float) -> FloatArray:
    power = -0.5 * (chi2 - chi2.min()) * (1.0 / cold - 1.0 / hot)
    weights = np.exp(power)
    return np.asarray(weights / weights.sum())


def _next(chi2: FloatArray, hot: float, final: float) -> float:
    """Return the lowest temperature, at least ``final``, that leaves ``HALF`` of the points effective."""

    def effective(cold: float) -> float:
        return float(1.0 / np.sum(_weights(chi2, hot, cold) ** 2) / len(chi2))

    if effective(final) >= HALF:
        return final
    low, high = final, min(hot, max(float(np.ptp(chi2)), final) * 10.0)
    for _ in range(60):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if effective(middle) >= HALF else (middle, high)
    # Where points coincide the share may never be reached: always go on.
    return float(min(high, 0.9 * hot))


def _resampled(rng: np.random.Generator, weights: FloatArray) -> NDArray[np.intp]:
    """Return indices drawn by weight, evenly (systematic resampling)."""
    count = len(weights)
    ladder = (np.arange(count) + rng.uniform()) / count
    return np.minimum(np.searchsorted(np.cumsum(weights), ladder), count - 1)


def _move(
    land: Landscape, rng: np.random.Generator, points: Points, temperature: float, length: float
) -> tuple[Points, float]:
    """Move each half of the population along differences of the other half; return it and the share accepted."""
    x, rows, chi2 = points.x.copy(), points.rows.copy(), points.chi2.copy()
    count, dimensions = x.shape
    shuffled = rng.permutation(count)
    halves = shuffled[: count // 2], shuffled[count // 2 :]
    taken = 0
    for mine, others in (halves, halves[::-1]):
        pairs = np.array([rng.choice(others, 2, replace=False) for _ in mine])
        usual = length * 2.38 / np.sqrt(2.0 * dimensions)
        stride = np.where(rng.uniform(size=len(mine)) < JUMP, 1.0, usual)
        apart = x[pairs[:, 0]] - x[pairs[:, 1]]
        jitter = rng.normal(size=apart.shape) * 0.02 * x[others].std(axis=0)
        tried = x[mine] + stride[:, None] * apart + jitter
        inside = np.flatnonzero(((tried >= land.low) & (tried <= land.high)).all(axis=1))
        chances = rng.uniform(size=len(mine))[inside]
        if not inside.size:
            continue
        new, old = Points.flown(land, tried[inside]), mine[inside]
        accept = np.log(chances) < -0.5 * (new.chi2 - chi2[old]) / temperature
        x[old[accept]], rows[old[accept]], chi2[old[accept]] = new.x[accept], new.rows[accept], new.chi2[accept]
        taken += int(accept.sum())
    return Points(x=x, rows=rows, chi2=chi2), taken / count


def roughness(cloud: Cloud, variance: float, seed: int, draws: int = 400) -> float:
    """Return by what factor a fit on this landscape lowers chi^2 more than one on a smooth one, at least 1.

    A fit of K parameters on a smooth landscape lowers the chi^2 of the truth by K on average; one that may choose among
    facets lowers it by more, and the likelihood ratio that bounds an interval has to grow alike (Bartlett's
    correction). Found by simulation: points of the cloud in turn are the truth, noise is drawn anew, and the lowest
    chi^2 among all flown points is looked up, once with what was flown there and once with the plane through it; no
    flight is made.

    Parameters
    ----------
    variance : float - of the noise in units of the residuals'
    draws : int - simulated measurements
    """
    rng = np.random.default_rng(seed)
    flown = Points.joined((cloud.likely, cloud.edge))
    plane = np.column_stack((np.ones(len(flown.x)), flown.x - flown.x.mean(axis=0)))
    smooth = plane @ np.linalg.lstsq(plane, flown.rows, rcond=None)[0]
    truths = rng.integers(len(cloud.likely.x), size=draws)
    noise = np.sqrt(variance) * rng.normal(size=(draws, flown.rows.shape[1]))
    rough, even = (_fall(rows, truths, noise) for rows in (flown.rows, smooth))
    return max(1.0, rough / even) if even > 0 else 1.0


def _fall(rows: FloatArray, truths: NDArray[np.intp], noise: FloatArray) -> float:
    """Return by how much the lowest of all ``rows`` is below the truth's on average when noise is added to a truth."""
    true = rows[truths]
    apart = (true**2).sum(axis=1)[:, None] - 2.0 * true @ rows.T + (rows**2).sum(axis=1)
    along = noise @ rows.T - (noise * true).sum(axis=1)[:, None]
    return float(-np.min(apart + 2.0 * along, axis=1).mean())
