"""The command ``flipproof compare``: two solvers, or two files, in numbers."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from flipproof.cli.arguments import (
    SCENARIO_HELP,
    add_command,
    add_json,
    check_writable,
    count,
    read_scenario,
    write_json,
    write_junit,
)
from flipproof.cli.check import tolerance


def add_compare(commands: Any) -> None:
    """Add the command."""
    compare = add_command(commands, "compare", "Compare two solvers, or two CSV files, in numbers.", command_compare)
    compare.add_argument(
        "first", metavar="A", help="a solver's name or spec, or a CSV file with a column t and at least one of omega, "
        "theta and r_cm; empty cells are left out, and of a track.csv the flight is taken",
    )  # fmt: skip
    compare.add_argument("second", metavar="B", help="the same; differences are B minus A")
    compare.add_argument("--scenario", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    compare.add_argument("--slices", type=count, metavar="N", help="slices for both solvers (default 50)")
    compare.add_argument(
        "--tolerance", type=tolerance, metavar="X", help="end with status 1 if the largest difference in omega exceeds "
        "X omega_0; without omega in both, in theta X rad; without theta, in r_cm X m",
    )  # fmt: skip
    add_json(compare, "both curves' differences")
    compare.add_argument("--junit", type=Path, metavar="FILE", help="write that verdict as JUnit XML, too")


def command_compare(options: argparse.Namespace) -> int:
    """Compare two solvers or files and print the differences; return 1 if they exceed the tolerance."""
    if options.junit and options.tolerance is None:
        raise ValueError(f"--junit {options.junit} needs --tolerance: without it no comparison can fail")
    check_writable(options, "junit", "json")
    from flipproof.check.comparison import claims, compare, table
    from flipproof.frame.solvers import find, solve
    from flipproof.output.tables import Curve, read_curve

    scenario = read_scenario(options.scenario, options.slices)
    if options.slices is None:
        scenario = scenario.with_slices(min(50, scenario.n_slices))

    def load(name: str) -> Curve:
        path = Path(name)
        if path.is_file() or ((path.suffix or "/" in name) and ":" not in name):
            return read_curve(path)
        run = solve(find(name).name, scenario)
        if len(run.t) < 2:
            raise ValueError(f"{name} has nothing to compare on this throw: {run.status}: {run.message}")
        return Curve.of(run)

    found = compare(load(options.first), load(options.second))
    print(table(found))
    allowed = math.inf if options.tolerance is None else options.tolerance
    held = claims(found, allowed)
    write_json(options.json, {**found.to_mapping(), "findings": [finding.to_mapping() for finding in held]})
    if options.tolerance is None:
        return 0
    write_junit(options.junit, held, "flipproof compare")
    first = held[0]
    word = "FAIL" if first.failed else "PASS"
    print(f"{word}  {first.title}: {first.value:.6g} {first.unit}, tolerance {options.tolerance:g} ({first.note})")
    return 1 if first.failed else 0
