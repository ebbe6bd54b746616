"""How long a flight can be predicted, and how fast two flights part: growth of small differences.

A throw is repeated with its release changed by tiny amounts. While the flight is smooth, the difference grows in
proportion to the change, so that the amplification, difference over change, is the same for every size. An impact
that one run has and another has not makes it jump instead, and then a smaller change does not help: the
amplification is therefore stated for every size and never averaged away. Nothing is cut off at the horizon.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flipproof.chapters.alignment.study import LEAST_SPEED, count_key, ordinal
from flipproof.chapters.differences.study import PARTING_BAND, Difference, first_crossing, percent
from flipproof.frame.solvers import Run
from slicemodel import Impacts, Scenario, Trajectory
from slicemodel.trajectory import FloatArray

SIZES = (1e-9, 1e-8, 1e-7, 1e-6)
"""Changes of the release: of theta_0 in rad and, at once, of omega_0 as a fraction."""

HORIZON_BAND = 1e-3
"""A flight is predictable while the difference in omega stays below this fraction of omega_0."""

GROWTH_WINDOW = 0.05
"""Growth before and after a parting is fitted over this time [s]."""


@dataclass(frozen=True, slots=True)
class Growth:
    """Exponential growth rate of a difference [1/s] with its standard error; NaN if it cannot be fitted."""

    rate: float = math.nan
    error: float = math.nan

    @property
    def clear(self) -> bool:
        """True if the rate differs from zero by more than three standard errors.

        With as few windows as are fitted, noise does so in 5 of 100 cases.
        """
        return abs(self.rate) > 3.0 * self.error

    @property
    def words(self) -> str:
        """The growth in words."""
        if not math.isfinite(self.rate):
            return "no growth rate (too few points above round-off)"
        if not self.clear:
            return f"does not clearly grow ({self.rate:.1f} ± {self.error:.1f} /s)"
        return f"{'grows' if self.rate > 0 else 'shrinks'} at {abs(self.rate):.1f} ± {self.error:.1f} /s"


def fit_growth(t: FloatArray, size: FloatArray, start: float = -math.inf, stop: float = math.inf) -> Growth:
    """Fit |difference| = A exp(rate t) over [start, stop], robustly.

    A difference changes sign and jumps, so single points and squares of residuals tell little. The interval is divided
    into twelve windows with the median of log |difference| in each, and the rate is the median of the slopes between
    all pairs of them (Theil and Sen). Its standard error is that of a straight line whose scatter is the median
    absolute residual, scaled to a normal distribution. Points below round-off or not finite are left out.
    """
    windows, least = 12, 4
    size = np.abs(size)
    usable = (t >= start) & (t <= stop) & np.isfinite(size) & (size > 1e-14)
    times, logs = t[usable], np.log(size[usable])
    if len(times) < least:
        return Growth()
    edges = np.linspace(times[0], times[-1], windows + 1)
    window = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, windows - 1)
    filled = np.unique(window)
    if len(filled) < least:
        return Growth()
    x = np.array([times[window == w].mean() for w in filled])
    y = np.array([np.median(logs[window == w]) for w in filled])
    i, j = np.triu_indices(len(x), 1)
    rate = float(np.median((y[j] - y[i]) / (x[j] - x[i])))
    residual = y - rate * x
    scatter = 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
    scatter *= math.sqrt(len(x) / (len(x) - 2))
    return Growth(rate, scatter / math.sqrt(float(((x - x.mean()) ** 2).sum())))


def parting_words(difference: Difference, impacts: Impacts | None = None) -> str:
    """Return when two flights part, the impact that this follows, and how their difference grows before and after.

    ``impacts`` is the record of the run whose impacts the parting is set against; those slower than ``LEAST_SPEED`` are
    passed over, because near rest there is always one. Growth is fitted over ``GROWTH_WINDOW`` seconds.
    """
    pair, band, time = f"{difference.first} and {difference.second}", percent(PARTING_BAND), difference.parting_time
    if time is None:
        return f"{pair} never differ by more than {band} of ω₀"
    words = f"{pair} differ by more than {band} of ω₀ from {time * 1e3:.1f} ms on"
    if impacts is not None:
        fast = np.flatnonzero((impacts.time <= time) & (impacts.speed_before >= LEAST_SPEED))
        if len(fast):
            impact, k = impacts[int(fast[-1])], count_key(impacts, int(fast[-1]), LEAST_SPEED)
            words += (
                f", {(time - impact.time) * 1e3:.1f} ms after the {ordinal(k)} impact of slice {impact.slice} on the "
                f"{impact.end}"
            )
    before = fit_growth(difference.t, difference.omega, time - GROWTH_WINDOW, time)
    after = fit_growth(difference.t, difference.omega, time, time + GROWTH_WINDOW)
    return f"{words}; the difference {before.words} before and {after.words} after"


@dataclass(frozen=True, slots=True, kw_only=True)
class Predictability:
    """What tiny changes of the release do to one solver's flight; one row per size of the change.

    Parameters
    ----------
    solver : str
    sizes : (S,) - of the changes, rising
    t : (P,) [s]
    spread : (S, P) - max |omega_member - omega| / |omega_0| over the members; infinite where a member has ended
    horizons : S times or None - when the spread first exceeds ``HORIZON_BAND`` [s]; None: predictable to the end
    round_off_horizon : float or None
        The same for a change of the size of round-off, amplified as the smallest change is. It means something only
        while the flight is smooth.
    growth : Growth - of the spread after the smallest change, up to its horizon
    rough_from : float or None
        First time at which amplifications of two sizes differ by more than a factor of 10 [s]: the flight is not smooth
        there, or the solver's own error exceeds the smallest change.
    ended : float or None - where the run ends, if that is before the end of the throw [s]
    """

    solver: str
    sizes: FloatArray
    t: FloatArray
    spread: FloatArray
    horizons: tuple[float | None, ...]
    round_off_horizon: float | None
    growth: Growth
    rough_from: float | None
    ended: float | None

    @property
    def amplification(self) -> FloatArray:
        """Largest spread over size of the change for every size, shape (S,); 1 if it is never amplified."""
        return np.asarray((self.spread / self.sizes[:, np.newaxis]).max(axis=1))

    @property
    def horizon(self) -> float | None:
        """Earliest horizon of all sizes [s]; None: predictable to the end for all of them."""
        return min((time for time in self.horizons if time is not None), default=None)

    @property
    def words(self) -> str:
        """Amplification of every size, horizon, growth and smoothness in words."""
        each = " and ".join(
            f"a change of the release by {size:.0e} at most {factor:.3g} times"
            for size, factor in zip(self.sizes, self.amplification, strict=True)
        )
        words = f"{self.solver}: the flight amplifies {each}"
        if self.horizon is None:
            words += f"; none of these moves ω by {HORIZON_BAND:g} of ω₀, so that the flight is predictable to its end"
        for size, time in zip(self.sizes, self.horizons, strict=True):
            if time is not None:
                words += f"; a change by {size:.0e} moves ω by {HORIZON_BAND:g} of ω₀ at {time * 1e3:.1f} ms"
        words += f"; the effect of a change by {self.sizes[0]:.0e} {self.growth.words}"
        if self.rough_from is not None:
            words += (
                f" and reaches {self.spread[0].max():.1e} of ω₀; from {self.rough_from * 1e3:.1f} ms on the factor "
                "depends on the size of the change, so that the effect of round-off cannot be extrapolated"
            )
        elif self.round_off_horizon is not None:
            words += f"; even round-off would move ω by that much at {self.round_off_horizon * 1e3:.1f} ms"
        return words + (f"; the run ends at {self.ended * 1e3:.1f} ms" if self.ended is not None else "")


def plan_predictability(
    throw: Scenario,
    solver: str,
    sizes: Sequence[float] = SIZES,
    members: int = 2,
    settings: Mapping[str, Any] | None = None,
) -> list[list[Run]]:
    """Return the changed runs, one list of one to four ``members`` per size, the smallest first.

    The unchanged run is the solver's own with the same settings.
    """
    # Signs of the changes of theta_0 and omega_0. Free flight does not feel theta_0, so omega_0 must change with it.
    directions = ((1, 1), (-1, -1), (1, -1), (-1, 1))
    return [
        [
            Run(
                solver,
                replace(throw, theta0=throw.theta0 + turn * size, omega0=throw.omega0 * (1 + spin * size)),
                dict(settings or {}),
                label=f"{solver}, release changed by {size:.0e} ({'+-'[turn < 0]}θ₀, {'+-'[spin < 0]}ω₀)",
            )
            for turn, spin in directions[:members]
        ]
        for size in sorted(sizes)
    ]


def study_predictability(base: Trajectory, members: Sequence[Sequence[Trajectory]]) -> Predictability:
    """Measure how far changed releases move the flight.

    Parameters
    ----------
    base : Trajectory - the unchanged flight
    members : sizes of members - flights of the runs of ``plan_predictability``, in its order
    """
    throw = base.scenario

    def size(changed: Scenario) -> float:
        return max(abs(changed.theta0 - throw.theta0), abs(changed.omega0 / throw.omega0 - 1))

    def apart(run: Trajectory) -> FloatArray:
        """Return |difference in omega| / |omega_0| at the times of ``base``, infinite after the end of ``run``."""
        distance = np.abs(np.interp(base.t, run.t, run.omega) - base.omega) / abs(throw.omega0)
        return np.where(base.t <= run.t[-1], distance, np.inf)

    sizes = np.array([max(size(run.scenario) for run in level) for level in members])
    spread = np.array([np.max([apart(run) for run in level], axis=0) for level in members])
    horizons = tuple(first_crossing(base.t, row, HORIZON_BAND) for row in spread)
    # A spread beyond a tenth of omega_0 says nothing about smoothness: a larger change has merely less room.
    amplification = np.where(spread <= 0.1, spread / sizes[:, np.newaxis], np.nan)
    with np.errstate(invalid="ignore"):
        ratio = np.fmax.reduce(amplification, axis=0) / np.fmin.reduce(amplification, axis=0)
    round_off = float(np.finfo(np.float64).eps)
    return Predictability(
        solver=base.label,
        sizes=sizes,
        t=base.t,
        spread=spread,
        horizons=horizons,
        round_off_horizon=first_crossing(base.t, spread[0] / sizes[0] * round_off, HORIZON_BAND),
        growth=fit_growth(base.t, spread[0], stop=math.inf if horizons[0] is None else horizons[0]),
        rough_from=first_crossing(base.t, np.nan_to_num(ratio, nan=1.0), 10.0),
        ended=None if base.status in ("ok", "escaped") else float(base.t[-1]),
    )
