"""Maps of validity and waterfalls made by a sweep: every run a row of one file, resumable, then figure and table.

::

    DIR/sweep.sqlite                     every run, one row each
    DIR/map.svg, DIR/map.png             the figure of a map
    DIR/map.csv                          one row per cell: plateaus, differences, fair shares, reasons
    DIR/map.json                         contours as lines, and how often each assumption has the largest fair share
    DIR/waterfall-plateau.svg, .png ...  one figure per observable of a waterfall
    DIR/waterfall.csv                    one row per observable and bar

A study of a chapter plans runs and reads what became of them; who makes them, and whether the program died
in between, is not its business. Here a sweep makes them. A run finds its row by what was computed, solver, scenario
and settings to the last bit: a design that misses a run of its plan cannot go unnoticed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from flipproof.chapters.maps.chapter import CONTOURS, contour_lines, errors, figure_map
from flipproof.chapters.maps.study import (
    CURVE,
    EXTRA,
    LADDER,
    RUNGS,
    Axis,
    Reading,
    ValidityMap,
    map_axes,
    plan_map,
    study_readings,
    word,
)
from flipproof.chapters.solvers import SCHEMES
from flipproof.chapters.waterfall.chapter import figure_waterfall
from flipproof.chapters.waterfall.study import PROGRAM, Waterfall, plan_waterfall, split_all
from flipproof.figures.style import draw
from flipproof.frame.solvers import Run
from flipproof.output.columns import rows_csv
from flipproof.sweep.axes import DAMPING, FILL, Value
from flipproof.sweep.command import Begin, fill
from flipproof.sweep.design import Design, design_of
from flipproof.sweep.entries import as_json
from flipproof.sweep.errors import SweepError
from flipproof.sweep.files import write_whole
from flipproof.sweep.store import Store, read_curves
from flipproof.sweep.work import CURVES, Outcome
from slicemodel import Scenario
from slicemodel.observables import toppling_angle

COLUMNS: Final = ("status", "message", "reason", "plateau", "omega_end", "theta_end", "r_cm_end", "curves")

STEPS: Final = 1000
"""Points of a scheme's grid where a plan does not say another: the published program's."""


def design_of_runs(runs: Sequence[Run], varied: Mapping[str, Sequence[Value]], curves: int, source: str) -> Design:
    """Return the grid over ``varied`` that makes all ``runs``, every one keeping ``curves`` points of its curves.

    Parameters
    ----------
    varied : mapping from field to values - how the scenarios of the runs differ; one value alone sets a field
    source : str - where the plan comes from, as the store and error messages name it
    """
    entries = {(run.solver, as_json(run.settings)): {"name": run.solver, **run.settings} for run in runs}
    sweep = {"design": "grid", "curves": curves, "fields": {name: list(values) for name, values in varied.items()}}
    document = {**runs[0].scenario.to_mapping(), "sweep": sweep, "solvers": list(entries.values())}
    return design_of(document, source, f"# {source}\n")


def read_runs(store: Store, runs: Sequence[Run]) -> dict[Run, Outcome]:
    """Return what became of every run; raise KeyError if the store's design does not make one."""
    points = (store.design.point(number) for number in range(store.design.size))
    numbers = {(point.solver, point.scenario(), as_json(point.settings)): point.number for point in points}
    rows = {}
    for number, *cells, curves in store.connection.execute(f"SELECT number, {', '.join(COLUMNS)} FROM points"):
        known = dict(zip(COLUMNS[:-1], cells, strict=True))
        rows[number] = Outcome(number=number, **known, curves=read_curves(curves) if curves else None)
    return {run: rows[numbers[run.solver, run.scenario, as_json(run.settings)]] for run in runs}


def _draw(figure: Figure, out: Path, name: str) -> None:
    drawing = draw(figure)
    write_whole(out / f"{name}.svg", drawing.svg.encode())
    write_whole(out / f"{name}.png", drawing.png)


# ---------------------------------------------------------------------- the map of validity

