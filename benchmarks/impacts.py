"""What an impact costs the reference: impacts per second, and how the cost grows with their number.

    python benchmarks/impacts.py

Prints a table and writes ``benchmarks/results/impacts.json`` and ``impacts.png``.
"""

from __future__ import annotations

import json
import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import ode_reference
from slicemodel import Scenario

RESULTS = Path(__file__).resolve().parent / "results"
FULL = Scenario(water_mass=1.0, n_slices=100, drag=0.1)
HALF = Scenario().with_slices(100)


def measure(name: str, scenario: Scenario, **settings: Any) -> dict[str, Any]:
    """Return impacts and CPU seconds of one run, output at its end only."""
    began = time.process_time()
    run = ode_reference.solve(scenario, method="DOP853", rtol=1e-9, times=[scenario.duration], **settings)
    seconds = time.process_time() - began
    assert run.ok, run.message
    impacts = len(run.impacts) if run.impacts is not None else 0
    return {"case": name, "impacts": impacts, "seconds": round(seconds, 4), "per_second": round(impacts / seconds)}


def measure_all() -> dict[str, Any]:
    """Return the runs and the exponent with which their cost grows with the number of impacts."""
    free = {"model": "free-flight", "impact_law": "sequential", "rest_speed": 1e-3}
    measure("warm up", replace(FULL, duration=0.05), **free)
    growth = [
        measure(f"free-flight, full, T = {duration:g} s", replace(FULL, duration=duration), **free)
        for duration in (0.06, 0.08, 0.1, 0.15, 0.25, 0.5)
    ]
    others = [
        measure("eq8, full", FULL, model="eq8"),
        measure("eq8, half full", HALF, model="eq8"),
        measure("free-flight, half full", HALF, model="free-flight"),
    ]
    impacts, seconds = (np.array([row[key] for row in growth], dtype=float) for key in ("impacts", "seconds"))
    return {
        "exponent": float(np.polyfit(np.log(impacts), np.log(seconds), 1)[0]),
        "growth": growth,
        "runs": growth + others,
    }


def main() -> int:
    """Measure, print, write, draw."""
    facts = measure_all()
    for row in facts["runs"]:
        print(f"{row['case']:32} {row['impacts']:7d} impacts {row['seconds']:8.3f} s {row['per_second']:7d} /s")
    print(f"cost grows as impacts^{facts['exponent']:.2f}")
    RESULTS.mkdir(exist_ok=True)
    facts |= {"python": sys.version.split()[0], "cores": os.cpu_count()}
    (RESULTS / "impacts.json").write_text(json.dumps(facts, indent=1))
    impacts, seconds = (np.array([row[key] for row in facts["growth"]], dtype=float) for key in ("impacts", "seconds"))
    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    axes = figure.subplots()
    axes.loglog(impacts, seconds, "o-", label="free-flight, full bottle, sequential law")
    axes.loglog(impacts, impacts / 2000, ":", color="black", label="2000 impacts per second")
    axes.set_xlabel("impacts [1]")
    axes.set_ylabel("processor time [s]")
    axes.legend()
    figure.savefig(RESULTS / "impacts.png", dpi=150)
    return 0


if __name__ == "__main__":
    sys.exit(main())
