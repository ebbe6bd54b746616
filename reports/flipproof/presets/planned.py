"""Maps of validity and waterfalls made by a sweep: every run a row of one file, resumable, then figure and table.

::

    DIR/sweep.sqlite                     every run, one row each
    DIR/map-gamma.svg, .png, .csv        the figure of a map along that axis, and one row per cell
    DIR/waterfall-plateau.svg ...        as many files per observable of a waterfall, one row per bar

A study of a chapter plans runs and reads what became of them; who makes them, and whether the program died
in between, is not its business. Here the loop of a sweep makes them, each once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from flipproof.chapters.maps.chapter import exhibit
from flipproof.chapters.maps.study import (
    CURVE,
    RUNGS,
    Axis,
    Reading,
    ValidityMap,
    map_axes,
    plan_map,
    study_readings,
    word,
)
from flipproof.chapters.waterfall.chapter import figures
from flipproof.chapters.waterfall.study import PROGRAM, Waterfall, plan_waterfall, split_all
from flipproof.frame.solvers import Run
from flipproof.frame.store import Store
from flipproof.frame.twins import FLOOR
from flipproof.output.files import write_files
from flipproof.sweep.command import Begin, completed
from flipproof.sweep.errors import SweepError
from flipproof.sweep.loop import rows_of
from flipproof.sweep.work import FLIGHTS, Point, Row
from slicemodel import Scenario
from slicemodel.observables import toppling_angle

STEPS: Final = 1000
"""Points of a scheme's grid where a plan does not say another: the published program's."""


def completed_runs(
    runs: Sequence[Run], out: Path, begin: Begin, curves: int, names: Sequence[str], **how: Any
) -> AbstractContextManager[tuple[Store, str]]:
    """Return what ``completed`` gives for runs, the rows of which keep ``names`` of the curves at ``curves`` times."""
    return completed(lambda: points_of(runs, curves, names), len(runs), out, begin, **how)


def points_of(runs: Iterable[Run], curves: int, names: Sequence[str]) -> Iterator[Point]:
    """Yield the points that make runs."""
    options = {"curves": curves, "names": list(names)}
    return (Point(run.solver, run.scenario.to_mapping(), run.settings, FLIGHTS, options) for run in runs)


def read_runs(store: Store, runs: Sequence[Run], curves: int, names: Sequence[str]) -> dict[Run, Row]:
    """Return the row of every run; raise KeyError if the store lacks one."""
    rows = dict(zip(runs, rows_of(store, points_of(runs, curves, names)), strict=True))
    if missing := [run.name for run, row in rows.items() if row is None]:
        raise KeyError(missing[0])
    return {run: row for run, row in rows.items() if row is not None}


# ---------------------------------------------------------------------- the map of validity

READ_OFF: Final = ("omega",)
"""What of the curves of a run a map reads."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MapPlan:
    """The cells of a map: the throw that they vary, and the values of both axes."""

    throw: Scenario
    axis: Axis
    fills: tuple[float, ...]
    values: tuple[float, ...]

    @classmethod
    def of_size(cls, throw: Scenario, axis: Axis, columns: int, rows: int) -> MapPlan:
        """Return the map of that many cells over the whole of its axes."""
        fills, values = map_axes(axis, columns, rows)
        return cls(throw=throw, axis=axis, fills=fills, values=values)

    def runs(self) -> list[Run]:
        """Return every run; the output times are the solvers' own, so that a row repeats a run of the command line."""
        return plan_map(self.throw, self.axis, self.fills, self.values, banded=True, steps=STEPS, points=None)

    def study(self, rows: Mapping[Run, Row]) -> ValidityMap:
        """Return the map that the rows of its runs make."""
        readings = {run: _reading(row) for run, row in rows.items()}
        return study_readings(self.throw, self.axis, self.fills, self.values, readings, steps=STEPS, points=None)


