"""The landing verb of this room: one touch and one table in, one certified outcome out.

The motion is that of ``ode_reference.landing``: events located, impulses by Newton's law. Where the outcome is
certified is decided by energy (``slicemodel.table.Outcome``), and whether by a second run with half the step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from slicemodel.scenario import Scenario, ScenarioError, known_name, number_in, refuse_other
from slicemodel.table import ENERGY_RISE, LAWS, LONGEST_LANDING, Outcome, Table, Touch
from slicemodel.trajectory import FloatArray

if TYPE_CHECKING:
    from ode_reference.landing.layout import Landing, World

DEFAULT_DT: Final = 4e-4
"""Longest step [s]; the numbers of an outcome are those of half of it."""

DRAG_STEP: Final = 0.5
"""Longest step in units of the time in which the drag stops all water in a free bottle; beyond 2 the midpoint rule, in
which the drag is explicit, is unstable."""

EDGE: Final = 8.0
"""Share by which the touches differ that have to end alike, over the step [1/s]."""

TOUCHING: Final = 1e-9
TWINS_TOUCHING: Final = (2e-10, 1e-9, 1e-9, 1e-6)
"""Gap below which two things touch, and that of the four twins [L]: whether a slice strikes a stack that lies on the
base or one that hangs an atom's width above it changes what comes after, and no outcome may hang on that."""

REFINED: Final = (8, 64)
SHORTEST: Final = 5e-6
"""How many times smaller the steps are that follow where one leaves the outcome open, and the shortest of them [s]."""

STRONGEST_DRAG: Final = DRAG_STEP / SHORTEST
"""Largest rate at which the drag may stop all water in a free bottle [1/s]."""

IMMOBILE: Final = 1e-12
"""Room in the bottle below which water cannot move [L]."""

MISPLACED: Final = 1e-9
"""How far a slice of a touch may lie beyond its stops [L]."""


def land(
    touch: Touch,
    table: Table,
    law: str | None = None,
    *,
    dt: float = DEFAULT_DT,
) -> Outcome:
    """Land a bottle on a table, impact by impact, until its outcome is certain (derived in ``ode_reference.landing``).

    Slices are rods of length h/N that meet each other: slices that overlap would all sink to the base, and the centre
    of mass at rest would be wrong.

    Parameters
    ----------
    touch : Touch
    table : Table
    law : str, optional
        "together" (the default) or "in-turn" (``slicemodel.table.LAWS``): who takes part in an impact on the table
        while water rests in the bottle. Ice has no law: there is nothing inside that could come after.
    dt : float
        Longest step [s], in [1e-6, 1e-3]; strong drag makes it shorter (``followed``).

    Returns
    -------
    Outcome
        Certified if the energy falls below the saddle, no impact raises it by more than 1e-6 of the saddle, and four
        touches that differ by ``EDGE`` times the step (``Touch.twins``) and in what counts as touching
        (``TWINS_TOUCHING``) end alike with twice the step. Where they do not, step and difference are made ``REFINED``
        times smaller, down to ``SHORTEST``. ``diagnostics`` has ``outcomes``, ``times`` [s] and ``bounces`` of the
        runs: where these differ the runs are different motions, and that they end alike makes it likely only.

    Raises
    ------
    ValueError
        Naming the argument, its value and the admissible values: an unknown law, a law for ice, slices that overlap
        or lie beyond their room in the touch, drag that no step follows.

    Accuracy
    --------
    Impacts are located to 1e-12 L; between them the midpoint rule has order 2 in ``dt``, but water leaves what it
    rests on at the end of a step. The edge between two outcomes lies within a share of 5 ``dt`` / s in omega of where
    the limit of small steps has it (12 edges of water, steps of 5e-5 to 4e-4 s), for ice of 2e-3 ``dt`` / s.
    """
    refuse_other("touch", touch, Touch)
    refuse_other("table", table, Table)
    chosen = _law(touch.scenario, law)
    dt = followed(touch.scenario, number_in("dt", dt, 1e-6, 1e-3, " s"))
    world = world_of(touch, table, chosen)
    for step in (dt, *(dt / k for k in REFINED if dt / k >= SHORTEST)):
        runs = _runs_until_two_differ(touch, world, step)
        if runs[0].code == runs[-1].code:
            break
    settings = {
        "law": None if world.rigid else chosen,
        "dt": step / 2,
        "height": table.height,
        "restitution": table.restitution,
        "friction": table.friction,
    }
    return _outcome(runs, EDGE * step, settings)


