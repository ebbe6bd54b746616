"""Watch why a grid in time and the event-driven landing part within the first hits after a touch.

    python benchmarks/landing_cascade.py                      touches 5, 8, 19, 20 and 26 of forty
    python benchmarks/landing_cascade.py --touches 26

Staggered slices, six, filling 0.25: the touches of landing_witnesses whose outcomes differ. Water that still rebounds
on the base lies micrometres over it at the touch. A grid whose step is longer than those gaps take to close lets bottle
and water strike at once; the event-driven landing strikes them one after the other. Prints the gaps, and the spin a
few microseconds later on finer and finer grids of MuJoCo's mass matrix. Where even the finest does
not give it, gaps differ by less than the 3e-10 m below which the event-driven landing counts things as touching.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from landing_witnesses import touches

from engine_check.landing import stops
from engine_check.landing_mujoco import build
from ode_reference.landing import path
from slicemodel import Table

AFTER = 2e-6
STEPS = (1e-6, 1e-7, 1e-8, 1e-9, 2e-11)


def main() -> int:
    """Land and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--touches", type=int, nargs="+", default=[5, 8, 19, 20, 26])
    options = parser.parse_args()
    table = Table(height=0.0)
    found = touches(40, 6, 0.25, False, "staggered", 1)
    alike = 0
    for k in options.touches:
        touch = found[k]
        _, high = stops(touch.scenario)
        gaps = np.array(high) - touch.r
        run = path(touch, table, "together", "staggered", dt=1e-8, every=AFTER, duration=AFTER + 5e-8)
        exact = float(run.omega[-1])
        print(f"touch {k}: least gaps over the base {np.sort(gaps)[:4]} m")
        print(f"    spin {AFTER:g} s after the touch: event-driven {exact:.4f} rad/s", flush=True)
        for step in STEPS:
            world = build(touch, table, step, "together", "staggered")
            for _ in range(round(float(run.t[-1]) / step)):
                world.advance()
            spin = float(world.data.qvel[2])
            print(f"        grid of {step:g} s: {spin:.4f} rad/s", flush=True)
        alike += abs(spin - exact) < 1e-3
    print(f"the finest grid gives the event-driven spin in {alike} of {len(options.touches)} touches")
    return 0 if 2 * alike > len(options.touches) else 1


if __name__ == "__main__":
    sys.exit(main())
