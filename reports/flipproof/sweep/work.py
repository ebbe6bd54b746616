"""What a worker does: it makes points, and says by which code and under which versions.

Nothing here knows which machine it runs on. A point is made by ``flipproof.frame.solvers.make``, as a run of a report
is, or with others by ``ode_reference.solve_batch``, which gives the same to the last bit; it depends on nothing but its
own parameters: batches, workers and resuming cannot change a bit of it.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from flipproof.foreign.specs import content_of
from flipproof.frame.keys import fingerprint
from flipproof.frame.solvers import Run, find, make
from flipproof.output.provenance import provenance, version_of
from flipproof.sweep.design import Point
from ode_reference.solver import WATERS
from slicemodel.observables import centre_of_mass_velocity, plateau
from slicemodel.scenario import Scenario, ScenarioError
from slicemodel.trajectory import STATUSES, FloatArray, Trajectory

if TYPE_CHECKING:
    from flipproof.landing.work import Landed

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

LAND: Final = "land"
"""What a point names in the place of a solver if a landing is to be made."""

SOURCES: Final = (
    "slicemodel",
    "ode_reference",
    "engine_check",
    "flipproof.frame.solvers",
    "flipproof.sweep.work",
    "flipproof.landing.work",
)
"""What a point's numbers depend on."""

TOGETHER: Final = 64
"""Points of the reference that are solved by one call: enough to share what a call costs, 5 MB of output."""

SHARED: Final = {"times", "rest_speed", "impact_law", "energy"}
"""Settings of the reference that ``solve_batch`` takes; others are of its slower methods."""

CURVES: Final = ("omega", "theta", "r_cm", "v_cm")
"""What a row's curves show, in their order [rad/s, rad, m, m/s]."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a point. A number that is not known is None, and ``reason`` says why.

    Without slots, as ``Point`` is.

    Parameters
    ----------
    plateau, omega_end, theta_end, r_cm_end : float or None
        Mean of omega / omega_0 over the second half [1]; omega [rad/s], theta [rad] and r_CM [m] at the end of the
        flight. None unless the flight was whole.
    t_end : float or None - last time reached [s]
    impacts : int or None - None where a solver does not count them
    status : a key of ``OUTCOMES``
    message : the trajectory's own
    reason : why a number is missing; empty if none is
    seconds : what the point took
    arrays : the flight, if it was asked for and there is one
    curves : (4, P) - ``curves_of`` the flight, if they were asked for and it was whole
    """

    number: int
    plateau: float | None = None
    omega_end: float | None = None
    theta_end: float | None = None
    r_cm_end: float | None = None
    t_end: float | None = None
    impacts: int | None = None
    status: str
    message: str = ""
    reason: str = ""
    seconds: float = 0.0
    arrays: Mapping[str, NDArray[Any]] | None = None
    curves: FloatArray | None = None

    @property
    def whole(self) -> bool:
        """True if the flight reached its end and its numbers are known."""
        return self.omega_end is not None


@dataclass(frozen=True, slots=True)
class Returned:
    """What a worker sends home: code and versions that it ran, the points, and the seconds they took together.

    ``changed`` names somebody else's solver whose files are not those of the design; then there are no points.
    """

    code: str
    versions: Mapping[str, str]
    outcomes: Sequence[Outcome | Landed]
    seconds: float
    changed: str = ""


@functools.cache
def code_identity() -> str:
    """Return version and fingerprint of the code that makes points, such as "0.1.0+3f2a9c41d0be"."""
    return f"{version_of('flipproof')}+{fingerprint(*SOURCES):.12}"


@functools.cache
def versions() -> Mapping[str, str]:
    """Return what else a point may depend on in its last bits: recorded with every row, not compared."""
    return {name: fact for name, fact in provenance("").items() if name not in ("command", "made", "flipproof")}


def make_batch(code: str, points: Sequence[Point], keep: bool, curves: int = 0) -> Returned:
    """Make points by one process; if the caller's ``code``, or that of the points' solver, is not that here, make none.

    ``keep``: return the flights too; ``curves``: points of the curves to return, 0 for none.
    """
    began = time.perf_counter()
    here = code_identity()
    outcomes = list(_made(points, keep, curves)) if here == code and not _changed(points) else []
    changed = _changed(points)  # while they were made, too: then nobody knows by which
    return Returned(here, versions(), () if changed else outcomes, time.perf_counter() - began, changed)


def _made(points: Sequence[Point], keep: bool, curves: int) -> Iterator[Outcome | Landed]:
    if points and points[0].solver == LAND:
        from flipproof.landing.work import make_landing

        yield from map(make_landing, points)
        return
    for begin in range(0, len(points), TOGETHER):
        some = points[begin : begin + TOGETHER]
        together = None if keep or curves else make_together(some)
        yield from together or [make_point(point, keep, curves) for point in some]


