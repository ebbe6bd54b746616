"""Error against step size: each scheme against the equation that it converges to."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from flipproof.chapters.solvers import LIMITS, SCHEMES
from flipproof.chapters.step_size.figure import figure_step_size
from flipproof.chapters.step_size.study import PHASES, StepSize, before_first_impact, plan_step_size, study_step_size
from flipproof.frame.chapter import (
    Ask,
    Chapter,
    Claims,
    Exhibit,
    Finding,
    Flights,
    Kind,
    Missing,
    Outcome,
    Run,
    Study,
    attempt,
    judged,
)
from flipproof.output.columns import rows_csv
from slicemodel import Scenario

COMMON: Final = 37
"""Intervals that all grids of a flight share; a divisor of the 999 intervals of the default output times."""

COMMON_START: Final = 9
"""The same, before the first impact."""

FIRST_ORDER: Final = (0.9, 1.1)
"""Admissible observed order of a scheme of first order, before the first impact and across impacts."""

CHECK_LEVELS: Final = 4


class Grids(NamedTuple):
    """A scheme's grids on one throw, and the run of its equation."""

    truth: Run
    levels: list[list[Run]]

    @property
    def runs(self) -> list[Run]:
        """Every run."""
        return [self.truth, *(run for level in self.levels for run in level)]

    def measured(self, flights: Flights) -> StepSize:
        """Return the observed order; raises Missing if a run was not made."""
        return study_step_size(
            flights[self.truth].flight, [[flights[run].flight for run in level] for level in self.levels]
        )


@dataclass(frozen=True, slots=True)
class Orders:
    """Scheme -> its study: over whole flights and before the first impact, of the throw and of the paper's own."""

    flights: Mapping[str, Outcome[StepSize]]
    starts: Mapping[str, Outcome[StepSize]]
    check_flights: Mapping[str, Outcome[StepSize]]
    check_starts: Mapping[str, Outcome[StepSize]]

    @property
    def measured(self) -> list[StepSize]:
        """The studies over whole flights of the throw that could be made."""
        return [each.found for each in self.flights.values() if each.found is not None]


def study(ask: Ask) -> Study[Orders]:
    """Halve the step over whole flights; then, once the first impact is known, before it as well.

    ``ask.work`` is the number of steps on the report's throw; 0: only the paper's own throw is studied.
    """
    throws = {"check": ask.reference, **({"throw": ask.throw} if ask.work else {})}
    levels = {"check": CHECK_LEVELS, "throw": ask.work}
    multiple = {"check": 108, "throw": 27}
    whole = {
        (where, scheme): Grids(
            Run(LIMITS[scheme], throw, {}, LIMITS[scheme]),
            plan_step_size(throw, scheme, COMMON, multiple[where], levels[where]),
        )
        for where, throw in throws.items()
        for scheme in SCHEMES
    }
    flights = yield [run for grids in whole.values() for run in grids.runs]
    starts = {
        (where, scheme): attempt(lambda grids, n, s: _start(grids, flights, s, n), grids, levels[where], scheme)
        for (where, scheme), grids in whole.items()
    }
    flights = yield [run for grids in starts.values() if grids.found is not None for run in grids.found.runs]

    def over(what: Mapping[tuple[str, str], Grids | Outcome[Grids]], where: str) -> dict[str, Outcome[StepSize]]:
        return {
            scheme: attempt(
                lambda grids: (grids.value if isinstance(grids, Outcome) else grids).measured(flights), grids
            )
            for (place, scheme), grids in what.items()
            if place == where
        }

    return Orders(over(whole, "throw"), over(starts, "throw"), over(whole, "check"), over(starts, "check"))


def _start(grids: Grids, flights: Flights, scheme: str, count: int) -> Grids:
    """Return the grids on the part of the flight before any impact."""
    model = grids.truth.solver
    start: Scenario | None = before_first_impact(grids.truth.scenario, flights[grids.truth].flight)
    if start is None:
        raise Missing(f"{model} strikes no end")
    times = np.linspace(0.0, start.duration, COMMON_START + 1)
    truth = Run(model, start, {"times": times}, f"{model} before the first impact")
    return Grids(truth, plan_step_size(start, scheme, COMMON_START, 14, count))


