"""Up to when the omega(t) of an engine means anything: ensembles of flights that should be one flight.

    angle    released at theta_0 +- size: free flight does not feel it, so what it does to omega is arithmetic
    release  theta_0 and omega_0 changed by the size (``predictability``): what the flight itself amplifies
    order    bodies entered in another order: what the engine's own sweep leaves open

The width of an ensemble at a time is its largest minus its smallest omega. Up to the horizon, where the width first
leaves a band, one member stands for all. Nothing is cut off there: the width is kept to the end, and it is
infinite from where a member has ended.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from flipproof.chapters.differences.study import first_crossing
from flipproof.chapters.predictability.study import HORIZON_BAND, SIZES, Growth, fit_growth, plan_predictability
from flipproof.frame.solvers import Made, Missing, Run, find
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray

Kind = Literal["angle", "release", "order"]
KINDS: Final[tuple[Kind, ...]] = ("angle", "release", "order")

SOLVERS: Final = ("pymunk", "mujoco", "free-flight")
SHUFFLED: Final = "pymunk"
"""The engine whose bodies can be entered in another order: the one that sweeps over them."""

POINTS: Final = 251
MEMBERS: Final = 2
"""Changed flights of each size, beside the unchanged one."""

SEEDS: Final = (1, 2, 3, 4)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """How much of it: solvers, sizes of the changes (rising), seeds of the order, slices, step and iterations."""

    solvers: tuple[str, ...] = SOLVERS
    sizes: tuple[float, ...] = SIZES
    seeds: tuple[int, ...] = SEEDS
    slices: int = 20
    dt: float = 2e-4
    iterations: int | None = None


FULL: Final = Reach()
QUICK: Final = Reach(sizes=(1e-9, 1e-6), seeds=(1, 2), slices=10)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble:
    """Flights that differ in one small thing.

    Parameters
    ----------
    solver : str
    kind : {"angle", "release", "order"}
    size : float
        Of the change [rad], and of omega_0 as a fraction; NaN for another order, which has none.
    members : int
        The unchanged flight included.
    t : (P,) [s]
    width : (P,)
        (largest - smallest omega) / |omega_0|; infinite where a member has ended.
    band : float
        What the width may not exceed.
    horizon : float or None
        First time the width exceeds the band [s]; None: never.
    growth : Growth
        Of the width, up to the horizon.
    ended : float or None
        Where the first member ends, if that is before the end of the throw [s].
    """

    solver: str
    kind: Kind
    size: float
    members: int
    t: FloatArray
    width: FloatArray
    band: float
    horizon: float | None
    growth: Growth
    ended: float | None

    @property
    def largest(self) -> float:
        """Largest width of the flight, fraction of omega_0; infinite if a member has ended early."""
        return float(self.width.max())

    @property
    def final(self) -> float:
        """Width at the end."""
        return float(self.width[-1])

    @property
    def what(self) -> str:
        """What differs, in words."""
        if self.kind == "order":
            return f"{self.members} orders of the bodies"
        return f"{'θ₀' if self.kind == 'angle' else 'θ₀ and ω₀'} changed by {self.size:.0e}"

    @property
    def words(self) -> str:
        """Width, horizon and growth in words."""
        words = f"{self.what}: width at most {self.largest:.1e} of ω₀, {self.final:.1e} at the end"
        if self.horizon is None:
            words += f", never beyond {self.band:g}"
        else:
            words += f", beyond {self.band:g} from {self.horizon * 1e3:.1f} ms"
        words += f"; {self.growth.words}"
        return words + ("" if self.ended is None else f"; a member ends at {self.ended * 1e3:.1f} ms")


@dataclass(frozen=True, slots=True, kw_only=True)
class Horizon:
    """The ensembles of one solver; ``problems`` says of those that are missing why they are."""

    solver: str
    ensembles: tuple[Ensemble, ...]
    problems: tuple[str, ...] = ()

    @property
    def horizon(self) -> float | None:
        """Earliest horizon of all ensembles [s]; None: there is none up to the end."""
        return min((e.horizon for e in self.ensembles if e.horizon is not None), default=None)

    @property
    def largest(self) -> Ensemble | None:
        """The ensemble that becomes widest."""
        return max(self.ensembles, key=lambda ensemble: ensemble.largest, default=None)

    def of_kind(self, kind: Kind) -> tuple[Ensemble, ...]:
        """Return the ensembles of a kind, in order of their size."""
        return tuple(ensemble for ensemble in self.ensembles if ensemble.kind == kind)

    @property
    def words(self) -> str:
        """The widest ensemble of each kind in words, and what is missing."""
        parts = []
        for kind in KINDS:
            widest = max(self.of_kind(kind), key=lambda ensemble: ensemble.largest, default=None)
            parts += [] if widest is None else [widest.words]
        parts += [f"missing: {reason}" for reason in self.problems]
        return f"{self.solver}: " + ". ".join(parts) + "."


def plan_horizon(throw: Scenario, reach: Reach) -> list[Run]:
    """Return every run, the unchanged flight of each solver first."""
    runs = []
    few = throw.with_slices(reach.slices)
    for solver in reach.solvers:
        runs.append(_base(few, solver, reach))
        runs += [run for _, _, level in _levels(few, solver, reach) for run in level]
    return runs


def _levels(throw: Scenario, solver: str, reach: Reach) -> Iterator[tuple[Kind, float, list[Run]]]:
    """Yield kind, size and changed runs of every ensemble of a solver."""
    settings = _settings(throw, solver, reach)
    for size in reach.sizes:
        turns = {turn * size: replace(throw, theta0=throw.theta0 + turn * size) for turn in (1, -1)}
        yield (
            "angle",
            size,
            [Run(solver, at, settings, f"{_label(solver)}, angle {by:+.0e}") for by, at in turns.items()],
        )
    plans = plan_predictability(throw, solver, sizes=reach.sizes, members=MEMBERS, settings=settings)
    for size, level in zip(sorted(reach.sizes), plans, strict=True):
        yield "release", size, level
    if solver == SHUFFLED and reach.seeds:
        orders = [
            Run(solver, throw, settings | {"shuffle": seed}, f"{_label(solver)}, order {seed}") for seed in reach.seeds
        ]
        yield "order", math.nan, orders


def _settings(throw: Scenario, solver: str, reach: Reach) -> dict[str, Any]:
    from engine_check.pymunk_settings import enough_iterations

    settings: dict[str, Any] = {"times": np.linspace(0.0, throw.duration, POINTS)}
    if find(solver).package == "engine_check":
        settings["dt"] = reach.dt
    if solver == SHUFFLED:
        settings["iterations"] = enough_iterations(throw) if reach.iterations is None else reach.iterations
    return settings


def _label(solver: str) -> str:
    return f"horizon, {solver}"


def _base(throw: Scenario, solver: str, reach: Reach) -> Run:
    return Run(solver, throw, _settings(throw, solver, reach), f"{_label(solver)}, as it is")


def study_horizon(throw: Scenario, reach: Reach, made: Mapping[Run, Made]) -> tuple[Horizon, ...]:
    """Read what ``plan_horizon`` planned with the same arguments.

    A solver that could not be run, such as an engine that is not installed, stays, with the reason.
    """
    few = throw.with_slices(reach.slices)
    return tuple(_study(few, solver, reach, made) for solver in reach.solvers)


def _study(throw: Scenario, solver: str, reach: Reach, made: Mapping[Run, Made]) -> Horizon:
    problems, ensembles = [], []
    try:
        base = made[_base(throw, solver, reach)].flight
    except Missing as missing:
        return Horizon(solver=solver, ensembles=(), problems=(str(missing.args[0]),))
    for kind, size, level in _levels(throw, solver, reach):
        try:
            members = [base, *(made[run].flight for run in level)]
        except Missing as missing:
            problems.append(str(missing.args[0]))
            continue
        ensembles.append(study_ensemble(solver, kind, size, members))
    return Horizon(solver=solver, ensembles=tuple(ensembles), problems=tuple(problems))


def study_ensemble(
    solver: str, kind: Kind, size: float, members: Sequence[Trajectory], *, band: float = HORIZON_BAND
) -> Ensemble:
    """Measure the width of an ensemble over time.

    Parameters
    ----------
    members : sequence of Trajectory
        All on the same output times, as far as each goes; the unchanged flight first.
    band : float
        Fraction of omega_0.

    Raises
    ------
    ValueError
        If there are fewer than two members, or their times differ.
    """
    if len(members) < 2:
        raise ValueError(f"an ensemble of {len(members)} has no width; two flights are needed")
    t = max((member.t for member in members), key=len)
    omega = np.full((len(members), len(t)), np.nan)
    for row, member in zip(omega, members, strict=True):
        if not np.array_equal(member.t, t[: len(member.t)]):
            raise ValueError(f"{solver}: members of an ensemble have different output times")
        row[: len(member.t)] = member.omega
    shortest = min(len(member.t) for member in members)
    width = np.full(len(t), np.inf)
    width[:shortest] = np.ptp(omega[:, :shortest], axis=0) / abs(members[0].scenario.omega0)
    horizon = first_crossing(t, width, band)
    # A member that is the longest but still stopped early ends the ensemble as well.
    stopped = [float(member.t[-1]) for member in members if member.status not in ("ok", "escaped")]
    return Ensemble(
        solver=solver,
        kind=kind,
        size=size,
        members=len(members),
        t=t,
        width=width,
        band=band,
        horizon=horizon,
        growth=fit_growth(t, width, stop=math.inf if horizon is None else horizon),
        ended=min(stopped, default=None),
    )
