"""A report's runs made by worker processes that may die."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from flipproof.frame import pool
from flipproof.frame.flights import Call
from flipproof.frame.pool import COSTS, TRIES, make_all, workers
from flipproof.frame.processes import Processes, WorkerDiedError
from flipproof.frame.solvers import Run
from slicemodel import Scenario


def die_the_first_time(mark: Path) -> int:
    """End this process, unless a process before it did so."""
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def die_with_run_2(runs):
    """Make runs as ``make_each`` does, but die with the run labelled "2"."""
    if any(run.label == "2" for run in runs):
        os.kill(os.getpid(), signal.SIGKILL)
    return [pool.make(run) for run in runs]


def test_a_call_whose_worker_died_once_is_made_again(tmp_path):
    with workers(1) as processes:
        assert processes.submit(die_the_first_time, tmp_path / "mark").result(timeout=300) != os.getpid()
        with pytest.raises(WorkerDiedError, match="exit code -9"):
            processes.submit(_always_die).result(timeout=300)
        assert processes.submit(max, 1, 2).result(timeout=300) == 2


def _always_die():
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="interrupts cannot be held back here")
def test_a_worker_that_still_starts_does_not_die_of_an_interrupt():
    # A terminal interrupts every process of its group, those that still import among them.
    with Processes(1) as processes:
        future = processes.submit(os.getpid)
        while not (children := multiprocessing.active_children()):
            time.sleep(0.001)
        for _ in range(10):
            os.kill(children[-1].pid, signal.SIGINT)
            time.sleep(0.01)
        assert future.result(timeout=300) == children[-1].pid
        assert processes.submit(signal.pthread_sigmask, signal.SIG_BLOCK, ()).result(timeout=300) == set()


def test_only_the_run_that_kills_its_worker_is_lost_and_the_order_stays(monkeypatch):
    monkeypatch.setattr(pool, "make_each", die_with_run_2)
    runs = [Run("eq8", Scenario(n_slices=n, duration=0.02), label=f"{n}") for n in (1, 2, 3)]
    with workers(2) as processes:
        made, _ = make_all(processes, runs, lambda *_: None)
    assert list(made) == runs
    assert [result.trajectory is None for result in made.values()] == [False, True, False]
    assert made[runs[1]].reason == f"the worker process died {TRIES} times with this run (exit code -9)"


def test_a_script_whose_workers_would_begin_it_anew_is_told_so(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "from flipproof.frame.pool import make_all, workers\n"
        "from flipproof.frame.solvers import Run\n"
        "from slicemodel import Scenario\n"
        "with workers(2) as pool:\n"
        "    make_all(pool, [Run('eq8', Scenario(n_slices=n)) for n in range(1, 50)], lambda *_: None)\n"
    )
    ended = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=300, check=False)
    assert ended.returncode == 1
    assert 'begin its work below `if __name__ == "__main__":`' in ended.stderr.splitlines()[-1]


def test_progress_counts_calls_that_are_done_while_runs_are_still_made():
    """Calls are heard when they end, not with the next run; what is planned is what all of it costs."""
    shown = []
    calls = [Call(pow, (2, k), f"call {k}") for k in range(3)]
    with ThreadPoolExecutor(1) as threads:
        make_all(threads, [Run("exact-step", Scenario(n_slices=2))], lambda *report: shown.append(report), calls)
    assert [planned for _, planned, _ in shown] == [3 * COSTS["call"] + COSTS["quick"]] * 4
    assert sorted(label for *_, label in shown) == ["call 0", "call 1", "call 2", "exact-step"]
    assert [done for done, *_ in shown] == sorted(done for done, *_ in shown)
    assert shown[-1][0] == shown[-1][1]


def test_progress_moves_without_any_run():
    shown = []
    with ThreadPoolExecutor(1) as threads:
        make_all(threads, [], lambda *report: shown.append(report), [Call(pow, (2, 3), "power")])
    assert shown == [(COSTS["call"], COSTS["call"], "power")]
