"""How well the data know a parameter, and which equation they speak for: in numbers and in plain words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from flipproof.film.fit.estimate import LIKELY, Estimate
from flipproof.film.fit.problem import UNITS, package_of
from flipproof.film.fit.region import fits, loss
from slicemodel.trajectory import FloatArray

Verdict = Literal["told", "bounded above", "bounded below", "not told"]

INDISTINCT: Final = 4.0
"""Difference of AIC up to which two equations are said to do equally well."""

COUNTED: Final = ("eq8", "free-flight")
"""Equations of the reference whose intervals held the truth in at least 90 of 100 twins (``benchmarks/twins.py``)."""


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
    middle, *tails = np.quantile(estimate.cloud, (0.5, (1.0 - level) / 2.0, (1.0 + level) / 2.0), axis=0)
    lower, upper = (middle + np.sqrt(estimate.roughness) * (tail - middle) for tail in tails)
    # An interval holds its own estimate, whatever the cloud says.
    below = np.clip(np.minimum(np.minimum(lower, estimate.reach[0]), estimate.x), low, high)
    above = np.clip(np.maximum(np.maximum(upper, estimate.reach[1]), estimate.x), low, high)
    # An end within 2 % of the searched range is that of the range if the data allow it; three quarters are not told.
    at_low = (below - low < 0.02 * (high - low)) & _allowed(estimate, low)
    at_high = (high - above < 0.02 * (high - low)) & _allowed(estimate, high)
    below, above = np.where(at_low, low, below), np.where(at_high, high, above)
    not_told = (above - below >= 0.75 * (high - low)) | (at_low & at_high)
    verdicts = np.select([not_told, at_high, at_low], ["not told", "bounded below", "bounded above"], "told").tolist()
    x, ends, searched = (problem.parameters(np.array(p)).tolist() for p in ([estimate.x], [below, above], [low, high]))
    deviations = [float(np.std(values)) for values in problem.parameters(estimate.cloud).T]
    return tuple(
        Interval(
            name=name,
            value=x[0][k],
            low=ends[0][k],
            high=ends[1][k],
            deviation=deviations[k],
            searched=(searched[0][k], searched[1][k]),
            verdict=verdicts[k],
        )
        for k, name in enumerate(problem.free)
    )


def _allowed(estimate: Estimate, ends: FloatArray) -> NDArray[np.bool_]:
    """Return for each coordinate whether the data allow its end of the searched range (K,).

    The other coordinates stay where the estimate has them, or where the point of the cloud nearest to that end has
    them: the better of the two bounds the profile likelihood of the end from above.
    """
    limit = estimate.chi2 + LIKELY * estimate.temperature * estimate.roughness
    allowed = []
    for k, end in enumerate(ends):
        trial = np.array([estimate.x, estimate.cloud[np.abs(estimate.cloud[:, k] - end).argmin()]])
        trial[:, k] = end
        allowed.append(loss(estimate.problem.residuals(trial)).min() <= limit)
    return np.array(allowed)


def correlation(estimate: Estimate) -> FloatArray:
    """Return the correlation of the parameters over the cloud (K, K); 0 for a parameter that does not vary there."""
    values = estimate.problem.parameters(estimate.cloud)
    spread = values.std(axis=0)
    centred = np.where(spread > 0, (values - values.mean(axis=0)) / np.where(spread > 0, spread, 1.0), 0.0)
    return np.asarray(centred.T @ centred / len(values))


@dataclass(frozen=True, slots=True, kw_only=True)
class Contender:
    """One equation and how well its best parameters do.

    Parameters
    ----------
    misfit : float - root mean square residual in units of the noise
    fits : whether noise alone makes residuals this large
    aic : float - Akaike's criterion less that of the best, chi^2 taken in units of what the best equation leaves if
        that is more than the noise (quasi-AIC)
    """

    estimate: Estimate
    intervals: tuple[Interval, ...]
    misfit: float
    fits: bool
    aic: float

    @property
    def solver(self) -> str:
        """Name of the equation's solver."""
        return self.estimate.problem.solver

    @property
    def root_mean_square(self) -> float:
        """Root mean square residual [rad or rad/s]."""
        return self.misfit * self.estimate.problem.noise


def compare(estimates: Sequence[Estimate]) -> tuple[Contender, ...]:
    """Return the fits by several equations, the best first; fits of different measurements or noise are refused."""
    first = estimates[0].problem
    for estimate in estimates[1:]:
        if estimate.problem.measured is not first.measured or estimate.problem.noise != first.noise:
            raise ValueError("equations can be compared on one measurement with one noise only")
    ordered = sorted(estimates, key=lambda one: one.chi2 + 2 * len(one.x))
    best = ordered[0]
    unit = max(1.0, best.chi2 / best.freedom)
    least = best.chi2 / unit + 2 * len(best.x)
    return tuple(
        Contender(
            estimate=one,
            intervals=intervals(one),
            misfit=float(np.sqrt(np.mean(one.residual() ** 2))) / one.problem.noise,
            fits=fits(one.chi2, one.freedom),
            aic=one.chi2 / unit + 2 * len(one.x) - least,
        )
        for one in ordered
    )


