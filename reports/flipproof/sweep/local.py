"""Worker processes of this machine, as a sweep uses them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass

from flipproof.frame.processes import WorkerDiedError, processes


@dataclass(frozen=True, slots=True, kw_only=True)
class Workers:
    """Where batches go.

    Parameters
    ----------
    executor : Executor
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
