"""Known mistakes, planted one at a time in the good solver of ``subject``; each overrides the part that it spoils."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from flipproof.foreign.contract import Ask
from flipproof.foreign.subject import Subject


class Weight(Subject):
    """Eq. 8's gravity is kept: + g cos(theta)."""

    def weight(self, y: Any, omega: float) -> float:
        return float(self.g * np.cos(y[0]))


class NoDrag(Subject):
    """The drag is missing."""

    def drag_on(self, v: Any) -> Any:
        return 0.0 * v

    def drag_of_body(self, v: Any, mass: float) -> float:
        return 0.0


class DragSign(Subject):
    """The drag has the wrong sign."""

    def drag_on(self, v: Any) -> Any:
        return -super().drag_on(v)


class DragHalved(Subject):
    """alpha / 2m stands where alpha / m is meant."""

    def drag_on(self, v: Any) -> Any:
        return super().drag_on(v) / 2


class DragFivePercent(Subject):
    """The drag is 5 % too strong."""

    def drag_on(self, v: Any) -> Any:
        return 1.05 * super().drag_on(v)


class DragOnCentre(Subject):
    """The drag is measured against the centre of mass instead of the tube."""

    def drag_on(self, v: Any) -> Any:
        mean = self.m * v.sum() / (self.m * self.n + self.mb)
        return super().drag_on(v - mean)

    def drag_of_body(self, v: Any, mass: float) -> float:
        return 0.0


class NoReaction(Subject):
    """The tube does not feel the drag of the slices."""

    def drag_of_body(self, v: Any, mass: float) -> float:
        return 0.0


class AboutCentreOfMass(Subject):
    """Slices are thrown away from the centre of mass: the acceleration of the origin is left out."""

    def body(self, r: Any) -> tuple[float, float]:
        return super().body(r)[0], self.centre(r)


class RestingMassForgotten(Subject):
    """Slices that rest on an end do not count as part of the tube."""

    def body(self, r: Any) -> tuple[float, float]:
        return self.mb, self.length / 2


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


class SliceMass(Subject):
    """A slice weighs M_w / (N + 1)."""

    def slice_mass(self, ask: Ask) -> float:
        return ask.scenario.water_mass / (ask.scenario.n_slices + 1)


class RestitutionLow(Subject):
    """The restitution is 10 % too low."""

    def restitution(self, speed: float, side: int) -> float:
        return 0.9 * self.e


class RestitutionOfEnergy(Subject):
    """e is taken for the ratio of energies instead of speeds."""

    def restitution(self, speed: float, side: int) -> float:
        return float(np.sqrt(self.e))


class ElasticCap(Subject):
    """The cap gives back all speed, the base e of it."""

    def restitution(self, speed: float, side: int) -> float:
        return self.e if side > 0 else 1.0


class VelocityThreshold(Subject):
    """Impacts slower than 0.5 m/s do not rebound."""

    def restitution(self, speed: float, side: int) -> float:
        return self.e if speed > 0.5 else 0.0


class GridRebounds(Subject):
    """A rebound waits for the end of the step, and the slice is put on the end."""

    def step(self, y: Any, h: float) -> Any:
        new = self.advance(y, h)
        return self.let_go(new) if not self.struck(new).any() or self.frozen else self.meet(new, self.struck(new))


class NoRecoil(Subject):
    """An impact does not move the tube."""

    def recoil(self) -> float:
        return 0.0


class RecoilSign(Subject):
    """The tube recoils to the wrong side."""

    def recoil(self) -> float:
        return -0.1 / self.mb


class StickForEver(Subject):
    """A slice that rests is never released."""

    def let_go(self, y: Any) -> Any:
        return y


class WallsAtTheEnds(Subject):
    """Slices turn at 0 and L instead of half a slice before."""

    def begin(self, ask: Ask) -> None:
        super().begin(ask)
        self.low, self.high = 0.0, self.length


class Euler(Subject):
    """A step of Euler's method."""

    def advance(self, y: Any, h: float) -> Any:
        return y + h * self.slope(y)


class HalfStep(Subject):
    """Answers are half a step late."""

    def solve(self, ask: Ask) -> Any:
        dt = float(ask.effort or 1e-4)
        times = np.concatenate([[0.0], ask.times[1:] - dt / 2])
        return super().solve(Ask(scenario=ask.scenario, times=times, start=ask.start, effort=ask.effort)) | {
            "t": ask.times
        }


class SinglePrecision(Subject):
    """The state is kept in float32, undeclared."""

    kind = np.float32


class InitialSpin(Subject):
    """theta advances with omega_0."""

    def turning(self, omega: float) -> float:
        return float(self.ask.scenario.omega0)


class Degrees(Subject):
    """theta is answered in degrees."""

    def solve(self, ask: Ask) -> Any:
        found = super().solve(ask)
        return found | {"theta": np.degrees(found["theta"])}


class PositiveSpin(Subject):
    """The direction of the spin is lost."""

    def spin(self, y: Any) -> float:
        return abs(super().spin(y))


class AirDrag(Subject):
    """The flight through the air brakes the spin."""

    def spin(self, y: Any) -> float:
        vx, vy = self.ask.scenario.launch_velocity
        return super().spin(y) * (1 - 1e-3 * float(np.hypot(vx, vy)))


class IceMoves(Subject):
    """Frozen water flows."""

    def begin(self, ask: Ask) -> None:
        super().begin(ask)
        self.frozen = False


class Noise(Subject):
    """Answers carry random noise of 1e-9."""

    def solve(self, ask: Ask) -> Any:
        found = super().solve(ask)
        return found | {"omega": found["omega"] * (1 + 1e-9 * np.random.default_rng().standard_normal(len(ask.times)))}


class LateStart(Subject):
    """The slices begin half a slice too high."""

    def start(self, ask: Ask) -> Any:
        y = super().start(ask)
        y[1 : self.n + 1] -= ask.scenario.slice_height / 2
        return y


MISTAKES: Final[Mapping[str, type[Subject]]] = MappingProxyType(
    {
        kind.__name__: kind
        for kind in (
            Weight, NoDrag, DragSign, DragHalved, DragFivePercent, DragOnCentre, NoReaction, AboutCentreOfMass,
            RestingMassForgotten, LaggedInertia, NoOwnInertia, WrongEpsilon, SliceMass, RestitutionLow,
            RestitutionOfEnergy, ElasticCap, VelocityThreshold, GridRebounds, NoRecoil, RecoilSign, StickForEver,
            WallsAtTheEnds, Euler, HalfStep, SinglePrecision, InitialSpin, Degrees, PositiveSpin, AirDrag, IceMoves,
            Noise, LateStart,
        )
    }
)  # fmt: skip
"""Every planted mistake by name; its docstring says what it is."""
