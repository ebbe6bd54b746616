"""What ``flipproof`` says of itself: a first screen of eight commands, and a second one with all others."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from typing import Final

from flipproof.cli.arguments import OneLineParser

FIRST: Final = ("report", "compare", "check", "simulate", "sweep", "certify", "track", "fit")
"""The commands of the first screen."""

EXIT_STATUSES: Final = """\
exit status:
  0    done; for a report: every claim was evaluated and no regression claim failed
  1    a regression claim failed; for diff: something moved; for compare: farther apart than --tolerance;
       for simulate: the flight stopped before its end
  2    bad input; one line on standard error says what and where
  3    an error in flipproof itself; FLIPPROOF_TRACEBACK=1 shows where
  130  interrupted; an older report is as it was, a sweep goes on where it stopped"""


class FirstScreen(OneLineParser):
    """The parser of the whole command line, whose help is the first screen."""

    def format_help(self) -> str:
        """Return the first screen."""
        return f"""\
flipproof throws one half-full bottle with many solvers and shows where and why they differ.

usage: flipproof COMMAND ...

{_listed(FIRST, commands_of(self))}

  flipproof help COMMAND   explain one command
  flipproof more           list all other commands
"""


def commands_of(top: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Return the parsers of all commands, by their names."""
    (commands,) = (action for action in top._actions if isinstance(action, argparse._SubParsersAction))
    return dict(commands.choices)


def second_screen(commands: Mapping[str, argparse.ArgumentParser]) -> str:
    """Return the commands that the first screen leaves out, and what exit statuses mean."""
    remaining = [name for name in commands if name not in (*FIRST, "more")]
    return f"{_listed(remaining, commands)}\n\n{EXIT_STATUSES}"


def _listed(names: Iterable[str], commands: Mapping[str, argparse.ArgumentParser]) -> str:
    return "\n".join(f"  {name:<10} {commands[name].description}" for name in names)
