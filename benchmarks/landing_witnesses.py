"""Do programs that share no formula land one touch alike? The matrix of their outcomes, per law, for water and ice.

    python benchmarks/landing_witnesses.py                    30 touches each of water and ice, six slices
    python benchmarks/landing_witnesses.py --touches 200      as many as the claim asks for
    python benchmarks/landing_witnesses.py --touches 200 --cases ice together in-turn --jobs 2 --json FILE
    python benchmarks/landing_witnesses.py --touches 200 --dt 1e-4 --rows FILE    another step; FILE goes on if killed

Throws are scattered widely in omega_0 and table height and kept if they come down within 35 degrees of upright, where
outcomes are open. The flight is the event-driven one for all. A disagreement is counted only between certified
outcomes; undecided ones are counted by themselves, and so are touches that half the step ends otherwise. Prints, for
each pair that differs, how near the reference passed by the saddle: a bottle that almost balances on its rim ends on
either side by its last digits.
"""

from __future__ import annotations

import argparse
import json
import math
import shlex
import sys
import time
from collections import Counter
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import engine_check
import ode_reference
from engine_check.landing import LANDERS
from ode_reference.landing.land import path
from slicemodel import Scenario, Table, Touch

REFERENCE = "event-driven"

CHUNK = 5
"""Touches that a worker lands at a time."""

NEAR_UPRIGHT = math.radians(35)
SPENT = 0.02
"""Time after the touch from which on the least distance from the saddle is read [s]."""


def touches(count: int, n_slices: int, filling: float, frozen: bool, seed: int) -> list[Touch]:
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
        touch = ode_reference.fly(scenario, Table(height=random.uniform(-0.5, -0.3)))
        if abs(touch.tilt) < NEAR_UPRIGHT:
            found.append(touch)
    return found


def closest_to_saddle(touch: Touch, table: Table, law: str | None) -> float:
    """Return the least |E - E_s| / E_s of the reference while the bottle's spin is below 1 rad/s."""
    run = path(touch, table, law, duration=1.0)
    slow = (np.abs(run.omega) < 1.0) & (run.t > SPENT)
    return float(np.min(np.abs(run.energy[slow] / run.saddle - 1), initial=math.inf))


CASES = {"ice": None, "together": "together", "in-turn": "in-turn"}
"""Law by name; ice has none."""


@dataclass(frozen=True, slots=True)
class Row:
    """One landing; ``coarse`` and ``fine`` are the outcomes with the step and with half of it."""

    outcome: str
    certified: float | None
    coarse: str
    fine: str
    reason: str
    seconds: float

    @property
    def decided(self) -> bool:
        """True if the outcome is certified."""
        return self.certified is not None

    @property
    def flips(self) -> bool:
        """True if half the step ends otherwise, both being certain of their outcome."""
        return self.coarse != self.fine and not {self.coarse, self.fine} & {"", "undecided"}


def landed(name: str, found: list[Touch], law: str | None, dt: float | None) -> list[Row]:
    """Return the outcomes by one program."""
    table, rows = Table(height=0.0), []
    for touch in found:
        began = time.process_time()
        if name == REFERENCE:
            outcome = ode_reference.land(touch, table, law)
        else:
            outcome = engine_check.land(touch, table, name, dt, law=law)
        ends = outcome.diagnostics["outcomes"]
        seconds = time.process_time() - began
        rows.append(Row(outcome.outcome, outcome.certified, str(ends[0]), str(ends[1]), outcome.reason, seconds))
    return rows


class Rows:
    """The rows that are made, by what they are about; kept in a file, a line each, if there is one."""

    def __init__(self, file: Path | None) -> None:
        self.file, self.made = file, dict[str, Row]()
        if file and file.exists():
            for line in file.read_text(encoding="utf-8").splitlines():
                key, row = json.loads(line)
                self.made[key] = Row(**row)

    def add(self, key: str, row: Row) -> None:
        """Keep a row."""
        self.made[key] = row
        if self.file:
            with self.file.open("a", encoding="utf-8") as file:
                file.write(json.dumps([key, asdict(row)]) + "\n")


