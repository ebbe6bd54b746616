"""The work-precision study as a report shows it: tables of every setting and result, and its data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from flipproof.chapters.work_precision.contenders import COMMON
from flipproof.chapters.work_precision.study import Cost, Curve, WorkPrecision, price, words_of

ERRORS: Final = (1e-2, 1e-3, 1e-4, 1e-6)
COUNTED: Final = {
    "scheme": "steps × slices (× 2 where it predicts)",
    "method": "right-hand sides × slices",
    "engine": "steps × slices × iterations, or × 4 for RK4",
}
UNITS: Final[dict[Cost, str]] = {"work": "updates of one slice", "steps": "steps", "seconds": "processor time"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of words: ``rows`` have as many cells as there are ``columns``."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def as_text(self) -> str:
        """Return the table for a terminal, columns aligned."""
        widths = [max(map(len, column)) for column in zip(self.columns, *self.rows, strict=True)]
        lines = [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
            for row in (self.columns, *self.rows)
        ]
        return "\n".join((self.title, *lines, *([self.note] if self.note else [])))


# ---------------------------------------------------------------------- tables


def tabulate_work_precision(studies: Sequence[WorkPrecision]) -> Iterator[Table]:
    """Yield results and settings of every throw, then who is absent and why."""
    for study in studies:
        yield _results(study)
        yield _settings(study)
        yield _references(study)
    if not studies:
        return
    absent = {name: reason for study in studies for name, reason in study.absent.items()}
    yield Table(
        name="work-absent",
        title="Not competing",
        columns=("what", "why"),
        rows=tuple(absent.items()),
    )


def _results(study: WorkPrecision) -> Table:
    return Table(
        name=f"work-results-{study.case.name}",
        title=f"What an error costs: {study.case.title}",
        columns=(
            "contender", "equation", "error, first to last level", "of the plateau, last", "order in cost",
            *(f"updates for {error:.0e}" for error in ERRORS), "seconds for 1e-03", "failed",
        ),
        rows=tuple(_result(study, curve) for curve in study.curves.values()),
        note="Errors in fractions of omega_0; floor: not told apart from the reference. ≤: the coarsest level that was "
        "usable keeps it already. Processor time is that of the machine that made this report.",
    )  # fmt: skip


def _result(study: WorkPrecision, curve: Curve) -> tuple[str, ...]:
    whole, failed = curve.whole, curve.failed
    first_last = f"{whole[0].error:.1e} to {whole[-1].error:.1e}" if whole else "–"
    if any(point.at_floor for point in whole):
        first_last += " (floor)"
    order = (
        f"{curve.slope:.2f} ± {curve.slope_error:.2f}" if math.isfinite(curve.slope) else f"– ({curve.slope_reason})"
    )
    return (
        curve.contender.name,
        curve.contender.equation,
        first_last,
        f"{whole[-1].plateau:.1e}" if whole else "–",
        order,
        *(_price(study, curve, error, "work") for error in ERRORS),
        _price(study, curve, 1e-3, "seconds"),
        f"{len(failed)} of {len(curve.points)}: {failed[0].settings}: {failed[0].reason}" if failed else "",
    )


def _price(study: WorkPrecision, curve: Curve, error: float, cost: Cost) -> str:
    found = price(curve, error, study.references[curve.contender.equation], cost)
    if found is None:
        return "–"
    return f"{'≤ ' if found.bound else ''}{found.value:.2g}"


def _settings(study: WorkPrecision) -> Table:
    return Table(
        name=f"work-settings-{study.case.name}",
        title=f"Settings: {study.case.title}",
        columns=("contender", "equation", "refined", "levels", "held", "an update is"),
        rows=tuple(
            (
                curve.contender.name,
                curve.contender.equation,
                curve.contender.refined,
                _levels(curve),
                words_of(curve.held),
                COUNTED[curve.contender.family],
            )
            for curve in study.curves.values()
        ),
        note=f"{study.case.scenario.n_slices} slices; errors at {COMMON + 1} times that all grids share. A method's "
        "absolute tolerance is a thousandth of its relative one.",
    )


def _levels(curve: Curve) -> str:
    levels = curve.contender.levels
    return f"{len(levels)}" + (f" of {len(levels[0])} grids" if len(levels[0]) > 1 else "")


def _references(study: WorkPrecision) -> Table:
    return Table(
        name=f"work-references-{study.case.name}",
        title=f"References: {study.case.title}",
        columns=("equation", "floor of ω", "floor of the plateau", "reference; its witnesses"),
        rows=tuple(
            (
                name,
                f"{reference.floor:.1e}" if math.isfinite(reference.floor) else "–",
                f"{reference.plateau_floor:.1e}" if math.isfinite(reference.floor) else "–",
                reference.words + (f" ({reference.reason})" if reference.reason else ""),
            )
            for name, reference in study.references.items()
        ),
        note="The floor is the largest difference between the reference and a witness, and never less than 1e-13.",
    )


# ---------------------------------------------------------------------- data


def summarise_work_precision(studies: Sequence[WorkPrecision]) -> dict[str, Any]:
    """Return every number of the diagrams as JSON-ready data; what is not finite becomes null."""
    return {
        study.case.name: {
            "title": study.case.title,
            "scenario": study.case.scenario.to_mapping(),
            "references": {name: _plain(asdict(reference)) for name, reference in study.references.items()},
            "contenders": {key: _curve_mapping(curve) for key, curve in study.curves.items()},
            "absent": dict(study.absent),
        }
        for study in studies
    }


def _curve_mapping(curve: Curve) -> dict[str, Any]:
    return {
        "name": curve.contender.name,
        "family": curve.contender.family,
        "equation": curve.contender.equation,
        "held": _plain(dict(curve.held)),
        **_plain({"slope": curve.slope, "slope_error": curve.slope_error, "slope_reason": curve.slope_reason}),
        "points": [_plain(asdict(point)) for point in curve.points],
    }


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    plain: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, float):
            plain[name] = value if math.isfinite(value) else None
        else:
            plain[name] = value if isinstance(value, (bool, int, str)) else str(value)
    return plain
