"""Least squares on a rough landscape: a grid of starts, descents with wide difference quotients, an explored region.

Each rebound puts a kink into theta(t) as a function of the parameters, and a rebound that waits for the grid a jump.
Difference quotients therefore reach over many kinks: about half the standard error of the estimate, never the square
root of round-off. Several starts, from a grid over drag and restitution, guard against side minima. What lies between
and beyond them is left to an even filling of all that the data allow (``region``), and the lowest point that any of the
three has seen is descended from once more.

flipproof's own equations make a flight in less than a millisecond and a usual search in seconds; a solver in a process
of its own may take a thousand times as long, so a ``Budget`` says which search a given time allows, and the search
leaves out what there is no time for.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.ndimage import minimum_filter

from flipproof.film.fit.problem import Problem
from flipproof.film.fit.region import DESCENT, Landscape, Points, Tick, explored, fits, loss, roughness, temperature
from flipproof.frame.solvers import solve
from slicemodel.trajectory import FloatArray

LIKELY: Final = 5.024
"""97.5 % point of chi^2 with one degree of freedom: two intervals that miss in 2.5 % each miss in 5 % together."""

REACH: Final = 15.0
"""chi^2 above the lowest up to which parameters are explored at the least: 0.06 % of two lie beyond, 0.5 % of four."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How many flights a search may make.

    Parameters
    ----------
    grid : pair of int - points of the scan along drag and restitution
    starts : int - descents
    points : int - of the explored region, at the least
    again : bool - whether to start again from a finer scan if no descent explains the measurement
    """

    grid: tuple[int, int] = (9, 6)
    starts: int = 4
    points: int = 400
    again: bool = True


USUAL: Final = Effort()
"""The search that is made unless another is asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The best parameters found, and all others that the data allow.

    Parameters
    ----------
    x : (K,) - coordinates of the lowest chi^2
    chi2 : float - Huber's loss at ``x`` in units of the noise
    temperature : float - variance that the intervals rest on, in units of the noise's
    roughness : float - by what factor intervals are wider, squared, than on a smooth landscape
    minima : (M, K + 1) - end of each descent and Huber's loss there in units of the noise, best first
    cloud : (S, K) - coordinates that the data allow, each as often as exp(-chi^2 / 2T) says
    reach : (2, K) - lowest and highest of each coordinate at which chi^2, all others fitted, exceeds the lowest by no
        more than ``LIKELY * temperature * roughness``
    flights : int - runs of the solver
    complete : bool - whether the time sufficed for the whole search
    """

    problem: Problem
    x: FloatArray
    chi2: float
    temperature: float
    roughness: float
    minima: FloatArray
    cloud: FloatArray
    reach: FloatArray
    flights: int
    complete: bool

    @property
    def freedom(self) -> int:
        """Values less parameters."""
        return len(self.problem.measured.t) - len(self.x)

    def residual(self) -> FloatArray:
        """Return measured minus predicted [rad or rad/s], shape (P,)."""
        return np.asarray(self.problem.measured.values - self.problem.predicted(self.x[np.newaxis])[0])


def estimate(
    problem: Problem,
    effort: Effort = USUAL,
    *,
    seconds: float = math.inf,
    tick: Tick = lambda _: None,
    seed: int = 0,
) -> Estimate:
    """Return the least-squares estimate and what else the data allow.

    What ``seconds`` do not suffice for is left out. ``tick`` is called with the number of flights made; ``seed`` is
    that of the noise that is simulated to correct intervals for roughness.
    """
    land = Landscape(problem, tick=tick, seconds=seconds)
    scanned, ends = _descents(land, effort.grid, effort.starts)
    if effort.again and not fits(float(loss(land.residuals(ends)).min()), len(problem.measured.t) - len(problem.free)):
        # Either the equation is wrong, or every descent ended in a side minimum: look between the starts.
        drags, restitutions = effort.grid
        finer, many = (2 * drags + 1, 2 * restitutions + 1), 4 * effort.starts
        if land.affords(_most(land, finer, many) + effort.points):
            more = _descents(land, finer, many)
            scanned, ends = (np.concatenate(pair) for pair in zip((scanned, ends), more, strict=True))

    # What no parameter explains must not be weighed as if it were noise: it would all be outliers.
    residuals = land.residuals(ends)
    steps = problem.coarse_steps()
    typical = float((1.4826 * np.median(np.abs(residuals), axis=1)).min())
    land.scale = typical if typical > 2.0 else 1.0
    levels = loss(residuals / land.scale)
    order = np.argsort(levels)
    near = ends[levels <= levels.min() + 30.0]
    if not land.affords(len(scanned) + len(ends) + 18 * near.size + effort.points):
        near = ends[order[:1]]
    around = _around(land, near)
    known = Points.flown(land, np.concatenate((scanned, ends, around)))
    best, lowest = ends[order[0]], float(levels[order[0]])
    variance, rough, needed = temperature(land, best, steps), 1.0, REACH
    for _ in range(4):
        within = needed * variance
        known = explored(land, known, within, effort.points)
        cloud = known.x[known.drawn(variance)]
        steps = np.clip(0.5 * cloud.std(axis=0), problem.coarse_steps() / 40.0, problem.coarse_steps())
        first = int(np.argmin(known.chi2))
        if known.chi2[first] < lowest:
            best, lowest = known.x[first], float(known.chi2[first])
        x, level = land.descend(best, steps, 8)
        if level < lowest:
            best, lowest = x, level
        variance = temperature(land, best, steps)
        rough = roughness(known, variance, seed)
        needed = max(REACH, 1.2 * LIKELY * rough)
        if 0.8 * needed * variance <= within <= 1.25 * needed * variance or not land.affords(effort.points):
            break
    likely = known.x[known.chi2 <= lowest + LIKELY * variance * rough]
    if not len(likely):
        likely = best[np.newaxis]
    return Estimate(
        problem=problem, x=best, chi2=float(loss(land.residual(best) * land.scale)),
        temperature=variance * land.scale**2, roughness=rough,
        minima=np.column_stack((ends, loss(residuals)))[order], cloud=known.x[known.drawn(variance)],
        reach=np.array([likely.min(axis=0), likely.max(axis=0)]), flights=land.flights,
        complete=land.complete,
    )  # fmt: skip


def _descents(land: Landscape, counts: tuple[int, int], starts: int) -> tuple[FloatArray, FloatArray]:
    """Return the points of a scan, and where the descents from its best ended, one at the least."""
    scanned = scan(land, counts)
    coarse = land.problem.coarse_steps()
    ends: list[FloatArray] = []
    for x in scanned[:starts]:
        if ends and not land.affords(_most(land, (0, 0), 1)):
            break
        ends.append(land.descend(x, coarse, DESCENT)[0])
    return scanned, np.array(ends)


def _most(land: Landscape, counts: tuple[int, int], starts: int) -> int:
    """Return how many flights ``_descents`` makes at most, with those at its points and around its ends after it."""
    free = len(land.low)
    a_point = 2 if free == 2 else 2 + free
    return math.prod(counts) * a_point + starts * (DESCENT * (1 + 2 * free) + 1 + 18 * free)


def _around(land: Landscape, ends: FloatArray) -> FloatArray:
    """Return points around the ends of descents, spread by 1.5 times what a smooth landscape would allow, as aslant."""
    rng = np.random.default_rng(len(ends))
    found = []
    for x in ends:
        slopes = land.jacobian(x, land.problem.coarse_steps())
        # A prior as wide as the bounds keeps the curvature invertible where the data say nothing.
        curvature = slopes.T @ slopes + np.diag((land.high - land.low) ** -2.0)
        found.append(rng.multivariate_normal(x, 1.5**2 * np.linalg.inv(curvature), size=16 * len(x)))
    return np.clip(np.concatenate(found), land.low, land.high)


def scan(land: Landscape, counts: tuple[int, int] = USUAL.grid) -> FloatArray:
    """Return the points of a grid over drag and restitution (M, K), local minima of the grid first, then by chi^2.

    At each point the other coordinates have been fitted by two Gauss-Newton steps with one set of difference quotients.
    """
    axes = [np.linspace(land.low[k], land.high[k], count + 2)[1:-1] for k, count in enumerate(counts)]
    pairs = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    others = np.tile(land.problem.start()[2:], (len(pairs), 1))
    points, level = _levelled(land, np.column_stack((pairs, others)))
    beside = minimum_filter(level.reshape(counts), size=3, mode="nearest").ravel()
    return np.asarray(points[np.lexsort((level, level > beside))])


def _levelled(land: Landscape, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points with all coordinates but drag and restitution fitted, and chi^2 there."""
    others = np.arange(2, points.shape[1])
    if not others.size:
        return points, loss(land.residuals(points))
    steps = land.problem.coarse_steps()
    moved = np.repeat(points, len(others), axis=0)
    moved[np.arange(len(moved)), np.tile(others, len(points))] += np.tile(steps[others], len(points))
    residuals = land.residuals(points)
    rise = land.residuals(moved).reshape(len(points), len(others), -1) - residuals[:, np.newaxis]
    slopes = rise / steps[others, np.newaxis]
    best, lowest = points, loss(residuals)
    for _ in range(2):
        moves = [np.linalg.lstsq(j.T, -r, rcond=None)[0] for j, r in zip(slopes, residuals, strict=True)]
        points = points.copy()
        points[:, others] = np.clip(points[:, others] + moves, land.low[others], land.high[others])
        residuals = land.residuals(points)
        level = loss(residuals)
        best, lowest = np.where((level < lowest)[:, np.newaxis], points, best), np.minimum(level, lowest)
    return best, lowest


