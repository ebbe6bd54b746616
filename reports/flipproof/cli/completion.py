"""The command ``flipproof completion``: a script for bash, zsh or fish that completes commands, options and solvers.

The script is made from the parser, so that it knows what the parser knows; it starts no Python at a key stroke.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator
from typing import Any, Final

from flipproof.cli.arguments import add_command
from slicemodel.scenario import shortened

SOLVERS: Final = frozenset({"solver", "solvers", "model", "guests", "spec", "first", "second"})
"""Arguments that name solvers."""

HEAD: Final = """\
# Completion for flipproof. Now: eval "$(flipproof completion {shell})"; for good: put that line into ~/.{shell}rc.
{prefix}_flipproof() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} command=${{COMP_WORDS[1]}} words=""
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W {commands} -- "$word"))
        return
    fi
    case "$command $before" in
"""

TAIL: Final = """\
    esac
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}
complete -o default -F _flipproof flipproof
"""

ZSH: Final = """\
whence compdef > /dev/null || { autoload -U +X compinit && compinit; }
autoload -U +X bashcompinit && bashcompinit
"""
"""What zsh needs to take a script for bash."""

FISH: Final = """\
# Completion for flipproof. Now: flipproof completion fish | source; for good: put that line into
# ~/.config/fish/config.fish.
function __flipproof_first
    test (count (commandline -opc)) -eq 1
end
function __flipproof_is
    set -l words (commandline -opc)
    test (count $words) -gt 1; and test "$words[2]" = "$argv[1]"
end
complete -c flipproof -e
complete -c flipproof -n __flipproof_first -f
"""
"""Which word is typed, asked by every line for fish; what was defined before is taken back."""


def add_completion(commands: Any) -> None:
    """Add the command."""
    command = add_command(
        commands, "completion", "Print a script that completes commands, options and solvers.", command_completion
    )
    command.add_argument(
        "shell",
        choices=("bash", "zsh", "fish"),
        help='whose; then: eval "$(flipproof completion bash)", or in fish: flipproof completion fish | source',
    )


def command_completion(options: argparse.Namespace) -> int:
    """Print the script."""
    from flipproof.cli.main import parser
    from flipproof.frame.solvers import catalogue

    print(script(options.shell, parser(), list(catalogue())), end="")
    return 0


def script(shell: str, top: argparse.ArgumentParser, solvers: list[str]) -> str:
    """Return the script for a shell; a file's name is completed where there are no words."""
    (found,) = (action for action in top._actions if isinstance(action, argparse._SubParsersAction))
    commands: dict[str, argparse.ArgumentParser] = dict(found.choices)
    if shell == "fish":
        return FISH + "".join(f"complete -c flipproof {line}\n" for line in _fish(top, commands, solvers))
    first = shlex.quote(" ".join([*commands, *_options(top)]))
    head = HEAD.format(shell=shell, prefix=ZSH if shell == "zsh" else "", commands=first)
    lines = [line for name, command in commands.items() for line in _values(name, command, solvers)]
    lines += ["    esac", '    case "$command $word" in']
    lines += [
        f'        "{name} -"*) words={shlex.quote(" ".join(_options(each)))} ;;' for name, each in commands.items()
    ]
    for name, command in commands.items():
        words = _first_words(command, solvers)
        if words:
            lines.append(f'        "{name} "*) words={shlex.quote(words)} ;;')
    return head + "\n".join(lines) + "\n" + TAIL


def _fish(
    top: argparse.ArgumentParser, commands: dict[str, argparse.ArgumentParser], solvers: list[str]
) -> Iterator[str]:
    """Yield a line for every command and option, with what fish says beside it, and for every word."""
    first = "-n __flipproof_first"
    yield from (f"{first} -l {action.option_strings[-1][2:]}" for action in top._actions if action.option_strings)
    for name, command in commands.items():
        yield f"{first} -a {name} -d {_for_fish(command.description or '')}"
        here = f"-n '__flipproof_is {name}'"
        positionals = command._get_positional_actions()
        if not positionals or any(action.choices is not None for action in positionals):
            yield f"{here} -f"  # no file's name stands there
        if offered := _first_words(command, solvers):
            yield f"{here} -a {_for_fish(offered)}"
        for action in command._actions:
            words = _words(action, solvers)
            # After -r fish offers files, too, after -x words only.
            takes = "" if action.nargs == 0 else " -r" if action.choices is None else " -x"
            takes += f" -a {_for_fish(' '.join(words))}" if words else ""
            said = command._get_formatter()._expand_help(action) if action.help else ""
            for option in action.option_strings:
                kind = "-l" if option.startswith("--") else "-s"
                yield f"{here} {kind} {option.lstrip('-')}{takes} -d {_for_fish(shortened(said, 70))}"


def _for_fish(text: str) -> str:
    """Return a text between quotes as fish reads it."""
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"'{escaped}'"


def _options(parser: argparse.ArgumentParser) -> list[str]:
    """Return the long options of a parser."""
    return [word for action in parser._actions for word in action.option_strings if word.startswith("--")]


def _values(name: str, command: argparse.ArgumentParser, solvers: list[str]) -> Iterator[str]:
    """Yield a line for all options that take a file or a number, and one for every option that takes a word."""
    free: list[str] = []
    for action in command._actions:
        if action.option_strings and action.nargs != 0:
            cases = [f'"{name} {option}"' for option in action.option_strings]
            words = _words(action, solvers)
            if words:
                quoted = shlex.quote(" ".join(words))
                yield f'        {"|".join(cases)}) COMPREPLY=($(compgen -W {quoted} -- "$word")); return ;;'
            else:
                free += cases
    if free:
        yield f"        {'|'.join(free)}) return ;;"


def _first_words(command: argparse.ArgumentParser, solvers: list[str]) -> str:
    """Return what may stand for the arguments of a command that are no options, as far as that is words."""
    return " ".join(dict.fromkeys(w for action in command._get_positional_actions() for w in _words(action, solvers)))


def _words(action: argparse.Action, solvers: list[str]) -> list[str]:
    """Return what may stand for an argument, as far as that is a word."""
    if action.choices is not None:
        return [str(choice) for choice in action.choices]
    return solvers if action.dest in SOLVERS else []
