"""The wall time of a run alone."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from flipproof.frame.solvers import find, solve
from slicemodel import Scenario, Trajectory
from slicemodel.scenario import MIN_VALUE


def solve_timed(name: str, scenario: Scenario, **settings: Any) -> tuple[Trajectory, float]:
    """Run the named solver; return its flight and the wall time it took [s], without compiling ``ode_reference``."""
    if find(name).package == "ode_reference":
        # The first fiftieth of the throw, or all of one that is as short as may be, compiles it at its own times.
        short = replace(scenario, duration=max(MIN_VALUE, 0.02 * scenario.duration))
        solve(name, short, **{key: value for key, value in settings.items() if key != "times"})
    began = time.perf_counter()
    flight = solve(name, scenario, **settings)
    return flight, time.perf_counter() - began
