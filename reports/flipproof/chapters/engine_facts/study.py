"""What an engine does that its user may not expect: each fact measured, with the interval that the number must lie in.

Some facts need the bottle: they are runs. The others are measured in worlds of one or two bodies (``engine_worlds``),
because in the bottle other settings hide them: ``engine_check`` has chosen its knobs so that they cannot bite.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from flipproof.chapters.engine_facts import worlds
from flipproof.frame.findings import Finding, Kind
from flipproof.frame.solvers import Made, Run, without_gravity
from slicemodel import Scenario, Trajectory

SLICES: Final = 10
DURATION: Final = 0.2
POINTS: Final = 201
"""The bottle of the runs: few slices, a flight that has its first impacts [s], an output time every millisecond."""

DT: Final = 2e-4
ITERATIONS: Final = 100
"""Step [s] and iterations of a run that is about something else; the rule asks for 57."""

FEW_ITERATIONS: Final = 10
LONG_DT, SHORT_DT = 1e-3, 1e-4
"""Iterations and steps [s] of the two runs that explode."""

SHUFFLES: Final = (1, 2, 3)
ORDER_ITERATIONS: Final = (25, 100)
"""Seeds of the order of insertion, and iterations at which they are compared."""

DEFAULT_BIAS: Final = (1.0 - 0.1) ** 60
"""``error_bias`` of a joint unless told otherwise: a tenth of the error is removed at each of 60 steps a second."""


Measured = Callable[[Mapping[str, Made]], tuple[float, str]]
"""The runs by what is said of each -> the number that shows a fact, and how it was measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineFact:
    """One fact about an engine.

    Parameters
    ----------
    id : str - stable name
    engine : str
    words : str - what holds
    unit : str - of the number that shows it
    admissible : (low, high) - closed interval that holds the number if the fact holds
    measure : callable - raises LookupError, with the reason, if a run that it needs is not whole
    """

    id: str
    engine: str
    words: str
    unit: str
    admissible: tuple[float, float]
    measure: Measured

    def found(self, made: Mapping[str, Made]) -> Finding:
        """Return the finding: that the number lies in its interval, or why there is none.

        A fact about an engine that is not installed and need not be cannot fail.
        """
        value: float | None = None
        kind: Kind = "regression"
        try:
            value, note = self.measure(made)
        except ModuleNotFoundError as missing:
            note = f"{self.engine} is not installed ({missing})"
            kind = "observation" if self.engine != "pymunk" else kind
        except LookupError as missing:
            note = str(missing.args[0])
        return Finding(
            id=f"engine-fact-{self.id}", title=self.words, value=value, unit=self.unit, kind=kind,
            admissible=self.admissible, note=note,
        )  # fmt: skip


def _fact(
    id_: str, engine: str, words: str, unit: str, admissible: tuple[float, float]
) -> Callable[[Measured], EngineFact]:
    """Return a decorator that makes a fact of what measures it."""
    return lambda measure: EngineFact(
        id=id_, engine=engine, words=words, unit=unit, admissible=admissible, measure=measure
    )


# ---------------------------------------------------------------------- facts that need the bottle


def plan_engine_facts(throw: Scenario) -> dict[str, Run]:
    """Return the runs of the facts that need the bottle, by what is said of each; about two seconds in all."""
    few = replace(throw.with_slices(SLICES), duration=min(DURATION, throw.duration))
    times = np.linspace(0.0, few.duration, POINTS)
    usual: dict[str, Any] = {"dt": DT, "iterations": ITERATIONS, "times": times}

    def run(words: str, scenario: Scenario = few, **changes: Any) -> Run:
        return Run("pymunk", scenario, {**usual, **changes}, words)

    runs = [
        run("usual"),
        run("no gravity", without_gravity(few)),
        *(
            run(f"few iterations, dt {dt:g} s", dt=dt, iterations=FEW_ITERATIONS, times=times)
            for dt in (LONG_DT, SHORT_DT)
        ),
        *(
            run(f"order {seed}, {iterations} iterations", iterations=iterations, shuffle=seed)
            for iterations in ORDER_ITERATIONS
            for seed in (0, *SHUFFLES)
        ),
        run("joints corrected as by default", error_bias=DEFAULT_BIAS),
    ]
    return {each.label: replace(each, label=f"engine fact, {each.label}") for each in runs}


