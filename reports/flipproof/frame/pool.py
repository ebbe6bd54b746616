"""Runs made on all cores, in the order asked, until somebody interrupts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future, as_completed, wait
from contextlib import AbstractContextManager
from typing import Any, Final

from flipproof.frame.flights import Call, Outcome, attempt, chapter_errors
from flipproof.frame.processes import WorkerDiedError, processes
from flipproof.frame.run_store import RunStore
from flipproof.frame.solvers import Run, RunResult, find, make
from slicemodel import Scenario

Progress = Callable[[int, int, str], None]
"""Called with the work that is done, the work that is planned, and the name of what was made last."""

COSTS: Final = {"certificate": 4000, "witness": 100, "engine": 50, "call": 20, "slow": 7, "quick": 1}
"""Ratios of measured mean times: a certified run, one by SciPy, one by an engine with many slices, a call, another run
by an engine, any other run.
"""

SHORT_RUN_SLICES: Final = 20
"""Slices with which an engine's run is not long."""

GROUP = 8
"""Runs of a group: sending a quick one away alone would cost as much as making it."""

TRIES = 2
"""Times that a call is made when its worker dies: what killed one worker may have had nothing to do with the call."""


def make_all(
    pool: Executor,
    runs: Iterable[Run],
    progress: Progress,
    calls: Iterable[Call] = (),
    store: RunStore | None = None,
) -> tuple[dict[Run, RunResult], dict[Call, Outcome[Any]]]:
    """Make runs in worker processes, equal ones once, but for those that the store has; keep slow ones there.

    One job for each run of an engine and of a witness, and groups of the others. Calls are made beside them, each a
    job, and kept in the store too, but for those that are made anew. This process only waits, so that it can be
    interrupted at any time. Both results are in the order asked.
    """
    runs, store = list(dict.fromkeys(runs)), store or RunStore(None)
    died = f"the worker process died {TRIES} times with this"
    keeping = store.remembering(pool)
    pending_calls = {call: (pool if call.anew else keeping).submit(call.function, *call.arguments) for call in calls}
    finished: dict[Run, RunResult] = {run: stored for run in runs if (stored := store.find(run)) is not None}
    jobs = _jobs([run for run in runs if run not in finished])
    costs = {run: COSTS[_kind(run)] for job in jobs for run in job}
    planned, done = sum(costs.values()) + COSTS["call"] * len(pending_calls), 0

    def report(label: str) -> None:
        progress(done + COSTS["call"] * sum(answer.done() for answer in pending_calls.values()), planned, label)

    def answered(label: str) -> Callable[[Future[Any]], None]:
        return lambda _: report(label)

    for call, answer in pending_calls.items():
        answer.add_done_callback(answered(call.label))
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
                results = [RunResult(job[0], None, 0.0, f"{died} run ({error})")]
            for result in results:
                store.keep(result)
                finished[result.run] = result
                done += costs[result.run]
                report(result.run.name)
    called: dict[Call, Outcome[Any]] = {}
    for call, answer in pending_calls.items():
        try:
            with chapter_errors(f"call {call.label or call.function.__name__!r}"):
                called[call] = attempt(answer.result)
        except WorkerDiedError as error:
            called[call] = Outcome(None, f"{call.label}: {died} call ({error})")
    # In the order asked, whichever worker was faster: what is read off this table must not depend on load.
    return {run: finished[run] for run in runs}, called


def compile_kernels(pool: Executor) -> None:
    """Wait until two workers have compiled the loops of schemes and of equations, or read them from numba's cache.

    Runs that are sent away after that find them there, whichever worker makes them.
    """
    short = Scenario(n_slices=2, duration=1e-3)
    wait([pool.submit(make_each, [Run(name, short)]) for name in ("exact-step", "eq8")])


def _jobs(runs: list[Run]) -> list[list[Run]]:
    """Return runs by jobs: each that may be slow alone, and these first; the others in groups."""
    quick = [run for run in runs if _kind(run) == "quick"]
    slow = [[run] for run in runs if _kind(run) != "quick"]
    return [*slow, *(quick[k : k + GROUP] for k in range(0, len(quick), GROUP))]


def _kind(run: Run) -> str:
    """Return what a run costs, in the words of COSTS: those of schemes and of equations take milliseconds.

    Exceptions are those by a ``method`` of SciPy's; and a ``tolerance`` asks an engine for a certificate.
    """
    if "method" in run.settings:
        return "witness"
    if find(run.solver).package in ("slicemodel", "ode_reference"):
        return "quick"
    if "tolerance" in run.settings:
        return "certificate"
    return "engine" if run.scenario.n_slices > SHORT_RUN_SLICES else "slow"


def make_each(runs: Iterable[Run]) -> list[RunResult]:
    """Make runs one after the other."""
    return [make(run) for run in runs]


def workers(jobs: int | None) -> AbstractContextManager[Executor]:
    """Give a pool of worker processes that makes a call once more when its worker dies; one per core unless told."""
    return processes(jobs, tries=TRIES)


class SerialExecutor(Executor):
    """An executor that makes every call when it is submitted, in this process."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return what came of the call."""
        answer: Future[Any] = Future()
        try:
            answer.set_result(fn(*args, **kwargs))
        except Exception as error:
            answer.set_exception(error)
        return answer
