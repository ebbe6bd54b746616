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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from flipproof.chapters.differences.study import first_crossing
from flipproof.chapters.predictability.study import HORIZON_BAND, SIZES, Growth, fit_growth, plan_predictability
from flipproof.frame.solvers import Made, Missing, Run, find
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray

Kind = Literal["angle", "release", "order"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """How much of it: solvers, sizes of the changes (rising), seeds of the order, slices."""

    solvers: tuple[str, ...] = ("pymunk", "mujoco", "free-flight")
    sizes: tuple[float, ...] = SIZES
    seeds: tuple[int, ...] = (1, 2, 3, 4)
    slices: int = 20


class Level(NamedTuple):
    """The runs of an ensemble, the unchanged one first. ``size`` is NaN for another order, which has none."""

    kind: Kind
    size: float
    runs: list[Run]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble:
    """Flights that differ in one small thing.

    Parameters
    ----------
    kind : {"angle", "release", "order"}
    size : float - of the change [rad], and of omega_0 as a fraction; NaN for another order, which has none
    members : int - the unchanged flight included
    t : (P,) [s]
    width : (P,) - (largest - smallest omega) / |omega_0|; infinite where a member has ended
    horizon : float or None - first time the width exceeds HORIZON_BAND [s]; None: never
    growth : Growth - of the width, up to the horizon
    ended : float or None - where the first member ends, if that is before the end of the throw [s]
    """

    kind: Kind
    size: float
    members: int
    t: FloatArray
    width: FloatArray
    horizon: float | None
    growth: Growth
    ended: float | None

    @property
    def largest(self) -> float:
        """Largest width of the flight, fraction of omega_0; infinite if a member has ended early."""
        return float(self.width.max())

    @property
    def what(self) -> str:
        """What differs, in words."""
        if self.kind == "order":
            return f"{self.members} orders of the bodies"
        return f"{'θ₀' if self.kind == 'angle' else 'θ₀ and ω₀'} changed by {self.size:.0e}"

    @property
    def words(self) -> str:
        """Width, horizon and growth in words."""
        when = f"never beyond {HORIZON_BAND:g}"
        if self.horizon is not None:
            when = f"beyond {HORIZON_BAND:g} from {self.horizon * 1e3:.1f} ms"
        words = f"{self.what}: width at most {self.largest:.1e} of ω₀, {self.width[-1]:.1e} at the end, {when}; "
        words += self.growth.words
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

    def of_kind(self, *kinds: Kind) -> list[Ensemble]:
        """Return the ensembles of these kinds, each in order of their size."""
        return [ensemble for kind in kinds for ensemble in self.ensembles if ensemble.kind == kind]

    def widest(self, *kinds: Kind) -> Ensemble | None:
        """Return the ensemble that becomes widest, of these kinds or of all."""
        chosen = self.of_kind(*kinds) if kinds else self.ensembles
        return max(chosen, key=lambda ensemble: ensemble.largest, default=None)

    @property
    def words(self) -> str:
        """The widest ensemble of each kind in words, and what is missing."""
        kinds: tuple[Kind, ...] = ("angle", "release", "order")
        parts = [widest.words for kind in kinds if (widest := self.widest(kind)) is not None]
        parts += [f"missing: {reason}" for reason in self.problems]
        return f"{self.solver}: " + ". ".join(parts) + "."


def plan_horizon(throw: Scenario, reach: Reach) -> dict[str, list[Level]]:
    """Return the runs of every ensemble, by solver."""
    few = throw.with_slices(reach.slices)
    return {solver: _levels(few, solver, reach) for solver in reach.solvers}


def _levels(throw: Scenario, solver: str, reach: Reach) -> list[Level]:
    from engine_check.pymunk_settings import enough_iterations

    settings: dict[str, Any] = {"times": np.linspace(0.0, throw.duration, 251)}
    if find(solver).package == "engine_check":
        settings["dt"] = 2e-4
    sweeps = solver == "pymunk"  # the engine that sweeps over its bodies, and so has an order of them
    if sweeps:
        settings["iterations"] = enough_iterations(throw)

    def run(words: str, at: Scenario = throw, **changes: Any) -> Run:
        return Run(solver, at, settings | changes, f"horizon, {solver}, {words}")

    base = run("as it is")
    levels = []
    for size in reach.sizes:
        turned = [run(f"angle {by:+.0e}", replace(throw, theta0=throw.theta0 + by)) for by in (size, -size)]
        levels.append(Level("angle", size, [base, *turned]))
    plans = plan_predictability(throw, solver, sizes=reach.sizes, settings=settings)
    levels += [Level("release", size, [base, *runs]) for size, runs in zip(sorted(reach.sizes), plans, strict=True)]
    if sweeps and reach.seeds:
        levels.append(Level("order", math.nan, [base, *(run(f"order {seed}", shuffle=seed) for seed in reach.seeds)]))
    return levels


def study_horizon(plan: Mapping[str, Sequence[Level]], made: Mapping[Run, Made]) -> tuple[Horizon, ...]:
    """Read the ensembles that were planned.

    A solver that could not be run, such as an engine that is not installed, stays, with the reason.
    """
    found = []
    for solver, levels in plan.items():
        ensembles = []
        problems: dict[str, None] = {}
        for kind, size, runs in levels:
            try:
                ensembles.append(study_ensemble(kind, size, [made[run].flight for run in runs]))
            except Missing as missing:
                problems[str(missing)] = None
        found.append(Horizon(solver=solver, ensembles=tuple(ensembles), problems=tuple(problems)))
    return tuple(found)


def study_ensemble(kind: Kind, size: float, members: Sequence[Trajectory]) -> Ensemble:
    """Measure the width over time of two flights or more on the same output times, the unchanged one first."""
    t = max((member.t for member in members), key=len)
    shortest = min(len(member.t) for member in members)
    width = np.full(len(t), np.inf)
    omega = [member.omega[:shortest] for member in members]
    width[:shortest] = np.ptp(omega, axis=0) / abs(members[0].scenario.omega0)
    horizon = first_crossing(t, width, HORIZON_BAND)
    # A member that is the longest but still stopped early ends the ensemble as well.
    stopped = [float(member.t[-1]) for member in members if member.status not in ("ok", "escaped")]
    return Ensemble(
        kind=kind,
        size=size,
        members=len(members),
        t=t,
        width=width,
        horizon=horizon,
        growth=fit_growth(t, width, stop=math.inf if horizon is None else horizon),
        ended=min(stopped, default=None),
    )
