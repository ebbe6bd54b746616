"""From evidence to a report folder: findings, figures, page, summary, verdicts for CI systems, and tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flipproof.evaluation import evaluate
from flipproof.evidence import FLIGHTS, OTHERS, Evidence
from flipproof.exhibits import draw_all
from flipproof.film.measured import Measured
from flipproof.frame.exhibit import Exhibit, drawn
from flipproof.frame.findings import Finding
from flipproof.output.junit import junit_text
from flipproof.output.summary import SCHEMA_NAME, schema_text, solver_rows, summarise, summary_text
from flipproof.output.tables import trajectory_csv
from flipproof.page.motion import motion_data
from flipproof.page.render import render
from flipproof.paper.figures import exhibits_paper


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A finished report in memory."""

    findings: tuple[Finding, ...]
    exhibits: tuple[Exhibit, ...]
    html: str
    summary: dict[str, Any]
    tables: dict[str, str]

    @property
    def failed(self) -> tuple[Finding, ...]:
        """Regression claims that failed or could not be evaluated."""
        return tuple(finding for finding in self.findings if finding.failed)


def build(
    evidence: Evidence, provenance: Mapping[str, str], jobs: int | None = None, measured: Measured | None = None
) -> Report:
    """Evaluate every claim, draw every figure and write the page, all in memory.

    Parameters
    ----------
    evidence : Evidence
    provenance : mapping
    jobs : int or None
        Worker processes that draw; None: one per core, 1: this process.
    measured : Measured or None
        A measured flight that the report holds beside its solvers.
    """
    paper = evidence.paper
    findings = (
        *evaluate(evidence),
        *(paper.verdicts.findings() if paper else ()),
        *(measured.findings() if measured else ()),
    )
    with evidence.stages.lap("figures"):
        figures = (*draw_all(evidence), *(exhibits_paper(paper.runs) if paper else ()))
        exhibits = drawn((*figures, *((measured.exhibit(),) if measured else ())), jobs)
    solvers = solver_rows(evidence)
    summary = summarise(evidence, findings, exhibits, solvers, provenance)
    with evidence.stages.lap("page"):
        html = render(
            evidence,
            findings,
            exhibits,
            solvers,
            provenance,
            summary=summary,
            motion=motion_data(evidence.throw, evidence.made),
            paper=paper.verdicts if paper else None,
            measured=measured,
        )
    summary["stages"]["page"] = round(evidence.stages.seconds["page"], 3)
    return Report(
        findings=findings,
        exhibits=exhibits,
        html=html,
        summary=summary,
        tables={
            tag: trajectory_csv(trajectory)
            for tag in (*FLIGHTS, *OTHERS)
            if (trajectory := evidence.trajectory(tag)) is not None
        },
    )


def write(report: Report, folder: Path) -> None:
    """Write a finished report into an empty folder."""
    (folder / "index.html").write_text(report.html, encoding="utf-8")
    (folder / "summary.json").write_text(summary_text(report.summary), encoding="utf-8")
    (folder / SCHEMA_NAME).write_text(schema_text(), encoding="utf-8")
    (folder / "junit.xml").write_text(junit_text(report.findings), encoding="utf-8")
    for exhibit in report.exhibits:
        place = folder / "figures"
        place.mkdir(exist_ok=True)
        (place / f"{exhibit.name}.svg").write_text(exhibit.drawing.svg, encoding="utf-8")
        (place / f"{exhibit.name}.png").write_bytes(exhibit.drawing.png)
        if exhibit.table is not None:
            (place / f"{exhibit.name}.csv").write_text(exhibit.table, encoding="utf-8")
    for tag, table in report.tables.items():
        place = folder / "trajectories" / tag
        place.mkdir(parents=True, exist_ok=True)
        (place / "data.csv").write_text(table, encoding="utf-8")
