"""Kill a sweep ten times over, and hold its rows against an undisturbed run.

    python benchmarks/sweep_kill.py                      5 000 points, ten kills, then the same through Dask
    python benchmarks/sweep_kill.py --points 500 --seed 2

Every kill is SIGKILL at a random moment: two in start-up, eight in the work, the writing of rows included. Through
Dask two workers begin; one is killed midway. Rows must agree to the last bit. Prints a table, writes
``benchmarks/results/sweep_kill.json``, and ends with status 1 if a row differs or a process outlives its parent.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
KILLS = "swwwwswwww"

DESIGN = """\
[scenario]
duration = 0.05
n_slices = 4

[sweep]
design = "latin-hypercube"
samples = {samples}
seed = 7

[sweep.fields]
fill_fraction = {{from = 0.1, to = 1.05}}
damping_rate = {{from = 0.1, to = 100.0, scale = "log"}}
restitution = {{from = 0.0, to = 1.0}}
bottle.length = {{from = 0.2, to = 0.3}}

[[solvers]]
name = "exact-step"
steps = 50

[[solvers]]
name = "eq8"
method = "DOP853"
rtol = 1e-6
atol = 1e-9
max_step = 0.01
"""
"""Cheap throws; one in twenty is impossible, with more water than the bottle holds."""


def start(design: Path, out: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start a sweep in a session of its own."""
    command = [sys.executable, "-m", "flipproof", "sweep", str(design), "--out", str(out), *arguments]
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, cwd=ROOT, start_new_session=True, **pipes)


def finish(process: subprocess.Popen[str]) -> str:
    """Wait for a sweep and return its line; anything but success ends this program."""
    out, err = process.communicate()
    if process.returncode != 0:
        sys.exit(f"the sweep failed with status {process.returncode}: {err}")
    return out.strip()


def rows(out: Path) -> list[tuple[Any, ...]]:
    """Return key, what was asked and what came of it, row by row."""
    file = out / "sweep.sqlite"
    if not file.exists():
        return []
    connection = sqlite3.connect(file, timeout=10)
    try:
        return connection.execute("SELECT key, asked, answer FROM made ORDER BY key").fetchall()
    except sqlite3.OperationalError:  # its tables are not there yet
        return []
    finally:
        connection.close()


