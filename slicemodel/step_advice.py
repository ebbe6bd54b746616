"""How many steps does a throw need? Answered by the scheme itself, before anyone believes its result."""

from __future__ import annotations

import math

import numpy as np

from slicemodel.scenario import Scenario, known_name, number_in
from slicemodel.schemes import SCHEMES
from slicemodel.solver import Rebound, solve
from slicemodel.trajectory import FloatArray

BASE = 64
"""All trial grids are multiples of this, so that they share times to be compared at."""

MEMBERS = 8
"""Grids tried per octave: an error depends on where in its step each impact falls, and one grid may be lucky."""

SAFETY = 1.5
"""The worst of an octave times this must meet the tolerance; covers phases of impact that were not tried."""

REFINEMENT = 32
"""The scheme's own limit is taken from a run this many times finer than the octave under trial."""

GROWS = 2.0
"""Ratio of an octave's worst to the least before it from which rounding is blamed, where the limit has many steps."""

MAX_STEPS = 1 << 20
"""Steps beyond which no answer is looked for."""


def required_steps(
    scenario: Scenario, tolerance: float, scheme: str = "exact-step", *, rebound: Rebound | None = None
) -> int:
    """Return ``steps`` for ``solve`` so that omega(t) is within ``tolerance`` of the scheme's own limit.

    Grids are refined octave by octave, eight per octave, until the worst of one octave and of the next finer one meet
    the tolerance with a margin; the limit is the same scheme, 32 times finer. Where finer grids differ more from it, by
    rounding, one octave must do. The answer is the start of an octave, so it may be up to twice what is needed.

    Parameters
    ----------
    scenario : Scenario
    tolerance : float
        Largest admissible max |omega - omega_limit| / |omega_0| over the flight, in (0, 1).
    scheme : str
        One of ``slicemodel.schemes.SCHEMES`` that converges: not "published-matlab", whose slices escape.
    rebound : {"grid", "in-step"} or None
        As in ``solve``.

    Returns
    -------
    int
        Points of the grid, as ``solve`` counts them. Finer grids keep the tolerance too, until rounding grows: that of
        "exact-step" in a throw of 0.1 s exceeds 1e-6 of omega_0 from four million steps on.

    Raises
    ------
    ValueError
        Tolerance out of range, unknown scheme, a run that escapes or overflows, or a tolerance that is not seen to be
        met by a million steps or before rounding grows.

    Accuracy
    --------
    The step error only. The scheme's limit is an equation of its own and may be far from free flight.
    """
    tolerance = number_in("tolerance", tolerance, 0.0, 1.0, " of omega_0", open_low=True, open_high=True)
    known_name("scheme", scheme, SCHEMES)
    octave, least = 1, math.inf
    good: int | None = None
    while octave * BASE <= MAX_STEPS:
        worst = _worst_of_octave(scenario, scheme, rebound, octave)
        meets = worst * SAFETY <= tolerance
        rounding = worst > GROWS * least and octave * BASE * REFINEMENT > 4 * MAX_STEPS
        if good is not None and (rounding or meets):
            return good + 1
        if rounding:
            raise ValueError(
                f"tolerance = {tolerance:g} is not seen to be met by {scheme}: the error is {least:.2g} at "
                f"{octave * BASE // 2} steps, and rounding hides it on finer grids"
            )
        good = octave * BASE if meets else None
        octave, least = 2 * octave, min(least, worst)
    raise ValueError(
        f"tolerance = {tolerance:g} needs more than {MAX_STEPS} steps of {scheme} "
        f"(error {worst:.2g} at {octave * BASE // 2} steps); a scheme of second order is 'midpoint'"
    )


def _worst_of_octave(scenario: Scenario, scheme: str, rebound: Rebound | None, octave: int) -> float:
    """Return the largest error of the octave's grids, max |d omega| / |omega_0| at the times shared with the limit."""
    limit = _omega(scenario, scheme, rebound, octave * BASE * REFINEMENT)
    worst = 0.0
    for member in range(MEMBERS):
        steps = octave * BASE * (MEMBERS + member) // MEMBERS
        common = math.gcd(steps, len(limit) - 1)
        difference = _omega(scenario, scheme, rebound, steps)[:: steps // common] - limit[:: (len(limit) - 1) // common]
        worst = max(worst, float(np.abs(difference).max()))
    return worst / abs(scenario.omega0)


def _omega(scenario: Scenario, scheme: str, rebound: Rebound | None, steps: int) -> FloatArray:
    run = solve(scenario, scheme, steps + 1, "summary", rebound=rebound)
    if not run.ok:
        raise ValueError(f"{scheme} has no step size to ask for on this throw: {run.status}: {run.message}")
    return run.omega
