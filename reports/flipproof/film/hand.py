"""What a hand does to place and angle before the release.

Beyond the flight, extended backwards, a hand accelerates C_M in two directions, and theta, by a random process:
Matern's of order 3/2 with CORRELATION_TIME. Its value at the release has a prior of its own, for some hands let go
when they no longer push, and some while they push hardest: a process of one size throughout takes the end of a gentle
push for flight, and the release comes out early. Both kinds of hands are fitted, and weighted by their evidence. Given
that value, the rest is the sum of the process's largest principal components. All are integrated twice, exactly
between knots.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from slicemodel.trajectory import FloatArray

KNOT_SPACING: Final = 0.005
"""Time between knots, between which accelerations are linear [s]."""

REACH: Final = 0.15
"""Time before the release for which a hand is modelled [s]."""

CORRELATION_TIME: Final = 0.04
"""Time in which a hand's acceleration changes [s]."""

MOTIONS: Final = 7
"""Motions of a hand in the last fits: that of the value at the release, and six components.

First guesses have only a steady acceleration: a hand that may do anything could fly the bottle.
"""

PULL: Final = (60.0, 60.0, 300.0)
"""Standard deviations of a hand's accelerations minus those of flight: C_M [m/s^2], twice, and theta [rad/s^2]."""

KINDS: Final = ((3.0, 5.0, 15.0), (30.0, 30.0, 150.0))
"""Standard deviations of their values at the release, for the two, equally likely kinds of hands."""

LIFT: Final = (0.0, 9.81, 0.0)
"""Values at the release of a hand that only carries the bottle."""


@dataclass(frozen=True, slots=True)
class Rest:
    """What a hand does beyond its motions (``kernel.scoring.variances``).

    Parameters
    ----------
    power : int - of time, by which it grows
    size, deviation : float - its expected size [m/s^2], and the deviation of the logarithm
    floor : float - added to the size: no hand is as steady as a flight [m/s^2]
    """

    power: int
    size: float
    deviation: float
    floor: float


FIRST: Final = Rest(3, 25.0, 0.5, 2.5)
SEARCH: Final = Rest(6, 25.0, 0.5, 2.5)
LAST: Final = Rest(6, 1.0, 0.5, 0.1)
"""Beyond a steady acceleration, in first guesses; beyond all motions, in the search for gamma and e; and after it.

After the search it must stay below the noise where motions describe the hand: a variance that falls towards the
release makes an early release likely, whatever is clicked. Before that, while gamma and e may be wrong, it keeps a
hand that may do anything from flying the bottle.
"""


@cache
def motions(count: int) -> FloatArray:
    """Return places, velocities and accelerations of a hand's motions at the knots, (3, J, count); one is steady."""
    tau = np.arange(0.0, REACH + KNOT_SPACING / 2, KNOT_SPACING)
    if count == 1:
        return _integrate(np.ones((len(tau), 1)))
    distance = np.sqrt(3.0) * np.abs(tau[:, None] - tau) / CORRELATION_TIME
    correlation = (1.0 + distance) * np.exp(-distance)
    eigenvalues, eigenvectors = np.linalg.eigh(correlation - np.outer(correlation[0], correlation[0]))
    leading = eigenvectors[:, :-count:-1] * np.sqrt(eigenvalues[:-count:-1])
    leading *= np.sign(leading[1])
    return _integrate(np.column_stack((correlation[0], leading)))


def _integrate(acceleration: FloatArray) -> FloatArray:
    position, velocity = np.zeros_like(acceleration), np.zeros_like(acceleration)
    for k in range(len(acceleration) - 1):
        velocity[k + 1] = velocity[k] - KNOT_SPACING * (acceleration[k] + acceleration[k + 1]) / 2
        position[k + 1] = (
            position[k] - KNOT_SPACING * velocity[k] + KNOT_SPACING**2 * (2 * acceleration[k] + acceleration[k + 1]) / 6
        )
    return np.array([position, velocity, acceleration])
