"""The machine-readable twin of a report: ``summary.json``, as ``schema/summary.schema.json`` describes it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from flipproof.frame.columns import json_ready
from flipproof.frame.exhibit import Exhibit
from flipproof.frame.gather import ChapterResult, Gathered
from flipproof.frame.solvers import RunResult

SUMMARY_VERSION: Final = 2
"""Rises when a reader of the last version would misread the next."""

SCHEMA_NAME: Final = "summary.schema.json"


def schema_text() -> str:
    """Return the JSON Schema (draft 2020-12) of a summary; it is written beside every summary."""
    return (Path(__file__).resolve().parent / "schema" / SCHEMA_NAME).read_text(encoding="utf-8")


def summarise(
    gathered: Gathered, results: Mapping[str, ChapterResult], provenance: Mapping[str, str], verdict: Mapping[str, Any]
) -> dict[str, Any]:
    """Return everything that a report found as JSON-ready data; ``verdict`` holds its lead and its headlines.

    A number that is not finite is one of the words "nan", "inf", "-inf": JSON has no such numbers, and to leave it out
    would hide that something was computed and came to nothing. Raises ValueError if two findings share an id.
    """
    findings = [finding for result in results.values() for finding in result.findings]
    ids = Counter(finding.id for finding in findings)
    if len(ids) < len(findings):
        raise ValueError(f"findings share an id: {', '.join(sorted(name for name, n in ids.items() if n > 1))}")
    summary: dict[str, Any] = {
        "$schema": SCHEMA_NAME,
        "flipproof": provenance["flipproof"],
        "version": SUMMARY_VERSION,
        "scenario": gathered.ask.scenario.to_mapping(),
        "slices": gathered.ask.throw.n_slices,
        "size": gathered.ask.size,
        **verdict,
        "findings": [finding.to_mapping() for finding in findings],
        "differences": [],
        "solvers": [],
        "paper": None,
        "runs": [_run_mapping(flight) for flight in gathered.flights.values()],
        "problems": dict(note for result in results.values() for note in result.notes),
        "figures": [
            _figure_mapping(exhibit, part.id)
            for part in gathered.parts
            for chapter in part.chapters
            if chapter.name in results
            for exhibit in results[chapter.name].figures
        ],
        "stages": {name: round(seconds, 3) for name, seconds in gathered.stages.seconds.items()},
        "provenance": dict(provenance),
    }
    for result in results.values():
        if result.study_result is not None:
            summary |= result.chapter.summary(result.study_result)
    return {name: json_ready(value) for name, value in summary.items()}


def summary_text(summary: Mapping[str, Any]) -> str:
    """Return a summary as the text of its file."""
    return json.dumps(summary, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def _run_mapping(result: RunResult) -> dict[str, Any]:
    mapping: dict[str, Any] = {"tag": result.run.name, "solver": result.run.solver, "seconds": round(result.seconds, 4)}
    if result.trajectory is None:
        return mapping | {"status": "failed", "message": result.reason}
    run = result.trajectory
    return mapping | {"status": run.status, "message": run.message, "settings": run.settings}


def _figure_mapping(exhibit: Exhibit, section: str) -> dict[str, Any]:
    place = f"figures/{exhibit.name}"
    return {
        "name": exhibit.name,
        "section": section,
        **{field: getattr(exhibit, field) for field in ("title", "caption", "alt")},
        "svg": f"{place}.svg",
        "png": f"{place}.png" if exhibit.drawn and exhibit.drawn.png else None,
        "table": None if exhibit.table is None else f"{place}.csv",
    }
