"""Flights that ought to be one flight, and how far their omega(t) diverge.

The members of an ensemble differ in one small thing: a late digit of the release, a tolerance, the method, the engine.
All differences are fractions of |omega_0|. Nothing is cut off where they become large.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from flipproof.frame.findings import Finding, regression
from flipproof.frame.solvers import Missing
from slicemodel import Trajectory
from slicemodel.trajectory import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble:
    """Flights at the times of the first, which stands for all; the others are interpolated linearly.

    Parameters
    ----------
    t : (P,) - times of the first member [s]
    omega : (M, P) - omega of the members, NaN after the end of each [rad/s]
    omega0 : what differences are divided by [rad/s]
    band : width up to which one member stands for all, fraction of omega_0
    ended : when the first member ended that stopped early [s]; None: all reached the end
    """

    t: FloatArray
    omega: FloatArray
    omega0: float
    band: float
    ended: float | None

    @classmethod
    def of(cls, members: Sequence[Trajectory], band: float) -> Self:
        """Return the ensemble of two flights or more, the unchanged one first."""
        t = members[0].t
        stopped = [float(member.t[-1]) for member in members if member.status not in ("ok", "escaped")]
        return cls(
            t=t,
            omega=np.array([np.interp(t, member.t, member.omega, right=np.nan) for member in members]),
            omega0=abs(members[0].scenario.omega0),
            band=band,
            ended=min(stopped, default=None),
        )

    @property
    def width(self) -> FloatArray:
        """Largest minus smallest omega / omega_0, shape (P,); infinite from where a member has ended."""
        width = np.ptp(self.omega, axis=0) / self.omega0
        return np.where(np.isnan(width), np.inf, width)

    @property
    def change(self) -> FloatArray:
        """Largest distance of a member from the first, shape (P,); infinite from where a member has ended."""
        change = np.max(np.abs(self.omega - self.omega[0]) / self.omega0, axis=0)
        return np.where(np.isnan(change), np.inf, change)

    @property
    def largest(self) -> float:
        """Largest width."""
        return float(self.width.max())

    @property
    def horizon(self) -> float | None:
        """First time at which the width exceeds the band [s]; None: never."""
        return first_crossing(self.t, self.width, self.band)


def first_crossing(t: FloatArray, size: FloatArray, band: float) -> float | None:
    """Return when ``size`` first exceeds ``band``, linear between points; None if never."""
    above = np.flatnonzero(size > band)
    if not len(above):
        return None
    if (k := int(above[0])) == 0:
        return float(t[0])
    share = (band - size[k - 1]) / (size[k] - size[k - 1])
    return float(t[k - 1] + share * (t[k] - t[k - 1]))


def difference(first: Trajectory, second: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Return the first flight's times that both cover [s], and there (omega_second - omega_first) / omega_0.

    The second is linear between its own times.
    """
    t = first.t[first.t <= min(first.t[-1], second.t[-1])]
    return t, (np.interp(t, second.t, second.omega) - first.omega[: len(t)]) / first.scenario.omega0


def largest_change(first: Trajectory, second: Trajectory) -> float:
    """Return max |omega_second - omega_first| / |omega_0|; NaN if either run is not complete or the grids differ."""
    if len(first.t) != len(second.t) or not np.array_equal(first.t, second.t) or not (first.ok and second.ok):
        return math.nan
    return float(np.abs(difference(first, second)[1]).max())


def claim_change(
    id_: str, title: str, first: Trajectory, second: Trajectory, band: float, *, differ: bool, note: str = ""
) -> Finding:
    """Return the claim that two runs agree; a run compared with itself, or incomplete, proves nothing.

    Runs that do not ``differ`` in their settings, or an incomplete one, raise Missing.
    """
    if not differ:
        raise Missing("the two runs have the same settings: comparing them proves nothing")
    for run in (first, second):
        if not run.ok:
            raise Missing(f"{run.method}: {run.message or run.status}")
    return regression(id_, title, largest_change(first, second), "of ω₀", (0.0, band), note)
