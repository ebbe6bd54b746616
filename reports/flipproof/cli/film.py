"""The commands of ``flipproof`` for one's own videos: track, export and fit."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from flipproof.cli.arguments import (
    SCENARIO_HELP,
    add_command,
    check_outputs,
    command_line,
    count,
    digits,
    number,
    read_scenario,
    reader,
)
from flipproof.cli.progress import progress_bar

DELIMITERS = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " "}

frames = reader("a whole number in [0, 1000]", digits, lambda value: value <= 1000)

LINE = 15.0
"""Seconds between two lines of a log."""


def add_film(commands: Any) -> None:
    """Add the three commands."""
    track = add_command(commands, "track", "Analyse a bottle flip tracked in the Tracker video tool.", command_track)
    track.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="what Tracker's File > Export > Data File wrote"
    )
    track.add_argument("--cap", required=True, metavar="NAME", help="track of the cap")
    track.add_argument("--base", required=True, metavar="NAME", help="track of the base")
    centre = track.add_mutually_exclusive_group()
    centre.add_argument("--ice-top", metavar="NAME", help="track of the top of the ice: C_M half-way to the base")
    centre.add_argument("--centre", metavar="NAME", help="track of the centre of mass")
    centre.add_argument(
        "--r-cm", type=number, metavar="M", help="centre of mass fixed at this distance from the cap [m]"
    )
    track.add_argument("--length-unit", default="", metavar="UNIT", help="of x and y: m, cm, mm (needed unless stated)")
    track.add_argument("--angle-unit", default="", metavar="UNIT", help="of exported angles: deg, rad")
    track.add_argument("--time-unit", default="s", metavar="UNIT", help="of t: s, ms (%(default)s)")
    track.add_argument("--frame-rate", type=number, metavar="HZ", help="of the recording, if t is that of slow motion")
    track.add_argument("--length", type=number, metavar="M", help="cap to base, measured by hand [m]")
    track.add_argument(
        "--table-height", type=number, metavar="M", help="y of the table [m]: landing when the base is there"
    )
    track.add_argument("--release", type=number, metavar="S", help="time of release [s] instead of finding it")
    track.add_argument("--landing", type=number, metavar="S", help="time of landing [s] instead of finding it")
    track.add_argument(
        "--window", type=count, default=11, metavar="N", help="frames of the derivative, odd (%(default)s)"
    )
    track.add_argument(
        "--max-gap", dest="most_gap", type=frames, default=3, metavar="N", help="frames interpolated at most "
        "(%(default)s)",
    )  # fmt: skip
    track.add_argument("--angle-track", metavar="NAME", help="track whose own angle is compared with Eq. 1")
    track.add_argument("--out", type=Path, metavar="DIR", help="folder for track.csv, figures and page")

    export = add_command(
        commands, "export", "Write a simulation as a table that Tracker lays over a video.", command_export
    )
    export.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    export.add_argument("--solver", required=True, metavar="NAME", help="see 'flipproof models'")
    export.add_argument("--format", choices=("tracker",), default="tracker", help="data track (%(default)s)")
    export.add_argument("--out", type=Path, metavar="FILE", help="file to write (default: standard output)")
    export.add_argument("--slices", type=count, metavar="N", help="cut the throw into N slices, alpha/2m unchanged")
    export.add_argument("--speed", type=number, metavar="V", help="of C_M at release [m/s] (default: the scenario's)")
    export.add_argument("--launch-angle", type=number, metavar="DEG", help="of that velocity above the horizontal")
    export.add_argument("--height", type=number, metavar="M", help="table over the cap at release [m]: stop on landing")
    export.add_argument("--frame-rate", type=number, default=240.0, metavar="HZ", help="of the video (%(default)g)")
    export.add_argument("--start", type=number, default=0.0, metavar="S", help="time of release in the video (0)")
    export.add_argument(
        "--origin", type=_pair, default=(0.0, 0.0), metavar="X,Y", help="cap at release [m] (0,0); below 0 as "
        "--origin=-0.1,0.2",
    )  # fmt: skip
    export.add_argument("--length-unit", default="m", metavar="UNIT", help="of the video: m, cm, mm (%(default)s)")
    export.add_argument("--delimiter", choices=tuple(DELIMITERS), default="tab", help="between cells (%(default)s)")

    fit = add_command(commands, "fit", "Estimate drag and restitution from a measured flight.", command_fit)
    fit.add_argument(
        "file", type=Path, metavar="FILE", help="CSV with columns t [s] and theta [rad] or omega [rad/s], of which a "
        "track.csv gives its flight, or, with --cap and --base, an export of the Tracker video tool",
    )  # fmt: skip
    fit.add_argument("--scenario", metavar="THROW.toml", help=f"what is known: bottle, water, release; {SCENARIO_HELP}")
    fit.add_argument(
        "--model", nargs="+", default=["midpoint"], metavar="NAME", help="equations to fit and compare, see 'flipproof "
        "models'; midpoint solves eq8 in steps of 0.5 ms (default midpoint)",
    )  # fmt: skip
    fit.add_argument(
        "--also", nargs="+", default=[], choices=("omega0", "theta0"), help="fit these too, instead of trusting the "
        "scenario",
    )  # fmt: skip
    fit.add_argument("--starts", type=count, metavar="K", help="descents from different starts (default 4)")
    fit.add_argument(
        "--minutes", type=_positive, metavar="M", help="time that a fit with another solver, such as mine.py:solve, "
        "may take: it decides between the usual search, a coarse one and none, and ends the search (default 10)",
    )  # fmt: skip
    fit.add_argument("--slices", type=count, metavar="N", help="slices of every throw, alpha/2m unchanged (50)")
    fit.add_argument("--quantity", choices=("theta", "omega"), help="column to fit (theta if there is one)")
    fit.add_argument(
        "--averaged", type=count, metavar="N", help="omega was made of theta by differences and a mean over N points"
    )
    fit.add_argument(
        "--noise", type=_positive, metavar="S", help="standard deviation of one value [rad or rad/s] (default: "
        "estimated from neighbouring values)",
    )  # fmt: skip
    fit.add_argument("--release", type=number, metavar="S", help="time of release by the file's clock [s]")
    fit.add_argument("--landing", type=number, metavar="S", help="time of landing by the file's clock [s]")
    fit.add_argument("--cap", metavar="NAME", help="track of the cap in a Tracker export")
    fit.add_argument("--base", metavar="NAME", help="track of the base in a Tracker export")
    fit.add_argument("--length-unit", default="", metavar="UNIT", help="of a Tracker export: m, cm, mm")
    fit.add_argument("--out", type=Path, metavar="DIR", help="folder for figures, residuals and summary.json")


def command_track(options: argparse.Namespace) -> int:
    """Analyse a video, print a few lines and write the folder."""
    from flipproof.output.folder import check_replaceable

    if options.out is not None:
        check_replaceable(options.out, "track")
    from flipproof.film.tracker.bench import Request, lines, measure

    given = {field.name: getattr(options, field.name) for field in fields(Request)}
    measured = measure(Request(**given | {"files": tuple(options.files)}))

    def write(folder: Path, made: Mapping[str, str]) -> None:
        from flipproof.film.tracker.page import write

        write(measured, folder, made)

    print("\n".join([*lines(measured), *_written(options, "track", write, "index.html")]))
    return 0


def _written(
    options: argparse.Namespace, kind: str, write: Callable[[Path, Mapping[str, str]], None], first: str
) -> list[str]:
    """Write the folder that ``--out`` names, if any, and return the line that tells what to open first."""
    if options.out is None:
        return []
    from flipproof.output.folder import replaced_folder
    from flipproof.output.provenance import provenance

    with replaced_folder(options.out, kind) as folder:
        write(folder, provenance(command_line()))
    return [f"written  {options.out / first}"]


def command_export(options: argparse.Namespace) -> int:
    """Run one solver and write cap, base and centre of mass in the lab, one row per frame."""
    from flipproof.film.tracker.export import at_times, data_track_text, frame_times, until_landing
    from flipproof.film.tracker.table import METRES
    from flipproof.frame.solvers import find, solve
    from flipproof.output.folder import write_text

    if options.length_unit not in METRES:
        raise ValueError(f"length_unit = {options.length_unit!r} is unknown; known: {', '.join(METRES)}")
    check_outputs(options, "out")
    scenario = read_scenario(options.scenario, options.slices)
    scenario = replace(scenario, launch_velocity=_velocity(scenario.launch_velocity, options))
    times = frame_times(scenario, options.frame_rate)
    run = solve(find(options.solver).name, scenario)
    if not run.ok:
        print(f"flipproof: {options.solver}: {run.status}: {run.message}", file=sys.stderr)
    frames = at_times(run, times[times <= run.t[-1]])
    if options.height is not None:
        frames, words = until_landing(run, frames, options.height)
        print(f"flipproof: {words}", file=sys.stderr)
    table = data_track_text(
        frames, start=options.start, origin=options.origin, metres=METRES[options.length_unit],
        delimiter=DELIMITERS[options.delimiter],
    )  # fmt: skip
    if options.out:
        write_text(options.out, table)
    else:
        sys.stdout.write(table)
    return 0


def _velocity(given: tuple[float, float], options: argparse.Namespace) -> tuple[float, float]:
    if options.speed is None and options.launch_angle is None:
        return given
    if options.speed is not None and options.speed < 0:
        raise ValueError(f"speed = {options.speed:g} m/s is outside [0, inf)")
    speed = math.hypot(*given) if options.speed is None else options.speed
    angle = math.atan2(given[1], given[0]) if options.launch_angle is None else math.radians(options.launch_angle)
    return speed * math.cos(angle), speed * math.sin(angle)


def _pair(text: str) -> tuple[float, float]:
    x, comma, y = text.partition(",")
    if not comma:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y in m, such as 0.1,1.2")
    return number(x), number(y)


def command_fit(options: argparse.Namespace) -> int:
    """Fit every equation, print estimates and comparison, and write the folder."""
    from flipproof.output.folder import check_replaceable

    if options.out is not None:
        check_replaceable(options.out, "fit")
    if (options.cap is None) != (options.base is None):
        raise ValueError("--cap and --base name the two tracks of a Tracker export; give both or neither")
    if options.length_unit and options.cap is None:
        raise ValueError(f"--length-unit {options.length_unit} is that of a Tracker export; give --cap and --base, too")
    if len(set(options.model)) < len(options.model):
        raise ValueError(f"--model names {next(n for n in options.model if options.model.count(n) > 1)} twice")
    throw = read_scenario(options.scenario)
    measured, remarks = _read(options)

    from flipproof.film.fit.compare import compare, report
    from flipproof.film.fit.problem import disagreements, pose

    also = tuple(options.also)
    problems = [pose(measured, throw, name, also=also, slices=options.slices) for name in options.model]
    remarks += disagreements(problems[0], throw, also)
    contenders = compare(_estimates(problems, options.starts, options.minutes))
    text = report(contenders, remarks)

    def write(folder: Path, made: Mapping[str, str]) -> None:
        from flipproof.film.fit.folder import write

        write(contenders, text, folder, made)

    print("\n".join([text, *_written(options, "fit", write, "fit.txt")]))
    return 0


def _read(options: argparse.Namespace) -> tuple[Any, list[str]]:
    """Return the measurement, and remarks on how it was read."""
    from flipproof.film.fit.reading import read_flight, read_tracker

    known = {name: getattr(options, name) for name in ("release", "landing", "noise")}
    if options.cap is None:
        return read_flight(options.file, quantity=options.quantity, averaged=options.averaged, **known)
    if options.quantity == "omega" or options.averaged is not None:
        raise ValueError(
            "a Tracker export is fitted by its theta (Eq. 1); --quantity omega and --averaged are for tables"
        )
    tracks = {"cap": options.cap, "base": options.base, "length_unit": options.length_unit}
    measured, words = read_tracker(options.file, **tracks, **known)
    return measured, [words]


def _estimates(problems: Sequence[Any], starts: int | None, minutes: float | None) -> list[Any]:
    """Fit one problem after the other under a bar that counts flights; a log gets a line now and then."""
    from flipproof.film.fit.estimate import MINUTES, USUAL, affordable, estimate
    from flipproof.foreign.specs import is_foreign

    searches = []
    for problem in problems:
        effort, seconds = USUAL, math.inf
        if is_foreign(problem.solver):
            budget = affordable(problem, minutes or MINUTES)
            print(f"flipproof: {problem.solver}: {budget.words}", file=sys.stderr, flush=True)
            effort, seconds = budget.effort, 60.0 * budget.minutes
        searches.append((problem, replace(effort, starts=starts) if starts else effort, seconds))
    estimates = []
    for problem, effort, seconds in searches:
        with progress_bar(problem.solver, "flight") as step:
            tick = _ticker(step, problem.solver, is_foreign(problem.solver))
            estimates.append(estimate(problem, effort, seconds=seconds, tick=tick))
    return estimates


def _ticker(step: Callable[..., None], solver: str, slow: bool) -> Callable[[int], object]:
    """Return what counts flights: the bar of a terminal, and lines in a log of a search that may be ``slow``."""
    began = time.perf_counter()
    made, due = 0, began + LINE

    def tick(count: int) -> None:
        nonlocal made, due
        made += count
        step(made, None)
        now = time.perf_counter()
        if slow and now >= due and not sys.stderr.isatty():
            due = now + LINE
            print(f"flipproof: {solver}: {made} flights in {now - began:.0f} s", file=sys.stderr, flush=True)

    return tick


def _positive(text: str) -> float:
    value = number(text)
    if not value > 0:
        raise argparse.ArgumentTypeError(f"{text!r} is outside (0, 1e6)")
    return value
