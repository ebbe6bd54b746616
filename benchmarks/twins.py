"""Whether a fit's 95 % intervals hold drag and restitution in 95 of 100 cases: throws simulated, filmed and fitted.

    python benchmarks/twins.py                           100 twins by midpoint (Eq. 8), omega_0 and theta_0 known
    python benchmarks/twins.py --also omega0 theta0      four parameters fitted
    python benchmarks/twins.py --measured omega          from omega as the paper makes it of theta
    python benchmarks/twins.py --model eq8               Eq. 8 exactly, event by event
    python benchmarks/twins.py --model free-flight       with the momentum of the tube

Each twin has its own truth, drawn at random from the ranges printed, and its own camera noise: 1 mm in each coordinate
of cap and base at 240 frames/s; theta by Eq. 1. The noise is not told to the fit. Prints how many intervals hold the
truth and how wide they are.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from statistics import median

from tqdm import tqdm

from flipproof.film.fit.problem import ALSO, SLICES
from flipproof.film.fit.twins import CAMERA_NOISE, RANGES, RATE, Twin, fit_twin

NEEDED = 0.90


def one(task: tuple[int, str, int, tuple[str, ...], str]) -> Twin:
    """Fit one twin."""
    seed, solver, slices, also, quantity = task
    return fit_twin(seed, solver, slices=slices, also=also, quantity=quantity)  # type: ignore[arg-type]


def main() -> int:
    """Fit the twins and print coverage and widths."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--twins", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--model", default="midpoint")
    parser.add_argument("--slices", type=int, default=SLICES)
    parser.add_argument("--also", nargs="+", choices=ALSO, default=[])
    parser.add_argument("--measured", choices=("theta", "omega"), default="theta")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=None, help="JSON file for every twin")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.twins)
    tasks = [(seed, options.model, options.slices, tuple(options.also), options.measured) for seed in seeds]
    began = time.perf_counter()
    with ProcessPoolExecutor(options.jobs) as pool:
        twins = list(tqdm(pool.map(one, tasks), total=len(tasks), disable=None))
    seconds, processor = time.perf_counter() - began, sum(os.times()[:4])

    print(f"{len(twins)} twins by {options.model}, {options.slices} slices, fitted to {options.measured}; truths from")
    for name, (low, high) in RANGES.items():
        print(f"    {name} in [{low:g}, {high:g}]")
    print(f"camera: {1e3 * CAMERA_NOISE:g} mm, {RATE:g} frames/s; not told to the fit")
    names = twins[0].estimate.problem.free
    held = {name: sum(twin.covers(name) for twin in twins) for name in names}
    both = sum(twin.covers("drag") and twin.covers("restitution") for twin in twins)
    for name in names:
        width = median(twin.width(name) for twin in twins)
        unit = "of the truth" if name == "drag" else {"omega0": "rad/s", "theta0": "rad"}.get(name, "")
        print(f"    {name:12} held in {held[name]} of {len(twins)}; median width of the interval {width:.4f} {unit}")
    print(f"    drag and restitution together held in {both} of {len(twins)}")
    missed = [twin.seed for twin in twins if twin.estimate.chi2 > twin.chi2_of_truth + 0.5]
    print(f"    lowest chi^2 not found (above that of the truth): {len(missed)} {missed or ''}")
    flights = median(twin.estimate.flights for twin in twins)
    print(f"    flights per fit: {flights:.0f}; {seconds:.0f} s, {processor:.0f} s of processor time")
    if options.out:
        rows = [
            {"seed": twin.seed, "chi2": twin.estimate.chi2, "chi2_of_truth": twin.chi2_of_truth,
             "temperature": twin.estimate.temperature,
             "roughness": twin.estimate.roughness,
             **{i.name: [getattr(twin.truth, i.name), i.value, i.low, i.high] for i in twin.intervals}}
            for twin in twins
        ]  # fmt: skip
        options.out.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    return 0 if both >= NEEDED * len(twins) else 1


if __name__ == "__main__":
    sys.exit(main())
