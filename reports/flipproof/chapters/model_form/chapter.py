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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, least_squares
from scipy.stats import f as f_distribution

from flipproof.chapters.step_size.chapter import errors_of, plan_step_size
from flipproof.curves.order import ROUND_OFF
from flipproof.frame.chapter import Ask, Band, Chapter, Claims, Finding, Study, judged, observed
from flipproof.frame.flights import Call, Outcome, attempt, results_of
from flipproof.frame.solvers import Run
from slicemodel.trajectory import FloatArray

Verdict = Literal["step size", "model form", "undecided", "failure"]
Interval = tuple[float, float]

ORDER_TOLERANCE: Final = 0.25
"""An observed order further than this from the expected one is a failure, be it too low or too high."""

PHASE_FACTOR: Final = 2.0
"""Impact phases alone change the error of a single run by up to this factor, up or down."""

MIN_LEVELS: Final = 4
"""Step sizes that a fit of three parameters needs at the least."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelForm:
    """What stays of an error as the step goes to zero.

    Parameters
    ----------
    order, floor : p and F of error = C dt^p + F; NaN if there is no fit
    order_interval, floor_interval : (low, high) - 95 % profile intervals, if the scatter is independent and log-normal
    reason : the verdict in words
    """

    order: float = math.nan
    floor: float = math.nan
    order_interval: Interval = (math.nan, math.nan)
    floor_interval: Interval = (math.nan, math.nan)
    verdict: Verdict
    reason: str


def study_model_form(dt: ArrayLike, error: ArrayLike, *, expected_order: float = 1.0, band: float = 1e-7) -> ModelForm:
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
    members = np.asarray(dt).reshape(len(np.asarray(dt)), -1)
    steps = np.exp(np.log(members).mean(axis=1))
    order = np.argsort(-steps)
    errors = np.sqrt((np.asarray(error).reshape(members.shape)[order] ** 2).mean(axis=1))
    steps = steps[order]
    refusal = _refusal(steps, errors, members.shape[1])
    if refusal is not None:
        return ModelForm(verdict=refusal[0], reason=refusal[1])
    fit = _Fit(steps, errors)
    intervals = fit.interval(1), fit.interval(2)
    verdict, reason = _verdict(fit, *intervals, float(errors[-1]), expected_order, band)
    return ModelForm(
        order=float(fit.best[1]),
        floor=float(fit.best[2]),
        order_interval=intervals[0],
        floor_interval=intervals[1],
        verdict=verdict,
        reason=reason,
    )


def _refusal(dt: FloatArray, error: FloatArray, members: int) -> tuple[Verdict, str] | None:
    """Return why these errors, the coarsest level's first, have no fit, or None."""
    if not np.all(np.isfinite(error)):
        return "failure", f"the error at Δt = {dt[~np.isfinite(error)][0]:.2g} s is not finite"
    if len(np.unique(dt)) < MIN_LEVELS:
        return "undecided", f"{len(np.unique(dt))} step sizes; {MIN_LEVELS} are needed for C, p and F"
    if error.min() < ROUND_OFF:
        return "undecided", f"errors reach round-off ({error.min():.1g}), where an order means nothing"
    # What impact phases may do to the quotient of two levels, less the more members are averaged.
    allowed = PHASE_FACTOR ** (2.0 / math.sqrt(members))
    rise = error[1:] / np.minimum.accumulate(error)[:-1]
    k = int(rise.argmax())
    if rise[k] > allowed:
        words = f"at Δt = {dt[k + 1]:.2g} s the error is {rise[k]:.1f} times that of a coarser step"
        return "failure", f"oscillation: {words}"
    return None


def _verdict(
    fit: _Fit, order: Interval, floor: Interval, finest: float, expected: float, band: float
) -> tuple[Verdict, str]:
    (order_low, order_high), (floor_low, floor_high) = order, floor
    if fit.scatter > math.log(PHASE_FACTOR):
        return "failure", f"errors scatter {math.exp(fit.scatter):.1f}-fold about C Δt^p + F: they do not follow it"
    # A smaller F may be the curve that higher orders bend into C dt^p: refine to tell.
    if floor_low > band and floor_high > 0.25 * finest:
        low, high = f"{floor_low:.2g}", f"{floor_high:.2g}"
        left = low if low == high else f"{low} to {high}"
        return "model form", f"an error of {left} remains as Δt goes to zero (band {band:.1g})"
    if order_low > expected + ORDER_TOLERANCE:
        return "failure", f"order too high: {order_low:.2f} to {order_high:.2f}, not {expected:g}"
    if order_high < expected - ORDER_TOLERANCE:
        return "failure", f"order too low: {order_low:.2f} to {order_high:.2f}, not {expected:g}"
    if floor_high > finest:
        return "undecided", f"F may be as large as {floor_high:.2g}, the finest error is {finest:.2g}: refine further"
    p = fit.best[1]
    if abs(p - expected) > ORDER_TOLERANCE:
        return "undecided", f"order {p:.2f} ({order_low:.2f} to {order_high:.2f}) instead of {expected:g}: add levels"
    return "step size", f"order {p:.2f}; F at zero, at most {floor_high:.2g} where the finest error is {finest:.2g}"


