"""A point of a sweep: what is asked, the key of its row, and how a worker makes some of them together.

A point names its maker, a function "module:name" that returns rows. Flights are made here; a landing's maker is
``flipproof.chapters.landing.work``. Nothing here knows which machine it runs on: a row depends on nothing but its own
point, so that chunks, workers and resuming cannot change a bit of it.
"""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from typing import Any, Final, NamedTuple

import numpy as np

from flipproof.foreign.specs import content_of
from flipproof.frame.keys import changed_since_import, fingerprint, versions_of
from flipproof.frame.provenance import provenance, version_of
from flipproof.frame.solvers import find, solve
from flipproof.frame.store import json_of
from flipproof.sweep.errors import SweepError
from ode_reference.solver import WATERS
from slicemodel.observables import centre_of_mass_velocity, plateau
from slicemodel.scenario import Bottle, Scenario, ScenarioError
from slicemodel.trajectory import STATUSES, FloatArray, Trajectory

Throw = Mapping[str, Mapping[str, Any]]
"""{"bottle": {...}, "scenario": {...}}: every field, possible or not."""

Row = dict[str, Any]
"""What a point gave by name, in SI: numbers, words, lists or None; ``status`` and ``reason`` are always among them."""

WHOLE: Final = ("ok", "escaped")
"""Statuses of a trajectory that reached the end of the flight."""

OUTCOMES: Final = {
    **STATUSES,
    "undecided": "of a landing: its outcome could not be certified",
    "missed": "of a landing: the bottle did not come down on the table from above",
    "impossible": "no bottle can be thrown so; the solver was not called",
    "failed": "the solver raised an error or returned nothing",
    "worker-died": "the point was alone in its worker each time that the worker died",
}
"""Status of a row -> its meaning."""

FLIGHTS: Final = "flipproof.sweep.work:make_flights"
"""The maker of flights."""

SOURCES: Final = (
    "slicemodel",
    "ode_reference",
    "engine_check",
    "flipproof.frame.solvers",
    "flipproof.sweep.work",
    "flipproof.chapters.landing.work",
)
"""What a row's numbers depend on."""

TOGETHER: Final = {"ode_reference": 64, "slicemodel": 16, "": 8}
"""Points of a solver's package, or of a maker's own programs, that go to a worker together; of others, one."""

SHARED: Final = {"times", "rest_speed", "energy"}
"""Settings that ``ode_reference.solve_batch`` takes; others are of its slower methods."""

READ: Final = ("plateau", "omega_end", "theta_end", "r_cm_end", "t_end", "impacts", "status", "message", "reason")
"""What a row holds of a flight."""

COARSE_PLATEAU: Final = 1e-3
"""Difference of a plateau from the mean that theta gives above which a message says so."""

CURVES: Final = ("omega", "theta", "r_cm", "v_cm")
"""What a row's curves show [rad/s, rad, m, m/s]."""


class Point(NamedTuple):
    """One throw by one solver, and what is made of it.

    Parameters
    ----------
    solver : str - name of a solver, or of a program that the maker knows
    throw : {"bottle": {...}, "scenario": {...}} - every field, possible or not
    settings : mapping - what the solver is called with
    maker : str - "module:name" of the function (solver, settings, throws, **options) that returns rows
    options : mapping - what the maker is called with
    content : str - fingerprint of somebody else's solver; empty for flipproof's own
    """

    solver: str
    throw: Throw
    settings: Mapping[str, Any]
    maker: str = FLIGHTS
    options: Mapping[str, Any] = {}
    content: str = ""


class WorkerResult(NamedTuple):
    """What a worker returns: the code and versions that it ran, and the rows of its points.

    ``changed`` names somebody else's solver whose files are not those of the points; then there are no rows.
    """

    code: str
    versions: Mapping[str, str]
    rows: Sequence[Row]
    changed: str = ""


def kind_of(point: Point) -> str:
    """Return as JSON what a point has in common with those that can be made together with it."""
    return json_of([point.maker, point.options, point.solver, point.settings, point.content])


