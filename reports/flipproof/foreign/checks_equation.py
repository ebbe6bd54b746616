"""Checks that hold a solver to what it says it is: a published program's printed numbers, an equation of the ladder."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flipproof.chapters.solvers import LIMITS
from flipproof.chapters.vectors.published import Vector, load_all
from flipproof.foreign.answers import Answer
from flipproof.foreign.checking import Found, Making, NotApplicableError
from flipproof.foreign.contract import Ask, Traits
from flipproof.foreign.place import THROWS, name_of, placing, switches_of

VECTOR = 1e-8
"""Largest relative difference to a published number; flipproof's own schemes keep to 1e-10."""


def check_vectors(traits: Traits) -> Making:
    """A solver that claims to be a published program prints its numbers."""
    vectors = [vector for vector in load_all() if vector.scheme == traits.equation]
    if not vectors:
        raise NotApplicableError("no published program is claimed")
    answers = yield [_ask(vector, traits) for vector in vectors]
    worst, where = 0.0, ""
    for vector, answer in zip(vectors, answers, strict=True):
        for column in ("theta", "omega"):
            off = _off(vector, answer, column)
            if not off <= worst:
                worst, where = off, f"{vector.name}, column {column}"
    return Found(
        holds=worst <= VECTOR,
        expected=f"{len(vectors)} printed runs within {VECTOR:g}",
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


def _off(vector: Vector, answer: Answer, column: str) -> float:
    printed = vector.columns[column]
    printed = printed[: len(answer.t)]
    rows = np.isfinite(printed)
    off = np.abs(getattr(answer, column) - printed)[rows]
    return float(np.max(off / np.maximum(np.abs(printed[rows]), 1e-300)))


def check_equation(traits: Traits) -> Making:
    """The solver is nearest to the equation it declares, and no farther from it than its own error explains."""
    found = yield from placing(traits)
    facts = {"place": found.to_mapping()}
    if traits.equation is None:
        raise NotApplicableError(f"none is declared; {found.text}")
    if traits.equation not in LIMITS and not traits.equation.startswith("switches:"):
        try:
            switches_of(traits.equation)
        except ValueError as error:
            raise NotApplicableError(str(error)) from None
    declared = name_of(switches_of(traits.equation))
    return Found(
        holds=found.equation == declared and found.on_lattice,
        expected=declared,
        came=found.text,
        where=f"{len(THROWS)} throws of {THROWS[0].duration:g} to {THROWS[-1].duration:g} s",
        advice="flipproof explain compares it with the declared equation, switch by switch",
        facts=facts,
    )