def claims(found: Orders) -> Claims:
    """Yield the order of every scheme: a regression on the paper's own throw, an observation on the report's."""
    for scheme in SCHEMES:
        for studies, where in (
            (found.check_starts, "before the first impact"),
            (found.check_flights, "across impacts"),
        ):
            yield judged(
                claim_order,
                studies[scheme],
                where,
                id=f"order-{scheme}-{where.replace(' ', '-')}",
                title=f"{scheme} converges to {LIMITS[scheme]}, {where}",
            )
        for studies, where in (
            (found.starts, "before the first impact of this throw"),
            (found.flights, "across the impacts of this throw"),
        ):
            measured = studies[scheme].found if scheme in studies else None
            if measured is not None:
                yield claim_order(measured, where, kind="observation")


def claim_order(study: StepSize, where: str, *, kind: Kind = "regression") -> Finding:
    """The scheme converges to its equation at first order, every refinement being better than the one before."""
    id_ = f"order-{study.scheme}-{where.replace(' ', '-')}"
    title = f"{study.scheme} converges to {study.model} at order 1, {where}"
    if study.exact:
        note = "there is no step error to be seen: all errors are at round-off"
        return Finding(id=id_, title=title, value=float(study.error.max()), unit="of ω₀", kind="observation", note=note)
    return Finding(
        id=id_,
        title=title,
        value=study.order if study.refined or kind == "observation" else math.nan,
        unit="",
        kind=kind,
        admissible=FIRST_ORDER if kind == "regression" else (-math.inf, math.inf),
        band=study.order_error,
        note=f"error {study.mean_error[0]:.2g} → {study.mean_error[-1]:.2g} of ω₀ "
        f"from Δt = {study.mean_dt[0]:.2g} s to {study.mean_dt[-1]:.2g} s"
        + ("" if study.refined else "; refinement does not always help"),
    )


def figures(found: Orders) -> Iterator[Exhibit]:
    """Yield error against step size, over the whole flight and before the first impact."""
    studies, starts = found.measured, [each.found for each in found.starts.values() if each.found is not None]
    if not studies:
        return
    words = f"Over the whole flight: {'; '.join(map(_converges, studies))}."
    if starts:
        words += f" Before the first impact: {'; '.join(map(_converges, starts))}."
    yield Exhibit(
        name="step-size",
        title="Error against step size",
        caption="Points parallel to the dotted slope mean that halving the step halves the error. The shaded range is "
        f"that of the {PHASES} grids averaged in each point: other steps, other impact phases, because a rebound waits "
        "for the grid. A scheme that converges does so to its own equation, not to free flight.",
        alt=f"Two log-log plots of error against step. {words}",
        maker=figure_step_size,
        data=(studies, starts),
        table=table(studies, starts),
    )


def _converges(study: StepSize) -> str:
    if study.exact:
        return f"{study.scheme} equals {study.model} to round-off at every step"
    order = f"order {study.order:.2f}" if math.isfinite(study.order) else "no order"
    return (
        f"{study.scheme} to {study.model} {order}, error {study.mean_error[0]:.1e} of omega_0 at a step of "
        f"{study.mean_dt[0]:.1e} s down to {study.mean_error[-1]:.1e} at {study.mean_dt[-1]:.1e} s"
    )


def table(flights: Sequence[StepSize], starts: Sequence[StepSize]) -> str:
    """Return the error at every step size, with the range of its grids and the order that was fitted."""
    return rows_csv(
        ("part of the flight", "scheme", "held against", "mean dt [s]", "mean error [of omega_0]",
         "least error [of omega_0]", "largest error [of omega_0]", "fitted order [1]", "its standard error [1]"),
        (
            (part, study.scheme, study.model, dt, mean, errors.min(), errors.max(), study.order, study.order_error)
            for part, studies in (("whole flight", flights), ("before the first impact", starts))
            for study in studies
            for dt, mean, errors in zip(study.mean_dt, study.mean_error, study.error, strict=True)
        ),
    )  # fmt: skip


CHAPTER: Final = Chapter(
    name="step-size",
    title="Error against step size",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
    template=Path(__file__).with_name("part.html.j2"),
    work={"check": 0, "quick": 6, "full": 7},
)
