"""What a foreign solver answers: whatever it gave, checked field by field, as arrays that can be compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from flipproof.foreign.contract import Ask, Traits
from slicemodel.observables import centre_of_mass, moment_of_inertia
from slicemodel.scenario import shown
from slicemodel.trajectory import IMPACT_FIELDS, FloatArray, Impacts, Trajectory

REQUIRED: Final = ("t", "theta", "omega")
PER_TIME: Final = ("r_cm", "inertia")
PER_SLICE: Final = ("r", "v")
IMPACT: Final = tuple(name for name, _ in IMPACT_FIELDS)


class AnswerError(ValueError):
    """What a solver returned is no answer; the message names the field, what came and what is needed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What a solver answered, checked: arrays of float64, finite, at the times asked.

    ``t`` [s], ``theta`` [rad], ``omega`` [rad/s], ``r_cm`` [m], ``inertia`` [kg m^2] have shape (P,), ``r`` [m] and
    ``v`` [m/s] (P, N). What the solver did not give is None; r_cm and inertia follow from r by their definitions.
    """

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    r_cm: FloatArray | None = None
    inertia: FloatArray | None = None
    r: FloatArray | None = None
    v: FloatArray | None = None
    impacts: Impacts | None = None

    @property
    def given(self) -> tuple[str, ...]:
        """Names of the fields that there are."""
        return tuple(name for name in self.__slots__ if getattr(self, name) is not None)


def answer_of(ask: Ask, given: object, *, own_times: bool = False) -> Answer:
    """Return what a solver gave as a checked answer.

    Parameters
    ----------
    ask : Ask
    given : mapping, Trajectory or any object with the fields of ``Answer`` as attributes
    own_times : bool - True for what was made before it was asked, such as a file: its times need only increase

    Raises
    ------
    AnswerError
        Naming the field, what came and what is needed.
    """
    if isinstance(given, Trajectory) and not given.ok:
        raise AnswerError(f"status = {given.status!r}: {given.message}")
    names = (*REQUIRED, *PER_TIME, *PER_SLICE, "impacts")
    fields = {name: value for name in names if (value := _field(given, name)) is not None}
    missing = [name for name in REQUIRED if name not in fields]
    if missing:
        kind = "" if isinstance(given, Mapping) else f" (a {type(given).__name__} came)"
        raise AnswerError(f"{' and '.join(missing)} missing{kind}; t, theta and omega are needed")
    points = _length("t", fields["t"]) if own_times else len(ask.times)
    shapes: dict[str, tuple[int, ...]] = {name: (points,) for name in (*REQUIRED, *PER_TIME)}
    shapes |= {name: (points, ask.scenario.n_slices) for name in PER_SLICE}
    if isinstance(given, Trajectory) and len(given.r) != len(given.t):
        fields = {name: value for name, value in fields.items() if name not in PER_SLICE}
    arrays = {name: numbers_of(name, fields[name], shape) for name, shape in shapes.items() if name in fields}
    t = arrays["t"]
    if own_times:
        if not np.all(np.diff(t) > 0):
            raise AnswerError("t does not increase")
    elif points and float(np.max(np.abs(t - ask.times))) > 1e-6 * ask.scenario.duration:
        k = int(np.argmax(np.abs(t - ask.times)))
        raise AnswerError(f"t[{k}] = {t[k]:.9g} s, asked was {ask.times[k]:.9g} s; answer at the times asked")
    if "r" in arrays:
        arrays.setdefault("r_cm", centre_of_mass(ask.scenario, arrays["r"]))
        arrays.setdefault("inertia", moment_of_inertia(ask.scenario, arrays["r"]))
    impacts = _impacts_of(fields["impacts"], ask.scenario.n_slices) if "impacts" in fields else None
    return Answer(**arrays, impacts=impacts)


def _field(given: object, name: str) -> Any:
    """Return what a mapping has under a name, or an object as an attribute; None if nothing."""
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
        words = {"c": "complex numbers", "U": "text", "S": "text", "O": "objects", "b": "truth values"}
        kind = words.get(array.dtype.kind, str(array.dtype))
        raise AnswerError(f"{name} holds {kind}; real numbers are needed")
    array = np.ascontiguousarray(array, dtype=np.float64)
    if not np.isfinite(array).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise AnswerError(f"{name}[{', '.join(map(str, where))}] = {array[where]} is not finite")
    return array


def _length(name: str, value: object, needed: int | None = None) -> int:
    """Return the length of a one-dimensional field, before anything of its size is copied."""
    if isinstance(value, (str, bytes)):
        raise AnswerError(f"{name} = {shown(value)} is not an array of numbers")
    shape = getattr(value, "shape", None)
    if shape is None:
        try:
            shape = (len(value),)  # type: ignore[arg-type]
        except TypeError:
            raise AnswerError(f"{name} is a {type(value).__name__}, not an array of numbers") from None
    if len(shape) != 1 or (needed is not None and shape[0] != needed):
        raise AnswerError(f"{name} has shape {tuple(shape)}, not ({'P' if needed is None else needed},)")
    return int(shape[0])


def _impacts_of(given: object, n_slices: int) -> Impacts:
    """Return impacts given as ``Impacts``, as a mapping of arrays, or as rows of its five fields."""
    if not isinstance(given, (Impacts, Mapping)):
        try:
            rows = [tuple(row[name] for name in IMPACT) if isinstance(row, Mapping) else tuple(row) for row in given]  # type: ignore[attr-defined]
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
        raise AnswerError(f"impacts.slice leaves [0, {n_slices - 1}]")
    return Impacts(**arrays)  # type: ignore[arg-type]


def trajectory_of(ask: Ask, answer: Answer, traits: Traits) -> Trajectory:
    """Return an answer as a Trajectory of method ``traits.name``, for comparison with every other solver.

    ``diagnostics["not_given"]`` names what the solver did not give: inertia is then what the conserved angular momentum
    implies, J_0 omega_0 / omega, and r_cm what it was at release; neither is shown or compared.
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
        method=traits.name,
        **{name: getattr(answer, name) for name in (*REQUIRED, "impacts")},
        r=r,
        v=v,
        r_cm=r_cm,
        inertia=inertia,
        settings={"spec": traits.name, "effort": ask.effort, **ask.options},
        diagnostics={"not_given": [name for name in PER_TIME if getattr(answer, name) is None]},
    )
