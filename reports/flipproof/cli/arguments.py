"""What the commands of ``flipproof`` share: how one is added, and the arguments that several take."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn, TypeVar

from flipproof.cli.console import readable

if TYPE_CHECKING:
    from flipproof.figures.style import Drawing
    from flipproof.frame.findings import Finding
    from flipproof.frame.run_store import RunStore

Read = TypeVar("Read")

SCENARIO_HELP: Final = "scenario file (TOML with tables [scenario] and [bottle]); default: the paper's own throw"


class OneLineParser(argparse.ArgumentParser):
    """A parser whose complaints are one line, like those of the commands; ``--help`` tells the rest."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and end with status 2."""
        self.exit(2, f"flipproof: error: {readable(message)}\n")


def add_command(
    commands: Any, name: str, description: str, action: Callable[[argparse.Namespace], int]
) -> argparse.ArgumentParser:
    """Add a command that ``action`` runs and return its parser."""
    command: argparse.ArgumentParser = commands.add_parser(name, description=description, help=description)
    command.set_defaults(action=action)
    return command


def add_no_cache(command: argparse.ArgumentParser) -> None:
    """Let a command do without the runs of an earlier time."""
    command.add_argument(
        "--no-cache",
        action="store_true",
        help="make every run anew, and keep none (else slow runs are kept in the user's cache folder)",
    )


def store_of(options: argparse.Namespace) -> RunStore:
    """Return the store of runs that a command with ``--no-cache`` uses."""
    from flipproof.frame.run_store import RunStore, default_place

    place = None if options.no_cache else default_place()
    return RunStore(place, say=lambda words: print(f"flipproof: {words}", file=sys.stderr, flush=True))


def add_guests(command: argparse.ArgumentParser, purpose: str) -> None:
    """Add ``--with SPEC``, which may be repeated, and ``--timeout``."""
    command.add_argument(
        "--with",
        dest="guests",
        action="append",
        default=[],
        metavar="SPEC",
        help=f"{purpose}, such as mine.py:solve; may be repeated",
    )
    command.add_argument("--timeout", type=count, metavar="S", help="seconds one run of a --with solver may take")


def check_guests(specs: Sequence[str]) -> None:
    """Refuse by a ValueError, before the work begins, what names nothing, one of our solvers, or one twice."""
    from flipproof.foreign.specs import is_foreign
    from flipproof.frame.solvers import find

    for spec in specs:
        find(spec)
        if not is_foreign(spec):
            raise ValueError(f"--with {spec} names flipproof's own solver; flipproof certify {spec} tests it")
        if specs.count(spec) > 1:
            raise ValueError(f"--with {spec} is there twice")


def reader(words: str, read: Callable[[str], Read], admissible: Callable[[Read], bool]) -> Callable[[str], Read]:
    """Return what reads an argument; one that cannot be read, or is not admissible, is said not to be ``words``."""

    def read_argument(text: str) -> Read:
        with suppress(ValueError):
            value = read(text)
            if admissible(value):
                return value
        raise argparse.ArgumentTypeError(f"{text!r} is not {words}")

    return read_argument


def digits(text: str) -> int:
    """Return the whole number that digits say; raise ValueError for anything else."""
    if not text.isdecimal():
        raise ValueError(text)
    return int(text)


def sides(text: str) -> tuple[int, int]:
    """Return the two whole numbers of COLUMNSxROWS; raise ValueError for anything else."""
    columns, _, rows = text.partition("x")
    return digits(columns), digits(rows)


def numbers(text: str) -> tuple[float, ...]:
    """Return numbers between commas; raise ValueError for anything else."""
    return tuple(float(part) for part in text.split(","))


count = reader("a whole number of at least 1", digits, lambda value: value >= 1)
seed = reader("a whole number in [0, 2^63)", digits, lambda value: value < 2**63)
number = reader("a number in (-1e6, 1e6)", float, lambda value: abs(value) < 1e6)
positive = reader("a number in (0, 1e6)", float, lambda value: 0.0 < value < 1e6)

whole = reader("a whole number", int, lambda _: True)
real = reader("a number", float, lambda _: True)
"""Numbers of fields that know and say their own range."""


