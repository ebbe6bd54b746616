"""What a digit costs: error against cost, every contender against its own equation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, Literal

from flipproof.chapters.work_precision.claims import claim_work_precision
from flipproof.chapters.work_precision.contenders import CASES, FULL
from flipproof.chapters.work_precision.figure import figure_work_precision
from flipproof.chapters.work_precision.study import Curve, WorkPrecision, plan_work_precision, study_work_precision
from flipproof.chapters.work_precision.tables import summarise_work_precision, tabulate_work_precision
from flipproof.frame.chapter import Ask, Call, Chapter, Exhibit, Study
from flipproof.frame.timing import batches, make_timed
from flipproof.output.columns import rows_csv


def study(ask: Ask) -> Study[tuple[WorkPrecision, ...]]:
    """Have workers time the runs of every throw of the effort ``ask.work``, those of one solver together."""
    cases = [CASES[name] for name in ask.work.cases]
    jobs = batches([(run, case.times) for case in cases for run in plan_work_precision(case, ask.work)])
    calls = [Call(make_timed, (job,), f"work, {job[0][0].solver}", timed=True) for job in jobs]
    # After the other runs, so that the compiled loop is there and its compiling is not counted.
    yield ()
    flights = yield calls
    made = {each.run: each for call in calls for each in flights.answer(call)}
    return tuple(study_work_precision(case, ask.work, made) for case in cases)


def figures(studies: Sequence[WorkPrecision]) -> Iterator[Exhibit]:
    """Yield a figure for each throw over updates; if there are several, one of them over processor time as well."""
    for study in studies:
        yield _exhibit(study, "work")
    if len(studies) > 1:
        # Through impacts: there methods differ by what an event costs them.
        yield _exhibit(next(study for study in studies if study.case.name == "impacts"), "seconds")


def _exhibit(study: WorkPrecision, cost: Literal["work", "seconds"]) -> Exhibit:
    timed = cost == "seconds"

    def reached(curve: Curve) -> str:
        """Return error and cost of a contender's first and last level, or why there is none."""
        if not curve.whole:
            return f"{curve.contender.key}: {curve.failed[0].reason.partition(':')[0]}"
        levels = (curve.whole[0], curve.whole[-1])
        words = (f"{level.error:.1e} for {level.cost(cost):.1e}{' s' if timed else ''}" for level in levels)
        return f"{curve.contender.key}: {' to '.join(words)}"

    levels = "; ".join(map(reached, study.curves.values()))
    floors = ", ".join(f"{r.equation} {r.floor:.1e}" for r in study.references.values() if math.isfinite(r.floor))
    return Exhibit(
        name=f"work-precision-{study.case.name}{'-time' if timed else ''}",
        title=f"What a digit costs: {study.case.title}{', in processor time' if timed else ''}",
        caption="Farther left is cheaper, farther down is better; p is the order in cost. Each panel holds one "
        "equation and those who solve it, so that what lies between equations does not enter. In the grey nothing is "
        "claimed: there the reference itself is uncertain. A cross at the top edge is a run that failed; the table "
        "says why. "
        + (
            "Schemes and engines run in compiled code, methods in Python: this is the price of a program."
            if timed
            else "An update of one slice is counted the same on every machine, but is not the same work to everyone."
        ),
        alt=f"Log-log plots of error, of omega_0, against {'processor time' if timed else 'updates of one slice'}. "
        f"From the first level to the last: {levels}. Floors: {floors}.",
        maker=figure_work_precision,
        data=(study, cost),
        table=_levels_csv(study),
    )


def _levels_csv(study: WorkPrecision) -> str:
    """Return every level of every contender, with its price and its error."""
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


CHAPTER: Final = Chapter(
    name="work-precision",
    title="What a digit costs",
    study=study,
    claims=claim_work_precision,
    figures=figures,
    template=Path(__file__).with_name("part.html.j2"),
    work={"full": FULL},
    summary=lambda found: {"work_precision": summarise_work_precision(found)},
    page=lambda found: {"tables": list(tabulate_work_precision(found))},
)
