"""Runs made on all cores, in the order asked, until somebody interrupts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future, as_completed
from contextlib import AbstractContextManager
from typing import Any

from flipproof.frame.flights import Call, Outcome, attempt
from flipproof.frame.processes import WorkerDiedError, processes
from flipproof.frame.solvers import Made, Run, find, make

Progress = Callable[[int, int, str], None]
"""Called with runs made, runs planned and the last run's name."""

SMALL = 8.0
"""Slices times seconds of flight below which runs are made in groups."""

GROUP = 8
"""Runs of a group."""

TRIES = 2
"""Times that a call is made when its worker dies: what killed one worker may have had nothing to do with the call."""


def make_all(
    pool: Executor, runs: Iterable[Run], progress: Progress, calls: Iterable[Call] = ()
) -> tuple[dict[Run, Made], dict[Call, Outcome[Any]]]:
    """Make runs in worker processes, equal ones once: a job for each slow run, one for all of the slice model's.

    Calls are made beside them, each a job. This process only waits, so that it can be interrupted at any time; the
    slice model compiles in one worker only. Both results are in the order asked.
    """
    runs = list(dict.fromkeys(runs))
    pending_calls = {call: pool.submit(call.function, *call.arguments) for call in calls}
    quick = [run for run in runs if find(run.solver).package == "slicemodel"]
    slow = [run for run in runs if find(run.solver).package != "slicemodel"]
    # Small runs go in groups: sending each away alone would cost as much as making it.
    small = [run for run in slow if run.scenario.n_slices * run.scenario.duration < SMALL]
    jobs = [[run] for run in slow if run.scenario.n_slices * run.scenario.duration >= SMALL]
    jobs += [small[k : k + GROUP] for k in range(0, len(small), GROUP)]
    made: dict[Run, Made] = {}
    jobs = ([quick] if quick else []) + jobs
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
                made[result.run] = result
                progress(len(made), len(runs), result.run.name)
    called: dict[Call, Outcome[Any]] = {}
    for call, answer in pending_calls.items():
        progress(len(made), len(runs), call.label)
        called[call] = _answered(call, answer)
    # In the order asked, whichever worker was faster: what is read off this table must not depend on load.
    return {run: made[run] for run in runs}, called


def _answered(call: Call, answer: Future[Any]) -> Outcome[Any]:
    try:
        return attempt(answer.result)
    except WorkerDiedError as error:
        return Outcome(None, f"{call.label}: the worker process died {TRIES} times with this call ({error})")


def make_each(runs: Iterable[Run]) -> list[Made]:
    """Make runs one after the other."""
    return [make(run) for run in runs]


def workers(jobs: int | None) -> AbstractContextManager[Executor]:
    """Give a pool of worker processes that makes a call once more when its worker dies; one per core unless told."""
    return processes(jobs, tries=TRIES)


class Here(Executor):
    """Makes every call at once, in this process."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return what came of the call."""
        answer: Future[Any] = Future()
        try:
            answer.set_result(fn(*args, **kwargs))
        except Exception as error:
            answer.set_exception(error)
        return answer
