"""Every solver of the three packages under one name, and runs of them as data."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import Any, Final

import numpy as np

from flipproof.frame.beside import beside
from flipproof.frame.others import OTHERS
from slicemodel import Scenario, Trajectory
from slicemodel.observables import plateau
from slicemodel.scenario import unknown_name

REFERENCE: Final = Scenario().with_slices(50)
"""The paper's own throw, on which the regression claims are made."""

FINER: Final = 2
"""Multiple of the slices at which every number of the verdict is computed again, to show how far it moves with N."""


@dataclass(frozen=True, slots=True)
class Solver:
    """A scheme, model or engine by name, with the package whose ``solve`` takes it."""

    name: str
    package: str
    keyword: str
    equation: str
    reason: str


def catalogue() -> dict[str, Solver]:
    """Return every solver by name: the schemes, the models of the reference, the engines."""
    from engine_check.engines import ENGINES
    from ode_reference.models import MODELS
    from ode_reference.solver import WATERS
    from slicemodel.schemes import SCHEMES

    solvers = [Solver(s.name, "slicemodel", "scheme", s.limit, s.reason) for s in SCHEMES.values()]
    solvers += [Solver(m.name, "ode_reference", "model", m.equation, m.reason) for m in MODELS.values()]
    solvers += [Solver(name, "ode_reference", "model", m.equation, m.reason) for name, m in WATERS.items()]
    solvers += [Solver(e.name, "engine_check", "engine", e.equation, e.reason) for e in ENGINES.values()]
    return {solver.name: solver for solver in solvers}


def find(name: str) -> Solver:
    """Return the solver of that name; "switches:110000" and its like are combinations of the ladder's rungs.

    Other names are asked of the modules in ``OTHERS``: specs of somebody else's solver.
    A name that no solver has raises a ValueError, which names the nearest.
    """
    from ode_reference.switches import Switches, are_switches

    if are_switches(name):
        from ode_reference.combinations import model_of

        model = model_of(Switches.from_name(name))
        return Solver(name, "ode_reference", "model", model.equation, model.reason)
    solvers = catalogue()
    if name not in solvers:
        for module in OTHERS:
            if (provider := import_module(module)).is_spec(name):
                provider.check_spec(name)
                return Solver(name, module, "spec", "", "somebody else's solver")
        raise ValueError(unknown_name("solver", name, solvers))
    return solvers[name]


class Missing(Exception):  # noqa: N818
    """A flight, or what is made of flights, is not there; the message says why."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One run to make: solver, scenario and settings. Equal runs are one run: it is made once, and is its own key.

    ``label`` is how the run is named to a reader; it takes no part in the comparison.
    """

    solver: str
    scenario: Scenario
    settings: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Run) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @property
    def _key(self) -> tuple[Any, ...]:
        return self.solver, self.scenario, _hashable(self.settings)

    @property
    def name(self) -> str:
        """The label, or the solver where there is none."""
        return self.label or self.solver


def _hashable(value: Any) -> Any:
    """Return a value that compares like ``value`` and can be hashed: mappings, lists and arrays become tuples."""
    if isinstance(value, Mapping):
        return tuple(sorted((name, _hashable(element)) for name, element in value.items()))
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    # 1 == 1.0 == True, but a solver may take them for different things.
    return tuple(map(_hashable, value)) if isinstance(value, (list, tuple)) else (type(value).__name__, value)


def finer(run: Run) -> Run:
    """Return the same run at ``FINER`` times the slices."""
    more = run.scenario.with_slices(FINER * run.scenario.n_slices)
    return replace(run, scenario=more, label=f"{run.name}, {FINER} times the slices")


@dataclass(frozen=True, slots=True)
class RunResult:
    """A run that was made, and the seconds it took. ``trajectory`` is None if it failed for ``reason``."""

    run: Run
    trajectory: Trajectory | None
    seconds: float
    reason: str = ""

    @property
    def flight(self) -> Trajectory:
        """The trajectory; raises Missing with the reason if there is none."""
        if self.trajectory is None:
            raise Missing(f"{self.run.name}: {self.reason}")
        return self.trajectory

    @property
    def whole(self) -> Trajectory:
        """The trajectory; raises Missing with the reason if there is none or the run did not reach its end."""
        if self.problem:
            raise Missing(f"{self.run.name}: {self.problem}")
        return self.flight

    @property
    def problem(self) -> str:
        """Why there is no trajectory, or why the run did not reach its end; "" if it did."""
        run = self.trajectory
        if run is None:
            return self.reason
        return "" if run.ok else f"{run.status}: {run.message}"

    @property
    def plateau(self) -> float:
        """Mean of omega / omega_0 over the second half of the flight; NaN if the run did not reach its end."""
        if self.problem:
            return math.nan
        return plateau(self.flight.t, self.flight.omega, self.flight.scenario.omega0)


def make(run: Run) -> RunResult:
    """Make one run; whatever it raises becomes its reason, so that a report can show the failure in place."""
    began = time.perf_counter()
    trajectory, reason = None, ""
    try:
        flight = solve(run.solver, run.scenario, **run.settings)
        if len(flight.t):
            trajectory = flight
        else:
            reason = f"{flight.status}: {flight.message}"
    except (ValueError, ArithmeticError, MemoryError, RuntimeError) as error:
        reason = f"{type(error).__name__}: {error}"
    return RunResult(run, trajectory, time.perf_counter() - began, reason)


def solve(name: str, scenario: Scenario, **settings: Any) -> Trajectory:
    """Run the named solver with its package's own ``solve``."""
    solver = find(name)
    settings = {solver.keyword: name, **settings}
    package = import_module(solver.package)
    if solver.package == "engine_check" and "tolerance" not in settings:
        # Without step and tolerance an engine would certify each run, at several times its cost; the report's own
        # refinement (``chapters.differences``) says what its runs are worth.
        settings = {"dt": package.DEFAULT_DT, **settings}
    if solver.package in OTHERS:  # waits for a process, which signals interrupt
        foreign: Trajectory = package.solve(scenario, **settings)
        return foreign
    trajectory: Trajectory = beside(package.solve, scenario, **settings)
    return trajectory


def without_gravity(scenario: Scenario) -> Scenario:
    """Return the same throw far from any planet."""
    return replace(scenario, gravity=0.0)