# ---------------------------------------------------------------------- what a search costs

COARSE: Final = Effort(grid=(5, 4), starts=2, points=60, again=False)
"""A search of about a quarter of the flights: mostly the same estimates, ends of intervals that are less certain."""

MINUTES: Final = 10.0
"""Time that a fit with somebody else's solver may take unless another is given."""

FLIGHTS: Final = MappingProxyType({USUAL: (1100, 1800, 3000), COARSE: (300, 450, 700)})
"""Search -> flights that it makes at least, about, if two, three or four parameters are fitted; three times as many are
common, and a rough landscape or an equation that does not fit takes up to eight times as many."""

ROOM: Final = 3.0
"""Times the flights that it makes at least for which the usual search must have time."""


@dataclass(frozen=True, slots=True)
class Budget:
    """The search that the time allows, the flights it makes at least, the seconds that one takes, and the minutes."""

    effort: Effort
    flights: int
    seconds: float
    minutes: float

    @property
    def words(self) -> str:
        """What the search will take."""
        kind = "" if self.effort == USUAL else "; a coarse search, since --minutes allows no more"
        least = in_words(self.flights * self.seconds)
        return (
            f"{self.seconds:.2g} s a flight, about {self.flights} flights or more: {least} or more; it leaves out what "
            f"--minutes {self.minutes:g} do not suffice for{kind}"
        )


