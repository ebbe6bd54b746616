"""What a digit costs: error against work and processor time for every scheme, method and engine, on three throws.

    python benchmarks/work_precision.py                  every method on every equation; a few minutes
    python benchmarks/work_precision.py --size full      what a report makes; 10 s on two cores
    python benchmarks/work_precision.py --size quick     one throw; 2 s

Prints sentences and tables, and writes ``benchmarks/results/work_precision.json`` and one ``work_precision_*.png`` per
figure.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

from flipproof.build import ask_of, gather_report
from flipproof.chapters import chapters_named
from flipproof.chapters.work_precision.chapter import (
    claim_work_precision,
    figures,
    summarise_work_precision,
    tabulate_work_precision,
)
from flipproof.chapters.work_precision.contenders import COMPLETE, FULL, QUICK
from flipproof.frame.pool import workers
from slicemodel import Scenario

RESULTS = Path(__file__).resolve().parent / "results"
SIZES = {effort.name: effort for effort in (COMPLETE, FULL, QUICK)}


def main() -> int:
    """Measure, print, write, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", choices=SIZES, default=COMPLETE.name)
    parser.add_argument("--jobs", type=int, default=None, help="worker processes; default: one per core")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder for the results")
    arguments = parser.parse_args()
    began = time.perf_counter()
    chapter = "work-precision"
    with workers(arguments.jobs) as pool:
        gathered = gather_report(
            ask_of(Scenario(), "full"),
            pool=pool,
            contents=chapters_named(chapter),
            work={chapter: SIZES[arguments.size]},
        )
    studies = gathered.outcomes[chapter].value
    seconds = time.perf_counter() - began
    findings = list(claim_work_precision(studies))
    for finding in findings:
        print(f"{finding.title}: {finding.value_text} {finding.band_text}\n    {finding.note}")
    for table in tabulate_work_precision(studies):
        widths = [max(map(len, column)) for column in zip(table.columns, *table.rows, strict=True)]
        print(f"\n{table.title}")
        for row in (table.columns, *table.rows):
            print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
        print(table.note)
    print(f"\n{seconds:.1f} s")
    arguments.out.mkdir(parents=True, exist_ok=True)
    facts = {
        "python": sys.version.split()[0],
        "cores": os.cpu_count(),
        "size": arguments.size,
        "seconds": round(seconds, 1),
        "findings": [finding.to_mapping() for finding in findings],
        "throws": summarise_work_precision(studies),
    }
    (arguments.out / "work_precision.json").write_text(json.dumps(facts, indent=1, allow_nan=False), encoding="utf-8")
    for exhibit in figures(studies):
        (arguments.out / f"{exhibit.name.replace('-', '_')}.png").write_bytes(exhibit.drawing.png)
    return 0


if __name__ == "__main__":
    sys.exit(main())
