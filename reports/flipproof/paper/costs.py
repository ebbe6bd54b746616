"""What a run costs: counted work, and processor time as an observation of this machine at this moment."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from flipproof.frame.solvers import solve
from flipproof.paper.parameters import numbers, paper_steps, paper_throw
from slicemodel import Scenario, Trajectory


@dataclass(frozen=True, slots=True)
class Cost:
    """One timed run.

    Parameters
    ----------
    solver : str
    slices, steps : int - N, and P: steps of the published program, output times of an event-driven solver
    work : int - slice steps N P of the published program; slices times Taylor series otherwise
    seconds : float - processor time, compiled
    """

    solver: str
    slices: int
    steps: int
    work: int
    seconds: float


def _numbers(of: str) -> list[int]:
    return [round(value) for value in numbers(f"figure-S1-{of}")]


def measure_published(solver: str) -> tuple[Cost, ...]:
    """Time the published program over the slices and steps of Supp. Fig. 1; the least of five runs."""
    throw = paper_throw()
    _seconds(solver, throw, steps=2, store="summary")  # compiles
    costs = []
    for slices, steps in product(_numbers("slices"), _numbers("steps")):
        run = partial(_seconds, solver, throw.with_slices(slices), steps=steps, store="summary")
        costs.append(Cost(solver, slices, steps, slices * steps, min(run()[0] for _ in range(5))))
    return tuple(costs)


def measure_event_driven(solver: str) -> tuple[Cost, ...]:
    """Time an event-driven solver over slices, and over the number of output times that stands for P there."""
    throw = paper_throw()
    _seconds(solver, throw.with_slices(1), times=[throw.duration / 100])  # loads the compiled flow
    costs = []
    for slices, steps in product((10, 100, 500), _numbers("steps")):
        # Output times do not change the steps of these solvers: one number of slices shows that.
        if steps >= paper_steps() or slices == 100:
            times = np.linspace(0.0, throw.duration, steps)
            seconds, run = _seconds(solver, throw.with_slices(slices), times=times)
            costs.append(Cost(solver, slices, steps, slices * int(run.diagnostics["evaluations"]), seconds))
    return tuple(costs)


def _seconds(solver: str, scenario: Scenario, **settings: Any) -> tuple[float, Trajectory]:
    began = time.process_time()
    run = solve(solver, scenario, **settings)
    return time.process_time() - began, run
