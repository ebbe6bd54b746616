"""The commands of ``flipproof`` about the landing: one throw, and the share of many that ends upright."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

from flipproof.cli.arguments import (
    SCENARIO_HELP,
    add_command,
    count,
    numbers,
    read_scenario,
    reader,
    real,
    seed,
    sides,
)
from flipproof.cli.sweeps import add_store, fill

SLICES: Final = 20

cells = reader(
    "COLUMNSxROWS, each in [2, 200], such as 24x24", sides, lambda counts: min(counts) >= 2 and max(counts) <= 200
)
scatter = reader(
    "SPIN,DEGREES,SPEED, three numbers in [0, 1e6), the largest at least 1e-6: without scatter all throws of a point "
    "are the same throw",
    numbers,
    lambda values: len(values) == 3 and all(0.0 <= value < 1e6 for value in values) and max(values) >= 1e-6,
)
fillings = reader(
    "X,Y,Z, fill fractions in (0, 1] that increase",
    numbers,
    lambda values: all(before < value <= 1.0 for before, value in pairwise((0.0, *values))),
)


def add_landing(commands: Any) -> None:
    """Add both commands."""
    land = add_command(commands, "land", "Land one throw: touch, outcome and certificate, law by law.", command_land)
    land.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    where = land.add_mutually_exclusive_group()
    where.add_argument(
        "--height", type=real, metavar="M", help="height of the table above the cap at release [m] (default: the "
        "bottle, if upright, touches it at the end of the throw's duration)",
    )  # fmt: skip
    where.add_argument("--aim", choices=("A", "B"), help="solve for a throw that touches upright; see 'upright'")
    _add_table(land)
    land.add_argument("--law", metavar="NAME", help="together or in-turn (default: both)")
    land.add_argument("--programs", default="ode_reference", metavar="A,B", help="ode_reference, mujoco (%(default)s)")
    land.add_argument("--slices", type=count, metavar="N", help=f"slices (default: at most {SLICES})")

    upright = add_command(
        commands, "upright", "Count how many scattered throws land upright, or resume the count.", command_upright
    )
    upright.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    upright.add_argument("--throws", type=count, default=300, metavar="N", help="throws a point (%(default)s)")
    upright.add_argument(
        "--slices", type=count, metavar="N", help="slices (default: 16 to 25 in turn, whose mean is the share)"
    )
    upright.add_argument(
        "--fillings", type=fillings, metavar="X,Y,Z", help="fill fractions (default: eight, 0.1 to 0.95)"
    )
    upright.add_argument(
        "--families", default="A,B", metavar="A,B", help="A: omega_0 as thrown, height of the table solved for; B: "
        "time of flight as thrown, omega_0 solved for (%(default)s)",
    )  # fmt: skip
    upright.add_argument(
        "--scatter", type=scatter, metavar="SPIN,DEGREES,SPEED", help="standard deviations, not all 0: share of "
        "omega_0, of theta_0 [degrees], of the upward launch velocity [m/s] (0.05,5,0.1)",
    )  # fmt: skip
    upright.add_argument("--seed", type=seed, default=1, metavar="N", help="seed of all throws (%(default)s)")
    upright.add_argument("--map", type=cells, default=(24, 24), metavar="CxR", help="cells of the map (24x24)")
    _add_table(upright)
    add_store(upright)


def _add_table(command: argparse.ArgumentParser) -> None:
    command.add_argument("--restitution", type=real, default=0.3, metavar="E", help="of rim and table (%(default)s)")
    command.add_argument("--friction", type=real, default=0.4, metavar="MU", help="of rim and table (%(default)s)")


def command_land(options: argparse.Namespace) -> int:
    """Throw one bottle on a table and say how it lands."""
    throw = read_scenario(options.scenario, options.slices, SLICES)
    _check_weight(throw)
    from flipproof.chapters.landing.single import describe, land_throw
    from flipproof.chapters.landing.study import standing
    from flipproof.chapters.landing.throws import aimed, mirrored
    from flipproof.frame.beside import beside
    from ode_reference.landing.flight import NotReachedError
    from slicemodel import Table

    Table(height=0.0, restitution=options.restitution, friction=options.friction)
    height = options.height
    if options.aim:
        aim = beside(aimed, throw, options.aim)
        aimed_throw = aim.throw if throw.omega0 > 0.0 else mirrored(aim.throw)
        throw, height = replace(aimed_throw, duration=aim.time), aim.height
    elif height is None:
        height = standing(throw).height
    table = Table(height=height, restitution=options.restitution, friction=options.friction)
    programs = list(dict.fromkeys(name.strip() for name in options.programs.split(",")))
    try:
        rows = beside(land_throw, throw, table, options.law, programs)
    except NotReachedError as error:
        if options.aim:
            words = f"--aim {options.aim}: no table meets this bottle from above when it is upright ({error})"
            raise ValueError(words) from error
        raise
    if options.aim:
        print(f"aimed: omega_0 = {throw.omega0:.4f} rad/s, table at {height:.4f} m, touch after {aim.time:.4f} s")
    print(describe(rows, table))
    return 0


def _check_weight(throw: Any) -> None:
    """Refuse a throw that nothing lets fall on a table."""
    if throw.gravity == 0.0:
        raise ValueError("gravity = 0 m/s^2: nothing falls on a table")


def command_upright(options: argparse.Namespace) -> int:
    """Make the throws of the study that have no row yet, and write its tables and figures."""
    throw = read_scenario(options.scenario, options.slices or SLICES)
    from flipproof.chapters.landing.study import Size
    from flipproof.chapters.landing.throws import FAMILIES, Scatter
    from flipproof.presets.upright import make_upright
    from flipproof.sweep.errors import refuse_unknown
    from slicemodel import Table

    Table(height=0.0, restitution=options.restitution, friction=options.friction)
    families = tuple(dict.fromkeys(name.strip() for name in options.families.split(",")))
    refuse_unknown("--families", families, FAMILIES)
    _check_weight(throw)
    if throw.frozen:
        raise ValueError("scenario.frozen = true: the study throws water and ice beside it; leave it out")
    size = Size(
        families=families,
        axis_throws=options.throws,
        aim_throws=max(1, options.throws // 5),
        map_cells=options.map,
        **{name: getattr(options, name) for name in ("throws", "restitution", "friction", "seed")},
    )
    if options.slices:
        size = replace(size, slices=options.slices, cuts=(options.slices,))
    if options.fillings:
        middle = min(options.fillings, key=lambda filling: abs(filling - size.axis_filling))
        size = replace(size, fillings=options.fillings, axis_filling=middle)
    if options.scatter:
        spin, angle, speed = options.scatter
        size = replace(size, scatter=Scatter(spin=spin, angle=math.radians(angle), speed=speed))

    told = {"say": lambda _: None} if options.quiet else {}
    return fill(options, lambda begin, where: make_upright(throw, size, options.out, begin, **where | told))
