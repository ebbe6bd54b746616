"""What the work-precision diagrams say, in sentences with numbers. All are observations: no price is wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from flipproof.chapters.work_precision.study import Cost, Curve, Price, WorkPrecision, price
from flipproof.frame.findings import Finding
from slicemodel.scenario import shortened

ERRORS: Final = tuple(10.0 ** (-k / 2) for k in range(2, 23))
"""Errors at which two contenders are compared, the finest that both keep."""

LEVELS: Final = (1e-3, 1e-6)
"""Errors at which the cheapest of an equation is named."""

PAIRS: Final = (("exact-step", "midpoint"), ("exact-step", "pymunk rotating"), ("pymunk", "mujoco"))
"""Contenders of one equation whose steps are compared."""

METHOD: Final = "DOP853"
STRUCK: Final = ("eq8", "free-flight")
"""The method and the equations on which impacts are priced."""


MAIN: Final = "impacts"
"""The throw that is told in words; the others stand in the tables."""


def claim_work_precision(studies: Sequence[WorkPrecision]) -> Iterator[Finding]:
    """Yield what the throw through impacts says, and what impacts cost compared with the smooth one."""
    by_name = {study.case.name: study for study in studies}
    for study in studies:
        yield from _order_of_midpoint(study)
    if MAIN in by_name:
        study = by_name[MAIN]
        for one, other in PAIRS:
            yield from _pair(study, one, other)
        for error in LEVELS:
            yield from _cheapest(study, "eq8", error)
        yield _floors(study)
        yield from _failures(study)
    yield from _price_of_impacts(by_name)


def finest_common(study: WorkPrecision, first: Curve, second: Curve) -> tuple[float, Price, Price] | None:
    """Return the smallest error that both keep, with the price of each in steps; None if there is none."""
    reference = study.references[first.contender.equation]
    found = None
    for error in ERRORS:
        one, other = price(first, error, reference, "steps"), price(second, error, reference, "steps")
        if one is not None and other is not None:
            found = (error, one, other)
    return found


def _named(study: WorkPrecision, name: str) -> Curve | None:
    return next((curve for curve in study.curves.values() if curve.contender.name == name), None)


def _pair(study: WorkPrecision, one: str, other: str) -> Iterator[Finding]:
    """Compare two contenders of one equation at the smallest error that both keep."""
    first, second = _named(study, one), _named(study, other)
    if first is None or second is None:
        return
    id_ = f"work-{one}-{other}".replace(" ", "-")
    title = f"steps of {one} for one of {other}, at equal error against {first.contender.equation}"
    common = finest_common(study, first, second)
    if common is None or (common[1].bound and common[2].bound):
        why = "no error that both keep" if common is None else f"the first levels of both keep {common[0]:.1e} of ω₀"
        yield Finding(id=id_, title=title, value=None, unit="", kind="observation", note=why)
        return
    error, steps_a, steps_b = common
    limit = {(False, True): "at least, ", (True, False): "at most, "}.get((steps_a.bound, steps_b.bound), "")
    reference = study.references[first.contender.equation]

    def against(cost: Cost, unit: str, scale: float = 1.0) -> str:
        prices = (price(curve, error, reference, cost) for curve in (first, second))
        return " against ".join("–" if found is None else f"{scale * found.value:.2g}" for found in prices) + f" {unit}"

    yield Finding(
        id=id_,
        title=limit + title,
        value=steps_a.value / steps_b.value,
        unit="",
        kind="observation",
        note=f"error {error:.1e} of ω₀: {_count(steps_a)} steps of {one}, {_count(steps_b)} of {other}; "
        f"{against('work', 'updates of one slice')}, {against('seconds', 'ms of processor time', 1e3)}",
    )


def _count(found: Price) -> str:
    return f"{'at most ' if found.bound else ''}{found.value:.0f}"


def _order_of_midpoint(study: WorkPrecision) -> Iterator[Finding]:
    curve = _named(study, "midpoint")
    if curve is None:
        return
    yield Finding(
        id=f"work-order-midpoint-{study.case.name}",
        title=f"observed order in cost of midpoint, {study.case.title}",
        value=None if math.isnan(curve.slope) else curve.slope,
        unit="",
        kind="observation",
        band=curve.slope_error,
        note=curve.slope_reason
        or "order 2 where nothing strikes; v_CM jumps at an impact, and drag feels a mean of it for one whole step",
    )


def _cheapest(study: WorkPrecision, equation: str, error: float) -> Iterator[Finding]:
    """Name the cheapest of an equation at an error, by updates and by time."""
    reference = study.references.get(equation)
    if reference is None:
        return
    kinds: tuple[Cost, ...] = ("work", "seconds")
    ranked = {
        kind: sorted(
            (found.value, curve.contender.name, found.bound)
            for curve in study.of(equation)
            if (found := price(curve, error, reference, kind)) is not None
        )
        for kind in kinds
    }
    work = ranked["work"]
    ratio = work[1][0] / work[0][0] if len(work) > 1 else None

    def words(kind: Cost, unit: str) -> str:
        return ", ".join(f"{name} {'≤ ' if bound else ''}{value:.2g}{unit}" for value, name, bound in ranked[kind])

    keepers = {name for _, name, _ in work}
    others = [curve.contender.name for curve in study.of(equation) if curve.contender.name not in keepers]
    yield Finding(
        id=f"work-cheapest-{equation}-{error:.0e}",
        title=f"{equation} to {error:.0e} of ω₀: updates of the second cheapest over the cheapest",
        value=ratio,
        unit="",
        kind="observation",
        note=f"updates: {words('work', '')}; processor time: {words('seconds', ' s')}"
        + (f"; not reached by {', '.join(others)}" if others else ""),
    )


def _floors(study: WorkPrecision) -> Finding:
    floors = {name: reference.floor for name, reference in study.references.items() if math.isfinite(reference.floor)}
    highest = max(floors, key=lambda name: floors[name])
    at = [curve.contender.name for curve in study.of(highest) if any(point.at_floor for point in curve.points)]
    return Finding(
        id="work-floor",
        title="highest floor of a reference, below which no contender is ranked",
        value=floors[highest],
        unit="of ω₀",
        kind="observation",
        note=f"{highest}; at the floor: {', '.join(at) or 'none'}; others: "
        + ", ".join(f"{name} {floor:.0e}" for name, floor in floors.items() if name != highest),
    )


def _failures(study: WorkPrecision) -> Iterator[Finding]:
    failed = {curve.contender.key: curve.failed for curve in study.curves.values() if curve.failed}
    if not failed:
        return
    yield Finding(
        id="work-failed",
        title=f"levels that failed, of {sum(len(c.points) for c in study.curves.values())}",
        value=float(sum(len(points) for points in failed.values())),
        unit="",
        kind="observation",
        note="; ".join(
            f"{name}: {len(points)} of {len(study.curves[name].points)}, {shortened(points[0].reason, 90)}"
            for name, points in failed.items()
        ),
    )


def _price_of_impacts(studies: dict[str, WorkPrecision]) -> Iterator[Finding]:
    """Say what impacts cost a method: the same error, updates per second of flight, with and without."""
    names = ("smooth", "impacts")
    if not set(names) <= set(studies):
        return
    for equation in STRUCK:
        rates = []
        for name in names:
            study = studies[name]
            curve = study.curves.get(f"{METHOD} on {equation}")
            found = None if curve is None else price(curve, 3e-4, study.references[equation])
            rates.append(None if found is None else found.value / study.case.scenario.duration)
        smooth, through = rates
        if smooth is None or through is None:
            continue
        yield Finding(
            id=f"work-impacts-{equation}",
            title=f"{equation}: updates of {METHOD} per second of flight, through impacts over before the first",
            value=through / smooth,
            unit="",
            kind="observation",
            note=f"error 3e-4 of ω₀; {smooth:.2g} updates per second before, {through:.2g} through all impacts",
        )
