"""Time of ``flipproof report``: with an empty store of runs and with the one that it leaves, kernels compiled.

    python benchmarks/report_time.py                 both sizes, each with an empty and with a filled store
    python benchmarks/report_time.py --quick         the quick report only
    python benchmarks/report_time.py --cold          numba's cache is empty, too, at the first of them

Wall time says what a user waits on this machine now; processor time, of all processes together, says what the report
costs whatever else the machine does. The published program (N = 100, P = 1000) is timed before and after each report,
in processor time: its ratio to half the report's processor time is that of a machine with two idle cores, if both
are busy all the time. Prints a table and writes ``benchmarks/results/report_time.json``.
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
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from kernel import published

from slicemodel import Scenario

ROOT = Path(__file__).resolve().parent.parent
LIMITS = {
    ("full", "empty"): (90, 900),
    ("full", "filled"): (40, 400),
    ("quick", "empty"): (25, 250),
    ("quick", "filled"): (12, 250),
}
"""What a report may take where the published program takes 0.1 s [s], and in times of that program."""


def published_seconds() -> float:
    """Return the processor time of the published program: the median of seven runs [s]."""
    scenario, spent = Scenario().with_slices(100), []
    for _ in range(7):
        began = time.process_time()
        published(scenario, 1000)
        spent.append(time.process_time() - began)
    return sorted(spent)[3]


def measure(arguments: list[str], environment: dict[str, str]) -> dict[str, Any]:
    """Return wall and processor seconds of one report, what it says of stages and store, and its exit status."""
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, "-m", "flipproof", "report", *arguments, "--out", f"{scratch}/report"]
        before, used, began = published_seconds(), resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        process = subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, check=False)
        seconds, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
        program = (before + published_seconds()) / 2
        summary = json.loads(Path(scratch, "report", "summary.json").read_text())
        size = sum(file.stat().st_size for file in Path(scratch, "report").rglob("*") if file.is_file())
    processor = after.ru_utime + after.ru_stime - used.ru_utime - used.ru_stime
    return {
        "seconds": round(seconds, 2),
        "processor_seconds": round(processor, 2),
        "published_seconds": round(program, 4),
        "ratio": round(processor / 2 / program),
        "from_the_store": summary["provenance"]["from the store"],
        "report_MiB": round(size / 2**20, 1),
        "exit_status": process.returncode,
        "stages": summary["stages"],
    }


def measure_all(sizes: Sequence[str], *, cold: bool = False) -> dict[tuple[str, str], dict[str, Any]]:
    """Measure each size with an empty store and with the one that it leaves; print what came."""
    results: dict[tuple[str, str], dict[str, Any]] = {}
    with tempfile.TemporaryDirectory() as scratch:
        environment = dict(os.environ)
        if cold:
            environment |= {"NUMBA_CACHE_DIR": f"{scratch}/numba", "MPLCONFIGDIR": f"{scratch}/matplotlib"}
        else:
            environment.setdefault("MPLCONFIGDIR", str(Path.home() / ".config" / "matplotlib"))
        for size in sizes:
            environment["XDG_CACHE_HOME"] = f"{scratch}/{size}"
            for store in ("empty", "filled"):
                found = measure(["--quick"] if size == "quick" else [], environment)
                results[size, store] = found
                print(", ".join(f"{name} {seconds:.1f} s" for name, seconds in found["stages"].items()))
                print(
                    f"{size}, {store} store: {found['seconds']:.1f} s, {found['processor_seconds']:.1f} s of processor "
                    f"time, half of it {found['ratio']} times the {found['published_seconds']:.3f} s of the published "
                    f"program (at most {LIMITS[size, store][1]}); from the store {found['from_the_store']}; "
                    f"exit status {found['exit_status']}",
                    flush=True,
                )
    return results


def main() -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the quick report only")
    parser.add_argument("--cold", action="store_true", help="begin with empty caches of numba and matplotlib")
    options = parser.parse_args()
    results = measure_all(("quick",) if options.quick else ("quick", "full"), cold=options.cold)
    place = ROOT / "benchmarks" / "results"
    place.mkdir(exist_ok=True)
    facts: dict[str, Any] = {"cores": os.cpu_count(), "python": sys.version.split()[0]}
    facts["results"] = {f"{size}, {store}": found for (size, store), found in results.items()}
    (place / "report_time.json").write_text(json.dumps(facts, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
