"""The runs that a study plans, as a sweep: a design made of them, and their rows read back by run.

A study of a chapter plans runs and reads what became of them; who makes them, and whether the program died
in between, is not its business. Here a sweep makes them. A run finds its row by what was computed, solver, scenario
and settings to the last bit: a design that misses a run of its plan cannot go unnoticed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

from flipproof.frame.solvers import Run
from flipproof.sweep.axes import Value
from flipproof.sweep.design import Design, design_of
from flipproof.sweep.entries import as_json
from flipproof.sweep.store import Store, read_curves
from slicemodel.trajectory import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What a store holds of one run; a number that is not known is None. ``curves`` are empty if there are none."""

    status: str
    message: str
    reason: str
    plateau: float | None
    omega_end: float | None
    theta_end: float | None
    r_cm_end: float | None
    curves: Mapping[str, FloatArray]


COLUMNS = tuple(field.name for field in fields(Row))


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


def read_runs(store: Store, runs: Sequence[Run]) -> dict[Run, Row]:
    """Return the row of every run; raise KeyError if the store's design does not make one."""
    points = (store.design.point(number) for number in range(store.design.size))
    numbers = {(point.solver, point.scenario(), as_json(point.settings)): point.number for point in points}
    rows = {}
    for number, *values in store.connection.execute(f"SELECT number, {', '.join(COLUMNS)} FROM points"):
        found = dict(zip(COLUMNS, values, strict=True))
        found["curves"] = read_curves(found["curves"]) if found["curves"] else {}
        rows[number] = Row(**found)
    return {run: rows[numbers[run.solver, run.scenario, as_json(run.settings)]] for run in runs}
