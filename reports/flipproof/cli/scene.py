"""The command ``flipproof scene``: a throw as a scene of other engines."""

from __future__ import annotations

import argparse
from typing import Any

from flipproof.cli.arguments import SCENARIO_HELP, add_command, count, output, read_scenario


def add_scene(commands: Any) -> None:
    """Add the command."""
    scene = add_command(commands, "scene", "Write a throw for other engines, with exact answers.", command_scene)
    scene.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    scene.add_argument("--format", choices=["mjcf", "urdf"], default="mjcf", help="(default %(default)s)")
    scene.add_argument("--slices", type=count, default=10, metavar="N", help="slices, alpha/2m unchanged (%(default)s)")
    scene.add_argument("--out", type=output, required=True, metavar="FOLDER", help="folder to write, made if missing")


def command_scene(options: argparse.Namespace) -> int:
    """Write the scene."""
    from flipproof.output.scene import write_scene

    write_scene(read_scenario(options.scenario, options.slices), options.out, options.format)
    print(f"{options.out}: the scene, scene.json, answers.csv; python {options.out / 'readback.py'} checks an engine")
    return 0
