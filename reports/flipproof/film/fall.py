"""Whether a bottle falls freely before its release already, seen without an equation of its water.

Whatever the water does along the bottle, n . cap = n . base = n . C_M, n being the direction across it; and in flight
C_M goes along a parabola. So what is clicked across the bottle between release and touch says how it went before:

    n . (cap + base) / 2 = n . (p + v s + a s^2/2)       s = t - (t_r + t_d)/2;  p, v, a by robust least squares

A hand that carries the bottle gives it g beyond its fall, g tau^2/2 upwards at a time tau before the release. The share
of this that the clicks show, with its standard error, is 1 or more in a hand, and 0 where the bottle falls already: the
release is then too late. Of a touch the same cannot be said: a bottle may go on over the rim that stands.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from flipproof.film.likelihood import GRAVITY, Film
from slicemodel.trajectory import FloatArray

ERROR: Final = 0.12
"""Standard error with which a share is read: from as many frames as that takes."""

FALLS: Final = 0.3
"""Share below which no hand is at work: two standard errors and a half."""

FAR: Final = 0.2
"""Seconds before the release up to which frames are looked at: no hand is alike for longer."""


class Share(NamedTuple):
    """What the frames before a release show of a hand.

    ``seconds`` is how far they reach, ``share`` what they show of carrying, ``misfit`` the mean square of what a free
    fall leaves, in its variances.
    """

    seconds: float
    share: float
    misfit: float

    @property
    def falls(self) -> bool:
        """Whether the bottle falls freely there."""
        return self.share < FALLS and self.misfit < 4.0


def before(film: Film, release: float, touch: float, noise: float) -> Share | None:
    """Return what is seen of a hand before the release; None where the frames do not suffice.

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
    inside, hand = (t >= release) & (t <= touch), (t < release) & (t > release - FAR)
    if inside.sum() < 8:
        return None
    x, covariance = _parabola(rows[inside], seen[inside], noise)
    away, left, up = release - t[hand][::-1], (seen - rows @ x)[hand][::-1], across[hand, 1][::-1]
    return _share(away, 0.5 * GRAVITY * away**2 * up, left, rows[hand][::-1], covariance, noise)


def _parabola(rows: FloatArray, seen: FloatArray, noise: float) -> tuple[FloatArray, FloatArray]:
    """Return p, v, a (6,) and their covariance; a is held to gravity within 3 m/s^2, what tilt and scale may change."""
    prior = np.zeros((2, 6))
    prior[0, 4] = prior[1, 5] = noise / 3.0
    weight = np.ones(len(seen))
    for _ in range(10):
        matrix = np.vstack((rows * weight[:, None], prior))
        x = np.linalg.lstsq(matrix, np.concatenate((seen * weight, prior @ [0, 0, 0, 0, 0, -GRAVITY])), rcond=None)[0]
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
        fisher = float(pattern[kept] @ weighed[:, 0])
        if fisher > 1.0 / ERROR**2:
            share, misfit = float(pattern[kept] @ weighed[:, 1]) / fisher, float(left[kept] @ weighed[:, 1]) / len(kept)
            return Share(float(away[count - 1]), share, misfit)
    return None
