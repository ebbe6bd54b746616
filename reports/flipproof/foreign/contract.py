"""The contract of a foreign solver: what it is asked, what it declares, and what it answers.

def solve(ask):                                       # or an object with this method and the attributes of Traits
    t = ask.times                                     # answer at exactly these times
    theta, omega = integrate(ask.scenario, ask.start, t)
    return {"t": t, "theta": theta, "omega": omega}   # and, if known, r_cm, inertia, r, v, impacts
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from slicemodel import Scenario
from slicemodel.observables import centre_of_mass, moment_of_inertia
from slicemodel.scenario import shown, unknown_name
from slicemodel.trajectory import IMPACT_FIELDS, FloatArray, Impacts, Trajectory

PRECISIONS: Final = MappingProxyType(
    {"float64": 2.0**-52, "float32": 2.0**-23, "8 digits": 1e-8, "7 digits": 1e-7, "6 digits": 1e-6}
)
"""Number formats a solver may compute in or print, with the spacing of their numbers at 1."""

REFINERS: Final = ("dt", "steps", "rtol")
"""Kinds of effort of a solver: a step [s], a number of steps, a relative tolerance."""


MAX_NAME: Final = 100
"""Longest name of a solver, in characters."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """What a solver is asked, many times in one process: it must keep nothing from one ask to the next.

    Whatever ``Scenario`` admits may be asked: spin in either direction, any angle at release, one slice, gravity, drag
    or restitution of 0.

    Parameters
    ----------
    scenario : Scenario - the throw; units as in ``slicemodel.scenario``
    times : array, shape (P,), P >= 1 - strictly increasing times in [0, duration] at which to answer [s]; the release
        is at t = 0, even if the first of them is later
    start : array, shape (N,) - positions of the slices at release, from the cap [m], in any order, not only those of
        ``scenario.initial_positions()``; the slices are at rest in the bottle
    effort : float or None - the number that ``Traits.refined_by`` names; None if it names nothing
    """

    scenario: Scenario
    times: FloatArray
    start: FloatArray
    effort: float | None = None

    @classmethod
    def of(cls, scenario: Scenario, times: FloatArray, effort: float | None = None) -> Ask:
        """Return the ask for a throw from the start of Eq. 3a, every slice at rest in the water on the base."""
        start = scenario.initial_positions()
        for array in (times, start):
            array.setflags(write=False)
        return cls(scenario=scenario, times=times, start=start, effort=effort)


@dataclass(frozen=True, slots=True, kw_only=True)
class Started(Scenario):
    """A throw whose slices are let go at ``places`` [m from the cap] instead of as a stack on the base."""

    places: tuple[float, ...]

    def initial_positions(self) -> FloatArray:
        """Return the places, shape (N,) [m]."""
        return np.array(self.places)


def started(ask: Ask) -> Scenario:
    """Return the throw of an ask with its start, for flipproof's own solvers, which take the start from the throw."""
    throw = ask.scenario
    if np.array_equal(ask.start, throw.initial_positions()):
        return throw
    return begun(throw, ask.start)


def begun(throw: Scenario, places: FloatArray, **changed: float) -> Started:
    """Return a throw let go at ``places``, shape (N,) [m], with some of its numbers changed."""
    given = {f.name: getattr(throw, f.name) for f in fields(Scenario)}
    return Started(**(given | changed), places=tuple(places.tolist()))


