"""Count how often the engine certifies a false outcome near the edge between upright and lying.

    python benchmarks/landing_edges.py                    48 touches, seed 1
    python benchmarks/landing_edges.py --touches 100 --seed 7

A touch of a random throw (4, 6 or 8 rods, ice one in six, both laws) is scaled in omega until the event-driven landing
ends upright on one side and lying on the other; bisection finds that edge, and the touch asked for lies 1e-3 to 0.05 of
omega beside it. Truth is the event-driven landing. Prints each touch, then how many certificates of the engine are
right, how many are false, and how many touches it leaves uncertified. Exit status 1 if one is false.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from dataclasses import replace

import numpy as np

import engine_check
import ode_reference
from slicemodel import Scenario, Table, Touch

FLAT = Table(height=0.0)
FACTORS = np.linspace(0.7, 1.3, 13)


def touch_of(random: np.random.Generator) -> Touch:
    """Return the touch of a random throw that comes down within 35 degrees of upright."""
    while True:
        n, water = int(random.choice([4, 6, 8])), float(random.choice([0.25, 0.4, 0.5]))
        throw = Scenario(
            n_slices=n,
            water_mass=water,
            drag=10 * water / n,
            frozen=bool(random.random() < 1 / 6),
            duration=2.0,
            omega0=random.uniform(10, 45),
            theta0=math.pi / 2 + 0.087 * random.standard_normal(),
            launch_velocity=(0.5, 1.94 + 0.1 * random.standard_normal()),
        )
        touch = ode_reference.fly(throw, Table(height=random.uniform(-0.5, -0.3)))
        if abs(touch.tilt) < math.radians(35):
            return touch


def hard_touch(random: np.random.Generator) -> tuple[Touch, str | None, float, str]:
    """Return a touch beside an edge, its law, its distance from the edge (share of omega), and how it ends."""
    while True:
        touch = touch_of(random)
        law = None if touch.scenario.frozen else str(random.choice(["together", "in-turn"]))

        def outcome(factor: float, touch: Touch = touch, law: str | None = law) -> str:
            return ode_reference.land(replace(touch, omega=factor * touch.omega), FLAT, law).outcome

        ends = [outcome(factor) for factor in FACTORS]
        edges = [k for k in range(len(ends) - 1) if {ends[k], ends[k + 1]} == {"upright", "lying"}]
        if not edges:
            continue
        low, high = FACTORS[edges[0]], FACTORS[edges[0] + 1]
        for _ in range(10):
            middle = (low + high) / 2
            end = outcome(middle)
            low, high = (
                (middle, middle) if end == "undecided" else (middle, high) if end == ends[edges[0]] else (low, middle)
            )
        distance = 10 ** random.uniform(-3, math.log10(0.05))
        factor = low - distance if random.random() < 0.5 else high + distance
        truth = outcome(factor)
        if truth != "undecided":
            return replace(touch, omega=factor * touch.omega), law, distance, truth


def main() -> int:
    """Land and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--touches", type=int, default=48)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    tally: Counter[str] = Counter()
    for k in range(options.touches):
        touch, law, distance, truth = hard_touch(random)
        found = engine_check.land(touch, FLAT, "mujoco", law=law)
        verdict = "not certified" if not found.decided else "right" if found.outcome == truth else "FALSE"
        tally[verdict] += 1
        words = f"{k + 1}: N = {touch.scenario.n_slices}, {law or 'ice'}, {distance:.1e} from the edge, {truth}"
        print(f"{words}: {found.outcome}, {verdict} {found.reason}", flush=True)
    print(f"{tally['right']} right, {tally['FALSE']} false, {tally['not certified']} not certified")
    return 1 if tally["FALSE"] else 0


if __name__ == "__main__":
    sys.exit(main())