def _law(scenario: Scenario, law: str | None) -> str:
    if law is None:
        return "together"
    known_name("law", law, LAWS)
    if scenario.frozen:
        raise ValueError(f"law = {law!r} has no meaning for ice (scenario.frozen): leave it out")
    return law


def followed(scenario: Scenario, dt: float) -> float:
    """Return the step, shortened to ``DRAG_STEP`` of the time in which the drag stops the water.

    Water that slides as one stops at the rate alpha (1/m + N/M_b), because the tube recoils; nothing stops faster.

    Raises
    ------
    ScenarioError
        If that rate exceeds ``STRONGEST_DRAG``.
    """
    if _rigid(scenario):
        return dt
    shares = 1 / scenario.slice_mass + scenario.n_slices / scenario.bottle.mass
    if scenario.drag * shares > STRONGEST_DRAG:
        raise ScenarioError(
            f"drag = {scenario.drag:g} kg/s is outside [0, {STRONGEST_DRAG / shares:.3g}]: a landing does not follow "
            f"water that stops at more than {STRONGEST_DRAG:g} /s"
        )
    return min(dt, DRAG_STEP / (scenario.drag * shares)) if scenario.drag else dt


def _rigid(scenario: Scenario) -> bool:
    """Return whether no slice can move: ice, or a full bottle."""
    length = scenario.bottle.length
    return scenario.frozen or length - scenario.n_slices * scenario.slice_height <= IMMOBILE * length


def world_of(touch: Touch, table: Table, law: str) -> World:
    """Return the constants of a landing, or raise ValueError for slices that are not where they may be."""
    from ode_reference.landing.layout import World

    scenario = touch.scenario
    bottle, n, rod = scenario.bottle, scenario.n_slices, scenario.slice_height
    half = bottle.length / 2
    rigid = _rigid(scenario)
    # Counted from the base: i rods lie below slice i and n - 1 - i above it.
    i = np.arange(n, dtype=np.float64)
    high: FloatArray
    low: FloatArray
    high, low = half - (i + 0.5) * rod, -half + (n - i - 0.5) * rod
    if not rigid:
        _refuse_misplaced(touch, low + half, high + half)
    z_rest = bottle.mass * half + scenario.slice_mass * float((half - high).sum())
    z_rest /= scenario.total_mass
    saddle = scenario.total_mass * scenario.gravity * math.hypot(bottle.radius, z_rest)
    # On the cap water rests as it does on the base; ice stays where it is.
    upside_down = bottle.length - z_rest if scenario.frozen else z_rest
    return World(
        n=n,
        rigid=rigid,
        in_turn=law == "in-turn",
        half=half,
        radius=bottle.radius,
        tube=bottle.mass,
        tube_inertia=bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12),
        m=scenario.slice_mass,
        rub=scenario.drag / scenario.slice_mass,
        gravity=scenario.gravity,
        e_water=scenario.restitution,
        e_table=table.restitution,
        friction=table.friction,
        rod=rod,
        saddle=saddle,
        upright=math.atan2(bottle.radius, z_rest),
        cap=math.pi - math.atan2(bottle.radius, upside_down),
        cap_saddle=scenario.total_mass * scenario.gravity * math.hypot(bottle.radius, upside_down),
        touching=TOUCHING,
    )


