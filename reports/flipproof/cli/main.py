"""The command ``flipproof``. Heavy packages load only inside the command that needs them."""

from __future__ import annotations

import sys

if __name__ == "__main__":
    # Before anything else is imported: an interrupt meets this program while it loads, too.
    from flipproof.cli.signals import guard

    guard()

import argparse
import os
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NoReturn

from flipproof.cli import signals
from flipproof.cli.arguments import (
    SCENARIO_HELP,
    OneLineParser,
    add_command,
    add_guests,
    add_no_cache,
    check_guests,
    check_outputs,
    command_line,
    count,
    output,
    place,
    read_scenario,
    refuse_overwriting,
    store_of,
    whole,
)
from flipproof.cli.bounce import add_bounce
from flipproof.cli.check import add_checks, add_compare
from flipproof.cli.console import readable, say, speak_plainly
from flipproof.cli.film import add_film
from flipproof.cli.foreign import add_foreign, add_models
from flipproof.cli.landing import add_landing
from flipproof.cli.paper import add_paper
from flipproof.cli.progress import ReportProgress
from flipproof.cli.scene import add_scene
from flipproof.cli.screens import FirstScreen, commands_of, second_screen
from flipproof.cli.sweeps import add_sweeps
from flipproof.frame.compiling import announce_compiling
from slicemodel.scenario import unknown_name

BAD_INPUT: Final = 2
"""Exit status of a mistake in what was given; 3 is that of one in flipproof."""

DEFAULT_OUT = Path("reports/latest" if Path("reports/flipproof").is_dir() else "flipproof-report")
"""Where a report goes without --out: into the checkout if the command runs in one, else beside what the user has."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status (0, 1, 2, 3 or 130)."""
    try:
        return _status(arguments)
    except KeyboardInterrupt:
        print(signals.INTERRUPTED_WORDS, file=sys.stderr)
        return signals.INTERRUPTED


def _status(arguments: Sequence[str] | None) -> int:
    """Run the command line; return its exit status unless it is interrupted."""
    speak_plainly()
    signals.interrupt_main()
    announce_compiling()
    try:
        options = parse(sys.argv[1:] if arguments is None else arguments)
        status = options.action(options)
        sys.stdout.flush()
        return int(status)
    except BrokenPipeError:
        # The reader of our output went away (a closed pager): not an error of ours.
        sys.stderr.close()
        return 0
    except OSError as error:
        return _complain(_words_of(error), BAD_INPUT)
    except (ValueError, MemoryError) as error:
        return _complain(str(error) or type(error).__name__, BAD_INPUT)
    except Exception as error:
        # Nobody is helped by a traceback at the command line; whoever wants to mend the cause asks for it.
        if isinstance(error.__cause__, ModuleNotFoundError):
            return _complain(str(error), BAD_INPUT)
        if os.environ.get("FLIPPROOF_TRACEBACK"):
            traceback.print_exc()
        return _complain(
            f"{type(error).__name__}: {readable(str(error))} (an error in flipproof itself; "
            "set FLIPPROOF_TRACEBACK=1 to see where)",
            3,
        )


def entry() -> NoReturn:
    """Run the command line as a program."""
    try:
        status = _status(None)
    except KeyboardInterrupt:
        # Nothing is left to clean up. An orderly exit would wait for threads, and Python kills itself where it lets go
        # of what was loaded by half: the exception that holds it is never given up.
        sys.stdout.flush()
        signals.end()
    signals.ignore()  # the command is done, whatever comes while Python ends
    _let_go()
    sys.exit(status)


