"""From a scenario to a report folder: findings, figures, two pages, summary, verdicts for CI systems, and tables."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, Final

from flipproof.chapters import parts
from flipproof.chapters.solvers import CERTIFIED, Guest, solver_runs
from flipproof.frame.chapter import Ask, Part, Size
from flipproof.frame.exhibit import Exhibit, drawn
from flipproof.frame.findings import Finding
from flipproof.frame.gather import Gathered, Stages, evaluate, gather
from flipproof.frame.pool import Progress, SerialExecutor, compile_kernels
from flipproof.frame.run_store import RunStore
from flipproof.output.junit import junit_text
from flipproof.output.summary import SCHEMA_NAME, schema_text, summarise, summary_text
from flipproof.page.render import render
from flipproof.page.verdict import verdict
from slicemodel import Scenario

SLICES: Final = 50
"""Slices at which solvers are compared, unless results otherwise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A finished report in memory; ``tables`` maps paths in its folder to the text of files.

    ``pages`` are the files ``index.html``, the story, and ``evidence.html``, by their names.
    """

    findings: tuple[Finding, ...]
    exhibits: tuple[Exhibit, ...]
    pages: Mapping[str, str]
    summary: dict[str, Any]
    tables: dict[str, str]

    @property
    def failed(self) -> tuple[Finding, ...]:
        """Regression claims that failed or could not be evaluated."""
        return tuple(finding for finding in self.findings if finding.failed)


def ask_of(
    scenario: Scenario,
    size: Size,
    slices: int | None = None,
    certified: tuple[str, ...] | None = None,
    guests: tuple[Guest, ...] = (),
) -> Ask:
    """Return what a report of a throw asks of its chapters.

    ``slices`` are those at which solvers are compared; None: SLICES, or the scenario's own if they are fewer.
    ``certified`` are the witnesses that are certified; None: those of the size. ``guests`` that could be loaded fly
    beside the other solvers.
    """
    throw = scenario.with_slices(slices or min(SLICES, scenario.n_slices))
    loaded = {guest.label: guest for guest in guests if guest.traits is not None}
    ask = Ask(scenario=scenario, throw=throw, size=size, guests=loaded)
    solvers = solver_runs(throw, ask.steps, CERTIFIED[size] if certified is None else certified)
    return replace(ask, solvers=solvers | {label: guest.run(throw) for label, guest in loaded.items()})


def gather_report(
    ask: Ask,
    pool: Executor,
    progress: Progress = lambda *_: None,
    *,
    stages: Stages | None = None,
    store: RunStore | None = None,
    contents: tuple[Part, ...] | None = None,
    work: Mapping[str, Any] | None = None,
) -> Gathered:
    """Make every run of a report in a pool, and study them; ``contents`` are its parts, if not those of every report.

    Slow runs and calls are looked for in the ``store`` and kept there.
    """
    compile_kernels(pool)
    return gather(contents or parts(), ask, pool, progress, work=work, stages=stages, store=store)


def build(
    gathered: Gathered,
    provenance: Mapping[str, str],
    pool: Executor | None = None,
    progress: Progress = lambda *_: None,
    *,
    png: bool = False,
) -> Report:
    """Evaluate every claim, draw every figure and write both pages, all in memory.

    Figures are drawn by the workers of ``pool``, or in this process, and reported to ``progress``; ``png`` says whether
    as PNG, too.
    """
    results = evaluate(gathered)
    with gathered.stages.lap("figures"):
        exhibits = drawn(
            [figure for result in results.values() for figure in result.figures],
            pool or SerialExecutor(),
            progress,
            png=png,
        )
    remaining = iter(exhibits)
    results = {
        name: replace(result, figures=tuple(islice(remaining, len(result.figures)))) for name, result in results.items()
    }
    summary = summarise(gathered, results, provenance, verdict(gathered))
    with gathered.stages.lap("page"):
        pages = render(gathered, results, provenance, summary)
    summary["stages"]["page"] = round(gathered.stages.seconds["page"], 3)
    present = [result for result in results.values() if result.study_result is not None]
    return Report(
        findings=tuple(finding for result in results.values() for finding in result.findings),
        exhibits=exhibits,
        pages=pages,
        summary=summary,
        tables={path: text for result in present for path, text in result.chapter.tables(result.study_result).items()},
    )


def write(report: Report, folder: Path) -> None:
    """Write a finished report into an empty folder."""
    files: dict[str, str | bytes] = {
        **report.pages,
        "summary.json": summary_text(report.summary),
        SCHEMA_NAME: schema_text(),
        "junit.xml": junit_text(report.findings, seconds=sum(report.summary["stages"].values())),
        **report.tables,
    }
    for exhibit in report.exhibits:
        files |= {f"figures/{name}": content for name, content in exhibit.files().items()}
    for path, content in files.items():
        place = folder / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
