"""Engine behaviour that a user may not expect: each fact measured anew with every report, and where it must lie.

Some facts need the bottle: they are runs. The others are measured in the smallest worlds, of one or two bodies, because
in the bottle other settings hide them: ``engine_check`` has chosen its knobs so that they cannot bite. In these worlds
x points to the right and y up; the engines are imported where a world is built.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, Final

import numpy as np

from flipproof.chapters.solvers import ENGINE
from flipproof.curves.ensemble import claim_change, largest_change
from flipproof.figures.spoken import spoken
from flipproof.frame.chapter import Absent, Ask, Chapter, Claims, Finding, Run, RunResult, Study, judged
from flipproof.frame.findings import regression
from flipproof.frame.solvers import Missing, without_gravity
from slicemodel import Scenario, Trajectory

FEW_ITERATIONS: Final = 10
LONG_DT, SHORT_DT = 1e-3, 1e-4
"""Iterations and steps [s] of the two runs that explode."""

SHUFFLES: Final = (1, 2, 3)
N_LOW, N_HIGH = 25, 100
"""Seeds of the order of insertion, and iterations at which they are compared."""


@dataclass(frozen=True, slots=True)
class EngineFact:
    """One fact about an engine; its stable ``id`` is a key of ``WORDS``.

    It holds if the number that ``measure`` returns lies in the closed interval ``admissible``, in ``unit``. Of the runs
    by what is said of each it returns that number and how it was measured, and raises Missing, with the reason, if
    a run that it needs is not whole.
    """

    engine: str
    id: str
    unit: str
    admissible: tuple[float, float]
    measure: Callable[[Mapping[str, RunResult]], tuple[float, str]]

    @property
    def title(self) -> str:
        """The engine and what holds of it."""
        return f"{spoken(self.engine)}: {WORDS[self.id]}"

    def finding(self, results: Mapping[str, RunResult]) -> Finding:
        """Return the finding: that the number lies in its interval, or why there is none.

        A fact about an engine that is not installed and need not be cannot fail.
        """
        value, absent = None, False
        try:
            value, note = self.measure(results)
        except ModuleNotFoundError as missing:
            note = f"{self.engine} is not installed ({missing})"
            absent = self.engine != "pymunk"
        except Missing as missing:
            note = str(missing.args[0])
        fact = regression(f"engine-fact-{self.id}", self.title, value, self.unit, self.admissible, note)
        return replace(fact, kind="observation") if absent else fact


def plan_engine_facts(throw: Scenario) -> dict[str, Run]:
    """Return the runs of the facts that need the bottle, by what is said of each; about two seconds in all.

    Few slices, a flight that has its first impacts, an output time every millisecond. In a run that is about something
    else the engine iterates 100 times, where its rule asks for 57.
    """
    short_throw = replace(throw.with_slices(10), duration=min(0.2, throw.duration))
    usual: dict[str, Any] = {"dt": 2e-4, "iterations": 100, "times": np.linspace(0.0, short_throw.duration, 201)}
    changes: dict[str, dict[str, Any]] = {
        "usual": {},
        "no gravity": {},
        **{f"few iterations, dt {dt:g} s": {"dt": dt, "iterations": FEW_ITERATIONS} for dt in (LONG_DT, SHORT_DT)},
        **{
            f"order {k}, {n} iterations": {"iterations": n, "shuffle": k}
            for n in (N_LOW, N_HIGH)
            for k in (0, *SHUFFLES)
        },
        # Unless told otherwise a joint removes a tenth of the error at each of 60 steps a second.
        "joints corrected as by default": {"error_bias": (1.0 - 0.1) ** 60},
    }
    throws = dict.fromkeys(changes, short_throw) | {"no gravity": without_gravity(short_throw)}
    return {words: Run("pymunk", throws[words], usual | changes[words], f"engine fact, {words}") for words in changes}


def _gravity(results: Mapping[str, RunResult]) -> tuple[float, str]:
    usual, without = results["usual"].whole, results["no gravity"].whole
    fallen = 0.5 * usual.scenario.gravity * float(usual.t[-1]) ** 2
    return largest_change(usual, without), f"the bottle falls by {fallen:.2f} m meanwhile"


def _smaller_step(results: Mapping[str, RunResult]) -> tuple[float, str]:
    held = []
    for dt in (LONG_DT, SHORT_DT):
        run = results[f"few iterations, dt {dt:g} s"].flight
        if run.ok:
            raise Missing(f"with {FEW_ITERATIONS} iterations and dt = {dt:g} s nothing explodes")
        held.append(float(run.t[-1]))
    long, short = held
    note = (
        f"last output before it breaks: {long * 1e3:g} ms at Δt = {LONG_DT:g} s, {short * 1e3:g} ms at {SHORT_DT:g} s; "
        "an output every millisecond"
    )
    return (short / long if long else math.nan), note


def _widest(results: Mapping[str, RunResult], iterations: int) -> float:
    """Return the largest change of omega by another order."""
    usual, *shuffled = (results[f"order {seed}, {iterations} iterations"].whole for seed in (0, *SHUFFLES))
    return max(largest_change(usual, run) for run in shuffled)


def _order(results: Mapping[str, RunResult]) -> tuple[float, str]:
    again = largest_change(results["usual"].whole, results[f"order 0, {N_HIGH} iterations"].whole)
    return _widest(results, N_LOW), f"{len(SHUFFLES)} shuffled orders; the same order twice: {again:.1g}"


def _order_forgotten(results: Mapping[str, RunResult]) -> tuple[float, str]:
    low, high = _widest(results, N_LOW), _widest(results, N_HIGH)
    note = f"{low:.1e} to {high:.1e} of ω₀: what the order moves is what the solver has not iterated away"
    return high / low, note


def _joints(results: Mapping[str, RunResult]) -> tuple[float, str]:
    default = results["joints corrected as by default"].whole.diagnostics["constraint_drift"]
    ours = results["usual"].whole.diagnostics["constraint_drift"]
    return float(default), f"{ours:.1e} with errors removed within one step"


def _disc(space: Any, at: tuple[float, float], velocity: tuple[float, float], radius: float, elastic: float) -> Any:
    """Add a disc of 1 kg that does not turn to a pymunk space; return its body."""
    pymunk = import_module("pymunk")
    body = pymunk.Body(1.0, math.inf)
    body.position, body.velocity = at, velocity
    disc = pymunk.Circle(body, radius)
    disc.elasticity = elastic
    space.add(body, disc)
    return body


def rebound_of_two(first: float, second: float) -> float:
    """Return the speed of separation over the speed of approach of two discs with these elasticities."""
    pymunk = import_module("pymunk")
    space = pymunk.Space()
    left = _disc(space, (-0.2, 0.0), (1.0, 0.0), 0.1, first)
    right = _disc(space, (0.2, 0.0), (-1.0, 0.0), 0.1, second)
    for _ in range(200):
        space.step(1e-3)
    return float(right.velocity.x - left.velocity.x) / 2.0


def groove_end(_: object) -> tuple[float, str]:
    """Return the largest speed back, over the speed before, of a mass that runs into the end of its groove; and how."""
    pymunk = import_module("pymunk")
    space = pymunk.Space()
    body = _disc(space, (0.5, 0.0), (1.0, 0.0), 0.01, 1.0)
    space.add(pymunk.GrooveJoint(space.static_body, body, (0.0, 0.0), (1.0, 0.0), (0.0, 0.0)))
    back = 0.0
    for _ in range(1000):
        space.step(1e-3)
        back = max(back, -float(body.velocity.x))
    if not abs(body.position.x - 1.0) < 1e-3:
        raise Missing(f"the mass is at {body.position.x:.3g} m, not at the groove's end")
    note = "one mass with elasticity 1 in a groove; the set-up check refuses a groove that ends inside the bottle"
    return back, note


def stagger(_: object) -> tuple[float, str]:
    """Return by how many steps the engine's velocity is ahead of its position, in free fall; and how that is measured.

    The slope of the positions at t_n is (x_n+1 - x_n-1) / 2 dt, exact for a parabola; the engine's velocity is larger
    by g times the time it is ahead.
    """
    pymunk = import_module("pymunk")
    dt, weight = 1e-3, -9.81
    space = pymunk.Space()
    space.gravity = (0.0, weight)
    body = _disc(space, (0.0, 0.0), (0.0, 0.0), 0.1, 0.0)
    height, speed = [], []
    for _ in range(11):
        space.step(dt)
        height.append(float(body.position.y))
        speed.append(float(body.velocity.y))
    slope = (height[6] - height[4]) / (2.0 * dt)
    ahead = (speed[5] - slope) / (weight * dt)
    return ahead, "free fall: velocity against the slope of the positions; positive is ahead"


def depth_left(slop: float | None) -> tuple[float, float]:
    """Return ``collision_slop`` and how deep a disc lies in the floor it was dropped on [m]; None: as by default."""
    pymunk = import_module("pymunk")
    space = pymunk.Space()
    space.gravity = (0.0, -9.81)
    if slop is not None:
        space.collision_slop = slop
    space.add(pymunk.Segment(space.static_body, (-1.0, -0.1), (1.0, -0.1), 0.1))
    body = _disc(space, (0.0, 0.05), (0.0, -2.0), 0.02, 0.0)
    for _ in range(200):
        space.step(1e-2)
    return float(space.collision_slop), 0.02 - float(body.position.y)


def speed_through_wall(dt: float) -> float:
    """Return the speed along the way over the speed before, of a disc thrown at an elastic wall 1 cm thick."""
    pymunk = import_module("pymunk")
    space = pymunk.Space()
    wall = pymunk.Segment(space.static_body, (0.0, -1.0), (0.0, 1.0), 0.005)
    wall.elasticity = 1.0
    space.add(wall)
    body = _disc(space, (-1.03, 0.0), (5.0, 0.0), 0.005, 1.0)
    for _ in range(round(0.5 / dt)):
        space.step(dt)
    return float(body.velocity.x) / 5.0


def soft_limit(_: object) -> tuple[float, str]:
    """Return speed back over speed before of a mass at MuJoCo's joint limit; and how far it goes beyond, in words."""
    xml = (
        '<mujoco><option gravity="0 0 0" timestep="1e-4"/><worldbody><body>'
        '<joint type="slide" axis="1 0 0" limited="true" range="-1 0.1"/>'
        '<geom size="0.01" mass="1" contype="0" conaffinity="0"/></body></worldbody></mujoco>'
    )
    path = list(_mujoco_path(xml, speed=1.0, duration=0.5))
    beyond = max(x for x, _ in path) - 0.1
    return -min(v for _, v in path), f"hit at 1 m/s; the mass goes {beyond * 1e3:.1f} mm beyond the limit first"


