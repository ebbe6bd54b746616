"""The command ``flipproof scene``: a throw as a scene of other engines."""

from __future__ import annotations

import argparse
from typing import Any

from flipproof.cli.arguments import SCENARIO_HELP, add_command, count, place, read_scenario


def add_scene(commands: Any) -> None:
    """Add the command."""
    scene = add_command(commands, "scene", "Write a throw for other engines, with exact answers.", command_scene)
    scene.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    scene.add_argument("--format", choices=["mjcf", "urdf"], default="mjcf", help="(default %(default)s)")
    scene.add_argument("--slices", type=count, default=10, metavar="N", help="slices, alpha/2m unchanged (%(default)s)")
    scene.add_argument("--out", type=place, required=True, metavar="FOLDER", help="folder to write or replace")


def command_scene(options: argparse.Namespace) -> int:
    """Write the scene."""
    from flipproof.output.folder import replaced_folder
    from flipproof.output.scene import write_scene

    throw = read_scenario(options.scenario, options.slices)
    with replaced_folder(options.out, "scene") as folder:
        doubted = write_scene(throw, folder, options.format)
    engine = "pinocchio" if options.format == "urdf" else "mujoco"
    print(f"{options.out}: the scene, scene.json, answers.csv")
    if doubted:
        print(f"answers.csv, {doubted}")
    print(f"python {options.out / 'readback.py'} {engine}  # compares what an engine reads with scene.json")
    return 0
