"""The loop of a sweep: every point exactly once, whatever its workers do; and the workers themselves."""

import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection

import pytest

from flipproof.frame.pool import Here
from flipproof.frame.processes import Processes, WorkerDiedError
from flipproof.sweep import run
from flipproof.sweep.design import design_of
from flipproof.sweep.errors import SweepError
from flipproof.sweep.run import (
    DEATHS_IN_A_ROW,
    GROWTH,
    LONE_DEATHS,
    MOST_BYTES,
    Line,
    Workers,
    local_workers,
    run_sweep,
)
from flipproof.sweep.store import Store
from flipproof.sweep.work import Outcome, Returned

CODE = "0.1.0+test"


def design(throws, solvers=2, trajectories=False):
    document = {
        "sweep": {
            "design": "grid",
            "trajectories": trajectories,
            "fields": {"omega0": {"from": 1.0, "to": 2.0, "count": throws}},
        },
        "solvers": [{"name": "eq8", "method": "DOP853", "rtol": 10.0**-k} for k in range(4, 4 + solvers)],
    }
    return design_of(document, "sweep.toml")


def quick(code, points, keep, curves):
    """Stand in for ``make_batch``: every point succeeds in a millisecond."""
    del keep, curves
    numbers = dict.fromkeys(("plateau", "omega_end", "theta_end", "r_cm_end", "t_end"), 0.5)
    outcomes = [Outcome(**numbers, number=point.number, impacts=1, status="ok") for point in points]
    return Returned(code, {}, outcomes, 0.001 * len(points))


class Inline(Here):
    """Makes a call in this process, unless ``fault`` has an exception for its points."""

    def __init__(self, fault=lambda points: None):  # noqa: ARG005
        self.fault, self.batches = fault, []

    def submit(self, fn, /, code, points, *kept):
        self.batches.append([point.number for point in points])
        error = self.fault(points)
        return super().submit(fail, error) if error else super().submit(fn, code, points, *kept)


def fail(error):
    raise error


def sweep(folder, executor, throws=50, capacity=lambda: 3, solvers=2):
    """Run a sweep of quick points and return (status, reason) by number."""
    progress = []
    with Store(folder, design(throws, solvers), CODE) as store:
        there = sum(store.done())
        workers = Workers(executor=executor, capacity=capacity, died=(WorkerDiedError,))
        run_sweep(store, workers, lambda points, unfinished: progress.append((points, unfinished)))
        rows = store.connection.execute("SELECT number, status, reason FROM points ORDER BY number").fetchall()
    assert sum(points for points, _ in progress) == len(rows) - there
    if not there:
        assert sum(unfinished for _, unfinished in progress) == sum(status != "ok" for _, status, _ in rows)
    return {number: (status, reason) for number, status, reason in rows}


@pytest.fixture
def _quick(monkeypatch):
    monkeypatch.setattr(run, "make_batch", quick)


