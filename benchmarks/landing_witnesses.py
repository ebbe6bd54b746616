"""Do programs that share no formula land one touch alike? The matrix of their outcomes, per law, for water and ice.

    python benchmarks/landing_witnesses.py                    30 touches each of water and ice, six slices
    python benchmarks/landing_witnesses.py --touches 200      as many as the claim asks for
    python benchmarks/landing_witnesses.py --engines pymunk   one engine only
    python benchmarks/landing_witnesses.py --touches 200 --cases ice together in-turn --jobs 2 --json FILE

Throws are scattered widely in omega_0 and table height and kept if they come down within 35 degrees of upright, where
outcomes are open. The flight is the event-driven one for all. A disagreement is counted only between certified
outcomes; undecided ones are counted by themselves. Prints, for each pair that differs, how near the reference passed by
the saddle: a bottle that almost balances on its rim ends on either side by its last digits.
"""

from __future__ import annotations

import argparse
import json
import math
import shlex
import sys
import time
from collections import Counter
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import engine_check
import ode_reference
from engine_check.landing import LANDERS
from ode_reference.landing import path
from slicemodel import Outcome, Scenario, Table, Touch

CHUNK = 5
"""Touches that a worker lands at a time."""

NEAR_UPRIGHT = math.radians(35)
SPENT = 0.02
"""Time after the touch from which on the least distance from the saddle is read [s]."""


def touches(count: int, n_slices: int, filling: float, frozen: bool, slices: str, seed: int) -> list[Touch]:
    """Return touches within 35 degrees of upright."""
    random = np.random.default_rng(seed)
    found: list[Touch] = []
    while len(found) < count:
        scenario = Scenario(
            n_slices=n_slices,
            water_mass=filling,
            drag=10 * filling / n_slices,
            frozen=frozen,
            duration=2.0,
            omega0=random.uniform(10, 45),
            theta0=math.pi / 2 + math.radians(5) * random.standard_normal(),
            launch_velocity=(0.5, 1.94 + 0.1 * random.standard_normal()),
        )
        touch = ode_reference.fly(scenario, Table(height=random.uniform(-0.5, -0.3)), slices)
        if abs(touch.tilt) < NEAR_UPRIGHT:
            found.append(touch)
    return found


def closest_to_saddle(touch: Touch, table: Table, law: str | None, slices: str) -> float:
    """Return the least |E - E_s| / E_s of the reference while the bottle's spin is below 1 rad/s."""
    run = path(touch, table, law, slices, duration=1.0)
    slow = (np.abs(run.omega) < 1.0) & (run.t > SPENT)
    return float(np.min(np.abs(run.energy[slow] / run.saddle - 1), initial=math.inf))


Case = tuple[str | None, str | None]
CASES: dict[str, Case] = {
    "ice": (None, None),
    "together": ("exclude", "together"),
    "in-turn": ("exclude", "in-turn"),
    "staggered": ("staggered", "together"),
    "staggered-in-turn": ("staggered", "in-turn"),
}
"""Kinds of slices and law by name; ice has neither."""


def landed(name: str, found: list[Touch], law: str | None, slices: str | None) -> tuple[list[Outcome], float] | None:
    """Return the outcomes by one program, and its process time; None if it has not this law or these slices."""
    table, lander = Table(height=0.0), LANDERS.get(name)
    began = time.process_time()
    if lander is None:
        outcomes = [ode_reference.land(t, table, law, slices or "exclude") for t in found]
    elif (slices and (slices not in lander.slices and lander.laws)) or (law == "in-turn" and law not in lander.laws):
        return None
    else:
        # Soft contacts have stops of their own for every slice, which rods keep, too.
        kind = slices if slices in lander.slices else lander.slices[-1]
        given = law if lander.laws else None
        outcomes = [engine_check.land(t, table, name, law=given, slices=kind) for t in found]
    return outcomes, time.process_time() - began


def compare(pool: Executor, found: list[Touch], case: Case, engines: list[str]) -> list[dict[str, Any]]:
    """Print outcomes and disagreements of all programs that have this law; return the matrix of every pair."""
    slices, law = case
    chunks = [found[k : k + CHUNK] for k in range(0, len(found), CHUNK)]
    names = ["event-driven", *engines]
    pending = {name: [pool.submit(landed, name, chunk, law, slices) for chunk in chunks] for name in names}
    programs: dict[str, list[Outcome]] = {}
    seconds = {}
    for name in names:
        parts = [part for future in pending[name] if (part := future.result()) is not None]
        if parts:
            programs[name] = [outcome for outcomes, _ in parts for outcome in outcomes]
            seconds[name] = sum(spent for _, spent in parts) / len(found)
    table, slices = Table(height=0.0), slices or "exclude"
    for name, outcomes in programs.items():
        reasons = dict(Counter(outcome.reason for outcome in outcomes if outcome.reason))
        print(f"    {name:17} {dict(Counter(o.outcome for o in outcomes))} {seconds[name]:.3f} s each {reasons or ''}")
    names = list(programs)
    matrices = []
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            pairs = list(zip(programs[one], programs[other], strict=True))
            differ = [k for k, (a, b) in enumerate(pairs) if a.decided and b.decided and a.outcome != b.outcome]
            both = sum(a.decided and b.decided for a, b in pairs)
            near = [closest_to_saddle(found[k], table, law, slices) for k in differ]
            missed = f", saddle missed by {[f'{least:.1e}' for least in near]}" if near else ""
            print(f"      {one} / {other}: {len(differ)} of {both} differ{missed}", flush=True)
            matrices.append(
                {
                    "programs": [one, other],
                    "outcomes": dict(sorted(Counter(f"{a.outcome}/{b.outcome}" for a, b in pairs).items())),
                    "touches": len(pairs),
                    "decided by both": both,
                    "differ": len(differ),
                    "saddle missed by": [round(least, 6) for least in near],
                }
            )
    return matrices


def main() -> int:
    """Land and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--touches", type=int, default=30)
    parser.add_argument("--n-slices", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--fillings", type=float, nargs="+", default=[0.4])
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--engines", nargs="+", choices=list(LANDERS), default=list(LANDERS))
    parser.add_argument("--cases", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--jobs", type=int, default=1, help="worker processes (%(default)s)")
    options = parser.parse_args()
    total, compared = 0, 0
    cases = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for filling in options.fillings:
            for name in options.cases:
                slices, law = CASES[name]
                found = touches(
                    options.touches, options.n_slices, filling, slices is None, slices or "exclude", options.seed
                )
                print(f"filling {filling:g}, {name}", flush=True)
                matrices = compare(pool, found, CASES[name], options.engines)
                total += sum(m["differ"] for m in matrices if "mujoco-compliant" not in m["programs"])
                compared += len(found)
                cases.append({"filling": filling, "slices": slices, "law": law, "matrices": matrices})
                if options.json:
                    facts: dict[str, Any] = {"command": shlex.join(["python", *sys.argv])}
                    facts |= {"touches": options.touches, "n_slices": options.n_slices, "cases": cases}
                    options.json.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    print(f"rigid programs differ {total} times from {compared} touches")
    return 0 if total <= 0.03 * compared else 1


if __name__ == "__main__":
    sys.exit(main())