def keyed(points: Iterable[Point], code: str) -> Iterator[tuple[bytes, str, Point]]:
    """Yield key, kind and point: the key is 16 bytes of a hash of the point and of the code that makes it."""
    last: tuple[Any, ...] = ()
    for point in points:
        solver, throw, *context = point
        if not last or any(previous is not current for previous, current in zip(last, (solver, *context), strict=True)):
            last, kind = (solver, *context), kind_of(point)
            begun = hashlib.blake2b(f"{code}\n{kind}\n".encode(), digest_size=16)
        whole = begun.copy()
        whole.update(json_of(throw).encode())
        yield whole.digest(), kind, point


def together(point: Point) -> int:
    """Return how many points like this one go to a worker together."""
    return 1 if "method" in point.settings else TOGETHER.get(_package(point.solver), 1)


@functools.cache
def _package(solver: str) -> str:
    try:
        return find(solver).package
    except ValueError:  # a program that its maker knows
        return ""


@functools.cache
def code_identity() -> str:
    """Return version and fingerprint of the code that makes points, such as "0.1.0+3f2a9c41d0be".

    A SweepError says that it was changed after this program had read it.
    """
    if changed := changed_since_import():
        raise SweepError(f"{changed} was changed after this program had read it; start the program again")
    return f"{version_of('flipproof')}+{fingerprint(*SOURCES):.12}"


@functools.cache
def versions() -> Mapping[str, str]:
    """Return what else a row may depend on in its last bits: recorded with every row, not compared."""
    machine = {name: fact for name, fact in provenance("").items() if name in ("system", "processor")}
    return {name: version for name, version in versions_of().items() if name != "flipproof"} | machine


def make_points(code: str, points: Sequence[Point]) -> WorkerResult:
    """Make points of one kind in this process, or none if the caller's ``code``, or the solver's, is another here."""
    current_code, first = code_identity(), points[0]
    if current_code != code or _changed(first):
        return WorkerResult(current_code, versions(), (), _changed(first))
    module, _, name = first.maker.partition(":")
    throws = [point.throw for point in points]
    rows = getattr(import_module(module), name)(first.solver, first.settings, throws, **first.options)
    changed = _changed(first)  # while they were made, too: then nobody knows by which
    return WorkerResult(current_code, versions(), () if changed else rows, changed)


def _changed(point: Point) -> str:
    """Return the name of a solver whose files here are not those that the point is to be made by, or nothing."""
    try:
        return "" if not point.content or content_of(point.solver) == point.content else point.solver
    except ValueError:
        return point.solver


# ---------------------------------------------------------------------- flights


def make_flights(
    solver: str, settings: Mapping[str, Any], throws: Sequence[Throw], *, curves: int = 0, names: Sequence[str] = CURVES
) -> list[Row]:
    """Return the rows of flights: ``READ``, and the ``names`` of ``CURVES`` at so many equal times, or None.

    Throws by an equation of the reference are solved by one call, which gives the same to the last bit.
    """
    flights = _fly(solver, settings, throws, slices=curves > 0 and "v_cm" in names)
    return [read_flight(flight) | (_curves(flight, curves, names) if curves else {}) for flight in flights]


def _fly(
    solver: str, settings: Mapping[str, Any], throws: Sequence[Throw], slices: bool = False
) -> list[Trajectory | Row]:
    """Return the flight of every throw, with its ``slices`` if asked, or the row that says why there is none."""
    scenarios = [scenario_of(throw) for throw in throws]
    if not slices and _package(solver) == "ode_reference" and solver not in WATERS and settings.keys() <= SHARED:
        import ode_reference

        try:
            possible = [throw for throw in scenarios if isinstance(throw, Scenario)]
            flights = iter(ode_reference.solve_batch(possible, solver, jobs=1, **settings))
            return [next(flights) if isinstance(throw, Scenario) else throw for throw in scenarios]
        except Exception:  # one of them cannot be solved: alone each says what is wrong with it
            pass
    return [_alone(solver, settings, throw) if isinstance(throw, Scenario) else throw for throw in scenarios]