class _Fit:
    """Least squares of log(C dt^p + F) - log(error) in (log C, p, F), and the scatter of what is left."""

    def __init__(self, dt: FloatArray, error: FloatArray) -> None:
        self.log_dt, self.log_error = np.log(dt), np.log(error)
        self.smallest, largest = (math.exp(float(end)) for end in (self.log_error.min(), self.log_error.max()))
        # Of an order below 0.2, C dt^p can no longer be told from F.
        self.low, self.high = np.array([-690.0, 0.2, 0.0]), np.array([690.0, 8.0, 2.0 * largest])
        # Starts: F nothing, a little, nearly all of the finest error.
        starts = [np.array([0.0, p, share * error.min()]) for p in (0.5, 1.0, 2.0) for share in (0.0, 0.3, 0.95)]
        for start in starts:
            start[0] = float(np.mean(self.log_error - start[1] * self.log_dt))
        self.best, self.cost = min((self._minimum(start, None) for start in starts), key=lambda best: best[1])
        self.freedom = len(dt) - 3
        self.scatter = math.sqrt(self.cost / self.freedom)

    def _minimum(self, start: FloatArray, fixed: int | None) -> tuple[FloatArray, float]:
        """Return the best parameters from ``start`` and their cost, with parameter ``fixed`` held."""
        moving = np.array([j for j in range(3) if j != fixed])
        # F is measured in its own size: near zero the finest error is the scale on which it matters.
        scale = np.array([1.0, 1.0, self.smallest])

        def whole(part: FloatArray) -> FloatArray:
            parameters = start.copy()
            parameters[moving] = part * scale[moving]
            return parameters

        def residuals(part: FloatArray) -> FloatArray:
            log_c, p, floor = whole(part)
            with np.errstate(over="ignore"):
                return np.asarray(np.log(np.exp(log_c + p * self.log_dt) + floor) - self.log_error)

        def slopes(part: FloatArray) -> FloatArray:
            log_c, p, floor = whole(part)
            with np.errstate(over="ignore", divide="ignore"):
                step_error = np.exp(log_c + p * self.log_dt)
                share = 1.0 / (1.0 + floor / step_error)
                columns = np.array([share, share * self.log_dt, scale[2] / (step_error + floor)])
            return np.asarray(columns[moving].T)

        bounds = (self.low[moving] / scale[moving], self.high[moving] / scale[moving])
        inside = np.clip(start[moving] / scale[moving], *bounds)
        result = least_squares(residuals, inside, slopes, bounds=bounds, x_scale="jac", max_nfev=400)
        return whole(result.x), float(2.0 * result.cost)

    def interval(self, j: int) -> Interval:
        """Return the values of p (1) or F (2) that the data do not refuse, with the others fitted anew for each."""
        # Even perfect data are given a scatter of 1e-6: the fit itself is no better.
        margin = float(f_distribution.ppf(0.95, 1, self.freedom)) * max(self.scatter, 1e-6) ** 2

        def excess(value: float) -> float:
            costs = []
            for start in (self.best.copy(), np.array([self.best[0], self.best[1], 0.0])):
                start[j] = value
                # Follow the ridge: with another p or F, C must change too, or the search starts far off.
                step_error = np.maximum(np.exp(self.log_error) - start[2], 1e-3 * np.exp(self.log_error))
                start[0] = float(np.mean(np.log(step_error) - start[1] * self.log_dt))
                costs.append(self._minimum(start, j)[1])
            return min(costs) - self.cost - margin

        centre = float(self.best[j])
        width = max(abs(centre) * 1e-3, 1e-3) if j == 1 else max(centre, self.smallest) * 1e-2
        return _edge(excess, centre, -width, self.low[j]), _edge(excess, centre, width, self.high[j])


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Richardson:
    """The limit of a value as the step goes to zero, from the three finest grids alone.

    ``order`` is the observed one, ``value`` f_1 + (f_1 - f_2) / (r^p - 1), extrapolated to dt = 0; ``gci`` the
    grid-convergence index of the finest grid, an uncertainty in the unit of the value. ``reason`` says why it is not
    ok, or how it was found.
    """

    order: float = math.nan
    value: float = math.nan
    gci: float = math.nan
    ok: bool = False
    reason: str


