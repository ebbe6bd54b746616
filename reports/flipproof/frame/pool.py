"""Runs made on all cores, in the order asked, until somebody interrupts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor, as_completed, wait
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

from flipproof.frame.processes import WorkerDiedError, processes
from flipproof.frame.solvers import Made, Run, find, make
from flipproof.frame.store import RunStore
from slicemodel import Scenario

Progress = Callable[[int, int, str], None]
"""Called with runs made, runs planned and the last run's tag."""

GROUP = 8
"""Runs of a group: sending a quick one away alone would cost as much as making it."""

QUICK = ("slicemodel", "ode_reference")
"""Packages whose runs take milliseconds, but for those by a ``method`` of SciPy's."""

COMPILED = ("exact-step", "eq8")
"""A solver of each compiled loop."""

TRIES = 2
"""Times that a call is made when its worker dies: what killed one worker may have had nothing to do with the call."""


def make_all(pool: Executor, runs: Iterable[Run], progress: Progress, store: RunStore | None = None) -> dict[str, Made]:
    """Make runs in worker processes, but for those that the store has from an earlier time; keep slow ones there.

    One job for each run of an engine and of a witness, and groups of the others. This process only waits, so that it
    can be interrupted at any time.
    """
    runs = list(runs)
    # Runs that differ in their tag only are made once.
    same: dict[tuple[Any, ...], list[Run]] = {}
    for run in runs:
        same.setdefault((run.solver, run.scenario, repr(sorted(run.settings.items()))), []).append(run)
    others = {group[0].tag: group for group in same.values()}
    store = store or RunStore(None)
    kept = {group[0].tag: found for group in same.values() if (found := store.find(group[0])) is not None}
    jobs = _jobs([group[0] for group in same.values() if group[0].tag not in kept])
    made: dict[str, Made] = {}

    def take(result: Made) -> None:
        for run in others[result.run.tag]:
            made[run.tag] = replace(result, run=run)
        progress(len(made), len(runs), result.run.tag)

    for found in kept.values():
        take(found)
    while jobs:
        pending = {pool.submit(make_each, job): job for job in jobs}
        jobs = []
        for future in as_completed(pending):
            job = pending[future]
            try:
                results = future.result()
            except WorkerDiedError as error:
                if len(job) > 1:
                    # Each alone, so that only the run that kills its worker is lost.
                    jobs += [[run] for run in job]
                    continue
                results = [Made(job[0], None, 0.0, f"the worker process died {TRIES} times with this run ({error})")]
            for result in results:
                store.keep(result)
                take(result)
    # In the order asked, whichever worker was faster: what is read off this table must not depend on load.
    return {run.tag: made[run.tag] for run in runs}


def compile_kernels(pool: Executor) -> None:
    """Wait until two workers have compiled the loops of schemes and of equations, or read them from numba's cache.

    Runs that are sent away after that find them there, whichever worker makes them.
    """
    short = Scenario(n_slices=2, duration=1e-3)
    wait([pool.submit(make_each, [Run("", name, short)]) for name in COMPILED])


def _jobs(runs: list[Run]) -> list[list[Run]]:
    """Return runs by jobs: each that may be slow alone, and these first; the others in groups."""
    quick: list[Run] = []
    slow: list[Run] = []
    for run in runs:
        (quick if find(run.solver).package in QUICK and "method" not in run.settings else slow).append(run)
    return [*([run] for run in slow), *(quick[k : k + GROUP] for k in range(0, len(quick), GROUP))]


def make_each(runs: Iterable[Run]) -> list[Made]:
    """Make runs one after the other."""
    return [make(run) for run in runs]


def workers(jobs: int | None) -> AbstractContextManager[Executor]:
    """Give a pool of worker processes that makes a call once more when its worker dies; one per core unless told."""
    return processes(jobs, tries=TRIES)
