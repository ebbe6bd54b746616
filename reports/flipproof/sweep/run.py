"""The loop of a sweep: points out in batches, rows in, until every point has a row.

The loop knows ``Workers`` and nothing else of where points are made: processes of this machine, or those of a Dask
cluster. It keeps a bounded number of batches in flight, so a sweep of a million points needs no more memory than they
do, and it writes whatever has come back in one transaction: a killed sweep loses what was in flight. Flights come back
as arrays: workers on other machines need no folder in common with this program, but the same version of flipproof.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from itertools import islice
from typing import Any, Final

from flipproof.frame.processes import WorkerDiedError, processes
from flipproof.sweep.design import Point
from flipproof.sweep.errors import SweepError
from flipproof.sweep.store import Store
from flipproof.sweep.work import Outcome, Returned, make_batch, versions

TARGET: Final = 0.4
"""Seconds that a batch should take: sending one costs up to some milliseconds, and a kill loses it."""

MOST_BYTES: Final = 32 * 2**20
"""Bytes of flights in one batch."""

GROWTH: Final = 8
"""A batch is at most so many times as large as the one before: the first points tell little of the others."""

LONE_DEATHS: Final = 2
"""A point that was alone in its worker so many times when the worker died is given up."""

DEATHS_IN_A_ROW: Final = 30
"""Deaths without one batch between them after which it is not the points that kill the workers."""

PATIENCE: Final = 60.0
"""Seconds to wait for a worker when none is left."""

TICK: Final = 0.5
"""Seconds between two looks at the workers while nothing comes back."""

CONNECT: Final = 10.0
"""Seconds in which a scheduler must answer."""

Progress = Callable[[int, int], None]
"""Called with the points just stored, and with how many of them have no whole flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Workers:
    """Where batches go.

    Parameters
    ----------
    capacity : callable - how many batches to keep in flight now; 0: nobody is there at the moment
    died : exceptions of a future that mean that its worker died
    """

    executor: Executor
    capacity: Callable[[], int]
    died: tuple[type[Exception], ...]


@contextmanager
def local_workers(jobs: int | None) -> Iterator[Workers]:
    """Give worker processes, one per core unless told otherwise; the sweep itself decides what a death means."""
    with processes(jobs) as pool:
        yield Workers(executor=pool, capacity=lambda: pool.count, died=(WorkerDiedError,))


@contextmanager
def dask_workers(address: str) -> Iterator[Workers]:
    """Give the workers of the scheduler at ``address``, such as tcp://127.0.0.1:8786.

    A SweepError says that Dask is not installed, or that nobody answers there.
    """
    try:
        distributed: Any = import_module("distributed")
    except ModuleNotFoundError as error:
        raise SweepError(f"--dask needs {error.name}: install flipproof with its extra 'dask'") from None
    # What becomes of batches is told by this program; client and event loop would tell it again, with tracebacks.
    for talker in ("distributed", "distributed.client", "tornado", "asyncio"):
        logging.getLogger(talker).setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SweepError(f"--dask {address}: no scheduler answers there ({error})") from None
    executor = client.get_executor(pure=False)

    def capacity() -> int:
        # One batch is made while the next is on its way.
        return 2 * sum(client.ncores().values()) if client.status == "running" else 0

    try:
        yield Workers(executor=executor, capacity=capacity, died=(distributed.KilledWorker,))
    finally:
        executor.shutdown(wait=False)
        client.close(timeout=CONNECT)


