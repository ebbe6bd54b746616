"""What the reduced flow costs: per impact, against DOP853, with the number of impacts, in batches, and to compile.

    python benchmarks/flow.py [--batch 10000]

Times are processor times; ratios are taken within this process, the two sides in turns. Prints a table and writes
``benchmarks/results/flow.json``.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from flow_agreement import impacts_of

import ode_reference
from slicemodel.scenario import Scenario

RESULTS = Path(__file__).resolve().parent / "results"
REPEATS = 5


def seconds(work: Callable[[], Any]) -> float:
    """Return the processor time of one call [s]."""
    began = time.process_time()
    work()
    return time.process_time() - began


def row(n: int, model: str, scenario: Scenario, *, against: bool) -> dict[str, Any]:
    """Return one line of the table; ``against`` DOP853 as it is by default."""
    times = [scenario.duration]
    run = ode_reference.solve(scenario, model, times)
    ours, theirs = [], []
    for k in range(REPEATS):
        ours.append(seconds(lambda: ode_reference.solve(scenario, model, times)))
        if against and k < 2:
            theirs.append(seconds(lambda: ode_reference.solve(scenario, model, times, method="DOP853")))
    impacts, cost = len(impacts_of(run)), float(np.median(ours))
    return {
        "slices": n,
        "model": model,
        "duration": scenario.duration,
        "impacts": impacts,
        "milliseconds": round(1e3 * cost, 4),
        "microseconds_per_impact": round(1e6 * cost / impacts, 3),
        "impacts_per_second": round(impacts / cost),
        "times_DOP853": round(float(np.median(theirs)) / cost) if theirs else None,
        "status": run.status,
    }


def runs(*slices: int) -> list[dict[str, Any]]:
    """Return the lines for the paper's throw at these numbers of slices, and print them."""
    ode_reference.solve(Scenario(n_slices=5))
    found = []
    for n in slices:
        for model in ("eq8", "free-flight"):
            found.append(row(n, model, Scenario().with_slices(n), against=20 <= n <= 100))
            print(found[-1], flush=True)
    return found


def growth() -> dict[str, Any]:
    """Return the exponent of cost in the number of impacts, to a million, and the drift of energy there."""
    scenario = replace(Scenario(water_mass=1.0).with_slices(1000), drag=0.0, restitution=1.0)
    points = []
    for duration in (4.0, 16.0, 64.0, 256.0):
        longer = replace(scenario, duration=duration)
        began = time.process_time()
        run = ode_reference.solve(longer, "free-flight", [duration], rest_speed=1e-8, energy=True)
        spent = time.process_time() - began
        ledger = run.diagnostics["energy"]
        impacts = len(impacts_of(run))
        points.append((impacts, spent, ledger["final"] / ledger["initial"] - 1, run.status))
        if impacts > 1e6:
            break
    counts, costs = (np.log([point[k] for point in points]) for k in (0, 1))
    return {"points": points, "exponent": float(np.polyfit(counts, costs, 1)[0])}


def batch(count: int) -> dict[str, Any]:
    """Return what ``count`` throws of eq8 at N = 50 cost on all cores."""
    rng = np.random.default_rng(0)
    throws = [
        replace(Scenario(), omega0=float(w), theta0=float(a)).with_slices(50)
        for w, a in zip(rng.uniform(10, 25, count), rng.uniform(0.5, 2.5, count), strict=True)
    ]
    began, wall = time.process_time(), time.perf_counter()
    found = ode_reference.solve_batch(throws, "eq8", np.linspace(0, 0.5, 100))
    return {
        "throws": count,
        "wall_seconds": round(time.perf_counter() - wall, 2),
        "processor_seconds": round(time.process_time() - began, 2),
        "cores": len(os.sched_getaffinity(0)),
        "ok": sum(flown.ok for flown in found),
        "impacts": sum(len(impacts_of(flown)) for flown in found),
    }


def first_calls() -> dict[str, float]:
    """Return the processor seconds of a process that solves one throw, with an empty and with a filled cache."""
    code = (
        "import time; from slicemodel import Scenario; import ode_reference\n"
        "began = time.process_time(); ode_reference.solve(Scenario(n_slices=5)); print(time.process_time() - began)"
    )
    with tempfile.TemporaryDirectory() as place:
        environment = {**os.environ, "NUMBA_CACHE_DIR": place}
        spent = [
            float(subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True).stdout)
            for _ in range(2)
        ]
    return {"compile": round(spent[0], 2), "cached": round(spent[1], 2)}


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--batch", type=int, default=10_000)
    asked = parser.parse_args()
    found: dict[str, Any] = {"first_calls": first_calls()}
    print(found["first_calls"], flush=True)
    found["runs"] = runs(10, 20, 50, 100, 1000, 10_000)
    found["growth"] = growth()
    print(found["growth"], flush=True)
    found["batch"] = batch(asked.batch)
    print(found["batch"], flush=True)
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "flow.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
