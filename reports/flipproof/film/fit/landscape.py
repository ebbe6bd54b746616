"""chi^2 over the parameters of a fit: asked for point by point or for many points at once, and descended."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from flipproof.film.fit.problem import Problem
from slicemodel.trajectory import FloatArray

HUBER: Final = 3.0
"""Residuals beyond this many standard deviations count linearly (Huber's loss), so that a slipped marker does not
decide; within it nothing changes."""

Tick = Callable[[int], object]


class Landscape:
    """chi^2 of a problem, and how often it was asked for; ``tick`` is called with the number of flights made.

    Residuals are divided by ``problem.noise * scale`` before the loss.
    """

    def __init__(self, problem: Problem, *, tick: Tick = lambda _: None) -> None:
        self.problem, self.tick = problem, tick
        self.low, self.high = problem.bounds()
        self.scale, self.flights = 1.0, 0

    def residuals(self, points: FloatArray) -> FloatArray:
        """Return the residuals at many points (M, K) in standard deviations, shape (M, P)."""
        rows = self.problem.residuals(points)
        self.flights += len(points)
        self.tick(len(points))
        return np.asarray(rows / self.scale)

    def residual(self, x: FloatArray) -> FloatArray:
        """Return the residuals at ``x`` in standard deviations, shape (P,)."""
        return np.asarray(self.residuals(x[np.newaxis])[0])

    def jacobian(self, x: FloatArray, steps: FloatArray) -> FloatArray:
        """Return d residual / d x by central difference quotients over ``steps``, at bounds one-sided, shape (P, K)."""
        up = np.minimum(x + np.diag(steps), self.high)
        down = np.maximum(x - np.diag(steps), self.low)
        above, below = np.split(self.residuals(np.concatenate((up, down))), 2)
        return np.asarray((above - below).T / np.diag(up - down))

    def descend(self, x: FloatArray, steps: FloatArray, flights: int) -> tuple[FloatArray, float]:
        """Minimise chi^2 from ``x``; return where it ended, and chi^2 there.

        ``steps`` (K,) are those of the difference quotients, ``flights`` the trial points at the most.
        """
        # The solver wants its start strictly inside.
        margin = 1e-9 * (self.high - self.low)
        found = least_squares(
            self.residual, np.clip(x, self.low + margin, self.high - margin), bounds=(self.low, self.high),
            jac=partial(self.jacobian, steps=steps), x_scale=steps, loss="huber", f_scale=HUBER, ftol=1e-5,
            xtol=1e-5, gtol=1e-8, max_nfev=flights,
        )  # fmt: skip
        return np.asarray(found.x), 2.0 * float(found.cost)


def loss(residuals: FloatArray) -> FloatArray:
    """Return the sum of Huber's loss over the last axis: squares up to ``HUBER``, straight lines beyond."""
    size = np.abs(residuals)
    return np.asarray(np.where(size <= HUBER, size * size, 2.0 * HUBER * size - HUBER * HUBER).sum(axis=-1))
