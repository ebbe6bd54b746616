"""Up to when an engine's omega(t) means anything: ensembles of flights that should be one flight."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from flipproof.chapters.horizon.figure import figure_horizon
from flipproof.chapters.horizon.study import FULL, Horizon, Reach, plan_horizon, study_horizon
from flipproof.chapters.predictability.study import HORIZON_BAND
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Study
from flipproof.output.columns import curves_csv
from slicemodel.trajectory import FloatArray

ANGLE_BAND: Final = HORIZON_BAND / 1000
"""What another angle of release may do to omega, as a fraction of omega_0: what parts flights is then their own."""


def study(ask: Ask) -> Study[tuple[Horizon, ...]]:
    """Fly the ensembles of ``ask.work``."""
    flights = yield plan_horizon(ask.reference, ask.work)
    return study_horizon(ask.reference, ask.work, flights)


def claims(found: tuple[Horizon, ...]) -> Claims:
    """Yield the widest ensemble of every solver, of other angles, and of other orders."""
    for horizon in found:
        yield claim_horizon(horizon)
        yield claim_angle(horizon)
        order = claim_order_of_bodies(horizon)
        if order is not None:
            yield order


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


def figures(found: tuple[Horizon, ...]) -> Iterator[Exhibit]:
    """Yield the widths over time."""
    if any(study.ensembles for study in found):
        yield draw_horizon(found)


def draw_horizon(horizons: Sequence[Horizon]) -> Exhibit:
    """Return the widths of the ensembles over time."""
    words = " ".join(study.words for study in horizons).replace("ω₀", "omega_0").replace("θ₀", "theta_0")
    numbers = []
    for study in horizons:
        widest = study.largest
        if widest is None:
            numbers.append(f"{study.solver} was not run")
            continue
        when = "" if study.horizon is None else f", beyond the band first at {study.horizon * 1e3:.0f} ms"
        numbers.append(f"{study.solver} at most {widest.largest:.1g} of ω₀{when}")
    return Exhibit(
        name="horizon",
        title="Up to when an engine's ω(t) means anything",
        caption="Each curve is the width of an ensemble: how far the ω of flights that should be one flight come "
        "apart. Top: the flights differ in their arithmetic alone, by the angle of release, which free flight does not "
        "feel, or by the order in which bodies entered the engine. Bottom: their release differs. Where curves of "
        "different changes jump to one level, an impact happens in some of the flights and not in the others; "
        "differences in ω below that level mean nothing. "
        f"Widest ensemble: {'; '.join(numbers)}.",
        alt=f"Logarithmic plots of the width of ensembles over time. {words}",
        maker=figure_horizon,
        data=(horizons,),
        table=table_horizon(horizons),
    )


def table_horizon(studies: Sequence[Horizon]) -> str:
    """Width of every ensemble."""
    curves: dict[str, tuple[FloatArray, FloatArray]] = {}
    for study in studies:
        for ensemble in study.ensembles:
            curves[f"width of omega/omega_0 {study.solver}, {ensemble.what} [1]"] = (ensemble.t, ensemble.width)
    return curves_csv(curves)


CHAPTER: Final = Chapter(
    name="horizon",
    title="Up to when an engine's ω(t) means anything",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
    work={"quick": Reach(solvers=("pymunk", "free-flight"), sizes=(1e-6,), seeds=(1,), slices=6), "full": FULL},
)
