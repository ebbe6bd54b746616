"""Ideal water in two dimensions over filling, start and cells: plateaus, what is lost, and how long a flight takes.

    python benchmarks/ideal_water.py --cells 16                       # both kinds, six fillings
    python benchmarks/ideal_water.py --cells 16 --starts --fillings 0.25 0.5
    python benchmarks/ideal_water.py --cells 32 --suction no

One line for each flight, as columns that ``docs/water.md`` quotes. The last figures depend on the processor.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from ode_reference import ideal_water
from slicemodel import Scenario


def row(filling: float, start: str, cells: int, suction: bool) -> str:
    """Return the line of one flight."""
    began = time.process_time()
    run = ideal_water.solve(replace(Scenario(), water_mass=filling), start, cells=cells, suction=suction)
    taken = time.process_time() - began
    times = np.linspace(0.25, run.t[-1], 1001)
    level = float(np.interp(times, run.t, run.omega).mean() / 20.0)
    below = np.flatnonzero(run.omega < 15.0)
    early = f"{run.t[below[0]]:.3f}" if below.size else "never"
    early_part = run.t <= 0.01
    # J / J_0 = 1 + J''(0) t^2 / (2 J_0) + O(t^4)
    square = run.t[early_part] ** 2
    growth = float(2 * (square @ (run.inertia[early_part] / run.inertia[0] - 1)) / (square @ square))
    return (
        f"{filling:<8g}{start:<14}{'yes' if suction else 'no':<9}{cells:<7}{level:<9.3f}{early:<8}"
        f"{np.abs(run.drift).max():<9.0e}{run.momentum.max():<9.0e}{run.energy.max():<9.4f}"
        f"{run.density[5:].min():<7.3f}{run.density[5:].max():<7.3f}{growth:<9.2f}{taken:.1f}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=16)
    parser.add_argument("--fillings", type=float, nargs="+", default=[0.1, 0.25, 0.33, 0.5, 0.75, 1.0])
    parser.add_argument("--starts", action="store_true", help="all starts, not only water that spins with the bottle")
    parser.add_argument("--suction", choices=("yes", "no", "both"), default="both")
    asked = parser.parse_args()
    print(
        "filling start         suction  cells  plateau  t(.75)  drift    P        E_max    density       J''/J_0  cpu s"
    )
    for suction in {"yes": (True,), "no": (False,), "both": (False, True)}[asked.suction]:
        for filling in asked.fillings:
            for start in ideal_water.STARTS if asked.starts else ideal_water.STARTS[:1]:
                try:
                    print(row(filling, start, asked.cells, suction), flush=True)
                except ValueError as why:
                    print(f"{filling:<8g}{start:<14}{why}", flush=True)


if __name__ == "__main__":
    main()
