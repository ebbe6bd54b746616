"""The command ``flipproof fit``: drag and restitution from a measured flight."""

from __future__ import annotations

import argparse
import math
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

from flipproof.cli.arguments import SCENARIO_HELP, add_command, count, number, read_scenario

LINE = 15.0
"""Seconds between two lines of a log."""


def add_fit(commands: Any) -> None:
    """Add the command."""
    fit = add_command(commands, "fit", "Estimate drag and restitution from a measured flight.", command_fit)
    fit.add_argument(
        "file", type=Path, metavar="FILE", help="CSV with columns t [s] and theta [rad] or omega [rad/s], or, with "
        "--cap and --base, an export of the Tracker video tool",
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
        "may take: it decides between the usual search, a coarse one and none (default 10)",
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


def command_fit(options: argparse.Namespace) -> int:
    """Fit every equation, print estimates and comparison, and write the folder."""
    from flipproof.output.folder import check_replaceable, replaced_folder

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

    from flipproof.film.fit.compare import compare
    from flipproof.film.fit.problem import pose

    also = tuple(options.also)
    problems = [pose(measured, throw, name, also=also, slices=options.slices) for name in options.model]
    remarks += _disagreements(problems[0], throw, also)
    contenders = compare(_estimates(problems, options.starts, options.minutes))
    text = _report(contenders, remarks)
    if options.out is not None:
        from flipproof.film.fit.folder import write
        from flipproof.output.provenance import provenance

        with replaced_folder(options.out, "fit") as folder:
            write(contenders, text, folder, provenance(shlex.join(["flipproof", *sys.argv[1:]])))
    print(text)
    if options.out is not None:
        print(f"written  {options.out / 'fit.txt'}")
    return 0


def _read(options: argparse.Namespace) -> tuple[Any, list[str]]:
    """Return the measurement, and remarks on how it was read."""
    from flipproof.film.fit.reading import read_flight, read_tracker

    known = {name: getattr(options, name) for name in ("release", "landing", "noise")}
    if options.cap is None:
        return read_flight(options.file, quantity=options.quantity, averaged=options.averaged, **known), []
    if options.quantity == "omega" or options.averaged is not None:
        raise ValueError(
            "a Tracker export is fitted by its theta (Eq. 1); --quantity omega and --averaged are for tables"
        )
    tracks = {"cap": options.cap, "base": options.base, "length_unit": options.length_unit}
    measured, words = read_tracker(options.file, **tracks, **known)
    return measured, [words]


def _disagreements(problem: Any, throw: Any, also: tuple[str, ...]) -> list[str]:
    """Return what of the scenario the first frames contradict although it is not fitted."""
    from flipproof.film.fit.problem import first_frames

    near = {"omega0": 0.1 * abs(throw.omega0), "theta0": 0.05}
    return [
        f"the first frames say {name} = {value:.3g}, the scenario {getattr(throw, name):.3g}: correct it or add "
        f"--also {name}"
        for name, value in sorted(first_frames(problem.measured).items())
        if name not in also and abs(value - getattr(throw, name)) > near[name]
    ]


def _estimates(problems: Sequence[Any], starts: int | None, minutes: float | None) -> list[Any]:
    """Fit one problem after the other under a bar that counts flights; a log gets a line now and then."""
    from dataclasses import replace

    from tqdm import tqdm

    from flipproof.film.fit.budget import MINUTES, affordable
    from flipproof.film.fit.estimate import USUAL, estimate
    from flipproof.foreign.specs import is_foreign

    searches = []
    for problem in problems:
        effort, planned = USUAL, None
        if is_foreign(problem.solver):
            budget = affordable(problem, minutes or MINUTES)
            print(f"flipproof: {problem.solver}: {budget.words}", file=sys.stderr, flush=True)
            effort, planned = budget.effort, budget.flights
        searches.append((problem, replace(effort, starts=starts) if starts else effort, planned))
    estimates = []
    for problem, effort, planned in searches:
        with tqdm(desc=problem.solver, total=planned, unit="flight", disable=None, leave=False) as bar:
            estimates.append(estimate(problem, effort, tick=_ticker(bar, problem.solver, planned)))
    return estimates


def _ticker(bar: Any, solver: str, planned: int | None) -> Callable[[int], object]:
    """Return what counts flights: the bar of a terminal, or lines in a log of a search that was estimated."""
    if not bar.disable or planned is None:
        return lambda count: bar.update(count)
    began = time.perf_counter()
    made, due = 0, began + LINE

    def tick(count: int) -> None:
        nonlocal made, due
        made += count
        now = time.perf_counter()
        if now >= due:
            due = now + LINE
            words = f"flipproof: {solver}: {made} of at most about {planned} flights in {now - began:.0f} s"
            print(words, file=sys.stderr, flush=True)

    return tick


def _report(contenders: Sequence[Any], remarks: Sequence[str]) -> str:
    from flipproof.film.fit.compare import verdict

    problem = contenders[0].estimate.problem
    measured = problem.measured
    how = "given" if measured.noise is not None else "estimated from neighbouring values"
    lines = [
        f"{measured.label}: {len(measured.t)} values of {measured.quantity} over {measured.t[-1]:.3f} s; noise of one "
        f"{problem.noise:.3g} {measured.unit} ({how})"
    ]
    if measured.quantity == "omega":
        lines.append("neighbouring values of omega share noise; intervals are widened by the residuals' autocovariance")
    lines += remarks
    for one in contenders:
        lines += ["", *_fit_lines(one)]
    lines += ["", verdict(contenders)]
    return "\n".join(lines)


def _fit_lines(one: Any) -> list[str]:
    from flipproof.film.fit.compare import digits, promise, told
    from flipproof.film.fit.problem import UNITS
    from flipproof.film.fit.uncertainty import correlation

    estimate = one.estimate
    throw = estimate.problem.throw
    lines = [f"{one.solver}, {throw.n_slices} slices; {promise(one.solver, fits=one.fits)}"]
    for found in one.intervals:
        places = digits(found)
        numbers = f"{found.value:.{places}f} [{found.low:.{places}f}, {found.high:.{places}f}]"
        note = told(found)
        lines.append(f"  {found.name:12} {numbers} {UNITS[found.name]}{'  ' + note if note else ''}")
        if found.name == "drag":
            gamma = [value / (2 * throw.slice_mass) for value in (found.value, found.low, found.high)]
            lines.append(f"  {'alpha/2m':12} {gamma[0]:.4g} [{gamma[1]:.4g}, {gamma[2]:.4g}] /s")
    pairs, names = correlation(estimate), estimate.problem.free
    words = [f"{names[i]}-{names[j]} {pairs[i, j]:+.2f}" for i, j in combinations(range(len(names)), 2)]
    lines.append(f"  correlation  {', '.join(words)}")
    lines.append(
        f"  chi^2        {estimate.chi2:.0f} for {estimate.freedom} degrees of freedom; residual "
        f"{one.root_mean_square:.3g} {estimate.problem.measured.unit} (root mean square)"
    )
    levels = estimate.minima[:, -1]
    same = int((levels < levels.min() + 1.0).sum())
    lines.append(
        f"  search       {estimate.flights} flights; {same} of {len(levels)} descents end there; intervals "
        f"{math.sqrt(max(1.0, estimate.temperature)):.2f} times wider for misfit or shared noise, "
        f"{math.sqrt(estimate.roughness):.2f} for roughness"
    )
    return lines


def _positive(text: str) -> float:
    value = number(text)
    if not value > 0:
        raise argparse.ArgumentTypeError(f"{text!r} is outside (0, 1e6)")
    return value
