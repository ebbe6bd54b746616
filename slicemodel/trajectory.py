"""What every solver returns: one trajectory on a time grid, with how it was made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from html import escape
from importlib import import_module
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slicemodel.scenario import Scenario, shown

FloatArray = NDArray[np.float64]

BASE: Final = 1
CAP: Final = -1

STATUSES: Final = MappingProxyType(
    {
        "ok": "the run is complete",
        "escaped": "a slice left the bottle; the run goes on as its scheme says",
        "overflow": "a number exceeded the floating-point range; returned up to the last finite point",
        "diverged": "an invariant of the solver broke; returned up to the last point it held",
        "stalled": "time hardly passes; returned up to the last point reached",
        "exhausted": "the greatest number of impacts was reached; returned up to the last point before",
    }
)
"""Reason codes of a trajectory."""

STATES_LIMIT: Final = 4 * 2**30
"""Bytes of r and v together beyond which no run is begun."""


def check_states(n_slices: int, points: int, advice: str) -> None:
    """Raise ValueError, before anything is allocated, if r and v would take more than ``STATES_LIMIT`` bytes.

    Parameters
    ----------
    n_slices : int - of all throws together
    points : int - output times
    advice : str - what to ask for instead
    """
    size, limit = 16 * n_slices * points, STATES_LIMIT
    if size > limit:
        raise ValueError(
            f"n_slices = {n_slices} at {points} output times need {size / 2**30:.1f} GiB (admissible: at most "
            f"{limit / 2**30:.0f} GiB, {limit // (16 * points)} slices); {advice}"
        )


@dataclass(frozen=True, slots=True)
class Impact:
    """One slice striking one end: ``end`` is "base" or "cap"; speeds are relative to the bottle [m/s], >= 0."""

    time: float
    slice: int
    end: str
    speed_before: float
    speed_after: float


IMPACT_FIELDS: Final = (
    ("time", np.float64),
    ("slice", np.int64),
    ("end", np.int64),
    ("speed_before", np.float64),
    ("speed_after", np.float64),
)
"""Names and types of the arrays of ``Impacts``."""


@dataclass(frozen=True, slots=True)
class Impacts:
    """Impacts in order of time, held as arrays of shape (K,); iterating gives ``Impact`` records.

    ``slice`` counts from 0 (the slice that starts on the base); ``end`` is +1 for the base, -1 for the cap.
    """

    time: FloatArray
    slice: NDArray[np.int64]
    end: NDArray[np.int64]
    speed_before: FloatArray
    speed_after: FloatArray

    def __post_init__(self) -> None:
        shape = (len(self.time),)
        for name, kind in IMPACT_FIELDS:
            array = np.array(getattr(self, name), dtype=kind)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
            if array.shape != shape:
                raise ValueError("impact arrays must be one-dimensional and of one length")

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, k: int) -> Impact:
        return Impact(
            float(self.time[k]),
            int(self.slice[k]),
            "base" if self.end[k] == BASE else "cap",
            float(self.speed_before[k]),
            float(self.speed_after[k]),
        )

    def __iter__(self) -> Iterator[Impact]:
        return (self[k] for k in range(len(self)))


NO_IMPACTS: Final = Impacts(np.empty(0), np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty(0))
"""The impacts of water that strikes nothing."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Trajectory:
    """The motion of one throw as one solver sees it. Time is axis 0; arrays are read-only.

    Parameters
    ----------
    scenario : Scenario
    solver : str
        "slicemodel", "ode_reference" or "engine_check".
    method : str
        Scheme, model or engine: "exact-step", "eq8", "pymunk".
    t : (P,) [s], theta : (P,) [rad], omega : (P,) [rad/s]
    r, v : (P, N)
        Position [m] and velocity [m/s] of every slice along the axis, from the cap, relative
        to the bottle. A run stored as "summary" holds shape (0, N).
    r_cm : (P,) [m], inertia : (P,) [kg m^2]
        Centre of mass from the cap; moment of inertia about it.
    impacts : Impacts or None
        None where the solver does not know them (an engine resolves contacts, not impacts).
    status : str
        "ok" or a reason code of ``STATUSES``.
    message : str
        What happened, where and when, in words.
    reason : str
        Code of what ended the run, such as the residual that left its band, or "stiff" for a time that hardly passes
        because a rate of the equations is too fast for the duration; "" where the status says it all.
    settings : mapping
        The exact settings that made this run; enough to repeat it.
    diagnostics : mapping
        What the solver measured of itself: counts, residuals, drifts.

    Raises
    ------
    ValueError
        If shapes disagree, time does not increase, the status is unknown or a value is not finite.
    """

    scenario: Scenario
    solver: str
    method: str
    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    r: FloatArray
    v: FloatArray
    r_cm: FloatArray
    inertia: FloatArray
    impacts: Impacts | None = None
    status: str = "ok"
    message: str = ""
    reason: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    diagnostics: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.status not in STATUSES:
            raise ValueError(f"status = {self.status!r} is unknown; known: {', '.join(STATUSES)}")
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))
        object.__setattr__(self, "diagnostics", MappingProxyType(dict(self.diagnostics)))
        points, n = len(self.t), self.scenario.n_slices
        per_point, per_slice = ((points,),), ((points, n), (0, n))
        for name in ("t", "theta", "omega", "r_cm", "inertia", "r", "v"):
            shapes = per_slice if name in ("r", "v") else per_point
            given = getattr(self, name)
            values = _read_only(given)
            if values is not given:
                object.__setattr__(self, name, values)
            if values.shape not in shapes:
                raise ValueError(f"{name} has shape {values.shape}, not {shapes[0]}")
            if not np.isfinite(values).all():
                raise ValueError(f"{name} holds values that are not finite; return the run up to its last finite point")
        if np.count_nonzero(self.t[1:] > self.t[:-1]) < points - 1:
            raise ValueError("t does not increase")

    def __reduce__(self) -> tuple[Any, ...]:
        # Read-only views of mappings do not pickle; worker processes send trajectories home.
        state = {f.name: getattr(self, f.name) for f in fields(self)}
        return _rebuild, (state | {"settings": dict(self.settings), "diagnostics": dict(self.diagnostics)},)

    @property
    def ok(self) -> bool:
        """True if the run is complete and its slices stayed in the bottle."""
        return self.status == "ok"

    @property
    def label(self) -> str:
        """The method's name, as figures and tables print it."""
        return self.method

    def __repr__(self) -> str:
        points, status = len(self.t), "" if self.ok else f", {self.status}"
        span = f"t = {self.t[0]:g} to {self.t[-1]:g} s" if points else "empty"
        end = f", omega = {self.omega[0]:.4g} to {self.omega[-1]:.4g} rad/s" if points else ""
        return f"<Trajectory {self.label}: {points} points, N = {self.scenario.n_slices}, {span}{end}{status}>"

    def _repr_html_(self) -> str:
        """Return the line of ``repr`` and the first, middle and last row, for a notebook."""
        names = ("t", "theta", "omega", "r_cm", "inertia")
        units = ("s", "rad", "rad/s", "m", "kg m<sup>2</sup>")
        head = "".join(f"<th>{name} [{unit}]</th>" for name, unit in zip(names, units, strict=True))
        rows = sorted({0, len(self.t) // 2, len(self.t) - 1}) if len(self.t) else []
        body = "".join(
            "<tr>" + "".join(f"<td>{getattr(self, name)[k]:.6g}</td>" for name in names) + "</tr>" for k in rows
        )
        return f"<p>{escape(repr(self))}</p><table><tr>{head}</tr>{body}</table>"

    def plot(self, axes: Any = None) -> Any:
        """Draw omega(t) into matplotlib axes, new ones by default, and return them."""
        if axes is None:
            from matplotlib.figure import Figure

            axes = Figure(layout="constrained").subplots()
        axes.plot(self.t, self.omega, label=self.label)
        axes.set_xlabel("t [s]")
        axes.set_ylabel("omega [rad/s]")
        return axes

    def to_pandas(self) -> Any:
        """Return t, theta, omega, r_cm, inertia and, if stored, r_i and v_i as a pandas DataFrame, one row a time.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        columns = {name: getattr(self, name) for name in ("t", "theta", "omega", "r_cm", "inertia")}
        if len(self.r) == len(self.t):
            columns |= {f"{name}_{i}": column for name in ("r", "v") for i, column in enumerate(getattr(self, name).T)}
        frame = _extra("pandas").DataFrame(columns)
        frame.attrs |= {"solver": self.solver, "method": self.method, "status": self.status}
        return frame

    def to_xarray(self) -> Any:
        """Return the run as an xarray Dataset over time and, if stored, slice; every variable carries its unit.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        units = {"theta": "rad", "omega": "rad/s", "r_cm": "m", "inertia": "kg m^2", "r": "m", "v": "m/s"}
        stored = [name for name in units if len(getattr(self, name)) == len(self.t)]
        variables = {
            name: (("t", "slice")[: getattr(self, name).ndim], getattr(self, name), {"units": units[name]})
            for name in stored
        }
        attributes = {"solver": self.solver, "method": self.method, "status": self.status}
        return _extra("xarray").Dataset(variables, coords={"t": ("t", self.t, {"units": "s"})}, attrs=attributes)


def _extra(name: str) -> Any:
    """Import a package that only some users need."""
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise ImportError(f"{name} is not installed; pip install 'flipproof[{name}]'") from None


def _rebuild(state: dict[str, Any]) -> Trajectory:
    return Trajectory(**state)


def _read_only(values: ArrayLike) -> FloatArray:
    """Return ``values`` as a C-contiguous float64 array that cannot be written; copies only if it must."""
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


def times_given(times: ArrayLike) -> FloatArray:
    """Return times as an array of numbers [s], of any shape.

    Raises
    ------
    ValueError
        If they are none.
    """
    try:
        return np.array(times, dtype=np.float64)
    except (ValueError, TypeError):
        raise ValueError(f"times = {shown(times)} is no array of seconds") from None


def output_times(scenario: Scenario, times: ArrayLike | None, default_points: int = 1000) -> FloatArray:
    """Return the output times of a run [s]: ``times`` if given, else uniform points with both ends.

    Raises
    ------
    ValueError
        If they are no numbers, or one is not finite, outside [0, duration], or not larger than the one before.
    """
    if times is None:
        return np.linspace(0.0, scenario.duration, default_points)
    values = times_given(times)
    if values.ndim != 1 or len(values) == 0:
        raise ValueError(f"times has shape {values.shape}; a non-empty one-dimensional list of seconds is needed")
    outside = ~((values >= 0.0) & (values <= scenario.duration))
    if outside.any():
        raise ValueError(
            f"times = {float(values[outside][0])!r} s is outside [0, {scenario.duration:g}] s (the duration)"
        )
    unordered = np.flatnonzero(~(np.diff(values) > 0))
    if unordered.size:
        k = int(unordered[0])
        raise ValueError(
            f"times must increase: times[{k + 1}] = {float(values[k + 1])!r} s follows {float(values[k])!r} s"
        )
    return values
