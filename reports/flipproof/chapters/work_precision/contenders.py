"""Who competes in the work-precision study, with which settings, against which equation.

Every scheme of the slice model, every method of the reference and every engine comes from its package's own registry:
a new one appears by itself. Each is held against the equation *it* solves, never against the one we believe in: what
lies between equations is model form, and stands elsewhere.

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

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
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

AT_REST: Final = "at rest"
"""The limit of ``paper-typeset``: nothing moves, and omega is omega_0 for ever."""

OWN_LIMIT: Final = "limit of "
"""Leads the name of an equation that no model states: where the scheme itself goes on finer grids."""

EQUATION_OF_SCHEME: Final[Mapping[str, str]] = {**LIMITS, "paper-typeset": AT_REST}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A throw on which all compete."""

    name: str
    title: str
    scenario: Scenario

    @property
    def times(self) -> FloatArray:
        """The common times, shape (COMMON + 1,) [s]."""
        return np.linspace(0.0, self.scenario.duration, COMMON + 1)


# With 20 slices, ten times the rest speed moves free flight by 1.4e-3 omega_0 after 1251 impacts, and nothing finer
# than that could be told apart; with 12 by 1e-5.
THROW: Final = Scenario().with_slices(12)
CASE: Final = Case(name="impacts", title="the paper's throw, with all its impacts", scenario=THROW)
"""The throw of the report."""


class Grids(NamedTuple):
    """Number of levels, and the members of each: their steps at the first level, as multiples of COMMON."""

    levels: int
    members: tuple[int, ...]

    def settings(self, of: Callable[[int], dict[str, Any]]) -> tuple[tuple[dict[str, Any], ...], ...]:
        """Return the setting of every member of every level, from its number of steps, which doubles each time."""
        return tuple(tuple(of(COMMON * member * 2**level) for member in self.members) for level in range(self.levels))


class Asked(NamedTuple):
    """The relative tolerances of a method, and the equations that it is asked for; none: all that have a contender."""

    rtol: tuple[float, ...]
    equations: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is run: grids of schemes and engines, and what methods are asked."""

    schemes: Grids
    engines: Grids
    methods: Mapping[str, Asked]


FULL: Final = Effort(
    schemes=Grids(7, (4, 5, 6)),
    engines=Grids(5, (4, 6)),
    methods={
        "DOP853": Asked((1e-3, 1e-6, 1e-9, 1e-11)),
        # The implicit methods on an equation without recoil and on one with it.
        "LSODA": Asked((1e-3, 1e-6, 1e-9, 1e-11), ("eq8", "free-flight")),
        "Radau": Asked((1e-5, 1e-8), ("eq8", "free-flight")),
    },
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Contender:
    """One curve of the diagram.

    Parameters
    ----------
    name : str - as figures and tables print it
    family : {"scheme", "method", "engine"}
    solver : str - whose ``solve`` is asked: scheme, model or engine
    equation : str - what it is held against: a model's name, AT_REST, or OWN_LIMIT and the scheme
    fixed : mapping - settings of all its runs
    levels : levels of members - the settings that are refined
    """

    name: str
    family: Literal["scheme", "method", "engine"]
    solver: str
    equation: str
    fixed: Mapping[str, Any]
    levels: tuple[tuple[Mapping[str, Any], ...], ...]

    @property
    def key(self) -> str:
        """Unique among the contenders of a throw: a method competes once for each equation."""
        return f"{self.name} on {self.equation}"

    def runs(self, case: Case) -> list[list[Run]]:
        """Return the runs of every level."""
        label = f"work, {case.name}, {self.key}"
        return [
            [
                Run(self.solver, case.scenario, {**self.fixed, **settings}, f"{label}, {k}, {member}")
                for member, settings in enumerate(level)
            ]
            for k, level in enumerate(self.levels)
        ]


def contenders(case: Case, effort: Effort) -> tuple[Contender, ...]:
    """Return all who compete on a throw: schemes, engines, then methods for each equation that one of these solves."""
    rivals = (*_schemes(effort), *_engines(case, effort))
    solved = {rival.equation for rival in rivals}
    return (*rivals, *_methods(case, effort, [model for model in MODELS if model in solved]))


def _schemes(effort: Effort) -> Iterator[Contender]:
    for name, scheme in SCHEMES.items():
        yield Contender(
            name=name,
            family="scheme",
            solver=name,
            equation=EQUATION_OF_SCHEME.get(name, OWN_LIMIT + name),
            fixed={"store": "summary", "rebound": "in-step" if scheme.form.in_step else "grid"},
            # Points of the grid: one more than steps.
            levels=effort.schemes.settings(lambda steps: {"steps": steps + 1}),
        )


def _engines(case: Case, effort: Effort) -> Iterator[Contender]:
    from engine_check.pymunk_settings import enough_iterations

    duration = case.scenario.duration
    for engine in ENGINES.values():
        # Iterations by rule, where the engine iterates; they depend on the throw, not on dt.
        iterated = {"iterations": enough_iterations(case.scenario)} if engine.sweeps else {}
        yield Contender(
            name=engine.name,
            family="engine",
            solver=engine.name,
            equation=engine.model,
            fixed={"times": case.times, **iterated},
            levels=effort.engines.settings(lambda steps: {"dt": duration / steps}),
        )


def _methods(case: Case, effort: Effort, solved: list[str]) -> Iterator[Contender]:
    longest = case.scenario.duration
    # Radau's dense output has order 3: with steps as long as its tolerance allows, rests and releases chatter (627 402
    # right-hand sides at rtol 1e-4, where 10 071 suffice at 1e-8). 0.02 rad of the bottle at release are short enough.
    shorter = min(0.02 / abs(case.scenario.omega0), longest)
    for model in solved:
        for method, asked in effort.methods.items():
            if asked.equations and model not in asked.equations:
                continue
            yield Contender(
                name=method,
                family="method",
                solver=model,
                equation=model,
                fixed={
                    "method": method,
                    "max_step": shorter if method == "Radau" else longest,
                    "rest_speed": usual_rest_speed(model),
                    "impact_law": "simultaneous",
                    "times": case.times,
                },
                # The numbers are of the order of 0.1 to 10.
                levels=tuple(({"rtol": rtol, "atol": 1e-3 * rtol},) for rtol in asked.rtol),
            )
