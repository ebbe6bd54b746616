"""Solvers in C and known mistakes in them, put to the suite as their authors would: as commands.

``c/NAME.c`` is a right solver; ``-DMISTAKE=K`` plants the mistake that the line ``K NAME`` of ``c/mistakes.txt`` words.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from flipproof.foreign.contract import Runner
from flipproof.foreign.solving import opened

HERE: Final = Path(__file__).parent / "c"

DECLARED: Final[dict[str, dict[str, Any]]] = {
    "free": {"equation": "free-flight", "refined_by": "dt", "order": 4.0},
    "eq8": {"equation": "eq8", "refined_by": "steps", "order": 2.0},
}
"""Base -> what it declares."""


@dataclass(frozen=True, slots=True)
class Compiled:
    """A right solver, or one with the mistake ``number``."""

    words: str
    base: str
    number: int = 0

    def runner(self) -> Runner:
        """Return it, compiled; raises FileNotFoundError without a compiler."""
        program = Path(folder().name) / f"{self.base}_{self.number}"
        options = ["-std=c11", "-O2", "-w", f"-DMISTAKE={self.number}", "-o", str(program), "-lm"]
        subprocess.run(["cc", str(HERE / f"{self.base}.c"), *options], check=True)
        declared = {name: value for name, value in DECLARED[self.base].items() if name != "equation"}
        return opened(f"cmd:{program} {{scenario}} {{times}} {{start}} {{effort}} {{out}}", given=declared)


@cache
def folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder for programs, which goes with this process."""
    return tempfile.TemporaryDirectory(prefix="planted-")


def mistakes() -> dict[str, Compiled]:
    """Return the mistakes by name; none where there is no compiler."""
    if shutil.which("cc") is None:
        return {}
    found = {}
    for line in (HERE / "mistakes.txt").read_text(encoding="utf-8").splitlines():
        number, base, words = line.split(" ", 2)
        found[f"{base}_in_c_{number}"] = Compiled(words, base, int(number))
    return found
