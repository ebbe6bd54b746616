"""Worker processes of this machine, as an ``Executor``.

It differs from ``ProcessPoolExecutor`` where processes die. There one death breaks every call in flight without telling
whose fault it was, a worker killed half-way through sending leaves the pool waiting for the rest for ever, and workers
outlive a killed parent. Here every worker has a pipe of its own: a death breaks one call, at once, and the next call
gets a new process; a parent that dies closes the pipes.
"""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from flipproof.frame.compiling import announce_compiling

Call = tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]


class WorkerDiedError(RuntimeError):
    """The process that made a call ended before it answered."""


class NoWorkersError(RuntimeError):
    """No worker can be started: the next one would fail like the last."""


@contextmanager
def processes(jobs: int | None, tries: int = 1) -> Iterator[Processes]:
    """Give ``jobs`` worker processes, or one per core; end them at once when the block is left, however it is left."""
    # One linear-algebra thread per worker: two workers with two each wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    pool = Processes(jobs or cores(), tries)
    try:
        yield pool
    finally:
        pool.kill()


def cores() -> int:
    """Return how many processors this program may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Processes(Executor):
    """``count`` processes, each started by its first call and replaced when it dies.

    A call whose worker dies is made ``tries`` times before its future gets a ``WorkerDiedError``.
    """

    def __init__(self, count: int, tries: int = 1) -> None:
        self.count, self._tries = count, tries
        self._calls: queue.SimpleQueue[tuple[Future[Any], Call] | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._alive: set[BaseProcess] = set()
        self._ended = False
        self._announcing = True
        self._threads = [threading.Thread(target=self._serve, daemon=True) for _ in range(count)]
        for thread in self._threads:
            thread.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call ``fn`` in a worker; a worker that dies gives the future a ``WorkerDiedError``."""
        if self._ended:
            raise RuntimeError("the workers have ended")
        future: Future[Any] = Future()
        self._calls.put((future, (fn, args, kwargs)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; end every process when its calls are answered."""
        self._ended = True
        with suppress(queue.Empty):
            while cancel_futures:
                call = self._calls.get_nowait()
                if call is not None:
                    call[0].cancel()
        for _ in self._threads:
            self._calls.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def kill(self) -> None:
        """End every process now, whatever it is doing."""
        with self._lock:
            self._ended = True
            for process in self._alive:
                process.kill()
        self.shutdown(cancel_futures=True)

    def _serve(self) -> None:
        """Pass calls to one process, and start another when it has died."""
        worker: _Worker | None = None
        while (task := self._calls.get()) is not None:
            future, call = task
            if not future.set_running_or_notify_cancel():
                continue
            for attempt in range(1, self._tries + 1):
                try:
                    worker = worker or self._start()
                    fine, answer = worker.ask(call)
                except (EOFError, OSError) as error:
                    code, ready = (worker.end(), worker.ready) if worker else (None, True)
                    self._forget(worker)
                    worker = None
                    words = f"exit code {code}" if code is not None else str(error)
                    if not ready and code and code > 0:
                        words += '; a script has to begin its work below `if __name__ == "__main__":`'
                        future.set_exception(NoWorkersError(f"a worker process ended as it started ({words})"))
                        break
                    if attempt == self._tries or self._ended:
                        future.set_exception(WorkerDiedError(words))
                        break
                except BaseException as error:
                    future.set_exception(error)
                    break
                else:
                    if fine:
                        future.set_result(answer)
                    else:
                        future.set_exception(answer)
                    break
        if worker:
            worker.end()
            self._forget(worker)

    def _start(self) -> _Worker:
        with self._lock:
            if self._ended:
                raise WorkerDiedError("the workers have ended")
            worker, self._announcing = _Worker(self._announcing), False
            self._alive.add(worker.process)
            return worker

    def _forget(self, worker: _Worker | None) -> None:
        with self._lock:
            if worker:
                self._alive.discard(worker.process)


class _Worker:
    """One process and the pipe to it; ``ready`` from its first word on, which says that it could start.

    One that is ``announcing`` writes a line on standard error when it compiles.
    """

    def __init__(self, announcing: bool) -> None:
        context = multiprocessing.get_context("spawn")
        self.ready = False
        self.pipe, far = context.Pipe()
        self.process = context.Process(target=_answer_calls, args=(far, announcing), daemon=True)
        with _interrupts_held():
            self.process.start()
        # Only the worker holds the far end now, so that its death ends the pipe.
        far.close()

    def ask(self, call: Call) -> tuple[bool, Any]:
        if not self.ready:
            self.ready = self.pipe.recv()
        self.pipe.send(call)
        fine, answer = self.pipe.recv()
        return fine, answer

    def end(self) -> int | None:
        self.pipe.close()
        self.process.join()
        return self.process.exitcode


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold back SIGINT from this thread and from a process that it starts, which inherits the mask.

    A terminal interrupts every process of its group. One that still imports would die of it with a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # it lets interrupts in again when it starts
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _answer_calls(pipe: Connection, announcing: bool) -> None:
    """Live as a worker: answer calls until the pipe or the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):  # what a worker starts can be interrupted again
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if announcing:
        announce_compiling()
    pipe.send(True)
    while True:
        try:
            call = pipe.recv()
        except (EOFError, OSError):
            return
        except Exception as error:  # what was sent cannot be imported here
            answer = (False, error)
        else:
            answer = _answer(*call)
        try:
            pipe.send(answer)
        except OSError:
            return
        except Exception as error:
            pipe.send((False, RuntimeError(f"the answer cannot be sent: {error}")))


def _answer(function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> tuple[bool, Any]:
    try:
        return True, function(*args, **kwargs)
    except Exception as error:
        error.add_note(f"in a worker process:\n{traceback.format_exc()}")
        return False, error


def _end_with_parent() -> None:
    """End a process whose parent was killed, even in the middle of a long call."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
