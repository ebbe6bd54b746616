"""How the error of a scheme falls with its step, against the equation it really solves.

A rebound waits for the grid, so the error at one step size depends on where in its step each impact falls. Single runs
then scatter by more than a factor of two, and an order read off them is luck. Each step size is therefore an ensemble
of grids: every member has other impact phases, and their mean error has an order. All grids of a study share a set of
times, and errors are taken there: an interpolation would have an error of its own, larger than that of a good scheme.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from flipproof.chapters.solvers import LIMITS, SCHEMES
from flipproof.curves.order import ROUND_OFF, observed_order
from flipproof.figures.style import MARKERS, STYLES, new_figure, shared_legend, solver_style, styled
from flipproof.frame.chapter import (
    Ask,
    Band,
    Chapter,
    Claims,
    Exhibit,
    Finding,
    Kind,
    Study,
    judged,
    observed,
    regression,
)
from flipproof.frame.columns import rows_csv
from flipproof.frame.flights import Flights, Outcome, attempt, results_of
from flipproof.frame.solvers import Missing, Run
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray

PHASES = 8
"""Members of the ensemble at each step size."""

MIN_COMMON = 8
"""Common times, less one, that a run and its reference must share at the least."""


@dataclass(frozen=True, slots=True)
class StepSize:
    """Error against step size, one row per level and one column per phase.

    ``dt`` and ``error`` have shape (levels, phases); error is max |omega - omega_reference| / omega_0 over the flight.
    ``order`` is the slope of log mean error against log mean dt with its standard error; NaN if any error is not
    finite or if the errors are at round-off.
    """

    scheme: str
    model: str
    dt: FloatArray
    error: FloatArray
    order: float
    order_error: float

    @property
    def refined(self) -> bool:
        """True if every level is better than the one before it: nothing less proves refinement."""
        mean = self.mean_error
        return bool(np.all(np.isfinite(mean)) and np.all(np.diff(mean) < 0))

    @property
    def exact(self) -> bool:
        """True if every error is at round-off: nothing depends on the step (ice, or a tube that nothing moves)."""
        return bool(np.all(self.error < ROUND_OFF))

    @property
    def mean_dt(self) -> FloatArray:
        """Geometric mean step of every level [s]."""
        return np.asarray(np.exp(np.log(self.dt).mean(axis=1)))

    @property
    def mean_error(self) -> FloatArray:
        """Root-mean-square error of every level."""
        return np.asarray(np.sqrt((self.error**2).mean(axis=1)))


def plan_step_size(scenario: Scenario, scheme: str, base: int, multiple: int, count: int) -> list[list[Run]]:
    """Return the runs of every level: PHASES multiples of ``base`` steps from ``multiple`` on, doubled at each level.

    All their grids share ``base + 1`` times.
    """
    return [
        [
            Run(scheme, scenario, {"steps": steps + 1, "store": "summary"}, f"{scheme}, {steps} steps")
            for steps in (base * (multiple + phase) * 2**level for phase in range(PHASES))
        ]
        for level in range(count)
    ]


def study_step_size(reference: Trajectory, runs: Sequence[Sequence[Trajectory]]) -> StepSize:
    """Measure the observed order of a scheme against its limit equation; arguments and errors as of ``errors_of``."""
    dt, error = errors_of(reference, runs)
    return StepSize(runs[0][0].method, reference.method, dt, error, *observed_order(dt, error))


def errors_of(reference: Trajectory, runs: Sequence[Sequence[Trajectory]]) -> tuple[FloatArray, FloatArray]:
    """Return step [s] and max |omega - omega_reference| / omega_0 of every run, shape (levels, members).

    The error is NaN where a run is not complete. The reference is on uniform times, the runs are as ``plan_step_size``
    plans them; one that shares fewer than MIN_COMMON intervals with the reference raises Missing.
    """

    def error(run: Trajectory) -> float:
        if not (run.ok and reference.ok):
            return math.nan
        fine, coarse = len(run.t) - 1, len(reference.t) - 1
        common = math.gcd(fine, coarse)
        if common < MIN_COMMON:
            raise Missing(f"{fine} steps and {coarse} reference intervals share only {common} intervals")
        difference = run.omega[:: fine // common] - reference.omega[:: coarse // common]
        return float(np.abs(difference).max() / abs(reference.scenario.omega0))

    dt = np.array([[run.settings["dt"] for run in level] for level in runs])
    return dt, np.array([[error(run) for run in level] for level in runs])


def before_first_impact(scenario: Scenario, reference: Trajectory) -> Scenario | None:
    """Return the throw cut off at 0.9 of the time of the first impact, or None if no slice ever strikes an end.

    A slice that rests on an end from the start does not strike it.
    """
    assert reference.impacts is not None
    if len(reference.impacts) == 0:
        return None
    return replace(scenario, duration=0.9 * float(reference.impacts.time[0]))


CHECKED: Final = ("before the first impact", "across impacts")
"""The two parts of the paper's own throw on which the order is a regression."""

