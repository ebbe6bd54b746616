"""The waterfall made by a sweep: every combination of assumptions in one file, resumable, with figures and table.

::

    DIR/sweep.sqlite                     every run, one row each
    DIR/waterfall-plateau.svg, .png ...  one figure per observable
    DIR/waterfall.csv                    one row per observable and bar
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from flipproof.chapters.waterfall.chapter import figure_waterfall
from flipproof.chapters.waterfall.study import PROGRAM, Waterfall, plan_waterfall, split_all
from flipproof.figures.style import draw
from flipproof.frame.solvers import Run
from flipproof.output.columns import rows_csv
from flipproof.sweep.axes import Value
from flipproof.sweep.command import Begin, fill
from flipproof.sweep.errors import SweepError
from flipproof.sweep.files import write_whole
from flipproof.sweep.planned import design_of_runs, read_runs
from flipproof.sweep.store import Store
from flipproof.sweep.work import CURVES, Outcome
from slicemodel import Scenario
from slicemodel.observables import toppling_angle

STEPS: Final = 1000
ENDS: Final = 2
"""Points of a row's curves: release and landing. Only v_CM on landing is read there."""


def plan_split(throw: Scenario) -> list[Run]:
    """Return the runs of ``plan_waterfall``; the program keeps its slices, whose velocity on landing is split too."""
    runs = plan_waterfall(throw, STEPS)
    return [replace(r, settings={**r.settings, "store": "full"}) if r.solver == PROGRAM else r for r in runs]


def releases(runs: list[Run]) -> dict[str, list[Value]]:
    """Return the fields of a scenario in which the runs differ: twins are released a little faster."""
    return {"omega0": list(dict.fromkeys(run.scenario.omega0 for run in runs))}


def make_split(throw: Scenario, out: Path, begin: Begin, **how: Any) -> str:
    """Make every run of the waterfall that has no row in ``out``, draw it; return its table and what is there.

    Parameters and errors as for ``flipproof.sweep.command.fill``; a run that is not whole is one: a split needs all.
    """
    runs = plan_split(throw)

    def end(store: Store, summary: str) -> str:
        waterfalls = split_rows(read_runs(store, runs))
        for waterfall in waterfalls:
            drawing = draw(figure_waterfall(waterfall))
            write_whole(out / f"waterfall-{waterfall.observable.name}.svg", drawing.svg.encode())
            write_whole(out / f"waterfall-{waterfall.observable.name}.png", drawing.png)
        write_whole(out / "waterfall.csv", waterfall_csv(waterfalls).encode())
        return f"{_table(waterfalls[0])}\n{summary}"

    return fill(design_of_runs(runs, releases(runs), ENDS, "flipproof waterfall"), out, begin, end, **how)


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
    rows: list[list[str]] = []
    for waterfall in waterfalls:
        what = (waterfall.observable.name, waterfall.observable.unit)
        rows.append([*what, "published program", repr(waterfall.start), "", "", "", ""])
        for bar in waterfall.bars:
            numbers = (bar.forward, bar.backward, bar.average, bar.forward_band, bar.average_band)
            rows.append([*what, bar.name, *map(repr, numbers)])
        rows.append([*what, "free flight", repr(waterfall.end), "", "", repr(waterfall.end_band), ""])
        rows.append([*what, "column", repr(waterfall.column), "", "", "", ""])
    return rows_csv(header, rows)


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