def _run(made: Mapping[str, Made], words: str) -> Trajectory:
    if words not in made:
        raise LookupError(f"{words}: not run")
    return made[words].flight


def _whole(made: Mapping[str, Made], words: str) -> Trajectory:
    flight = _run(made, words)
    if not flight.ok:
        raise LookupError(f"{words}: {flight.message}")
    return flight


def _apart(first: Trajectory, second: Trajectory) -> float:
    return float(np.abs(first.omega - second.omega).max() / abs(first.scenario.omega0))


@_fact(
    "gravity",
    "pymunk",
    "gravity changes nothing in free flight: largest change of ω(t) when it is switched off",
    "of ω₀",
    (0.0, 1e-9),
)
def _gravity(made: Mapping[str, Made]) -> tuple[float, str]:
    usual, without = _whole(made, "usual"), _whole(made, "no gravity")
    fallen = 0.5 * usual.scenario.gravity * float(usual.t[-1]) ** 2
    return _apart(usual, without), f"the bottle falls by {fallen:.2f} m meanwhile"


@_fact(
    "smaller-step",
    "pymunk",
    f"with {FEW_ITERATIONS} iterations a tenth of the step explodes sooner: quotient of the times it holds",
    "",
    (0.0, 0.5),
)
def _smaller_step(made: Mapping[str, Made]) -> tuple[float, str]:
    held = {}
    for dt in (LONG_DT, SHORT_DT):
        run = _run(made, f"few iterations, dt {dt:g} s")
        if run.ok:
            raise LookupError(f"with {FEW_ITERATIONS} iterations and dt = {dt:g} s nothing explodes")
        held[dt] = float(run.t[-1])
    long, short = held[LONG_DT], held[SHORT_DT]
    note = f"holds for {long * 1e3:g} ms at Δt = {LONG_DT:g} s, for {short * 1e3:g} ms at {SHORT_DT:g} s"
    return (short / long if long else math.nan), note


def _order_widths(made: Mapping[str, Made]) -> list[float]:
    """Return the largest change of omega by another order, at each of ORDER_ITERATIONS."""
    widths = []
    for iterations in ORDER_ITERATIONS:
        usual = _whole(made, f"order 0, {iterations} iterations")
        widths.append(max(_apart(usual, _whole(made, f"order {seed}, {iterations} iterations")) for seed in SHUFFLES))
    return widths


@_fact(
    "order",
    "pymunk",
    f"the order in which bodies enter matters: largest change of ω(t), {ORDER_ITERATIONS[0]} iterations",
    "of ω₀",
    (1e-9, 1e-2),
)
def _order(made: Mapping[str, Made]) -> tuple[float, str]:
    again = _apart(_whole(made, "usual"), _whole(made, f"order 0, {ITERATIONS} iterations"))
    return _order_widths(made)[0], f"{len(SHUFFLES)} shuffled orders; the same order twice: {again:.1g}"


@_fact(
    "order-forgotten",
    "pymunk",
    f"a solver that converges forgets the order: that change at {ORDER_ITERATIONS[1]} iterations "
    f"over that at {ORDER_ITERATIONS[0]}",
    "",
    (0.0, 0.1),
)
def _order_forgotten(made: Mapping[str, Made]) -> tuple[float, str]:
    few, many = _order_widths(made)
    return (
        many / few,
        f"{few:.1e} to {many:.1e} of ω₀: what the order moves is what the solver has not iterated away",
    )


