"""Known mistakes, planted one at a time in the good solver of ``subject``; each overrides the part that it spoils."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from flipproof.foreign.contract import Ask
from planted.subject import Subject


def _spoiled(name: str, words: str, **parts: Any) -> Any:
    """Return the solver with other ``parts``, each a function of the solver and what the part is given."""
    return type(name, (Subject,), {"__doc__": words, **parts})


class LaggedInertia(Subject):
    """J and omega are those of the step before."""

    def begin(self, ask: Ask) -> None:
        super().begin(ask)
        self.before = ask.scenario.omega0

    def spin(self, y: Any) -> float:
        return self.before

    def step(self, y: Any, h: float) -> Any:
        new = super().step(y, h)
        self.before = Subject.spin(self, y)
        return new


class NoOwnInertia(Subject):
    """The radius of the bottle is left out of its moment of inertia."""

    def begin(self, ask: Ask) -> None:
        super().begin(ask)
        bottle = ask.scenario.bottle
        self.own_inertia = bottle.mass * bottle.length**2 / 12
        self.momentum = self.inertia(np.array(ask.start)) * ask.scenario.omega0


class WrongEpsilon(Subject):
    """The centre of mass is that of Eq. 4b with rho pi R^2 L for the capacity: the bottle weighs 0.71 of its mass."""

    def centre(self, r: Any) -> float:
        light = 0.71 * self.mb
        return float((self.m * r.sum() + light * self.length / 2) / (self.m * self.n + light))


class WallsAtTheEnds(Subject):
    """Slices turn at 0 and L instead of half a slice before."""

    def begin(self, ask: Ask) -> None:
        super().begin(ask)
        self.low, self.high = 0.0, self.length


class HalfStep(Subject):
    """Answers are half a step late."""

    def solve(self, ask: Ask) -> Any:
        times = np.concatenate([[0.0], ask.times[1:] - float(ask.effort or 1e-4) / 2])
        late = Ask(scenario=ask.scenario, times=times, start=ask.start, effort=ask.effort)
        return super().solve(late) | {"t": ask.times}


class IceMoves(Subject):
    """Frozen water flows."""

    def begin(self, ask: Ask) -> None:
        super().begin(ask)
        self.frozen = False


class LateStart(Subject):
    """The slices begin half a slice too high."""

    def start(self, ask: Ask) -> Any:
        y = super().start(ask)
        y[1 : self.n + 1] -= ask.scenario.slice_height / 2
        return y


def _on_the_grid(subject: Any, y: Any, h: float) -> Any:
    new = subject.advance(y, h)
    struck = subject.struck(new)
    return subject.let_go(new) if not struck.any() or subject.frozen else subject.meet(new, struck)


def _in_degrees(subject: Any, ask: Ask) -> Any:
    found = Subject.solve(subject, ask)
    return found | {"theta": np.degrees(found["theta"])}


def _noisy(subject: Any, ask: Ask) -> Any:
    found = Subject.solve(subject, ask)
    return found | {"omega": found["omega"] * (1 + 1e-9 * np.random.default_rng().standard_normal(len(ask.times)))}


_KINDS: Final = (
    _spoiled("Weight", "Eq. 8's gravity is kept: + g cos(theta).", weight=lambda s, y, _: float(s.g * np.cos(y[0]))),
    _spoiled("NoDrag", "The drag is missing.", drag_on=lambda _, v: 0.0 * v, drag_of_body=lambda *_: 0.0),
    _spoiled("DragSign", "The drag has the wrong sign.", drag_on=lambda s, v: -Subject.drag_on(s, v)),
    _spoiled(
        "DragHalved", "alpha / 2m stands where alpha / m is meant.", drag_on=lambda s, v: Subject.drag_on(s, v) / 2
    ),
    _spoiled("DragFivePercent", "The drag is 5 % too strong.", drag_on=lambda s, v: 1.05 * Subject.drag_on(s, v)),
    _spoiled(
        "DragOnCentre",
        "The drag is measured against the centre of mass instead of the tube.",
        drag_on=lambda s, v: Subject.drag_on(s, v - s.m * v.sum() / (s.m * s.n + s.mb)),
        drag_of_body=lambda *_: 0.0,
    ),
    _spoiled("NoReaction", "The tube does not feel the drag of the slices.", drag_of_body=lambda *_: 0.0),
    _spoiled(
        "AboutCentreOfMass",
        "Slices are thrown away from the centre of mass: the acceleration of the origin is left out.",
        body=lambda s, r: (Subject.body(s, r)[0], s.centre(r)),
    ),
    _spoiled(
        "RestingMassForgotten",
        "Slices that rest on an end do not count as part of the tube.",
        body=lambda s, _: (s.mb, s.length / 2),
    ),
    LaggedInertia,
    NoOwnInertia,
    WrongEpsilon,
    _spoiled(
        "SliceMass",
        "A slice weighs M_w / (N + 1).",
        slice_mass=lambda _, ask: ask.scenario.water_mass / (ask.scenario.n_slices + 1),
    ),
    _spoiled("RestitutionLow", "The restitution is 10 % too low.", restitution=lambda s, *_: 0.9 * s.e),
    _spoiled(
        "RestitutionOfEnergy",
        "e is taken for the ratio of energies instead of speeds.",
        restitution=lambda s, *_: float(np.sqrt(s.e)),
    ),
    _spoiled(
        "ElasticCap",
        "The cap gives back all speed, the base e of it.",
        restitution=lambda s, _, side: s.e if side > 0 else 1.0,
    ),
    _spoiled(
        "VelocityThreshold",
        "Impacts slower than 0.5 m/s do not rebound.",
        restitution=lambda s, speed, _: s.e if speed > 0.5 else 0.0,
    ),
    _spoiled(
        "GridRebounds", "A rebound waits for the end of the step, and the slice is put on the end.", step=_on_the_grid
    ),
    _spoiled("NoRecoil", "An impact does not move the tube.", recoil=lambda _: 0.0),
    _spoiled("RecoilSign", "The tube recoils to the wrong side.", recoil=lambda s: -0.1 / s.mb),
    _spoiled("StickForEver", "A slice that rests is never released.", let_go=lambda _, y: y),
    WallsAtTheEnds,
    _spoiled("Euler", "A step of Euler's method.", advance=lambda s, y, h: y + h * s.slope(y)),
    HalfStep,
    _spoiled("SinglePrecision", "The state is kept in float32, undeclared.", kind=np.float32),
    _spoiled("InitialSpin", "theta advances with omega_0.", turning=lambda s, _: float(s.ask.scenario.omega0)),
    _spoiled("Degrees", "theta is answered in degrees.", solve=_in_degrees),
    _spoiled("PositiveSpin", "The direction of the spin is lost.", spin=lambda s, y: abs(Subject.spin(s, y))),
    _spoiled(
        "AirDrag",
        "The flight through the air brakes the spin.",
        spin=lambda s, y: Subject.spin(s, y) * (1 - 1e-3 * float(np.hypot(*s.ask.scenario.launch_velocity))),
    ),
    IceMoves,
    _spoiled("Noise", "Answers carry random noise of 1e-9.", solve=_noisy),
    LateStart,
)

MISTAKES: Final[Mapping[str, type[Subject]]] = MappingProxyType({kind.__name__: kind for kind in _KINDS})
"""Every planted mistake by name; its docstring says what it is."""
