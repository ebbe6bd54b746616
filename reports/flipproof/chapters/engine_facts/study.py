"""What an engine does that its user may not expect: each fact measured, with the interval that the number must lie in.

Some facts need the bottle: they are runs. The others are measured in worlds of one or two bodies (``worlds``), because
in the bottle other settings hide them: ``engine_check`` has chosen its knobs so that they cannot bite.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from flipproof.chapters.differences.study import largest_change
from flipproof.chapters.engine_facts import worlds
from flipproof.frame.findings import Finding, regression
from flipproof.frame.solvers import Made, Run, without_gravity
from slicemodel import Scenario

FEW_ITERATIONS: Final = 10
LONG_DT, SHORT_DT = 1e-3, 1e-4
"""Iterations and steps [s] of the two runs that explode."""

SHUFFLES: Final = (1, 2, 3)
FEW, MANY = 25, 100
"""Seeds of the order of insertion, and iterations at which they are compared."""

Measured = Callable[[Mapping[str, Made]], tuple[float, str]]
"""The runs by what is said of each -> the number that shows a fact, and how it was measured."""


@dataclass(frozen=True, slots=True)
class EngineFact:
    """One fact about an engine; its stable ``id`` is a key of ``WORDS``.

    It holds if the number that ``measure`` returns lies in the closed interval ``admissible``, in ``unit``. That raises
    LookupError, with the reason, if a run that it needs is not whole.
    """

    engine: str
    id: str
    unit: str
    admissible: tuple[float, float]
    measure: Measured

    def found(self, made: Mapping[str, Made]) -> Finding:
        """Return the finding: that the number lies in its interval, or why there is none.

        A fact about an engine that is not installed and need not be cannot fail.
        """
        value, absent = None, False
        try:
            value, note = self.measure(made)
        except ModuleNotFoundError as missing:
            note = f"{self.engine} is not installed ({missing})"
            absent = self.engine != "pymunk"
        except LookupError as missing:
            note = str(missing.args[0])
        fact = regression(f"engine-fact-{self.id}", WORDS[self.id], value, self.unit, self.admissible, note)
        return replace(fact, kind="observation") if absent else fact


def plan_engine_facts(throw: Scenario) -> dict[str, Run]:
    """Return the runs of the facts that need the bottle, by what is said of each; about two seconds in all.

    Few slices, a flight that has its first impacts, an output time every millisecond. In a run that is about something
    else the engine iterates 100 times, where its rule asks for 57.
    """
    few = replace(throw.with_slices(10), duration=min(0.2, throw.duration))
    usual: dict[str, Any] = {"dt": 2e-4, "iterations": 100, "times": np.linspace(0.0, few.duration, 201)}
    changes: dict[str, dict[str, Any]] = {"usual": {}, "no gravity": {}}
    for dt in (LONG_DT, SHORT_DT):
        changes[f"few iterations, dt {dt:g} s"] = {"dt": dt, "iterations": FEW_ITERATIONS}
    for iterations in (FEW, MANY):
        for seed in (0, *SHUFFLES):
            changes[f"order {seed}, {iterations} iterations"] = {"iterations": iterations, "shuffle": seed}
    # Unless told otherwise a joint removes a tenth of the error at each of 60 steps a second.
    changes["joints corrected as by default"] = {"error_bias": (1.0 - 0.1) ** 60}
    throws = dict.fromkeys(changes, few) | {"no gravity": without_gravity(few)}
    return {
        words: Run("pymunk", throws[words], usual | change, f"engine fact, {words}")
        for words, change in changes.items()
    }


def _gravity(made: Mapping[str, Made]) -> tuple[float, str]:
    usual, without = made["usual"].whole, made["no gravity"].whole
    fallen = 0.5 * usual.scenario.gravity * float(usual.t[-1]) ** 2
    return largest_change(usual, without), f"the bottle falls by {fallen:.2f} m meanwhile"


def _smaller_step(made: Mapping[str, Made]) -> tuple[float, str]:
    held = []
    for dt in (LONG_DT, SHORT_DT):
        run = made[f"few iterations, dt {dt:g} s"].flight
        if run.ok:
            raise LookupError(f"with {FEW_ITERATIONS} iterations and dt = {dt:g} s nothing explodes")
        held.append(float(run.t[-1]))
    long, short = held
    note = f"holds for {long * 1e3:g} ms at Δt = {LONG_DT:g} s, for {short * 1e3:g} ms at {SHORT_DT:g} s"
    return (short / long if long else math.nan), note


def _widest(made: Mapping[str, Made], iterations: int) -> float:
    """Return the largest change of omega by another order."""
    usual, *others = (made[f"order {seed}, {iterations} iterations"].whole for seed in (0, *SHUFFLES))
    return max(largest_change(usual, other) for other in others)


def _order(made: Mapping[str, Made]) -> tuple[float, str]:
    again = largest_change(made["usual"].whole, made[f"order 0, {MANY} iterations"].whole)
    return _widest(made, FEW), f"{len(SHUFFLES)} shuffled orders; the same order twice: {again:.1g}"


def _order_forgotten(made: Mapping[str, Made]) -> tuple[float, str]:
    few, many = _widest(made, FEW), _widest(made, MANY)
    note = f"{few:.1e} to {many:.1e} of ω₀: what the order moves is what the solver has not iterated away"
    return many / few, note


def _joints(made: Mapping[str, Made]) -> tuple[float, str]:
    default = made["joints corrected as by default"].whole.diagnostics["constraint_drift"]
    ours = made["usual"].whole.diagnostics["constraint_drift"]
    return float(default), f"{ours:.1e} with errors removed within one step"


def _elasticity(_: Mapping[str, Made]) -> tuple[float, str]:
    others = ", ".join(f"{a:g} and {b:g} give {worlds.rebound_of_two(a, b):.2f}" for a, b in ((1.0, 0.5), (0.0, 1.0)))
    return worlds.rebound_of_two(0.5, 0.5), others


def _slop(_: Mapping[str, Made]) -> tuple[float, str]:
    (default, left), without = worlds.depth_left(None), worlds.depth_left(0.0)[1]
    dropped = f"a disc dropped at 2 m/s (Δt = 10 ms) stays {left * 1e3:.1f} mm deep in the floor"
    return default, f"{dropped}, {without * 1e3:.1g} mm with slop 0"


def _tunnel(_: Mapping[str, Made]) -> tuple[float, str]:
    back = worlds.speed_through_wall(1e-3)
    note = f"5 m/s and a wall of 10 mm at Δt = 10 ms; at 1 ms it comes back, {back:.3g}"
    return worlds.speed_through_wall(1e-2), note


WORDS: Final = {
    "gravity": "gravity changes nothing in free flight: largest change of ω(t) when it is switched off",
    "smaller-step": f"with {FEW_ITERATIONS} iterations a tenth of the step explodes sooner: quotient of the times it "
    "holds",
    "order": f"the order in which bodies enter matters: largest change of ω(t), {FEW} iterations",
    "order-forgotten": f"a solver that converges forgets the order: that change at {MANY} iterations over "
    f"that at {FEW}",
    "joints": "joints give: how far a mass leaves the axis that a joint holds it on, default correction",
    "elasticity": "elasticities multiply: restitution of two shapes of 0.5 each",
    "groove-end": "the end of a groove is a dead stop whatever the elasticity: speed back over speed before",
    "stagger": "velocities stand half a step ahead of positions",
    "slop": "penetration is left alone up to collision_slop, by default a third of the bottle",
    "tunnel": "no swept test: a wall thinner than one step is passed, speed after over speed before",
    "mujoco-limit": "joint limits are soft and have no restitution: speed back over speed before (0.5 is meant)",
    "mujoco-contact": "contacts are soft: how deep a resting ball lies in the floor",
}
"""Fact -> what holds."""

FACTS: Final = (
    EngineFact("pymunk", "gravity", "of ω₀", (0.0, 1e-9), _gravity),
    EngineFact("pymunk", "smaller-step", "", (0.0, 0.5), _smaller_step),
    EngineFact("pymunk", "order", "of ω₀", (1e-9, 1e-2), _order),
    EngineFact("pymunk", "order-forgotten", "", (0.0, 0.1), _order_forgotten),
    EngineFact("pymunk", "joints", "of L", (1e-5, 1e-2), _joints),
    EngineFact("pymunk", "elasticity", "", (0.249, 0.251), _elasticity),
    EngineFact("pymunk", "groove-end", "", (0.0, 1e-3), worlds.groove_end),
    EngineFact("pymunk", "stagger", "steps", (0.49, 0.51), worlds.stagger),
    EngineFact("pymunk", "slop", "m", (0.099, 0.101), _slop),
    EngineFact("pymunk", "tunnel", "", (0.99, 1.01), _tunnel),
    EngineFact("mujoco", "mujoco-limit", "", (0.0, 0.3), worlds.soft_limit),
    EngineFact("mujoco", "mujoco-contact", "mm", (0.01, 10.0), worlds.soft_contact),
)
"""Every fact, in the order of the table."""