def land_all(
    pool: Executor, rows: Rows, about: str, found: list[Touch], law: str | None, names: list[str], dt: float | None
) -> dict[str, list[Row]]:
    """Return the rows of every program that has this case, making those that are not there."""
    keys = {name: [f"{about}, {name}, {k}" for k in range(len(found))] for name in names}
    pending = {}
    for name, of_touches in keys.items():
        missing = [k for k, key in enumerate(of_touches) if key not in rows.made]
        for begin in range(0, len(missing), CHUNK):
            some = missing[begin : begin + CHUNK]
            future = pool.submit(landed, name, [found[k] for k in some], law, dt)
            pending[future] = [of_touches[k] for k in some]
    for future in as_completed(pending):
        for key, row in zip(pending[future], future.result(), strict=True):
            rows.add(key, row)
    return {name: [rows.made[key] for key in of_touches] for name, of_touches in keys.items()}


def compare(programs: dict[str, list[Row]], found: list[Touch], law: str | None) -> list[dict[str, Any]]:
    """Print outcomes and disagreements of all programs; return the matrix of every pair."""
    table = Table(height=0.0)
    for name, rows in programs.items():
        reasons = dict(Counter(row.reason for row in rows if row.reason))
        seconds = sum(row.seconds for row in rows) / len(rows)
        outcomes, flips = dict(Counter(row.outcome for row in rows)), sum(row.flips for row in rows)
        print(f"    {name:17} {outcomes}, {flips} flipped by half the step, {seconds:.3f} s each {reasons or ''}")
    names = list(programs)
    matrices = []
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            pairs = list(zip(programs[one], programs[other], strict=True))
            differ = [k for k, (a, b) in enumerate(pairs) if a.decided and b.decided and a.outcome != b.outcome]
            both = sum(a.decided and b.decided for a, b in pairs)
            near = [closest_to_saddle(found[k], table, law) for k in differ]
            missed = f", touches {differ}, saddle missed by {[f'{least:.1e}' for least in near]}" if near else ""
            print(f"      {one} / {other}: {len(differ)} of {both} differ{missed}", flush=True)
            matrices.append(
                {
                    "programs": [one, other],
                    "outcomes": dict(sorted(Counter(f"{a.outcome}/{b.outcome}" for a, b in pairs).items())),
                    "touches": len(pairs),
                    "decided by both": both,
                    "differ": len(differ),
                    "flipped": [sum(row.flips for row in programs[name]) for name in (one, other)],
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
    parser.add_argument("--cases", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--jobs", type=int, default=1, help="worker processes (%(default)s)")
    parser.add_argument("--dt", type=float, help="step of rigid contacts [s]; default: the engines' own")
    parser.add_argument("--rows", type=Path, metavar="FILE", help="keep every landing there, and go on from it")
    options = parser.parse_args()
    total, compared = 0, 0
    cases, rows = [], Rows(options.rows)
    step = "" if options.dt is None else f", dt {options.dt:g}"
    with ProcessPoolExecutor(options.jobs) as pool:
        for filling in options.fillings:
            for name in options.cases:
                law = CASES[name]
                found = touches(options.touches, options.n_slices, filling, law is None, options.seed)
                print(f"filling {filling:g}, {name}", flush=True)
                about = f"{name}, filling {filling:g}, N {options.n_slices}, seed {options.seed}{step}"
                names = [REFERENCE, *LANDERS]
                programs = land_all(pool, rows, about, found, law, names, options.dt)
                matrices = compare(programs, found, law)
                total += sum(m["differ"] for m in matrices)
                compared += len(found)
                cases.append(
                    {
                        "filling": filling,
                        "slices": law and "exclude",
                        "law": law,
                        "dt": options.dt,
                        "matrices": matrices,
                    }
                )
                if options.json:
                    facts: dict[str, Any] = {"command": shlex.join(["python", *sys.argv])}
                    facts |= {"touches": options.touches, "n_slices": options.n_slices, "cases": cases}
                    options.json.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    print(f"rigid programs differ {total} times from {compared} touches")
    return 0 if total <= 0.03 * compared else 1


if __name__ == "__main__":
    sys.exit(main())
