"""What the work-precision diagrams say, in sentences with numbers. All are observations: no price is wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from flipproof.chapters.work_precision.study import Cost, Curve, WorkPrecision
from flipproof.frame.findings import Finding, observed
from slicemodel.scenario import shortened


def claim_work_precision(studies: Sequence[WorkPrecision]) -> Iterator[Finding]:
    """Yield what the throw through impacts says, and what impacts cost compared with the smooth one.

    The other throws stand in the tables.
    """
    by_name = {study.case.name: study for study in studies}
    for study in studies:
        yield from _order_of_midpoint(study)
    if "impacts" in by_name:
        study = by_name["impacts"]
        for pair in (("exact-step", "midpoint"), ("exact-step", "pymunk rotating"), ("pymunk", "mujoco")):
            first, second = map(study.named, pair)
            if first is not None and second is not None:
                yield _pair(study, first, second)
        for error in (1e-3, 1e-6):
            yield from _cheapest(study, "eq8", error)
        yield _floors(study)
        yield from _failures(study)
    yield from _price_of_impacts(by_name)


def _pair(study: WorkPrecision, first: Curve, second: Curve) -> Finding:
    """Compare two contenders of one equation at the smallest error that both keep."""
    one, other = first.contender.name, second.contender.name
    id_ = f"work-{one}-{other}".replace(" ", "-")
    title = f"steps of {one} for one of {other}, at equal error against {first.contender.equation}"
    for error in (10.0 ** (-k / 2) for k in range(22, 1, -1)):
        steps_a, steps_b = study.price(first, error, "steps"), study.price(second, error, "steps")
        if steps_a is not None and steps_b is not None:
            break
    else:
        return observed(id=id_, title=title, value=None, note="no error that both keep")
    if steps_a.bound and steps_b.bound:
        return observed(id=id_, title=title, value=None, note=f"the first levels of both keep {error:.1e} of ω₀")

    def against(cost: Cost, unit: str, scale: float = 1.0) -> str:
        prices = (study.price(curve, error, cost) for curve in (first, second))
        return " against ".join("–" if found is None else f"{scale * found.value:.2g}" for found in prices) + f" {unit}"

    limit = {(False, True): "at least, ", (True, False): "at most, "}.get((steps_a.bound, steps_b.bound), "")
    count_a, count_b = (f"{'at most ' if steps.bound else ''}{steps.value:.0f}" for steps in (steps_a, steps_b))
    note = f"error {error:.1e} of ω₀: {count_a} steps of {one}, {count_b} of {other}; "
    note += f"{against('work', 'updates of one slice')}, {against('seconds', 'ms of processor time', 1e3)}"
    return observed(id_, limit + title, steps_a.value / steps_b.value, note=note)


def _order_of_midpoint(study: WorkPrecision) -> Iterator[Finding]:
    curve = study.named("midpoint")
    if curve is not None:
        id_, title = f"work-order-midpoint-{study.case.name}", f"observed order in cost of midpoint, {study.case.title}"
        words = "order 2 where nothing strikes; v_CM jumps at an impact, and drag feels a mean of it for one whole step"
        order = None if math.isnan(curve.slope) else curve.slope
        yield observed(id_, title, order, note=curve.slope_reason or words, band=curve.slope_error)


def _cheapest(study: WorkPrecision, equation: str, error: float) -> Iterator[Finding]:
    """Name the cheapest of an equation at an error, by updates and by time."""
    if equation not in study.references:
        return

    def ranked(cost: Cost) -> list[tuple[float, str, str]]:
        prices = ((curve.contender.name, study.price(curve, error, cost)) for curve in study.of(equation))
        return sorted((found.value, name, found.limit) for name, found in prices if found is not None)

    def words(cost: Cost, unit: str) -> str:
        return ", ".join(f"{name} {limit}{value:.2g}{unit}" for value, name, limit in ranked(cost))

    work = ranked("work")
    keepers = {name for _, name, _ in work}
    others = [curve.contender.name for curve in study.of(equation) if curve.contender.name not in keepers]
    title = f"{equation} to {error:.0e} of ω₀: updates of the second cheapest over the cheapest"
    note = f"updates: {words('work', '')}; processor time: {words('seconds', ' s')}"
    note += f"; not reached by {', '.join(others)}" if others else ""
    ratio = work[1][0] / work[0][0] if len(work) > 1 else None
    yield observed(f"work-cheapest-{equation}-{error:.0e}", title, ratio, note=note)


def _floors(study: WorkPrecision) -> Finding:
    floors = {name: reference.floor for name, reference in study.references.items() if math.isfinite(reference.floor)}
    highest = max(floors, key=lambda name: floors[name])
    at = [curve.contender.name for curve in study.of(highest) if any(point.at_floor for point in curve.points)]
    others = ", ".join(f"{name} {floor:.0e}" for name, floor in floors.items() if name != highest)
    note = f"{highest}; at the floor: {', '.join(at) or 'none'}; others: {others}"
    title = "highest floor of a reference, below which no contender is ranked"
    return observed("work-floor", title, floors[highest], "of ω₀", note)


def _failures(study: WorkPrecision) -> Iterator[Finding]:
    failed = {key: curve.failed for key, curve in study.curves.items() if curve.failed}
    if failed:
        title = f"levels that failed, of {sum(len(curve.points) for curve in study.curves.values())}"
        note = "; ".join(
            f"{key}: {len(points)} of {len(study.curves[key].points)}, {shortened(points[0].reason, 90)}"
            for key, points in failed.items()
        )
        yield observed("work-failed", title, float(sum(map(len, failed.values()))), note=note)


def _price_of_impacts(studies: Mapping[str, WorkPrecision]) -> Iterator[Finding]:
    """Say what impacts cost a method: the same error, updates per second of flight, with and without."""
    if not {"smooth", "impacts"} <= set(studies):
        return
    for equation in ("eq8", "free-flight"):
        rates = []
        for study in (studies["smooth"], studies["impacts"]):
            curve = study.curves.get(f"DOP853 on {equation}")
            found = None if curve is None else study.price(curve, 3e-4)
            rates.append(None if found is None else found.value / study.case.scenario.duration)
        smooth, through = rates
        if smooth is not None and through is not None:
            title = f"{equation}: updates of DOP853 per second of flight, through impacts over before the first"
            note = f"error 3e-4 of ω₀; {smooth:.2g} updates per second before, {through:.2g} through all impacts"
            yield observed(f"work-impacts-{equation}", title, through / smooth, note=note)
