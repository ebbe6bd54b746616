"""From evidence to a report folder: findings, figures, page, summary and tables."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from reports.evaluation import evaluate
from reports.evidence import FLIGHTS, FREE, OTHERS, Evidence
from reports.exhibit import Exhibit
from reports.exhibits import draw_all
from reports.exhibits_work_precision import summarise_work_precision
from reports.findings import Finding
from reports.lead import lead_words
from reports.page import render
from reports.solvers import find
from reports.studies.differences import PARTING_BAND
from reports.tables import trajectory_csv
from slicemodel import Trajectory
from slicemodel.observables import plateau

SUMMARY_VERSION = 1


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


def build(evidence: Evidence, provenance: Mapping[str, str]) -> Report:
    """Evaluate every claim, draw every figure and write the page, all in memory."""
    findings = tuple(evaluate(evidence))
    exhibits = tuple(draw_all(evidence))
    solvers = [_solver_row(evidence, tag) for tag in (*FLIGHTS, *OTHERS)]
    summary = {
        "flipproof": provenance["flipproof"],
        "version": SUMMARY_VERSION,
        "scenario": evidence.scenario.to_mapping(),
        "slices": evidence.throw.n_slices,
        "size": evidence.size.name,
        "findings": [finding.to_mapping() for finding in findings],
        "differences": [_difference_mapping(difference) for difference in evidence.differences],
        "solvers": solvers,
        "work_precision": summarise_work_precision(evidence.precision),
        "runs": [_run_mapping(evidence, tag) for tag in evidence.made],
        "lead": lead_words(evidence.differences, evidence.trajectory(FREE)),
        "figures": [{"name": s.name, "title": s.title, "alt": s.alt} for s in exhibits],
        "provenance": dict(provenance),
    }
    return Report(
        findings=findings,
        exhibits=exhibits,
        html=render(evidence, findings, exhibits, solvers, provenance),
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
    (folder / "summary.json").write_text(json.dumps(report.summary, indent=1, allow_nan=False), encoding="utf-8")
    for exhibit in report.exhibits:
        place = folder / "figures"
        place.mkdir(exist_ok=True)
        (place / f"{exhibit.name}.svg").write_text(exhibit.drawing.svg, encoding="utf-8")
        (place / f"{exhibit.name}.png").write_bytes(exhibit.drawing.png)
    for tag, table in report.tables.items():
        place = folder / "trajectories" / tag
        place.mkdir(parents=True, exist_ok=True)
        (place / "data.csv").write_text(table, encoding="utf-8")


def _solver_row(evidence: Evidence, tag: str) -> dict[str, Any]:
    made = evidence.made[tag]
    solver = find(made.run.solver)
    row: dict[str, Any] = {
        "name": tag,
        "package": solver.package,
        "equation": solver.equation,
        "reason": solver.reason,
        "seconds": made.seconds,
    }
    trajectory = made.trajectory
    if trajectory is None:
        return row | {"status": "failed", "message": made.reason}
    return row | {
        "status": trajectory.status,
        "message": trajectory.message,
        "final": float(trajectory.omega[-1] / trajectory.scenario.omega0) if _landed(trajectory) else None,
        "plateau": plateau(trajectory.t, trajectory.omega, trajectory.scenario.omega0) if trajectory.ok else None,
        "impacts": None if trajectory.impacts is None else len(trajectory.impacts),
        "diagnostics": _plain(trajectory.diagnostics),
    }


def _landed(trajectory: Trajectory) -> bool:
    """Return whether the run reached the end of the flight."""
    return bool(trajectory.t[-1] >= trajectory.scenario.duration * (1 - 1e-12))


def _run_mapping(evidence: Evidence, tag: str) -> dict[str, Any]:
    made = evidence.made[tag]
    mapping: dict[str, Any] = {"tag": tag, "solver": made.run.solver, "seconds": round(made.seconds, 4)}
    if made.trajectory is None:
        return mapping | {"status": "failed", "message": made.reason}
    trajectory = made.trajectory
    return mapping | {
        "status": trajectory.status,
        "message": trajectory.message,
        "settings": _plain(trajectory.settings),
    }


def _difference_mapping(difference: Any) -> dict[str, Any]:
    mapping = {
        name: getattr(difference, name)
        for name in ("name", "first", "second", "largest", "largest_time", "final", "parting_time", "band")
    }
    impact = difference.parting_impact
    return mapping | {"parting_band": PARTING_BAND, "parting_impact": None if impact is None else asdict(impact)}


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings or diagnostics as JSON-ready values, without the arrays."""
    return {name: _plain_value(value) for name, value in values.items() if not getattr(value, "shape", None)}


def _plain_value(value: Any) -> Any:
    """Return one value as JSON holds it; what it cannot say becomes text."""
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, Mapping):
        return _plain(value)
    if isinstance(value, (list, tuple)):
        return [_plain_value(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)
