"""The commands of ``flipproof`` that fill a folder with runs and can be run again to go on: sweep, map, waterfall."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from flipproof.cli.arguments import SCENARIO_HELP, add_command, count, place, read_scenario, reader, sides
from flipproof.cli.console import say
from flipproof.cli.progress import progress_bar
from flipproof.cli.signals import INTERRUPTED

SLICES: Final = 50

size = reader(
    "COLUMNSxROWS, each in [2, 1000], such as 20x20", sides, lambda cells: min(cells) >= 2 and max(cells) <= 1000
)


def add_sweeps(commands: Any) -> None:
    """Add the three commands."""
    sweep = add_command(
        commands, "sweep", "Run many throws with many solvers, or resume an interrupted sweep.", command_sweep
    )
    sweep.add_argument("design", type=Path, metavar="SWEEP.toml", help="which fields vary, and which solvers")
    add_store(sweep)

    drawn = add_command(commands, "map", "Map which mistake matters where, or resume the map.", command_map)
    drawn.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    drawn.add_argument(
        "--axis", choices=("gamma", "step", "restitution"), required=True, help="what varies besides the fill fraction"
    )
    drawn.add_argument(
        "--size", type=size, default=(20, 20), metavar="CxR", help="fill fractions by values of the axis (20x20)"
    )
    drawn.add_argument("--slices", type=count, metavar="N", help=f"slices of every throw (default: at most {SLICES})")
    add_store(drawn)

    waterfall = add_command(
        commands, "waterfall", "Split the published program's error over its assumptions, or resume.",
        command_waterfall,
    )  # fmt: skip
    waterfall.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    waterfall.add_argument("--slices", type=count, metavar="N", help=f"slices (default: at most {SLICES})")
    add_store(waterfall)


def command_sweep(options: argparse.Namespace) -> int:
    """Make the points of a design that have no row yet."""
    from flipproof.sweep.command import sweep

    return fill(options, lambda begin, where: sweep(options.design, options.out, begin, **where))


def command_map(options: argparse.Namespace) -> int:
    """Make the runs of a map that have no row yet, and draw it."""
    throw = read_scenario(options.scenario, options.slices, SLICES)
    from flipproof.presets.planned import MapPlan, make_map

    plan = MapPlan.of_size(throw, options.axis, *options.size)
    return fill(options, lambda begin, where: make_map(plan, options.out, begin, **where))


def command_waterfall(options: argparse.Namespace) -> int:
    """Make the runs of a waterfall that have no row yet, and draw it."""
    throw = read_scenario(options.scenario, options.slices, SLICES)
    from flipproof.presets.planned import make_split

    return fill(options, lambda begin, where: make_split(throw, options.out, begin, **where))


def add_store(command: argparse.ArgumentParser) -> None:
    """Add what every command takes that fills a folder: where its rows go, who makes them, what they begin with."""
    command.add_argument("--out", type=place, required=True, metavar="DIR", help="folder; holds a SQLite file of rows")
    where = command.add_mutually_exclusive_group()
    where.add_argument("--jobs", type=count, metavar="N", help="worker processes (default: one per core)")
    where.add_argument(
        "--executor", type=_executor, metavar="MODULE:FACTORY", help="factory of the concurrent.futures.Executor to "
        "use; with an argument, MODULE:FACTORY@ARGUMENT; Dask: distributed:Client@tcp://127.0.0.1:8786",
    )  # fmt: skip
    command.add_argument("--export", type=place, metavar="FILE", help="when complete, write all rows to a .csv or .nc")
    command.add_argument("--quiet", action="store_true", help="no progress")


def _executor(text: str) -> str:
    if not re.fullmatch(r"[\w.]+:\w+(@.+)?", text):
        raise argparse.ArgumentTypeError(f"{text!r} is not MODULE:FACTORY or MODULE:FACTORY@ARGUMENT")
    return text


def fill(options: argparse.Namespace, make: Callable[[Any, dict[str, Any]], str]) -> int:
    """Run ``make(begin, where)`` under a bar of progress and print what it returns; an interrupt says what is kept."""
    from contextlib import ExitStack

    stored = [0, 0]

    def begin(size: int) -> Callable[[int, int, int], None]:
        bars.close()
        stored[:] = 0, size
        show = bars.enter_context(progress_bar(options.out.name, "point", quiet=options.quiet))

        def progress(done: int, without: int, before: int) -> None:
            stored[0] = done
            show(done, size, f"{without} without a whole flight" if without else "", before)
            if done >= size:
                bars.close()

        return progress

    try:
        with ExitStack() as bars:
            where = {"jobs": options.jobs, "executor": options.executor, "export_to": options.export, "say": say}
            words = make(begin, where)
    except KeyboardInterrupt:
        # An interrupt may fall between the storing of rows and their counting, or before older rows were looked at.
        sentence = f"at least {stored[0]} of {stored[1]} points are stored; " if stored[1] else ""
        say(f"interrupted; {sentence}the same command goes on from there")
        return INTERRUPTED
    print(words)
    return 0
