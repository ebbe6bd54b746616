"""The landing verb of this room: one touch and one table in, one certified outcome of a physics engine out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from types import MappingProxyType
from typing import Final, Protocol

from engine_check.solver import checked_number
from slicemodel.scenario import Scenario, unknown_name
from slicemodel.table import ENERGY_RISE, LAWS, LONGEST_LANDING, Outcome, Table, Touch


@dataclass(frozen=True, slots=True)
class Lander:
    """An engine that lands bottles: its module, its laws and slices, and why.

    Parameters
    ----------
    module : str - has ``build``, which returns a ``Body``, and ``quiet``, within which the engine writes no file
    dt, ice_dt : float - default steps for water and for ice [s]
    halvings : int - of the step, after which an outcome that still changes is left undecided
    rise : float - rise of the energy in an impact beyond which a landing is not certified [E_s]
    """

    module: str
    dt: float
    ice_dt: float
    halvings: int
    laws: tuple[str, ...]
    slices: tuple[str, ...]
    rise: float
    reason: str


STEP: Final = 2e-5
ICE_STEP: Final = 1e-4
"""Steps of rigid contacts [s]. Whatever closes within a step strikes at once, which hits in a cascade of water do not:
with steps of 1e-4 s some 4 % of its touches end otherwise than event by event (docs/landing.md, section 3)."""

LANDERS: Final[Mapping[str, Lander]] = MappingProxyType(
    {
        "mujoco": Lander(
            module="engine_check.landing_mujoco",
            dt=STEP,
            ice_dt=ICE_STEP,
            halvings=4,
            laws=("together", "in-turn"),
            slices=("exclude", "staggered"),
            rise=ENERGY_RISE,
            reason="impulses from the engine's own mass matrix and Jacobians: rigid contacts under either law",
        ),
    }
)
"""Engines by name."""

CHECK_EVERY: Final = 1e-3
"""Time between two looks at the energy [s]."""

SLICES: Final = ("exclude", "staggered")

ALOFT: Final = 1e-3
LANDED: Final = 1e-4
"""Heights of the lowest corner beyond which the bottle is off the table, and below which it is on it again [m]."""


@dataclass(slots=True)
class Watch:
    """What is read off a landing while it runs: is it certain yet, how often did it bounce, how far did it slide."""

    scenario: Scenario
    saddle: float = field(init=False)
    cap_saddle: float = field(init=False)
    lean: float = field(init=False)
    lean_on_cap: float = field(init=False)
    bounces: int = 0
    aloft: bool = False
    rise: float = 0.0

    def __post_init__(self) -> None:
        bottle, water = self.scenario.bottle, self.scenario.water_mass
        level = self.scenario.fill_fraction * bottle.length / 2
        height = (water * level + bottle.mass * bottle.length / 2) / self.scenario.total_mass
        on_cap = bottle.length - height if self.scenario.frozen else height
        weight = self.scenario.total_mass * self.scenario.gravity
        self.saddle, self.cap_saddle = (weight * math.hypot(over, bottle.radius) for over in (height, on_cap))
        self.lean, self.lean_on_cap = math.atan(bottle.radius / height), math.atan(bottle.radius / on_cap)

    def lowest(self, y: float, theta: float) -> float:
        """Return the height of the lowest corner of a bottle whose middle is at ``y`` [m]."""
        bottle = self.scenario.bottle
        return y - bottle.length / 2 * abs(math.cos(theta)) - bottle.radius * abs(math.sin(theta))

    def note(self, y: float, theta: float) -> None:
        """Count a bounce when the bottle is on the table again."""
        height = self.lowest(y, theta)
        if height > ALOFT:
            self.aloft = True
        elif self.aloft and height < LANDED:
            self.aloft, self.bounces = False, self.bounces + 1

    def outcome(self, theta: float, energy: float) -> str | None:
        """Return the outcome if the energy is below the saddle."""
        if not energy < self.limit(theta):
            return None
        tilt = abs(math.remainder(theta, math.tau))
        return "upright" if tilt < self.lean else "cap" if tilt > math.pi - self.lean_on_cap else "lying"

    def limit(self, theta: float) -> float:
        """Return the saddle out of the basin of the cap for a bottle over its cap, else the other one [J]."""
        over_cap = abs(math.remainder(theta, math.tau)) > math.pi - self.lean_on_cap
        return self.cap_saddle if over_cap else self.saddle


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One landing in an engine; ``outcome`` is "undecided" with a ``reason`` if there is none."""

    outcome: str
    time: float
    margin: float
    bounces: int
    slid: float
    rise: float
    reason: str
    setup: Mapping[str, float]
    settings: Mapping[str, object]