def scenario_of(throw: Throw) -> Scenario | Row:
    """Return the scenario, or the status and reason of a throw that no bottle can make."""
    fields = dict(throw["scenario"])
    fields["launch_velocity"] = tuple(fields["launch_velocity"])
    try:
        return Scenario(bottle=Bottle(**throw["bottle"]), **fields)
    except ScenarioError as error:
        return {"status": "impossible", "reason": str(error)}


def _alone(solver: str, settings: Mapping[str, Any], throw: Scenario) -> Trajectory | Row:
    try:
        return solve(solver, throw, **settings)
    except Exception as error:  # a sweep of days does not end because one point met a mistake in a solver
        return {"status": "failed", "reason": f"{type(error).__name__}: {error}"}


def read_flight(flight: Trajectory | Row) -> Row:
    """Return plateau [1], omega [rad/s], theta [rad], r_CM [m] and t [s] at the end, and the impacts counted.

    None where a flight did not reach its end, or where the solver does not give the number; ``reason`` says why.
    """
    row: Row = dict.fromkeys(READ) | {"status": "failed", "message": "", "reason": ""}
    if isinstance(flight, dict):
        return row | flight
    if not len(flight.t):
        return row | {"reason": f"{flight.status}: {flight.message}"}
    reasons = []
    if flight.status in WHOLE:
        # A number out of range is missing with a reason here; it must not also appear as a warning.
        with np.errstate(all="ignore"):
            readings = {"plateau": plateau(flight.t, flight.omega, flight.scenario.omega0)}
        readings |= {f"{name}_end": float(getattr(flight, name)[-1]) for name in ("omega", "theta", "r_cm")}
        row |= {name: value if math.isfinite(value) else None for name, value in readings.items()}
        reasons += [f"{name} is not finite" for name in readings if row[name] is None]
        if "r_cm" in flight.diagnostics.get("not_given", ()):
            row["r_cm_end"] = None
            reasons.append(f"{flight.method} gives no r_cm")
    else:
        reasons.append(f"{flight.status}: the flight ends at t = {flight.t[-1]:.6g} s")
    if flight.impacts is None:
        reasons.append(f"{flight.method} counts no impacts")
    row["impacts"] = None if flight.impacts is None else len(flight.impacts)
    message = "; ".join(filter(None, (flight.message, _coarse_plateau(flight, row["plateau"]))))
    ending = {"t_end": float(flight.t[-1]), "status": flight.status, "message": message}
    return row | ending | {"reason": "; ".join(reasons)}


def _coarse_plateau(flight: Trajectory, level: float | None) -> str:
    """Return what theta says of a plateau of an equation whose output times are too few for it, else nothing."""
    if level is None or flight.solver != "ode_reference":
        return ""
    (begin, *_, end), theta = flight.t, flight.theta
    middle = (begin + end) / 2
    turned = float(theta[-1] - np.interp(middle, flight.t, theta)) / (end - middle) / flight.scenario.omega0
    few = abs(turned - level) > COARSE_PLATEAU
    return f"plateau: {len(flight.t)} output times are few; by theta it is {turned:.4f}" if few else ""


def _curves(flight: Trajectory | Row, points: int, names: Sequence[str]) -> Row:
    if isinstance(flight, dict) or flight.status not in WHOLE or not len(flight.t):
        return dict.fromkeys(names)
    curves = dict(zip(CURVES, curves_of(flight, points), strict=True))
    return {name: None if np.isnan(curves[name]).any() else curves[name].tolist() for name in names}


def curves_of(flight: Trajectory, points: int) -> FloatArray:
    """Return the ``CURVES`` of a whole flight at equal times from release to landing, shape (4, points).

    Linear between output times. v_CM is NaN where the run kept no slices (a scheme's store "summary").
    """
    times = np.linspace(0.0, flight.scenario.duration, points)
    kept = len(flight.v) == len(flight.t)
    v_cm = centre_of_mass_velocity(flight.scenario, flight.v) if kept else np.full(len(flight.t), np.nan)
    return np.array([np.interp(times, flight.t, curve) for curve in (flight.omega, flight.theta, flight.r_cm, v_cm)])
