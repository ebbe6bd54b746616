"""The centre of mass of a flying bottle: Eq. 2a and 2b fitted to its track, or found from the bottle's axis alone.

Whatever moves inside, in free flight the centre of mass C_M runs along a parabola and lies on the bottle's axis:

    n . (p_0 + v_0 tau - g tau^2/2 y - C) = 0        n perpendicular to the axis, C the cap, tau since the release

is linear in p_0, v_0 and g, one equation per frame, and asks nothing of where on the axis C_M is. So a video of cap and
base gives v_0 and g, and then r_CM(t) = u_r . (p_0 + v_0 tau - g tau^2/2 y - C), with water as with ice (derived here).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from flipproof.film.tracker.smoothing import BoolArray
from slicemodel.trajectory import FloatArray

LEAST_POINTS: Final = 8
"""Points below which a fit of five numbers says nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parabola:
    """A straight line in x and a parabola in y (Eq. 2a, 2b) with one standard deviation of every number.

    Lengths are in the unit of the points, times in s since ``start``; ``x0`` and ``y0`` stand for the constants
    (L - h/2) sin theta_0 and -(L - h/2) cos theta_0, from the origin of the video's axes instead of the cap's place.
    ``residual`` is the root mean square of what the fit leaves, ``points`` how many frames it used.
    """

    start: float
    x0: float
    y0: float
    v0x: float
    v0y: float
    g: float
    sd_x0: float
    sd_y0: float
    sd_v0x: float
    sd_v0y: float
    sd_g: float
    residual: float
    points: int

    def at(self, t: FloatArray) -> FloatArray:
        """Return the place of the centre of mass, shape (P, 2), at times t [s]."""
        tau = t - self.start
        return np.column_stack((self.x0 + self.v0x * tau, self.y0 + self.v0y * tau - 0.5 * self.g * tau * tau))


def fit_track(t: FloatArray, points: FloatArray, start: float) -> Parabola:
    """Fit Eq. 2a to x and Eq. 2b to y of a tracked centre of mass by least squares, from its release at ``start`` [s].

    ``points`` (P, 2) at times ``t`` (P,) are NaN where missing; fewer than ``LEAST_POINTS`` others are refused.
    """
    known = ~np.isnan(points).any(axis=1)
    if known.sum() < LEAST_POINTS:
        raise ValueError(
            f"the centre of mass was tracked in {known.sum()} frames of the flight; {LEAST_POINTS} are needed"
        )
    tau, (x, y) = (t - start)[known], points[known].T
    one = np.ones_like(tau)
    (x0, v0x), x_sd, x_rest = least_squares(np.column_stack((one, tau)), x)
    (y0, v0y, g), y_sd, y_rest = least_squares(np.column_stack((one, tau, -0.5 * tau * tau)), y)
    residual = float(np.sqrt((x_rest @ x_rest + y_rest @ y_rest) / (2 * len(tau))))
    return Parabola(
        start=start, x0=float(x0), v0x=float(v0x), y0=float(y0), v0y=float(v0y), g=float(g),
        sd_x0=float(x_sd[0]), sd_v0x=float(x_sd[1]), sd_y0=float(y_sd[0]), sd_v0y=float(y_sd[1]), sd_g=float(y_sd[2]),
        residual=residual, points=int(known.sum()),
    )  # fmt: skip


def least_squares(matrix: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return solution, standard deviations (from the residual) and residual of an overdetermined linear system."""
    solution = np.asarray(np.linalg.lstsq(matrix, values, rcond=None)[0], dtype=np.float64)
    rest = values - matrix @ solution
    variance = float(rest @ rest) / max(len(values) - matrix.shape[1], 1)
    deviations = np.sqrt(np.diag(np.linalg.pinv(matrix.T @ matrix)) * variance)
    return solution, np.asarray(deviations, dtype=np.float64), rest


def axis_equations(t: FloatArray, cap: FloatArray, base: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return matrix (P, 5) and right-hand side (P,) of the axis condition for (x0, y0, v0x, v0y, g).

    ``t`` (P,) counts from the release [s]; no value of ``cap`` and ``base`` (P, 2) is missing.
    """
    axis = base - cap
    axis = axis / np.hypot(*axis.T)[:, None]
    normal = np.column_stack((-axis[:, 1], axis[:, 0]))
    matrix = np.column_stack((normal, normal * t[:, None], -0.5 * t * t * normal[:, 1]))
    return matrix, np.einsum("ij,ij->i", normal, cap)


def fit_axis(
    t: FloatArray, cap: FloatArray, base: FloatArray, inside: BoolArray, start: float, gravity: float | None = None
) -> Parabola:
    """Find the parabola of the centre of mass from cap and base alone, over the frames ``inside``.

    With ``gravity`` given, g is not fitted. Fewer than ``LEAST_POINTS`` frames are refused.
    """
    if inside.sum() < LEAST_POINTS:
        raise ValueError(f"the flight has {inside.sum()} tracked frames; {LEAST_POINTS} are needed")
    matrix, values = axis_equations(t[inside] - start, cap[inside], base[inside])
    if gravity is None:
        solution, deviations, rest = least_squares(matrix, values)
    else:
        solution, deviations, rest = least_squares(matrix[:, :4], values - matrix[:, 4] * gravity)
        solution, deviations = np.append(solution, gravity), np.append(deviations, 0.0)
    names = ("x0", "y0", "v0x", "v0y", "g")
    found: dict[str, Any] = dict(zip(names, solution.tolist(), strict=True))
    found |= {f"sd_{name}": sd for name, sd in zip(names, deviations.tolist(), strict=True)}
    residual = float(np.sqrt(np.mean(rest * rest)))
    return Parabola(start=start, **found, residual=residual, points=int(inside.sum()))


def distance_from_cap(parabola: Parabola, t: FloatArray, cap: FloatArray, base: FloatArray) -> FloatArray:
    """Return r_CM(t), the place on the axis nearest to the parabola, from the cap; shape (P,), NaN where missing."""
    axis = base - cap
    axis = axis / np.hypot(*axis.T)[:, None]
    return np.asarray(np.einsum("ij,ij->i", axis, parabola.at(t) - cap))
