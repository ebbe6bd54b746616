"""The completion script, asked by the shells themselves."""

import shutil
import subprocess

import pytest

from flipproof.cli.completion import script
from flipproof.cli.main import parser

SOLVERS = ["eq8", "free-flight", "exact-step"]


def completed(shell, *words):
    """Return what a shell offers after ``flipproof`` and these words, the last of which is being typed."""
    line = " ".join(f"'{word}'" for word in ("flipproof", *words))
    ask = f'COMP_WORDS=({line}); COMP_CWORD={len(words)}; _flipproof; echo "${{COMPREPLY[@]}}"\n'
    if shell == "zsh":  # as bashcompinit calls it
        ask = f"emulate sh; setopt kshglob noshglob braceexpand; {ask}"
    text = script(shell, parser(), SOLVERS) + ask
    command = {"bash": ["bash", "--norc", "--noprofile"], "zsh": ["zsh", "-f"]}[shell]
    made = subprocess.run(command, input=text, capture_output=True, text=True, timeout=60, check=True)
    assert not made.stderr
    # The shell itself offers what begins with the word; bash's compgen has done so already.
    return [word for word in made.stdout.split() if word.startswith(words[-1])]


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_a_shell_completes_commands_options_and_solvers(shell):
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell}")
    every = completed(shell, "")
    assert {"report", "certify", "fit", "completion", "--version"} <= set(every)
    assert completed(shell, "cer") == ["certify"]
    assert completed(shell, "report", "--w") == ["--with"]
    assert completed(shell, "report", "--with", "e") == ["eq8", "exact-step"]
    assert completed(shell, "certify", "f") == ["free-flight"]
    assert completed(shell, "certify", "eq8", "--j") == ["--json", "--junit"]
    assert completed(shell, "fit", "flight.csv", "--also", "o") == ["omega0"]
    assert completed(shell, "completion", "") == ["bash", "zsh"]
    assert completed(shell, "report", "--out", "") == []  # the shell completes a file's name
    assert completed(shell, "report", "thr") == []
    assert completed(shell, "nonsense", "x") == []


def test_every_command_and_option_of_the_parser_is_in_the_script():
    text = script("bash", parser(), SOLVERS)
    (commands,) = (action.choices for action in parser()._actions if action.dest == "==SUPPRESS==" or action.choices)
    for name, command in commands.items():
        for action in command._actions:
            for option in action.option_strings:
                if option.startswith("--"):
                    assert f"{option}" in text, (name, option)
        assert f'"{name} -"*)' in text
