"""The paper's own throw, and the same run at more slices."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from flipproof.frame.solvers import Run
from slicemodel import Scenario

REFERENCE: Final = Scenario().with_slices(50)
"""The paper's own throw, on which the regression claims are made."""

FINER: Final = 2
"""Multiple of the slices at which every number of the verdict is computed again, to show how far it moves with N."""


def finer(run: Run) -> Run:
    """Return the same run at ``FINER`` times the slices."""
    more = run.scenario.with_slices(FINER * run.scenario.n_slices)
    return replace(run, scenario=more, label=f"{run.name}, {FINER} times the slices")
