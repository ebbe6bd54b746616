"""What must hold in any engine while the bottle flies, and how far it may be off.

    state of the bodies  ->  measure: residuals, one number each  ->  broken: the first cause, in words

Works on positions and velocities alone, so that it serves every engine. theta is the angle of u_r (cap to
base) from the downward vertical, counter-clockwise positive; u_r = (sin theta, -cos theta).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray


@dataclass(frozen=True, slots=True)
class Bound:
    """The largest admissible residual, what it is measured against, why, and what to do when it is left."""

    limit: float
    reference: str
    reason: str
    remedy: str


BOUNDS: Final[Mapping[str, Bound]] = MappingProxyType(
    {
        "angular_momentum_drift": Bound(
            1e-2,
            "|L/L_0 - 1|",
            "every impulse acts along the line between two bodies, so L is exact to round-off (1e-13); "
            "only a position correction, if switched on, moves it, by up to 5e-3",
            "raise iterations",
        ),
        "linear_momentum_residual": Bound(
            1e-6,
            "|p - p_0 - M g t| / (M |omega_0| L)",
            "internal impulses cancel in pairs, so p is exact to round-off (1e-13)",
            "raise iterations",
        ),
        "constraint_drift": Bound(
            1e-3,
            "largest distance of a slice from the axis / L",
            "5e-7 at dt = 1e-4 s and order 2 when the solver has converged, 1e-2 when it has not",
            "raise iterations",
        ),
        "omega_mismatch": Bound(
            5e-3,
            "|omega - L_0/J(positions)| / |omega_0|",
            "1e-4 or less when the solver has converged, 1e-1 and more when it has not: slices whose "
            "velocities do not follow the tube show here first, while L still holds",
            "raise iterations",
        ),
        "penetration": Bound(
            1e-2,
            "largest depth of a slice in an end / L",
            "an impact sinks in by v dt (2e-3 L at 5 m/s and 1e-4 s), a rest creeps by order dt; 1e-2 L is 2 % of J",
            "reduce dt",
        ),
    }
)


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """All bodies at one time: ``angle``, ``omega`` of the tube; positions and velocities, first row the tube.

    ``x``, ``v`` have shape (1 + N, 2), or (1, 2) for one rigid body [m], [m/s]; ``axis_origin`` is the distance
    of the first body's centre from the cap [m]; ``spin_moment`` its moment about its own centre [kg m^2];
    ``gravity_time`` the time for which gravity has acted on ``v`` [s], which is ``t`` if all steps are equal.
    """

    t: float
    angle: float
    omega: float
    x: FloatArray
    v: FloatArray
    masses: FloatArray
    axis_origin: float
    spin_moment: float
    gravity_time: float

    @property
    def u_r(self) -> FloatArray:
        """Unit vector from cap to base."""
        return np.array([np.sin(self.angle), -np.cos(self.angle)])

    @property
    def finite(self) -> bool:
        """True if every number of the state is finite."""
        return bool(
            np.isfinite([self.angle, self.omega]).all() and np.isfinite(self.x).all() and np.isfinite(self.v).all()
        )

    def along_axis(self) -> tuple[FloatArray, FloatArray]:
        """Return r, r' of the slices from the cap, relative to the tube; shape (N,) [m], [m/s]."""
        u = self.u_r
        return self.axis_origin + (self.x[1:] - self.x[0]) @ u, (self.v[1:] - self.v[0]) @ u

    def centre_and_inertia(self) -> tuple[float, float]:
        """Return r_CM from the cap [m] and the moment of inertia about it [kg m^2], from the bodies alone."""
        centre = self.masses @ self.x / self.masses.sum()
        r_cm = self.axis_origin + float((centre - self.x[0]) @ self.u_r)
        return r_cm, float((self.masses * ((self.x - centre) ** 2).sum(axis=1)).sum() + self.spin_moment)

    def angular_momentum(self) -> float:
        """Return the angular momentum about the centre of mass, spin of the tube included [kg m^2/s]."""
        total = self.masses.sum()
        dx, dv = self.x - self.masses @ self.x / total, self.v - self.masses @ self.v / total
        return float((self.masses * (dx[:, 0] * dv[:, 1] - dx[:, 1] * dv[:, 0])).sum() + self.spin_moment * self.omega)


def measure(state: State, scenario: Scenario, angular_momentum: float) -> dict[str, float]:
    """Return the residuals of a finite state under the names of ``BOUNDS``, dimensionless as the bounds say.

    Parameters
    ----------
    angular_momentum : float
        L_0, of the engine's own bodies at release [kg m^2/s].
    """
    length, omega0 = scenario.bottle.length, abs(scenario.omega0)
    masses, x, v = state.masses, state.x, state.v
    # Formed once for all residuals: this is asked at every output time, and must cost little against the steps.
    total = masses.sum()
    centre, drift = masses @ x / total, masses @ v / total
    dx, dv = x - centre, v - drift
    momentum = masses @ (dx[:, 0] * dv[:, 1] - dx[:, 1] * dv[:, 0]) + state.spin_moment * state.omega
    inertia = masses @ (dx * dx).sum(axis=1) + state.spin_moment
    launch_x, launch_y = scenario.launch_velocity
    gap = math.hypot(drift[0] - launch_x, drift[1] - launch_y + scenario.gravity * state.gravity_time)
    u = state.u_r
    aside, along = ((x[1:] - x[0]) @ np.array([[-u[1], u[0]], [u[0], u[1]]]).T).T
    r = state.axis_origin + along
    depth = max(0.0, float(r.max()) - scenario.r_max, scenario.r_min - float(r.min())) if len(r) else 0.0
    return {
        "angular_momentum_drift": float(abs(momentum / angular_momentum - 1.0)),
        "linear_momentum_residual": gap / (omega0 * length),
        "constraint_drift": float(np.abs(aside).max(initial=0.0)) / length,
        "omega_mismatch": float(abs(state.omega - angular_momentum / inertia) / omega0),
        "penetration": depth / length,
    }


def broken(residuals: Mapping[str, float], cap_thickness: float) -> str:
    """Return the cause, in words, if a residual has exceeded its bound; the empty string if none has.

    ``cap_thickness`` is in bottle lengths: past the middle of a cap the engine pushes a slice outward.
    """
    name, words = first_left(residuals, BOUNDS)
    if name == "penetration" and residuals[name] > cap_thickness / 2:
        return f"a slice has tunnelled through an end cap ({residuals[name]:.3g} L deep); reduce dt"
    return words


def first_left(residuals: Mapping[str, float], bounds: Mapping[str, Bound]) -> tuple[str, str]:
    """Return the first residual that has exceeded its bound, and how in words; two empty strings if none has."""
    for name, bound in bounds.items():
        # Written as "not inside", because NaN passes every "outside" test.
        if not residuals[name] <= bound.limit:
            value = f"{name.replace('_', ' ')} {residuals[name]:.3g}"
            return name, f"{value} exceeds {bound.limit:g} ({bound.reference}); {bound.remedy}"
    return "", ""
