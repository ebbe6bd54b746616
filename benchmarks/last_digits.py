"""How far the last digits decide omega(t): twins of random throws by the reduced flow.

    python benchmarks/last_digits.py [--throws 400] [--seed 1]

A twin has omega_0 and the mass of the bottle larger by 3e-11 of themselves, more than rounding adds up to. Printed is
the share of flights whose omega it moves by more than 1e-4 omega_0, and the largest change, by equation, drag and
restitution; beside it the same of a twin in omega_0 alone, which without drag and weight is a change of the unit of
time, and of one with a tenth of the rest speed.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

import ode_reference
from ode_reference.solver import REST_SPEED, REST_SPEED_WITH_RECOIL
from slicemodel.scenario import Bottle, Scenario

CHANGE, MOVED = 3e-11, 1e-4
RESTITUTIONS = (0.5, 0.8, 0.9, 0.95, 0.99, 1.0)
GROUPS = {"e = 0.5": (0.5, 0.5), "e = 0.8 to 0.99": (0.8, 0.99), "e = 1": (1.0, 1.0)}


def random_throw(rng: np.random.Generator, k: int) -> Scenario:
    """Return throw k: restitutions in turn, every other six without drag."""
    n, gamma = int(rng.integers(3, 51)), rng.uniform(0.5, 10.0) * (1 - k // 6 % 2)
    bottle = Bottle(length=rng.uniform(0.15, 0.4), radius=rng.uniform(0.02, 0.06), mass=rng.uniform(0.015, 0.15))
    water = bottle.capacity * rng.uniform(0.1, 0.9)
    return Scenario(
        bottle=bottle, water_mass=water, n_slices=n, drag=2 * gamma * water / n, restitution=RESTITUTIONS[k % 6],
        omega0=rng.uniform(5.0, 25.0), theta0=rng.uniform(0.0, 6.0),
    )  # fmt: skip


def main() -> None:
    """Fly all throws and their twins, and print what these move."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--throws", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    throws = [random_throw(rng, k) for k in range(options.throws)]
    faster = [replace(throw, omega0=throw.omega0 * (1 + CHANGE)) for throw in throws]
    both = [replace(throw, bottle=replace(throw.bottle, mass=throw.bottle.mass * (1 + CHANGE))) for throw in faster]
    spins = np.array([throw.omega0 for throw in throws])
    drag, e = np.array([throw.drag > 0.0 for throw in throws]), np.array([throw.restitution for throw in throws])
    times = np.linspace(0.0, 0.5, 201)
    for model in ("free-flight", "accelerating-origin", "eq8"):
        usual = REST_SPEED_WITH_RECOIL if ode_reference.MODELS[model].switches.recoil else REST_SPEED
        runs = ode_reference.solve_batch(throws, model, times)
        twins = {
            "omega_0 and mass": ode_reference.solve_batch(both, model, times),
            "omega_0 alone": ode_reference.solve_batch(faster, model, times),
            "rest speed": ode_reference.solve_batch(throws, model, times, rest_speed=usual / 10),
        }
        moved = {name: np.abs(twin.omega - runs.omega).max(axis=1) / spins for name, twin in twins.items()}
        print(f"{model}: {sum(status == 'ok' for status in runs.status)} of {len(throws)} ok")
        for words, which in (("with drag", drag), ("no drag", ~drag)):
            for group, (low, high) in GROUPS.items():
                here = which & (e >= low) & (e <= high)
                each = (f"{name} {np.mean(by[here] > MOVED):.0%} ({by[here].max():.1e})" for name, by in moved.items())
                print(f"  {words}, {group}, {here.sum()} flights: " + ", ".join(each))


if __name__ == "__main__":
    main()
