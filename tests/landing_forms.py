r"""Closed forms of the landing of a rigid bottle (ice), and of one slice aloft; which the solvers do not use.

   C_M o                    z height of C_M over the base, rho^2 = z^2 + R^2, J about C_M, I = J + M rho^2 about a
      /|                    rim. (x, y) is the place of C_M from the rim that touches; the bottle turns about it
 rho / | z                  without slip or rebound with the spin omega.
    /  |
rim ===+=== base
     R
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slicemodel import Scenario, Touch


def at_rest(scenario: Scenario, tilt: float = 0.0, omega: float = 0.0, velocity=(0.0, 0.0), r=None) -> Touch:
    """Return a touch of a bottle whose water does not move in it; it lies on the base, unless told otherwise."""
    places = scenario.initial_positions() if r is None else r
    still = np.zeros(scenario.n_slices)
    return Touch(scenario=scenario, theta=tilt, omega=omega, velocity=velocity, r=places, v=still)


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A bottle whose water stays on its base.

    Parameters
    ----------
    mass : float - M [kg], inertia : float - J [kg m^2]
    height : float - z [m], radius : float - R [m]
    gravity : float - g [m/s^2]
    """

    mass: float
    inertia: float
    height: float
    radius: float
    gravity: float

    @classmethod
    def of(cls, scenario: Scenario) -> Block:
        """Return the block of a scenario with its water at rest on the base."""
        bottle, m = scenario.bottle, scenario.slice_mass
        heights = bottle.length - scenario.initial_positions()
        z = (bottle.mass * bottle.length / 2 + m * float(heights.sum())) / scenario.total_mass
        own = bottle.mass * (bottle.radius**2 / 2 + bottle.length**2 / 12 + (bottle.length / 2 - z) ** 2)
        inertia = own + m * float(((heights - z) ** 2).sum())
        return cls(mass=scenario.total_mass, inertia=inertia, height=z, radius=bottle.radius, gravity=scenario.gravity)

    @property
    def rho(self) -> float:
        """Return the distance of C_M from a rim [m]."""
        return math.hypot(self.height, self.radius)

    @property
    def about_rim(self) -> float:
        """Return I [kg m^2]."""
        return self.inertia + self.mass * self.rho**2

    @property
    def toppling(self) -> float:
        """Return alpha, the tilt at which C_M stands over the rim [rad] (Eq. 13a)."""
        return math.atan2(self.radius, self.height)

    @property
    def saddle(self) -> float:
        """Return E_s = M g rho [J]."""
        return self.mass * self.gravity * self.rho


def corner_ratio(block: Block) -> float:
    """Return omega after over before as a rocking block goes over from rim to rim: (J + M (z^2 - R^2)) / I.

    Angular momentum about the new rim. It is Housner's 1 - 1.5 sin^2 alpha for a uniform block.
    """
    return (block.inertia + block.mass * (block.height**2 - block.radius**2)) / block.about_rim


def ends_upright(block: Block, tilt: float, omega: float, velocity: tuple[float, float]) -> bool | None:
    """Return whether ice that lands on a rim, without slip or rebound, ends upright; None where this does not decide.

    Parameters
    ----------
    block : Block
    tilt : float
        At the touch, in (-pi/2, 0) [rad]: it leans so that a positive spin raises it.
    omega : float [rad/s]
    velocity : (v_x, v_y) - of C_M [m/s]

    Notes
    -----
    At the touch, omega+ = (J omega + M (r x v)) / I. A negative spin has to be stopped by gravity before C_M is over
    the rim. Then the base comes down with omega_f^2 = omega+^2 + 2 M g (y - z)/I, keeps ``corner_ratio`` of it, and the
    bottle stands if that does not carry C_M over the other rim.
    The rim stays down while M (g - omega^2 y - M g x^2/I) > 0; that is asked at the touch and as the base comes down.
    To ask for omega+^2 rho/g < 1 only does not suffice: the base may come down faster than the touch.
    """
    mass, g, z, radius, about_rim = block.mass, block.gravity, block.height, block.radius, block.about_rim
    x = -z * math.sin(tilt) - radius * math.cos(tilt)
    y = z * math.cos(tilt) - radius * math.sin(tilt)
    spin = (block.inertia * omega + mass * (x * velocity[1] - y * velocity[0])) / about_rim
    down = spin**2 + 2 * mass * g * (y - z) / about_rim
    held = spin**2 * y < g * (1 - mass * x * x / about_rim) and down * z < g * (1 - mass * radius**2 / about_rim)
    if not held or velocity[1] + omega * x >= 0.0:
        return None
    if spin <= 0.0 and (x >= 0.0 or about_rim * spin**2 / 2 >= mass * g * (block.rho - y)):
        return False
    return about_rim * corner_ratio(block) ** 2 * down / 2 < mass * g * (block.rho - z)
