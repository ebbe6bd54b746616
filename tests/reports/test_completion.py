"""The completion script, asked by the shells themselves."""

import shutil
import subprocess

import pytest

from flipproof.cli.completion import script
from flipproof.cli.main import parser

SOLVERS = ["eq8", "free-flight", "exact-step"]


def offered(shell, folder, *words):
    """Return what a shell in ``folder`` offers after ``flipproof`` and words, the last of which is being typed."""
    if shell == "fish":
        text = script(shell, parser(), SOLVERS) + f"complete -C 'flipproof {' '.join(words)}'\n"
        made = run(["fish", "--no-config"], text, folder)
        return sorted(line.partition("\t")[0] for line in made.splitlines())
    line = " ".join(f"'{word}'" for word in ("flipproof", *words))
    ask = f'COMP_WORDS=({line}); COMP_CWORD={len(words)}; _flipproof; echo "${{COMPREPLY[@]}}"\n'
    if shell == "zsh":  # as bashcompinit calls it
        ask = f"emulate sh; setopt kshglob noshglob braceexpand; {ask}"
    text = script(shell, parser(), SOLVERS) + ask
    command = {"bash": ["bash", "--norc", "--noprofile"], "zsh": ["zsh", "-f"]}[shell]
    made = run(command, text, folder)
    # The shell itself offers what begins with the word; bash's compgen has done so already.
    return [word for word in made.split() if word.startswith(words[-1])]


def run(command, text, folder):
    made = subprocess.run(command, input=text, capture_output=True, text=True, timeout=60, check=True, cwd=folder)
    assert not made.stderr
    return made.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_completes_commands_options_and_solvers(shell, tmp_path):
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell}")

    def completed(*words):
        return offered(shell, tmp_path, *words)

    every = completed("") + completed("--")  # fish shows options once a dash is typed
    assert {"report", "certify", "fit", "completion", "--version"} <= set(every)
    assert completed("cer") == ["certify"]
    assert completed("report", "--w") == ["--with"]
    assert completed("report", "--with", "e") == ["eq8", "exact-step"]
    assert completed("certify", "f") == ["free-flight"]
    assert completed("certify", "eq8", "--j") == ["--json", "--junit"]
    assert completed("fit", "flight.csv", "--also", "o") == ["omega0"]
    assert sorted(completed("completion", "")) == ["bash", "fish", "zsh"]
    assert completed("report", "--out", "") == []  # the shell completes a file's name
    assert completed("report", "thr") == []
    assert completed("nonsense", "x") == []


def test_every_command_and_option_of_the_parser_is_in_the_script():
    text, fish = (script(shell, parser(), SOLVERS) for shell in ("bash", "fish"))
    (commands,) = (action.choices for action in parser()._actions if action.dest == "==SUPPRESS==" or action.choices)
    for name, command in commands.items():
        for action in command._actions:
            for option in action.option_strings:
                if option.startswith("--"):
                    assert f"{option}" in text, (name, option)
                    assert f"'__flipproof_is {name}' -l {option[2:]} " in fish, (name, option)
        assert f'"{name} -"*)' in text


def test_fish_is_told_what_a_word_is_for_and_offers_files_where_a_spec_may_name_one(tmp_path):
    if shutil.which("fish") is None:
        pytest.skip("no fish")
    (tmp_path / "eq.py").touch()
    assert offered("fish", tmp_path, "certify", "eq") == ["eq.py", "eq8"]
    assert offered("fish", tmp_path, "report", "--with", "eq") == ["eq.py", "eq8"]
    assert offered("fish", tmp_path, "kit", "--refined-by", "") == ["dt", "rtol", "steps"]
    assert offered("fish", tmp_path, "power", "") == []
    text = script("fish", parser(), SOLVERS)
    (line,) = [one for one in text.splitlines() if "-n __flipproof_first -a certify " in one]
    assert line.endswith("-d 'Hold a solver to the conformance suite, a line a check.'")
    subprocess.run(["fish", "--no-execute"], input=text, text=True, check=True, timeout=60)
