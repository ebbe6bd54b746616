"""The work-precision study as a report shows it: figures with their words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from flipproof.chapters.work_precision.figure import figure_work_precision
from flipproof.chapters.work_precision.study import Cost, Curve, WorkPrecision
from flipproof.frame.exhibit import Exhibit
from flipproof.output.columns import rows_csv

ERRORS: Final = (1e-2, 1e-3, 1e-4, 1e-6)
COUNTED: Final = {
    "scheme": "steps × slices (× 2 where it predicts)",
    "method": "right-hand sides × slices",
    "engine": "steps × slices × iterations, or × 4 for RK4",
}
UNITS: Final[dict[Cost, str]] = {"work": "updates of one slice", "steps": "steps", "seconds": "processor time"}


def draw_work_precision(studies: Sequence[WorkPrecision]) -> Iterator[Exhibit]:
    """Yield a figure for each throw over updates; if there are several, one of them over processor time as well."""
    for study in studies:
        yield _exhibit(study, "work")
    if len(studies) > 1:
        yield _exhibit(max(studies, key=_whole_levels), "seconds")


def _whole_levels(study: WorkPrecision) -> tuple[bool, int, str]:
    # Through impacts first: there the methods differ by what an event costs them.
    return (study.case.name == "impacts", sum(len(curve.whole) for curve in study.curves.values()), study.case.name)


def _exhibit(study: WorkPrecision, cost: Cost) -> Exhibit:
    reached = "; ".join(_reached(curve, cost) for curve in study.curves.values())
    floors = ", ".join(
        f"{name} {reference.floor:.1e}"
        for name, reference in study.references.items()
        if math.isfinite(reference.floor)
    )
    return Exhibit(
        name=f"work-precision-{study.case.name}" + ("" if cost == "work" else "-time"),
        title=f"What a digit costs: {study.case.title}" + ("" if cost == "work" else ", in processor time"),
        caption="Farther left is cheaper, farther down is better; p is the order in cost. Each panel holds one "
        "equation and those who solve it, so that what lies between equations does not enter. In the grey nothing is "
        "claimed: there the reference itself is uncertain. A cross at the top edge is a run that failed; the table "
        "says why. "
        + (
            "An update of one slice is counted the same on every machine, but is not the same work to everyone."
            if cost == "work"
            else "Schemes and engines run in compiled code, methods in Python: this is the price of a program."
        ),
        alt=f"Log-log plots of error, of omega_0, against {UNITS[cost]}. From the first level to the last: {reached}. "
        f"Floors: {floors}.",
        maker=figure_work_precision,
        data=(study, cost),
        table=table_work_precision(study),
    )


def _reached(curve: Curve, cost: Cost) -> str:
    """Return error and cost of a contender's first and last level, or why there is none."""
    if not curve.whole:
        return f"{curve.contender.key}: {curve.failed[0].reason.partition(':')[0]}"
    first, last = curve.whole[0], curve.whole[-1]
    unit = " s" if cost == "seconds" else ""
    return (
        f"{curve.contender.key}: {first.error:.1e} for {first.cost(cost):.1e}{unit} to {last.error:.1e} for "
        f"{last.cost(cost):.1e}{unit}"
    )


def table_work_precision(study: WorkPrecision) -> str:
    """Every level of every contender, with its price and its error."""
    return rows_csv(
        ("contender", "equation", "level", "updates of one slice [1]", "steps [1]", "processor time [s]",
         "error of omega [of omega_0]", "least error [of omega_0]", "largest error [of omega_0]",
         "error of the plateau [of omega_0]", "floor of the reference [of omega_0]", "at the floor",
         "failed because"),
        (
            (curve.contender.name, curve.contender.equation, point.settings, point.work, point.steps, point.seconds,
             point.error, point.lowest, point.highest, point.plateau,
             study.references[curve.contender.equation].floor, point.at_floor, point.reason)
            for curve in study.curves.values()
            for point in curve.points
        ),
    )  # fmt: skip
