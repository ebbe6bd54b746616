"""The published programs' printed numbers are reproduced, in every column and over the whole run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from flipproof.chapters.vectors.published import Vector, deviations, load_all
from flipproof.frame.chapter import Ask, Chapter, Claims, Finding, Made, Run, Study, judged, regression

TOLERANCE: Final = {"published-python": 1e-10, "published-matlab": 1e-8}
"""Relative; the two sides differ by the order of additions and, for MATLAB, by amplified round-off."""


@dataclass(frozen=True, slots=True)
class Repeated:
    """One published run, and what became of ours."""

    vector: Vector
    made: Made


def study(ask: Ask) -> Study[tuple[Repeated, ...]]:
    """Repeat every published run; these are throws of the paper, whatever the report's own is."""
    del ask
    runs = {
        vector.name: (vector, Run(vector.scheme, vector.scenario, {"steps": vector.steps}, f"vector {vector.name}"))
        for vector in load_all()
    }
    flights = yield [run for _, run in runs.values()]
    return tuple(Repeated(vector, flights[run]) for vector, run in runs.values())


def claims(found: tuple[Repeated, ...]) -> Claims:
    """Yield the largest deviation of each run from what was printed."""
    for one in found:
        yield judged(
            lambda one: claim_vectors(one.vector.name, one.vector.scheme, deviations(one.vector, one.made.flight)),
            one,
            id=f"vectors-{one.vector.name}",
            title=f"published run {one.vector.name}",
        )


def claim_vectors(name: str, scheme: str, off: Mapping[str, float]) -> Finding:
    """The scheme reproduces what the published program prints; ``off`` is the largest deviation of each column."""
    worst = max(off, key=lambda column: math.inf if math.isnan(off[column]) else off[column])
    return regression(
        id=f"vectors-{name}",
        title=f"{scheme} reproduces the published run {name}",
        value=float(off[worst]),
        unit="relative",
        admissible=(0.0, TOLERANCE[scheme]),
        note=f"largest in column {worst}, over {len(off)} columns",
    )


CHAPTER: Final = Chapter(
    name="vectors",
    title="Published vectors",
    study=study,
    claims=claims,
    kind="regression",
    work={"check": None, "quick": None, "full": None},
)
