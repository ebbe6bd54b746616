"""The command ``flipproof bounce``: a passport of how an engine bounces."""

from __future__ import annotations

import argparse
from typing import Any

from flipproof.cli.arguments import (
    add_command,
    add_json,
    check_outputs,
    check_plot,
    output,
    real,
    write_json,
    write_plot,
)
from flipproof.cli.progress import progress_bar
from flipproof.figures.spoken import inert


def add_bounce(commands: Any) -> None:
    """Add the command."""
    bounce = add_command(commands, "bounce", "Measure how an engine bounces: its passport.", command_bounce)
    bounce.add_argument(
        "adapter",
        nargs="+",
        metavar="ADAPTER",
        help="pymunk, mujoco, box2d, file.py:name, package.module:name or cmd:'program {height} {speed} {restitution} "
        "{gravity} {dt} {duration}', or cmd:'program' that reads them line by line; it runs with your rights",
    )
    bounce.add_argument("--dt", type=real, default=1e-3, metavar="S", help="step in seconds (default 0.001)")
    add_json(bounce, "the passports")
    bounce.add_argument(
        "--plot", type=output, metavar="FILE.png", help="draw the passports, one row per engine (.png or .svg)"
    )


def command_bounce(options: argparse.Namespace) -> int:
    """Measure, print one line per property, write the requested files; the status is 0 whatever the remarks."""
    from flipproof.bounce.passport import passport
    from flipproof.bounce.specs import load

    check_outputs(options, "json", "plot")
    check_plot(options.plot)
    passports = []
    for adapter in map(load, options.adapter):
        print(inert(adapter.name) + f", step {options.dt:g} s")
        with progress_bar(adapter.name, "measurement") as progress:
            passports.append(passport(adapter, options.dt, progress))
        print(inert("".join(f"  {name} = {value}\n" for name, value in adapter.settings.items())), end="")
        for measurement in passports[-1].measurements:
            print(inert(f"{'!' if measurement.remark else ' '} {measurement.name:<14} {measurement.sentence}"))
            if measurement.remark:
                print(inert(f"  {'':<14} {measurement.remark}"))
    write_json(options.json, {"passports": [made.to_mapping() for made in passports]})
    if options.plot:
        from flipproof.bounce.figure import picture

        write_plot(options.plot, picture(passports))
    return 0
