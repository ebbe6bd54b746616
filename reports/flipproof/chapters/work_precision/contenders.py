"""Who competes in the work-precision study, with which settings, against which equation.

Every scheme of the slice model that converges to a model, every method of the reference and every engine comes from
its package's own registry: a new one appears by itself. Each is held against the equation *it* solves, never against
the one we believe in: what lies between equations is model form, and stands elsewhere.

==========  ============================================  ==========================================================
family      refined by                                    work, in updates of one slice
==========  ============================================  ==========================================================
scheme      number of steps, doubled at each level        steps times slices; twice that if it predicts (midpoint)
method      relative tolerance, cut at each level         right-hand sides times slices; linear algebra not counted
engine      dt, halved at each level                      steps times slices times what one step does to a slice:
                                                          iterations of an impulse solver, or 4 stages of RK4
==========  ============================================  ==========================================================

Grids of one level share ``COMMON`` intervals with all others, and errors are read there. A level of a scheme or an
engine has several members: their impacts fall at other phases of the step, and a single one may be lucky.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from engine_check.engines import ENGINES
from flipproof.chapters.solvers import LIMITS
from flipproof.frame.solvers import Run
from flipproof.frame.twins import usual_rest_speed
from ode_reference.models import MODELS
from slicemodel import Scenario
from slicemodel.schemes import SCHEMES
from slicemodel.trajectory import FloatArray

COMMON: Final = 40
"""Intervals that all runs of a throw share."""

IMPLICIT_ON: Final = ("eq8", "free-flight")
"""The equations that implicit methods are asked for: one without recoil and one with it."""

# With 20 slices, ten times the rest speed moves free flight by 1.4e-3 omega_0 after 1251 impacts, and nothing finer
# than that could be told apart; with 12 by 1e-5.
THROW: Final = Scenario().with_slices(12)
"""The paper's throw, as the report shows it."""


def common_times(throw: Scenario) -> FloatArray:
    """Return the times at which errors are read, shape (COMMON + 1,) [s]."""
    return np.linspace(0.0, throw.duration, COMMON + 1)


class Grids(NamedTuple):
    """Number of levels, and the members of each: their steps at the first level, as multiples of COMMON."""

    levels: int
    members: tuple[int, ...]

    def steps(self) -> list[list[int]]:
        """Return the number of steps of every member of every level; it doubles from one level to the next."""
        return [[COMMON * member * 2**level for member in self.members] for level in range(self.levels)]


class Effort(NamedTuple):
    """How much is run: grids of schemes and engines, and the relative tolerances of methods."""

    schemes: Grids
    engines: Grids
    methods: Mapping[str, tuple[float, ...]]


