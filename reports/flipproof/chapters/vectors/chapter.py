"""The published programs' printed numbers are reproduced, in every column and over the whole run."""

from __future__ import annotations

import math
from typing import Final

from flipproof.frame.chapter import Ask, Chapter, Claims, Finding, Run, RunResult, Study, judged, regression
from slicemodel import Trajectory
from slicemodel.vectors import Vector, deviations, load_all


def study(ask: Ask) -> Study[list[tuple[Vector, RunResult]]]:
    """Repeat every published run; these are throws of the paper, whatever the report's own is."""
    del ask
    vectors = load_all()
    runs = [Run(vector.scheme, vector.scenario, {"steps": vector.steps}, f"vector {vector.name}") for vector in vectors]
    flights = yield runs
    return [(vector, flights[run]) for vector, run in zip(vectors, runs, strict=True)]


def claims(results: list[tuple[Vector, RunResult]]) -> Claims:
    """Yield the largest deviation of each run from what was printed."""
    for vector, result in results:
        title = f"output of the paper's program, {vector.name}"
        yield judged(claim_vectors, vector, result, id=f"vectors-{vector.name}", title=title)


def claim_vectors(vector: Vector, flight: Trajectory) -> Finding:
    """The scheme reproduces what the published program prints, in the column with the largest deviation, too."""
    error = deviations(vector, flight)
    # The two sides differ by the order of additions and, for MATLAB, by amplified round-off.
    admissible = {"published-python": (0.0, 1e-10), "published-matlab": (0.0, 1e-8)}
    worst = max(error, key=lambda column: math.inf if math.isnan(error[column]) else error[column])
    title = f"{vector.scheme} reproduces the output of the paper's program, {vector.name}"
    until = f", up to {vector.until:g} s" if vector.until < vector.scenario.duration else ""
    note = f"largest in column {worst}, over {len(error)} columns{until}"
    return regression(f"vectors-{vector.name}", title, float(error[worst]), "relative", admissible[vector.scheme], note)


CHAPTER: Final = Chapter(
    "vectors", "Published vectors", study, claims, kind="regression", work={"check": None, "quick": None, "full": None}
)
