"""The commands of ``flipproof`` for pipelines: compare two curves, diff two reports, check a throw against one."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from flipproof.cli.arguments import (
    SCENARIO_HELP,
    add_command,
    add_guests,
    add_json,
    add_no_cache,
    check_guests,
    count,
    output,
    picture,
    read_scenario,
    reader,
    store_of,
    write_json,
    write_junit,
    write_picture,
)
from flipproof.cli.console import tell
from flipproof.figures.spoken import inert

if TYPE_CHECKING:
    from flipproof.curves.compare import Comparison

tolerance = reader("a finite number of at least 0", float, lambda value: 0.0 <= value < math.inf)

TOLERANCE_HELP: Final = (
    "how far a finding may move beyond its bands, in its own unit (default 1e-6: round-off between machines; use 0 "
    "on the same machine)"
)


def add_checks(commands: Any) -> None:
    """Add the two commands."""
    diff = add_command(commands, "diff", "Compare two reports: findings that changed beyond bands.", command_diff)
    diff.add_argument("old", type=Path, metavar="OLD", help="a report's folder, or its summary.json")
    diff.add_argument("new", type=Path, metavar="NEW", help="the same; changes are from OLD to NEW")
    diff.add_argument("--tolerance", type=tolerance, metavar="X", help=TOLERANCE_HELP)
    add_json(diff, "the comparison")

    check = add_command(commands, "check", "Check a throw in a few seconds, one line per claim.", command_check)
    check.add_argument("scenario", metavar="SCENARIO.toml", help="scenario file (TOML with [scenario] and [bottle])")
    check.add_argument(
        "--baseline", type=Path, metavar="SUMMARY", help="summary.json of a report of this throw, or its folder: "
        "its differences and errata must not move, and what is checked is held to the thresholds that stand in it",
    )  # fmt: skip
    check.add_argument("--tolerance", type=tolerance, metavar="X", help=TOLERANCE_HELP)
    check.add_argument(
        "--only", type=_groups, metavar="LIST", help="some of ice,vectors,convergence,reference,thresholds, "
        "and of other chapters that can be checked (default: all; thresholds only with --baseline)",
    )  # fmt: skip
    add_guests(check, "certify another solver, too, and hold it to what the baseline knows of it")
    add_json(check, "the findings")
    add_no_cache(check)
    check.add_argument("--junit", type=output, metavar="FILE", help="write the verdicts as JUnit XML, too")


def command_diff(options: argparse.Namespace) -> int:
    """Print what differs; return 1 if anything does."""
    from flipproof.check.diff import TOLERANCE, compare_summaries, read_summary

    old, new = read_summary(options.old), read_summary(options.new)
    comparison = compare_summaries(old, new, TOLERANCE if options.tolerance is None else options.tolerance)
    write_json(options.json, comparison.to_mapping())
    print(inert(comparison.text))
    return 0 if comparison.same else 1


def command_check(options: argparse.Namespace) -> int:
    """Print one line per claim, the verdict first; return 1 if one fails."""
    from slicemodel import Scenario

    scenario = Scenario.from_toml(options.scenario)
    check_guests(options.guests)
    from flipproof.check.throw import groups as known_groups

    groups = options.only or tuple(group for group in known_groups() if options.baseline or group != "thresholds")
    if "thresholds" in groups and options.baseline is None:
        raise ValueError("--only thresholds: needs --baseline, the summary.json of a report of this throw")
    if options.tolerance is not None and options.baseline is None:
        raise ValueError(f"--tolerance {options.tolerance:g}: needs --baseline, whose findings it is allowed to move")
    from flipproof.check.diff import TOLERANCE
    from flipproof.check.throw import check

    allowed = TOLERANCE if options.tolerance is None else options.tolerance

    with store_of(options) as store:
        checked = check(
            scenario, groups, baseline=options.baseline, tolerance=allowed, say=tell, store=store,
            guests=options.guests, timeout=options.timeout,
        )  # fmt: skip
    write_junit(options.junit, checked.findings, "flipproof check")
    write_json(
        options.json,
        {"findings": [finding.to_mapping() for finding in checked.findings], "conclusion": checked.conclusion},
    )
    print(inert(checked.conclusion), flush=True)
    return 1 if checked.failed else 0


def _groups(text: str) -> tuple[str, ...]:
    from flipproof.check.throw import groups

    requested, available = [word.strip() for word in text.split(",") if word.strip()], groups()
    unknown = [word for word in requested if word not in available]
    if unknown or not requested:
        raise argparse.ArgumentTypeError(f"{', '.join(unknown) or text!r} is not among {', '.join(available)}")
    return tuple(group for group in available if group in requested)


def add_compare(commands: Any) -> None:
    """Add the command."""
    compare = add_command(commands, "compare", "Compare two solvers, or two files, in numbers.", command_compare)
    compare.add_argument(
        "first", metavar="A", help="a solver's name or spec, or a CSV file with a column t and at least one of omega, "
        "theta and r_cm; empty cells are left out, and of a track.csv the flight is taken",
    )  # fmt: skip
    compare.add_argument("second", metavar="B", help="the same; differences are B minus A")
    compare.add_argument("--scenario", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    compare.add_argument("--slices", type=count, metavar="N", help="slices for both solvers (default: at most 50)")
    compare.add_argument(
        "--tolerance", type=tolerance, metavar="X", help="end with status 1 if the largest difference in omega exceeds "
        "X omega_0; without omega in both, in theta X rad; without theta, in r_cm X m",
    )  # fmt: skip
    compare.add_argument(
        "--columns", type=_names, metavar="x,y", help="compare these columns of two files (.csv, .parquet, .npz or "
        ".nc; times in t or time) of any system, each in its own unit; default for files without omega, theta and r_cm",
    )  # fmt: skip
    compare.add_argument(
        "--twin", type=Path, action="append", default=[], metavar="FILE", help="a run that should equal A: its release "
        "differs in a late digit, or its step is coarser; shows how long A and B can be compared; may be repeated",
    )  # fmt: skip
    compare.add_argument(
        "--twin-of-b", type=Path, action="append", default=[], metavar="FILE", help="a run that ought to be B"
    )
    compare.add_argument("--from-twins", action="store_true", help="allow only the differences that the twins show")
    compare.add_argument(
        "--shift", type=tolerance, metavar="S", help="time by which a jump may be early or late, beyond one output "
        "step and what the twins show",
    )  # fmt: skip
    compare.add_argument("--plot", type=picture, metavar="FILE.png", help="draw files' differences (.png or .svg)")
    add_json(compare, "both curves' differences")
    compare.add_argument("--junit", type=output, metavar="FILE", help="write that verdict as JUnit XML, too")


def _names(text: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))


def _names_file(path: Path) -> bool:
    """Return whether a name is that of a file, there or not; what has a colon is a solver's spec."""
    return path.is_file() or ((path.suffix != "" or len(path.parts) > 1) and ":" not in str(path))


