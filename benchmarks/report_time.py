"""Wall time of ``flipproof report`` from a cold start: a new process and an empty compilation cache.

    python benchmarks/report_time.py            both sizes, once each
    python benchmarks/report_time.py --quick    the quick report only

Prints a table and writes ``benchmarks/results/report_time.json``.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
LIMITS = {"full": 120.0, "quick": 25.0}
"""Seconds on two cores that a report may take."""


def measure(arguments: list[str]) -> dict[str, Any]:
    """Return wall seconds, also stage by stage, and peak memory [MiB] of one report, and its exit status."""
    with tempfile.TemporaryDirectory() as scratch:
        environment = {**os.environ, "NUMBA_CACHE_DIR": f"{scratch}/numba", "MPLCONFIGDIR": f"{scratch}/matplotlib"}
        command = [sys.executable, "-m", "flipproof", "report", *arguments, "--out", f"{scratch}/report"]
        began = time.perf_counter()
        status = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, check=False).returncode
        seconds = time.perf_counter() - began
        stages = json.loads(Path(scratch, "report", "summary.json").read_text())["stages"]
        size = sum(file.stat().st_size for file in Path(scratch, "report").rglob("*") if file.is_file())
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return {"seconds": round(seconds, 2), "peak_MiB_one_process": round(peak), "report_MiB": round(size / 2**20, 1),
            "exit_status": status, "stages": stages}  # fmt: skip


def main() -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the quick report only")
    sizes = ["quick"] if parser.parse_args().quick else ["quick", "full"]
    results = {size: measure(["--quick"] if size == "quick" else []) for size in sizes}
    for size, result in results.items():
        print(f"{'':6} " + ", ".join(f"{name} {seconds:.1f} s" for name, seconds in result["stages"].items()))
        print(f"{size:6} {result['seconds']:7.1f} s of {LIMITS[size]:.0f} s, exit status {result['exit_status']:.0f}")
    place = ROOT / "benchmarks" / "results"
    place.mkdir(exist_ok=True)
    facts = {"cores": os.cpu_count(), "python": sys.version.split()[0], "results": results}
    (place / "report_time.json").write_text(json.dumps(facts, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
