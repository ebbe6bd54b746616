"""Workers of a Dask cluster behind the same ``Executor`` as the processes of this machine.

Flights come back to this program as arrays: workers on other machines need no folder in common with it, but the same
version of flipproof.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from flipproof.sweep.errors import SweepError
from flipproof.sweep.local import Workers

CONNECT = 10.0
"""Seconds in which the scheduler must answer."""

DEPTH = 2
"""Batches in flight for each thread of a worker: one is made while the next is on its way."""


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
        return DEPTH * sum(client.ncores().values()) if client.status == "running" else 0

    try:
        yield Workers(executor=executor, capacity=capacity, died=(distributed.KilledWorker,))
    finally:
        executor.shutdown(wait=False)
        client.close(timeout=CONNECT)
