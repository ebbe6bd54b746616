"""The commands of ``flipproof`` for one's own videos: track, export and fit."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flipproof.cli.arguments import (
    SCENARIO_HELP,
    add_command,
    command_line,
    count,
    number,
    output,
    place,
    positive,
    read_scenario,
    real,
)
from flipproof.cli.console import say
from flipproof.cli.progress import progress_bar

if TYPE_CHECKING:
    from flipproof.film.estimate import Estimate
    from flipproof.film.likelihood import Film


def add_film(commands: Any) -> None:
    """Add the three commands."""
    track = add_command(
        commands, "track", "Read a tracked video of a flip and state what it can and cannot show.", command_film
    )
    track.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="data file exported by Tracker (File > Export > Data "
        "File), or a track.csv",
    )  # fmt: skip
    _add_film_arguments(track)
    track.set_defaults(kind="track", model=["free-flight"], minutes=10.0)

    export = add_command(
        commands, "export", "Write a simulation as a table that Tracker lays over a video.", command_export
    )
    export.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    export.add_argument("--solver", required=True, metavar="NAME", help="see 'flipproof models'")
    export.add_argument("--format", choices=("tracker",), default="tracker", help="data track (%(default)s)")
    export.add_argument("--out", type=output, metavar="FILE", help="file to write (default: standard output)")
    export.add_argument("--slices", type=count, metavar="N", help="cut the throw into N slices, alpha/2m unchanged")
    export.add_argument("--height", type=number, metavar="M", help="table above the cap at release [m]: stop there")
    export.add_argument("--frame-rate", type=real, default=240.0, metavar="HZ", help="of the video (%(default)g)")
    export.add_argument("--start", type=number, default=0.0, metavar="S", help="time of release in the video (0)")
    export.add_argument(
        "--origin", type=_pair, default=(0.0, 0.0), metavar="X,Y", help="cap at release [m] (0,0); below 0 as "
        "--origin=-0.1,0.2",
    )  # fmt: skip

    fit = add_command(commands, "fit", "Fit equations to a measured flight and compare them.", command_film)
    fit.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="a file as for track, or a CSV with columns t [s] and "
        "theta [rad] or omega [rad/s], starting at release",
    )  # fmt: skip
    _add_film_arguments(fit)
    fit.add_argument(
        "--model", nargs="+", default=["free-flight"], metavar="NAME", help="equations to fit and compare, see "
        "'flipproof models'; midpoint solves eq8 in steps of 0.5 ms (default free-flight)",
    )  # fmt: skip
    fit.add_argument(
        "--each", action="store_true", help="every FILE is a film of the same bottle: gamma and restitution are shared"
    )
    fit.add_argument(
        "--minutes", type=positive, default=10.0, metavar="M", help="give up a search whose grid takes half of this "
        "many minutes; raise it for a slow solver such as mine.py:solve (%(default)g)",
    )  # fmt: skip
    fit.set_defaults(kind="fit")


def _add_film_arguments(command: argparse.ArgumentParser) -> None:
    command.add_argument("--cap", metavar="NAME", help="track of the cap in a Tracker export")
    command.add_argument("--base", metavar="NAME", help="track of the base in a Tracker export")
    command.add_argument("--length-unit", default="", metavar="UNIT", help="of x and y: m, cm, mm")
    command.add_argument("--time-unit", default="s", metavar="UNIT", help="of t: s, ms (%(default)s)")
    command.add_argument(
        "--frame-rate", type=real, metavar="HZ", help="frame rate of the recording, if t is slow motion"
    )
    command.add_argument("--scenario", metavar="THROW.toml", help=f"bottle and water; {SCENARIO_HELP}")
    command.add_argument("--slices", type=count, metavar="N", help="slices of every throw, gamma unchanged (50)")
    command.add_argument("--release", type=number, metavar="S", help="known time of release by the film's clock [s]")
    command.add_argument("--landing", type=number, metavar="S", help="known time of the touch by the film's clock [s]")
    command.add_argument("--table-height", type=number, metavar="M", help="known y of the table in the picture [m]")
    command.add_argument("--noise", type=positive, metavar="S", help="known noise of one coordinate [m, rad, rad/s]")
    command.add_argument(
        "--hold", nargs="+", default=[], choices=("tilt", "scale"), help="known: the camera is level; the picture's "
        "scale and clock are right",
    )  # fmt: skip
    command.add_argument(
        "--out", type=place, metavar="DIR", help="folder for track.csv, figures, summary.json and page"
    )


def command_film(options: argparse.Namespace) -> int:
    """Fit films, print the estimates and write the folder; return 1 for a film that cannot be right."""
    from flipproof.frame.provenance import provenance
    from flipproof.output.folder import check_replaceable, replaced_folder

    if options.out is not None:
        for path in options.files:
            if path.resolve().is_relative_to(options.out.resolve()):
                raise ValueError(f"--out {options.out} holds {path.name}, which this command reads; name another")
        check_replaceable(options.out, options.kind)
    if len(set(options.model)) < len(options.model):
        raise ValueError(f"--model names {next(n for n in options.model if options.model.count(n) > 1)} twice")
    from flipproof.film import page
    from flipproof.film.judge import Assessment, UnsoundError, compared, ranked, shared_draws

    each_film = options.kind == "fit" and options.each
    for k, path in enumerate(options.files):
        if path in options.files[:k]:
            raise ValueError(f"{path} is there twice")
    if each_film and len(options.model) > 1:
        raise ValueError("--each fits one equation to several films; name one --model")
    scenario = read_scenario(options.scenario)
    groups = [(path,) for path in options.files] if each_film else [tuple(options.files)]
    films: list[list[Assessment]] = []
    for paths in groups:
        film = _film(options, paths)
        assessments = ranked([Assessment(_estimate(options, film, scenario, name)) for name in options.model])
        try:
            assessments[0].check()
        except UnsoundError as error:
            say(str(error))
            return 1
        films.append(assessments)
    lines: list[str] = []
    for assessments in films:
        film = assessments[0].estimate.film
        lines += [f"{film.label}: {len(film.t)} frames ({'; '.join(film.notes)})"]
        for assessment in assessments:
            lines += assessment.lines()
        lines += [compared(assessments), ""]
    if each_film:
        lines += _shared_lines(*shared_draws([assessments[0] for assessments in films]))
    text = "\n".join(lines).rstrip()
    print(text)
    if options.out is not None:
        facts: Mapping[str, str] = provenance(command_line())
        with replaced_folder(options.out, options.kind) as folder:
            for k, assessments in enumerate(films):
                film_folder = folder / f"film-{k + 1}" if each_film else folder
                film_folder.mkdir(exist_ok=True)
                page.write(assessments, text, film_folder, facts)
        print(f"written  {options.out / ('film-1/index.html' if each_film else 'index.html')}")
    return 0


def _film(options: argparse.Namespace, paths: tuple[Path, ...]) -> Film:
    from flipproof.film.clip import read_film

    return read_film(
        paths, cap=options.cap, base=options.base, length_unit=options.length_unit, time_unit=options.time_unit,
        frame_rate=options.frame_rate,
    )  # fmt: skip


def _estimate(options: argparse.Namespace, film: Film, scenario: Any, solver: str) -> Estimate:
    from flipproof.film.estimate import estimate
    from flipproof.film.likelihood import Held

    if None not in (options.release, options.landing) and not options.release < options.landing:
        raise ValueError(f"landing = {options.landing:g} s does not follow release = {options.release:g} s")
    held = Held(
        release=options.release, touch=options.landing, table=options.table_height, tilt="tilt" in options.hold,
        scale="scale" in options.hold, noise=options.noise,
    )  # fmt: skip
    with progress_bar(solver, "flight") as step:
        return estimate(
            film, scenario, solver, held, slices=options.slices, seconds=60.0 * options.minutes,
            tick=lambda flights: step(flights, None),
        )  # fmt: skip


def _shared_lines(draws: Mapping[str, Any], agreement: str) -> list[str]:
    import numpy as np

    from flipproof.film.estimate import UNITS, shortest

    lines = [f"all films together: {agreement}"]
    for name, values in draws.items():
        low, high = shortest(values, 0.95)
        lines.append(f"  {name:12} {np.median(values):.3g} [{low:.3g}, {high:.3g}] {UNITS[name]}".rstrip())
    return lines


def command_export(options: argparse.Namespace) -> int:
    """Run one solver and write cap, base and centre of mass in the lab, one row per frame."""
    import numpy as np

    from flipproof.film.tracker.export import at_times, data_track_text, frame_times, until_landing
    from flipproof.frame.solvers import find
    from flipproof.frame.timing import solve_timed
    from flipproof.frame.twins import doubt
    from flipproof.output.folder import write_text
    from slicemodel.trajectory import output_times

    scenario = read_scenario(options.scenario, options.slices)
    times = frame_times(scenario, options.frame_rate)
    solver = find(options.solver)
    # A scheme has its own grid, between whose points frames are interpolated.
    exact = {} if solver.package == "slicemodel" else {"times": np.union1d(output_times(scenario, None), times)}
    run, seconds = solve_timed(solver.name, scenario, **exact)
    if warning := doubt(run, seconds):
        say(warning)
    if not run.ok:
        say(f"{options.solver}: {run.status}: {run.message}")
    frames = at_times(run, times[times <= run.t[-1]])
    if options.height is not None:
        frames, landing = until_landing(run, frames, options.height, options.start)
        say(landing)
    table = data_track_text(frames, start=options.start, origin=options.origin)
    if options.out:
        write_text(options.out, table)
    else:
        sys.stdout.write(table)
    return 0 if run.ok else 1


def _pair(text: str) -> tuple[float, float]:
    x, comma, y = text.partition(",")
    if not comma:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y in m, such as 0.1,1.2")
    return number(x), number(y)