def alive_in_session(session: int) -> list[int]:
    """Return the processes of a session that still run (Linux)."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            state, _, _, its_session = (place / "stat").read_text().rpartition(")")[2].split()[:4]
        except (OSError, ValueError):
            continue
        if int(its_session) == session and state != "Z":
            found.append(int(place.name))
    return found


def left_over(session: int) -> list[int]:
    """Return the processes of a session that have not ended within a minute of their parent."""
    deadline = time.monotonic() + 60.0
    while (left := alive_in_session(session)) and time.monotonic() < deadline:
        time.sleep(0.05)
    return left


def wait_for_rows(process: subprocess.Popen[str], out: Path, more_than: int) -> int:
    """Wait until a running sweep has stored more rows than that, or has ended; return how many."""
    while (count := len(rows(out))) <= more_than and process.poll() is None:
        time.sleep(0.02)
    return count


def killed(design: Path, out: Path, kills: str, work: float, chance: random.Random) -> list[dict[str, Any]]:
    """Kill the sweep at random moments, one for each letter of ``kills``; then let it end.

    "s" falls within two seconds of the start; "w" in the work, up to three equal parts of ``work`` [s] after
    the first new row.
    """
    told: list[dict[str, Any]] = []
    for kill in kills:
        there = len(rows(out))
        process = start(design, out)
        if kill == "s":
            moment = chance.uniform(0.0, 2.0)
        else:
            wait_for_rows(process, out, there)
            moment = chance.uniform(0.0, 3.0 * work / len(kills))
        try:
            process.communicate(timeout=moment)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
        left = left_over(process.pid)
        count = len(rows(out))
        was_killed = process.returncode == -signal.SIGKILL
        told.append({"killed": was_killed, "rows_before": there, "rows": count, "outlived": len(left)})
        since = "start" if kill == "s" else "first new row"
        print(f"  {'killed' if was_killed else 'ended '} {moment:5.2f} s after {since:13}: {count:5d} rows")
    print(f"  {finish(start(design, out))}")
    return told


@contextmanager
def cluster() -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Give a real scheduler's address and its two workers, each a process with one thread and no nurse."""
    quiet: dict[str, Any] = {"cwd": ROOT, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "distributed.cli.dask_"]
    processes: list[subprocess.Popen[bytes]] = []
    with tempfile.TemporaryDirectory() as place:
        file = Path(place, "scheduler.json")
        scheduler = [*dask[:-1], f"{dask[-1]}scheduler", "--host", "tcp://127.0.0.1:0", "--scheduler-file", str(file)]
        try:
            processes.append(subprocess.Popen([*scheduler, "--no-dashboard"], **quiet))
            while not file.exists() or not file.stat().st_size:  # written when it listens, on a port that was free
                if processes[0].poll() is not None:
                    sys.exit(f"the scheduler ended with status {processes[0].returncode}")
                time.sleep(0.05)
            address = json.loads(file.read_text())["address"]
            worker = [*dask[:-1], f"{dask[-1]}worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
            processes += [subprocess.Popen(worker, **quiet) for _ in range(2)]
            yield address, processes[1:]
        finally:
            for process in processes:
                process.kill()
                process.wait()


def through_dask(design: Path, out: Path, points: int, wanted: int) -> dict[str, Any]:
    """Run the sweep through Dask and kill one of two workers when ``wanted`` of its points have rows."""
    with cluster() as (address, workers):
        process = start(design, out, "--executor", f"distributed:Client@{address}")
        while process.poll() is None and len(rows(out)) < wanted:
            time.sleep(0.05)
        there = len(rows(out))
        workers[0].kill()
        line = finish(process)
    print(f"  one of two workers killed at {there} rows\n  {line}")
    return {"killed_at_rows": there, "midway": 0 < there < points}


def main() -> int:
    """Run, kill, compare, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=5000, help="points of the sweep, both solvers together")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    parser.add_argument("--no-dask", action="store_true")
    options = parser.parse_args()
    os.environ["PYTHONPATH"] = str(ROOT)
    chance = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as scratch:
        design, place = Path(scratch, "sweep.toml"), Path(scratch)
        design.write_text(DESIGN.format(samples=options.points // 2))
        print("undisturbed")
        process = start(design, place / "undisturbed")
        wait_for_rows(process, place / "undisturbed", 0)
        began = time.perf_counter()
        print(f"  {finish(process)}")
        work = time.perf_counter() - began
        expected = rows(place / "undisturbed")
        print("killed")
        facts: dict[str, Any] = {"points": len(expected), "work_seconds": round(work, 1), "seed": options.seed}
        facts["kills"] = killed(design, place / "killed", KILLS, work, chance)
        facts["killed_differs"] = sum(a != b for a, b in zip(expected, rows(place / "killed"), strict=True))
        if not options.no_dask:
            print("Dask")
            facts["dask"] = through_dask(
                design, place / "dask", len(expected), round(len(expected) * chance.uniform(0.25, 0.75))
            )
            facts["dask_differs"] = sum(a != b for a, b in zip(expected, rows(place / "dask"), strict=True))
    differing = facts["killed_differs"] + facts.get("dask_differs", 0)
    outlived = sum(kill["outlived"] for kill in facts["kills"])
    print(f"{differing} of {len(expected)} rows differ; {outlived} processes outlived their parent")
    results = ROOT / "benchmarks" / "results"
    results.mkdir(exist_ok=True)
    (results / "sweep_kill.json").write_text(json.dumps(facts, indent=1))
    return 1 if differing or outlived else 0


if __name__ == "__main__":
    sys.exit(main())
