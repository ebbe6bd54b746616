"""Processor time of a validity map and of the waterfall, N = 50: what a user waits for, on two cores twice.

python benchmarks/maps.py
"""

from __future__ import annotations

import argparse
import time

from flipproof.chapters.maps.study import make_readings, map_axes, plan_map
from flipproof.chapters.waterfall.study import plan_waterfall
from flipproof.frame.solvers import Run, make
from slicemodel import Scenario

THROW = Scenario().with_slices(50)


def main() -> None:
    """Measure and print."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    for solver in ("exact-step", "eq8"):
        make(Run(solver, THROW.with_slices(2)))
    fills, values = map_axes("gamma", 20, 20)
    for words, runs in {
        "map 20 x 20 over gamma, all 64 sets of assumptions, two schemes and the column": plan_map(
            THROW, "gamma", fills, values
        ),
        "the same with twins": plan_map(THROW, "gamma", fills, values, banded=True),
    }.items():
        began = time.process_time()
        made = make_readings(runs)
        spent, missing = time.process_time() - began, sum(reading.omega is None for reading in made)
        print(f"{words}: {len(runs)} runs, {spent:.1f} s, {1e3 * spent / len(runs):.2f} ms each; {missing} missing")
    runs = plan_waterfall(THROW, 1000)
    began = time.process_time()
    made_all = [make(run) for run in runs]
    spent = time.process_time() - began
    print(f"waterfall: {len(made_all)} runs of all 64 combinations and their twins, {spent:.2f} s")


if __name__ == "__main__":
    main()