def _changed(points: Sequence[Point]) -> str:
    """Return the name of a solver whose files here are not those that the points are to be made by, or nothing."""
    for solver, content in {(point.solver, point.content) for point in points if point.content}:
        try:
            same = content_of(solver) == content
        except ValueError:
            same = False
        if not same:
            return solver
    return ""


def make_together(points: Sequence[Point]) -> list[Outcome] | None:
    """Make points of one equation of the reference by one call; None where they must be made one by one."""
    solver, settings = points[0].solver, points[0].settings
    if any(point.solver != solver or point.settings != settings for point in points):
        return None
    if find(solver).package != "ode_reference" or solver in WATERS or not settings.keys() <= SHARED:
        return None
    from ode_reference import solve_batch

    throws: list[Scenario] = []
    outcomes: dict[int, Outcome] = {}
    began = time.perf_counter()
    for point in points:
        try:
            throws.append(point.scenario())
        except ScenarioError as error:
            outcomes[point.number] = Outcome(number=point.number, status="impossible", reason=str(error))
    try:
        flights = solve_batch(throws, solver, jobs=1, **settings).flights
    except Exception:
        # One of them cannot be solved: alone each says what is wrong with it.
        return None
    seconds = (time.perf_counter() - began) / len(points)
    possible = (point.number for point in points if point.number not in outcomes)
    outcomes |= {number: _read(number, flight, seconds) for number, flight in zip(possible, flights, strict=True)}
    return [outcomes[point.number] for point in points]


def make_point(point: Point, keep: bool = False, curves: int = 0) -> Outcome:
    """Make one point; whatever goes wrong becomes its status and reason."""
    try:
        scenario = point.scenario()
    except ScenarioError as error:
        return Outcome(number=point.number, status="impossible", reason=str(error))
    began = time.perf_counter()
    try:
        made = make(Run(point.solver, scenario, point.settings, label=""))
    except Exception as error:
        # A sweep of days does not end because one point met a mistake in a solver.
        seconds = time.perf_counter() - began
        return Outcome(number=point.number, status="failed", reason=f"{type(error).__name__}: {error}", seconds=seconds)
    if made.trajectory is None:
        return Outcome(number=point.number, status="failed", reason=made.reason, seconds=made.seconds)
    flight = made.trajectory
    outcome = _read(point.number, flight, made.seconds)
    return replace(
        outcome,
        arrays=_arrays(flight) if keep and len(flight.t) else None,
        curves=curves_of(flight, curves) if curves and flight.status in WHOLE else None,
    )


def curves_of(flight: Trajectory, points: int) -> FloatArray:
    """Return the ``CURVES`` of a whole flight at equal times from release to landing, shape (4, points).

    Linear between output times. v_CM is NaN where the run kept no slices (a scheme's store "summary").
    """
    times = np.linspace(0.0, flight.scenario.duration, points)
    kept = len(flight.v) == len(flight.t)
    v_cm = centre_of_mass_velocity(flight.scenario, flight.v) if kept else np.full(len(flight.t), np.nan)
    return np.array([np.interp(times, flight.t, curve) for curve in (flight.omega, flight.theta, flight.r_cm, v_cm)])


def _read(number: int, flight: Trajectory, seconds: float) -> Outcome:
    if len(flight.t) == 0:
        return Outcome(number=number, status="failed", reason=f"{flight.status}: {flight.message}", seconds=seconds)
    values: dict[str, Any] = dict.fromkeys(("plateau", "omega_end", "theta_end", "r_cm_end"))
    reasons = []
    if flight.status in WHOLE:
        # A number out of range is missing with a reason here; it must not also appear as a warning.
        with np.errstate(all="ignore"):
            found = {
                "plateau": plateau(flight.t, flight.omega, flight.scenario.omega0),
                "omega_end": float(flight.omega[-1]),
                "theta_end": float(flight.theta[-1]),
                "r_cm_end": float(flight.r_cm[-1]),
            }
        values = {name: value if math.isfinite(value) else None for name, value in found.items()}
        reasons += [f"{name} is not finite" for name, value in values.items() if value is None]
        if "r_cm" in flight.diagnostics.get("not_given", ()):
            values["r_cm_end"] = None
            reasons.append(f"{flight.method} gives no r_cm")
    else:
        reasons.append(f"{flight.status}: the flight ends at t = {flight.t[-1]:.6g} s")
    if flight.impacts is None:
        reasons.append(f"{flight.method} counts no impacts")
    return Outcome(
        number=number, **values, t_end=float(flight.t[-1]),
        impacts=None if flight.impacts is None else len(flight.impacts), status=flight.status,
        message=flight.message, reason="; ".join(reasons), seconds=seconds,
    )  # fmt: skip


def _arrays(flight: Trajectory) -> dict[str, NDArray[Any]]:
    names = ("t", "theta", "omega", "r_cm", "inertia", "r", "v")
    arrays: dict[str, NDArray[Any]] = {name: np.asarray(getattr(flight, name)) for name in names}
    if flight.impacts is not None:
        arrays |= {f"impact_{name}": getattr(flight.impacts, name) for name in flight.impacts.__slots__}
    return arrays