def make_map(plan: MapPlan, out: Path, begin: Begin, **how: Any) -> str:
    """Make every run of the map that has no row in ``out``, as ``completed`` does, and draw it; return its lines."""
    runs = plan.runs()
    with completed_runs(runs, out, begin, CURVE, READ_OFF, **how) as (store, summary):
        study = plan.study(read_runs(store, runs, CURVE, READ_OFF))
        shown = exhibit(study)
        write_files(out, shown.files())
        shares = ", ".join(f"{name} {count}" for name, count in _dominating(study).items() if count)
        words = f"cells by largest fair share of omega/omega_0, mean of the second half, N = {study.slices}"
        small = f", too small or too near the next to tell {count}" if (count := _undecided(study)) else ""
        return f"{summary}\n{words}: {shares or 'none'}{small}; see {out / shown.name}.png"


def _dominating(study: ValidityMap) -> dict[str, int]:
    return {name: int((study.dominant == k).sum()) for k, name in enumerate(RUNGS)}


def _undecided(study: ValidityMap) -> int:
    return int((study.dominant < 0).sum() - study.missing.sum())


def _reading(row: Row) -> Reading:
    if row["status"] != "ok":
        return Reading(problem=word(row["reason"]) if row["status"] == "failed" else row["status"])
    return Reading(level=row["plateau"], omega=np.array(row["omega"]))


# ---------------------------------------------------------------------- the waterfall

ENDS: Final = 2
"""Points of a row's curves: release and landing. Only v_CM on landing is read there."""

LANDS_AT: Final = ("v_cm",)
"""What of the curves of a run a waterfall reads."""


def plan_split(throw: Scenario) -> list[Run]:
    """Return the runs of ``plan_waterfall``; the program keeps its slices, whose velocity on landing is split too."""
    runs = plan_waterfall(throw, STEPS)
    return [replace(r, settings={**r.settings, "store": "full"}) if r.solver == PROGRAM else r for r in runs]


def make_split(throw: Scenario, out: Path, begin: Begin, **how: Any) -> str:
    """Make every run of the waterfall that has no row in ``out``, as ``completed`` does, and draw it; return its table.

    A run that is not whole is refused: a split needs all.
    """
    runs = plan_split(throw)
    with completed_runs(runs, out, begin, ENDS, LANDS_AT, **how) as (store, summary):
        waterfalls = split_rows(read_runs(store, runs, ENDS, LANDS_AT))
        for waterfall in waterfalls:
            (shown,) = figures((waterfall,))
            write_files(out, replace(shown, name=f"waterfall-{waterfall.observable.name}").files())
        return f"{_table(waterfalls[0])}\n{summary}"


def split_rows(rows: Mapping[Run, Row]) -> tuple[Waterfall, ...]:
    """Split every observable of the rows of ``plan_split``; a run that is not whole is refused."""
    program = next(run for run in rows if run.solver == PROGRAM)
    return split_all(program, {run: _observed(run, row) for run, row in rows.items()})


def _observed(run: Run, row: Row) -> dict[str, float]:
    throw = run.scenario
    if row["status"] != "ok":
        raise SweepError(
            f"{run.name}: {row['status']}: {row['message'] or row['reason']}; a waterfall needs every run whole"
        )
    return {
        "plateau": row["plateau"],
        "omega": row["omega_end"] / throw.omega0,
        "theta": row["theta_end"],
        "toppling": float(toppling_angle(throw, row["r_cm_end"])),
        "v_cm": row["v_cm"][-1],
    }


def _table(waterfall: Waterfall) -> str:
    observable, space = waterfall.observable, 30 * " "
    lines = [
        f"{observable.words} [{observable.unit}], N = {waterfall.slices}: in the order shown, in reverse, mean of all "
        "orders with its band, below which a mean cannot be told from 0",
        f"  {waterfall.start:+8.4f}  {space}published program",
    ]
    for bar in waterfall.bars:
        band = f"+- {max(bar.average_band, FLOOR):.1g}"
        lines.append(f"  {bar.forward:+8.4f}  {bar.backward:+8.4f}  {bar.average:+8.4f} {band:9}  {bar.name}")
    lines += [
        f"  {waterfall.end:+8.4f}  {space}free flight (+- {max(waterfall.end_band, FLOOR):.1g})",
        f"  {waterfall.overlap:+8.4f}  {space}rods minus free flight: two models of the water, no share",
    ]
    return "\n".join(lines)
