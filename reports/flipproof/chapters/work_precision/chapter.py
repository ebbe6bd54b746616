"""What a digit costs: error against cost, every contender against its own equation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final, Literal, NamedTuple

from flipproof.chapters.work_precision.contenders import CASES, COMMON, FULL
from flipproof.chapters.work_precision.figure import figure_work_precision
from flipproof.chapters.work_precision.study import (
    Cost,
    Curve,
    Price,
    WorkPrecision,
    plan_work_precision,
    study_work_precision,
    words_of,
)
from flipproof.frame.chapter import Ask, Call, Chapter, Exhibit, Finding, Study, observed
from flipproof.frame.findings import finite_or_none
from flipproof.frame.timing import batches, make_timed
from flipproof.output.columns import rows_csv
from slicemodel.scenario import shortened


def study(ask: Ask) -> Study[tuple[WorkPrecision, ...]]:
    """Have workers time the runs of every throw of the effort ``ask.work``, those of one solver together."""
    cases = [CASES[name] for name in ask.work.cases]
    jobs = batches([(run, case.times) for case in cases for run in plan_work_precision(case, ask.work)])
    calls = [Call(make_timed, (job,), f"work, {job[0][0].solver}", timed=True) for job in jobs]
    # After the other runs, so that the compiled loop is there and its compiling is not counted.
    yield ()
    flights = yield calls
    made = {each.run: each for call in calls for each in flights.answer(call)}
    return tuple(study_work_precision(case, ask.work, made) for case in cases)


def claim_work_precision(studies: Sequence[WorkPrecision]) -> Iterator[Finding]:
    """Yield what the throw through impacts says, and what impacts cost compared with the smooth one.

    The other throws stand in the tables.
    """
    by_name = {study.case.name: study for study in studies}
    for study in studies:
        curve = study.curves["midpoint on eq8"]
        title = f"observed order in cost of midpoint, {study.case.title}"
        words = "order 2 where nothing strikes; v_CM jumps at an impact, and drag feels a mean of it for one whole step"
        order = None if math.isnan(curve.slope) else curve.slope
        note = curve.slope_reason or words
        yield observed(f"work-order-midpoint-{study.case.name}", title, order, note=note, band=curve.slope_error)
    if "impacts" in by_name:
        study = by_name["impacts"]
        yield _pair(study, "exact-step on eq8", "midpoint on eq8")
        yield _pair(study, "pymunk on free-flight", "mujoco on free-flight")
        yield _cheapest(study, 1e-3)
        yield _cheapest(study, 1e-6)
        yield _floors(study)
        yield from _failures(study)
        if "smooth" in by_name:
            yield from _price_of_impacts(by_name["smooth"], study)


def _pair(study: WorkPrecision, first_key: str, second_key: str) -> Finding:
    """Compare two contenders of one equation at the smallest error that both keep."""
    first, second = study.curves[first_key], study.curves[second_key]
    one, other = first.contender.name, second.contender.name
    id_ = f"work-{one}-{other}".replace(" ", "-")
    title = f"steps of {one} for one of {other}, at equal error against {first.contender.equation}"
    for error in (10.0 ** (-k / 2) for k in range(22, 1, -1)):
        steps_a, steps_b = first.price(error, "steps"), second.price(error, "steps")
        if steps_a is not None and steps_b is not None:
            break
    else:
        return observed(id=id_, title=title, value=None, note="no error that both keep")
    if steps_a.bound and steps_b.bound:
        return observed(id=id_, title=title, value=None, note=f"the first levels of both keep {error:.1e} of ω₀")

    def against(cost: Cost, unit: str, scale: float = 1.0) -> str:
        prices = (curve.price(error, cost) for curve in (first, second))
        return " against ".join("–" if found is None else f"{scale * found.value:.2g}" for found in prices) + f" {unit}"

    limit = {(False, True): "at least, ", (True, False): "at most, "}.get((steps_a.bound, steps_b.bound), "")
    count_a, count_b = (f"{'at most ' if steps.bound else ''}{steps.value:.0f}" for steps in (steps_a, steps_b))
    note = f"error {error:.1e} of ω₀: {count_a} steps of {one}, {count_b} of {other}; "
    note += f"{against('work', 'updates of one slice')}, {against('seconds', 'ms of processor time', 1e3)}"
    return observed(id_, limit + title, steps_a.value / steps_b.value, note=note)


def _cheapest(study: WorkPrecision, error: float) -> Finding:
    """Name the cheapest that solves Eq. 8 to an error, by updates and by time."""
    curves = study.of("eq8")

    def ranked(cost: Cost) -> list[tuple[Price, str]]:
        prices = ((curve.price(error, cost), curve.contender.name) for curve in curves)
        return sorted((price, name) for price, name in prices if price is not None)

    def words(cost: Cost, unit: str) -> str:
        return ", ".join(f"{name} {price.text}{unit}" for price, name in ranked(cost))

    work = ranked("work")
    keepers = {name for _, name in work}
    others = [curve.contender.name for curve in curves if curve.contender.name not in keepers]
    title = f"eq8 to {error:.0e} of ω₀: updates of the second cheapest over the cheapest"
    note = f"updates: {words('work', '')}; processor time: {words('seconds', ' s')}"
    note += f"; not reached by {', '.join(others)}" if others else ""
    ratio = work[1][0].value / work[0][0].value if len(work) > 1 else None
    return observed(f"work-cheapest-eq8-{error:.0e}", title, ratio, note=note)


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


def _price_of_impacts(smooth: WorkPrecision, through: WorkPrecision) -> Iterator[Finding]:
    """Say what impacts cost a method: updates per second of flight to one error, before the first and through all."""
    for equation in ("eq8", "free-flight"):
        studies = smooth, through
        prices = [study.curves[f"DOP853 on {equation}"].price(3e-4) for study in studies]
        rates = [p.value / study.case.scenario.duration for p, study in zip(prices, studies, strict=True) if p]
        if len(rates) == 2:
            title = f"{equation}: updates of DOP853 per second of flight, through impacts over before the first"
            note = f"error 3e-4 of ω₀; {rates[0]:.2g} updates per second before, {rates[1]:.2g} through all impacts"
            yield observed(f"work-impacts-{equation}", title, rates[1] / rates[0], note=note)


def figures(studies: Sequence[WorkPrecision]) -> Iterator[Exhibit]:
    """Yield a figure for each throw over updates; if there are several, one of them over processor time as well."""
    for study in studies:
        yield _exhibit(study, "work")
    if len(studies) > 1:
        # Through impacts: there methods differ by what an event costs them.
        yield _exhibit(next(study for study in studies if study.case.name == "impacts"), "seconds")


def _exhibit(study: WorkPrecision, cost: Literal["work", "seconds"]) -> Exhibit:
    timed = cost == "seconds"

    def reached(curve: Curve) -> str:
        """Return error and cost of a contender's first and last level, or why there is none."""
        if not curve.whole:
            return f"{curve.contender.key}: {curve.failed[0].reason.partition(':')[0]}"
        levels = (curve.whole[0], curve.whole[-1])
        words = (f"{level.error:.1e} for {level.cost(cost):.1e}{' s' if timed else ''}" for level in levels)
        return f"{curve.contender.key}: {' to '.join(words)}"

    levels = "; ".join(map(reached, study.curves.values()))
    floors = ", ".join(f"{r.equation} {r.floor:.1e}" for r in study.references.values() if math.isfinite(r.floor))
    return Exhibit(
        name=f"work-precision-{study.case.name}{'-time' if timed else ''}",
        title=f"What a digit costs: {study.case.title}{', in processor time' if timed else ''}",
        caption="Farther left is cheaper, farther down is better; p is the order in cost. Each panel holds one "
        "equation and those who solve it, so that what lies between equations does not enter. In the grey nothing is "
        "claimed: there the reference itself is uncertain. A cross at the top edge is a run that failed; the table "
        "says why. "
        + (
            "Schemes and engines run in compiled code, methods in Python: this is the price of a program."
            if timed
            else "An update of one slice is counted the same on every machine, but is not the same work to everyone."
        ),
        alt=f"Log-log plots of error, of omega_0, against {'processor time' if timed else 'updates of one slice'}. "
        f"From the first level to the last: {levels}. Floors: {floors}.",
        maker=figure_work_precision,
        data=(study, cost),
        table=_levels_csv(study),
    )


