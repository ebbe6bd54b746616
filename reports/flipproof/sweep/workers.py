"""Where the batches of a sweep go: worker processes of this machine, or those of a Dask cluster.

Flights come back to this program as arrays: workers on other machines need no folder in common with it, but the same
version of flipproof.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from flipproof.frame.processes import WorkerDiedError, processes
from flipproof.sweep.errors import SweepError

CONNECT = 10.0
"""Seconds in which the scheduler must answer."""


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

    Raises
    ------
    SweepError
        If Dask is not installed, or nobody answers at the address.
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