def _compares_any_system(options: argparse.Namespace) -> bool:
    """Return whether two files are to be compared that need not be throws of a bottle."""
    from flipproof.curves.files import SUFFIXES

    for_files = options.columns is not None or options.twin or options.twin_of_b or options.from_twins or options.plot
    for_files = for_files or options.shift is not None
    paths = Path(options.first), Path(options.second)
    if not all(path.is_file() for path in paths):
        if for_files:
            missing = next(path for path in paths if not path.is_file())
            raise ValueError(f"{missing} is no file: --columns, --twin, --from-twins, --shift and --plot compare files")
        for path in paths:
            if _names_file(path) and not path.exists():
                raise ValueError(f"{path} is no file")
        return False
    if for_files or any(path.suffix in (".parquet", ".npz", ".nc") for path in paths):
        return True
    from flipproof.output.tables import QUANTITIES, read_cells

    if any({*QUANTITIES} & {*read_cells(path)[0]} for path in paths):
        return False
    if other := next((path for path in paths if path.suffix not in SUFFIXES), None):
        raise ValueError(f"{other}: the name must end in {', '.join(SUFFIXES)}")
    return True


def _compare_curves(options: argparse.Namespace) -> Comparison:
    """Compare two files of any system."""
    from flipproof.curves.compare import TOLERANCE, compare
    from flipproof.curves.files import read

    if options.columns == ():
        raise ValueError("--columns names no column")
    if options.scenario is not None:
        raise ValueError("--scenario is that of throws; these files may be of anything")
    if options.from_twins and options.tolerance is not None:
        raise ValueError("--from-twins and --tolerance exclude each other")
    first, second = (read(name, options.columns) for name in (options.first, options.second))
    twins, twins_of_b = ([read(path, options.columns) for path in paths] for paths in (options.twin, options.twin_of_b))
    allowed = None if options.from_twins else TOLERANCE if options.tolerance is None else options.tolerance
    return compare(
        first, second, twins=twins, twins_of_second=twins_of_b, columns=options.columns, tolerance=allowed,
        shift=options.shift or 0.0,
    )  # fmt: skip


def _compare_flights(options: argparse.Namespace) -> tuple[Comparison, list[str]]:
    """Compare two solvers or files of throws; also return what is printed of the throws, in lines."""
    from flipproof.check.comparison import compare_flights, ends
    from flipproof.frame.solvers import find
    from flipproof.frame.timing import solve_timed
    from flipproof.frame.twins import TRUSTED, doubt
    from flipproof.output.tables import Curve, read_curve

    if options.junit and options.tolerance is None:
        raise ValueError(f"--junit {options.junit} needs --tolerance: without it no comparison can fail")
    scenario = read_scenario(options.scenario, options.slices, 50)
    stopped: list[str] = []
    flown: list[str] = []

    def load(name: str) -> Curve:
        if _names_file(path := Path(name)):
            return read_curve(path)
        run, seconds = solve_timed(find(name).name, scenario)
        flown.append(name)
        if len(run.t) < 2:
            raise ValueError(f"{name} has nothing to compare on this throw: {run.status}: {run.message}")
        warnings = [doubt(run, seconds, TRUSTED if options.tolerance is None else options.tolerance)]
        if not run.ok:
            stopped.append(f"{name}: {run.status}: {run.message}")
            warnings.append(f"{stopped[-1]}; its flight counts up to t = {run.t[-1]:.4g} s of {scenario.duration:g} s")
        return replace(Curve.of(run), notes=tuple(filter(None, warnings)))

    first, second = load(options.first), load(options.second)
    allowed = math.inf if options.tolerance is None else options.tolerance
    comparison = compare_flights(first, second, allowed, "; ".join(stopped))
    cut = [f"{' and '.join(dict.fromkeys(flown))}: N = {scenario.n_slices} slices"] if flown else []
    return comparison, [*cut, *ends(comparison, first)]


def command_compare(options: argparse.Namespace) -> int:
    """Compare two solvers or files and print the differences; return 1 if they differ, or cannot be compared."""
    lines: list[str] = []
    if _compares_any_system(options):
        comparison = _compare_curves(options)
    else:
        comparison, lines = _compare_flights(options)
    write_json(options.json, comparison.to_mapping())
    write_junit(options.junit, comparison.findings, "flipproof compare")
    if options.plot:
        from flipproof.curves import figure

        write_picture(options.plot, figure.picture(comparison))
    for line in [*lines, *comparison.lines]:
        tell(line)
    return 0 if comparison.passed else 1
