"""Does ice that lands on a rim end as its energy says? The closed form against the event-driven landing.

    python benchmarks/landing_criterion.py                300 throws inside the closed form's domain

e_table = 0 and a friction at which nothing slips; tilt -0.02 to -0.45 rad, 0.5 to 3 m/s down, up to 0.5 m/s sideways,
-10 to 25 rad/s, fillings 0.3 and 0.6. Prints how many agree, and how many of each outcome there are.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter

import numpy as np

import ode_reference
from ode_reference.landing_forms import Block, ends_upright
from slicemodel import Scenario, Table, Touch

TABLE = Table(height=0.0, restitution=0.0, friction=50.0)


def main() -> int:
    """Land and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--throws", type=int, default=300)
    parser.add_argument("--seed", type=int, default=3)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    tally: Counter[tuple[bool, str]] = Counter()
    outside = 0
    while sum(tally.values()) < options.throws:
        scenario = Scenario(n_slices=10, frozen=True, water_mass=float(random.choice([0.3, 0.6])))
        tilt, omega = -random.uniform(0.02, 0.45), random.uniform(-10.0, 25.0)
        velocity = random.uniform(-0.5, 0.5), -random.uniform(0.5, 3.0)
        block = Block.of(scenario)
        upright = ends_upright(block, tilt, omega, velocity)
        if upright is None:
            outside += 1
            continue
        # From C_M to the middle of the tube.
        swing = omega * (scenario.bottle.length / 2 - block.height)
        touch = Touch(
            scenario=scenario,
            theta=tilt,
            omega=omega,
            velocity=(velocity[0] - swing * math.cos(tilt), velocity[1] - swing * math.sin(tilt)),
            r=scenario.initial_positions(),
            v=np.zeros(scenario.n_slices),
        )
        tally[upright, ode_reference.land(touch, TABLE).outcome] += 1
    right = tally[True, "upright"] + tally[False, "lying"] + tally[False, "cap"]
    print(f"{right} of {options.throws} as the closed form says; {outside} throws lay outside its domain")
    for (upright, outcome), count in sorted(tally.items()):
        print(f"    closed form {'upright' if upright else 'not upright'}, landing {outcome}: {count}")
    return 0 if right == options.throws else 1


if __name__ == "__main__":
    sys.exit(main())
