"""Which claims a report makes, and what happens to a claim whose evidence is missing."""

from __future__ import annotations

from collections.abc import Iterator

from reports import claims
from reports.evidence import ENGINE, LIMITS, MODELS, Evidence
from reports.findings import Finding
from reports.vectors import load_all


def evaluate(evidence: Evidence) -> Iterator[Finding]:
    """Yield every finding: the differences first, then the regression claims."""
    for difference in evidence.differences:
        yield claims.claim_difference(difference)
    yield from _vector_findings(evidence)
    yield from _ice_findings(evidence)
    yield from _order_findings(evidence)
    yield from _reference_findings(evidence)
    yield from _engine_findings(evidence)


def _vector_findings(evidence: Evidence) -> Iterator[Finding]:
    for vector in load_all():
        if vector.name in evidence.vectors:
            yield claims.claim_vectors(vector.name, vector.scheme, evidence.vectors[vector.name])
        else:
            yield _missing(evidence, f"vectors-{vector.name}", f"published run {vector.name}", f"vector {vector.name}")


def _ice_findings(evidence: Evidence) -> Iterator[Finding]:
    for ice in evidence.ice:
        yield claims.claim_ice(ice)
    for tag in (f"ice, {name}" for name in (*LIMITS, *MODELS, f"{ENGINE} rigid")):
        if evidence.trajectory(tag) is None:
            yield _missing(evidence, tag.replace(", ", "-").replace(" ", "-"), f"{tag} keeps ω constant", tag)
    runs = [made for tag, made in evidence.made.items() if tag.startswith(f"ice, {ENGINE} welded")]
    trajectories = [made.trajectory for made in runs if made.trajectory is not None]
    if len(trajectories) == len(runs):
        yield claims.claim_welded_order(
            [trajectory.settings["step"] for trajectory in trajectories],
            list(evidence.welded),
            trajectories[0].diagnostics["weld_order"],
        )
    else:
        yield _missing(evidence, "ice-welded-order", "drift of welded ice", *(made.run.tag for made in runs))


def _order_findings(evidence: Evidence) -> Iterator[Finding]:
    for scheme, model in LIMITS.items():
        for studies, where, admissible in (
            (evidence.starts_by_step, "before the first impact", claims.ORDER_BEFORE_IMPACT),
            (evidence.flights_by_step, "across impacts", claims.ORDER_ACROSS_IMPACTS),
        ):
            if scheme in studies:
                yield claims.claim_order(studies[scheme], where, admissible)
            else:
                title = f"{scheme} converges to {model}, {where}"
                yield _missing(evidence, f"order-{scheme}-{where.replace(' ', '-')}", title, scheme, model)


def _reference_findings(evidence: Evidence) -> Iterator[Finding]:
    for model in MODELS:
        usual, tight = evidence.trajectory(model), evidence.trajectory(f"{model}, tighter")
        if usual is None or tight is None:
            yield _missing(evidence, f"reference-{model}", f"{model} is converged", model, f"{model}, tighter")
        else:
            yield claims.claim_reference_converged(usual, tight)
        if evidence.size.second_method is None:
            continue
        tag = f"{model}, {evidence.size.second_method}"
        other = evidence.trajectory(tag)
        if usual is None or other is None:
            yield _missing(evidence, f"second-method-{model}", f"{model} by a second method", model, tag)
        else:
            yield claims.claim_second_method(usual, other)


def _engine_findings(evidence: Evidence) -> Iterator[Finding]:
    usual, without = evidence.trajectory(ENGINE), evidence.trajectory(f"{ENGINE}, no gravity")
    if usual is None or without is None:
        yield _missing(
            evidence, "engine-gravity", "free flight is the same with g = 0", ENGINE, f"{ENGINE}, no gravity"
        )
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
