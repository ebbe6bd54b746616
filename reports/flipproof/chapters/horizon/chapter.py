"""Up to when an engine's omega(t) means anything: ensembles of flights that should be one flight."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from flipproof.chapters.horizon.figure import figure_horizon
from flipproof.chapters.horizon.study import Horizon, Reach, plan_horizon, study_horizon
from flipproof.chapters.predictability.study import HORIZON_BAND
from flipproof.frame.chapter import Ask, Chapter, Claims, Exhibit, Finding, Study, observed, regression
from flipproof.output.columns import curves_csv


def study(ask: Ask) -> Study[tuple[Horizon, ...]]:
    """Fly the ensembles of ``ask.work``."""
    plan = plan_horizon(ask.reference, ask.work)
    flights = yield [run for levels in plan.values() for level in levels for run in level.runs]
    return study_horizon(plan, flights)


def claims(found: tuple[Horizon, ...]) -> Claims:
    """Yield the widest ensemble of every solver, of other angles, and of other orders if the solver has an order."""
    for horizon in found:
        yield claim_horizon(horizon)
        yield claim_angle(horizon)
        order, title = horizon.widest("order"), f"{horizon.solver}: width of ω among orders in which the bodies enter"
        if order is not None:
            yield observed(f"horizon-order-{horizon.solver}", title, order.largest, "of ω₀", order.words)


def claim_horizon(study: Horizon) -> Finding:
    """How wide the widest ensemble of a solver becomes, and from when on it is wider than the band."""
    widest = study.widest()
    name, title = f"horizon-{study.solver}", f"{study.solver}: largest width of ω among flights that should be one"
    if widest is None:
        return observed(name, title, None, "of ω₀", "; ".join(study.problems))
    when = "never left" if study.horizon is None else f"left from {study.horizon * 1e3:.1f} ms on"
    return observed(name, title, widest.largest, "of ω₀", f"band {HORIZON_BAND:g} {when}; widest: {widest.words}")


def claim_angle(study: Horizon) -> Finding:
    """Free flight does not feel the angle of release, nor does a solver's omega(t), to a thousandth of the band.

    An engine that is not installed has no ensemble at all and proves nothing, one that lacks this one fails.
    """
    widest = study.widest("angle")
    name = f"horizon-angle-{study.solver}"
    title = f"{study.solver}: width of ω among flights with other angles of release"
    if not study.ensembles:
        return observed(name, title, None, "of ω₀", "; ".join(study.problems))
    value, note = (None, "; ".join(study.problems)) if widest is None else (widest.largest, f"widest: {widest.words}")
    return regression(name, title, value, "of ω₀", (0.0, HORIZON_BAND / 1000), note)


def figures(found: tuple[Horizon, ...]) -> Iterator[Exhibit]:
    """Yield the widths of the ensembles over time."""
    if not any(study.ensembles for study in found):
        return
    words = " ".join(study.words for study in found).replace("ω₀", "omega_0").replace("θ₀", "theta_0")
    numbers, curves = [], {}
    for study in found:
        widest = study.widest()
        if widest is None:
            numbers.append(f"{study.solver} was not run")
        else:
            when = "" if study.horizon is None else f", beyond the band first at {study.horizon * 1e3:.0f} ms"
            numbers.append(f"{study.solver} at most {widest.largest:.1g} of ω₀{when}")
        for e in study.ensembles:
            curves[f"width of omega/omega_0 {study.solver}, {e.what} [1]"] = e.t, e.width
    yield Exhibit(
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
        data=(found,),
        table=curves_csv(curves),
    )


CHAPTER: Final = Chapter(
    name="horizon",
    title="Up to when an engine's ω(t) means anything",
    study=study,
    claims=claims,
    kind="regression",
    figures=figures,
    work={"quick": Reach(solvers=("pymunk", "free-flight"), sizes=(1e-6,), seeds=(1,), slices=6), "full": Reach()},
)