def richardson(dt: Sequence[float], values: Sequence[float]) -> Richardson:
    """Extrapolate a value of first order to dt = 0 and give its grid-convergence index (ASME V&V 20).

        gci = 1.25 |f_2 - f_1| / (r^p - 1),   r = dt_2 / dt_1

    p comes from the three finest grids, (f_3 - f_2) / (f_2 - f_1) = (dt_3^p - dt_2^p) / (dt_2^p - dt_1^p). Fails if a
    value is not finite, if the values oscillate or part, or if p is more than 0.5 off 1.
    """
    if not np.all(np.isfinite(values)):
        return Richardson(reason="a value is not finite")
    finest = np.argsort(dt)[:3]
    h, f = np.asarray(dt)[finest], np.asarray(values)[finest]
    fine, coarse = f[1] - f[0], f[2] - f[1]
    if coarse * fine < 0.0:
        return Richardson(reason="oscillation: the value turns back")

    def excess(p: float) -> float:
        return float((h[2] ** p - h[1] ** p) / (h[1] ** p - h[0] ** p) - coarse / fine)

    low, high = 1e-3, 20.0
    if coarse * fine == 0.0 or excess(low) * excess(high) > 0.0:
        return Richardson(reason="the values do not approach a limit")
    p = float(brentq(excess, low, high))
    gap = -fine / ((h[1] / h[0]) ** p - 1.0)
    ok = abs(p - 1.0) <= 0.5
    return Richardson(
        order=p,
        value=float(f[0] + gap),
        gci=float(1.25 * abs(gap)),
        ok=ok,
        reason="three finest grids" if ok else f"order too {'high' if p > 1.0 else 'low'}: {p:.2f}, not 1",
    )


FORMS: Final = (
    ("exact-step", "eq8"),
    ("exact-step", "eq8-weightless"),
    ("published-python", "published-limit"),
    ("published-python", "eq8"),
)
"""Scheme and equation: is what is left as the step goes to zero the step's, or another equation?"""

Results = tuple[Mapping[tuple[str, str], Outcome[ModelForm]], Mapping[str, Outcome[Richardson]]]
"""The fit of every pair of scheme and equation, and where each scheme goes as its step goes to zero."""


def study(ask: Ask) -> Study[Results]:
    """Halve the step of the schemes of FORMS; fit omega of the pairs that ``ask.work`` lists, in workers."""
    levels = {scheme: plan_step_size(ask.throw, scheme, base=37, multiple=54, count=6) for scheme in dict(FORMS)}
    grids = (run for halvings in levels.values() for level in halvings for run in level)
    flights = yield [*(Run(model, ask.throw) for _, model in ask.work), *grids]

    def fit(scheme: str, model: str) -> Call:
        truth = flights[Run(model, ask.throw)].flight
        return Call(study_model_form, errors_of(truth, flights.levels(levels[scheme])), f"{scheme} against {model}")

    def limit(scheme: str) -> Richardson:
        # The mean over the grids of a level: a single one carries the luck of its impact phases.
        grids = flights.levels(levels[scheme])
        steps = [float(np.mean([run.settings["dt"] for run in level])) for level in grids]
        ends = [float(np.mean([run.omega[-1] for run in level])) / ask.throw.omega0 for level in grids]
        return richardson(steps, ends)

    calls = {pair: attempt(fit, *pair) for pair in ask.work}
    flights = yield results_of(calls).values()
    forms = {pair: attempt(lambda call: flights.answer(call.value), call) for pair, call in calls.items()}
    return forms, {scheme: attempt(limit, scheme) for scheme in levels}


def claims(results: Results) -> Claims:
    """Yield where every scheme goes, and what stays of its error against an equation."""
    forms, limits = results
    for scheme, limit in limits.items():
        id_ = f"limit-{scheme}"
        yield judged(claim_limit, id_, scheme, limit, id=id_, title=f"limit of {scheme}", kind="observation")
    for (scheme, model), form in forms.items():
        id_, title = f"model-form-{scheme}-{model}", f"{scheme} against {model}"
        yield judged(claim_model_form, id_, title, form, id=id_, title=title, kind="observation")


def claim_limit(id_: str, scheme: str, limit: Richardson) -> Finding:
    """Where omega(T) / omega_0 of a scheme goes as its step goes to zero, with its grid-convergence index."""
    title = f"{scheme}: ω(T)/ω₀ extrapolated to Δt = 0 (Richardson)"
    if not limit.ok:
        return observed(id_, title, None, note=limit.reason)
    note = f"observed order {limit.order:.2f}; band: grid-convergence index; {limit.reason}"
    return observed(id_, title, limit.value, note=note, band=Band(limit.gci, "refinement"))


def claim_model_form(id_: str, title: str, form: ModelForm) -> Finding:
    """What stays of a scheme's error as its step goes to zero decides between step size and another equation."""
    return observed(id_, f"{title}: {form.verdict}", form.floor, "of ω₀", form.reason)


CHAPTER: Final = Chapter(
    name="model-form",
    title="Step size or another equation?",
    study=study,
    claims=claims,
    work={"quick": FORMS[:2], "full": FORMS},
    page=lambda results: {"fits": list(results_of(results[0]).items())},
)
