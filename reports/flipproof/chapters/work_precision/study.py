"""What does a digit cost, and with whom? Error against cost, in the manner of the ODE community.

    error  |  x x                 x  failed: at the top edge, with its reason in the table
           |  o                   o  one level of a contender; a line per contender
           |     o    s           #  the floor: nothing below it is claimed
           |        o     s
           |###########o####      The slope is the order in cost: error ~ cost^-p.
           +------------------ cost

Error is max |omega - omega_reference| / |omega_0| over the common times, against the contender's *own* equation. The
reference of an equation is its reduced flow, which has no tolerance; the floor is the largest difference from it of two
witnesses by ``solve_ivp``, which share neither search nor contact code with it and have ten times its rest speed. All
three stand in one package: that the equations mean the same in all packages is shown where exact solutions, schemes and
engines meet, not here.

Cost is counted twice: in updates of one slice (``contenders``), which any machine reproduces, and in processor seconds
(``flipproof.frame.timing``), which say what an update is worth in the language that makes it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from flipproof.chapters.work_precision.contenders import Contender, Plan, common_times
from flipproof.curves.order import ROUND_OFF, observed_order
from flipproof.frame.solvers import Run, RunResult
from flipproof.frame.timing import at_times
from slicemodel import Scenario, Trajectory
from slicemodel.schemes import SCHEMES
from slicemodel.trajectory import FloatArray

Cost = Literal["work", "seconds"]
"""Updates of one slice, seconds of the processor."""

SATURATED: Final = 0.2
"""Errors above this fraction of omega_0 say that the run is wrong, not how wrong: no slope is read off them."""


class Price(NamedTuple):
    """What it costs to keep an error; ``bound`` says that it may be less, because no coarser level was usable."""

    value: float
    bound: bool

    @property
    def text(self) -> str:
        """The value, with a sign before one that is a bound."""
        return f"{'≤ ' if self.bound else ''}{self.value:.2g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """What contenders of one equation are held against.

    ``floor`` is a fraction of omega_0, never below round-off; NaN if there is no reference, for ``reason``. ``omega``
    is its omega at the common times [1/s].
    """

    floor: float = math.nan
    omega: FloatArray | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One level of a contender: geometric means of cost, root-mean-square error with the range of its members.

    Costs are NaN if the run never began. Errors are NaN if a member failed, for ``reason``.
    """

    settings: str
    work: float
    steps: float
    seconds: float
    error: float = math.nan
    lowest: float = math.nan
    highest: float = math.nan
    at_floor: bool = False
    reason: str = ""


