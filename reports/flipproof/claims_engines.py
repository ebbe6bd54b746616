"""Claims about the engines: where pymunk is stable, what engines do unexpectedly, and how small changes move omega."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flipproof.frame.findings import Finding
from flipproof.studies.agreement import Agreement
from flipproof.studies.engine_facts import EngineFact
from flipproof.studies.horizon import Horizon
from flipproof.studies.overlap import COLUMN, EXCLUDE, PASS, Overlap
from flipproof.studies.predictability import HORIZON_BAND
from flipproof.studies.stability import DEFAULT_ITERATIONS, GOOD, RULE_DT, StabilityPanel
from slicemodel import Trajectory

FULL_BOTTLE = 1e-3
"""What a full bottle in which nothing can move may lose of its angular velocity, fraction of omega_0."""

ANGLE_BAND = HORIZON_BAND / 1000
"""What another angle of release may do to omega, as a fraction of omega_0: what parts flights is then their own."""


def claim_rule_of_iterations(panels: Sequence[StabilityPanel]) -> Finding:
    """With the iterations that the rule asks for, and a step up to twice the default, pymunk follows free flight."""
    errors = np.concatenate([panel.by_the_rule for panel in panels]) if panels else np.array([])
    band = float(np.max([panel.band for panel in panels])) if panels else math.nan
    return Finding(
        id="engine-rule-of-iterations",
        title=f"pymunk with enough iterations and Δt ≤ {RULE_DT:g} s: largest error of ω(t) against free flight",
        # A NaN among them stays NaN, and fails.
        value=float(errors.max()) if len(errors) else None,
        unit="of ω₀",
        kind="regression",
        admissible=(0.0, GOOD),
        band=band,
        note=f"{len(errors)} runs; " + "; ".join(panel.words for panel in panels),
    )


def claim_default_iterations_explode(panels: Sequence[StabilityPanel]) -> Finding:
    """No run with pymunk's own number of iterations reaches the end of the flight, whatever its step."""
    grades = np.concatenate([panel.at_default for panel in panels]) if panels else np.array([])
    stopped = int((grades == "explodes").sum())
    return Finding(
        id="engine-default-explodes",
        title=f"pymunk with its default {DEFAULT_ITERATIONS} iterations: runs that do not explode",
        value=float(len(grades) - stopped) if len(grades) else None,
        unit="",
        kind="regression",
        admissible=(0.0, 0.0),
        note=f"of {len(grades)}, at every step of the chart; each is reported as diverged with its reason",
    )


def claim_whole_and_wrong(panels: Sequence[StabilityPanel]) -> Finding:
    """How many runs break no invariant and are wrong all the same: only a reference tells."""
    counts = {grade: sum(panel.counts[grade] for panel in panels) for grade in ("wrong", "good", "excellent")}
    errors = np.concatenate([panel.error[panel.grade == "wrong"] for panel in panels]) if panels else np.array([])
    return Finding(
        id="engine-whole-and-wrong",
        title=f"pymunk: runs that break no invariant and are wrong by more than {GOOD:.0%} of ω₀",
        value=float(counts["wrong"]),
        unit=f"of {sum(counts.values())}",
        kind="observation",
        note=f"by up to {100 * errors.max():.2g} % of ω₀; only a reference tells"
        if len(errors)
        else "none on this chart",
    )


def claim_engine_fact(fact: EngineFact) -> Finding:
    """Every engine does what the gallery says of it; a fact about one that is not installed is not evaluated."""
    return Finding(
        id=f"engine-fact-{fact.id}",
        title=fact.fact,
        value=fact.value,
        unit=fact.unit,
        kind="observation" if fact.absent else "regression",
        admissible=fact.admissible,
        note=fact.note,
    )


def claim_horizon(study: Horizon) -> Finding:
    """How wide the widest ensemble of a solver becomes, and from when on it is wider than the band."""
    widest = study.largest
    title = f"{study.solver}: largest width of ω among flights that should be one"
    if widest is None:
        return Finding(
            id=f"horizon-{study.solver}", title=title, value=None, unit="of ω₀", kind="observation",
            note="; ".join(study.problems),
        )  # fmt: skip
    when = "never left" if study.horizon is None else f"left from {study.horizon * 1e3:.1f} ms on"
    return Finding(
        id=f"horizon-{study.solver}",
        title=title,
        value=widest.largest,
        unit="of ω₀",
        kind="observation",
        note=f"band {widest.band:g} {when}; widest: {widest.words}",
    )