def _let_go() -> None:
    """Send to nowhere what a stream holds and cannot write: Python's end would try again, and end with 120."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError, AttributeError):  # full or gone; closed; never there
            with suppress(OSError, ValueError, AttributeError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _words_of(error: OSError) -> str:
    """Return what an error of the operating system says, and of what if it does not say that."""
    if error.filename is not None:
        return str(error)
    if isinstance(error, FileNotFoundError):
        return "the current folder has been removed; go to another"
    return f"standard output or a file cannot be read or written ({error.strerror or error})"


def _complain(words: str, status: int) -> int:
    with suppress(OSError):  # the status says it where standard error does not take it
        say(f"error: {readable(words)}")
    return status


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the command and its options; a mistake ends with one line, what was probably meant, and status 2."""
    words = list(arguments)
    if words[:1] == ["help"]:
        words = [*words[1:], "--help"]
    top = parser()
    commands = commands_of(top)
    if words and not words[0].startswith("-") and words[0] not in commands:
        top.error(unknown_name("command", words[0], [*commands, "help"]))
    options, unread = top.parse_known_args(words)
    command = commands.get(words[0], top) if words else top
    for word in unread:
        if word.startswith("-"):
            top.error(unknown_name(f"{command.prog}: option", word.partition("=")[0], command._option_string_actions))
    if unread:
        top.error(f"{command.prog} takes no further argument: {' '.join(unread)}")
    if "action" not in options:
        top.print_help()
        sys.exit(BAD_INPUT)
    refuse_overwriting(options, command)
    check_outputs(options, command)
    return options


def parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    from flipproof.frame.provenance import version_of

    top = FirstScreen(prog="flipproof")
    top.add_argument("--version", action="version", version=f"flipproof {version_of('flipproof')}")
    commands = top.add_subparsers(metavar="COMMAND", parser_class=OneLineParser)

    report = add_command(commands, "report", "Run everything and write a validation report.", command_report)
    report.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    report.add_argument("--out", type=place, default=DEFAULT_OUT, metavar="DIR", help="folder (default %(default)s)")
    report.add_argument(
        "--quick", action="store_true", help="fewer refinements; no maps, engine certificates or paper figures"
    )
    report.add_argument(
        "--slices", type=count, metavar="N", help="slices at which solvers are compared (default 50, or the file's "
        "number if smaller)",
    )  # fmt: skip
    add_guests(report, "certify another solver and hold it against all others; a failed check is a failed claim")
    report.add_argument(
        "--measured", type=Path, metavar="TRACK.csv", help="a measured flight to hold beside the solvers: a track of "
        "'flipproof track', or a CSV with t and theta or omega from release to landing",
    )  # fmt: skip
    report.add_argument("--jobs", type=count, metavar="N", help="worker processes (default: one per core)")
    add_no_cache(report)
    report.add_argument("--open", action="store_true", help="open the page in the browser when it is written")
    report.add_argument("--png", action="store_true", help="also write every figure as PNG, beside the SVG")

    simulate = add_command(commands, "simulate", "Run one solver and write its trajectory as CSV.", command_simulate)
    simulate.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help=SCENARIO_HELP)
    simulate.add_argument(
        "--solver",
        default="exact-step",
        metavar="NAME",
        help="see 'flipproof models'; or a spec such as mine.py:solve (%(default)s)",
    )
    simulate.add_argument("--steps", type=whole, metavar="P", help="points of a scheme's grid (default 1000)")
    simulate.add_argument("--slices", type=count, metavar="N", help="cut the throw into N slices, alpha/2m unchanged")
    simulate.add_argument("--out", type=output, metavar="FILE.csv", help="file to write (default: standard output)")

    add_compare(commands)
    add_paper(commands)
    add_checks(commands)
    add_sweeps(commands)
    add_film(commands)
    add_landing(commands)
    add_foreign(commands)
    add_bounce(commands)
    add_scene(commands)
    add_models(commands)
    add_command(commands, "more", "List every other command, and the exit statuses.", command_more)
    return top


def command_more(_: argparse.Namespace) -> int:
    """Print the second screen."""
    print(second_screen(commands_of(parser())))
    return 0


