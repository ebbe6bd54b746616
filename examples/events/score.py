"""Score a solver on the event problem set.

    python examples/events/score.py examples/events/scipy_ivp.py [--tolerance 1e-10] [--problem hit-1 ...]

ADAPTER.py holds ``solve(problem, tolerance)`` and returns the impacts as rows (time, bead, end, speed before, speed
after), and omega at ``problem["t"]``. An impact matches the next one of the same bead in the list if the end is the
same and the times lie within 1e-6 s; at its first impact that does not match a bead's list ends. Needs NumPy alone.
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

WITHIN = 1e-6
"""Largest difference of the times of one impact [s]."""

HERE = Path(__file__).resolve().parent


class Score(NamedTuple):
    """Impacts of the list, of the answer and of both; largest differences of time [s] and omega; cost [s]."""

    impacts: int
    answered: int
    matched: int
    time: float
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


def score(problem: dict[str, Any], solve: Callable[..., Any], *asked: Any) -> Score:
    """Solve a problem and return its score."""
    began = time.process_time()
    rows, omegas = solve(problem, *asked)
    spent = time.process_time() - began
    rows, exact = sorted(rows, key=lambda row: row[0]), problem["impacts"]
    matched, late = 0, 0.0
    for bead in range(problem["beads"]):
        mine = [(row[0], row[2]) for row in rows if row[1] == bead]
        theirs = [(t, end) for t, i, end in zip(exact["time"], exact["slice"], exact["end"], strict=True) if i == bead]
        for (one, at), (other, end) in zip(mine, theirs, strict=False):
            if at != end or abs(one - other) > WITHIN:
                break
            matched, late = matched + 1, max(late, abs(one - other))
    error = float(np.abs(np.array(omegas) - problem["omega"]).max() / abs(problem["omega"][0]))
    return Score(len(exact["time"]), len(rows), matched, late, error, spent)


def main() -> None:
    """Print a line a problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("adapter", type=Path)
    parser.add_argument("--tolerance", type=float, default=1e-10)
    parser.add_argument("--problem", nargs="+")
    asked = parser.parse_args()
    solve = adapter(asked.adapter)
    for problem in load():
        if asked.problem is None or problem["name"] in asked.problem:
            found = score(problem, solve, asked.tolerance)
            print(
                f"{problem['name']:16} {found.words}, times within {found.time:.1e} s, "
                f"omega within {found.omega:.1e} omega_0, {found.seconds:.2f} s"
            )


if __name__ == "__main__":
    main()
