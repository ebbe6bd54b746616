"""What does a digit cost, and with whom? Error against cost, in the manner of the ODE community.

    error  |  x x                 x  failed: at the top edge, with its reason in the table
           |  o                   o  one level of a contender; a line per contender
           |     o    s           #  the floor: nothing below it is claimed
           |        o     s
           |###########o####      The slope is the order in cost: error ~ cost^-p.
           +------------------ cost

Error is max |omega - omega_reference| / |omega_0| over the common times, against the contender's *own* equation; beside
it the same of the plateau, which forgives a rebound that comes a little early. The reference of an equation is its
reduced flow, which has no tolerance; the floor is the largest difference from it of two witnesses by ``solve_ivp``,
which share neither search nor contact code with it and have ten times its rest speed. All three stand in one package:
that the equations mean the same in all packages is shown where exact solutions, schemes and engines meet, not here.

Cost is counted twice: in updates of one slice (``contenders``), which any machine reproduces, and in processor seconds
(``flipproof.frame.timing``), which say what an update is worth in the language that makes it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from flipproof.chapters.work_precision.contenders import AT_REST, Case, Contender, Effort, contenders
from flipproof.curves.order import ROUND_OFF, observed_order
from flipproof.frame.solvers import Made, Run
from flipproof.frame.timing import at_times
from flipproof.frame.twins import usual_rest_speed
from ode_reference.models import MODELS
from slicemodel import Trajectory
from slicemodel.observables import plateau
from slicemodel.schemes import SCHEMES
from slicemodel.trajectory import FloatArray

Cost = Literal["work", "seconds", "steps"]
"""Updates of one slice, seconds of the processor, the solver's own steps."""

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

    ``floor`` and ``plateau_floor`` are fractions of omega_0, never below round-off; NaN if there is no reference, for
    ``reason``. ``words`` states the settings of the reference and of its witnesses.
    """

    equation: str
    floor: float = math.nan
    plateau_floor: float = math.nan
    words: str
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One level of a contender: geometric means of cost, root-mean-square errors with the range of its members.

    Costs are NaN if the run never began. Errors are NaN if a member failed, for ``reason``.
    """

    settings: str
    work: float
    steps: float
    seconds: float
    error: float = math.nan
    lowest: float = math.nan
    highest: float = math.nan
    plateau: float = math.nan
    at_floor: bool = False
    reason: str = ""

    def cost(self, kind: Cost) -> float:
        """Return the cost of that kind."""
        return float(getattr(self, kind))


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A contender's levels; ``slope`` is p in error ~ work^-p with its standard error, NaN for ``slope_reason``.

    ``held`` is every setting that its runs report and that is not refined, versions included.
    """

    contender: Contender
    reference: Reference
    points: tuple[Point, ...]
    held: Mapping[str, Any]
    slope: float
    slope_error: float
    slope_reason: str = ""

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
            return Price(fine.cost(cost), bound=True)
        coarse = points[first - 1]
        y0, y1 = math.log(coarse.error), math.log(max(fine.error, floor))
        share = (math.log(error) - y0) / (y1 - y0)
        x0, x1 = math.log(coarse.cost(cost)), math.log(fine.cost(cost))
        return Price(math.exp(x0 + share * (x1 - x0)), bound=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkPrecision:
    """The diagram of one throw."""

    case: Case
    references: Mapping[str, Reference]
    curves: Mapping[str, Curve]

    def of(self, equation: str) -> tuple[Curve, ...]:
        """Return the curves of one equation."""
        return tuple(curve for curve in self.curves.values() if curve.contender.equation == equation)


def plan_work_precision(case: Case, effort: Effort) -> list[Run]:
    """Return every run of one throw: references, witnesses, contenders."""
    rivals = contenders(case, effort)
    levels = [*_plan_references(case, rivals).values(), *(level for rival in rivals for level in rival.runs(case))]
    return list(chain.from_iterable(levels))


def _plan_references(case: Case, rivals: Iterable[Contender]) -> dict[str, list[Run]]:
    """Return the reference and the witnesses of every equation that somebody solves."""
    runs: dict[str, list[Run]] = {}
    for rival in rivals:
        equation, solver, scenario = rival.equation, rival.equation, case.scenario
        if equation in runs:
            continue
        if equation in (*MODELS, AT_REST):
            if equation == AT_REST:
                scenario, solver = replace(scenario, frozen=True), "eq8"
            usual, omega0 = usual_rest_speed(solver), abs(scenario.omega0)
            asked: list[dict[str, Any]] = [{"method": "taylor", "rest_speed": usual / 10, "times": case.times}]
            for method, rtol, radians in (("LSODA", 1e-10, 0.02), ("DOP853", 1e-11, 0.04)):
                longest = min(radians, scenario.duration * omega0) / omega0
                tolerances = {"rtol": rtol, "atol": 1e-3 * rtol, "rest_speed": usual, "max_step": longest}
                asked.append({"method": method, **tolerances, "times": case.times})
        else:
            # The scheme's own limit: the scheme on a grid eight times finer than its last level, and on half of that.
            solver, finest = rival.solver, 8 * (rival.levels[-1][0]["steps"] - 1)
            asked = [{**rival.fixed, "steps": finest // coarser + 1} for coarser in (1, 2)]
        runs[equation] = [
            Run(solver, scenario, settings, f"work, {case.name}, {f'witness {k}' if k else 'reference'}, {equation}")
            for k, settings in enumerate(asked)
        ]
    return runs


def study_work_precision(case: Case, effort: Effort, made: Mapping[Run, Made]) -> WorkPrecision:
    """Read the runs that ``plan_work_precision`` planned with the same arguments.

    Raises
    ------
    ValueError
        If a run does not hold the common times.
    """
    rivals = contenders(case, effort)
    truths = {
        equation: _reference(case, equation, [made[run] for run in runs])
        for equation, runs in _plan_references(case, rivals).items()
    }
    curves = {
        rival.key: _curve(
            case, rival, [[made[run] for run in level] for level in rival.runs(case)], *truths[rival.equation]
        )
        for rival in rivals
    }
    references = {equation: reference for equation, (reference, _) in truths.items()}
    return WorkPrecision(case=case, references=references, curves=curves)


def _reference(case: Case, equation: str, runs: Sequence[Made]) -> tuple[Reference, FloatArray | None]:
    """Return an equation's reference and its omega at the common times; None if there is none."""
    words = "; ".join(words_of(run.run.settings) for run in runs)
    if problem := _why_failed(runs):
        return Reference(equation=equation, words=words, reason=problem), None
    truth = _omega(case, runs[0])
    errors = [_errors(case, witness, truth) for witness in runs[1:]]
    floor, plateau_floor = (max(ROUND_OFF, *column) for column in zip(*errors, strict=True))
    return Reference(equation=equation, floor=floor, plateau_floor=plateau_floor, words=words), truth


