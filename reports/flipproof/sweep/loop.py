"""The loop of a sweep: points without a row go to an executor in chunks, and their rows to the store.

The executor is any ``concurrent.futures.Executor``: processes of this machine, Dask's ``Client.get_executor()``, an
``mpi4py.futures.MPIPoolExecutor``. A bounded number of chunks is in flight, so that a million points need no more
memory than they do, and each is stored as soon as it is there: a killed sweep loses what was in flight. The same call
goes on from there; two programs may fill one store at once.
"""

from __future__ import annotations

import json
import queue
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from importlib import import_module
from itertools import chain, islice
from typing import Any, Final

from flipproof.frame.processes import NoWorkersError
from flipproof.frame.store import Entry, Store, json_of
from flipproof.sweep.errors import SweepError
from flipproof.sweep.work import Point, Row, Throw, WorkerResult, code_identity, keyed, make_points, together, versions

Chunk = list[tuple[bytes, Point]]
"""Keys and points of one kind."""

BATCH: Final = 256
"""Keys that the store is asked for at a time."""

IN_FLIGHT: Final = 64
"""Chunks in flight where nobody says how many workers an executor has."""

MAX_LOST: Final = 30
"""Chunks lost one after the other from which on it is not the points that kill the workers."""

Progress = Callable[[int, int, int], object]
"""Called with how many points have a row, how many of them have no whole flight, and how many were there before."""


def fill(
    store: Store,
    points: Iterable[Point],
    executor: Executor,
    in_flight: int = IN_FLIGHT,
    progress: Progress = lambda *_: None,
) -> tuple[Counter[str], int]:
    """Make every point that has no row; return how many points have which status, and how many were made.

    Raises
    ------
    SweepError
        If workers have other code or cannot be started, or if they are lost whatever they are given.
    OSError, sqlite3.Error
        If the store cannot be written.
    """
    code, counts = code_identity(), Counter[str]()
    n_new, lost, suspects = 0, 0, set[bytes]()
    again: list[Chunk] = []
    flying: dict[Future[WorkerResult], Chunk] = {}
    done: queue.SimpleQueue[Future[WorkerResult]] = queue.SimpleQueue()

    def count(rows: Iterable[Row]) -> None:
        counts.update(str(row["status"]) for row in rows)
        done = counts.total()
        progress(done, done - counts["ok"] - counts["escaped"] - counts["undecided"], done - n_new)

    points = iter(points)
    if not (begin := list(islice(points, 1))):
        return counts, 0
    base = begin[0].throw  # the same in whatever order rows are made
    fresh = _chunks(_missing(store, chain(begin, points), code, count))
    while True:
        while len(flying) < in_flight and (chunk := again.pop() if again else next(fresh, None)):
            try:
                future = executor.submit(make_points, code, [point for _, point in chunk])
            except Exception as error:
                raise _no_workers(error) from None
            flying[future] = chunk
            future.add_done_callback(done.put)
        if not flying:
            return counts, n_new
        future = done.get()
        chunk = flying.pop(future)
        try:
            result, lost = future.result(), 0
        except NoWorkersError as error:
            raise _no_workers(error) from None
        except Exception as error:  # the worker, or the way to it, is gone: points themselves raise nothing
            lost += 1
            if lost > MAX_LOST:
                words = f"workers die whatever they are given ({str(error) or type(error).__name__}); all rows are kept"
                raise SweepError(words) from None
            middle = len(chunk) // 2
            if middle:
                again += [chunk[:middle], chunk[middle:]]
                continue
            if chunk[0][0] not in suspects:
                suspects.add(chunk[0][0])
                again.append(chunk)
                continue
            words = f"the worker died twice with this point alone in it ({error})"
            result = WorkerResult(code, versions(), [{"status": "worker-died", "reason": words}])
        if result.changed:
            words = f"the files of {result.changed} are not those that the sweep was begun with; begin it again"
            raise SweepError(f"{words}, which keeps the rows that are there")
        if result.code != code:
            raise SweepError(f"a worker runs flipproof {result.code}, this is {code}; install the same in both")
        store.put(_entries(chunk, result, base))
        n_new += len(result.rows)
        count(result.rows)


