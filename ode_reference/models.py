r"""Right-hand sides: how a slice accelerates along the axis, one function per equation.

    cap                              C_M                                   base
    r = 0                           r = r_CM                              r = L
     |-----------------------o------- + -------o-------o-----------------o|   --> u_r, theta from the
     |                       |<- -s_j |  s_i ->|                          |       downward vertical
                       thrown to the cap   thrown to the base

s_i = r_i - r_CM is positive on the base side. Gravity acts along the axis with +g cos(theta): toward the base
of a bottle that stands upright. The whole bottle turns about C_M with

    theta' = omega = J_0 omega_0 / J(r),                                  (conservation of angular momentum)
    J = m sum s_i^2 + M_b (R^2/2 + L^2/12 + (L/2 - r_CM)^2),              (Eq. 11b, 11c)
    r_CM = (m sum r_i + M_b L/2) / (M_w + M_b),                           (Eq. 10 with Eq. 4a)

so that omega is not a state of its own. A slice that rests on an end is *held*: r' = 0. It still counts in
J, r_CM and r'_CM. To add an equation, write one function and register it in ``MODELS``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray

BoolArray = NDArray[np.bool_]


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


Acceleration = Callable[[Throw, float, float, FloatArray, FloatArray, BoolArray], FloatArray]


@dataclass(frozen=True, slots=True)
class Model:
    """One equation of motion along the axis.

    Parameters
    ----------
    name : str
    equation : str - in one line, as tables print it
    reason : str - why this equation is here
    acceleration : callable (throw, theta, omega, s, v, held) -> array, shape (N,) [m/s^2]
        For a free slice r_i''; for a held slice the acceleration relative to the bottle that it would
        have if its end let go. The sign of the latter decides rest and release: a slice rests on the base
        while it is >= 0, on the cap while it is <= 0. ``s`` and ``v`` have shape (N,) [m], [m/s];
        ``held`` (N,) is True where a slice rests, for models in which a resting slice moves with the tube.
    """

    name: str
    equation: str
    reason: str
    acceleration: Acceleration


def eq8(throw: Throw, theta: float, omega: float, s: FloatArray, v: FloatArray, held: BoolArray) -> FloatArray:
    """Return Eq. 8 exactly as printed, divided by m.

    r_i'' = g cos(theta) + omega^2 (r_i - r_CM) - (alpha/m) (r_i' - r'_CM)

    Source: Eq. 6 projected on u_r, with the weight, the centrifugal force of Eq. 7a and a drag
    alpha times the velocity relative to C_M; the Coriolis and Euler forces are transverse. The force on a
    held slice is the same expression with r_i' = 0. Without drag and gravity
    E = m/2 sum r_i'^2 + (J omega)^2 / 2J is constant between impacts, because dJ/dt = 2 m sum s_i r_i'
    (m sum s_i + M_b (L/2 - r_CM) = 0 removes every term with r'_CM).
    """
    del held  # r_i' = 0 of a held slice already stands in v
    acceleration = s * (omega * omega)
    acceleration -= throw.drag_rate * v
    acceleration += throw.gravity * np.cos(theta) + throw.drag_rate * throw.centre_of_mass_velocity(v)
    return acceleration


def published_limit(
    throw: Throw, theta: float, omega: float, s: FloatArray, v: FloatArray, held: BoolArray
) -> FloatArray:
    """Return what the published Python program solves as its time step goes to zero.

    r_i'' = (omega^2 - gamma^2) X_i,   X_i = r_i - r_CM + g cos(theta) / omega^2,   gamma = alpha / 2m

    Proof. With C = r_CM - g cos(theta)/omega^2 and all of omega, theta, r_CM frozen over a step of length h, the
    program's ``update_slice_positions`` computes (Eq. 9c, and its own variant of Eq. 9d)

        r+ = C + exp(-gamma h) [ X cosh(omega h) + (v/omega + gamma X/omega) sinh(omega h) ]
        v+ =     exp(-gamma h) [ ((omega^2 - gamma^2) X/omega + gamma v/omega) sinh(omega h) + v cosh(omega h) ]

    Insert exp(-gamma h) = 1 - gamma h, sinh(omega h) = omega h and cosh(omega h) = 1, each up to O(h^2):

        r+ = C + X (1 - gamma h) + v h + gamma X h                   = r + h v + O(h^2)
        v+ = v (1 - gamma h) + h (omega^2 - gamma^2) X + h gamma v   = v + h (omega^2 - gamma^2) X + O(h^2)

    so one step is Euler's method, up to O(h^2), for r' = v, v' = (omega^2 - gamma^2) X, and its limit is the equation
    above. The two terms in gamma v cancel because the program adds gamma v/omega where the derivative of Eq. 9c
    subtracts it; with the right sign -2 gamma v would remain. That r_CM, J and omega lag one step
    behind changes each frozen value by O(h) only, and keeping the old position at a rebound moves a slice by
    O(h): neither survives in the limit. The equation has no damping at all, and it pulls
    slices *toward* X = 0 once omega < gamma. Without gravity E + gamma^2 J / 2, with E of ``eq8``, is constant between
    impacts.
    """
    del v, held
    gamma = throw.drag_rate / 2
    slowness = np.float64(gamma) / omega
    # (omega^2 - gamma^2) g cos(theta) / omega^2, the same for all slices
    push = (1 - slowness * slowness) * throw.gravity * np.cos(theta)
    acceleration = s * (omega * omega - gamma * gamma)
    acceleration += push
    return acceleration


MODELS: Final[Mapping[str, Model]] = MappingProxyType(
    {
        model.name: model
        for model in (
            Model(
                name="eq8",
                equation="r_i'' = g cos(theta) + omega^2 (r_i - r_CM) - (alpha/m) (r_i' - r'_CM)",
                reason="Eq. 8 exactly as printed: what the paper sets out to solve.",
                acceleration=eq8,
            ),
            Model(
                name="published-limit",
                equation="r_i'' = (omega^2 - gamma^2) (r_i - r_CM + g cos(theta)/omega^2)",
                reason="What the published Python program solves as its time step goes to zero: it has no damping.",
                acceleration=published_limit,
            ),
        )
    }
)
"""Every equation that ``solve`` knows, by name."""


@dataclass(frozen=True, slots=True)
class Instant:
    """A state, what it means and what it feels: ``y`` = [theta, r_0..r_N-1, v_0..v_N-1]; ``r``, ``v`` are views of it.

    ``a`` is the model's acceleration of every slice, shape (N,) [m/s^2], held ones included (see ``Model``).
    """

    t: float
    y: FloatArray
    r: FloatArray
    v: FloatArray
    a: FloatArray


class Motion:
    """The right-hand side that a stepper integrates: one model, one throw, and the slices that are held at present.

    Parameters
    ----------
    throw : Throw
    model : Model
    held : array, shape (N,) of bool - slices that do not move. To be replaced, never written into, and only
        between two steppers: a stepper assumes that its right-hand side is smooth.
    """

    __slots__ = ("evaluations", "held", "model", "n", "throw")

    def __init__(self, throw: Throw, model: Model, held: BoolArray) -> None:
        self.throw = throw
        self.model = model
        self.held = held
        self.n = len(held)
        self.evaluations = 0

    def acceleration(self, y: FloatArray, held: BoolArray) -> tuple[float, FloatArray]:
        """Return omega [rad/s] and the model's acceleration of every slice, held or not, shape (N,) [m/s^2]."""
        self.evaluations += 1
        n = self.n
        _, s, inertia = self.throw.about_centre_of_mass(y[1 : n + 1])
        omega = self.throw.angular_momentum / inertia
        return omega, self.model.acceleration(self.throw, float(y[0]), omega, s, y[n + 1 :], held)

    def __call__(self, t: float, y: FloatArray) -> FloatArray:
        """Return dy/dt, shape (2N + 1,); the equations do not depend on ``t`` itself."""
        del t
        n = self.n
        omega, acceleration = self.acceleration(y, self.held)
        acceleration[self.held] = 0.0
        derivative = np.empty(2 * n + 1)
        derivative[0] = omega
        derivative[1 : n + 1] = y[n + 1 :]
        derivative[n + 1 :] = acceleration
        return derivative

    def at(self, t: float, y: FloatArray) -> Instant:
        """Return the state ``y`` at time ``t`` with the acceleration the model gives it."""
        n = self.n
        return Instant(t, y, y[1 : n + 1], y[n + 1 :], self.acceleration(y, self.held)[1])