class Slope(NamedTuple):
    """The order p in cost, error ~ work^-p, with its standard error; NaN for ``reason``."""

    order: float = math.nan
    error: float = math.nan
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A contender's levels, and how its error falls with its work."""

    contender: Contender
    reference: Reference
    points: tuple[Point, ...]
    slope: Slope

    @property
    def whole(self) -> tuple[Point, ...]:
        """The levels that have an error."""
        return tuple(point for point in self.points if math.isfinite(point.error))

    @property
    def failed(self) -> tuple[Point, ...]:
        """The levels that failed."""
        return tuple(point for point in self.points if not math.isfinite(point.error))

    def price(self, error: float, cost: Cost = "work") -> Price | None:
        """Return the cost from which on a contender keeps ``error``, interpolated between two levels.

        From which on: a level that is better than a finer one was lucky. None if no level keeps it, or if the error is
        below the floor, where nobody can tell.
        """
        floor, points = self.reference.floor, self.points
        first = len(points)
        while first > 0 and max(points[first - 1].error, floor) <= error:
            first -= 1
        if first == len(points) or not error > floor:
            return None
        fine = points[first]
        if first == 0 or not math.isfinite(points[first - 1].error):
            return Price(getattr(fine, cost), bound=True)
        coarse = points[first - 1]
        y0, y1 = math.log(coarse.error), math.log(max(fine.error, floor))
        share = (math.log(error) - y0) / (y1 - y0)
        x0, x1 = math.log(getattr(coarse, cost)), math.log(getattr(fine, cost))
        return Price(math.exp(x0 + share * (x1 - x0)), bound=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkPrecision:
    """The diagram of one throw."""

    throw: Scenario
    references: Mapping[str, Reference]
    curves: Mapping[str, Curve]

    def of(self, equation: str) -> tuple[Curve, ...]:
        """Return the curves of one equation."""
        return tuple(curve for curve in self.curves.values() if curve.contender.equation == equation)


def study_work_precision(plan: Plan, results: Mapping[Run, RunResult]) -> WorkPrecision:
    """Read the runs of a plan; raise Missing if one does not hold the common times."""
    references = {name: _reference([results[run] for run in runs]) for name, runs in plan.references.items()}
    curves = {}
    for rival in plan.rivals:
        reference = references[rival.equation]
        points = tuple(_point([results[run] for run in level], reference) for level in rival.levels)
        slope = _slope(points, reference.floor)
        curves[rival.key] = Curve(contender=rival, reference=reference, points=points, slope=slope)
    return WorkPrecision(throw=plan.throw, references=references, curves=curves)


def _reference(runs: Sequence[RunResult]) -> Reference:
    """Return what an equation's reference and its witnesses make."""
    if problem := _why_failed(runs):
        return Reference(reason=problem)
    omega = _omega(runs[0])
    return Reference(floor=max(ROUND_OFF, *(_error(witness, omega) for witness in runs[1:])), omega=omega)


def _omega(result: RunResult) -> FloatArray:
    return np.asarray(result.flight.omega[at_times(result.flight.t, common_times(result.run.scenario))])


def _error(result: RunResult, truth: FloatArray) -> float:
    """Return the largest error, as a fraction of omega_0."""
    return float(np.abs(_omega(result) - truth).max() / abs(result.run.scenario.omega0))


def _why_failed(runs: Iterable[RunResult]) -> str:
    """Return why the first run that failed cannot be used, or nothing."""
    for result in runs:
        if result.trajectory is None:
            return result.reason or "it returned nothing"
        if not result.trajectory.ok:
            status = result.trajectory.status
            return f"{status}: {result.trajectory.message.removeprefix(f'{status} ')}"
    return ""


def _steps(trajectory: Trajectory) -> float:
    if trajectory.solver == "slicemodel":
        return float(trajectory.settings["steps"] - 1)
    return float(trajectory.diagnostics["steps"])


def work_of(trajectory: Trajectory) -> float:
    """Return the updates of one slice that a run made (module docstring of ``contenders``)."""
    slices, settings = trajectory.scenario.n_slices, trajectory.settings
    if trajectory.solver == "ode_reference":
        return float(trajectory.diagnostics["evaluations"] * slices)
    if trajectory.solver == "slicemodel":
        per_step = 2 if SCHEMES[trajectory.method].form.midpoint else 1
    else:
        per_step = settings.get("iterations") or (4 if settings.get("integrator") == "RK4" else 1)
    return _steps(trajectory) * slices * per_step


def _point(members: Sequence[RunResult], reference: Reference) -> Point:
    flights = [result.trajectory for result in members]
    costs: dict[str, Any] = {
        "settings": " to ".join(_words(result.run.settings) for result in (members[0], *members[1:][-1:])),
        "work": _geometric([math.nan if flight is None else work_of(flight) for flight in flights]),
        "steps": _geometric([math.nan if flight is None else _steps(flight) for flight in flights]),
        "seconds": _geometric([result.seconds for result in members]),
    }
    reason = _why_failed(members)
    if reason or reference.omega is None:
        return Point(**costs, reason=reason or f"no reference: {reference.reason}")
    errors = np.array([_error(result, reference.omega) for result in members])
    error = float(np.sqrt(np.mean(errors**2)))
    lowest, highest = float(errors.min()), float(errors.max())
    return Point(**costs, error=error, lowest=lowest, highest=highest, at_floor=error <= reference.floor)


def _geometric(values: Sequence[float]) -> float:
    """Return the geometric mean; NaN if a value is missing or no cost was measured."""
    return float(np.exp(np.mean(np.log(values)))) if all(value > 0.0 for value in values) else math.nan


def _words(settings: Mapping[str, Any]) -> str:
    """Return the settings that are refined as tables print them."""
    refined = {name: settings[name] for name in ("steps", "dt", "rtol", "atol") if name in settings}
    return ", ".join(f"{name} {value:.3g}" if name != "steps" else f"steps {value}" for name, value in refined.items())


def _slope(points: Sequence[Point], floor: float) -> Slope:
    # Below three floors the reference's own error bends a slope.
    used = [point for point in points if math.isfinite(point.error) and 3.0 * floor <= point.error <= SATURATED]
    if len(used) < 3:
        levels = f"{len(used)} level{'s' * (len(used) != 1)}"
        return Slope(reason=f"{levels} between the floor and {SATURATED:g} omega_0; 3 are needed")
    if max(point.work for point in used) < 1.5 * min(point.work for point in used):
        return Slope(reason="refinement hardly changes the cost: events set it")
    order, error = observed_order([1.0 / point.work for point in used], [point.error for point in used])
    if error > 0.25 * max(1.0, abs(order)):
        return Slope(reason=f"errors fall by no law of cost: {order:.1f} ± {error:.1f}")
    return Slope(order, error)