@dataclass(frozen=True, slots=True, kw_only=True)
class Traits:
    """What a solver says of itself.

    Raises ValueError, naming the attribute, its value and the admissible values.

    Parameters
    ----------
    name : str - printed on every page; without line breaks, of at most ``MAX_NAME`` characters
    equation : str or None
        The equation that it solves: a rung of the ladder ("eq8"), a set of switches ("switches:111100"), or a
        published program ("published-python"). None: flipproof is to find out.
    refined_by : {"dt", "steps", "rtol"} or None - what ``Ask.effort`` means to it
    precision : {"float64", "float32", "8 digits", "7 digits", "6 digits"} - of its arithmetic, or of what it prints
    order : float or None - order of its error in dt before the first impact
    distribution : str - the installed package it comes from, for the record
    timeout : float - seconds one run may take, in (0, 86400]
    expected_failures : mapping - check -> reason, for failures that its author knows of
    """

    name: str
    equation: str | None = None
    refined_by: str | None = None
    precision: str = "float64"
    order: float | None = None
    distribution: str = ""
    timeout: float = 60.0
    expected_failures: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip() or not self.name.isprintable():
            raise ValueError(f"name = {shown(self.name)} is not a line of text")
        if len(self.name) > MAX_NAME:
            raise ValueError(f"name = {shown(self.name)} has more than {MAX_NAME} characters")
        if self.equation is not None:
            check_equation(self.equation)
        if self.refined_by is not None and self.refined_by not in REFINERS:
            raise ValueError(unknown_name("refined_by =", self.refined_by, REFINERS))
        if self.precision not in PRECISIONS:
            raise ValueError(unknown_name("precision =", self.precision, PRECISIONS))
        if self.order is not None and not _inside(self.order, 0.0, 40.0):
            raise ValueError(f"order = {shown(self.order)} is not a number in (0, 40]")
        if not _inside(self.timeout, 0.0, 86_400.0):
            raise ValueError(f"timeout = {shown(self.timeout)} is not a number of seconds in (0, 86400]")
        failures = self.expected_failures
        if not isinstance(failures, Mapping) or not all(isinstance(x, str) for pair in failures.items() for x in pair):
            raise ValueError(f"expected_failures = {shown(failures)} is not a mapping of checks to reasons")
        object.__setattr__(self, "expected_failures", dict(failures))

    @property
    def epsilon(self) -> float:
        """Spacing of the solver's numbers at 1."""
        return PRECISIONS[self.precision]


def check_equation(name: object) -> None:
    """Raise ValueError for what is neither a model of the reference, nor a set of switches, nor a scheme."""
    from ode_reference.models import MODELS
    from ode_reference.switches import Switches, are_switches
    from slicemodel.schemes import SCHEMES

    if are_switches(name):
        Switches.from_name(name)
    elif name not in MODELS and name not in SCHEMES:
        raise ValueError(unknown_name("equation =", name, [*MODELS, *SCHEMES]))


def traits_of(solver: object, name: str) -> Traits:
    """Return the traits that ``solver`` declares, or raise ValueError; ``name`` is used if it has none."""
    solve_of(solver)
    given = {
        f: value
        for f in Traits.__slots__
        if f != "name" and (value := getattr(solver, f, None)) is not None and not callable(value)
    }
    own_name = getattr(solver, "name", None)
    spec = name if len(name) <= MAX_NAME else f"... {name[4 - MAX_NAME :]}"
    return Traits(name=own_name if isinstance(own_name, str) else spec, **given)


def solve_of(solver: object) -> Callable[[Ask], object]:
    """Return ``solver.solve``, or ``solver`` itself if it has none; raises ValueError if that is not callable."""
    solve = getattr(solver, "solve", solver)
    if not callable(solve):
        raise ValueError(f"{shown(solver)} is neither callable nor has a method solve(ask)")
    return solve


def _inside(value: object, lower: float, upper: float) -> bool:
    is_number = isinstance(value, numbers.Real) and not isinstance(value, bool)
    return is_number and math.isfinite(float(value)) and lower < float(value) <= upper  # type: ignore[arg-type]


# ---------------------------------------------------------------------- the answer

REQUIRED: Final = ("t", "theta", "omega")
PER_TIME: Final = ("r_cm", "inertia")
PER_SLICE: Final = ("r", "v")
IMPACT: Final = tuple(name for name, _ in IMPACT_FIELDS)


class AnswerError(ValueError):
    """What a solver returned is no answer; the message names the field, what it holds and what is needed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What a solver answered, checked: arrays of float64, finite, at the times asked.

    ``t`` [s], ``theta`` [rad], ``omega`` [rad/s], ``r_cm`` [m], ``inertia`` [kg m^2] have shape (P,), ``r`` [m] and
    ``v`` [m/s] (P, N). theta goes on beyond a turn, unwrapped; v is measured in the bottle, from cap to base. What the
    solver did not give is None; r_cm and inertia follow from r by their definitions if they are ``derived``. Speeds of
    ``impacts`` are without sign, however they were given.
    """

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    r_cm: FloatArray | None = None
    inertia: FloatArray | None = None
    r: FloatArray | None = None
    v: FloatArray | None = None
    impacts: Impacts | None = None
    derived: tuple[str, ...] = ()

    @property
    def given(self) -> tuple[str, ...]:
        """Names of the fields that the solver gave."""
        return tuple(
            name
            for name in (*REQUIRED, *PER_TIME, *PER_SLICE, "impacts")
            if getattr(self, name) is not None and name not in self.derived
        )