NAMES: Final = (*LADDER, *EXTRA)
VALUES: Final[Mapping[Axis, str]] = {"gamma": "gamma/omega0", "step": "omega0*dt", "restitution": "restitution"}


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
        return plan_map(self.throw, self.axis, self.fills, self.values, steps=STEPS, points=None)

    def varied(self) -> dict[str, Sequence[Value]]:
        """Return the fields of a scenario that the cells vary."""
        if self.axis == "gamma":
            return {DAMPING: [value * abs(self.throw.omega0) for value in self.values], FILL: self.fills}
        restitution = {"restitution": self.values} if self.axis == "restitution" else {}
        return {**restitution, DAMPING: [self.throw.damping_rate], FILL: self.fills}

    def study(self, rows: Mapping[Run, Outcome]) -> ValidityMap:
        """Return the map that the rows of its runs make."""
        readings = {run: _reading(row) for run, row in rows.items()}
        return study_readings(self.throw, self.axis, self.fills, self.values, readings, steps=STEPS, points=None)


def make_map(plan: MapPlan, out: Path, begin: Begin, **how: Any) -> str:
    """Make every run of the map that has no row in ``out``, as ``fill`` does, and draw it; return its lines."""
    runs = plan.runs()

    def end(store: Store, summary: str) -> str:
        study = plan.study(read_runs(store, runs))
        _draw(figure_map(study), out, "map")
        write_whole(out / "map.csv", map_csv(study).encode())
        write_whole(out / "map.json", json.dumps(map_facts(study, plan.throw), indent=1, allow_nan=False).encode())
        shares = ", ".join(f"{name} {count}" for name, count in _dominating(study).items() if count)
        return f"{summary}\ncells by largest fair share: {shares or 'none'}; see {out / 'map.png'}"

    source = f"flipproof map --axis {plan.axis} --size {len(plan.fills)}x{len(plan.values)}"
    return fill(design_of_runs(runs, plan.varied(), CURVE, source), out, begin, end, **how)


def map_csv(study: ValidityMap) -> str:
    """Return one row per cell as CSV; a number that could not be computed is an empty cell with a reason."""
    fills, values = np.meshgrid(study.fills, study.values)
    columns = {
        FILL: fills,
        VALUES[study.axis]: values,
        **{f"plateau {name}": study.level[name] for name in NAMES},
        **{f"fair share of {name}": share for name, share in zip(RUNGS, study.shares, strict=True)},
        **{f"largest difference of {name} from {LADDER[-1]}": study.largest[name] for name in NAMES},
        **{f"step error of {name}": study.step_error[name] for name in SCHEMES},
        "largest fair share": np.array([*RUNGS, ""])[study.dominant],  # -1 where there is none
        "reason": study.reason,
    }
    known = [np.where(np.isfinite(c), c, np.nan) if c.dtype.kind == "f" else c for c in columns.values()]
    return rows_csv(list(columns), zip(*(cells.flat for cells in known), strict=True), digits=None)


def map_facts(study: ValidityMap, throw: Scenario) -> dict[str, Any]:
    """Return what a program reads off a map: contours as lines of (fill fraction, value), cells by largest step."""
    return {
        "throw": throw.to_mapping(),
        "x": FILL,
        "y": VALUES[study.axis],
        "ladder": list(LADDER),
        "cells by largest fair share": _dominating(study),
        "cells without": int((study.dominant < 0).sum()),
        "contours": [
            {
                "of": words,
                "level": level,
                "lines": [line.tolist() for line in contour_lines(study, error, level)],
                "cells above": int((error >= level).sum()),
            }
            for words, error in errors(study)
            for level, _ in CONTOURS
        ],
    }


def _dominating(study: ValidityMap) -> dict[str, int]:
    return {name: int((study.dominant == k).sum()) for k, name in enumerate(RUNGS)}


def _reading(row: Outcome) -> Reading:
    if row.status != "ok":
        return Reading(problem=word(row.reason) if row.status == "failed" else row.status)
    assert row.plateau is not None
    assert row.curves is not None
    return Reading(level=row.plateau, omega=row.curves[CURVES.index("omega")])