FULL: Final = Effort(
    schemes=Grids(7, (4, 5, 6)),
    engines=Grids(5, (4, 6)),
    methods={"DOP853": (1e-3, 1e-6, 1e-9, 1e-11), "LSODA": (1e-3, 1e-6, 1e-9, 1e-11), "Radau": (1e-5, 1e-8)},
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Contender:
    """One curve of the diagram.

    Parameters
    ----------
    name : str - as figures and tables print it
    family : {"scheme", "method", "engine"}
    equation : str - the model that it is held against
    levels : the runs of every level, the coarsest first
    """

    name: str
    family: Literal["scheme", "method", "engine"]
    equation: str
    levels: tuple[tuple[Run, ...], ...]

    @property
    def key(self) -> str:
        """Unique among the contenders of a throw: a method competes once for each equation."""
        return f"{self.name} on {self.equation}"


class Plan(NamedTuple):
    """All who compete on a throw, and the reference of every equation that somebody solves, its witnesses behind it."""

    throw: Scenario
    rivals: tuple[Contender, ...]
    references: Mapping[str, tuple[Run, ...]]

    def runs(self) -> list[Run]:
        """Return every run."""
        levels = (level for rival in self.rivals for level in rival.levels)
        return list(chain.from_iterable((*self.references.values(), *levels)))


def plan_work_precision(throw: Scenario, effort: Effort) -> Plan:
    """Plan schemes, engines, the methods for each equation that one of these solves, and all references."""
    rivals = (*_schemes(throw, effort), *_engines(throw, effort))
    solved = {rival.equation for rival in rivals}
    rivals += tuple(_methods(throw, effort, [model for model in MODELS if model in solved]))
    references = {model: _reference(throw, model) for model in dict.fromkeys(rival.equation for rival in rivals)}
    return Plan(throw, rivals, references)


def _levels(throw: Scenario, solver: str, key: str, levels: Iterable[list[dict[str, Any]]]) -> tuple[Any, ...]:
    """Return the runs of levels, each a list of its members' settings."""
    return tuple(
        tuple(Run(solver, throw, settings, f"work, {key}, {k}, {member}") for member, settings in enumerate(level))
        for k, level in enumerate(levels)
    )


def _schemes(throw: Scenario, effort: Effort) -> Iterator[Contender]:
    for name, equation in LIMITS.items():
        fixed = {"store": "summary", "rebound": "in-step" if SCHEMES[name].form.in_step else "grid"}
        # Points of the grid: one more than steps.
        levels = [[{**fixed, "steps": steps + 1} for steps in level] for level in effort.schemes.steps()]
        runs = _levels(throw, name, f"{name} on {equation}", levels)
        yield Contender(name=name, family="scheme", equation=equation, levels=runs)


def _engines(throw: Scenario, effort: Effort) -> Iterator[Contender]:
    from engine_check.pymunk_settings import enough_iterations

    for engine in ENGINES.values():
        # Iterations by rule, where the engine iterates; they depend on the throw, not on dt.
        fixed = {"times": common_times(throw)} | ({"iterations": enough_iterations(throw)} if engine.sweeps else {})
        levels = [[{**fixed, "dt": throw.duration / steps} for steps in level] for level in effort.engines.steps()]
        runs = _levels(throw, engine.name, f"{engine.name} on {engine.model}", levels)
        yield Contender(name=engine.name, family="engine", equation=engine.model, levels=runs)


def _methods(throw: Scenario, effort: Effort, solved: list[str]) -> Iterator[Contender]:
    # Radau's dense output has order 3: with steps as long as its tolerance allows, rests and releases chatter (627 402
    # right-hand sides at rtol 1e-4, where 10 071 suffice at 1e-8). 0.02 rad of the bottle at release are short enough.
    longest = {"Radau": min(0.02 / abs(throw.omega0), throw.duration)}
    for model in solved:
        for method, tolerances in effort.methods.items():
            if method != "DOP853" and model not in IMPLICIT_ON:
                continue
            fixed = {
                "method": method,
                "max_step": longest.get(method, throw.duration),
                "rest_speed": usual_rest_speed(model),
                "impact_law": "simultaneous",
                "times": common_times(throw),
            }
            # The numbers are of the order of 0.1 to 10.
            levels = [[{**fixed, "rtol": rtol, "atol": 1e-3 * rtol}] for rtol in tolerances]
            runs = _levels(throw, model, f"{method} on {model}", levels)
            yield Contender(name=method, family="method", equation=model, levels=runs)


def _reference(throw: Scenario, model: str) -> tuple[Run, ...]:
    """Return the reference of an equation and its witnesses."""
    usual, times = usual_rest_speed(model), common_times(throw)
    variants: list[dict[str, Any]] = [{"method": "taylor", "rest_speed": usual / 10, "times": times}]
    for method, rtol, radians in (("LSODA", 1e-10, 0.02), ("DOP853", 1e-11, 0.04)):
        longest = min(radians / abs(throw.omega0), throw.duration)
        tolerances = {"rtol": rtol, "atol": 1e-3 * rtol, "rest_speed": usual, "max_step": longest}
        variants.append({"method": method, **tolerances, "times": times})
    names = ("reference", "witness 1", "witness 2")
    return tuple(
        Run(model, throw, settings, f"work, {name}, {model}") for name, settings in zip(names, variants, strict=True)
    )
