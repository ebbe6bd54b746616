"""The commands of ``flipproof`` about solvers, its own and anybody's: models, certify, place, explain."""

from __future__ import annotations

import argparse
import json
import textwrap
from contextlib import closing
from dataclasses import asdict
from typing import Any

from flipproof.cli.arguments import (
    SCENARIO_HELP,
    add_command,
    add_json,
    count,
    output,
    read_scenario,
    seed,
    write_json,
    write_junit,
)
from flipproof.cli.console import say, tell
from flipproof.figures.spoken import inert

SPEC_HELP = (
    "a name that flipproof models lists, package.module:name, file.py:name, "
    "cmd:'program {scenario} {times} {start} {effort} {out}' or csv:FOLDER; it runs with your rights"
)


def add_foreign(commands: Any) -> None:
    """Add the commands."""
    certify = add_command(
        commands, "certify", "Test a solver with the conformance suite, one line per check.", command_certify
    )
    _add_spec(certify)
    certify.add_argument("--equation", metavar="E", help="test the solver against this equation, whatever it declares")
    declared = certify.add_argument_group("for a cmd: or csv: solver, which cannot declare these itself")
    declared.add_argument("--name", help="its name")
    declared.add_argument("--refined-by", choices=("dt", "steps", "rtol"), help="what its effort is")
    declared.add_argument(
        "--precision",
        choices=("float64", "float32", "8 digits", "7 digits", "6 digits"),
        help="of its arithmetic, or of what it prints",
    )
    declared.add_argument("--order", type=float, metavar="P", help="order of its error before impacts")
    certify.add_argument("--seed", type=seed, metavar="K", help="seed of the random throws of the check elsewhere")
    add_json(certify, "the passport (traits, results, versions)")
    certify.add_argument("--junit", type=output, metavar="FILE", help="write the verdicts as JUnit XML")
    certify.add_argument("--badge", type=output, metavar="FILE", help="draw verdict and domain as SVG, for a README")

    place = add_command(commands, "place", "Find out which equation a solver solves, and how well.", command_place)
    _add_spec(place)
    place.add_argument("--json", action="store_true", help="print JSON")

    explain = add_command(commands, "explain", "Split the difference of two solvers over assumptions.", command_explain)
    explain.add_argument("first", metavar="A", help=SPEC_HELP)
    explain.add_argument("second", metavar="B", help="the same")
    explain.add_argument("--scenario", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    explain.add_argument("--slices", type=count, metavar="N", help="slices of the throw (default: at most 10)")


def add_models(commands: Any) -> None:
    """Add the command that lists solvers."""
    models = add_command(commands, "models", "List every scheme, model and engine.", command_models)
    models.add_argument("--json", action="store_true", help="print JSON")


def command_models(options: argparse.Namespace) -> int:
    """List every solver with its equation and the reason it is there, and what packages offer; none is imported."""
    from flipproof.foreign.specs import offered
    from flipproof.frame.solvers import catalogue

    built_in, points = catalogue(), sorted(offered().items())
    if options.json:
        solvers = {name: asdict(solver) for name, solver in built_in.items()}
        external = {n: {"object": p.value, "distribution": p.dist.name if p.dist else None} for n, p in points}
        print(json.dumps({"solvers": solvers, "offered": external}, indent=1, ensure_ascii=False))
        return 0
    package = ""
    for solver in built_in.values():
        if solver.package != package:
            package = solver.package
            print(f"\n{package}.solve(scenario, {solver.keyword}=...)\n")
        print(f"  {solver.name}")
        for text in (solver.equation, solver.reason):
            print(textwrap.fill(text, width=100, initial_indent="      ", subsequent_indent="      "))
    if points:
        print("\nsolvers that installed packages offer, imported when they are named\n")
    for name, point in points:
        owner = f"{point.dist.name} {point.dist.version}" if point.dist else "an unnamed package"
        print(f"  {name}\n      {point.value}, from {owner}")
    return 0


def _add_spec(command: argparse.ArgumentParser) -> None:
    command.add_argument("spec", metavar="SPEC", help=SPEC_HELP)
    command.add_argument(
        "--timeout", type=count, metavar="S", help="seconds one run may take (default: as it declares)"
    )
    command.add_argument(
        "--memory", type=count, metavar="MB", help="megabytes one run may take (default: half of the machine's)"
    )


def _opened(options: argparse.Namespace, **given: Any) -> Any:
    """Return the runner of ``options.spec``, with its limits."""
    from flipproof.foreign.solving import opened
    from flipproof.foreign.specs import offered
    from flipproof.frame.solvers import catalogue

    if options.spec in catalogue() and options.spec in offered():
        say(f"{options.spec} is flipproof's own; the entry point of that name is hidden")
    memory = options.memory * 1e6 if options.memory else None
    return opened(options.spec, options.timeout, memory=memory, given=given)


def command_certify(options: argparse.Namespace) -> int:
    """Print one line a check; return 1 if one failed, or if answers are missing."""
    from flipproof.foreign.badge import badge
    from flipproof.foreign.certify import certify, findings_of
    from flipproof.foreign.contract import check_equation
    from flipproof.foreign.files import Folder
    from flipproof.foreign.throws import SEED
    from flipproof.output.folder import write_text

    if options.equation is not None:
        check_equation(options.equation)
    names = ("name", "refined_by", "precision", "order")
    given = {name: value for name in names if (value := getattr(options, name)) is not None}

    drawn = SEED if options.seed is None else options.seed
    with closing(_opened(options, **given)) as runner:
        certificate = certify(runner, equation=options.equation, seed=drawn, say=lambda result: tell(result.line))
        write_json(options.json, certificate.to_mapping())
        write_junit(options.junit, findings_of(certificate), f"flipproof certify {certificate.traits.name}")
        if options.badge:
            write_text(options.badge, badge(certificate))
    tell(certificate.conclusion)
    waiting = len(runner.waiting) if isinstance(runner, Folder) else 0
    if waiting:
        questions = "1 question waits" if waiting == 1 else f"{waiting} questions wait"
        tell(f"{questions} for answer.csv (columns t, theta, omega; r_0 to r_(N-1), v_0 to v_(N-1) if you have them)")
        tell(f"in {runner.folder}; certify again when they are there")
    return 1 if certificate.failed or waiting else 0


def command_place(options: argparse.Namespace) -> int:
    """Print where a solver stands; return 1 if it is off the lattice."""
    from flipproof.foreign.contract import ForeignError
    from flipproof.foreign.place import place

    with closing(_opened(options)) as runner:
        _ = runner.traits  # loads the solver: one that cannot be loaded is an error, not off the lattice
        try:
            placement = place(runner)
        except ForeignError as error:
            words = f"{options.spec} cannot be placed; it does not answer the throws that tell equations apart: {error}"
            tell(words)
            return 1
    sentence = "; ".join(filter(None, (placement.text, placement.advice)))
    print(json.dumps(placement.to_mapping(), indent=1) if options.json else inert(sentence))
    return 0 if placement.on_lattice else 1


def command_explain(options: argparse.Namespace) -> int:
    """Print why two solvers differ; return 1 if one is off the lattice, or flies this throw otherwise."""
    from flipproof.foreign.place import explain
    from flipproof.foreign.solving import opened

    throw = read_scenario(options.scenario, options.slices, 10)
    with closing(opened(options.first)) as first, closing(opened(options.second)) as second:
        found = explain(first, second, throw)
    print(inert(found.text))
    return 0 if found.fits else 1