def _levels_csv(study: WorkPrecision) -> str:
    """Return every level of every contender, with its price and its error."""
    return rows_csv(
        ("contender", "equation", "level", "updates of one slice [1]", "steps [1]", "processor time [s]",
         "error of omega [of omega_0]", "least error [of omega_0]", "largest error [of omega_0]",
         "error of the plateau [of omega_0]", "floor of the reference [of omega_0]", "at the floor",
         "failed because"),
        (
            (curve.contender.name, curve.contender.equation, point.settings, point.work, point.steps, point.seconds,
             point.error, point.lowest, point.highest, point.plateau,
             curve.reference.floor, point.at_floor, point.reason)
            for curve in study.curves.values()
            for point in curve.points
        ),
    )  # fmt: skip


class Table(NamedTuple):
    """A table of words: ``rows`` have as many cells as there are ``columns``."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    note: str = ""


def tabulate_work_precision(studies: Sequence[WorkPrecision]) -> Iterator[Table]:
    """Yield results and settings of every throw, then who is absent and why."""
    for study in studies:
        yield _results(study)
        yield _settings(study)
        yield _references(study)
    # The same of every throw.
    yield Table("work-absent", "Not competing", ("what", "why"), list(studies[0].absent.items()))


def _results(study: WorkPrecision) -> Table:
    errors = (1e-2, 1e-3, 1e-4, 1e-6)

    rows = []
    for curve in study.curves.values():
        who, whole, failed = (curve.contender.name, curve.contender.equation), curve.whole, curve.failed
        reached = f"{whole[0].error:.1e} to {whole[-1].error:.1e}" if whole else "–"
        reached += " (floor)" if any(point.at_floor for point in whole) else ""
        flat = f"{whole[-1].plateau:.1e}" if whole else "–"
        slope = f"{curve.slope:.2f} ± {curve.slope_error:.2f}"
        order = slope if math.isfinite(curve.slope) else f"– ({curve.slope_reason})"
        prices = [*(curve.price(error) for error in errors), curve.price(1e-3, "seconds")]
        why = f"{len(failed)} of {len(curve.points)}: {failed[0].settings}: {failed[0].reason}" if failed else ""
        rows.append((*who, reached, flat, order, *(price.text if price else "–" for price in prices), why))
    return Table(
        f"work-results-{study.case.name}",
        f"What an error costs: {study.case.title}",
        (
            "contender", "equation", "error, first to last level", "of the plateau, last", "order in cost",
            *(f"updates for {error:.0e}" for error in errors), "seconds for 1e-03", "failed",
        ),
        rows,
        "Errors in fractions of omega_0; floor: not told apart from the reference. ≤: the coarsest level that was "
        "usable keeps it already. Processor time is that of the machine that made this report.",
    )  # fmt: skip


def _settings(study: WorkPrecision) -> Table:
    counted = {
        "scheme": "steps × slices (× 2 where it predicts)",
        "method": "right-hand sides × slices",
        "engine": "steps × slices × iterations, or × 4 for RK4",
    }
    rows = []
    for curve in study.curves.values():
        rival, levels = curve.contender, curve.contender.levels
        name, first = next(iter(levels[0][0].items()))
        refined = f"{name} {first:.3g} to {levels[-1][-1][name]:.3g}"
        count = f"{len(levels)}" + (f" of {len(levels[0])} grids" if len(levels[0]) > 1 else "")
        rows.append((rival.name, rival.equation, refined, count, words_of(curve.held), counted[rival.family]))
    return Table(
        f"work-settings-{study.case.name}",
        f"Settings: {study.case.title}",
        ("contender", "equation", "refined", "levels", "held", "an update is"),
        rows,
        f"{study.case.scenario.n_slices} slices; errors at {COMMON + 1} times that all grids share. A method's "
        "absolute tolerance is a thousandth of its relative one.",
    )


def _references(study: WorkPrecision) -> Table:
    rows = []
    for one in study.references.values():
        floors = (f"{floor:.1e}" if math.isfinite(floor) else "–" for floor in (one.floor, one.plateau_floor))
        rows.append((one.equation, *floors, one.words + (f" ({one.reason})" if one.reason else "")))
    return Table(
        f"work-references-{study.case.name}",
        f"References: {study.case.title}",
        ("equation", "floor of ω", "floor of the plateau", "reference; its witnesses"),
        rows,
        "The floor is the largest difference between the reference and a witness, and never less than 1e-13.",
    )


def summarise_work_precision(studies: Sequence[WorkPrecision]) -> dict[str, Any]:
    """Return every number of the diagrams as JSON-ready data; what is not finite becomes null."""
    return {
        study.case.name: {
            "title": study.case.title,
            "scenario": study.case.scenario.to_mapping(),
            "references": {name: _plain(asdict(reference)) for name, reference in study.references.items()},
            "contenders": {
                key: {
                    **{name: getattr(curve.contender, name) for name in ("name", "family", "equation")},
                    "held": _plain(curve.held),
                    **_plain({name: getattr(curve, name) for name in ("slope", "slope_error", "slope_reason")}),
                    "points": [_plain(asdict(point)) for point in curve.points],
                }
                for key, curve in study.curves.items()
            },
            "absent": dict(study.absent),
        }
        for study in studies
    }


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    finite = {name: finite_or_none(value) if isinstance(value, float) else value for name, value in values.items()}
    known = (bool, int, float, str, type(None))
    return {name: value if isinstance(value, known) else str(value) for name, value in finite.items()}


CHAPTER: Final = Chapter(
    name="work-precision",
    title="What a digit costs",
    study=study,
    claims=claim_work_precision,
    figures=figures,
    work={"full": FULL},
    summary=lambda found: {"work_precision": summarise_work_precision(found)},
    page=lambda found: {"tables": list(tabulate_work_precision(found))},
)
