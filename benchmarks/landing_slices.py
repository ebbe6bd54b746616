"""Measure how many slices P(upright) needs, and how many landings are made a second.

    python benchmarks/landing_slices.py                       600 throws with 20 and with 40 slices, filling 0.4
    python benchmarks/landing_slices.py --slices 10 20 40     others

Family B, law together, one aim (that of the first number of slices) and the same throwers for all. Prints P(upright),
the difference from the first with its 95 % interval, that of paired throws, and landings and throws per second of
process time.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace

import ode_reference
from flipproof.chapters.landing.study import Size, cell_of, filled
from flipproof.chapters.landing.throws import Case, Throws, aimed, make_cases
from slicemodel import Scenario, Table


def main() -> int:
    """Throw and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--throws", type=int, default=600)
    parser.add_argument("--filling", type=float, default=0.4)
    parser.add_argument("--slices", type=int, nargs="+", default=[20, 40])
    options = parser.parse_args()
    aim = aimed(filled(Scenario(), options.filling, options.slices[0], frozen=False), "B")
    first, inside = None, True
    for slices in options.slices:
        case = Case(aim=replace(aim, throw=aim.throw.with_slices(slices)), law="together", throws=options.throws)
        make_cases([replace(case, throws=1)], Size().seed)  # compiles
        began = time.process_time()
        cell = cell_of(case.aim, make_cases([case], Size().seed)[0])
        seconds = time.process_time() - began
        share = cell.share
        low, high = share.interval
        words = f"N = {slices}: P(upright) = {share.value:.4f} [{low:.4f}, {high:.4f}], {share.undecided} undecided"
        if first is None:
            first = cell
        else:
            difference, least, most = cell.minus(first)
            inside = inside and least <= 0.0 <= most
            words += f"; difference {difference:+.4f} [{least:+.4f}, {most:+.4f}]"
        print(f"{words}; {options.throws / seconds:.0f} throws/s", flush=True)
        print(f"    {_landings(case)}", flush=True)
    return 0 if inside else 1


def _landings(case: Case, count: int = 100) -> str:
    """Return how many landings a second are made of touches that are there."""
    design = Throws(cases=(replace(case, throws=count),), seed=Size().seed)
    table = Table(height=case.aim.height, restitution=case.restitution, friction=case.friction)
    touches = [ode_reference.fly(design.thrown(design.cases[0], k), table) for k in range(count)]
    ode_reference.land(touches[0], table)  # compiles
    began = time.process_time()
    for touch in touches:
        ode_reference.land(touch, table)
    return f"{count / (time.process_time() - began):.0f} landings/s"


if __name__ == "__main__":
    sys.exit(main())
