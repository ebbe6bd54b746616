"""The register of engines, and one throw in one of them at settings that are given."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, TypeVar

from numpy.typing import ArrayLike

from slicemodel.scenario import Scenario, known_name, not_whole, number_in, refuse_other, unknown_name
from slicemodel.trajectory import FloatArray, Trajectory, output_times

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Knobs = TypeVar("Knobs", bound="DataclassInstance")


@dataclass(frozen=True, slots=True)
class Engine:
    """A physics engine: the module whose ``run`` throws the bottle in it, what it solves and why it is here.

    A comparison tests only what the engine does itself (``theirs``); what we hand it (``ours``: an impact law, times of
    impacts) is on both sides, and agreement says nothing about it.
    ``contacts`` are those of ``CONTACTS`` that it has; ``model`` is the equation of ``ode_reference.MODELS`` that it is
    held against; ``sweeps`` says that it takes ``iterations`` over its bodies, in their order; ``movable`` that it
    answers hits at points of a grid that its knob ``grid_offset`` moves.
    """

    name: str
    module: str
    equation: str
    reason: str
    theirs: str
    ours: str
    contacts: tuple[str, ...] = ("overlap",)
    model: str = "free-flight"
    movable: bool = False
    sweeps: bool = False

    @property
    def words(self) -> str:
        """What is the engine's and what is ours, in one sentence each."""
        return f"The engine's: {self.theirs}. Ours: {self.ours}."


ENGINES: Final[Mapping[str, Engine]] = MappingProxyType(
    {
        engine.name: engine
        for engine in (
            Engine(
                name="pymunk",
                module="engine_check.engine_pymunk",
                equation="free flight: Newton's equations of a rigid tube and N point masses in the lab frame",
                reason="Bodies, joints and contacts of the engine in the lab frame: no equation of motion and no law "
                "of impact of ours enters, so that the moving origin and the recoil of the tube follow from the engine "
                "alone. A hit on an end is answered at the next step of the grid.",
                theirs="the motion, the law of impact, the recoil, rests, and the times of hits, which wait for the "
                "step's grid",
                ours="the initial state and the settings",
                contacts=("overlap", "exclude"),
                movable=True,
                sweeps=True,
            ),
            Engine(
                name="mujoco",
                module="engine_check.engine_mujoco",
                equation="free flight: a tree of joints in generalised coordinates, in the lab frame",
                reason="The engine's equations of motion in generalised coordinates, by Runge-Kutta steps: the masses "
                "cannot leave the axis. Impacts are ours: our simultaneous law, solved with the engine's mass matrix "
                "at times that we locate.",
                theirs="the motion between impacts, and the mass matrix that impacts are solved with",
                ours="the simultaneous law of impact, the times and the order of impacts, rests and releases",
            ),
        )
    }
)
"""Every engine by name. A new engine is one file and one entry here."""

DEFAULT_DT: Final = 1e-4
"""Upper bound of the step when iterations are given and the step is not [s]."""

ICE_MODELS: Final = ("rigid", "welded")
CONTACTS: Final = ("overlap", "exclude")
"""What two slices do when they meet: pass through each other as in the paper, or collide as rods of length h/N."""

MAX_ITERATIONS: Final = 1_000_000
MAX_STEPS: Final = 1_000_000_000
"""Steps of a run at the most, as of the slice model."""

MAX_DRIFT: Final = 5e3
"""Largest launch velocity of an engine's throw [|omega0| L]."""

MAX_SLICES: Final = 5_000
"""Slices at the most; an engine's sweep costs their number times its iterations, 2e6 constraints a step at 5 000."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What an engine is asked to build and how to step it, checked; knobs are the engine's own to check."""

    dt: float
    iterations: int | None
    times: FloatArray
    ice: str = "rigid"
    slices: str = "overlap"
    knobs: Mapping[str, float]

    def intervals(self) -> Iterator[tuple[float, int]]:
        """Yield each output time with the number of equal steps that lead to it."""
        before = 0.0
        for when in self.times.tolist():
            # A hair less than the quotient: 0.5 s / 1e-4 s must not become 5001 steps by rounding.
            yield when, math.ceil((when - before) / self.dt * (1.0 - 1e-12))
            before = when


class SetupError(RuntimeError):
    """The world that the engine holds is not the one that was meant; the message names each difference."""


def check_asked(scenario: Scenario, engine: str, ice: str, slices: str) -> None:
    """Raise ValueError if no such engine, ice model or contact is known, or this engine cannot throw this scenario."""
    refuse_other("scenario", scenario, Scenario)
    has = ENGINES[known_name("engine", engine, ENGINES)]
    choices = (
        ("ice", ice, ICE_MODELS, ICE_MODELS),
        ("slices", slices, CONTACTS, has.contacts),
    )
    for argument, name, valid, offered in choices:
        if name not in valid:
            raise ValueError(unknown_name(f"{argument} =", name, valid))
        if name not in offered:
            raise ValueError(f"engine = {engine!r} has no {argument} = {name!r} (it has: {', '.join(offered)})")
    if scenario.n_slices > MAX_SLICES:
        raise ValueError(f"n_slices = {scenario.n_slices} is outside [1, {MAX_SLICES}] for an engine; cut it coarser")
    fastest, spin = math.hypot(*scenario.launch_velocity), abs(scenario.omega0) * scenario.bottle.length
    if fastest > MAX_DRIFT * spin:
        raise ValueError(
            f"launch_velocity = {fastest:g} m/s is outside [0, {MAX_DRIFT * spin:g}] m/s, {MAX_DRIFT:g} |omega0| L:"
            " an engine works in the lab frame, where the spin would be lost in round-off; take a smaller one"
        )


def run_engine(
    scenario: Scenario,
    engine: str,
    dt: float | None = None,
    iterations: int | None = None,
    times: ArrayLike | None = None,
    *,
    ice: str = "rigid",
    slices: str = "overlap",
    **knobs: float,
) -> Trajectory:
    """Return the throw at these settings, not certified; parameters and errors are those of ``solver.solve``.

    Without ``dt`` the step is at most ``DEFAULT_DT``.
    """
    check_asked(scenario, engine, ice, slices)
    run = import_module(ENGINES[engine].module).run
    t_out = output_times(scenario, times)
    order = Order(
        dt=_checked_step(DEFAULT_DT if dt is None else dt, float(t_out[-1])),
        iterations=_checked_iterations(iterations),
        times=t_out,
        ice=ice,
        slices=slices,
        knobs=knobs,
    )
    trajectory: Trajectory = run(scenario, order)
    return trajectory


def _checked_step(dt: object, end: float) -> float:
    """Return a step if a flight up to the time ``end`` has at most ``MAX_STEPS`` of it, else raise ValueError."""
    try:
        return number_in("dt", dt, end / MAX_STEPS, math.inf, " s", open_low=True)
    except ValueError as error:
        raise ValueError(f"{error}: an engine makes at most {MAX_STEPS:g} steps, here of {end:g} s in all") from None


def _checked_iterations(iterations: int | None) -> int | None:
    """Return a plain int, also of NumPy's, which no settings could be written with; None for the engine's own rule."""
    if iterations is None:
        return None
    if problem := not_whole("iterations", iterations, 1, MAX_ITERATIONS):
        raise ValueError(problem)
    return int(iterations)


def knobs_from(kind: type[Knobs], overrides: Mapping[str, float]) -> Knobs:
    """Return the defaults with some knobs changed; an unknown name raises ValueError with the nearest."""
    names = [field.name for field in fields(kind)]
    for name in overrides:
        if name not in names:
            raise ValueError(unknown_name("knob =", name, names))
    return kind(**overrides)
