r"""When, within a step, does a slice meet an end? From the states at both ends of the step alone.

gap |\                  g(t), the distance from the end, is taken as the cubic through g and g' at both ends of
    | \_               the step (error h^4/384 of its fourth derivative: the order of the engine's RK4 step).
  0 +----*-----+--> t   The state at the root is the engine's own, by a shorter step from the same start.
    0    t*    h
"""

from __future__ import annotations

from typing import Final

ITERATIONS: Final = 60
RESOLUTION: Final = 1e-15
"""Bracket at which a root is known [h]."""


def first_zero(h: float, gap: tuple[float, float], rate: tuple[float, float]) -> float:
    """Return when a gap that is negative at ``h`` first closes, in [0, h]; both in [s].

    Parameters
    ----------
    h : float - length of the step [s]
    gap, rate : pair of floats - g [m] and g' [m/s] at its start and its end; g >= 0 at the start

    A slice that starts on the end, g = 0, has a root at the start. It counts only if the slice does not leave:
    otherwise g / t is searched, which no longer has it.
    """
    (g0, g1), (v0, v1) = gap, rate
    # g = g0 + t (v0 + t (c2 + t c3))
    c2 = (3.0 * (g1 - g0) / h - 2.0 * v0 - v1) / h
    c3 = (v0 + v1 - 2.0 * (g1 - g0) / h) / (h * h)

    def value(t: float) -> float:
        leaves = v0 + t * (c2 + t * c3)
        return g0 + t * leaves if g0 > 0.0 else leaves

    if value(0.0) <= 0.0:
        return 0.0
    # Illinois: regula falsi that halves the value kept twice; always inside the bracket.
    low, high = 0.0, h
    above, below = value(low), value(high)
    if below >= 0.0:
        return h
    kept = 0
    for _ in range(ITERATIONS):
        middle = (low * below - high * above) / (below - above)
        at_middle = value(middle)
        if at_middle > 0.0:
            low, above = middle, at_middle
            below = below / 2 if kept == 1 else below
            kept = 1
        else:
            high, below = middle, at_middle
            above = above / 2 if kept == -1 else above
            kept = -1
        if at_middle == 0.0 or high - low <= RESOLUTION * h:
            break
    return middle
