"""Whether a bottle falls freely before its release or after its touch, judged without an equation of its water.

Whatever the water does along the bottle, n . cap = n . base = n . C_M, n being the direction across it; and in flight
C_M moves along a parabola. So the clicks across the bottle between release and touch predict those before:

    n . (cap + base) / 2 = n . (p + v s + a s^2/2)       s = t - (t_r + t_d)/2;  p, v, a by robust least squares

A hand that carries the bottle adds g to its fall, g tau^2/2 upwards at a time tau before the release. The share of this
that the clicks show, with its standard error, is 1 or more in a hand, and 0 where the bottle already falls: the release
is then too late. The same film backwards shows whether it still falls after its touch, which is then too early. Since a
bottle may go on over the rim that stands, ``LATER`` is looked at, too.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from flipproof.film.likelihood import GRAVITY, Film
from slicemodel.trajectory import FloatArray

SHARE_ERROR: Final = 0.12
"""Standard error of a share: as many frames are used as it takes."""

MAX_FREE_SHARE: Final = 0.3
"""Share below which no hand is at work: two and a half standard errors."""

MAX_SECONDS: Final = 0.2
"""Seconds before the release from which frames are used: no hand is steady for longer."""


LATER: Final = 0.05
"""Time after a touch at which the bottle must still fall [s]."""


class Share(NamedTuple):
    """What the frames before a release show of a hand.

    ``seconds`` is how far back they reach, ``share`` the share of carrying, ``misfit`` the mean square residual of a
    free fall, in its variances.
    """

    seconds: float
    share: float
    misfit: float

    @property
    def falls(self) -> bool:
        """Whether the bottle falls freely there."""
        return self.share < MAX_FREE_SHARE and self.misfit < 4.0


def fall_after(film: Film, release: float, touch: float, noise: float) -> Share | None:
    """Return the free fall seen after a touch, and still ``LATER``; None if there is none, or too few frames."""
    backwards = replace(film, t=-film.t[::-1], values=film.values[:, ::-1].copy(), lines=film.lines[::-1])
    shares = [hand_share(backwards, -later, -release, noise) for later in (touch, touch + LATER)]
    return shares[1] if all(share is not None and share.falls for share in shares) else None


def hand_share(film: Film, release: float, touch: float, noise: float) -> Share | None:
    """Return what is seen of a hand before the release; None if there are too few frames.

    Parameters
    ----------
    film : of points
    release, touch : [s]
    noise : standard deviation of one coordinate of a click [m]
    """
    length = np.hypot(*(film.values[1] - film.values[0]).T)
    valid = np.abs(length - np.nanmedian(length)) < 8.0 * noise  # neither missing nor far off
    t, (cap, base) = film.t[valid], film.values[:, valid]
    axis = (base - cap) / length[valid, None]
    normal = np.column_stack((-axis[:, 1], axis[:, 0]))
    observed = (normal * (cap + base) / 2).sum(axis=1)
    s = t - (release + touch) / 2
    design = np.hstack((normal, normal * s[:, None], normal * s[:, None] ** 2 / 2))
    in_flight, in_hand = (t >= release) & (t <= touch), (t < release) & (t > release - MAX_SECONDS)
    if in_flight.sum() < 8:
        return None
    x, covariance = _fit_parabola(design[in_flight], observed[in_flight], noise)
    tau, residual, up = release - t[in_hand][::-1], (observed - design @ x)[in_hand][::-1], normal[in_hand, 1][::-1]
    return _share(tau, 0.5 * GRAVITY * tau**2 * up, residual, design[in_hand][::-1], covariance, noise)


def _fit_parabola(design: FloatArray, y: FloatArray, noise: float) -> tuple[FloatArray, FloatArray]:
    """Return p, v, a (6,) and their covariance; a is held to gravity within 3 m/s^2, for tilt and scale."""
    prior = np.zeros((2, 6))
    prior[0, 4] = prior[1, 5] = noise / 3.0
    weight = np.ones(len(y))
    for _ in range(10):
        matrix = np.vstack((design * weight[:, None], prior))
        x = np.linalg.lstsq(matrix, np.concatenate((y * weight, prior @ [0, 0, 0, 0, 0, -GRAVITY])), rcond=None)[0]
        weight = 1.0 / np.sqrt(1.0 + ((y - design @ x) / (3.0 * noise)) ** 2)
    return np.asarray(x), np.asarray(noise**2 * np.linalg.inv(matrix.T @ matrix))


def _share(
    tau: FloatArray, pattern: FloatArray, data: FloatArray, design: FloatArray, covariance: FloatArray, noise: float
) -> Share | None:
    """Return the share of a pattern in the residual of the nearest frames, the worst of four or more left out."""
    for count in range(2, len(tau) + 1):
        total = noise**2 * np.eye(count) + design[:count] @ covariance @ design[:count].T
        kept = np.arange(count)
        if count >= 4:
            kept = np.delete(kept, np.argmax(np.abs(data[:count]) / np.sqrt(np.diag(total))))
        weighted = np.linalg.solve(total[np.ix_(kept, kept)], np.column_stack((pattern[kept], data[kept])))
        fisher = float(pattern[kept] @ weighted[:, 0])
        if fisher > 1.0 / SHARE_ERROR**2:
            share, misfit = (
                float(pattern[kept] @ weighted[:, 1]) / fisher,
                float(data[kept] @ weighted[:, 1]) / len(kept),
            )
            return Share(float(tau[count - 1]), share, misfit)
    return None
