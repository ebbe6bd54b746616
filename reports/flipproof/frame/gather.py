"""What drives chapters: their runs in waves, each made once; then their findings, figures and notes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from flipproof.frame.chapter import Absent, Ask, Chapter, Part
from flipproof.frame.exhibit import Exhibit
from flipproof.frame.findings import Finding
from flipproof.frame.flights import Call, Flights, Outcome, attempt, chapter_errors
from flipproof.frame.pool import Progress, make_all
from flipproof.frame.run_store import RunStore
from flipproof.frame.solvers import Run


class Stages:
    """A stopwatch whose laps have names; ``seconds`` holds them in the order in which they were first begun.

    ``begins`` is called with the name of each lap when it begins.
    """

    def __init__(self, begins: Callable[[str], None] = lambda _: None) -> None:
        self.seconds: dict[str, float] = {}
        self._begins = begins

    @contextmanager
    def lap(self, name: str) -> Iterator[None]:
        """Add the wall time of a block to the lap of this name."""
        self._begins(name)
        self.seconds.setdefault(name, 0.0)
        began = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] += time.perf_counter() - began


@dataclass(frozen=True, slots=True, kw_only=True)
class Gathered:
    """What the studies of a report found, or why they found nothing, by chapter; and every run that was made."""

    ask: Ask
    parts: tuple[Part, ...]
    outcomes: Mapping[str, Outcome[Any]]
    flights: Flights
    stages: Stages

    def result(self, name: str) -> Any:
        """Return what a chapter found, or None."""
        return self.outcomes[name].result if name in self.outcomes else None


@dataclass(frozen=True, slots=True, kw_only=True)
class ChapterResult:
    """Findings and figures of a chapter, and ``notes``: what is missing, each with the reason."""

    chapter: Chapter[Any]
    study_result: Any
    findings: tuple[Finding, ...]
    figures: tuple[Exhibit, ...]
    notes: tuple[tuple[str, str], ...]


def gather(
    parts: Iterable[Part],
    ask: Ask,
    pool: Executor,
    progress: Progress = lambda *_: None,
    *,
    work: Mapping[str, Any] | None = None,
    stages: Stages | None = None,
    store: RunStore | None = None,
) -> Gathered:
    """Drive every study to its end, wave by wave; the runs of a wave are made together, equal ones once.

    ``work`` is the amount of work of a chapter in place of that of the size, or although the size has none; ``stages``
    the stopwatch of the report, if somebody watches it; ``store`` where slow runs and calls are looked for and kept.
    """
    parts, stages, work = tuple(parts), stages or Stages(), work or {}
    flights = Flights({})
    outcomes: dict[str, Outcome[Any]] = {}
    waiting: dict[str, tuple[Any, tuple[Run | Call, ...]]] = {}
    for chapter in (chapter for part in parts for chapter in part.chapters):
        if (ask.size in chapter.work or chapter.name in work) and (chapter.ice or not ask.throw.frozen):
            amount = work.get(chapter.name, chapter.work.get(ask.size))
            _advance(chapter.name, chapter.study(replace(ask, work=amount)), None, waiting, outcomes)
    wave = 0
    while waiting:
        wave += 1
        wanted = dict.fromkeys(request for _, requests in waiting.values() for request in requests)
        runs = [request for request in wanted if isinstance(request, Run) and request not in flights]
        calls = [request for request in wanted if isinstance(request, Call)]
        with stages.lap(f"runs, wave {wave}"):
            flights.add(*make_all(pool, runs, progress, calls, store))
        with stages.lap("studies"):
            resumed, waiting = waiting, {}
            for name, (study, _) in resumed.items():
                _advance(name, study, flights, waiting, outcomes)
    return Gathered(ask=ask, parts=parts, outcomes=outcomes, flights=flights, stages=stages)


def _advance(name: str, study: Any, flights: Flights | None, waiting: dict[str, Any], outcomes: dict[str, Any]) -> None:
    """Resume a study with what it asked for; note what it asks next, what it found, or what evidence is missing."""

    def resume() -> tuple[bool, Any]:
        try:
            return False, tuple(study.send(flights))
        except StopIteration as end:
            return True, end.value

    with chapter_errors(f"chapter {name!r}, study"):
        outcome = attempt(resume)
    if outcome.reason:
        outcomes[name] = Outcome(None, outcome.reason)
        return
    ended, value = outcome.value
    if ended:
        outcomes[name] = Outcome(value)
    else:
        waiting[name] = (study, value)


def evaluate(gathered: Gathered) -> dict[str, ChapterResult]:
    """Return the findings and figures of every chapter, by its name; no figure is drawn yet."""
    chapters = {chapter.name: chapter for part in gathered.parts for chapter in part.chapters}
    return {
        name: _evaluated(chapter, gathered.outcomes[name])
        for name, chapter in chapters.items()
        if name in gathered.outcomes
    }


def _evaluated(chapter: Chapter[Any], outcome: Outcome[Any]) -> ChapterResult:
    findings: list[Finding | Absent] = []
    drawn: list[Exhibit] = []
    with chapter_errors(f"chapter {chapter.name!r}, claims"):
        claims = attempt(lambda: findings.extend(chapter.claims(outcome.value)))
    with chapter_errors(f"chapter {chapter.name!r}, figures"):
        figures = attempt(lambda: drawn.extend(chapter.figures(outcome.value)))
    if reason := claims.reason or figures.reason:
        findings.append(Absent(f"chapter-{chapter.name}", chapter.title, reason, chapter.kind))
    return ChapterResult(
        chapter=chapter,
        study_result=outcome.result,
        findings=tuple(finding.finding if isinstance(finding, Absent) else finding for finding in findings),
        figures=tuple(drawn),
        notes=tuple((absent.title, absent.reason) for absent in findings if isinstance(absent, Absent)),
    )
