r"""One bottle and its water as the equations of motion see them: constants, a model, the right-hand side it makes.

    cap                              C_M                                   base
    r = 0                           r = r_CM                              r = L
     |-----------------------o------- + -------o-------o-----------------o|   --> u_r, theta from the
     |                       |<- -s_j |  s_i ->|                          |       downward vertical
                       thrown to the cap   thrown to the base

s_i = r_i - r_CM is positive on the base side. The whole bottle turns about C_M with

    theta' = omega = J_0 omega_0 / J(r),                                  (conservation of angular momentum)
    J = m sum s_i^2 + M_b (R^2/2 + L^2/12 + (L/2 - r_CM)^2),              (Eq. 11b, 11c)
    r_CM = (m sum r_i + M_b L/2) / (M_w + M_b),                           (Eq. 10 with Eq. 4a)

so that omega is not a state of its own: axial motion carries no angular momentum about an axis through C_M. A slice
that rests on an end is *held*: r' = 0. It still counts in J, r_CM and r'_CM. How a free slice accelerates is the
business of ``ode_reference.models``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ode_reference.switches import Switches
from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray

BoolArray = NDArray[np.bool_]

PUBLISHED: Final = Switches()


@dataclass(frozen=True, slots=True)
class Throw:
    """The constants of one scenario that the right-hand sides need, computed once.

    Parameters
    ----------
    slice_mass, bottle_mass, total_mass : float [kg]
    half_length : float - L/2 [m]
    bottle_inertia : float - of the empty bottle about its own centre, Eq. 11a [kg m^2]
    angular_momentum : float - J_0 omega_0 [kg m^2/s]
    gravity : float [m/s^2]
    drag_rate : float - alpha / m = 2 gamma [1/s]
    ones : array, shape (N,) - a sum as a dot product costs half of ``ndarray.sum``
    """

    slice_mass: float
    bottle_mass: float
    total_mass: float
    half_length: float
    bottle_inertia: float
    angular_momentum: float
    gravity: float
    drag_rate: float
    ones: FloatArray

    @classmethod
    def of(cls, scenario: Scenario) -> Throw:
        """Return the constants of ``scenario``, its slices where Eq. 3a puts them at release."""
        bottle = scenario.bottle
        # The angular momentum needs J_0, which the other constants define: made in two steps.
        at_rest = cls(
            slice_mass=scenario.water_mass / scenario.n_slices,
            bottle_mass=bottle.mass,
            total_mass=bottle.mass + scenario.water_mass,
            half_length=bottle.length / 2,
            bottle_inertia=bottle.mass * (bottle.radius * bottle.radius / 2 + bottle.length * bottle.length / 12),
            angular_momentum=0.0,
            gravity=scenario.gravity,
            drag_rate=scenario.drag * scenario.n_slices / scenario.water_mass,
            ones=np.ones(scenario.n_slices),
        )
        _, _, inertia = at_rest.about_centre_of_mass(scenario.initial_positions())
        # A NumPy float divides by zero to inf, where Python raises: overflow becomes a status, not an exception.
        constants = {name: getattr(at_rest, name) for name in cls.__slots__}
        return cls(**{**constants, "angular_momentum": np.float64(inertia * scenario.omega0)})

    def about_centre_of_mass(self, r: FloatArray) -> tuple[float, FloatArray, float]:
        """Return r_CM [m], s = r - r_CM (shape (N,)) [m] and J [kg m^2] (Eq. 10, 11b, 11c) for ``r``, shape (N,)."""
        r_cm = (self.slice_mass * float(r.dot(self.ones)) + self.bottle_mass * self.half_length) / self.total_mass
        s = r - r_cm
        off_centre = self.half_length - r_cm
        inertia = self.slice_mass * float(s.dot(s)) + self.bottle_inertia + self.bottle_mass * off_centre * off_centre
        return r_cm, s, inertia

    def centre_of_mass_velocity(self, v: FloatArray) -> float:
        """Return r'_CM [m/s], the derivative of Eq. 10, for slice velocities ``v`` of shape (N,)."""
        return self.slice_mass * float(v.dot(self.ones)) / self.total_mass


Acceleration = Callable[[Throw, float, float, FloatArray, FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, slots=True)
class Model:
    """One equation of motion along the axis, with its impact law.

    Parameters
    ----------
    name : str
    equation : str - in one line, as tables print it
    reason : str - why this equation is here
    acceleration : callable (throw, theta, omega, s, v, free) -> new array of floats, shape (N,) [m/s^2]
        For a free slice r_i''; for a held slice the acceleration relative to the bottle at which contact and
        drag apart it would leave its end: m times it is what the end presses back with. Its sign decides rest and
        release: a slice rests on the base while it is >= 0, on the cap while it is <= 0. ``s`` and ``v`` have shape
        (N,) [m], [m/s]; ``free`` (N,) is 1.0 where a slice is free and 0.0 where it rests and moves with the tube.
    switches : Switches - what the equation gets right; ``recoil`` of it chooses the impacts
    """

    name: str
    equation: str
    reason: str
    acceleration: Acceleration
    switches: Switches = PUBLISHED


def accelerated(
    model: Model, throw: Throw, theta: float, r: FloatArray, v: FloatArray, free: FloatArray
) -> tuple[float, FloatArray]:
    """Return omega [rad/s] and a model's acceleration of every slice, free (1.0) or held, shape (N,) [m/s^2].

    Raises
    ------
    ValueError
        If the model returns anything but N real numbers, or writes to what it is given.
    """
    _, s, inertia = throw.about_centre_of_mass(r)
    omega = throw.angular_momentum / inertia
    v = v.view()
    v.flags.writeable = s.flags.writeable = False  # a right-hand side in place would change the integrator's state
    a = model.acceleration(throw, theta, omega, s, v, free)
    if not (isinstance(a, np.ndarray) and a.shape == r.shape and a.dtype.kind == "f"):
        words = f"an array {a.shape} of {a.dtype}" if isinstance(a, np.ndarray) else repr(a)
        raise ValueError(f"model = {model.name!r}: its acceleration is {words}, must be an array {r.shape} of floats")
    return omega, a


class Motion:
    """The right-hand side of a segment: one model, one throw, and the slices that are held at present.

    Parameters
    ----------
    throw : Throw
    model : Model
    held : array, shape (N,) of bool - slices that do not move. Changed by ``hold``, and only between two segments:
        within one the right-hand side must be smooth.
    """

    __slots__ = ("evaluations", "free", "held", "model", "n", "throw")

    def __init__(self, throw: Throw, model: Model, held: BoolArray) -> None:
        self.throw = throw
        self.model = model
        self.n = len(held)
        self.evaluations = 0
        self.hold(held)

    def hold(self, held: BoolArray) -> None:
        """Let these slices be held from now on, and no others."""
        self.held = held
        self.free = np.where(held, 0.0, 1.0)

    def acceleration(self, y: FloatArray, free: FloatArray) -> tuple[float, FloatArray]:
        """Return omega [rad/s] and the model's acceleration of every slice, free (1.0) or held, shape (N,) [m/s^2]."""
        self.evaluations += 1
        return accelerated(self.model, self.throw, float(y[0]), y[1 : self.n + 1], y[self.n + 1 :], free)

    def __call__(self, t: float, y: FloatArray) -> FloatArray:
        """Return dy/dt, shape (2N + 1,); the equations do not depend on ``t`` itself."""
        del t
        omega, a = self.acceleration(y, self.free)
        return np.concatenate(((omega,), y[self.n + 1 :], np.where(self.held, 0.0, a)))
