"""One throw of the study, from its release to its outcome: what a worker makes and a row holds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np

from flipproof.sweep.work import Row, Throw, scenario_of
from ode_reference.landing.flight import NotReachedError
from slicemodel import Outcome, Scenario, Table, Touch
from slicemodel.observables import centre_of_mass, centre_of_mass_at_rest, toppling_angle
from slicemodel.scenario import ScenarioError

READ: Final = ("touch_time", "touch_theta", "touch_omega", "touch_speed", "touch_energy", "static_margin")
MAKER: Final = "flipproof.chapters.landing.work:make_landings"
"""What makes the rows of landings."""

REFERENCE: Final = "ode_reference"
"""The program that lands event by event; every other name is an engine's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Landed:
    """What became of a throw. A number that is not known is None, and ``reason`` says why.

    Parameters
    ----------
    outcome : str or None - a key of ``slicemodel.table.OUTCOMES``
    touch_time [s], touch_theta [rad], touch_omega [rad/s] : float or None
    touch_speed : float or None - of the centre of mass, downwards [m/s]
    touch_energy : float or None - over the table, share of the saddle E_s [1]
    static_margin : float or None - toppling angle of the water as it is at the touch, minus |tilt| [rad] (Eq. 13a)
    certified [s], margin [E_s], slid [m], bounces : as of ``slicemodel.Outcome``
    status : a key of ``flipproof.sweep.work.OUTCOMES``
    """

    outcome: str | None = None
    touch_time: float | None = None
    touch_theta: float | None = None
    touch_omega: float | None = None
    touch_speed: float | None = None
    touch_energy: float | None = None
    static_margin: float | None = None
    certified: float | None = None
    margin: float | None = None
    slid: float | None = None
    bounces: int | None = None
    status: str
    message: str = ""
    reason: str = ""

    @property
    def whole(self) -> bool:
        """True if it is known how the throw ended."""
        return self.outcome not in (None, "undecided") or self.status == "missed"


def make_landings(program: str, settings: Mapping[str, Any], throws: Sequence[Throw]) -> list[Row]:
    """Return the rows of landings: ``LANDING``, status, message and reason."""
    return [asdict(make_landing(program, settings, throw)) for throw in throws]


def make_landing(program: str, settings: Mapping[str, Any], throw: Throw) -> Landed:
    """Throw and land one bottle; whatever goes wrong becomes its status and reason."""
    scenario = scenario_of(throw)
    if isinstance(scenario, dict):
        return Landed(**scenario)
    try:
        table = Table(height=settings["height"], restitution=settings["restitution"], friction=settings["friction"])
    except ScenarioError as error:
        return Landed(status="impossible", reason=str(error))
    try:
        touch = flown(scenario, table.height)
    except NotReachedError as error:
        return Landed(status="missed", reason=str(error))
    except Exception as error:
        return Landed(status="failed", reason=f"{type(error).__name__}: {error}")
    try:
        outcome = landed(touch, table, program, settings["law"])
    except Exception as error:
        return Landed(status="failed", reason=f"{type(error).__name__}: {error}")
    read = {name: getattr(outcome, name) for name in ("outcome", "certified", "margin", "slid", "bounces")}
    status = "ok" if outcome.decided else "undecided"
    return Landed(status=status, reason=outcome.reason, **touch_readings(touch), **read)


@lru_cache(maxsize=1024)
def flown(scenario: Scenario, height: float) -> Touch:
    """Return the touch of a throw; laws and tables meet the same throwers, whose flights they share."""
    import ode_reference

    return ode_reference.fly(scenario, Table(height=height))


def landed(touch: Touch, table: Table, program: str, law: str | None) -> Outcome:
    """Return the outcome by one program; ice is asked for no law, and an engine for the slices that it has."""
    law = None if touch.scenario.frozen else law
    if program == REFERENCE:
        import ode_reference

        return ode_reference.land(touch, table, law)
    import engine_check

    return engine_check.land(touch, table, program, law=law)


def saddle(scenario: Scenario) -> float:
    """Return E_s = M g sqrt(R^2 + z_rest^2) [J]."""
    z_rest = scenario.bottle.length - centre_of_mass_at_rest(scenario)
    return scenario.total_mass * scenario.gravity * math.hypot(scenario.bottle.radius, z_rest)


def touch_readings(touch: Touch) -> dict[str, Any]:
    """Return what a row holds of a touch: the energy is that of bottle and point slices, over the table."""
    scenario, bottle = touch.scenario, touch.scenario.bottle
    r_cm = float(centre_of_mass(scenario, touch.r))
    sine, cosine = math.sin(touch.theta), math.cos(touch.theta)
    (v_x, v_y), half = touch.velocity, bottle.length / 2
    middle = half * abs(cosine) + bottle.radius * abs(sine)
    along, across = v_x * sine - v_y * cosine, v_x * cosine + v_y * sine
    s = touch.r - half
    water_along, water_across = along + touch.v, across + touch.omega * s
    kinetic = bottle.mass * (along**2 + across**2 + touch.omega**2 * (bottle.radius**2 / 2 + bottle.length**2 / 12)) / 2
    kinetic += scenario.slice_mass * float(np.sum(water_along**2 + water_across**2)) / 2
    height = middle - (r_cm - half) * cosine
    down = (bottle.mass * v_y + scenario.slice_mass * float(np.sum(water_across * sine - water_along * cosine))) / -(
        scenario.total_mass
    )
    energy = (kinetic + scenario.total_mass * scenario.gravity * height) / saddle(scenario)
    margin = float(toppling_angle(scenario, r_cm)) - abs(touch.tilt)
    return dict(zip(READ, (touch.time, touch.theta, touch.omega, down, energy, margin), strict=True))
