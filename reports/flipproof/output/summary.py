"""The machine-readable twin of a report: ``summary.json``, as ``schema/summary.schema.json`` describes it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from engine_check.witness import witness_of
from flipproof.evidence import FLIGHTS, OTHERS, Evidence
from flipproof.exhibits_work_precision import summarise_work_precision
from flipproof.frame.exhibit import Exhibit
from flipproof.frame.findings import Finding
from flipproof.frame.solvers import find
from flipproof.page.headlines import headlines
from flipproof.page.lead import lead_words
from flipproof.studies.differences import PARTING_BAND, Difference
from slicemodel import Trajectory
from slicemodel.observables import plateau

SUMMARY_VERSION: Final = 2
"""Rises when a reader of the last version would misread the next."""

SCHEMA_NAME: Final = "summary.schema.json"


def schema_text() -> str:
    """Return the JSON Schema (draft 2020-12) of a summary; it is written beside every summary."""
    return (Path(__file__).resolve().parent / "schema" / SCHEMA_NAME).read_text(encoding="utf-8")


def summarise(
    evidence: Evidence,
    findings: Sequence[Finding],
    exhibits: Sequence[Exhibit],
    solvers: Sequence[Mapping[str, Any]],
    provenance: Mapping[str, str],
) -> dict[str, Any]:
    """Return everything that a report found as JSON-ready data.

    A number that is not finite is one of the words "nan", "inf", "-inf": JSON has no such numbers, and to leave it out
    would hide that something was computed and came to nothing.

    Raises
    ------
    ValueError
        If two findings share an id.
    """
    ids = [finding.id for finding in findings]
    twice = sorted({name for name in ids if ids.count(name) > 1})
    if twice:
        raise ValueError(f"findings share an id: {', '.join(twice)}")
    verdict = headlines(evidence)
    summary = {
        "$schema": SCHEMA_NAME,
        "flipproof": provenance["flipproof"],
        "version": SUMMARY_VERSION,
        "scenario": evidence.scenario.to_mapping(),
        "slices": evidence.throw.n_slices,
        "size": evidence.size.name,
        "lead": lead_words(verdict),
        "headlines": [headline.to_mapping() for headline in verdict],
        "findings": [finding.to_mapping() for finding in findings],
        "differences": [_difference_mapping(difference) for difference in evidence.differences],
        "solvers": list(solvers),
        "paper": evidence.paper.verdicts.to_mapping() if evidence.paper else None,
        "work_precision": summarise_work_precision(evidence.precision),
        "runs": [_run_mapping(evidence, tag) for tag in evidence.made],
        "problems": {**evidence.attribution.problems, **evidence.instruments.problems},
        "figures": [_figure_mapping(exhibit) for exhibit in exhibits],
        "stages": {name: round(seconds, 3) for name, seconds in evidence.stages.seconds.items()},
        "provenance": dict(provenance),
    }
    if evidence.guests.guests:
        summary["guests"] = [guest.to_mapping() for guest in evidence.guests.guests]
    return {name: json_ready(value) for name, value in summary.items()}


def summary_text(summary: Mapping[str, Any]) -> str:
    """Return a summary as the text of its file."""
    return json.dumps(summary, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def solver_rows(evidence: Evidence) -> list[dict[str, Any]]:
    """Return what the report says of every solver on the throw: status, end, plateau, impacts, diagnostics."""
    return [_solver_row(evidence, tag) for tag in (*FLIGHTS, *OTHERS) if tag in evidence.made]


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
    if solver.package == "engine_check":
        witness = witness_of(trajectory.settings)
        row |= {"equation": witness.equation, "reason": witness.words}
    return row | {
        "status": trajectory.status,
        "message": trajectory.message,
        "final": float(trajectory.omega[-1] / trajectory.scenario.omega0) if _landed(trajectory) else None,
        "plateau": plateau(trajectory.t, trajectory.omega, trajectory.scenario.omega0) if trajectory.ok else None,
        "impacts": None if trajectory.impacts is None else len(trajectory.impacts),
        "diagnostics": json_ready(trajectory.diagnostics),
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
        "settings": trajectory.settings,
    }


def _difference_mapping(difference: Difference) -> dict[str, Any]:
    mapping = {
        name: getattr(difference, name)
        for name in ("name", "first", "second", "largest", "largest_time", "final", "parting_time", "band")
    }
    impact = difference.parting_impact
    slices, largest = difference.finer or (None, None)
    return mapping | {
        "slices": difference.slices,
        "finer": None if slices is None else {"slices": slices, "largest": largest},
        "parting_band": PARTING_BAND,
        "parting_impact": None if impact is None else asdict(impact),
    }


def _figure_mapping(exhibit: Exhibit) -> dict[str, Any]:
    place = f"figures/{exhibit.name}"
    return {
        "name": exhibit.name,
        "section": exhibit.section,
        "title": exhibit.title,
        "caption": exhibit.caption,
        "alt": exhibit.alt,
        "svg": f"{place}.svg",
        "png": f"{place}.png",
        "table": None if exhibit.table is None else f"{place}.csv",
    }


def json_ready(value: Any) -> Any:
    """Return a value as JSON holds it: arrays are left out of mappings, what JSON cannot say becomes text."""
    if isinstance(value, Mapping):
        return {str(name): json_ready(each) for name, each in value.items() if not getattr(each, "shape", None)}
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, (list, tuple)):
        return [json_ready(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)