class Body(Protocol):
    """What ``landed`` asks of an engine's world."""

    setup: Mapping[str, float]
    settings: Mapping[str, object]
    ledger: float | None
    """Largest rise of the energy in an impact [E_s], where the engine lets it be seen; else that between two looks."""

    def advance(self) -> str:
        """Make one step; return what left its band, or an empty string."""

    def pose(self) -> tuple[float, float, float]:
        """Return x, y of the middle of the tube [m] and theta [rad]."""

    def energy(self) -> float:
        """Return the energy over the table [J]."""


def landed(body: Body, scenario: Scenario, dt: float) -> Run:
    """Step ``body`` until its outcome is certain, a band is left, or the longest landing is over."""
    watch = Watch(scenario)
    x, y, theta = body.pose()
    origin = x + scenario.bottle.length / 2 * math.sin(theta)
    every, count = max(1, round(CHECK_EVERY / dt)), math.ceil(LONGEST_LANDING / dt)
    before, outcome, reason = body.energy(), None, ""
    for k in range(1, count + 1):
        reason = body.advance()
        pose = body.pose()
        if not reason and not math.isfinite(sum(pose)):
            reason = "the motion diverged: it left the floating-point range; reduce dt"
        if reason:
            break
        x, y, theta = pose
        watch.note(y, theta)
        if k % every == 0:
            energy = body.energy()
            watch.rise = max(watch.rise, (energy - before) / watch.saddle)
            before = energy
            outcome = watch.outcome(theta, energy)
            if outcome:
                break
    else:
        reason = f"the energy stays above the saddle for {LONGEST_LANDING:g} s"
    return Run(
        outcome=outcome or "undecided",
        time=k * dt,
        margin=1.0 - before / watch.limit(theta),
        bounces=watch.bounces,
        slid=x + scenario.bottle.length / 2 * math.sin(theta) - origin,
        rise=watch.rise if body.ledger is None else body.ledger,
        reason=reason,
        setup=body.setup,
        settings=body.settings,
    )


