"""The paper's figures and statements, by three equations; they do not depend on the throw of the report."""

from __future__ import annotations

from typing import Final, NamedTuple

from flipproof.frame.chapter import Ask, Chapter, Study
from flipproof.paper.figures import exhibits_paper
from flipproof.paper.runs import PaperRuns, group_calls, plan_claims, plan_figures
from flipproof.paper.verdicts import PaperVerdicts, judge_paper


class Paper(NamedTuple):
    """The paper's own throws, and what becomes of its statements."""

    runs: PaperRuns
    verdicts: PaperVerdicts


def study(ask: Ask) -> Study[Paper]:
    """Make the throws of the figures, and those that statements need beside them; then judge."""
    del ask
    plan = plan_claims()
    calls = [*group_calls(plan_figures(), "the paper's figures"), *group_calls(plan, "the paper's statements")]
    flights = yield [*calls, *(planned.run for planned in plan if not planned.grouped)]
    runs = PaperRuns.of(flights, calls, plan)
    return Paper(runs, judge_paper(runs))


CHAPTER: Final = Chapter(
    name="paper",
    title="The paper's figures and claims",
    study=study,
    claims=lambda results: results.verdicts.findings(),
    figures=lambda results: exhibits_paper(results.runs),
    work={"full": None},
    summary=lambda results: {"paper": results.verdicts.to_mapping()},
    page=lambda results: {"paper": results.verdicts},
)
