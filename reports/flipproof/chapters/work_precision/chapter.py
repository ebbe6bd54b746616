"""What a digit costs: error against cost, every contender against its own equation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from flipproof.chapters.work_precision import contenders
from flipproof.chapters.work_precision.claims import claim_work_precision
from flipproof.chapters.work_precision.contenders import CASES
from flipproof.chapters.work_precision.exhibits import draw_work_precision
from flipproof.chapters.work_precision.study import WorkPrecision, plan_work_precision, study_work_precision
from flipproof.chapters.work_precision.tables import summarise_work_precision, tabulate_work_precision
from flipproof.frame.chapter import Ask, Call, Chapter, Made, Run, Study
from flipproof.frame.timing import batches, make_timed


def study(ask: Ask) -> Study[tuple[WorkPrecision, ...]]:
    """Have workers time the runs of every throw of the effort ``ask.work``, those of one solver together."""
    cases = [CASES[name] for name in ask.work.cases]
    jobs = batches([(run, case.times) for case in cases for run in plan_work_precision(case, ask.work)])
    calls = [Call(make_timed, (job,), f"work, {job[0][0].solver}", timed=True) for job in jobs]
    # After the other runs, so that the compiled loop is there and its compiling is not counted.
    yield ()
    flights = yield calls
    made: Mapping[Run, Made] = {each.run: each for call in calls for each in flights.answer(call)}
    return tuple(study_work_precision(case, ask.work, made) for case in cases)


CHAPTER: Final = Chapter(
    name="work-precision",
    title="What a digit costs",
    study=study,
    claims=claim_work_precision,
    figures=draw_work_precision,
    template=Path(__file__).with_name("part.html.j2"),
    work={"full": contenders.FULL},
    summary=lambda found: {"work_precision": summarise_work_precision(found)},
    page=lambda found: {"tables": list(tabulate_work_precision(found))},
)