def soft_contact(_: object) -> tuple[float, str]:
    """Return how deep a ball of 1 kg lies in MuJoCo's floor at rest [mm]; and how deep after landing, in words."""
    xml = (
        '<mujoco><option timestep="1e-4"/><worldbody><geom type="plane" size="1 1 0.1"/>'
        '<body pos="0 0 0.02"><joint type="slide" axis="0 0 1"/><geom size="0.02" mass="1"/></body>'
        "</worldbody></mujoco>"
    )
    path = list(_mujoco_path(xml, speed=-1.0, duration=1.0))
    deepest = -min(x for x, _ in path)
    return -path[-1][0] * 1e3, f"1 kg at rest under its weight; {deepest * 1e3:.1f} mm when it lands at 1 m/s"


def _mujoco_path(xml: str, *, speed: float, duration: float) -> Iterator[tuple[float, float]]:
    """Yield position and velocity of a model with one joint, step by step; ``speed`` is its velocity at the start."""
    mujoco = import_module("mujoco")
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qvel[0] = speed
    for _ in range(round(duration / model.opt.timestep)):
        mujoco.mj_step(model, data)
        yield float(data.qpos[0]), float(data.qvel[0])


def _elasticity(_: Mapping[str, RunResult]) -> tuple[float, str]:
    examples = ", ".join(f"{a:g} and {b:g} give {rebound_of_two(a, b):.2f}" for a, b in ((1.0, 0.5), (0.0, 1.0)))
    return rebound_of_two(0.5, 0.5), examples


