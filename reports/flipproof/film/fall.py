"""Whether a bottle falls freely before its release or after its touch, seen without an equation of its water.

Whatever the water does along the bottle, n . cap = n . base = n . C_M, n being the direction across it; and in flight
C_M goes along a parabola. So what is clicked across the bottle between release and touch says how it goes on:

    n . (cap + base) / 2 = n . (p + v s + a s^2/2)       s = t - (t_r + t_d)/2;  p, v, a by robust least squares

A hand that carries the bottle gives it g beyond its fall, g tau^2/2 upwards at a time tau before the release; a table
takes the velocity, or what of it is vertical. The share of this that the clicks show, with its standard error, is 1 or
more in a hand or on a table, and 0 where the bottle falls on: a release is then too late, or a touch too early.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from flipproof.film.likelihood import GRAVITY, Film
from slicemodel.trajectory import FloatArray

ERROR: Final = 0.12
"""Standard error with which a share is read: from as many frames as that takes."""

FALLS: Final = 0.3
"""Share below which neither a hand nor a table is at work: two standard errors and a half."""

FAR: Final = 0.2
"""Seconds from release or touch up to which frames are looked at; no hand and no table is alike for longer."""


class Share(NamedTuple):
    """What the frames beyond an end of the flight show of a hand or a table.

    ``seconds`` is how far they reach, ``share`` what they show of carrying or stopping, ``error`` its standard error,
    ``misfit`` the mean square of what a free fall leaves, in its variances.
    """

    seconds: float
    share: float
    error: float
    misfit: float

    @property
    def falls(self) -> bool:
        """Whether the bottle falls freely there."""
        return self.share < FALLS and self.misfit < 4.0


def beyond(film: Film, release: float, touch: float, noise: float) -> tuple[Share | None, Share | None]:
    """Return what is seen of a hand before the release and of a table after the touch; None where nothing can be.

    Parameters
    ----------
    film : of points
    release, touch : [s]
    noise : standard deviation of one coordinate of a click [m]
    """
    apart = np.hypot(*(film.values[1] - film.values[0]).T)
    sound = np.abs(apart - np.nanmedian(apart)) < 8.0 * noise  # neither missing nor far off
    t, (cap, base) = film.t[sound], film.values[:, sound]
    along = (base - cap) / apart[sound, None]
    across = np.column_stack((-along[:, 1], along[:, 0]))
    seen = (across * (cap + base) / 2).sum(axis=1)
    s = t - (release + touch) / 2
    rows = np.hstack((across, across * s[:, None], across * s[:, None] ** 2 / 2))
    inside = (t >= release) & (t <= touch)
    if inside.sum() < 8:
        return None, None
    x, covariance = _parabola(rows[inside], seen[inside], noise)
    hand, table = release - t, t - touch
    lost = -across * (x[2:4] + x[4:6] * (touch - release) / 2)
    # A table may take all of the velocity or, if the bottle slides, what is vertical: the less that shows the better.
    stopped = min((lost.sum(axis=1), lost[:, 1]), key=lambda one: float(np.abs(one[(table > 0) & (table < FAR)]).sum()))
    patterns = 0.5 * GRAVITY * hand**2 * across[:, 1], stopped * table
    left = seen - rows @ x
    shares = []
    for away, pattern in zip((hand, table), patterns, strict=True):
        near = np.flatnonzero((away > 0) & (away < FAR))
        near = near[np.argsort(away[near])]
        shares.append(_share(away[near], pattern[near], left[near], rows[near], covariance, noise))
    return shares[0], shares[1]


def _parabola(rows: FloatArray, seen: FloatArray, noise: float) -> tuple[FloatArray, FloatArray]:
    """Return p, v, a (6,) and their covariance; a is held to gravity within 3 m/s^2, what tilt and scale may change."""
    known = np.zeros((2, 6))
    known[0, 4] = known[1, 5] = noise / 3.0
    weight = np.ones(len(seen))
    for _ in range(10):
        matrix = np.vstack((rows * weight[:, None], known))
        x = np.linalg.lstsq(matrix, np.concatenate((seen * weight, known @ [0, 0, 0, 0, 0, -GRAVITY])), rcond=None)[0]
        weight = 1.0 / np.sqrt(1.0 + ((seen - rows @ x) / (3.0 * noise)) ** 2)
    return np.asarray(x), np.asarray(noise**2 * np.linalg.inv(matrix.T @ matrix))


def _share(
    away: FloatArray, pattern: FloatArray, left: FloatArray, rows: FloatArray, covariance: FloatArray, noise: float
) -> Share | None:
    """Return the share of a pattern in what is left of the nearest frames, the worst of four or more left out."""
    for count in range(2, len(away) + 1):
        spread = noise**2 * np.eye(count) + rows[:count] @ covariance @ rows[:count].T
        kept = np.arange(count)
        if count >= 4:
            kept = np.delete(kept, np.argmax(np.abs(left[:count]) / np.sqrt(np.diag(spread))))
        weighed = np.linalg.solve(spread[np.ix_(kept, kept)], np.column_stack((pattern[kept], left[kept])))
        known = float(pattern[kept] @ weighed[:, 0])
        if known > 1.0 / ERROR**2:
            share, misfit = float(pattern[kept] @ weighed[:, 1]) / known, float(left[kept] @ weighed[:, 1]) / len(kept)
            return Share(float(away[count - 1]), share, known**-0.5, misfit)
    return None
