"""What a digit costs: error against cost, every contender against its own equation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any, Final, NamedTuple

from flipproof.chapters.work_precision.contenders import FULL, THROW, common_times, plan_work_precision
from flipproof.chapters.work_precision.figure import figure_work_precision
from flipproof.chapters.work_precision.study import Curve, WorkPrecision, study_work_precision
from flipproof.frame.chapter import Ask, Band, Call, Chapter, Exhibit, Finding, Study, observed
from flipproof.frame.columns import rows_csv
from flipproof.frame.findings import finite_or_none
from flipproof.frame.timing import batches, make_timed

NAME: Final = "impacts"
TITLE: Final = "the paper's throw, with all its impacts"


def study(ask: Ask) -> Study[WorkPrecision]:
    """Have workers time the runs of the effort ``ask.work``, those of one solver together."""
    plan = plan_work_precision(THROW, ask.work)
    jobs = batches([(run, common_times(THROW)) for run in plan.runs()])
    calls = [Call(make_timed, (job,), f"work, {job[0][0].solver}", timed=True) for job in jobs]
    # After the other runs, so that the compiled loop is there and its compiling is not counted.
    yield ()
    flights = yield calls
    return study_work_precision(plan, {result.run: result for call in calls for result in flights.answer(call)})


def claims(study: WorkPrecision) -> Iterator[Finding]:
    """Yield the order in cost of midpoint; what others reach stands in figure and table."""
    slope = study.curves["midpoint on eq8"].slope
    words = "order 2 where nothing strikes; v_CM jumps at an impact, and drag feels a mean of it for one whole step"
    yield observed(
        f"work-order-midpoint-{NAME}",
        f"observed order in cost of midpoint, {TITLE}",
        finite_or_none(slope.order),
        note=slope.reason or words,
        band=Band(slope.error, "fit"),
    )


def figures(study: WorkPrecision) -> Iterator[Exhibit]:
    """Yield the figure over updates of one slice."""

    def reached(curve: Curve) -> str:
        """Return error and cost of a contender's first and last level, or why there is none."""
        if not curve.whole:
            return f"{curve.contender.key}: {curve.failed[0].reason.partition(':')[0]}"
        words = (f"{level.error:.1e} for {level.work:.1e}" for level in (curve.whole[0], curve.whole[-1]))
        return f"{curve.contender.key}: {' to '.join(words)}"

    levels = "; ".join(map(reached, study.curves.values()))
    references = study.references.items()
    floors = ", ".join(
        f"{name} {reference.floor:.1e}" for name, reference in references if math.isfinite(reference.floor)
    )
    yield Exhibit(
        name=f"work-precision-{NAME}",
        title=f"What a digit costs: {TITLE}",
        caption="Farther left is cheaper, farther down is better; p is the order in cost: doubling the work divides "
        "the error by 2^p. Each panel holds one equation and its solvers, so that differences between equations do "
        "not enter. Solid: schemes, by their steps; dashed: methods, by their tolerance; dotted: engines, by their dt. "
        "In the grey nothing is claimed: there the reference itself is uncertain; a hollow mark lies at that floor. "
        "A cross at the top edge is a run that failed; the table says why. The number of slice updates is the "
        "same on every machine, but one update costs solvers different work.",
        alt="Log-log plots of error, of omega_0, against updates of one slice. "
        f"From the first level to the last: {levels}. Floors: {floors}.",
        maker=figure_work_precision,
        data=(study,),
        table=_levels_csv(study),
    )


def _levels_csv(study: WorkPrecision) -> str:
    """Return every level of every contender, with its price and its error."""
    return rows_csv(
        ("contender", "equation", "level", "updates of one slice [1]", "steps [1]", "processor time [s]",
         "error of omega [of omega_0]", "least error [of omega_0]", "largest error [of omega_0]",
         "floor of the reference [of omega_0]", "at the floor", "failed because"),
        (
            (curve.contender.name, curve.contender.equation, point.settings, point.work, point.steps, point.seconds,
             point.error, point.lowest, point.highest, curve.reference.floor, point.at_floor, point.reason)
            for curve in study.curves.values()
            for point in curve.points
        ),
    )  # fmt: skip


class Table(NamedTuple):
    """A table of words: ``rows`` have as many cells as there are ``columns``."""

    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]


def tabulate(study: WorkPrecision) -> Table:
    """Return what every contender reached and what an error costs it."""
    errors = (1e-2, 1e-3, 1e-4, 1e-6)
    prices = tuple(f"updates for {error:.0e}" for error in errors)
    columns = ("contender", "equation", "error, first to last level", "order in cost", *prices, "seconds for 1e-03")
    rows = []
    for curve in study.curves.values():
        names, whole, failed = (curve.contender.name, curve.contender.equation), curve.whole, curve.failed
        reached = f"{whole[0].error:.1e} to {whole[-1].error:.1e}" if whole else "–"
        reached += " (floor)" if any(point.at_floor for point in whole) else ""
        order = f"{curve.slope.order:.2f} ± {curve.slope.error:.2f}"
        order = f"– ({curve.slope.reason})" if curve.slope.reason else order
        costs = [*(curve.price(error) for error in errors), curve.price(1e-3, "seconds")]
        why = f"{len(failed)} of {len(curve.points)}: {failed[0].settings}: {failed[0].reason}" if failed else ""
        rows.append((*names, reached, order, *(cost.text if cost else "–" for cost in costs), why))
    return Table((*columns, "failed"), rows)


def summarise_work_precision(study: WorkPrecision) -> dict[str, Any]:
    """Return every number of the diagram as JSON-ready data; what is not finite becomes null."""
    references = study.references.items()
    return {
        NAME: {
            "title": TITLE,
            "scenario": study.throw.to_mapping(),
            "references": {
                name: {"floor": finite_or_none(reference.floor), "reason": reference.reason}
                for name, reference in references
            },
            "contenders": {
                key: {
                    **{name: getattr(curve.contender, name) for name in ("name", "family", "equation")},
                    "slope": finite_or_none(curve.slope.order),
                    "slope_error": finite_or_none(curve.slope.error),
                    "slope_reason": curve.slope.reason,
                    "points": [
                        {name: finite_or_none(x) if isinstance(x, float) else x for name, x in asdict(point).items()}
                        for point in curve.points
                    ],
                }
                for key, curve in study.curves.items()
            },
        }
    }


CHAPTER: Final = Chapter(
    name="work-precision",
    title="What a digit costs",
    study=study,
    claims=claims,
    figures=figures,
    work={"full": FULL},
    summary=lambda results: {"work_precision": summarise_work_precision(results)},
    page=lambda results: {"table": tabulate(results)},
)