def _omega(case: Case, made: Made) -> FloatArray:
    return np.asarray(made.flight.omega[at_times(made.flight.t, case.times)])


def _errors(case: Case, made: Made, truth: FloatArray) -> tuple[float, float]:
    """Return the largest error and that of the plateau, as fractions of omega_0."""
    omega, omega0 = _omega(case, made), case.scenario.omega0
    largest = float(np.abs(omega - truth).max() / abs(omega0))
    return largest, abs(plateau(case.times, omega, omega0) - plateau(case.times, truth, omega0))


def _why_failed(runs: Iterable[Made]) -> str:
    """Return why the first run that failed cannot be used, or nothing."""
    for made in runs:
        if made.trajectory is None:
            return made.reason or "it returned nothing"
        if not made.trajectory.ok:
            status = made.trajectory.status
            return f"{status}: {made.trajectory.message.removeprefix(f'{status} ')}"
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


def _point(
    case: Case,
    members: Sequence[Made],
    level: Sequence[Mapping[str, Any]],
    reference: Reference,
    truth: FloatArray | None,
) -> Point:
    flights = [made.trajectory for made in members]
    costs: dict[str, Any] = {
        "settings": words_of(level[0]) + (f" to {words_of(level[-1])}" if len(level) > 1 else ""),
        "work": _geometric([math.nan if flight is None else work_of(flight) for flight in flights]),
        "steps": _geometric([math.nan if flight is None else _steps(flight) for flight in flights]),
        "seconds": _geometric([made.seconds for made in members]),
    }
    reason = _why_failed(members)
    if reason or truth is None:
        return Point(**costs, reason=reason or f"no reference: {reference.reason}")
    errors = [_errors(case, made, truth) for made in members]
    largest, flat = (np.array(column) for column in zip(*errors, strict=True))
    error = float(np.sqrt(np.mean(largest**2)))
    return Point(
        **costs,
        error=error,
        lowest=float(largest.min()),
        highest=float(largest.max()),
        plateau=float(np.sqrt(np.mean(flat**2))),
        at_floor=error <= reference.floor,
    )


def _geometric(values: Sequence[float]) -> float:
    """Return the geometric mean; NaN if a value is missing or no cost was measured."""
    return float(np.exp(np.mean(np.log(values)))) if all(value > 0.0 for value in values) else math.nan


def words_of(settings: Mapping[str, Any]) -> str:
    """Return settings as tables print them, without the output times."""
    return ", ".join(
        f"{name} {value:.3g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in settings.items()
        if name != "times"
    )


def _curve(
    case: Case,
    rival: Contender,
    runs: Sequence[Sequence[Made]],
    reference: Reference,
    truth: FloatArray | None,
) -> Curve:
    """Return the curve of a contender; what it held is what the first run that began reports of its settings."""
    points = tuple(
        _point(case, members, level, reference, truth) for members, level in zip(runs, rival.levels, strict=True)
    )
    reported = next((m.trajectory.settings for level in runs for m in level if m.trajectory is not None), rival.fixed)
    refined = {*rival.levels[0][0], "dt", "step", "step_least", "points", "times"}  # or follows from what is
    held = {name: value for name, value in reported.items() if name not in refined and value is not None}
    # Below three floors the reference's own error bends a slope.
    used = [
        point for point in points if math.isfinite(point.error) and 3.0 * reference.floor <= point.error <= SATURATED
    ]
    slope, slope_error, reason = math.nan, math.nan, ""
    if len(used) < 3:
        reason = f"{len(used)} level{'s' * (len(used) != 1)} between the floor and {SATURATED:g} omega_0; 3 are needed"
    elif max(point.work for point in used) < 1.5 * min(point.work for point in used):
        reason = "refinement hardly changes the cost: events set it"
    else:
        step = np.array([[1.0 / point.work] for point in used])
        slope, slope_error = observed_order(step, [point.error for point in used])
        if slope_error > 0.25 * max(1.0, abs(slope)):
            reason = f"errors fall by no law of cost: {slope:.1f} ± {slope_error:.1f}"
            slope = slope_error = math.nan
    slopes: dict[str, Any] = {"slope": slope, "slope_error": slope_error, "slope_reason": reason}
    return Curve(contender=rival, reference=reference, points=points, held=held, **slopes)