def answer_of(ask: Ask, given: object) -> Answer:
    """Return a mapping, a Trajectory or any object with the attributes of ``Answer`` as a checked answer.

    Times within 1e-6 of the duration of those asked, as a program prints them, are taken for those asked. Raises
    AnswerError, naming the field, what it holds and what is needed.
    """
    if isinstance(given, Trajectory) and not given.ok:
        raise AnswerError(f"status = {given.status!r}: {given.message}")
    names = (*REQUIRED, *PER_TIME, *PER_SLICE, "impacts")
    fields = {name: value for name in names if (value := _field(given, name)) is not None}
    missing = [name for name in REQUIRED if name not in fields]
    if missing:
        kind = "" if isinstance(given, Mapping) else f" (a {type(given).__name__} came)"
        raise AnswerError(f"{' and '.join(missing)} missing{kind}; t, theta and omega are needed")
    points = len(ask.times)
    shapes: dict[str, tuple[int, ...]] = {name: (points,) for name in (*REQUIRED, *PER_TIME)}
    shapes |= {name: (points, ask.scenario.n_slices) for name in PER_SLICE}
    if isinstance(given, Trajectory) and len(given.r) != len(given.t):
        fields = {name: value for name, value in fields.items() if name not in PER_SLICE}
    arrays = {name: numbers_of(name, fields[name], shape) for name, shape in shapes.items() if name in fields}
    t = arrays["t"]
    if points and float(np.max(np.abs(t - ask.times))) > 1e-6 * ask.scenario.duration:
        k = int(np.argmax(np.abs(t - ask.times)))
        raise AnswerError(f"t[{k}] = {t[k]:.9g} s, asked was {ask.times[k]:.9g} s; answer at the times asked")
    arrays["t"] = ask.times
    derived = tuple(name for name in PER_TIME if "r" in arrays and name not in arrays)
    for name, definition in zip(PER_TIME, (centre_of_mass, moment_of_inertia), strict=True):
        if name in derived:
            arrays[name] = definition(ask.scenario, arrays["r"])
    impacts = _impacts_of(fields["impacts"], ask.scenario.n_slices) if "impacts" in fields else None
    return Answer(**arrays, impacts=impacts, derived=derived)


def _field(given: object, name: str) -> Any:
    """Return the value of a mapping's key or an object's attribute; None if there is none."""
    return given.get(name) if isinstance(given, Mapping) else getattr(given, name, None)


def numbers_of(name: str, value: object, shape: tuple[int, ...]) -> FloatArray:
    """Return ``value`` as finite float64 numbers of ``shape``; an AnswerError names the field and what is needed."""
    if len(shape) == 1:
        _length(name, value, shape[0])
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, OverflowError, MemoryError) as error:
        raise AnswerError(f"{name} is no array of numbers ({type(error).__name__}: {error})") from None
    if array.shape != shape:
        raise AnswerError(f"{name} has shape {array.shape}, not {shape}")
    if array.dtype.kind not in "fiu":
        kinds = {"c": "complex numbers", "U": "text", "S": "text", "O": "objects", "b": "truth values"}
        kind = kinds.get(array.dtype.kind, str(array.dtype))
        raise AnswerError(f"{name} holds {kind}; real numbers are needed")
    masked = np.ma.getmaskarray(value) if isinstance(value, np.ma.MaskedArray) else np.zeros(shape, dtype=bool)
    if masked.any():
        raise AnswerError(f"{name}{_first_index(masked)} is masked; a number is needed")
    array = np.ascontiguousarray(array, dtype=np.float64)
    if not np.isfinite(array).all():
        wrong = ~np.isfinite(array)
        raise AnswerError(f"{name}{_first_index(wrong)} = {array[wrong][0]} is not finite")
    return array


def _first_index(wrong: NDArray[np.bool_]) -> str:
    """Return the index of the first True, in brackets."""
    return f"[{', '.join(str(k) for k in np.argwhere(wrong)[0])}]"


def _length(name: str, value: object, expected: int | None = None) -> int:
    """Return the length of a one-dimensional field, without copying it."""
    if isinstance(value, (str, bytes)):
        raise AnswerError(f"{name} = {shown(value)} is not an array of numbers")
    shape = getattr(value, "shape", None)
    if shape is None:
        try:
            shape = (len(value),)  # type: ignore[arg-type]
        except TypeError:
            raise AnswerError(f"{name} is a {type(value).__name__}, not an array of numbers") from None
    if len(shape) != 1 or (expected is not None and shape[0] != expected):
        raise AnswerError(f"{name} has shape {tuple(shape)}, not ({'P' if expected is None else expected},)")
    return int(shape[0])