@dataclass(slots=True)
class Line:
    """The points of one solver that wait for a worker, and how many of them the next batch may hold."""

    points: Iterator[Point]
    total: int
    left: int
    size: int = 1

    def take(self, shares: int) -> Batch:
        """Return the next batch; towards the end of the line smaller ones, so that no worker is left waiting."""
        points = tuple(islice(self.points, max(1, min(self.size, -(-self.left // shares)))))
        self.left -= len(points)
        return Batch(points, self)

    def learn(self, returned: Returned) -> None:
        """Set the size of the next batch by what the last one took."""
        count = len(returned.outcomes)
        if count:
            bytes_each = sum(a.nbytes for o in returned.outcomes for a in (o.arrays or {}).values()) / count
            wanted = min(TARGET * count / max(returned.seconds, 1e-6), MOST_BYTES / max(bytes_each, 1.0), 5_000)
            self.size = max(1, min(int(wanted), GROWTH * count))


@dataclass(frozen=True, slots=True)
class Batch:
    """Points on their way through one worker, and how often its worker died with one point in it."""

    points: tuple[Point, ...]
    line: Line
    deaths: int = 0


def run_sweep(store: Store, workers: Workers, progress: Progress) -> None:
    """Make every point that has no row, and store it.

    A SweepError says that rows cannot be written, or that workers run other code, die on everything, or are gone.
    """
    design, done = store.design, store.done()
    lines = [
        Line(
            points=(design.point(number) for number in numbers if not done[number]), total=len(numbers),
            left=len(numbers) - done.count(1, numbers.start, numbers.stop),
        )
        for numbers in design.lines
    ]  # fmt: skip
    again: deque[Batch] = deque()
    flying: dict[Future[Returned], Batch] = {}
    deaths, heard = 0, time.monotonic()
    while True:
        capacity = workers.capacity()
        while len(flying) < capacity and (batch := _next(lines, again, capacity)) is not None:
            try:
                future = workers.executor.submit(
                    make_batch, store.code, batch.points, design.trajectories, design.curves
                )
            except Exception as error:
                raise _no_workers(store.code, error) from None
            flying[future] = batch
        if not flying and not again and not any(line.left for line in lines):
            return
        if capacity > 0:
            heard = time.monotonic()
        elif time.monotonic() - heard > PATIENCE:
            raise SweepError(f"no worker is left since {PATIENCE:.0f} s; the same command goes on from there")
        if not flying:
            time.sleep(TICK)
            continue
        came: list[Returned] = []
        problem: SweepError | None = None
        for future in wait(flying, timeout=TICK, return_when=FIRST_COMPLETED).done:
            batch = flying.pop(future)
            try:
                returned = future.result()
            except workers.died as error:
                deaths += 1
                if deaths > DEATHS_IN_A_ROW:
                    problem = SweepError(f"workers die whatever they are given ({error}); none returned a point")
                divided, given_up = _after_death(batch, error)
                again.extend(divided)
                came += given_up
            except Exception as error:
                problem = _no_workers(store.code, error)
            else:
                deaths = 0
                problem = problem or _other_code(store.code, returned)
                batch.line.learn(returned)
                came.append(returned)
        # What came back is stored before anything is said of what did not.
        if came:
            store.add(came)
            outcomes = [outcome for returned in came for outcome in returned.outcomes]
            progress(len(outcomes), sum(not outcome.whole for outcome in outcomes))
        if problem:
            raise problem


def _next(lines: list[Line], again: deque[Batch], capacity: int) -> Batch | None:
    """Return what to send next: what came back unmade, else of the solver that has the most before it.

    So all solvers end together, the time left is told honestly, and a reader sees the same throws by all of them.
    """
    if again:
        return again.popleft()
    line = max(lines, key=lambda line: line.left / line.total)
    return line.take(capacity) if line.left else None


def _no_workers(code: str, error: Exception) -> SweepError:
    return SweepError(
        f"the workers cannot go on ({str(error) or type(error).__name__}); they need flipproof {code} and a "
        "connection; the points stored so far are safe, the same command goes on from there"
    )


def _after_death(batch: Batch, error: BaseException) -> tuple[list[Batch], list[Returned]]:
    """Divide a batch whose worker died, until the point that kills is alone; give that up when it has done so again."""
    points = batch.points
    if len(points) > 1:
        middle = len(points) // 2
        return [Batch(half, batch.line) for half in (points[:middle], points[middle:])], []
    deaths = batch.deaths + 1
    if deaths < LONE_DEATHS:
        return [Batch(points, batch.line, deaths)], []
    reason = f"the worker died {deaths} times with this point alone in it ({error})"
    lost = Outcome(number=points[0].number, status="worker-died", reason=reason)
    return [], [Returned("", versions(), [lost], 0.0)]


def _other_code(code: str, returned: Returned) -> SweepError | None:
    if returned.changed:
        return SweepError(
            f"the files of {returned.changed} are not those that the sweep was begun with; with them as they were the "
            "same command goes on, or name another --out"
        )
    if returned.code == code:
        return None
    return SweepError(f"a worker runs flipproof {returned.code}, this is {code}; install the same in both")