@pytest.mark.usefixtures("_quick")
def test_every_point_is_made_once(tmp_path):
    executor = Inline()
    rows = sweep(tmp_path, executor)
    assert list(rows) == list(range(100))
    assert sorted(number for batch in executor.batches for number in batch) == list(range(100))
    # Solvers take turns: no batch mixes them, and neither is far ahead.
    solvers = [batch[0] // 50 for batch in executor.batches]
    assert all(len({number // 50 for number in batch}) == 1 for batch in executor.batches)
    assert solvers[:2] == [0, 1]
    again = Inline()
    assert sweep(tmp_path, again) == rows
    assert again.batches == []


@pytest.mark.usefixtures("_quick")
def test_batches_grow_to_their_time_and_shrink_towards_the_end(tmp_path):
    executor = Inline()
    sweep(tmp_path, executor, throws=5000, solvers=1, capacity=lambda: 2)
    sizes = [len(batch) for batch in executor.batches]
    assert sizes[0] == 1
    assert all(later <= GROWTH * max(sizes[: k + 1]) for k, later in enumerate(sizes[1:]))
    assert max(sizes) == 400
    assert sizes[-1] == 1


def test_a_batch_of_flights_is_bounded_in_bytes():
    class Big:
        nbytes = MOST_BYTES // 3

    line = Line(iter(()), 10, 10, size=10)
    line.learn(Returned(CODE, {}, [Outcome(number=k, status="ok", arrays={"r": Big()}) for k in range(10)], 1e-3))
    assert line.size == 3


@pytest.mark.usefixtures("_quick")
def test_no_more_is_in_flight_than_the_workers_can_hold(tmp_path):
    lock, counts = threading.Lock(), {"now": 0, "most": 0}

    class Counting(ThreadPoolExecutor):
        def submit(self, fn, /, *args, **kwargs):
            with lock:
                counts["now"] += 1
                counts["most"] = max(counts["most"], counts["now"])
            future = super().submit(fn, *args, **kwargs)
            future.add_done_callback(self.count_down)
            return future

        @staticmethod
        def count_down(_):
            with lock:
                counts["now"] -= 1

    with Counting(2) as executor:
        assert len(sweep(tmp_path, executor, throws=3000, capacity=lambda: 3)) == 6000
    assert 1 <= counts["most"] <= 3


@pytest.mark.usefixtures("_quick")
def test_a_point_that_kills_its_worker_becomes_a_row_and_takes_no_other_with_it(tmp_path):
    poison = {17, 18, 63}

    def fault(points):
        return WorkerDiedError("exit code -9") if poison & {point.number for point in points} else None

    executor = Inline(fault)
    rows = sweep(tmp_path, executor)
    assert {number for number, (status, _) in rows.items() if status == "worker-died"} == poison
    assert len(rows) == 100
    for number in poison:
        assert rows[number][1] == f"the worker died {LONE_DEATHS} times with this point alone in it (exit code -9)"
        assert executor.batches.count([number]) == LONE_DEATHS


@pytest.mark.usefixtures("_quick")
def test_a_worker_killed_from_outside_costs_no_point(tmp_path):
    deaths = iter([None, None, None, WorkerDiedError("exit code -9"), None, WorkerDiedError("exit code -9")])
    rows = sweep(tmp_path, Inline(lambda _: next(deaths, None)))
    assert {status for status, _ in rows.values()} == {"ok"}
    assert len(rows) == 100


@pytest.mark.usefixtures("_quick")
def test_workers_that_always_die_end_the_sweep_and_not_every_point(tmp_path):
    with pytest.raises(SweepError, match=r"workers die whatever they are given \(exit code 1\)"):
        sweep(tmp_path, executor := Inline(lambda _: WorkerDiedError("exit code 1")), throws=500)
    assert DEATHS_IN_A_ROW < len(executor.batches) < 2 * DEATHS_IN_A_ROW


@pytest.mark.usefixtures("_quick")
def test_a_lost_connection_ends_the_sweep_and_keeps_its_rows(tmp_path):
    calls = iter(range(100))
    executor = Inline(lambda _: ConnectionError("scheduler gone") if next(calls) == 4 else None)
    with pytest.raises(SweepError, match=r"cannot go on \(scheduler gone\).*the same command goes on"):
        sweep(tmp_path, executor)
    with Store(tmp_path, design(50), CODE) as store:
        # What came back beside the error was stored too.
        assert sum(store.done()) == sum(map(len, executor.batches)) - len(executor.batches[4]) > 3
    assert len(sweep(tmp_path, Inline())) == 100


@pytest.mark.usefixtures("_quick")
def test_waiting_for_workers_has_an_end(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "PATIENCE", 0.05)
    monkeypatch.setattr(run, "TICK", 0.01)
    with pytest.raises(SweepError, match="no worker is left"):
        sweep(tmp_path, Inline(), capacity=lambda: 0)
    capacities = iter([0, 0, 3, 0])
    assert len(sweep(tmp_path, Inline(), capacity=lambda: next(capacities, 3))) == 100


def test_a_worker_of_other_code_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "make_batch", lambda *_: Returned("0.9.0+other", {}, [], 0.1))
    with pytest.raises(SweepError, match=r"a worker runs flipproof 0\.9\.0\+other, this is 0\.1\.0\+test"):
        sweep(tmp_path, Inline())


# ---------------------------------------------------------------------- processes of this machine


def test_a_dead_process_breaks_its_own_call_only_and_is_replaced():
    executor = Processes(2)
    try:
        slow, first = executor.submit(time.sleep, 0.5), executor.submit(os.getpid)
        process = first.result(timeout=60)
        killed = [executor.submit(os._exit, 3), executor.submit(os.kill, 0, 0)]
        assert slow.result(timeout=60) is None
        with pytest.raises(WorkerDiedError, match="exit code 3"):
            killed[0].result(timeout=60)
        assert killed[1].result(timeout=60) is None
        seen = {executor.submit(os.getpid).result(timeout=60) for _ in range(4)}
        assert process != os.getpid()
        assert len(seen) <= 2
    finally:
        executor.kill()


def die_while_sending():
    """End this process when it has sent the first kilobyte of its answer."""

    def write(pipe, message):
        sent = os.write(pipe, message[:1000])
        if len(message) > 1000:
            os.kill(os.getpid(), signal.SIGKILL)
        return sent

    Connection._send.__defaults__ = (write,)
    return bytes(100_000)


def test_a_process_killed_while_it_sends_is_noticed():
    executor = Processes(1)
    try:
        with pytest.raises(WorkerDiedError, match="exit code -9"):
            executor.submit(die_while_sending).result(timeout=60)
        assert executor.submit(max, 1, 2).result(timeout=60) == 2
    finally:
        executor.kill()


def test_an_error_in_a_call_is_the_futures_and_not_the_workers():
    with Processes(1) as executor:
        process = executor.submit(os.getpid)
        with pytest.raises(ZeroDivisionError):
            executor.submit(divmod, 1, 0).result(timeout=60)
        with pytest.raises(RuntimeError, match="the answer cannot be sent"):
            executor.submit(memoryview, b"x").result(timeout=60)
        with pytest.raises(EOFError):
            executor.submit(input).result(timeout=60)
        assert executor.submit(os.getpid).result(timeout=60) == process.result()
    with pytest.raises(RuntimeError, match="ended"):
        executor.submit(os.getpid)


def begin_and_sleep(mark):
    mark.touch()
    time.sleep(1000)


def test_leaving_ends_processes_in_the_middle_of_their_calls(tmp_path):
    with local_workers(1) as workers:
        process = workers.executor.submit(os.getpid).result(timeout=60)
        endless = workers.executor.submit(begin_and_sleep, tmp_path / "begun")
        waiting = workers.executor.submit(time.sleep, 1000)
        while not (tmp_path / "begun").exists():
            time.sleep(0.01)
        assert workers.capacity() == 1
    with pytest.raises(WorkerDiedError):
        endless.result(timeout=60)
    assert waiting.cancelled()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
