"""Checks that hold a solver to what it says it is: a published program's printed numbers, an equation of the ladder."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flipproof.chapters.vectors.published import Vector, load_all
from flipproof.foreign.checking import Found, Making, NotApplicableError
from flipproof.foreign.contract import Ask, Traits
from flipproof.foreign.place import THROWS, name_of, placing, switches_of


def check_vectors(traits: Traits) -> Making:
    """A solver that claims to be a published program prints its numbers."""
    vectors = [vector for vector in load_all() if vector.scheme == traits.equation]
    if not vectors:
        raise NotApplicableError("no published program is claimed")
    answers = yield [_ask(vector, traits) for vector in vectors]
    worst, where = 0.0, ""
    for vector, answer in zip(vectors, answers, strict=True):
        for column in ("theta", "omega"):
            printed = vector.columns[column][: len(answer.t)]
            rows = np.isfinite(printed)
            off = np.abs(getattr(answer, column) - printed)[rows] / np.maximum(np.abs(printed[rows]), 1e-300)
            if not off.max() <= worst:
                worst, where = float(off.max()), f"{vector.name}, column {column}"
    return Found(
        holds=worst <= 1e-8,  # flipproof's own schemes keep to 1e-10
        expected=f"{len(vectors)} printed runs within 1e-08",
        came=f"{worst:.2g} off",
        where=where,
        advice="compare step by step with the published program's first rows",
        facts={"vectors": worst},
    )


def _ask(vector: Vector, traits: Traits) -> Ask:
    """Return the ask for a published run, up to where its numbers are held to; the program takes its own steps."""
    times = np.linspace(0.0, vector.scenario.duration, vector.steps)
    times = times[times <= vector.until]
    effort = {"steps": float(len(times) - 1), "dt": float(times[1])}.get(traits.refined_by or "")
    return Ask.of(replace(vector.scenario, duration=float(times[-1])), times, effort)


def check_equation(traits: Traits) -> Making:
    """The solver is nearest to the equation it declares, and no farther from it than its own error explains."""
    found = yield from placing(traits)
    if traits.equation is None:
        raise NotApplicableError(f"none is declared; {found.text}")
    try:
        declared = name_of(switches_of(traits.equation))
    except ValueError as error:
        raise NotApplicableError(str(error)) from None
    return Found(
        holds=found.equation == declared and found.on_lattice,
        expected=declared,
        came=found.text,
        where=f"{len(THROWS)} throws of {THROWS[0].duration:g} to {THROWS[-1].duration:g} s",
        advice="flipproof explain compares it with the declared equation, switch by switch",
        facts={"place": found.to_mapping()},
    )
