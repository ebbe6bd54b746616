"""Sweep a million points: killed twice and resumed on this machine, then through Dask with two workers.

    python benchmarks/sweep_million.py                   1e6 points of eq8, N = 20
    python benchmarks/sweep_million.py --points 100000

The first sweep is killed by SIGKILL at about a third and two thirds of its rows and goes on each time; the second goes
through a Dask scheduler undisturbed. Their rows must be equal in every column but ``seconds``, ``versions`` and the
checksum over them, and a thousand of them equal to their single runs, to the last bit. Memory of all processes of a
sweep is read some hundred times: what it grows by from a tenth of the rows to the end is printed. Writes
``benchmarks/results/sweep_million.json``; ends with status 1 if a row differs.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import sqlite3
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from sweep_cost import DESIGN
from sweep_kill import ROOT, alive_in_session, cluster, finish, start

from flipproof.sweep.design import from_parameters
from flipproof.sweep.work import make_point

SINGLE = 1000
"""Rows that are made again alone."""


def count(out: Path) -> int:
    """Return how many rows a sweep has; they are numbered in the order of the design, so the file knows at once."""
    try:
        with sqlite3.connect(f"file:{out / 'sweep.sqlite'}?mode=ro", uri=True, timeout=10) as rows:
            return int(rows.execute("SELECT count(*) FROM points").fetchone()[0])
    except sqlite3.Error:
        return 0


def memory(processes: list[int]) -> int:
    """Return the resident memory of processes together [bytes] (Linux)."""
    pages = 0
    for number in processes:
        try:
            pages += int(Path(f"/proc/{number}/statm").read_text().split()[1])
        except OSError:
            continue
    return pages * resource.getpagesize()


def watch(process: subprocess.Popen[str], out: Path, points: int, until: int, more: list[int]) -> list[tuple[int, int]]:
    """Wait until a sweep has so many rows or has ended; return rows and bytes of memory as time goes on."""
    seen: list[tuple[int, int]] = []
    while process.poll() is None and (there := count(out)) < until:
        seen.append((there, memory(alive_in_session(process.pid) + more)))
        time.sleep(max(0.1, points / 2e5))
    return seen


def told(seen: list[tuple[int, int]], begun: int, points: int) -> dict[str, float]:
    """Return memory at a tenth of the points after the beginning of a run and at its end [MB]."""
    settled = [bytes_ / 1e6 for there, bytes_ in seen if there >= begun + points / 10]
    facts = {"first": settled[0], "last": settled[-1], "most": max(settled)} if settled else {}
    return {name: round(number, 1) for name, number in facts.items()}


def differing(one: Path, other: Path) -> int:
    """Return how many rows of two sweeps are not equal, or are there only once."""
    with sqlite3.connect(one / "sweep.sqlite") as rows:
        rows.execute("ATTACH ? AS other", (str(other / "sweep.sqlite"),))
        names = [name for _, name, *_ in rows.execute("PRAGMA table_info(points)")]
        kept = ", ".join(name for name in names if name not in ("seconds", "versions", "checksum"))
        found = 0
        for here, there in (("main", "other"), ("other", "main")):
            query = f"SELECT count(*) FROM (SELECT {kept} FROM {here}.points EXCEPT SELECT {kept} FROM {there}.points)"
            found += int(rows.execute(query).fetchone()[0])
        return found


def unlike_single_runs(out: Path, points: int, chance: random.Random) -> int:
    """Return how many of some rows differ from their single runs in a bit of a result."""
    names = ("plateau", "omega_end", "theta_end", "r_cm_end", "t_end", "impacts", "status")
    found = 0
    with sqlite3.connect(out / "sweep.sqlite") as rows:
        for number in chance.sample(range(points), min(SINGLE, points)):
            query = f"SELECT parameters, {', '.join(names)} FROM points WHERE number = ?"
            text, *cells = rows.execute(query, (number,)).fetchone()
            alone = make_point(from_parameters(text))
            found += cells != [getattr(alone, name) for name in names]
    return found


def main() -> int:
    """Sweep, kill, compare, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1, help="of the moments of the kills, and of the rows made alone")
    options = parser.parse_args()
    points, chance = options.points, random.Random(options.seed)
    os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), str(ROOT / "reports")])
    facts: dict[str, Any] = {"points": points}
    with tempfile.TemporaryDirectory() as scratch:
        design, killed, dask = (Path(scratch, name) for name in ("sweep.toml", "killed", "dask"))
        design.write_text(DESIGN.format(samples=points), encoding="utf-8")
        for share in (chance.uniform(0.25, 0.4), chance.uniform(0.6, 0.75), None):
            begun = count(killed)
            process = start(design, killed)
            seen = watch(process, killed, points, round(share * points) if share else points, [])
            facts.setdefault("memory_MB", []).append(told(seen, begun, points))
            if share:
                process.kill()
                process.communicate()
                facts.setdefault("killed_at", []).append(count(killed))
            else:
                finish(process)
            print(f"{count(killed)} rows; memory {facts['memory_MB'][-1]} MB", flush=True)
        with cluster() as (address, workers):
            process = start(design, dask, "--dask", address)
            seen = watch(process, dask, points, points, [worker.pid for worker in workers])
            finish(process)
        facts["dask_memory_MB"] = told(seen, 0, points)
        facts["bytes_a_row"] = round((killed / "sweep.sqlite").stat().st_size / points, 1)
        print(f"through Dask: memory {facts['dask_memory_MB']} MB; {facts['bytes_a_row']} bytes a row", flush=True)
        facts["differing"] = differing(killed, dask)
        facts["unlike_single_runs"] = unlike_single_runs(killed, points, chance)
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    facts["processor_seconds"] = round(children.ru_utime + children.ru_stime)
    print(f"{facts['differing']} rows differ; {facts['unlike_single_runs']} of {SINGLE} differ from their single runs")
    results = ROOT / "benchmarks" / "results"
    results.mkdir(exist_ok=True)
    (results / "sweep_million.json").write_text(json.dumps(facts, indent=1))
    return 1 if facts["differing"] or facts["unlike_single_runs"] else 0


if __name__ == "__main__":
    sys.exit(main())
