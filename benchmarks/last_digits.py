"""How far the last digits decide omega(t), and whether the estimated band holds: random throws by the reduced flow.

    python benchmarks/last_digits.py [--throws 60] [--twins 40] [--near-full 500] [--seed 2]

First, by equation, drag and restitution: the share of flights whose band (``ode_reference.estimate_band``, eight twins)
exceeds 1e-4 omega_0, the widest band, and the shares of further twins that lie within it: by their largest difference,
which is what a report prints, and at every single output time. Twins 1 to 8 make the band; those that it is held
against have other numbers and so other signs.

Then bottles short of full by 5e-8 to 1e-6 without drag, in another unit of time: omega_0, the rest speed and the output
times change with it, and omega / omega_0 must not. Printed is the share of flights that lie within the band of free
flight, and how far the widest parts from itself.

Ends with status 1 if less than 95 % of either lie within. Seed 1 served to choose the band, others are held out.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

import ode_reference
from slicemodel.scenario import Bottle, Scenario

FLOOR, MOVED, NEEDED = 1e-9, 1e-4, 0.95
RESTITUTIONS = (0.5, 0.8, 0.9, 0.95, 0.99, 1.0)
GROUPS = {"e = 0.5": (0.5, 0.5), "e = 0.8 to 0.99": (0.8, 0.99), "e = 1": (1.0, 1.0)}
TIMES = np.linspace(0.0, 0.5, 201)


def random_throw(rng: np.random.Generator, k: int) -> Scenario:
    """Return throw k: restitutions in turn, every other six without drag."""
    n, gamma = int(rng.integers(3, 51)), rng.uniform(0.5, 10.0) * (1 - k // 6 % 2)
    bottle = Bottle(length=rng.uniform(0.15, 0.4), radius=rng.uniform(0.02, 0.06), mass=rng.uniform(0.015, 0.15))
    water = bottle.capacity * rng.uniform(0.1, 0.9)
    return Scenario(
        bottle=bottle, water_mass=water, n_slices=n, drag=2 * gamma * water / n, restitution=RESTITUTIONS[k % 6],
        omega0=rng.uniform(5.0, 25.0), theta0=rng.uniform(0.0, 6.0),
    )  # fmt: skip


def near_full(rng: np.random.Generator) -> Scenario:
    """Return a bottle a hair short of full, without drag, whose slices mostly never rest."""
    return replace(
        Scenario(), water_mass=1.0 - 1e-6 * rng.uniform(0.05, 1.0), n_slices=int(rng.integers(2, 9)), drag=0.0,
        restitution=float(rng.choice([0.5, 0.9, 1.0, 1.0])), omega0=rng.uniform(5.0, 25.0),
    )  # fmt: skip


def in_other_unit(throw: Scenario, unit: float) -> np.ndarray:
    """Return omega / omega_0 of free flight at ``TIMES``, computed in a unit of time that is ``unit`` seconds."""
    switches = ode_reference.MODELS["free-flight"].switches
    spin, speed = throw.omega0 * unit, ode_reference.solver.usual_rest_speed(switches, throw) * unit
    scaled = replace(throw, omega0=spin, duration=throw.duration / unit, gravity=throw.gravity * unit**2)
    return ode_reference.solve(scaled, "free-flight", TIMES / unit, rest_speed=speed).omega / spin


def held(throw: Scenario, model: str, twins: int) -> tuple[float, float, float]:
    """Return the band of a flight [omega_0], and the shares of further twins within it."""
    flight = ode_reference.solve(throw, model, TIMES)
    band = np.maximum(ode_reference.estimate_band(flight).size, FLOOR) * throw.omega0
    others = (ode_reference.solve(throw, model, TIMES, twin=k) for k in range(101, 101 + twins))
    apart = np.array([np.abs(other.omega - flight.omega) for other in others])
    by_largest, at_all_times = apart.max(axis=1) <= band[-1], np.all(apart <= band, axis=1)
    return float(band[-1] / throw.omega0), float(by_largest.mean()), float(at_all_times.mean())


def main() -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--throws", type=int, default=60)
    parser.add_argument("--twins", type=int, default=40)
    parser.add_argument("--near-full", type=int, default=500)
    parser.add_argument("--seed", type=int, default=2)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    throws = [random_throw(rng, k) for k in range(options.throws)]
    drag, e = np.array([throw.drag > 0.0 for throw in throws]), np.array([throw.restitution for throw in throws])
    worst = 1.0
    for model in ("free-flight", "accelerating-origin", "eq8"):
        bands, by_largest, at_all_times = np.transpose([held(throw, model, options.twins) for throw in throws])
        worst = min(worst, by_largest.mean())
        within = f"{by_largest.mean():.2%} ({at_all_times.mean():.2%} at every output time)"
        print(f"{model}: {within} of {len(throws)} x {options.twins} further twins within the band")
        for words, which in (("with drag", drag), ("no drag", ~drag)):
            for group, (low, high) in GROUPS.items():
                if (here := which & (e >= low) & (e <= high)).any():
                    moved, widest = np.mean(bands[here] > MOVED), bands[here].max()
                    print(
                        f"  {words}, {group}, {here.sum()} flights: {moved:.0%} wider than 1e-4 (at most {widest:.1e})"
                    )
    apart, inside = [], []
    for _ in range(options.near_full):
        throw = near_full(rng)
        flight = ode_reference.solve(throw, "free-flight", TIMES)
        change = np.abs(in_other_unit(throw, rng.uniform(1.1, 3.7)) - flight.omega / throw.omega0)
        inside.append(bool(np.all(change <= np.maximum(ode_reference.estimate_band(flight).size, FLOOR))))
        apart.append(change.max())
    if inside:
        worst = min(worst, float(np.mean(inside)))
        moved, most = np.mean(np.array(apart) > MOVED), max(apart)
        print(f"near-full bottles in another unit of time: {np.mean(inside):.2%} of {len(inside)} within the band")
        print(f"  {moved:.0%} parted from themselves by more than 1e-4 omega_0, by {most:.1e} at the most")
    return 0 if worst >= NEEDED else 1


if __name__ == "__main__":
    raise SystemExit(main())
