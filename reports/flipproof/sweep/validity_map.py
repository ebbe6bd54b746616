"""A map of validity made by a sweep: many cells at full slices, resumable, with figure, table and contours.

::

    DIR/sweep.sqlite            every run of the map, one row each
    DIR/map.svg, DIR/map.png    the figure
    DIR/map.csv                 one row per cell: plateaus, differences, fair shares, reasons
    DIR/map.json                contours as lines, and in how many cells each assumption has the largest fair share
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

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
from flipproof.figures.style import draw
from flipproof.frame.solvers import Run
from flipproof.output.columns import rows_csv
from flipproof.sweep.axes import DAMPING, FILL, Value
from flipproof.sweep.command import Begin, fill
from flipproof.sweep.files import write_whole
from flipproof.sweep.planned import design_of_runs, read_runs
from flipproof.sweep.store import Store
from flipproof.sweep.work import CURVES, Outcome
from slicemodel import Scenario

STEPS: Final = 1000
"""Points of a scheme's grid where the map does not say another: the published program's."""

NAMES: Final = (*LADDER, *EXTRA)
VALUES: Final[Mapping[Axis, str]] = {"gamma": "gamma/omega0", "step": "omega0*dt", "restitution": "restitution"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """The cells of a map: the throw that they vary, and the values of both axes."""

    throw: Scenario
    axis: Axis
    fills: tuple[float, ...]
    values: tuple[float, ...]

    @classmethod
    def of_size(cls, throw: Scenario, axis: Axis, columns: int, rows: int) -> Plan:
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


def make_map(plan: Plan, out: Path, begin: Begin, **how: Any) -> str:
    """Make every run of the map that has no row in ``out``, draw the map; return lines that tell what is there.

    Parameters and errors as for ``flipproof.sweep.command.fill``.
    """
    runs = plan.runs()

    def end(store: Store, summary: str) -> str:
        study = plan.study(read_runs(store, runs))
        drawing = draw(figure_map(study))
        write_whole(out / "map.svg", drawing.svg.encode())
        write_whole(out / "map.png", drawing.png)
        write_whole(out / "map.csv", map_csv(study).encode())
        write_whole(out / "map.json", json.dumps(map_facts(study, plan.throw), indent=1, allow_nan=False).encode())
        shares = ", ".join(f"{name} {count}" for name, count in _dominating(study).items() if count)
        return f"{summary}\ncells by largest fair share: {shares or 'none'}; see {out / 'map.png'}"

    source = f"flipproof map --axis {plan.axis} --size {len(plan.fills)}x{len(plan.values)}"
    return fill(design_of_runs(runs, plan.varied(), CURVE, source), out, begin, end, **how)


def map_csv(study: ValidityMap) -> str:
    """Return one row per cell as CSV; a number that could not be computed is an empty cell with a reason."""
    header = [
        FILL,
        VALUES[study.axis],
        *(f"plateau {name}" for name in NAMES),
        *(f"fair share of {name}" for name in RUNGS),
        *(f"largest difference of {name} from {LADDER[-1]}" for name in NAMES),
        *(f"step error of {name}" for name in SCHEMES),
        "largest fair share",
        "reason",
    ]
    rows = []
    dominant = study.dominant
    for at in np.ndindex(dominant.shape):
        numbers = [study.level[name][at] for name in NAMES] + study.shares[(slice(None), *at)].tolist()
        numbers += [study.largest[name][at] for name in NAMES] + [study.step_error[name][at] for name in SCHEMES]
        shown = [repr(float(number)) if np.isfinite(number) else "" for number in numbers]
        largest = RUNGS[dominant[at]] if dominant[at] >= 0 else ""
        place = [repr(float(study.fills[at[1]])), repr(float(study.values[at[0]]))]
        rows.append([*place, *shown, largest, study.reason[at]])
    return rows_csv(header, rows)


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
