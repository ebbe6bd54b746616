"""What a hand does to place and angle before the release.

Beyond the flight, which goes on backwards, a hand accelerates C_M in two directions, and theta, by a random process:
Matern's of order 3/2, which changes within CHANGES, as hands do. Its value at the release has a prior of its own, for
some hands let go when they push no more, and some while they push hardest: a process of one size all along takes the
end of a gentle push for flight, and the release comes out early. Both kinds of hands are fitted, and weighed by their
evidence. Given that value, the rest is the sum of the process's largest principal components. All are integrated twice,
between knots exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from slicemodel.trajectory import FloatArray

APART: Final = 0.005
"""Time between knots, between which accelerations are straight [s]."""

REACH: Final = 0.15
"""Time before the release up to which a hand is looked at [s]."""

CHANGES: Final = 0.04
"""Time in which a hand's acceleration changes [s]."""

MOTIONS: Final = 7
"""Motions of a hand in the last fits: that of the value at the release, and six components.

First guesses have a steady acceleration alone: a hand that may do anything could fly the bottle.
"""

PULL: Final = (60.0, 60.0, 300.0)
"""Standard deviations of a hand's accelerations less those of flight: of C_M [m/s^2], twice, and of theta [rad/s^2]."""

KINDS: Final = ((3.0, 5.0, 15.0), (30.0, 30.0, 150.0))
"""Standard deviations of their values at the release, for the two kinds of hands, each as likely as the other."""

LIFT: Final = (0.0, 9.81, 0.0)
"""Values at the release of a hand that does nothing but carry the bottle."""


@dataclass(frozen=True, slots=True)
class Rest:
    """What a hand does beyond its motions (``kernel.scoring.variances``).

    Parameters
    ----------
    power : int - of time, by which it grows
    size, deviation : float - its expected size [m/s^2], and the deviation of the logarithm
    least : float - what is added to it: no hand is as steady as a flight [m/s^2]
    """

    power: int
    size: float
    deviation: float
    least: float


FIRST: Final = Rest(3, 25.0, 0.5, 2.5)
SEARCH: Final = Rest(6, 25.0, 0.5, 2.5)
LAST: Final = Rest(6, 1.0, 0.5, 0.1)
"""Beyond a steady acceleration, in first guesses; beyond all motions, in the search for gamma and e; and after it.

After the search it must stay below the noise where motions describe the hand: a variance that falls towards the
release makes an early release likely, whatever is clicked. Before, while gamma and e may be wrong, it keeps a hand
that may do anything from flying the bottle.
"""


@cache
def motions(count: int) -> FloatArray:
    """Return places, velocities and accelerations of a hand's motions at the knots, (3, J, count); one is steady."""
    before = np.arange(0.0, REACH + APART / 2, APART)
    if count == 1:
        return _integrated(np.ones((len(before), 1)))
    apart = np.sqrt(3.0) * np.abs(before[:, None] - before) / CHANGES
    together = (1.0 + apart) * np.exp(-apart)
    sizes, components = np.linalg.eigh(together - np.outer(together[0], together[0]))
    largest = components[:, :-count:-1] * np.sqrt(sizes[:-count:-1])
    largest *= np.sign(largest[1])
    return _integrated(np.column_stack((together[0], largest)))


def _integrated(pull: FloatArray) -> FloatArray:
    place, velocity = np.zeros_like(pull), np.zeros_like(pull)
    for k in range(len(pull) - 1):
        velocity[k + 1] = velocity[k] - APART * (pull[k] + pull[k + 1]) / 2
        place[k + 1] = place[k] - APART * velocity[k] + APART**2 * (2 * pull[k] + pull[k + 1]) / 6
    return np.array([place, velocity, pull])