# ---------------------------------------------------------------------- the waterfall

ENDS: Final = 2
"""Points of a row's curves: release and landing. Only v_CM on landing is read there."""


def plan_split(throw: Scenario) -> list[Run]:
    """Return the runs of ``plan_waterfall``; the program keeps its slices, whose velocity on landing is split too."""
    runs = plan_waterfall(throw, STEPS)
    return [replace(r, settings={**r.settings, "store": "full"}) if r.solver == PROGRAM else r for r in runs]


def make_split(throw: Scenario, out: Path, begin: Begin, **how: Any) -> str:
    """Make every run of the waterfall that has no row in ``out``, as ``fill`` does, and draw it; return its table.

    A run that is not whole is refused: a split needs all.
    """
    runs = plan_split(throw)

    def end(store: Store, summary: str) -> str:
        waterfalls = split_rows(read_runs(store, runs))
        for waterfall in waterfalls:
            _draw(figure_waterfall(waterfall), out, f"waterfall-{waterfall.observable.name}")
        write_whole(out / "waterfall.csv", waterfall_csv(waterfalls).encode())
        return f"{_table(waterfalls[0])}\n{summary}"

    return fill(design_of_runs(runs, {"omega0": [throw.omega0]}, ENDS, "flipproof waterfall"), out, begin, end, **how)


def split_rows(rows: Mapping[Run, Outcome]) -> tuple[Waterfall, ...]:
    """Split every observable of the rows of ``plan_split``; a run that is not whole is refused."""
    program = next(run for run in rows if run.solver == PROGRAM)
    return split_all(program, {run: _observed(run, row) for run, row in rows.items()})


def _observed(run: Run, row: Outcome) -> dict[str, float]:
    throw = run.scenario
    if row.status != "ok":
        raise SweepError(f"{run.name}: {row.status}: {row.message or row.reason}; a waterfall needs every run whole")
    assert row.plateau is not None
    assert row.omega_end is not None
    assert row.theta_end is not None
    assert row.r_cm_end is not None
    assert row.curves is not None
    return {
        "plateau": row.plateau,
        "omega": row.omega_end / throw.omega0,
        "theta": row.theta_end,
        "toppling": float(toppling_angle(throw, row.r_cm_end)),
        "v_cm": float(row.curves[CURVES.index("v_cm"), -1]),
    }


def waterfall_csv(waterfalls: tuple[Waterfall, ...]) -> str:
    """Return one row per observable and bar as CSV; numbers read back to the last bit."""
    header = ["observable", "unit", "bar", "forward", "backward", "mean of all orders", "forward band", "mean band"]
    rows: list[list[Any]] = []
    for waterfall in waterfalls:
        what = (waterfall.observable.name, waterfall.observable.unit)
        rows += [
            [*what, "published program", waterfall.start, "", "", "", ""],
            *(
                [*what, b.name, b.forward, b.backward, b.average, b.forward_band, b.average_band]
                for b in waterfall.bars
            ),
            [*what, "free flight", waterfall.end, "", "", waterfall.end_band, ""],
            [*what, "column", waterfall.column, "", "", "", ""],
        ]
    return rows_csv(header, rows, digits=None)


def _table(waterfall: Waterfall) -> str:
    observable, space = waterfall.observable, 20 * " "
    lines = [
        f"{observable.words} [{observable.unit}]: in the order shown, in reverse, mean of all orders",
        f"  {waterfall.start:+8.4f}  {space}published program",
    ]
    lines += [f"  {bar.forward:+8.4f}  {bar.backward:+8.4f}  {bar.average:+8.4f}  {bar.name}" for bar in waterfall.bars]
    lines += [
        f"  {waterfall.end:+8.4f}  {space}free flight (+- {waterfall.end_band:.1g})",
        f"  {waterfall.overlap:+8.4f}  {space}column minus free flight: no overlap, no share",
    ]
    return "\n".join(lines)