def _slop(_: Mapping[str, RunResult]) -> tuple[float, str]:
    (default, left), without = depth_left(None), depth_left(0.0)[1]
    dropped = f"a disc dropped at 2 m/s (Δt = 10 ms) stays {left * 1e3:.1f} mm deep in the floor"
    return default, f"{dropped}, {without * 1e3:.1g} mm with slop 0"


def _tunnel(_: Mapping[str, RunResult]) -> tuple[float, str]:
    back = speed_through_wall(1e-3)
    note = f"5 m/s and a wall of 10 mm at Δt = 10 ms; at 1 ms it comes back, {back:.3g}"
    return speed_through_wall(1e-2), note


WORDS: Final = {
    "gravity": "gravity changes nothing in free flight: largest change of ω(t) when it is switched off",
    "smaller-step": f"with {FEW_ITERATIONS} iterations a tenth of the step explodes sooner: ratio of the times until "
    "it explodes",
    "order": f"the order in which bodies enter matters: largest change of ω(t), {N_LOW} iterations",
    "order-forgotten": "a solver that converges forgets the order: largest change of ω(t) at "
    f"{N_HIGH} iterations over that at {N_LOW}",
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
    EngineFact("pymunk", "groove-end", "", (0.0, 1e-3), groove_end),
    EngineFact("pymunk", "stagger", "steps", (0.49, 0.51), stagger),
    EngineFact("pymunk", "slop", "m", (0.099, 0.101), _slop),
    EngineFact("pymunk", "tunnel", "", (0.99, 1.01), _tunnel),
    EngineFact("mujoco", "mujoco-limit", "", (0.0, 0.3), soft_limit),
    EngineFact("mujoco", "mujoco-contact", "mm", (0.01, 10.0), soft_contact),
)
"""Every fact, in the order of the page."""