def rows_of(store: Store, points: Iterable[Point]) -> Iterator[Row | None]:
    """Yield the row of every point, or None where there is none."""
    for some in _batches(keyed(points, code_identity())):
        there = store.get([key for key, *_ in some])
        for key, *_ in some:
            yield _row(*there[key]) if key in there else None


def _row(shared: Any, answer: bytes) -> Row:
    return dict(zip(shared["columns"], json.loads(answer), strict=True))


def _entries(chunk: Chunk, result: WorkerResult, base: Throw) -> list[Entry]:
    """Return the rows of a chunk as entries: what differs from the base throw stands beside each."""
    first = chunk[0][1]
    facts = {
        "solver": first.solver,
        "settings": dict(first.settings),
        "maker": first.maker,
        "options": dict(first.options),
        "code": result.code,
        "content": first.content,
        "versions": dict(result.versions),
        "throw": base,
        "columns": list(result.rows[0]),
    }
    return [
        Entry(key, facts, json_of(_changes(point.throw, base)), json_of(list(row.values())))
        for (key, point), row in zip(chunk, result.rows, strict=True)
    ]


def _changes(throw: Throw, base: Throw) -> dict[str, Any]:
    """Return the fields in which a throw differs from another; those of the bottle begin with "bottle."."""
    if throw["bottle"] == base["bottle"]:
        changes = {}
    else:
        bottle = base["bottle"]
        changes = {f"bottle.{name}": value for name, value in throw["bottle"].items() if value != bottle[name]}
    scenario = base["scenario"]
    return changes | {name: value for name, value in throw["scenario"].items() if value != scenario[name]}


def _missing(
    store: Store, points: Iterable[Point], code: str, count: Callable[[Iterable[Row]], None]
) -> Iterator[tuple[bytes, str, Point]]:
    for some in _batches(keyed(points, code)):
        there = store.get([key for key, *_ in some])
        if there:
            count(_row(*there[key]) for key, *_ in some if key in there)
        yield from (keyed_point for keyed_point in some if keyed_point[0] not in there)


def _chunks(keyed_points: Iterable[tuple[bytes, str, Point]]) -> Iterator[Chunk]:
    """Yield points that can be made together, whatever their order."""
    waiting: dict[str, Chunk] = {}
    for key, kind, point in keyed_points:
        chunk = waiting.setdefault(kind, [])
        chunk.append((key, point))
        if len(chunk) >= together(point):
            yield waiting.pop(kind)
    yield from waiting.values()


def _batches(keyed_points: Iterator[tuple[bytes, str, Point]]) -> Iterator[list[tuple[bytes, str, Point]]]:
    while some := list(islice(keyed_points, BATCH)):
        yield some


def _no_workers(error: Exception) -> SweepError:
    words = str(error) or type(error).__name__
    return SweepError(f"the workers cannot go on ({words}); the points stored so far are safe")


@contextmanager
def executor_of(spec: str) -> Iterator[Executor]:
    """Give the executor that "MODULE:FACTORY" makes, or "MODULE:FACTORY@ARGUMENT" of its argument.

    What has a ``get_executor`` gives that: "distributed:Client@tcp://127.0.0.1:8786" are the workers of a Dask cluster.
    """
    target, _, argument = spec.partition("@")
    module, _, name = target.partition(":")
    try:
        product: Any = getattr(import_module(module), name)(*([argument] if argument else []))
    except Exception as error:  # whatever a factory of somebody else raises
        words = str(error) or type(error).__name__
        raise SweepError(f"--executor {spec}: {words}") from None
    executor = product.get_executor(pure=False) if hasattr(product, "get_executor") else product
    if not hasattr(executor, "submit"):
        raise SweepError(f"--executor {spec}: {type(product).__name__} is no concurrent.futures.Executor")
    try:
        yield executor
    finally:
        with suppress(Exception):  # of a cluster that is gone
            executor.shutdown(wait=False, cancel_futures=True)
        if product is not executor and hasattr(product, "close"):
            with suppress(Exception):
                product.close()
