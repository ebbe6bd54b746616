"""The shared nouns (scenario, trajectory, observables) and the paper's slice model.

Importing this package loads neither numba nor SciPy; the compiled loop is made inside the first ``solve``.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Final

from slicemodel.scenario import Bottle, Scenario, ScenarioError

if TYPE_CHECKING:
    from slicemodel.batch import Batch, solve_batch
    from slicemodel.solver import solve
    from slicemodel.step_advice import required_steps
    from slicemodel.table import Outcome, Table, Touch
    from slicemodel.trajectory import Impact, Impacts, Trajectory

IMPORTED: Final = time.time_ns()
"""When this program began to read the sources of the packages [ns]: what is kept by their hash asks for it."""

__all__ = [
    "Batch",
    "Bottle",
    "Impact",
    "Impacts",
    "Outcome",
    "Scenario",
    "ScenarioError",
    "Table",
    "Touch",
    "Trajectory",
    "required_steps",
    "solve",
    "solve_batch",
]

_HOMES = {
    "required_steps": "slicemodel.step_advice",
    "solve": "slicemodel.solver",
    "solve_batch": "slicemodel.batch",
    "Batch": "slicemodel.batch",
    "Impact": "slicemodel.trajectory",
    "Impacts": "slicemodel.trajectory",
    "Outcome": "slicemodel.table",
    "Table": "slicemodel.table",
    "Touch": "slicemodel.table",
    "Trajectory": "slicemodel.trajectory",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for on first use (PEP 562), so that start-up stays light."""
    if name in _HOMES:
        from importlib import import_module

        globals()[name] = getattr(import_module(_HOMES[name]), name)
        return globals()[name]
    raise AttributeError(f"module 'slicemodel' has no attribute {name!r}")
