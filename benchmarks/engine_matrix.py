"""Certified engine against event-driven free flight on 72 throws: how far apart they are, whether the bands hold.

    python benchmarks/engine_matrix.py                       all of them; half an hour of processor time
    python benchmarks/engine_matrix.py --jobs 2              in two processes
    python benchmarks/engine_matrix.py --slices 2 10         a part; --restitution, --bottle, --drag likewise
    python benchmarks/engine_matrix.py --drag dry --hits located   pymunk's hybrid, without drag

Prints a table and writes ``benchmarks/results/engine_matrix.json``. Both solve the simultaneous law of impact. The band
of free flight is what a tenth of its rest speed changes; the engine's is its certificate's. Status 1 if a throw misses.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np

import engine_check
import ode_reference
from slicemodel import Bottle, Scenario

RESULTS = Path(__file__).resolve().parent / "results"
TARGET: Final = 3e-3
"""Largest admissible difference of omega, fraction of omega_0."""

SHARE: Final = 0.95
"""Least share of output times at which the difference lies within the two bands together."""

SLICES: Final = (2, 10, 20, 50)
RESTITUTIONS: Final = (0.0, 0.35, 0.5)
BOTTLES: Final = {
    "paper": (Bottle(), 0.5),
    "small": (Bottle(length=0.22, radius=0.033, mass=0.024, capacity=0.75), 0.3),
    "light": (Bottle(length=0.30, radius=0.045, mass=0.05, capacity=1.5), 0.15),
}
"""Bottle and water [kg]: the paper's throw, a small bottle, and one that holds little."""

TIMES: Final = np.linspace(0.0, 0.5, 501)


def cases(arguments: argparse.Namespace) -> Iterator[tuple[str, Scenario]]:
    """Yield the throws asked for by name."""
    for n, e, drag, name in product(arguments.slices, arguments.restitution, arguments.drag, arguments.bottle):
        bottle, water = BOTTLES[name]
        throw = Scenario(bottle=bottle, water_mass=water, restitution=e).with_slices(n)
        yield f"{name}, N = {n}, e = {e:g}, {drag}", throw if drag == "drag" else replace(throw, drag=0.0)


def compare(case: tuple[str, Scenario, str, str | None]) -> dict[str, Any]:
    """Return what one throw gives: the certificate's words and numbers, the difference, and how the bands hold it."""
    name, throw, engine, hits = case
    omega0 = abs(throw.omega0)
    usual, tighter = (
        ode_reference.solve(throw, model="free-flight", times=TIMES, rest_speed=speed) for speed in (1e-3, 1e-4)
    )
    began = time.process_time()
    found = engine_check.certify(throw, engine, times=TIMES, hits=hits)
    seconds = time.process_time() - began
    row = {
        "case": name,
        "status": found.status,
        "reason": found.reason,
        "hits": found.settings["hits"],
        "dt": found.settings["dt"],
        "steps": found.steps,
        "seconds": round(seconds, 2),
        "order": found.order if np.isfinite(found.order) else None,
        "reference_band": float(np.max(np.abs(usual.omega - tighter.omega)) / omega0),
    }
    if len(found.trajectory.t) < len(TIMES):
        return row | {"difference": None, "band": None, "within": None}
    difference = np.abs(found.trajectory.omega - tighter.omega) / omega0
    within = float(np.mean(difference <= found.band + row["reference_band"]))
    return row | {"difference": float(difference.max()), "band": found.largest_band, "within": within}


def misses(row: dict[str, Any]) -> list[str]:
    """Return which of the targets a throw misses."""
    return [
        words
        for words, met in (
            ("apart", row["difference"] is not None and row["difference"] <= TARGET),
            ("band", row["within"] is not None and row["within"] >= SHARE),
            ("not certified", row["status"] == "certified"),
        )
        if not met
    ]


def tell(row: dict[str, Any]) -> str:
    """Return one line of the table."""
    numbers = [
        "     nan" if row[name] is None else f"{row[name]:8.1e}" for name in ("difference", "band", "reference_band")
    ]
    within = "  nan" if row["within"] is None else f"{row['within']:5.3f}"
    words = f"{row['case']:28} {row['status']:14} {row['hits']:8} {row['dt']:7.1e} {' '.join(numbers)} {within}"
    return f"{words} {row['steps']:7d} {row['seconds']:6.1f}  {', '.join(misses(row))}".rstrip()


def parse() -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", choices=list(engine_check.ENGINES), default="pymunk")
    parser.add_argument("--slices", type=int, nargs="+", choices=SLICES, default=SLICES)
    parser.add_argument("--restitution", type=float, nargs="+", choices=RESTITUTIONS, default=RESTITUTIONS)
    parser.add_argument("--drag", nargs="+", choices=("drag", "dry"), default=("drag", "dry"))
    parser.add_argument("--bottle", nargs="+", choices=list(BOTTLES), default=list(BOTTLES))
    parser.add_argument("--hits", choices=("grid", "located"), help="how hits are answered (default: the engine's own)")
    parser.add_argument("--jobs", type=int, default=1, help="worker processes")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    return parser.parse_args()


def main() -> int:
    """Compare, print, write."""
    arguments = parse()
    jobs = [(name, throw, arguments.engine, arguments.hits) for name, throw in cases(arguments)]
    print(
        f"{'throw':28} {'status':14} {'hits':8} {'dt':7} {'apart':>8} {'band':>8} {'of ODE':>8} within   steps      s"
    )
    rows = []
    with ProcessPoolExecutor(max(1, arguments.jobs)) as pool:
        for row in pool.map(compare, jobs):
            rows.append(row)
            print(tell(row), flush=True)
    counts = {
        "throws": len(rows),
        "certified": sum(row["status"] == "certified" for row in rows),
        "certified_but_apart": sum(row["status"] == "certified" and "apart" in misses(row) for row in rows),
        "within_target": sum("apart" not in misses(row) for row in rows),
        "within_bands": sum("band" not in misses(row) for row in rows),
    }
    print(", ".join(f"{name.replace('_', ' ')}: {count}" for name, count in counts.items()))
    facts = {"python": sys.version.split()[0], "cores": os.cpu_count(), "engine": arguments.engine, "target": TARGET}
    arguments.out.mkdir(parents=True, exist_ok=True)
    text = json.dumps({**facts, **counts, "runs": rows}, indent=1, allow_nan=False)
    (arguments.out / "engine_matrix.json").write_text(text, encoding="utf-8")
    return int(counts["within_target"] < len(rows) or counts["within_bands"] < len(rows))


if __name__ == "__main__":
    sys.exit(main())