def verdict(contenders: Sequence[Contender]) -> str:
    """Return what a comparison says, in plain words."""
    best, *others = contenders
    angle = best.estimate.problem.measured.quantity == "theta"
    noise = "the camera's noise" if angle else "the noise of its neighbours' differences"
    words = [
        f"{best.solver} leaves {best.misfit:.3g} times {noise}"
        + (": it explains the flight." if best.fits else ", more than chance: it does not explain the flight.")
    ]
    if not best.fits and others:
        words.append("No equation does; what follows ranks misfits, and all intervals are widened by theirs.")
    equal = [one.solver for one in others if one.aic <= INDISTINCT]
    worse = [one for one in others if one.aic > INDISTINCT]
    if equal:
        *first, last = equal
        words.append(f"The data cannot tell it from {', '.join(first)}{' and ' if first else ''}{last}.")
    words += [f"{one.solver} leaves {one.misfit:.3g} times the noise (AIC {one.aic:.0f} higher)." for one in worse]
    if worse:
        words.append(
            "AIC is chi^2, divided by the misfit of the best if that is more than noise, plus two for every fitted "
            f"number. The least is best; up to {INDISTINCT:g} more is no difference."
        )
    return " ".join(words)


def promise(solver: str, *, fits: bool) -> str:
    """Return what the intervals of a fit are worth.

    How often they hold the truth was counted on flights that the fitted equation had made: for the schemes, and for
    the ``COUNTED`` equations of the reference.
    """
    if not fits:
        return "intervals widened by the misfit; no coverage is claimed for an equation that does not fit"
    if package_of(solver) != "slicemodel" and solver not in COUNTED:
        return "intervals meant to hold drag and restitution together in 95 %, which was not measured for this equation"
    return "intervals that hold drag and restitution together in 95 %"


def told(interval: Interval) -> str:
    """Return what an interval says that numbers alone do not, or nothing."""
    low, high = interval.searched
    if interval.verdict == "not told":
        return f"the data cannot tell it: the interval all but covers [{low:.3g}, {high:.3g}], all that was searched"
    if interval.verdict == "bounded below":
        return f"bounded from below only: the search ended at {high:.3g}"
    return f"bounded from above only: {low:.3g} is not excluded" if interval.verdict == "bounded above" else ""


def report(contenders: Sequence[Contender], remarks: Sequence[str]) -> str:
    """Return estimates and comparison as lines for a terminal, after ``remarks`` on how the measurement was read."""
    problem = contenders[0].estimate.problem
    measured = problem.measured
    how = "given" if measured.noise is not None else "estimated from neighbouring values"
    lines = [
        f"{measured.label}: {len(measured.t)} values of {measured.quantity} over {measured.t[-1]:.3f} s; noise of one "
        f"{problem.noise:.3g} {measured.unit} ({how})"
    ]
    if measured.quantity == "omega":
        lines.append("neighbouring values of omega share noise; intervals are widened by the residuals' autocovariance")
    lines += remarks
    for one in contenders:
        lines += ["", *_fit_lines(one)]
    lines += ["", verdict(contenders)]
    return "\n".join(lines)


def _fit_lines(one: Contender) -> list[str]:
    estimate = one.estimate
    throw = estimate.problem.throw
    lines = [f"{one.solver}, {throw.n_slices} slices; {promise(one.solver, fits=one.fits)}"]
    for found in one.intervals:
        width = found.high - found.low  # of which two digits are shown
        places = min(12, max(0, 1 - math.floor(math.log10(width)))) if width > 0 else 6
        numbers = f"{found.value:.{places}f} [{found.low:.{places}f}, {found.high:.{places}f}]"
        note = told(found)
        lines.append(f"  {found.name:12} {numbers} {UNITS[found.name]}{'  ' + note if note else ''}")
        if found.name == "drag":
            gamma = [value / (2 * throw.slice_mass) for value in (found.value, found.low, found.high)]
            lines.append(f"  {'alpha/2m':12} {gamma[0]:.4g} [{gamma[1]:.4g}, {gamma[2]:.4g}] /s")
    pairs, names = correlation(estimate), estimate.problem.free
    words = [f"{names[i]}-{names[j]} {pairs[i, j]:+.2f}" for i, j in combinations(range(len(names)), 2)]
    lines.append(f"  correlation  {', '.join(words)}")
    lines.append(
        f"  chi^2        {estimate.chi2:.0f} for {estimate.freedom} degrees of freedom; residual "
        f"{one.root_mean_square:.3g} {estimate.problem.measured.unit} (root mean square)"
    )
    levels = estimate.minima[:, -1]
    same = int((levels < levels.min() + 1.0).sum())
    lines.append(
        f"  search       {estimate.flights} flights; {same} of {len(levels)} descents end there; intervals "
        f"{math.sqrt(max(1.0, estimate.temperature)):.2f} times wider for misfit or shared noise, "
        f"{math.sqrt(estimate.roughness):.2f} for roughness"
    )
    if not estimate.complete:
        lines.append(
            "  time         did not suffice for the whole search: a lower chi^2 may have been missed, and intervals "
            "are less certain; give more --minutes"
        )
    return lines
