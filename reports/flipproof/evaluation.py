"""Which claims a report makes, and what happens to a claim whose evidence is missing."""

from __future__ import annotations

from collections.abc import Iterator

from flipproof import claims, claims_engines
from flipproof.chapters.guests.claims import claim_guests
from flipproof.claims_work_precision import claim_work_precision
from flipproof.evidence import CHECK, CROSS_CHECKED, ENGINE, ICED, LIMITS, WITNESS, Evidence
from flipproof.frame.findings import Finding
from flipproof.vectors import load_all
from ode_reference.models import LADDER


def evaluate(evidence: Evidence) -> Iterator[Finding]:
    """Yield every finding: the differences first, then the regression claims."""
    for difference in evidence.differences:
        yield claims.claim_difference(difference)
    yield from _vector_findings(evidence)
    yield from _ice_findings(evidence)
    yield from _order_findings(evidence)
    for cost in evidence.finite_step:
        yield claims.claim_finite_step(cost)
    yield from _reference_findings(evidence)
    yield from _engine_findings(evidence)
    yield from _instrument_findings(evidence)
    yield from _attribution_findings(evidence)
    yield from claim_work_precision(evidence.precision)
    yield from claim_guests(evidence.guests)


def _instrument_findings(evidence: Evidence) -> Iterator[Finding]:
    found = evidence.instruments
    for tag, certificate in found.certificates.items():
        yield claims_engines.claim_certificate(tag, certificate)
    if found.agreement is not None:
        yield claims_engines.claim_agreement(found.agreement)
    yield claims_engines.claim_rule_of_iterations(found.panels)
    yield claims_engines.claim_default_iterations_explode(found.panels)
    yield claims_engines.claim_whole_and_wrong(found.panels)
    for fact in found.facts:
        yield claims_engines.claim_engine_fact(fact)
    for horizon in found.horizons:
        yield claims_engines.claim_horizon(horizon)
        yield claims_engines.claim_angle(horizon)
        order = claims_engines.claim_order_of_bodies(horizon)
        if order is not None:
            yield order
    yield claims_engines.claim_full_bottle(found.full_bottle)
    if found.overlap is not None:
        yield claims_engines.claim_overlap(found.overlap)


def _attribution_findings(evidence: Evidence) -> Iterator[Finding]:
    found = evidence.attribution
    for waterfall in found.waterfalls:
        yield claims.claim_waterfall(waterfall)
    for model, digits in found.digits.items():
        yield claims.claim_exact_cases(model, digits)
    for scheme, limit in found.limits.items():
        yield claims.claim_limit(scheme, limit)
    for pair, tube in found.tubes.items():
        yield claims.claim_tube(*pair, tube)
    for pair, forms in found.forms.items():
        yield claims.claim_model_form(*pair, forms["omega"])
    for solver, study in found.predictability.items():
        yield claims.claim_predictability(solver, study)
    for erratum in found.errata:
        yield claims.claim_erratum(erratum)


def _vector_findings(evidence: Evidence) -> Iterator[Finding]:
    for vector in load_all():
        if vector.name in evidence.vectors:
            yield claims.claim_vectors(vector.name, vector.scheme, evidence.vectors[vector.name])
        else:
            yield _missing(evidence, f"vectors-{vector.name}", f"published run {vector.name}", f"vector {vector.name}")


def _ice_findings(evidence: Evidence) -> Iterator[Finding]:
    for ice in evidence.ice:
        yield claims.claim_ice(ice)
    for tag in (f"ice, {name}" for name in (*LIMITS, *ICED, f"{ENGINE} rigid")):
        if evidence.trajectory(tag) is None:
            yield _missing(evidence, tag.replace(", ", "-").replace(" ", "-"), f"{tag} keeps ω constant", tag)
    runs = [made for tag, made in evidence.made.items() if tag.startswith(f"ice, {ENGINE} welded")]
    trajectories = [made.trajectory for made in runs if made.trajectory is not None]
    if len(trajectories) == len(runs):
        yield claims.claim_welded_order(evidence.welded, trajectories[0].diagnostics["weld_order"])
    else:
        yield _missing(evidence, "ice-welded-order", "drift of welded ice", *(made.run.tag for made in runs))


def _order_findings(evidence: Evidence) -> Iterator[Finding]:
    for scheme, model in LIMITS.items():
        for studies, where in (
            (evidence.check_starts, "before the first impact"),
            (evidence.check_flights, "across impacts"),
        ):
            if scheme in studies:
                yield claims.claim_order(studies[scheme], where)
            else:
                title = f"{scheme} converges to {model}, {where}"
                tags = (f"{CHECK}, {model}", scheme)
                yield _missing(evidence, f"order-{scheme}-{where.replace(' ', '-')}", title, *tags)
        for studies, where in (
            (evidence.starts_by_step, "before the first impact of this throw"),
            (evidence.flights_by_step, "across the impacts of this throw"),
        ):
            if scheme in studies:
                yield claims.claim_order(studies[scheme], where, kind="observation")


def _reference_findings(evidence: Evidence) -> Iterator[Finding]:
    for model in LADDER:
        tag = f"{CHECK}, {model}"
        usual, witness = evidence.trajectory(tag), evidence.trajectory(f"{tag}, {WITNESS}")
        if usual is None or witness is None:
            yield _missing(evidence, f"reference-{model}", f"{model} is converged", tag, f"{tag}, {WITNESS}")
        else:
            yield claims.claim_reference_converged(usual, witness)
        ledger = evidence.trajectory(f"{CHECK}, ledger, {model}")
        if ledger is None:
            yield _missing(
                evidence, f"energy-{model}", f"{model}: the energy ledger closes", f"{CHECK}, ledger, {model}"
            )
        else:
            yield claims.claim_energy(ledger)
        if evidence.size.second_method is None or model not in CROSS_CHECKED:
            continue
        other_tag = f"{tag}, {evidence.size.second_method}"
        other = evidence.trajectory(other_tag)
        if usual is None or other is None:
            yield _missing(evidence, f"second-method-{model}", f"{model} by a second method", tag, other_tag)
        else:
            yield claims.claim_second_method(usual, other)


def _engine_findings(evidence: Evidence) -> Iterator[Finding]:
    tags = (f"{CHECK}, {ENGINE}", f"{CHECK}, {ENGINE}, no gravity")
    usual, without = (evidence.trajectory(tag) for tag in tags)
    if usual is None or without is None:
        yield _missing(evidence, "engine-gravity", f"{ENGINE}: free flight is the same with g = 0", *tags)
    else:
        yield claims.claim_gravity_cancels(usual, without)
    explosion = evidence.trajectory(f"{ENGINE}, 10 iterations")
    if explosion is not None:
        yield claims.claim_explosion_is_reported(explosion)


def _missing(evidence: Evidence, id_: str, title: str, *tags: str) -> Finding:
    reasons = [
        f"{tag}: {evidence.made[tag].reason}" for tag in tags if tag in evidence.made and evidence.made[tag].reason
    ]
    return claims.not_evaluated(id_, title, "; ".join(reasons) or "the evidence is missing")
