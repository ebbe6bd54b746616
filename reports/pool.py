"""Runs made on all cores, in the order asked, until somebody interrupts."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from reports.solvers import Made, Run, find, make

Progress = Callable[[int, int, str], None]
"""Called with runs made, runs planned and the last run's tag."""

SMALL = 8.0
"""Slices times seconds of flight below which runs are made in groups."""

GROUP = 8
"""Runs of a group."""

PATIENCE = 2.0
"""Seconds that an interrupted report waits for its workers to end."""


def make_all(pool: Executor, runs: Iterable[Run], progress: Progress) -> dict[str, Made]:
    """Make runs in worker processes: one job for each slow run, one for all of the slice model's.

    This process only waits, so that it can be interrupted at any time; the slice model compiles in one worker only.
    """
    runs = list(runs)
    # Runs that differ in their tag only are made once.
    same: dict[tuple[Any, ...], list[Run]] = {}
    for run in runs:
        same.setdefault((run.solver, run.scenario, repr(sorted(run.settings.items()))), []).append(run)
    different = [group[0] for group in same.values()]
    others = {group[0].tag: group for group in same.values()}
    quick = [run for run in different if find(run.solver).package == "slicemodel"]
    slow = [run for run in different if find(run.solver).package != "slicemodel"]
    # Small runs go in groups: sending each away alone would cost as much as making it.
    small = [run for run in slow if run.scenario.n_slices * run.scenario.duration < SMALL]
    jobs = [[run] for run in slow if run.scenario.n_slices * run.scenario.duration >= SMALL]
    jobs += [small[k : k + GROUP] for k in range(0, len(small), GROUP)]
    made: dict[str, Made] = {}
    for future in as_completed([pool.submit(make_each, job) for job in ([quick] if quick else []) + jobs]):
        for result in future.result():
            for run in others[result.run.tag]:
                made[run.tag] = replace(result, run=run)
            progress(len(made), len(runs), result.run.tag)
    # In the order asked, whichever worker was faster: what is read off this table must not depend on load.
    return {run.tag: made[run.tag] for run in runs}


def make_each(runs: Iterable[Run]) -> list[Made]:
    """Make runs one after the other."""
    return [make(run) for run in runs]


@contextmanager
def workers(jobs: int | None) -> Iterator[Executor]:
    """Give a pool of worker processes; when interrupted, end them at once instead of waiting for their runs."""
    # One linear-algebra thread per worker: two workers with two each wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    pool = ProcessPoolExecutor(
        max_workers=jobs or cores,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )
    try:
        yield pool
    except KeyboardInterrupt:
        for child in multiprocessing.active_children():
            child.kill()
        # A worker killed while it sends a result leaves the pool waiting for the rest of it, so the wait is bounded.
        ending = threading.Thread(target=pool.shutdown, kwargs={"cancel_futures": True}, daemon=True)
        ending.start()
        ending.join(PATIENCE)
        raise
    except BaseException:
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()