def _impacts_of(given: object, n_slices: int) -> Impacts:
    """Return impacts given as ``Impacts``, as a mapping of arrays, or as rows of its five fields."""
    if not isinstance(given, (Impacts, Mapping)):
        try:
            rows = [tuple(row[name] for name in IMPACT) if isinstance(row, Mapping) else tuple(row) for row in given]  # type: ignore[attr-defined]
            if counts := {len(row) for row in rows} - {len(IMPACT)}:
                raise ValueError(f"a row has {min(counts)} numbers, not {len(IMPACT)}")
            given = dict(zip(IMPACT, zip(*rows, strict=True) if rows else [()] * len(IMPACT), strict=True))
        except (TypeError, ValueError, KeyError) as error:
            raise AnswerError(f"impacts are no rows of {', '.join(IMPACT)} ({type(error).__name__}: {error})") from None
    columns = {name: _field(given, name) for name in IMPACT}
    absent = [name for name, column in columns.items() if column is None]
    if absent:
        raise AnswerError(f"impacts: {' and '.join(absent)} missing; {', '.join(IMPACT)} are needed")
    count = _length("impacts.time", columns["time"])
    arrays = {name: numbers_of(f"impacts.{name}", column, (count,)) for name, column in columns.items()}
    if not np.isin(arrays["end"], (-1.0, 1.0)).all():
        raise AnswerError("impacts.end holds other numbers than 1 (base) and -1 (cap)")
    if count and not (arrays["slice"].min() >= 0 and arrays["slice"].max() < n_slices):
        from_one = arrays["slice"].min() == 1 and arrays["slice"].max() == n_slices
        raise AnswerError(
            f"impacts.slice leaves [0, {n_slices - 1}]: "
            f"{'number slices from 0' if from_one else 'keep no impacts of another question, and number slices from 0'}"
        )
    broken = arrays["slice"] % 1.0 != 0.0
    if broken.any():
        raise AnswerError(
            f"impacts.slice{_first_index(broken)} = {arrays['slice'][broken][0]:g} is not a whole number in "
            f"[0, {n_slices - 1}]"
        )
    speeds = {name: np.abs(arrays[name]) for name in ("speed_before", "speed_after")}  # also from velocities
    return Impacts(**arrays | speeds)  # type: ignore[arg-type]


def trajectory_of(ask: Ask, answer: Answer, name: str) -> Trajectory:
    """Return an answer as a Trajectory of method ``name``, for comparison with every other solver.

    ``diagnostics["not_given"]`` names what the solver did not give: inertia then follows from the conserved angular
    momentum, J_0 omega_0 / omega, and r_cm keeps its value at release; neither is shown or compared.
    """
    r_cm, inertia = answer.r_cm, answer.inertia
    if r_cm is None:
        r_cm = np.full(len(answer.t), float(centre_of_mass(ask.scenario, ask.start)))
    if inertia is None:
        turning = np.where(answer.omega == 0.0, ask.scenario.omega0, answer.omega)
        inertia = float(moment_of_inertia(ask.scenario, ask.start)) * ask.scenario.omega0 / turning
    r, v = answer.r, answer.v
    if r is None or v is None:
        r = v = np.empty((0, ask.scenario.n_slices))
    return Trajectory(
        scenario=ask.scenario,
        solver="foreign",
        method=name,
        **{field: getattr(answer, field) for field in (*REQUIRED, "impacts")},
        r=r,
        v=v,
        r_cm=r_cm,
        inertia=inertia,
        settings={"spec": name, "effort": ask.effort},
        diagnostics={"not_given": [field for field in PER_TIME if getattr(answer, field) is None]},
    )


# ---------------------------------------------------------------------- runners


class ForeignError(ValueError):
    """A foreign solver gave no answer; the message says what happened, on one line."""


class LateError(ForeignError):
    """A foreign solver gave no answer within its time."""


class WaitingError(ForeignError):
    """An answer that somebody has to write does not exist yet."""


class Runner:
    """A solver that can be asked, wherever it runs; ``traits`` is what it declares."""

    traits: Traits

    def __call__(self, ask: Ask) -> Answer:
        """Return its checked answer; raise ForeignError if there is none."""
        raise NotImplementedError

    def forgive(self) -> None:
        """Forget late answers but one: those of a search for the last that came in time do not count."""

    def close(self) -> None:
        """End its process, if it has one."""
