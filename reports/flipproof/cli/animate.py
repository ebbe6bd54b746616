"""The command ``flipproof animate``: the flights as GIF or MP4."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Final

from flipproof.cli.arguments import SCENARIO_HELP, add_command, count, read_scenario
from flipproof.cli.progress import progress_bar

SLICES: Final = 50


def add_animate(commands: Any) -> None:
    """Add the command."""
    animate = add_command(commands, "animate", "Write the flights, side by side, as GIF or MP4.", command_animate)
    animate.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    animate.add_argument("--solvers", metavar="A,B,C", help="see 'flipproof models' (default: those of the report)")
    animate.add_argument(
        "--out", type=Path, default=Path("flips.gif"), metavar="FILE", help="file.gif or file.mp4 (%(default)s)"
    )
    animate.add_argument(
        "--slow", type=float, default=9.6, metavar="X", help="times slower than the flight (%(default)s)"
    )
    animate.add_argument("--fps", type=count, default=25, metavar="N", help="frames per second (%(default)s)")
    animate.add_argument("--slices", type=count, metavar="N", help=f"slices (default {SLICES}, or the file's if fewer)")
    animate.add_argument("--quiet", action="store_true", help="no progress")


def command_animate(options: argparse.Namespace) -> int:
    """Throw the bottles and write the film."""
    scenario = read_scenario(options.scenario)
    throw = scenario.with_slices(options.slices or min(SLICES, scenario.n_slices))
    from flipproof.animate import check_target, film_of, plan_film, write_film
    from flipproof.output.motion import FLOWN

    check_target(options.out)
    times = plan_film(throw, options.slow, options.fps)
    names = chosen_solvers(options.solvers, FLOWN)

    from flipproof.frame.solvers import solve

    runs = []
    for name in names:
        run = solve(name, throw)
        if len(run.t) < 2:
            raise ValueError(f"--solvers {name}: nothing to show on this throw: {run.status}: {run.message}")
        if "r_cm" in run.diagnostics.get("not_given", ()):
            raise ValueError(f"--solvers {name}: gives neither r nor r_cm; a picture needs one of them")
        runs.append(run)
    film = film_of(runs, times, fps=options.fps, slow=options.slow)
    with progress_bar("drawing", "frame", quiet=options.quiet) as step:
        write_film(film, options.out, step)
    seconds = throw.duration * options.slow
    print(f"{options.out}: {len(times)} frames, {len(runs)} bottles, {seconds:.1f} s ({options.slow:g} times slower)")
    return 0


def chosen_solvers(text: str | None, usual: tuple[str, ...]) -> list[str]:
    """Return the solvers that ``--solvers`` names, or the usual ones.

    One that is unknown or named twice, or too many to stand side by side, raise a ValueError.
    """
    if text is None:
        return list(usual)
    from flipproof.frame.solvers import find

    names = [find(name.strip()).name for name in text.split(",")]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"--solvers {text}: {name} is there twice")
    if len(names) > 6:
        raise ValueError(f"--solvers {text}: {len(names)} bottles do not fit (admissible: at most 6)")
    return names
