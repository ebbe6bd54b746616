"""Score a solver on the event problem set.

    python examples/events/score.py examples/events/scipy_ivp.py [--tolerance 1e-10] [--problem hit-1 ...]

ADAPTER.py holds ``solve(problem, tolerance)`` and returns the impacts as rows (time, bead, end, speed before, speed
after), and omega at ``problem["t"]``. An impact matches the next one of the same bead in the list if the end is the
same, the times lie within 1e-6 s and both speeds within 1e-4 m/s; at its first impact that does not match a bead's
list ends. Needs NumPy alone.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROW = ("time", "slice", "end", "speed_before", "speed_after")
"""Columns of an impact, as the list names them."""

WITHIN = (1e-6, 0, 0, 1e-4, 1e-4)
"""Largest difference of each column for one impact [s, 1, 1, m/s, m/s]."""

HERE = Path(__file__).resolve().parent


class Score(NamedTuple):
    """Impacts of the list, of the answer and of both; largest differences of time [s], speed [m/s], omega; cost [s]."""

    impacts: int
    answered: int
    matched: int
    time: float
    speed: float
    omega: float
    seconds: float

    @property
    def words(self) -> str:
        """Return the score in a few words."""
        return f"{self.matched} of {self.impacts} impacts ({self.answered} answered)"


def load() -> list[dict[str, Any]]:
    """Return the problems."""
    problems: list[dict[str, Any]] = json.loads((HERE / "problems.json").read_text(encoding="utf-8"))["problems"]
    return problems


def adapter(path: Path) -> Callable[..., Any]:
    """Return ``solve`` of a file."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    solve: Callable[..., Any] = module.solve
    return solve


class AnswerError(ValueError):
    """An answer that cannot be scored; the message names its field."""


def score(problem: dict[str, Any], solve: Callable[..., Any], *asked: Any) -> Score:
    """Solve a problem and return its score; AnswerError names a field of a wrong length."""
    began = time.process_time()
    rows, omegas = solve(problem, *asked)
    spent = time.process_time() - began
    for row in rows:
        refuse_length(f"{problem['name']}: an impact", row, len(ROW), ", ".join(ROW))
    refuse_length(f"{problem['name']}: omega", omegas, len(problem["t"]), "one for each time of t")
    rows = sorted(rows, key=lambda row: row[0])
    listed = list(zip(*(problem["impacts"][key] for key in ROW), strict=True))
    matched, largest = 0, np.zeros(len(ROW))
    for bead in range(problem["beads"]):
        for mine, its in zip(of_bead(rows, bead), of_bead(listed, bead), strict=False):
            differences = np.abs(np.subtract(mine, its, dtype=float))
            if not np.all(differences <= WITHIN):  # NaN is within nothing
                break
            matched, largest = matched + 1, np.maximum(largest, differences)
    error = float(np.abs(np.subtract(omegas, problem["omega"])).max() / abs(problem["omega"][0]))
    return Score(len(listed), len(rows), matched, float(largest[0]), float(largest[3:].max()), error, spent)


def of_bead(rows: list[Any], bead: int) -> list[Any]:
    """Return the impacts of one bead."""
    return [row for row in rows if row[1] == bead]


def refuse_length(field: str, value: Any, length: int, entries: str) -> None:
    """Raise AnswerError if a field of an answer is no row of so many entries."""
    if np.shape(value) != (length,):
        raise AnswerError(f"{field} has the shape {np.shape(value)}, not ({length},): {entries}")


def chosen(names: list[str] | None) -> list[dict[str, Any]]:
    """Return the problems of these names, or all; exit with the names there are if one is unknown."""
    problems = {problem["name"]: problem for problem in load()}
    unknown = [name for name in names or () if name not in problems]
    if unknown:
        raise SystemExit(f"--problem {' '.join(unknown)} is unknown; known: {', '.join(problems)}")
    return [problems[name] for name in names or problems]


def main() -> None:
    """Print a line a problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("adapter", type=Path)
    parser.add_argument("--tolerance", type=float, default=1e-10)
    parser.add_argument("--problem", nargs="+")
    asked = parser.parse_args()
    solve = adapter(asked.adapter)
    for problem in chosen(asked.problem):
        try:
            found = score(problem, solve, asked.tolerance)
        except AnswerError as error:
            raise SystemExit(str(error)) from None
        print(
            f"{problem['name']:16} {found.words}, times within {found.time:.1e} s, "
            f"speeds within {found.speed:.1e} m/s, omega within {found.omega:.1e} omega_0, {found.seconds:.2f} s"
        )


if __name__ == "__main__":
    main()
