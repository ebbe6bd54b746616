"""The work-precision study as a report shows it: tables of every setting and result, and its data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple

from flipproof.chapters.work_precision.contenders import COMMON
from flipproof.chapters.work_precision.study import Cost, Curve, WorkPrecision, words_of


class Table(NamedTuple):
    """A table of words: ``rows`` have as many cells as there are ``columns``."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    note: str = ""


def tabulate_work_precision(studies: Sequence[WorkPrecision]) -> Iterator[Table]:
    """Yield results and settings of every throw, then who is absent and why."""
    absent: dict[str, str] = {}
    for study in studies:
        yield _results(study)
        yield _settings(study)
        yield _references(study)
        absent |= study.absent
    if studies:
        yield Table("work-absent", "Not competing", ("what", "why"), list(absent.items()))


def _results(study: WorkPrecision) -> Table:
    errors = (1e-2, 1e-3, 1e-4, 1e-6)

    def price(curve: Curve, error: float, cost: Cost) -> str:
        found = study.price(curve, error, cost)
        return "–" if found is None else f"{found.limit}{found.value:.2g}"

    rows = []
    for curve in study.curves.values():
        whole, failed = curve.whole, curve.failed
        first_last = f"{whole[0].error:.1e} to {whole[-1].error:.1e}" if whole else "–"
        order = f"{curve.slope:.2f} ± {curve.slope_error:.2f}"
        rows.append(
            (
                curve.contender.name,
                curve.contender.equation,
                first_last + (" (floor)" if any(point.at_floor for point in whole) else ""),
                f"{whole[-1].plateau:.1e}" if whole else "–",
                order if math.isfinite(curve.slope) else f"– ({curve.slope_reason})",
                *(price(curve, error, "work") for error in errors),
                price(curve, 1e-3, "seconds"),
                f"{len(failed)} of {len(curve.points)}: {failed[0].settings}: {failed[0].reason}" if failed else "",
            )
        )
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
        rows.append(
            (
                rival.name,
                rival.equation,
                f"{name} {first:.3g} to {levels[-1][-1][name]:.3g}",
                f"{len(levels)}" + (f" of {len(levels[0])} grids" if len(levels[0]) > 1 else ""),
                words_of(curve.held),
                counted[rival.family],
            )
        )
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
    for reference in study.references.values():
        floors = (
            f"{floor:.1e}" if math.isfinite(floor) else "–" for floor in (reference.floor, reference.plateau_floor)
        )
        rows.append(
            (reference.equation, *floors, reference.words + (f" ({reference.reason})" if reference.reason else ""))
        )
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
                    "name": curve.contender.name,
                    "family": curve.contender.family,
                    "equation": curve.contender.equation,
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
    def plain(value: Any) -> Any:
        if isinstance(value, float):
            return value if math.isfinite(value) else None
        return value if isinstance(value, (bool, int, str)) else str(value)

    return {name: plain(value) for name, value in values.items()}