def claim_angle(study: Horizon) -> Finding:
    """Free flight does not feel the angle of release, and neither does a solver's omega(t)."""
    widest = max(study.of_kind("angle"), key=lambda ensemble: ensemble.largest, default=None)
    return Finding(
        id=f"horizon-angle-{study.solver}",
        title=f"{study.solver}: width of ω among flights with other angles of release",
        value=None if widest is None else widest.largest,
        unit="of ω₀",
        # An engine that is not installed has no ensemble at all and proves nothing, one that lacks this one fails.
        kind="regression" if study.ensembles else "observation",
        admissible=(0.0, ANGLE_BAND) if study.ensembles else (-math.inf, math.inf),
        note="; ".join(study.problems) if widest is None else f"widest: {widest.words}",
    )


def claim_order_of_bodies(study: Horizon) -> Finding | None:
    """How much the order of the bodies leaves open at the iterations of the rule; None for a solver without order."""
    widest = max(study.of_kind("order"), key=lambda ensemble: ensemble.largest, default=None)
    if widest is None:
        return None
    return Finding(
        id=f"horizon-order-{study.solver}",
        title=f"{study.solver}: width of ω among orders in which the bodies enter",
        value=widest.largest,
        unit="of ω₀",
        kind="observation",
        note=widest.words,
    )


def claim_certificate(tag: str, certificate: Mapping[str, Any]) -> Finding:
    """What an engine says of its own run: how far omega(t) may be off at the settings it was certified for."""
    settings, order = certificate["settings"], certificate["order"]
    words = [f"Δt = {settings['step']:.3g} s" if settings.get("step") else "no step was completed"]
    if settings.get("iterations") is not None:
        words.append(f"{settings['iterations']} iterations")
    hits = {"grid": "hits on the step's grid", "located": "hits located by us"}.get(settings.get("hits"))
    if hits is not None:
        words.append(hits)
    words.append(f"order {order:.2f}" if order is not None else f"no order: {certificate['order_reason']}")
    if certificate["reason"]:
        words.append(certificate["reason"])
    return Finding(
        id=f"certificate-{tag.replace(' ', '-')}",
        title=f"{tag}: {certificate['status']}, band of ω(t)",
        value=certificate["band"],
        unit="of ω₀",
        kind="observation",
        note="; ".join(words),
    )


def claim_agreement(agreement: Agreement) -> Finding:
    """Free flight by several solvers: the largest difference of a pair, and which solver differs from all others."""
    widest = max(agreement.pairs, key=lambda pair: pair.largest)
    return Finding(
        id="agreement",
        title=f"{', '.join(agreement.names)}: {agreement.words}",
        value=widest.largest,
        unit="of ω₀",
        kind="observation",
        band=widest.bands,
        note="; ".join(
            f"{p.first} and {p.second} {p.largest:.1e}, {100 * p.share:.0f} % within" for p in agreement.pairs
        )
        + f"; up to {1e3 * agreement.until:.0f} ms",
    )


def claim_full_bottle(run: Trajectory | None) -> Finding:
    """A full bottle whose slices exclude each other keeps its angular velocity: it is ice."""
    drift = None if run is None else float(np.abs(run.omega / run.scenario.omega0 - 1.0).max())
    return Finding(
        id="engine-full-bottle",
        title="full bottle, slices exclude each other: largest |ω/ω₀ − 1|",
        value=drift,
        unit="",
        kind="regression",
        admissible=(0.0, FULL_BOTTLE),
        note="" if run is None else f"N = {run.scenario.n_slices}, Δt = {run.settings['step']:.1g} s; falls with Δt",
    )


def claim_overlap(study: Overlap) -> Finding:
    """What a full bottle loses because its slices may share their place."""
    return Finding(
        id="overlap-full-bottle",
        title="full bottle: how far the plateau of ω/ω₀ lies below ice when slices overlap",
        value=study.missing_from_ice(PASS),
        unit="",
        kind="observation",
        note=f"{study.missing_from_ice(EXCLUDE):.2g} when they exclude each other, "
        f"{study.missing_from_ice(COLUMN):.2g} for a column; N = {study.slices}; the paper expects a full bottle to "
        "behave like ice",
    )
