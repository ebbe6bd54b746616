"""The public verb of this package, and the register of engines."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import Final

from numpy.typing import ArrayLike

from slicemodel.scenario import Scenario, unknown_name
from slicemodel.trajectory import FloatArray, Trajectory, output_times


@dataclass(frozen=True, slots=True)
class Engine:
    """A physics engine: the module whose ``run`` throws the bottle in it, what it solves and why it is here.

    ``frames`` and ``contacts`` name the worlds it can build, of ``FRAMES`` and ``CONTACTS``.
    """

    name: str
    module: str
    equation: str
    reason: str
    frames: tuple[str, ...] = ("free",)
    contacts: tuple[str, ...] = ("overlap",)


ENGINES: Final[Mapping[str, Engine]] = MappingProxyType(
    {
        engine.name: engine
        for engine in (
            Engine(
                name="pymunk",
                module="engine_check.engine_pymunk",
                equation="free flight: Newton's equations of a rigid tube and N point masses in the lab frame",
                reason="A witness with no formula of ours: constraints keep the masses on the axis, the engine's own "
                "solver makes the rebounds, and gravity, the moving origin and the recoil of the tube come out by "
                "themselves.",
            ),
        )
    }
)
"""Every engine by name. A new engine is one file and one entry here."""

DEFAULT_DT: Final = 1e-4
"""Upper bound of the step unless told otherwise [s]."""

ICE_MODELS: Final = ("rigid", "welded")
FRAMES: Final = ("free", "rotating")
"""Who moves the tube: "free", the engine, in the lab; "rotating", it is held, and Eq. 8's fictitious forces act."""

CONTACTS: Final = ("overlap", "exclude")
"""What two slices do when they meet: pass through each other as in the paper, or collide as rods of length h/N."""

MOST_ITERATIONS: Final = 1_000_000
MOST_SLICES: Final = 5_000
"""Slices at the most; an engine's sweep costs their number times its iterations, 2e6 constraints a step at 5 000."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What an engine is asked to build and how to step it, checked; knobs are the engine's own to check."""

    dt: float
    iterations: int | None
    times: FloatArray
    ice: str = "rigid"
    frame: str = "free"
    slices: str = "overlap"
    knobs: Mapping[str, float]


class SetupError(RuntimeError):
    """The world that the engine holds is not the one that was meant; the message names each difference."""


def solve(
    scenario: Scenario,
    engine: str = "pymunk",
    dt: float = DEFAULT_DT,
    iterations: int | None = None,
    times: ArrayLike | None = None,
    *,
    ice: str = "rigid",
    frame: str = "free",
    slices: str = "overlap",
    **knobs: float,
) -> Trajectory:
    """Throw the bottle in a rigid-body engine and return what the engine's own bodies did.

    Parameters
    ----------
    scenario : Scenario
    engine : str
        A name in ``ENGINES``.
    dt : float
        Upper bound of the engine's step [s]; every output interval is divided into equal steps.
    iterations : int or None
        Iterations of the engine's impulse solver per step. None: enough for this number of slices and
        this mass ratio (``pymunk_settings.enough_iterations``); ``settings`` states the number.
    times : array, shape (P,) or None
        Output times [s], increasing, in [0, duration]. None: 1000 uniform points.
    ice : str
        How ``scenario.frozen`` is built: "rigid" (one body) or "welded" (slices held by joints, whose
        drift is reported). Without effect on a scenario that is not frozen.
    frame : str
        "free" or "rotating" (``FRAMES``).
    slices : str
        "overlap" or "exclude" (``CONTACTS``).
    **knobs
        Overrides of the engine's settings (``PymunkKnobs``), for sensitivity studies.

    Returns
    -------
    Trajectory
        ``impacts`` is None: an engine resolves contacts and knows no impacts. ``settings`` holds every
        knob and version, ``diagnostics`` the set-up as read back and the largest residuals.

    Raises
    ------
    ValueError
        Unknown engine, ice model, frame, contact or knob (with the nearest known name), or one that this engine
        does not have; ``dt``, ``iterations``, ``times`` or a knob out of range (with the admissible range).
    SetupError
        If the engine did not receive what was meant.

    Accuracy
    --------
    See ``engine_pymunk``: order 2 in ``dt`` in free flight without drag, order 1 with drag or contact.
    Status "diverged" if an invariant leaves its band (``watch``).
    """
    if engine not in ENGINES:
        raise ValueError(unknown_name("engine =", engine, ENGINES))
    for what, name, known in (("ice", ice, ICE_MODELS), ("frame", frame, FRAMES), ("slices", slices, CONTACTS)):
        if name not in known:
            raise ValueError(unknown_name(f"{what} =", name, known))
    for what, name, offered in (("frame", frame, ENGINES[engine].frames), ("slices", slices, ENGINES[engine].contacts)):
        if name not in offered:
            raise ValueError(f"engine = {engine!r} has no {what} = {name!r} (it has: {', '.join(offered)})")
    if scenario.n_slices > MOST_SLICES:
        raise ValueError(f"n_slices = {scenario.n_slices} is outside [1, {MOST_SLICES}] for an engine; cut it coarser")
    run = import_module(ENGINES[engine].module).run
    order = Order(
        dt=_checked_dt(dt),
        iterations=_checked_iterations(iterations),
        times=output_times(scenario, times),
        ice=ice,
        frame=frame,
        slices=slices,
        knobs=knobs,
    )
    trajectory: Trajectory = run(scenario, order)
    return trajectory


def _checked_dt(dt: object) -> float:
    if isinstance(dt, bool) or not isinstance(dt, numbers.Real):
        raise ValueError(f"dt = {dt!r} is not a number (admissible: (0, inf) s)")
    # Written as "not inside", because NaN passes every "outside" test.
    if not 0.0 < float(dt) < math.inf:
        raise ValueError(f"dt = {float(dt)!r} s is outside (0, inf) s")
    return float(dt)


def _checked_iterations(iterations: object) -> int | None:
    if iterations is None:
        return None
    whole = isinstance(iterations, numbers.Integral) and not isinstance(iterations, bool)
    if not whole or not 1 <= int(iterations) <= MOST_ITERATIONS:  # type: ignore[call-overload]
        raise ValueError(f"iterations = {iterations!r} is not a whole number in [1, {MOST_ITERATIONS}]")
    return int(iterations)  # type: ignore[call-overload, no-any-return]
