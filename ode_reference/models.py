r"""The ladder: how a slice accelerates along the axis, one equation each, from the published program to free flight.

Geometry, signs and the meaning of s, J and omega stand in ``ode_reference.motion``. Gravity, where an equation has it,
acts along the axis with +g cos(theta): toward the base of a bottle that stands upright. Each rung mends one thing of
the rung before it, and ``LADDER`` names them in that order. To add an equation, write one function and register it
in ``MODELS`` with the switches that make the same equation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple
from types import MappingProxyType
from typing import Final

import numpy as np

from ode_reference.motion import Model, Throw
from ode_reference.switches import Switches
from slicemodel.trajectory import FloatArray


def published_limit(
    throw: Throw, theta: float, omega: float, s: FloatArray, v: FloatArray, free: FloatArray
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
    del v, free
    gamma = throw.drag_rate / 2
    slowness = np.float64(gamma) / omega
    # (omega^2 - gamma^2) g cos(theta) / omega^2, the same for all slices
    push = (1 - slowness * slowness) * throw.gravity * np.cos(theta)
    acceleration = s * (omega * omega - gamma * gamma)
    acceleration += push
    return acceleration


def signs_limit(throw: Throw, theta: float, omega: float, s: FloatArray, v: FloatArray, free: FloatArray) -> FloatArray:
    """Return what the published program would solve if it differentiated Eq. 9c with the right sign.

    r_i'' = (omega^2 - gamma^2) X_i - 2 gamma r_i'

    Proof. The derivative of Eq. 9c has - gamma v/omega where the program has + gamma v/omega. In the proof of
    ``published_limit`` the two terms in gamma v then add up instead of cancelling:
    v+ = v (1 - gamma h) + h (omega^2 - gamma^2) X - h gamma v. A term of Eq. 9a remains wrong: Eq. 8 solved exactly
    gives the roots -gamma +- sqrt(omega^2 + gamma^2), Eq. 9a has -gamma +- omega, whose product is gamma^2 - omega^2.
    """
    acceleration = published_limit(throw, theta, omega, s, v, free)
    acceleration -= throw.drag_rate * v
    return acceleration


def eq8_wall(throw: Throw, theta: float, omega: float, s: FloatArray, v: FloatArray, free: FloatArray) -> FloatArray:
    """Return the equation whose frozen-coefficient solution has the exact roots -gamma +- sqrt(omega^2 + gamma^2).

    r_i'' = omega^2 X_i - 2 gamma r_i' = g cos(theta) + omega^2 (r_i - r_CM) - (alpha/m) r_i'

    This is Eq. 8 with the drag measured against the wall on which the slice rubs.
    """
    del free
    acceleration = s * (omega * omega)
    acceleration -= throw.drag_rate * v
    acceleration += throw.gravity * np.cos(theta)
    return acceleration


def eq8(throw: Throw, theta: float, omega: float, s: FloatArray, v: FloatArray, free: FloatArray) -> FloatArray:
    """Return Eq. 8 exactly as printed, divided by m.

    r_i'' = g cos(theta) + omega^2 (r_i - r_CM) - (alpha/m) (r_i' - r'_CM)

    Source: Eq. 6 projected on u_r, with the weight, the centrifugal force of Eq. 7a and a drag
    alpha times the velocity relative to C_M; the Coriolis and Euler forces are transverse. The force on a
    held slice is the same expression with r_i' = 0. Without drag and gravity
    E = m/2 sum r_i'^2 + (J omega)^2 / 2J is constant between impacts, because dJ/dt = 2 m sum s_i r_i'
    (m sum s_i + M_b (L/2 - r_CM) = 0 removes every term with r'_CM).
    """
    acceleration = eq8_weightless(throw, theta, omega, s, v, free)
    acceleration += throw.gravity * np.cos(theta)
    return acceleration


def eq8_weightless(
    throw: Throw, theta: float, omega: float, s: FloatArray, v: FloatArray, free: FloatArray
) -> FloatArray:
    """Return Eq. 8 without the weight: in the frame of a C_M that falls with g, gravity has gone.

    r_i'' = omega^2 (r_i - r_CM) - (alpha/m) (r_i' - r'_CM)
    """
    del theta, free
    acceleration = s * (omega * omega)
    acceleration -= throw.drag_rate * v
    acceleration += throw.drag_rate * throw.centre_of_mass_velocity(v)
    return acceleration


def free_flight(throw: Throw, theta: float, omega: float, s: FloatArray, v: FloatArray, free: FloatArray) -> FloatArray:
    """Return the motion of point slices in a bottle on which nothing acts but gravity.

    r_i'' = omega^2 (r_i - r_c) - (alpha/m) r_i' - (alpha/M_c) sum_{free j} r_j'

    M_c and r_c are mass and centre of the body that the tube forms with the slices resting in it.

    Proof. In the frame of C_M, which falls, gravity has gone. Along the axis, with s = r - r_CM, a free slice feels the
    centrifugal force and the drag of the wall, and the body "tube with resting slices" the reactions of that drag:

        m s_i'' = m omega^2 s_i - alpha r_i',        M_c s_c'' = M_c omega^2 s_c + alpha sum_{free j} r_j'

    Contact forces of resting slices are internal to the body. r_i moves relative to the tube, so that
    r_i'' = s_i'' - s_c'', in which r_CM drops out. In terms of s the body's place follows from the definition of C_M,
    M_c s_c = -m sum_{free j} s_j, and s_c'' = -r''_CM is the acceleration of the origin that Eq. 8 leaves out.

    A resting slice is pressed onto its end by m (omega^2 s_i - s_c''), which is m times the expression above with
    r_i' = 0. If it leaves, the body loses its mass and the expression is multiplied by M_c / (M_c - m) > 0: whether it
    is counted as resting or as free, its sign is the same.
    """
    del theta
    free_mass = throw.slice_mass * float(free.dot(free))
    body = throw.slice_mass / (throw.total_mass - free_mass)
    square = omega * omega
    acceleration = s * square
    acceleration -= throw.drag_rate * v
    acceleration += body * (square * float(s.dot(free)) - throw.drag_rate * float(v.dot(free)))
    return acceleration


MODELS: Final[Mapping[str, Model]] = MappingProxyType(
    {
        model.name: model
        for model in (
            Model(
                name="published-limit",
                equation="r_i'' = (omega^2 - gamma^2) (r_i - r_CM + g cos(theta)/omega^2)",
                reason="What the published Python program solves as its time step goes to zero: it has no damping.",
                acceleration=published_limit,
                switches=Switches(),
            ),
            Model(
                name="signs-limit",
                equation="r_i'' = (omega^2 - gamma^2) (r_i - r_CM + g cos(theta)/omega^2) - 2 gamma r_i'",
                reason="The same with the derivative of Eq. 9c signed rightly: the drag damps.",
                acceleration=signs_limit,
                switches=Switches(signs=True),
            ),
            Model(
                name="eq8-wall",
                equation="r_i'' = g cos(theta) + omega^2 (r_i - r_CM) - (alpha/m) r_i'",
                reason="The same with the exact roots instead of those for gamma << omega: no negative spring.",
                acceleration=eq8_wall,
                switches=Switches(signs=True, roots=True),
            ),
            Model(
                name="eq8",
                equation="r_i'' = g cos(theta) + omega^2 (r_i - r_CM) - (alpha/m) (r_i' - r'_CM)",
                reason="Eq. 8 exactly as printed: what the paper sets out to solve.",
                acceleration=eq8,
                switches=Switches(signs=True, roots=True, drag_on_centre=True),
            ),
            Model(
                name="eq8-weightless",
                equation="r_i'' = omega^2 (r_i - r_CM) - (alpha/m) (r_i' - r'_CM)",
                reason="Eq. 8 in the frame of C_M, which falls: no weight.",
                acceleration=eq8_weightless,
                switches=Switches(signs=True, roots=True, drag_on_centre=True, weightless=True),
            ),
            Model(
                name="accelerating-origin",
                equation="r_i'' = omega^2 (r_i - r_c) - (alpha/m) r_i' - (alpha/M_c) sum_free r_j', no recoil",
                reason="The acceleration of the origin and the drag against the wall; impacts on an immovable tube.",
                acceleration=free_flight,
                switches=Switches(signs=True, roots=True, drag_on_centre=True, weightless=True, origin=True),
            ),
            Model(
                name="free-flight",
                equation="r_i'' = omega^2 (r_i - r_c) - (alpha/m) r_i' - (alpha/M_c) sum_free r_j', recoil",
                reason="The mechanics of point slices in a falling bottle: impacts move the tube.",
                acceleration=free_flight,
                switches=Switches(
                    signs=True, roots=True, drag_on_centre=True, weightless=True, origin=True, recoil=True
                ),
            ),
        )
    }
)
"""Every equation that has a name."""


def ladder_of(models: Mapping[str, Model]) -> tuple[str, ...]:
    """Return the names of models by how much they get right, the number of their switches that are on."""
    return tuple(sorted(models, key=lambda name: sum(astuple(models[name].switches))))


LADDER: Final = ladder_of(MODELS)
"""The names of the rungs, from what the published program solves to free flight."""