START, WHOLE = "before the first impact of this throw", "across the impacts of this throw"
"""The same parts of the report's throw, on which it is an observation."""

Orders = Mapping[tuple[str, str], Outcome[StepSize]]
"""Part and scheme -> its study."""


Grids = list[list[Run]]
"""The run of an equation, alone; then a scheme's grids on the same throw, level by level."""


def study(ask: Ask) -> Study[Orders]:
    """Halve the step over whole flights; then, once the first impact is known, before it as well.

    ``ask.work`` is the number of steps on the report's throw; 0: only the paper's own throw is studied.
    """
    # Throw, first multiple of the 37 intervals that all grids share (a divisor of the 999 of the default output times),
    # levels, and the names of both parts.
    plans = [(ask.reference, 108, 4, *CHECKED)] + ([(ask.throw, 27, ask.work, START, WHOLE)] if ask.work else [])
    grids: dict[tuple[str, str], Outcome[Grids]] = {}
    for throw, multiple, levels, _, part in plans:
        for scheme in SCHEMES:
            truth = Run(LIMITS[scheme], throw)
            grids[part, scheme] = Outcome([[truth], *plan_step_size(throw, scheme, 37, multiple, levels)])
    flights = yield chain.from_iterable(chain.from_iterable(results_of(grids).values()))
    for throw, _, levels, start, _ in plans:
        for scheme in SCHEMES:
            truth = Run(LIMITS[scheme], throw)
            grids[start, scheme] = attempt(_start, truth, flights, scheme, levels)
    flights = yield chain.from_iterable(chain.from_iterable(results_of(grids).values()))

    def measured(outcome: Outcome[Grids]) -> StepSize:
        (truth,), *levels = flights.levels(outcome.value)
        return study_step_size(truth, levels)

    return {part: attempt(measured, outcome) for part, outcome in grids.items()}


def _start(truth: Run, flights: Flights, scheme: str, levels: int) -> Grids:
    """Return the grids on the part of the flight before any impact."""
    start = before_first_impact(truth.scenario, flights[truth].flight)
    if start is None:
        raise Missing(f"{truth.solver} strikes no end")
    times = np.linspace(0.0, start.duration, 10)
    before = Run(truth.solver, start, {"times": times}, f"{truth.solver} before the first impact")
    return [[before], *plan_step_size(start, scheme, base=9, multiple=14, count=levels)]


def claims(results: Orders) -> Claims:
    """Yield the order of every scheme: a regression on the paper's own throw, an observation on the report's."""
    for scheme in SCHEMES:
        for where in CHECKED:
            id_ = f"order-{scheme}-{where.replace(' ', '-')}"
            title = f"{scheme} converges to {LIMITS[scheme]}, {where}"
            yield judged(claim_order, results[where, scheme], where, id=id_, title=title)
        for where in (START, WHOLE):
            if (where, scheme) in results and (measured := results[where, scheme].result) is not None:
                yield claim_order(measured, where, kind="observation")


def _measured(results: Orders, where: str) -> list[StepSize]:
    """Return the studies of a part that could be made."""
    return [result for (part, _), result in results_of(results).items() if part == where]


def claim_order(study: StepSize, where: str, *, kind: Kind = "regression") -> Finding:
    """The scheme converges to its equation at first order, every refinement being better than the one before."""
    id_ = f"order-{study.scheme}-{where.replace(' ', '-')}"
    title = f"{study.scheme} converges to {study.model} at order 1, {where}"
    if kind == "observation":
        part = "before the first impact" if where == START else "whole flight"
        title = f"observed order of {study.scheme} towards {study.model}, this throw, {part}"
    if study.exact:
        note = "there is no step error to be seen: all errors are at round-off"
        return observed(id_, title, float(study.error.max()), "of ω₀", note)
    note = (
        f"error {study.mean_error[0]:.2g} → {study.mean_error[-1]:.2g} of ω₀ "
        f"from Δt = {study.mean_dt[0]:.2g} s to {study.mean_dt[-1]:.2g} s"
        + ("" if study.refined else "; refinement does not always help")
    )
    if kind == "observation":
        return observed(id_, title, study.order, note=note, band=Band(study.order_error, "fit"))
    order = study.order if study.refined else math.nan
    return regression(id_, title, order, "", (0.9, 1.1), note, band=Band(study.order_error, "fit"))


