"""Anybody's solver behind the verb ``solve``, and flipproof's own solvers behind the contract of a foreign one."""

from __future__ import annotations

import atexit
import math
from typing import Any, Final

import numpy as np

from flipproof.foreign.checking import effort_of
from flipproof.foreign.contract import Answer, AnswerError, Ask, Traits, answer_of, trajectory_of
from flipproof.foreign.specs import ForeignError, Runner, content_of, opened
from flipproof.frame import solvers
from ode_reference.solver import WATERS
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray, output_times


def solve(
    scenario: Scenario, *, spec: str, times: FloatArray | None = None, effort: float | None = None, **options: Any
) -> Trajectory:
    """Run the solver that a spec names, in a process of its own that serves the next run, too.

    Raises ForeignError if it gives no answer.

    Parameters
    ----------
    times : array, optional - output times [s]; 1000 uniform ones by default
    effort : float, optional - the number that the solver's ``refined_by`` names; a thousandth of the flight by default
    options : passed to the solver by name
    """
    runner = _runner(spec, content_of(spec))
    given = effort_of(runner.traits, scenario, 0) if effort is None else effort
    ask = Ask.of(scenario, output_times(scenario, times), given, **options)
    try:
        return trajectory_of(ask, runner(ask), runner.traits)
    except ForeignError as error:
        raise type(error)(f"{spec}: {error}") from None


_RUNNERS: Final[dict[str, tuple[str, Runner]]] = {}
"""The process of every solver that has been run, by spec, with the content of its files."""


def _runner(spec: str, content: str) -> Runner:
    """Return the process of a solver; one whose files have changed gets another, and its old process ends."""
    if spec in _RUNNERS and _RUNNERS[spec][0] != content:
        _RUNNERS.pop(spec)[1].close()
    if spec not in _RUNNERS:
        _RUNNERS[spec] = content, opened(spec, curves=True)
    return _RUNNERS[spec][1]


@atexit.register
def _close() -> None:
    for _, runner in _RUNNERS.values():
        runner.close()


class Own(Runner):
    """A scheme, model or engine of flipproof as a runner."""

    def __init__(self, solver: solvers.Solver) -> None:
        self.solver = solver
        # Column and rods are no equations of slices: they stand on no rung and declare none.
        equation = None if solver.name in WATERS else solver.name
        order = 2.0 if solver.name == "midpoint" else 1.0
        declared: dict[str, dict[str, Any]] = {
            "slicemodel": {"equation": equation, "refined_by": "steps", "order": order},
            "ode_reference": {"equation": equation},
            "engine_check": {"equation": "free-flight", "refined_by": "dt"},
        }
        self.traits = Traits(name=solver.name, distribution="flipproof", timeout=600.0, **declared[solver.package])

    def __call__(self, ask: Ask) -> Answer:
        """Return the checked answer; the slice model computes on a uniform grid that holds the asked times."""
        settings: dict[str, Any] = dict(ask.options)
        stride = 1
        if self.solver.package == "slicemodel":
            stride, settings["steps"] = _grid_of(ask)
        else:
            settings["times"] = ask.times
            if self.solver.package == "engine_check" and ask.effort is not None:
                settings["dt"] = ask.effort
        try:
            found = solvers.solve(self.solver.name, ask.scenario, **settings)
            if not found.ok:
                raise ForeignError(f"status = {found.status!r}: {found.message}")
            if stride == 1:
                return answer_of(ask, found)
            names = ("t", "theta", "omega", "r", "v", "r_cm", "inertia")
            return answer_of(ask, {n: getattr(found, n)[::stride] for n in names} | {"impacts": found.impacts})
        except ForeignError:
            raise
        except (ValueError, ArithmeticError, MemoryError, RuntimeError) as error:
            raise ForeignError(f"{type(error).__name__}: {error}") from None


def _grid_of(ask: Ask) -> tuple[int, int]:
    """Return steps between asked times, and points of the grid, for ``effort`` steps or more.

    Times that are off a uniform grid by more than 1e-9 of the duration raise AnswerError.
    """
    points, duration = len(ask.times), ask.scenario.duration
    uniform = np.linspace(0.0, duration, points)
    if points < 2 or float(np.max(np.abs(ask.times - uniform))) > 1e-9 * duration:
        raise AnswerError(f"times are not a uniform grid over [0, {duration:g}] s, which the slice model computes on")
    stride = max(1, math.ceil((ask.effort or 1000.0) / (points - 1) - 1e-9))
    return stride, stride * (points - 1) + 1
