"""How far a parameter can go before no choice of the others makes up for it: the profile likelihood at its ends."""

from __future__ import annotations

from typing import Final

import numpy as np

from flipproof.film.fit.landscape import Landscape
from flipproof.film.fit.sampling import Cloud
from slicemodel.trajectory import FloatArray

STRIDE: Final = 0.05
"""First push in units of the distance to the best."""


def profile(
    land: Landscape, cloud: Cloud, best: FloatArray, lowest: float, allowed: float, steps: FloatArray, pushes: int
) -> tuple[FloatArray, FloatArray, float]:
    """Return how far each coordinate reaches (2, K), and the lowest point known at the end with its chi^2.

    From the farthest point of the population that is likely enough, a coordinate is pushed on and the others are fitted
    again, as long as that goes well.

    Parameters
    ----------
    best, lowest : (K,), float - the lowest point so far, its chi^2
    allowed : float - what chi^2 may exceed the lowest by
    steps : (K,) - of difference quotients
    pushes : int - trials at each end
    """
    x = np.concatenate((cloud.likely.x, cloud.edge.x, best[np.newaxis]))
    chi2 = np.concatenate((cloud.likely.chi2, cloud.edge.chi2, [lowest]))
    first = int(np.argmin(chi2))
    best, lowest = x[first], float(chi2[first])
    likely = x[chi2 <= lowest + allowed]
    reach = np.empty((2, len(best)))
    for k in range(len(best)):
        others = np.array([other for other in range(len(best)) if other != k])
        for side, sign in enumerate((-1.0, 1.0)):
            here = likely[np.argmax(sign * likely[:, k])]
            push = STRIDE * max(abs(here[k] - best[k]), 0.5 * steps[k])
            for _ in range(pushes):
                moved = here.copy()
                moved[k] = np.clip(here[k] + sign * push, land.low[k], land.high[k])
                if moved[k] == here[k]:
                    break
                moved, level = land.descend(moved, steps, others, 3)
                if level < lowest:
                    best, lowest = moved, level
                if level <= lowest + allowed:
                    here, push = moved, 1.5 * push
                elif push < 0.02 * abs(here[k] - best[k]):
                    break
                else:
                    push *= 0.4
            reach[side, k] = here[k]
    return reach, best, lowest
