"""Anybody's solver behind the verb ``solve``, and flipproof's own solvers behind the contract of a foreign one."""

from __future__ import annotations

import atexit
import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from flipproof.foreign.checking import effort_of
from flipproof.foreign.contract import Answer, Ask, ForeignError, Runner, Traits, answer_of, started, trajectory_of
from flipproof.foreign.files import Folder, traits_of_command
from flipproof.foreign.isolated import Isolated
from flipproof.foreign.specs import (
    COMMAND,
    CSV,
    OBJECT,
    check_spec,
    content_of,
    is_foreign,
    is_spec,
    split_spec,
)
from flipproof.frame import solvers
from ode_reference.solver import WATERS
from slicemodel import Scenario, Trajectory
from slicemodel.schemes import SCHEMES
from slicemodel.trajectory import FloatArray, output_times

__all__ = ["Own", "check_spec", "is_spec", "opened", "solve"]


def solve(
    scenario: Scenario,
    *,
    spec: str,
    times: FloatArray | None = None,
    effort: float | None = None,
    level: float = 0,
    timeout: float | None = None,
    label: str = "",
) -> Trajectory:
    """Run the solver that a spec names, in a process of its own that is kept for the next run.

    Raises ForeignError if it gives no answer.

    Parameters
    ----------
    times : array, optional - output times [s]; 1000 uniform ones by default
    effort : float, optional - the number that the solver's ``refined_by`` names; by default that of ``level``
    level : float - refinement: 0 is a thousandth of the flight, each level halves the step
    timeout : float, optional - seconds that the run may take, instead of what the solver declares
    label : str - the method's name, instead of the solver's
    """
    runner = _runner(spec, content_of(spec), timeout)
    given = effort_of(runner.traits, scenario, level) if effort is None else effort
    ask = Ask.of(scenario, output_times(scenario, times), given)
    try:
        answer = runner(ask)
    except ForeignError as error:
        raise type(error)(f"{spec}: {error}") from None
    return trajectory_of(ask, answer, label or runner.traits.name)


def opened(
    spec: str,
    timeout: float | None = None,
    *,
    memory: float | None = None,
    given: Mapping[str, Any] = MappingProxyType({}),
) -> Runner:
    """Return the solver that a spec names, ready to be asked; raises ValueError if it names nothing.

    A run may take ``timeout`` seconds, or what the solver declares, and ``memory`` bytes, or half of the machine's.
    ``given`` are traits of a program or a folder, which cannot declare them.
    """
    kind, body = split_spec(spec)
    if given and kind == OBJECT:
        raise ValueError(f"solver {spec!r}: says itself what it is: {', '.join(given)} cannot be given")
    if not is_foreign(spec):
        return Own(solvers.find(spec))
    check_spec(spec)
    if kind == CSV:
        return Folder(Path(body), given)
    return Isolated(spec, timeout, memory, traits_of_command(spec, timeout, given) if kind == COMMAND else None)


_RUNNERS: Final[dict[tuple[str, float | None], tuple[str, Runner]]] = {}
"""The process of every solver that has been run, by spec and time limit, with the hash of its files."""


def _runner(spec: str, content: str, timeout: float | None) -> Runner:
    """Return the process of a solver; if its files have changed, the old process ends and a new one starts."""
    key = spec, timeout
    if key in _RUNNERS and _RUNNERS[key][0] != content:
        _RUNNERS.pop(key)[1].close()
    if key not in _RUNNERS:
        _RUNNERS[key] = content, opened(spec, timeout)
    return _RUNNERS[key][1]


@atexit.register
def _close() -> None:
    for _, runner in _RUNNERS.values():
        runner.close()


class Own(Runner):
    """A scheme, model or engine of flipproof as a runner."""

    def __init__(self, solver: solvers.Solver) -> None:
        self.solver = solver
        # Column and rods are no equations of slices: they are on no rung and declare none.
        equation = None if solver.name in WATERS else solver.name
        order = SCHEMES[solver.name].order if solver.name in SCHEMES else None
        declared: dict[str, dict[str, Any]] = {
            "slicemodel": {"equation": equation, "refined_by": "steps", "order": order},
            "ode_reference": {"equation": equation},
            "engine_check": {"equation": "free-flight", "refined_by": "dt"},
        }
        self.traits = Traits(name=solver.name, distribution="flipproof", timeout=600.0, **declared[solver.package])

    def __call__(self, ask: Ask) -> Answer:
        """Return the checked answer; the slice model computes on a uniform grid that holds the asked times."""
        settings: dict[str, Any] = {}
        grid: FloatArray | None = None
        if self.solver.package == "slicemodel":
            settings["steps"] = _points_of(ask)
            grid = np.linspace(0.0, ask.scenario.duration, settings["steps"])
        else:
            settings["times"] = ask.times
            if self.solver.package == "engine_check" and ask.effort is not None:
                settings["dt"] = ask.effort
        try:
            trajectory = solvers.solve(self.solver.name, started(ask), **settings)
            if not trajectory.ok:
                raise ForeignError(f"status = {trajectory.status!r}: {trajectory.message}")
            if grid is None:
                return answer_of(ask, trajectory)
            names = ("theta", "omega", "r", "v", "r_cm", "inertia")
            values = {n: _between(grid, getattr(trajectory, n), ask.times) for n in names}
            return answer_of(ask, {"t": ask.times, **values, "impacts": trajectory.impacts})
        except ForeignError:
            raise
        except (ValueError, ArithmeticError, MemoryError, RuntimeError) as error:
            raise ForeignError(f"{type(error).__name__}: {error}") from None


def _points_of(ask: Ask) -> int:
    """Return the points of a uniform grid of ``effort`` steps or more, which holds the asked times if they are even."""
    points, duration = len(ask.times), ask.scenario.duration
    steps = max(1, math.ceil((ask.effort or 1000.0) - 1e-9))
    even = points > 1 and float(np.max(np.abs(ask.times - np.linspace(0.0, duration, points)))) <= 1e-9 * duration
    return (points - 1) * math.ceil(steps / (points - 1)) + 1 if even else steps + 1


def _between(grid: FloatArray, values: FloatArray, times: FloatArray) -> FloatArray:
    """Return values at ``times``: those of the grid where it has them, linear between."""
    k = np.clip(np.searchsorted(grid, times), 1, len(grid) - 1)
    fraction = np.clip((times - grid[k - 1]) / (grid[k] - grid[k - 1]), 0.0, 1.0)
    fraction = np.where(np.abs(fraction - np.round(fraction)) < 1e-6, np.round(fraction), fraction)
    fraction = fraction.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(np.where(fraction == 1.0, values[k], values[k - 1] + fraction * (values[k] - values[k - 1])))
