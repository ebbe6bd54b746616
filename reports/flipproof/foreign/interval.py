"""The interval between two outputs of a solver, and where its equation leads from the state at the first one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np

import ode_reference
from flipproof.foreign.checking import rest_speed_of, scales
from flipproof.foreign.contract import Answer, Ask, Started, begun
from flipproof.foreign.place import switches_of
from slicemodel.observables import moment_of_inertia
from slicemodel.trajectory import BASE, CAP, FloatArray

FIELDS: Final = ("theta", "omega", "r", "v")

FLOOR: Final = 3e-6
"""Departure between two outputs, as a fraction of the field's scale, that is ignored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """The interval between two outputs of a solver, [begin, end] in each array, and where it departs.

    Parameters
    ----------
    number, time : int, float - number of the throw, and when the interval begins [s]
    angle_of_ice : float - theta_0 + omega_0 t of the whole throw in the middle of the interval [rad]
    throw : Started - the throw from the solver's state at its first output
    theta, omega, r, v : arrays, shapes (2,), (2,), (2, N), (2, N) - what the solver answers; SI units
    expected : mapping - by field what the equation gives at the second output
    hits : tuple of (slice, end, time) - impacts in the equation
    speeds : tuple of float - the speed of each before it, relative to the bottle [m/s]
    slowest_rebound : float - the lowest speed after one of a slice that flew, a fraction of omega_0 L, or infinity
    before, after : array, shape (N,) - end on which each slice rests at either output in the equation, or 0
    departure : mapping
        By field the largest difference from ``expected``, a fraction of its scale; for omega, from what the angular
        momentum gives with the solver's own places.
    faint : float - departure of v that another rest speed may cause
    """

    number: int
    time: float
    angle_of_ice: float
    throw: Started
    theta: FloatArray
    omega: FloatArray
    r: FloatArray
    v: FloatArray
    expected: Mapping[str, FloatArray]
    hits: tuple[tuple[int, int, float], ...]
    speeds: tuple[float, ...]
    slowest_rebound: float
    before: FloatArray
    after: FloatArray
    departure: Mapping[str, float]
    faint: float

    @property
    def size(self) -> float:
        """The largest departure of any field beyond what is faint, 0 if none is."""
        room = self.faint if self.hits or self.before.any() or self.after.any() else 0.0
        return max((d for name, d in self.departure.items() if d > room * (name != "theta")), default=0.0)

    @property
    def together(self) -> bool:
        """Whether several slices strike at one instant."""
        times = sorted(time for _, _, time in self.hits)
        return any(b - a < 1e-9 * self.throw.duration for a, b in pairwise(times))

    def strikes(self, end: int) -> bool:
        """Return whether a slice strikes an end."""
        return any(side == end for _, side, _ in self.hits)

    def strikes_beside(self, end: int, resting: int) -> bool:
        """Return whether a slice strikes an end while others rest on ``resting``."""
        others = np.flatnonzero(self.before == resting).tolist()
        return any(side == end and set(others) - {index} for index, side, _ in self.hits)

    def rests(self, end: int) -> bool:
        """Return whether a slice rests on an end at both outputs."""
        return bool(np.any((self.before == end) & (self.after == end)))

    def settles(self, end: int) -> bool:
        """Return whether a slice comes to rest on an end."""
        return bool(np.any((self.before != end) & (self.after == end)))

    def leaves(self, end: int) -> bool:
        """Return whether a slice is let go from an end."""
        return bool(np.any((self.before == end) & (self.after != end)))


def intervals_of(equation: str, number: int, ask: Ask, answer: Answer) -> list[Interval]:
    """Carry on from the state at each output to the next."""
    throw, switches = ask.scenario, switches_of(equation)
    rest_speed = rest_speed_of(switches)
    scale = scales(throw)
    assert answer.r is not None
    assert answer.v is not None
    intervals = []
    for k in range(len(answer.t) - 1):
        rows = slice(k, k + 2)
        r, v = answer.r[rows], answer.v[rows]
        if not all(np.isfinite(x).all() for x in (answer.theta[rows], answer.omega[rows], r, v)):
            break
        places = np.clip(r[0], throw.r_min, throw.r_max)
        theta, omega, span = float(answer.theta[k]), float(answer.omega[k]), float(answer.t[k + 1] - answer.t[k])
        try:
            state = begun(throw, places, theta0=theta, omega0=omega, duration=span)
            flight = ode_reference.solve(state, switches, [0.0, span], rest_speed=rest_speed, speeds=v[0])
        except ValueError:
            break  # a state that is no throw: the answer went wrong long before
        if len(flight.t) < 2 or flight.impacts is None:
            break
        expected = {name: getattr(flight, name)[-1] for name in FIELDS}
        inertia = moment_of_inertia(throw, np.array([places, r[1]]))
        expected["omega"] = answer.omega[k] * inertia[0] / inertia[1]
        scale["theta"] = max(1.0, abs(float(answer.theta[k + 1])))  # digits are relative to the number, not to a radian
        difference = {
            name: np.max(np.abs(getattr(answer, name)[k + 1] - expected[name])) / scale[name] for name in FIELDS
        }
        impacts = flight.impacts
        rebounds = impacts.speed_after[impacts.speed_before > rest_speed]  # a slice at rest strikes with no speed
        intervals.append(
            Interval(
                number=number,
                time=float(answer.t[k]),
                angle_of_ice=throw.theta0 + throw.omega0 * float(answer.t[rows].mean()),
                throw=state,
                theta=answer.theta[rows],
                omega=answer.omega[rows],
                r=r,
                v=v,
                expected=expected,
                hits=tuple(
                    zip(*(getattr(flight.impacts, name).tolist() for name in ("slice", "end", "time")), strict=True)
                ),
                speeds=tuple(flight.impacts.speed_before.tolist()),
                slowest_rebound=float(np.min(rebounds, initial=np.inf) / scale["v"]),
                before=_resting(throw, places, v[0], 2 * rest_speed),
                after=_resting(throw, expected["r"], expected["v"], 0.0),
                departure={name: min(float(value), 1e3) for name, value in difference.items()},  # its square is finite
                faint=3 * rest_speed / scale["v"],
            )
        )
    return intervals


def _resting(throw: Any, r: FloatArray, v: FloatArray, rest_speed: float) -> FloatArray:
    """Return the end on which each slice rests, 0 if on none."""
    still, near = np.abs(v) <= rest_speed, 1e-6 * throw.bottle.length
    return np.where(still & (r >= throw.r_max - near), BASE, np.where(still & (r <= throw.r_min + near), CAP, 0))
