"""What a run costs: counted work, and processor time as an observation of this machine at this moment."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from flipproof.frame.solvers import solve
from flipproof.paper.parameters import numbers, paper_steps, paper_throw
from slicemodel import Scenario

REPEATS: Final = 5
"""Times that the published program is timed; the least time counts."""

EVENT_SLICES: Final = (10, 100, 500)
"""Numbers of slices of the timed event-driven runs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """One timed run.

    Parameters
    ----------
    solver : str
    slices, steps : int
        N, and P: steps of the published program, output times of an event-driven solver.
    work : int
        Slice steps N P of the published program; slices times Taylor series otherwise.
    seconds : float
        Processor time, compiled.
    """

    solver: str
    slices: int
    steps: int
    work: int
    seconds: float


def measure_published(solver: str) -> tuple[Cost, ...]:
    """Time the published program over the slices and steps of Supp. Fig. 1; the least of a few runs."""
    throw = paper_throw()
    _seconds(solver, throw, {"steps": 2, "store": "summary"})  # compiles
    costs = []
    for slices in (round(value) for value in numbers("figure-S1-slices")):
        for steps in (round(value) for value in numbers("figure-S1-steps")):
            settings = {"steps": steps, "store": "summary"}
            least = min(_seconds(solver, throw.with_slices(slices), settings)[0] for _ in range(REPEATS))
            costs.append(Cost(solver=solver, slices=slices, steps=steps, work=slices * steps, seconds=least))
    return tuple(costs)


def measure_event_driven(solver: str) -> tuple[Cost, ...]:
    """Time an event-driven solver over slices, and over the number of output times that stands for P there."""
    throw = paper_throw()
    _seconds(solver, throw.with_slices(1), {"times": [throw.duration / 100]})  # loads the compiled flow
    costs = []
    for slices in EVENT_SLICES:
        for steps in (round(value) for value in numbers("figure-S1-steps")):
            if steps < paper_steps() and slices != EVENT_SLICES[1]:
                continue  # output times do not change the steps of these solvers: one number of slices shows that
            times = np.linspace(0.0, throw.duration, steps)
            seconds, run = _seconds(solver, throw.with_slices(slices), {"times": times})
            work = slices * int(run.diagnostics["evaluations"])
            costs.append(Cost(solver=solver, slices=slices, steps=steps, work=work, seconds=seconds))
    return tuple(costs)


def _seconds(solver: str, scenario: Scenario, settings: dict[str, Any]) -> tuple[float, Any]:
    began = time.process_time()
    run = solve(solver, scenario, **settings)
    return time.process_time() - began, run