def land(
    touch: Touch,
    table: Table,
    engine: str = "mujoco",
    dt: float | None = None,
    *,
    law: str | None = None,
    slices: str = "exclude",
) -> Outcome:
    """Land a bottle on a table in a rigid-body engine until its outcome is certain.

    Parameters
    ----------
    touch : Touch
    table : Table
    engine : str
        A name in ``LANDERS``.
    dt : float, optional
        Step [s], in (0, 1e-3]; the engine's own for water or for ice otherwise. Half of it certifies; where that ends
        otherwise, or gives energy, the step is halved again, ``LANDERS[engine].halvings`` times in all.
    law : str, optional
        A name in ``slicemodel.table.LAWS`` that the engine has; "together" by default. Ice has none.
    slices : str
        "exclude" or "staggered", as far as the engine has it. Without effect on ice.

    Returns
    -------
    Outcome
        Certified if the energy falls below the saddle with a step and with half of it, alike, and with the half step
        never rises by more than ``LANDERS[engine].rise`` of the saddle in an impact. Its numbers are those of the
        half step, ``settings["dt"]``; ``diagnostics`` has the outcomes with the steps from ``dt`` on, each half of the
        one before.

    Raises
    ------
    ValueError
        Naming the argument, its value and the admissible values.
    SetupError
        If the engine did not receive what was meant.
    """
    if engine not in LANDERS:
        raise ValueError(unknown_name("engine =", engine, LANDERS))
    lander = LANDERS[engine]
    if slices == "overlap":
        raise ValueError(
            "slices = 'overlap' is refused: overlapping slices at rest all sink to the base, which puts the centre of "
            f"mass too low (admissible: {', '.join(lander.slices)})"
        )
    for what, name, known, offered in (("law", law, LAWS, lander.laws), ("slices", slices, SLICES, lander.slices)):
        if name is not None and name not in known:
            raise ValueError(unknown_name(f"{what} =", name, known))
        if name is not None and name not in offered:
            has = ", ".join(offered) or "none"
            raise ValueError(f"engine = {engine!r} has no {what} = {name!r} (it has: {has})")
    chosen = law or next(iter(lander.laws), None)
    if touch.scenario.frozen and law is not None:
        raise ValueError(f"law = {law!r} has no meaning for ice (scenario.frozen): leave it out")
    default = lander.ice_dt if immovable(touch.scenario) else lander.dt
    step = default if dt is None else checked_number("dt", dt, 0.0, 1e-3 * (1 + 1e-12), " s")
    module = import_module(lander.module)

    def run(step: float) -> Run:
        with module.quiet():
            return landed(module.build(touch, table, step, chosen, slices), touch.scenario, step)

    fine, reason = run(step), ""
    outcomes = [fine.outcome]
    for _ in range(lander.halvings):
        step, coarse = step / 2, fine
        fine = run(step)
        outcomes.append(fine.outcome)
        reason = _doubt(coarse, fine, lander)
        if not reason or coarse.reason or fine.reason:
            break
    return Outcome(
        outcome="undecided" if reason else fine.outcome,
        certified=None if reason else fine.time,
        margin=None if reason else fine.margin,
        bounces=fine.bounces,
        slid=None if reason else fine.slid,
        reason=reason,
        solver="engine_check",
        method=engine,
        settings={
            "engine": engine,
            "law": None if touch.scenario.frozen else chosen,
            "slices": None if touch.scenario.frozen else slices,
            "dt": step,
            "height": table.height,
            "restitution": table.restitution,
            "friction": table.friction,
            **fine.settings,
        },
        diagnostics={"energy_rise": fine.rise, "outcomes": outcomes, "setup": dict(fine.setup)},
    )


def _doubt(coarse: Run, fine: Run, lander: Lander) -> str:
    """Return why two runs, the second with half the step, certify no outcome; or nothing."""
    reason = coarse.reason or fine.reason
    if not reason and not fine.rise <= lander.rise:
        reason = f"the energy rises by {fine.rise:.2g} of the saddle, more than {lander.rise:g}"
    if not reason and coarse.outcome != fine.outcome:
        reason = f"half the step ends {fine.outcome} instead of {coarse.outcome}"
    return reason


def stops(scenario: Scenario) -> tuple[list[float], list[float]]:
    """Return the least and largest place of every slice that keeps its order and its room [m], slice 0 at the base."""
    n, rod = scenario.n_slices, scenario.slice_height
    low = [rod / 2 + rod * (n - 1 - i) for i in range(n)]
    high = [scenario.bottle.length - rod / 2 - rod * i for i in range(n)]
    return low, high


def immovable(scenario: Scenario) -> bool:
    """Return whether the water cannot move: ice, or no room in the bottle."""
    low, high = stops(scenario)
    return scenario.frozen or high[0] - low[0] <= 1e-12 * scenario.bottle.length


def refuse_misplaced(touch: Touch, slices: str) -> None:
    """Raise ValueError if a slice lies where no slice that keeps its room can be, by more than 1e-9 L."""
    slack = 1e-9 * touch.scenario.bottle.length
    low, high = stops(touch.scenario)
    for k, place in enumerate(touch.r.tolist()):
        if not low[k] - slack <= place <= high[k] + slack:
            raise ValueError(
                f"touch.r[{k}] = {place:.9g} m is outside [{low[k]:.9g}, {high[k]:.9g}] m, the room of slice {k} among "
                f"{len(low)} that do not overlap"
            )
        if slices == "exclude" and k and touch.r[k - 1] - place < touch.scenario.slice_height - slack:
            raise ValueError(
                f"touch.r[{k - 1}] - touch.r[{k}] = {touch.r[k - 1] - place:.9g} m is below the length "
                f"{touch.scenario.slice_height:.9g} m of a rod: take slices = 'staggered'"
            )
