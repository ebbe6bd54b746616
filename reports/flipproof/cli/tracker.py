"""The commands of ``flipproof`` for one's own videos: track reads a Tracker export, export writes a data track."""

from __future__ import annotations

import argparse
import math
import shlex
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from flipproof.cli.arguments import SCENARIO_HELP, add_command, check_writable, count, number, read_scenario

DELIMITERS = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " "}


def add_tracker(commands: Any) -> None:
    """Add the two commands."""
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
        "--max-gap", dest="most_gap", type=_frames, default=3, metavar="N", help="frames interpolated at most "
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


def command_track(options: argparse.Namespace) -> int:
    """Analyse a video, print a few lines and write the folder."""
    from flipproof.output.folder import check_replaceable, replaced_folder

    if options.out is not None:
        check_replaceable(options.out, "track")
    from flipproof.film.tracker.bench import Request, measure

    given = {field.name: getattr(options, field.name) for field in fields(Request)}
    measured = measure(Request(**given | {"files": tuple(options.files)}))
    from flipproof.film.tracker.page import lines, write

    if options.out is not None:
        from flipproof.output.provenance import provenance

        with replaced_folder(options.out, "track") as folder:
            write(measured, folder, provenance(shlex.join(["flipproof", *sys.argv[1:]])))
    print("\n".join(lines(measured)))
    if options.out is not None:
        print(f"written  {options.out / 'index.html'}")
    return 0


def command_export(options: argparse.Namespace) -> int:
    """Run one solver and write cap, base and centre of mass in the lab, one row per frame."""
    from flipproof.film.tracker.export import at_times, data_track_text, frame_times, until_landing
    from flipproof.film.tracker.table import METRES
    from flipproof.frame.solvers import find, solve
    from flipproof.output.folder import write_text

    if options.length_unit not in METRES:
        raise ValueError(f"length_unit = {options.length_unit!r} is unknown; known: {', '.join(METRES)}")
    if options.out:
        check_writable("--out", options.out)
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


def _frames(text: str) -> int:
    if not text.isdecimal() or int(text) > 1000:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number in [0, 1000]")
    return int(text)


def _pair(text: str) -> tuple[float, float]:
    x, comma, y = text.partition(",")
    if not comma:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y in m, such as 0.1,1.2")
    return number(x), number(y)
