"""Two curves of one throw, compared in numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reports.studies.differences import PARTING_BAND, first_crossing
from reports.tables import Curve
from slicemodel.observables import plateau
from slicemodel.trajectory import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Differences second minus first on the first curve's times, up to where the shorter one ends."""

    first: str
    second: str
    omega0: float
    end: float
    theta: float
    r_cm: float
    plateaus: tuple[float, float]
    finals: tuple[float, float]
    largest: float
    largest_time: float
    parting_time: float | None


def compare(first: Curve, second: Curve) -> Comparison:
    """Compare two curves; omega is taken relative to the first curve's initial value.

    Raises
    ------
    ValueError
        If the two have no common time, or the first starts without spin.
    """
    if second.t[0] > first.t[-1] or first.t[0] > second.t[-1]:
        raise ValueError(f"{first.label} and {second.label} have no common time")
    omega0 = float(first.omega[0])
    if omega0 == 0.0:
        raise ValueError(f"{first.label}: omega is 0 at the first time; differences are taken relative to it")
    t = first.t[(first.t >= second.t[0]) & (first.t <= second.t[-1])]
    if len(t) < 2:
        raise ValueError(f"{first.label} has {len(t)} times within those of {second.label}; at least 2 are needed")

    def both(name: str) -> tuple[FloatArray, FloatArray]:
        return np.interp(t, first.t, getattr(first, name)), np.interp(t, second.t, getattr(second, name))

    omega = both("omega")
    size = np.abs(omega[1] - omega[0]) / abs(omega0)
    k = int(size.argmax())
    theta, r_cm = both("theta"), both("r_cm")
    return Comparison(
        first=first.label,
        second=second.label,
        omega0=omega0,
        end=float(t[-1]),
        theta=float(theta[1][-1] - theta[0][-1]),
        r_cm=float(r_cm[1][-1] - r_cm[0][-1]),
        plateaus=(plateau(t, omega[0], omega0), plateau(t, omega[1], omega0)),
        finals=(float(omega[0][-1]), float(omega[1][-1])),
        largest=float(size[k]),
        largest_time=float(t[k]),
        parting_time=first_crossing(t, size, PARTING_BAND),
    )


def table(c: Comparison) -> str:
    """Return the comparison as lines of text."""
    parting = "never" if c.parting_time is None else f"{c.parting_time:.5g} s"
    width = max(len(c.first), len(c.second), 12)
    return "\n".join(
        [
            f"{'':34}{c.first:>{width}}  {c.second:>{width}}  difference",
            f"{f'omega({c.end:.4g} s) [rad/s]':34}{c.finals[0]:{width}.5f}  {c.finals[1]:{width}.5f}  "
            f"{c.finals[1] - c.finals[0]:+.5f}",
            f"{'omega/omega_0, mean of second half':34}{c.plateaus[0]:{width}.5f}  {c.plateaus[1]:{width}.5f}  "
            f"{c.plateaus[1] - c.plateaus[0]:+.5f}",
            f"theta({c.end:.4g} s) differs by {c.theta:+.5f} rad, r_CM by {c.r_cm:+.3g} m",
            f"largest |difference in omega|: {c.largest:.3%} of omega_0 at t = {c.largest_time:.5g} s",
            f"first more than {PARTING_BAND:.0%} of omega_0 apart: {parting}",
        ]
    )
