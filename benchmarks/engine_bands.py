"""Do the bands of pymunk's certificates hold? Random throws, each held against event-driven free flight.

    python benchmarks/engine_bands.py                      64 throws of the held-out seed
    python benchmarks/engine_bands.py --seed 7 --throws 20 others

Every other throw is without drag. Prints, throw by throw, the certificate's verdict, the largest |omega - exact| of
omega_0, the band at that time, their quotient, and the share of the output times inside; then the shares of all.
"""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

import engine_check
import ode_reference
from slicemodel import Bottle, Scenario

HELD_OUT: Final = 20261123
POINTS: Final = 201


def random_throw(seed: int, index: int) -> Scenario:
    """Return a throw with N, filling, e, bottle, spin and duration drawn anew; with drag if ``index`` is odd."""
    draw = np.random.default_rng((seed, index))
    bottle = Bottle(
        length=float(draw.uniform(0.15, 0.35)),
        radius=float(draw.uniform(0.025, 0.05)),
        mass=float(np.exp(draw.uniform(np.log(0.02), np.log(0.2)))),
        capacity=1.0,
    )
    throw = Scenario(
        bottle=bottle,
        water_mass=float(draw.uniform(0.1, 0.8)),
        n_slices=round(float(np.exp(draw.uniform(np.log(2.0), np.log(16.0))))),
        drag=0.0,
        restitution=float(draw.choice([0.0, 0.2, 0.5, 0.8, 1.0])),
        omega0=float(draw.uniform(8.0, 30.0)),
        theta0=float(draw.uniform(0.0, 3.0)),
        duration=float(draw.uniform(0.2, 0.4)),
    )
    damping = float(np.exp(draw.uniform(np.log(1.0), np.log(30.0))))
    return replace(throw, drag=damping * throw.slice_mass) if index % 2 else throw


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One throw: the certificate's status, the largest |omega - exact| and the band there, and how the band holds."""

    throw: Scenario
    status: str
    error: float
    band: float
    worst: float
    share: float
    final: float
    reference: float
    seconds: float

    def __str__(self) -> str:
        """Return one line of the table."""
        t = self.throw
        filling = t.water_mass / t.bottle.capacity
        words = f"N = {t.n_slices:2d}, filling {filling:.2f}, e = {t.restitution:g}, {'wet' if t.drag else 'dry'}"
        numbers = f"{self.error:.1e} {self.band:.1e} x{self.worst:<6.2f} {self.share:.3f} x{self.final:<6.2f}"
        return f"{words:40} {self.status:14} {numbers} {self.reference:.0e} {self.seconds:5.1f} s"


def compare(asked: tuple[int, int]) -> Row:
    """Return how the band of one throw holds."""
    throw = random_throw(*asked)
    times = np.linspace(0.0, throw.duration, POINTS)
    exact, twin = (
        ode_reference.solve(throw, model="free-flight", times=times, rest_speed=speed).omega for speed in (1e-4, 1e-5)
    )
    began = time.process_time()
    found = engine_check.certify(throw, "pymunk", times=times)
    omega0, flown = abs(throw.omega0), found.trajectory.omega
    error = np.full(POINTS, np.inf)
    error[: len(flown)] = np.abs(flown - exact[: len(flown)]) / omega0
    band = np.full(POINTS, np.nan)
    band[: len(flown)] = found.band
    quotient = error / band
    k = int(np.nanargmax(quotient)) if np.isfinite(quotient).any() else 0
    return Row(
        throw=throw,
        status=found.status,
        error=float(error[k]),
        band=float(band[k]),
        worst=float(quotient[k]),
        share=float(np.mean(error <= band)),
        final=float(quotient[-1]),
        reference=float(np.abs(exact - twin).max() / omega0),
        seconds=time.process_time() - began,
    )


def main() -> int:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=HELD_OUT)
    parser.add_argument("--throws", type=int, default=64)
    parser.add_argument("--jobs", type=int, default=1, help="worker processes")
    arguments = parser.parse_args()
    rows = []
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for row in pool.map(compare, [(arguments.seed, index) for index in range(arguments.throws)]):
            rows.append(row)
            print(row, flush=True)
    certified = [row for row in rows if row.status == "certified"]
    for words, some in (("all", rows), ("certified", certified)):
        shares = np.array([row.share for row in some])
        whole, last = np.mean(shares == 1.0), np.mean([row.final <= 1.0 for row in some])
        print(
            f"{words}: {len(some)} throws; wholly inside their band {whole:.1%}, at the end {last:.1%}; "
            f"output times inside {shares.mean():.2%}, at least {shares.min():.1%} in one throw"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