def command_report(options: argparse.Namespace) -> int:
    """Write a report; return 1 if a regression claim failed."""
    scenario = read_scenario(options.scenario)
    from flipproof.output.folder import check_replaceable, replaced_folder

    check_replaceable(options.out, "report")
    check_guests(options.guests)
    measurement = None
    if options.measured is not None:
        from flipproof.film.clip import read_table

        measurement = read_table(options.measured)

    from flipproof.build import ask_of, build, gather_report, write
    from flipproof.chapters import parts
    from flipproof.chapters.solvers import facts_of, invited
    from flipproof.film.measured import part_measured
    from flipproof.frame.gather import Stages
    from flipproof.frame.pool import workers
    from flipproof.frame.provenance import provenance

    began = time.perf_counter()
    guests = invited(options.guests, options.timeout)
    ask = ask_of(scenario, "quick" if options.quick else "full", options.slices, guests=guests)
    with replaced_folder(options.out, "report") as folder:
        with store_of(options) as store, workers(options.jobs) as pool, ReportProgress(ask.size) as bar:
            contents = parts() if measurement is None else (part_measured(measurement), *parts())
            work = {"guests": guests} if guests else {}
            gathered = gather_report(
                ask, pool, bar.show, stages=Stages(bar.begin), store=store, contents=contents, work=work
            )
            facts = provenance(command_line()) | store.facts() | facts_of(guests)
            report = build(gathered, facts, store.remembering(pool), bar.show, png=options.png)
        write(report, folder)
    for visit in gathered.result("guests") or ():
        certificate = visit.certificate.result
        print(f"{visit.guest.label}: {certificate.conclusion if certificate else '; '.join(visit.problems.values())}")
    print(f"Cache: {store.whereabouts()}")
    _print_report(report, options.out, time.perf_counter() - began)
    if options.open:
        import webbrowser

        if not webbrowser.open((options.out / "index.html").resolve().as_uri()):
            say("no browser could be opened")
    return 1 if report.failed else 0


def _print_report(report: Any, out: Path, seconds: float) -> None:
    from flipproof.page.verdict import Headline, answer

    print("Largest |difference in omega| / omega_0:")
    for finding in report.findings:
        if finding.id.startswith("difference-"):
            size = "       –" if finding.value is None else f"{finding.value:8.3%}"
            band = finding.band.size if finding.band is not None else 0.0
            vague = (
                f" (numerical uncertainty {100 * band:.2g}%)" if band > max(1e-4, 0.1 * (finding.value or 0.0)) else ""
            )
            print(f"  {size}  {finding.title}{vague}")
    regressions = [finding for finding in report.findings if finding.kind == "regression"]
    for finding in report.failed:
        print(f"FAIL  {finding.title}: {finding.value_text} (threshold {finding.threshold_text}) {finding.note}")
    for finding in report.findings:
        if finding.id.startswith("measured-fit-"):
            print(f"{finding.title}: {finding.value_text} root mean square")
    page = out / "index.html"
    absent = [finding.title for finding in report.findings if finding.id.startswith("chapter-") and not finding.failed]
    if absent:
        print(f"Could not be made, for reasons in the evidence: {'; '.join(absent)}")
    print(f"{len(regressions) - len(report.failed)} of {len(regressions)} regression claims hold.")
    print(f"Report: {page} ({seconds:.0f} s)")
    print(answer([Headline.from_mapping(mapping) for mapping in report.summary.get("headlines", ())]))
    print(f"Open {page.resolve().as_uri()}")


def command_simulate(options: argparse.Namespace) -> int:
    """Run one solver and write CSV; say on standard error what stopped it, or up to when it may be trusted.

    Returns 1 if the flight stopped before its end; what was flown is written all the same.
    """
    from flipproof.frame.solvers import find
    from flipproof.frame.timing import solve_timed
    from flipproof.frame.twins import doubt
    from flipproof.output.folder import write_text
    from flipproof.output.tables import trajectory_csv

    scenario = read_scenario(options.scenario, options.slices)
    solver = find(options.solver)
    if options.steps is not None and solver.package != "slicemodel":
        raise ValueError(f"--steps {options.steps}: {solver.name} is not a scheme and chooses its own steps")
    settings = {} if options.steps is None else {"steps": options.steps}
    trajectory, seconds = solve_timed(solver.name, scenario, **settings)
    table = trajectory_csv(trajectory)
    if options.out:
        write_text(options.out, table)
    else:
        sys.stdout.write(table)
    if not trajectory.ok:
        say(f"{solver.name}: {trajectory.status}: {trajectory.message}")
    if words := doubt(trajectory, seconds):
        say(words)
    return 0 if trajectory.ok else 1


if __name__ == "__main__":
    entry()