def _refuse_misplaced(touch: Touch, low: FloatArray, high: FloatArray) -> None:
    """Raise ValueError if a slice lies where no slice that keeps its room can be."""
    length, rod, r = touch.scenario.bottle.length, touch.scenario.slice_height, touch.r
    beyond = MISPLACED * length
    for k in np.flatnonzero((r < low - beyond) | (r > high + beyond))[:1].tolist():
        raise ValueError(
            f"touch.r[{k}] = {r[k]:.9g} m is outside [{low[k]:.9g}, {high[k]:.9g}] m, the room of slice {k} among "
            f"{len(r)} that do not overlap: take a flight in which they do not (model 'column', or rods)"
        )
    for k in np.flatnonzero(r[:-1] - r[1:] < rod - beyond)[:1].tolist():
        raise ValueError(
            f"touch.r[{k}] - touch.r[{k + 1}] = {r[k] - r[k + 1]:.9g} m is below the length {rod:.9g} m of a rod: take "
            "a flight whose slices do not overlap"
        )


def state_of(touch: Touch, world: World) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (q, s, w) of ``ode_reference.landing``: the lowest corner on the table, the tube's middle over x = 0."""
    sine, cosine = math.sin(touch.theta), math.cos(touch.theta)
    height = world.half * abs(cosine) + world.radius * abs(sine)
    q = np.array([0.0, height, touch.theta, *touch.velocity, touch.omega])
    return q, touch.r - world.half, touch.v.copy()


def _run(touch: Touch, world: World, dt: float) -> Landing:
    from ode_reference.landing import loop

    q, s, w = state_of(touch, world)
    none = np.empty((0, 7 + 2 * world.n))
    run: Landing = loop.land(q, s, w, dt, LONGEST_LANDING, False, world, 1.0, none)
    return run


def _runs_until_two_differ(touch: Touch, world: World, step: float) -> list[Landing]:
    """Land the twins with the step and then the touch with half of it; the first that ends otherwise is the last."""
    runs: list[Landing] = []
    for twin, gap in zip(touch.twins(EDGE * step), TWINS_TOUCHING, strict=True):
        runs.append(_run(twin, world._replace(touching=gap), step))
        if runs[0].code != runs[-1].code:
            return runs
    return [*runs, _run(touch, world, step / 2)]


def _outcome(runs: Sequence[Landing], shift: float, settings: Mapping[str, object]) -> Outcome:
    """Return the outcome of the last run, and of the twins before it, whose touches differ from it by ``shift``."""
    from ode_reference.landing.layout import BROKEN, CAP, LYING, TIMEOUT, UPRIGHT

    names = {UPRIGHT: "upright", LYING: "lying", CAP: "cap"}
    run = runs[-1]
    codes = {landing.code for landing in runs}
    reason = ""
    if BROKEN in codes:
        reason = "the motion left the floating-point range or stopped passing time"
    elif TIMEOUT in codes:
        reason = f"the energy stays above the saddle for {LONGEST_LANDING:g} s"
    elif run.unresolved:
        reason = f"{run.unresolved} impacts have no impulses that fit the law"
    elif not run.rise <= ENERGY_RISE:
        reason = f"an impact raises the energy by {run.rise:.2g} of the saddle, more than {ENERGY_RISE:g}"
    elif len(codes) > 1:
        reason = f"touches that differ by {100 * shift:.2g} % end {names[runs[0].code]} and {names[run.code]}"
    return Outcome(
        outcome="undecided" if reason else names[run.code],
        certified=None if reason else run.time,
        margin=None if reason else run.margin,
        bounces=run.bounces,
        slid=None if reason else run.slid,
        reason=reason,
        solver="ode_reference",
        method="landing",
        settings=settings,
        diagnostics={
            "energy_rise": run.rise,
            "steps": sum(landing.steps for landing in runs),
            "impacts": run.impacts,
            "outcomes": [names.get(landing.code, "") for landing in runs],
            "times": [landing.time for landing in runs],
            "bounces": [landing.bounces for landing in runs],
        },
    )
