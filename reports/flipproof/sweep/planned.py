"""The runs that a study plans, as a sweep: a design made of them, and their rows read back by run.

A study of a chapter plans runs and reads what became of them; who makes them, and whether the program died
in between, is not its business. Here a sweep makes them. A run finds its row by what was computed, solver, scenario
and settings to the last bit: a design that misses a run of its plan cannot go unnoticed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flipproof.frame.solvers import Run
from flipproof.sweep.axes import Value
from flipproof.sweep.design import Design, design_of
from flipproof.sweep.entries import as_json
from flipproof.sweep.store import Store, read_curves
from flipproof.sweep.work import Outcome

COLUMNS = ("status", "message", "reason", "plateau", "omega_end", "theta_end", "r_cm_end", "curves")


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