CHECK_DT: Final = 4e-4
"""Step of the engine where two of its runs are compared with one another [s]."""


EngineFacts = tuple[Finding | Absent, tuple[Finding, ...]]
"""Whether gravity cancels in the engine's free flight of the paper's own throw, and the facts."""


def study(ask: Ask) -> Study[EngineFacts]:
    """Measure every fact."""
    runs = plan_engine_facts(ask.reference)
    both = [
        Run(ENGINE, throw, {"dt": CHECK_DT}, f"{ENGINE}, g = {throw.gravity:g} m/s²")
        for throw in (ask.reference, without_gravity(ask.reference))
    ]
    flights = yield [*runs.values(), *both]
    results = {words: flights[run] for words, run in runs.items()}
    title = f"{ENGINE}: free flight is the same with g = 0"
    gravity = judged(claim_gravity_cancels, *(flights[run] for run in both), id="engine-gravity", title=title)
    return gravity, tuple(fact.finding(results) for fact in FACTS)


def claims(results: EngineFacts) -> Claims:
    """Yield that gravity cancels, and every fact."""
    gravity, facts = results
    yield from (gravity, *facts)


def claim_gravity_cancels(with_gravity: Trajectory, without: Trajectory) -> Finding:
    """A free engine spins the same with and without gravity, to a billionth of omega_0."""
    title = f"{with_gravity.method}: free flight is the same with g = 0"
    differ = with_gravity.scenario.gravity > 0.0 == without.scenario.gravity
    note = f"g = {with_gravity.scenario.gravity:g} and {without.scenario.gravity:g} m/s²"
    return claim_change("engine-gravity", title, with_gravity, without, 1e-9, differ=differ, note=note)


CHAPTER: Final = Chapter(
    "engine-facts", "Engine behaviour that a user may not expect", study, claims, kind="regression"
)