def figures(results: Orders) -> Iterator[Exhibit]:
    """Yield error against step size, over the whole flight and before the first impact."""
    studies, starts = _measured(results, WHOLE), _measured(results, START)
    if all(study.exact for study in studies):
        return
    words = f"Over the whole flight: {'; '.join(map(_converges, studies))}."
    if starts:
        words += f" Before the first impact: {'; '.join(map(_converges, starts))}."
    yield Exhibit(
        name="step-size",
        title="Error against step size",
        caption="Points parallel to the dotted slope mean that halving the step halves the error. The shaded range is "
        f"that of the {PHASES} grids averaged in each point: their steps differ a little, and so does the time that a "
        "rebound waits for the grid. A scheme that converges does so to its own equation, not to free flight.",
        alt=f"Two log-log plots of error against step. {words}",
        maker=figure_step_size,
        data=(studies, starts),
        table=rows_csv(
            ("part of the flight", "scheme", "held against", "mean dt [s]", "rms error [of omega_0]",
             "least error [of omega_0]", "largest error [of omega_0]", "fitted order [1]", "its standard error [1]"),
            (
                (part, curve.scheme, curve.model, dt, mean, errors.min(), errors.max(), curve.order, curve.order_error)
                for part, parted in (("whole flight", studies), ("before the first impact", starts))
                for curve in parted
                for dt, mean, errors in zip(curve.mean_dt, curve.mean_error, curve.error, strict=True)
            ),
        ),
    )  # fmt: skip


def _converges(study: StepSize) -> str:
    if study.exact:
        return f"{study.scheme} equals {study.model} to round-off at every step"
    return (
        f"{study.scheme} to {study.model} {_order(study)}, error {study.mean_error[0]:.1e} of omega_0 at a step of "
        f"{study.mean_dt[0]:.1e} s down to {study.mean_error[-1]:.1e} at {study.mean_dt[-1]:.1e} s"
    )


def _order(study: StepSize) -> str:
    return f"order {study.order:.2f}" if math.isfinite(study.order) else "no order"


@styled
def figure_step_size(flights: Sequence[StepSize], starts: Sequence[StepSize]) -> Figure:
    """Error against step size: over the whole flight (left) and before the first impact (right)."""
    figure, panels = new_figure(1, 2, size=(8.0, 4.4))
    for axes, studies, title in ((panels[0], flights, "whole flight"), (panels[1], starts, "before the first impact")):
        for k, study in enumerate(studies):
            style = solver_style(study.scheme, k)
            spread = study.error.min(axis=1), study.error.max(axis=1)
            low, high = np.maximum(spread, ROUND_OFF)
            axes.fill_between(study.mean_dt, low, high, color=style["color"], alpha=0.25, linewidth=0)
            look = {"color": style["color"], "linewidth": 1.4, "label": f"{study.scheme} → {study.model}"}
            axes.loglog(study.mean_dt, np.maximum(study.mean_error, ROUND_OFF), marker=MARKERS[k], **look)
            words, colour = f"{study.scheme}: {_order(study)}", STYLES.get(study.model, style)["color"]
            axes.text(0.03, 0.96 - 0.07 * k, words, transform=axes.transAxes, va="top", fontsize=9, color=colour)
        if studies:
            dt = studies[0].mean_dt
            top = max(ROUND_OFF, *(study.mean_error[0] for study in studies)) * 2.0
            axes.loglog(dt, top * dt / dt[0], color="#444444", linestyle=":", linewidth=1.0, label="slope 1")
        axes.set_title(title, fontsize=10, loc="left")
        axes.set_xlabel("step Δt [s]")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_minor_formatter(NullFormatter())
    panels[0].set_ylabel("max |ω − ω of its equation| / ω₀ [1]")
    shared_legend(figure, panels[0])
    return figure


CHAPTER: Final = Chapter(
    name="step-size",
    title="Error against step size",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
    work={"check": 0, "quick": 6, "full": 7},
    page=lambda results: {"studies": _measured(results, WHOLE)},
)