def output(text: str) -> Path:
    """Return the path of an option that a command writes: by this type ``refuse_overwriting`` knows such options."""
    return Path(text)


def check_outputs(options: argparse.Namespace, *names: str) -> None:
    """Refuse by a ValueError, before the work begins, files of options that could not be written after it.

    No two options may name one file; a device or a pipe takes both. What the command reads is kept by
    ``refuse_overwriting``.
    """
    taken: dict[Path, str] = {}
    for name in names:
        path = getattr(options, name)
        if path and path.is_dir():
            raise ValueError(f"--{name} {path} is a folder; name a file")
        if path and not path.parent.is_dir():
            raise ValueError(f"--{name} {path}: the folder {path.parent} does not exist")
        if path and (path.is_file() or not path.exists()):
            first_name = taken.setdefault(path.resolve(), name)
            if first_name != name:
                raise ValueError(f"--{name} {path} is the file of --{first_name}, too; name another")


def refuse_overwriting(options: argparse.Namespace, command: argparse.ArgumentParser) -> None:
    """Refuse by a ValueError a command that would write over a file that it reads."""
    given = vars(options)
    written = [action.dest for action in command._actions if action.type is output]
    values = [value if isinstance(value, list) else [value] for name, value in given.items() if name not in written]
    texts = [str(element) for value in values for element in value if isinstance(element, str | Path)]
    for name in written:
        path = given.get(name)
        if isinstance(path, Path) and path.is_file() and any(path.samefile(file) for file in _read_by(texts)):
            raise ValueError(f"--{name} {path} is a file that this command reads; name another")


def _read_by(texts: Sequence[str]) -> Iterator[Path]:
    """Yield the files that arguments name, themselves or as the spec of a solver."""
    from flipproof.foreign.specs import files_of, is_spec

    for text in texts:
        if os.path.isfile(text):
            yield Path(text)
        if os.path.isdir(text):  # such as a report's
            yield from (file for file in Path(text).iterdir() if file.is_file())
        with suppress(ValueError):  # what is no spec is told by the command itself
            if is_spec(text):
                for file in (file for _, file in files_of(text) if file.is_file()):
                    yield file
                    if file.suffix == ".py":  # a solver may import whatever lies beside it
                        yield from file.parent.glob("*.py")


def add_json(command: argparse.ArgumentParser, content: str) -> None:
    """Add ``--json FILE``."""
    command.add_argument("--json", type=output, metavar="FILE", help=f"write {content} as JSON, too")


def write_json(path: Path | None, mapping: Mapping[str, Any]) -> None:
    """Write a mapping into the file that ``--json`` names, if any; what JSON cannot say becomes text."""
    if path is not None:
        from flipproof.frame.columns import json_ready
        from flipproof.output.folder import write_text

        write_text(path, json.dumps(json_ready(mapping), indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def write_junit(
    path: Path | None, findings: Sequence[Finding], suite: str, seconds: Mapping[str, float] | None = None
) -> None:
    """Write findings as JUnit XML into the file that ``--junit`` names, if any."""
    if path is not None:
        from flipproof.output.folder import write_text
        from flipproof.output.junit import junit_text

        write_text(path, junit_text(findings, suite, seconds))


def check_plot(path: Path | None) -> None:
    """Refuse a name of a figure that ends neither in .png nor in .svg."""
    if path and path.suffix not in (".png", ".svg"):
        raise ValueError(f"--plot {path} ends neither in .png nor in .svg")


def write_plot(path: Path, drawing: Drawing) -> None:
    """Write a figure as its name says."""
    path.write_bytes(drawing.png if path.suffix == ".png" else drawing.svg.encode())


def command_line() -> str:
    """Return the command as it was given, for the provenance."""
    return shlex.join(["flipproof", *sys.argv[1:]])


def read_scenario(path: str | None, slices: int | None = None, most: int | None = None) -> Any:
    """Return the throw of a file, or the paper's own, cut into ``slices`` if given, else into at most ``most``."""
    from slicemodel import Scenario

    scenario = Scenario() if path is None else Scenario.from_toml(path)
    if slices is None and most is not None:
        slices = min(most, scenario.n_slices)
    return scenario.with_slices(slices) if slices else scenario