@_fact(
    "joints",
    "pymunk",
    "joints give: how far a mass leaves the axis that a joint holds it on, default correction",
    "of L",
    (1e-5, 1e-2),
)
def _joints(made: Mapping[str, Made]) -> tuple[float, str]:
    default = _whole(made, "joints corrected as by default")
    ours = _whole(made, "usual").diagnostics["constraint_drift"]
    return float(default.diagnostics["constraint_drift"]), f"{ours:.1e} with errors removed within one step"


# ---------------------------------------------------------------------- facts of one or two bodies


@_fact(
    "elasticity",
    "pymunk",
    "elasticities multiply: restitution of two shapes of 0.5 each",
    "",
    (0.249, 0.251),
)
def _elasticity(_: Mapping[str, Made]) -> tuple[float, str]:
    others = ", ".join(f"{a:g} and {b:g} give {worlds.rebound_of_two(a, b):.2f}" for a, b in ((1.0, 0.5), (0.0, 1.0)))
    return worlds.rebound_of_two(0.5, 0.5), others


@_fact(
    "groove-end",
    "pymunk",
    "the end of a groove is a dead stop whatever the elasticity: speed back over speed before",
    "",
    (0.0, 1e-3),
)
def _groove_end(_: Mapping[str, Made]) -> tuple[float, str]:
    return (
        worlds.speed_after_groove_end(),
        "one mass with elasticity 1 in a groove; the set-up check refuses a groove that ends inside the bottle",
    )


@_fact(
    "stagger",
    "pymunk",
    "velocities stand half a step ahead of positions",
    "steps",
    (0.49, 0.51),
)
def _stagger(_: Mapping[str, Made]) -> tuple[float, str]:
    return worlds.stagger(), "free fall: velocity against the slope of the positions; positive is ahead"


@_fact(
    "slop",
    "pymunk",
    "penetration is left alone up to collision_slop, by default a third of the bottle",
    "m",
    (0.099, 0.101),
)
def _slop(_: Mapping[str, Made]) -> tuple[float, str]:
    (default, left), without = worlds.depth_left(None), worlds.depth_left(0.0)[1]
    return default, (
        f"a disc dropped at 2 m/s (Δt = 10 ms) stays {left * 1e3:.1f} mm deep in the floor, "
        f"{without * 1e3:.1g} mm with slop 0"
    )


@_fact(
    "tunnel",
    "pymunk",
    "no swept test: a wall thinner than one step is passed, speed after over speed before",
    "",
    (0.99, 1.01),
)
def _tunnel(_: Mapping[str, Made]) -> tuple[float, str]:
    return (
        worlds.speed_through_wall(1e-2),
        f"5 m/s and a wall of 10 mm at Δt = 10 ms; at 1 ms it comes back, {worlds.speed_through_wall(1e-3):.3g}",
    )


# ---------------------------------------------------------------------- MuJoCo, if it is there


@_fact(
    "mujoco-limit",
    "mujoco",
    "joint limits are soft and have no restitution: speed back over speed before (0.5 is meant)",
    "",
    (0.0, 0.3),
)
def _soft_limit(_: Mapping[str, Made]) -> tuple[float, str]:
    back, beyond = worlds.rebound_of_limit()
    return back, f"hit at 1 m/s; the mass goes {beyond * 1e3:.1f} mm beyond the limit first"


@_fact(
    "mujoco-contact",
    "mujoco",
    "contacts are soft: how deep a resting ball lies in the floor",
    "mm",
    (0.01, 10.0),
)
def _soft_contact(_: Mapping[str, Made]) -> tuple[float, str]:
    at_rest, deepest = worlds.depth_of_contact()
    return at_rest * 1e3, f"1 kg at rest under its weight; {deepest * 1e3:.1f} mm when it lands at 1 m/s"


FACTS: Final = (
    _gravity, _smaller_step, _order, _order_forgotten, _joints, _elasticity, _groove_end, _stagger, _slop, _tunnel,
    _soft_limit, _soft_contact,
)  # fmt: skip
"""Every fact, in the order of the table."""
