"""The paper's own steps: its two supplementary programs, and its equations as typeset."""

from __future__ import annotations

import math

from slicemodel.scenario import Scenario
from slicemodel.schemes.form import Scheme, StepConstants, StepForm, constants_of

MATLAB_GRAVITY = 9.8
MATLAB_RESTITUTION = 0.5
WATER_DENSITY = 1000.0


def matlab_constants(scenario: Scenario) -> StepConstants:
    """Return the numbers of the MATLAB supplement.

    It writes g = 9.8, a rebound factor of -0.5, epsilon of Eq. 4b (H_0 / (H_0 + h) with
    H_0 = M_b / (rho pi R^2)), and in the position update alpha / (2 M_w N) where the
    damping rate is alpha N / (2 M_w).
    """
    bottle = scenario.bottle
    water_height = scenario.fill_fraction * bottle.length
    empty_height = bottle.mass / (WATER_DENSITY * math.pi * bottle.radius**2)
    return constants_of(scenario)._replace(
        gamma_position=scenario.drag / (2 * scenario.water_mass * scenario.n_slices),
        gravity=MATLAB_GRAVITY,
        restitution=MATLAB_RESTITUTION,
        bottle_share=empty_height / (empty_height + water_height),
    )


PUBLISHED_PYTHON = Scheme(
    name="published-python",
    form=StepForm(
        exact_roots=False,
        cosh_sign=+1.0,
        sinh_sign=+1.0,
        follows_cm=False,
        lagged=True,
        keeps_position=True,
        strict=True,
    ),
    limit="v' = (omega^2 - gamma^2) X: no damping at all",
    model="published-limit",
    reason="The Python program of the supplement. The sinh term of Eq. 9d keeps its typeset plus sign, where the "
    "derivative of Eq. 9c has a minus; centre of mass, inertia and omega lag one step.",
)

PUBLISHED_MATLAB = Scheme(
    name="published-matlab",
    form=StepForm(
        exact_roots=False,
        cosh_sign=+1.0,
        sinh_sign=+1.0,
        follows_cm=False,
        lagged=False,
        keeps_position=False,
        strict=True,
    ),
    limit="slices leave the bottle",
    reason="The MATLAB program of the supplement. As published-python, but a rebound flips the velocity and leaves the "
    "slice outside; the position update divides gamma by N twice; g = 9.8, epsilon of Eq. 4b, e = 0.5 whatever the "
    "scenario says.",
    constants=matlab_constants,
)

PAPER_TYPESET = Scheme(
    name="paper-typeset",
    form=StepForm(
        exact_roots=False,
        cosh_sign=-1.0,
        sinh_sign=+1.0,
        follows_cm=False,
        lagged=False,
        keeps_position=True,
        strict=False,
    ),
    limit="nothing moves as dt -> 0: v changes sign every step",
    reason="Eq. 9c and Eq. 9d exactly as typeset; Eq. 9d ends in minus v cosh. Rebounds as [C.S.] means them: with the "
    "sign it prints, beta = -0.5 would not reverse the velocity.",
)