def in_words(seconds: float) -> str:
    """Return a time in seconds or minutes."""
    return f"{seconds:.2g} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"


def affordable(problem: Problem, minutes: float = MINUTES) -> Budget:
    """Time a flight of somebody else's solver and return the best search that ``minutes`` allow.

    A solver that does not answer the throw from which the search begins raises a ForeignError, a time in which no
    search can be made a ValueError that says how long the coarse one takes.
    """
    took = []
    for _ in range(3):  # the fastest counts, since the first one loads the solver
        began = time.perf_counter()
        solve(problem.solver, problem.throw, times=problem.measured.t)
        took.append(time.perf_counter() - began)
    return chosen(problem, min(took), minutes)


def chosen(problem: Problem, seconds: float, minutes: float) -> Budget:
    """Return the best search that ``minutes`` allow if a flight takes so many ``seconds``; raise as ``affordable``."""
    for effort, least in FLIGHTS.items():
        budget = Budget(effort, least[len(problem.free) - 2], seconds, minutes)
        if budget.flights * seconds * (ROOM if effort == USUAL else 1.0) <= 60.0 * minutes:
            return budget
    raise ValueError(
        f"model = {problem.solver!r} takes {seconds:.2g} s a flight; even a coarse fit makes about {budget.flights} of "
        f"them or more, {in_words(budget.flights * seconds)}, more than --minutes {minutes:g}: take fewer --slices, a "
        f"longer step in the solver, or more --minutes; flipproof place says which of flipproof's own equations fits "
        f"as well in seconds"
    )
