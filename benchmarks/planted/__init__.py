"""Right solvers and known mistakes: what ``python benchmarks/power.py`` puts to the conformance suite.

Mistakes are planted one at a time. Those of ``ours`` override a part of ``subject``, those of ``asked`` change what it
is asked or answers, and those of a ``*.diff`` replace lines of a solver beside it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from flipproof.foreign.contract import Answer, AnswerError, Ask, ForeignError, Runner, answer_of, solve_of, traits_of

HERE = Path(__file__).parent


class InProcess(Runner):
    """A solver object as a runner, in this process: for code of our own only."""

    def __init__(self, solver: Any, name: str) -> None:
        self.solve = solve_of(solver)
        self.traits = traits_of(solver, name)

    def __call__(self, ask: Ask) -> Answer:
        """Return the checked answer; what the solver raises is raised: a bug in what is planted is no finding."""
        try:
            return answer_of(ask, self.solve(ask))
        except AnswerError as error:
            raise ForeignError(f"answer: {error}") from None


@dataclass(frozen=True, slots=True)
class Patch:
    """A mistake as lines of a solver, by file, and what stands there instead."""

    words: str
    base: str
    changes: tuple[tuple[str, str], ...]

    def text(self) -> str:
        """Return the solver with the mistake; raises ValueError if what it replaces does not stand there once.

        The base is a file of ``solvers``, or one of ``right.diff``.
        """
        file = HERE / "solvers" / f"{self.base}.py"
        text = file.read_text(encoding="utf-8") if file.is_file() else patches("right")[self.base].text()
        for old, _ in self.changes:
            if text.count(old) != 1:
                raise ValueError(f"{self.base} holds {text.count(old)} times, not once:\n{old}")
        for old, new in sorted(self.changes, key=lambda change: -text.index(change[0])):
            at = text.index(old)
            text = text[:at] + new + text[at + len(old) :]
        return text

    def solver(self) -> Any:
        """Return its function of one ask."""
        module = ModuleType(f"planted_{self.base}")
        sys.modules[module.__name__] = module  # where a dataclass looks
        exec(compile(self.text(), self.base, "exec"), module.__dict__)
        return module.solve


@cache
def patches(name: str) -> dict[str, Patch]:
    """Return the mistakes of ``NAME.diff`` by name.

    A mistake begins with ``== NAME (BASE)`` and its words on the next line. Blocks of lines with ``-`` are replaced by
    the lines with ``+`` below them; a line with a blank before it stands there in both, and an empty line ends a block.
    """
    parts = re.split(r"^== (\w+) \((\w+)\)\n", (HERE / f"{name}.diff").read_text(encoding="utf-8"), flags=re.M)
    return {
        title: Patch(body.partition("\n")[0], base, tuple(_changes(body.partition("\n")[2])))
        for title, base, body in zip(parts[1::3], parts[2::3], parts[3::3], strict=True)
    }


def _changes(text: str) -> Iterator[tuple[str, str]]:
    for block in re.split(r"\n{2,}", text.strip("\n")):
        lines = block.splitlines()
        yield tuple("".join(f"{line[1:]}\n" for line in lines if line[0] in kept) for kept in (" -", " +"))  # type: ignore[misc]
