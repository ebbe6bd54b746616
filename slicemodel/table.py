r"""What a landing is made of: the table, the touch that a solver is given, and the outcome that it returns.

        \ u_r           The flight ends in the touch: the lowest rim of the bottle is at the height of the table.
   cap   o              A landing solver is given the touch and the table and nothing else, so that two solvers
          \             start from the same numbers. theta, omega, r and r' are those of a trajectory; the velocity
           o  centre    is that of the middle of the tube, r = L/2.
   rim  +--/
===========*=========   table
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from slicemodel.scenario import Scenario, ScenarioError, _Checks, shown, unknown_name
from slicemodel.trajectory import FloatArray

MAX_VALUE: Final = 1e15
"""Size of a number at the most, in SI units, as in a scenario."""

OUTCOMES: Final = MappingProxyType(
    {
        "upright": "the bottle stands on its base",
        "lying": "the bottle lies on its side",
        "cap": "the bottle stands on its cap",
        "undecided": "no outcome could be certified; the reason says why",
    }
)
"""How a landing can end."""

LAWS: Final = MappingProxyType(
    {
        "together": "bottle and water that touch at one instant share one impact (Newton)",
        "in-turn": "the bottle strikes the table first, without its water; then the water strikes the bottle, which "
        "the table holds",
    }
)
"""Laws of an impact on the table while water rests in the bottle."""

ENERGY_RISE: Final = 1e-6
"""Rise of the energy in an impact above which a landing is not certified [E_s]."""

LONGEST_LANDING: Final = 5.0
"""Time after the touch within which a landing must be certain [s]; decided ones take 0.2 to 0.5 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A rigid horizontal table. No measured restitution or friction of a bottle on a table was found: both are assumed.

    Parameters
    ----------
    height : float
        Over the place of the cap at release [m].
    restitution : float
        e_table, of a rim and the table, in [0, 1].
    friction : float
        Coulomb's coefficient of a rim on the table [1], >= 0.

    Raises
    ------
    ScenarioError
        Naming every field that no table can have, its value and the admissible range.
    """

    height: float
    restitution: float = 0.3
    friction: float = 0.4

    def __post_init__(self) -> None:
        checks = _Checks("table.")
        values = {
            "height": checks.number("height", self.height, "m", minimum=-MAX_VALUE, maximum=MAX_VALUE),
            "restitution": checks.number("restitution", self.restitution, "", minimum=0.0, maximum=1.0),
            "friction": checks.number("friction", self.friction, "", minimum=0.0, maximum=MAX_VALUE),
        }
        checks.refuse()
        for name, value in values.items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Touch:
    """The bottle at the moment at which its lowest rim touches the table: all that a landing solver is given.

    Parameters
    ----------
    scenario : Scenario
        Bottle, water, drag, restitution of the water, gravity and ice; the throw itself plays no part any more.
    theta : float [rad], omega : float [rad/s]
    velocity : (v_x, v_y) - of the middle of the tube in the lab [m/s]
    r : array, shape (N,) - slices from the cap [m]
    v : array, shape (N,) - their velocities in the bottle [m/s], positive towards the base
    time : float - from release [s]

    Raises
    ------
    ScenarioError
        Naming every field that is not finite or has the wrong shape, a slice outside the bottle, ice that moves, or a
        gravity of 0, without which nothing lands.
    """

    scenario: Scenario
    theta: float
    omega: float
    velocity: tuple[float, float]
    r: FloatArray
    v: FloatArray
    time: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.scenario, Scenario):
            raise ScenarioError(f"touch.scenario = {self.scenario!r} is not a Scenario")
        checks = _Checks("touch.")
        numbers = {
            "theta": checks.number("theta", self.theta, "rad", minimum=-MAX_VALUE, maximum=MAX_VALUE),
            "omega": checks.number("omega", self.omega, "rad/s", minimum=-MAX_VALUE, maximum=MAX_VALUE),
            "time": checks.number("time", self.time, "s", minimum=-MAX_VALUE, maximum=MAX_VALUE),
            "velocity": checks.pair("velocity", self.velocity, "m/s", maximum=MAX_VALUE),
        }
        checks.number("scenario.gravity", self.scenario.gravity, "m/s^2", minimum=1.0 / MAX_VALUE, maximum=MAX_VALUE)
        length = self.scenario.bottle.length
        arrays = {name: _each_slice(checks, name, getattr(self, name), self.scenario.n_slices) for name in ("r", "v")}
        if not checks.problems:
            outside = np.flatnonzero((arrays["r"] < 0.0) | (arrays["r"] > length))
            for k in outside[:1].tolist():
                checks.problems.append(f"touch.r[{k}] = {float(arrays['r'][k])!r} m is outside [0, {length:g}]")
            if self.scenario.frozen and arrays["v"].any():
                checks.problems.append("touch.v is not 0 everywhere although the scenario is frozen")
        checks.refuse()
        for key, value in (numbers | arrays).items():
            object.__setattr__(self, key, value)

    @property
    def tilt(self) -> float:
        """Return the angle from upright, theta modulo 2 pi, in [-pi, pi] [rad]."""
        return math.remainder(self.theta, math.tau)

    def twins(self, shift: float) -> tuple[Touch, ...]:
        """Return four touches beside this one, by which a landing says whether it is near an edge between outcomes.

        The spin of two is larger and smaller by the share ``shift``, all other velocities of the other two; the tilt
        of each differs by ``shift`` / 20 [rad], so that a bottle at rest has twins, too.
        """
        side = math.copysign(shift / 20, self.tilt)
        return tuple(
            replace(
                self,
                theta=self.theta + tilt * side,
                omega=self.omega * (1 + spin * shift),
                velocity=(self.velocity[0] * (1 + speed * shift), self.velocity[1] * (1 + speed * shift)),
                v=self.v * (1 + speed * shift),
            )
            for spin, speed, tilt in ((1, 0, 1), (-1, 0, -1), (0, 1, -1), (0, -1, 1))
        )


def _each_slice(checks: _Checks, name: str, value: object, n: int) -> FloatArray:
    """Return ``value`` as a read-only array of ``n`` finite numbers, else note why not."""
    try:
        values = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        checks.problems.append(f"{checks.where}{name} = {shown(value)} is not an array of numbers")
        return np.zeros(n)
    if values.shape != (n,):
        checks.problems.append(f"{checks.where}{name} has shape {values.shape}, not {(n,)}")
    elif not np.isfinite(values).all():
        k = int(np.flatnonzero(~np.isfinite(values))[0])
        checks.problems.append(f"{checks.where}{name}[{k}] = {values[k]!r} is not finite")
    values.setflags(write=False)
    return values


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a landing ends, and why that is certain.

    The saddle E_s = M g sqrt(R^2 + z_rest^2) is the least energy over the table with which a bottle can get from its
    base to its side or back, z_rest being the height of the centre of mass over the base while the water rests on it.
    Once the energy is below it no passive law can change the outcome. Ice on the cap has its weight high: there the
    saddle is that of the cap, M g sqrt(R^2 + (L - z_rest)^2).

    Parameters
    ----------
    outcome : str
        A name in ``OUTCOMES``.
    certified : float or None
        When the energy was below the saddle, from the touch [s]; None if undecided.
    margin : float or None
        (E_s - E) / E_s at that moment [1], > 0.
    bounces : int
        How often the bottle came down on the table again after all of it had been more than 1 mm above.
    slid : float or None
        How far the middle of the base was from its place at the touch, along the table, when certified [m].
    reason : str
        Why the outcome is undecided; empty if it is certified.
    solver, method : str
        "ode_reference" or "engine_check", and what it solved.
    settings, diagnostics : mapping
        What repeats the run, and what it measured of itself; ``energy_rise`` is the largest rise in an impact [E_s].

    Raises
    ------
    ValueError
        If the outcome is unknown, or certified without a time and a margin, or undecided without a reason.
    """

    outcome: str
    certified: float | None = None
    margin: float | None = None
    bounces: int = 0
    slid: float | None = None
    reason: str = ""
    solver: str
    method: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    diagnostics: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.outcome not in OUTCOMES:
            raise ValueError(unknown_name("outcome =", self.outcome, OUTCOMES))
        if self.outcome == "undecided":
            if not self.reason:
                raise ValueError("reason is empty although the outcome is undecided")
        elif self.certified is None or self.margin is None or not self.margin > 0.0:
            raise ValueError(
                f"margin = {self.margin!r} at {self.certified!r} s does not certify an outcome (admissible: (0, inf))"
            )
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))
        object.__setattr__(self, "diagnostics", MappingProxyType(dict(self.diagnostics)))

    def __reduce__(self) -> tuple[Any, ...]:
        # Read-only views of mappings do not pickle; worker processes send outcomes home.
        names = ("outcome", "certified", "margin", "bounces", "slid", "reason", "solver", "method")
        state = {name: getattr(self, name) for name in names}
        return _rebuild, (state | {"settings": dict(self.settings), "diagnostics": dict(self.diagnostics)},)

    @property
    def decided(self) -> bool:
        """True if the outcome is certified."""
        return self.outcome != "undecided"


def _rebuild(state: dict[str, Any]) -> Outcome:
    return Outcome(**state)
