"""The one shape that all closed-form steps of this package share.

For constant omega, theta, r_CM (and, for some, v_CM) the equation of a slice is linear, and every
published or corrected step is the same map with shared coefficients,

    r' = r* + a (r - r*) + b v ,      v' = c (r - r*) + d v ,

    a = E (C + (gamma_r / k) S)              b = E S / k
    c = E S (k^2 - gamma^2) / k              d = E (p C + q (gamma / k) S)

with E = exp(-gamma dt), C = cosh(k dt), S = sinh(k dt) and the centre of repulsion

    r* = r_CM - g cos(theta) / omega^2  [ - 2 gamma v_CM / omega^2 ] .

The schemes differ only in the switches below, so that an erratum of the paper *is* a switch.
The exact solution of r'' = k'^2 (r - r*) - 2 gamma r' has k = sqrt(k'^2 + gamma^2), gamma_r = gamma,
p = +1, q = -1; differentiate r' once to see it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from slicemodel.scenario import Scenario


class StepForm(NamedTuple):
    """Switches of one closed-form step; compiled code reads them as they are.

    Parameters
    ----------
    exact_roots : bool
        k = sqrt(omega^2 + gamma^2) if true, k = omega (valid for gamma << omega) if false.
    cosh_sign : float
        p, sign of the v cosh term in the new velocity.
    sinh_sign : float
        q, sign of the gamma v sinh term in the new velocity.
    follows_cm : bool
        Drag is measured against v_CM, as Eq. 8 prints it, and not against the bottle.
    lagged : bool
        r_CM comes from the slices of the step before, and J from the r_CM of the step before that.
    keeps_position : bool
        Rebound: a slice past an end returns to its previous position. If false, it stays outside.
    strict : bool
        Rebound only past the end (<, >), not at it (<=, >=).
    midpoint : bool
        Coefficients are frozen at a predicted mid-step, not at the start of the step.
    in_step : bool
        Hits are located inside the step by the closed form, and a rebound does not wait for the grid.
    """

    exact_roots: bool
    cosh_sign: float
    sinh_sign: float
    follows_cm: bool
    lagged: bool
    keeps_position: bool
    strict: bool
    midpoint: bool = False
    in_step: bool = False


class StepConstants(NamedTuple):
    """Numbers of one throw as a scheme uses them; most are the scenario's own.

    gamma, gamma_position [1/s]; gravity [m/s^2]; restitution e; bottle_share epsilon of Eq. 4a or 4b.
    """

    gamma: float
    gamma_position: float
    gravity: float
    restitution: float
    bottle_share: float


def constants_of(scenario: Scenario) -> StepConstants:
    """Return the scenario's own numbers, with epsilon of Eq. 4a."""
    return StepConstants(
        gamma=scenario.damping_rate,
        gamma_position=scenario.damping_rate,
        gravity=scenario.gravity,
        restitution=scenario.restitution,
        bottle_share=scenario.bottle.mass / scenario.total_mass,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Scheme:
    """A named step: its form, the numbers it uses, what it solves and why it is here.

    ``limit`` is the equation it converges to, in words; ``model`` its name in ``ode_reference.MODELS``, if it has one.
    """

    name: str
    form: StepForm
    limit: str
    reason: str
    model: str = ""
    constants: Callable[[Scenario], StepConstants] = constants_of

    @property
    def order(self) -> float:
        """The order in the step before impacts: 2 with coefficients of the mid-step, 1 with those of its start."""
        return 2.0 if self.form.midpoint else 1.0
