"""Where two trajectories part: how much, when, and after which impact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flipproof.curves.ensemble import difference, first_crossing
from slicemodel import Impact, Trajectory
from slicemodel.trajectory import FloatArray

PARTING_BAND = 0.01
"""Two solvers part when their omega differ by this fraction of omega_0."""


def percent(share: float) -> str:
    """Return a fraction as the page prints it: two digits, more if they hide that it is above ``PARTING_BAND``."""
    share += 0.0  # -0.0
    if abs(share) >= 0.995:
        return f"{100 * share:.0f} %"
    digits, limit = 2, f"{100 * PARTING_BAND:.2g}"
    while abs(share) > PARTING_BAND and digits < 9 and f"{100 * abs(share):.{digits}g}" == limit:
        digits += 1
    return f"{100 * share:.{digits}g} %"


def moved(value: float, finer: float, slices: int) -> str:
    """Return how far a fraction moves with the number of slices, as in "0.35 % of ω₀ less at N = 100"."""
    change = finer - value
    words = "the same" if abs(change) < 1e-9 else f"{percent(abs(change))} of ω₀ {'more' if change > 0 else 'less'}"
    return f"{words} at N = {slices}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Two runs of one throw, compared on their common times.

    Parameters
    ----------
    name, first, second : the assumption that separates the two, and the labels of the runs
    t, omega : (P,) - times [s] and (omega_second - omega_first) / omega_0, signed
    largest, largest_time, final : max |omega| over time and when it is reached [s]; omega at the last common time
    parting_time : first time |omega| exceeds PARTING_BAND, interpolated [s]; None if it never does
    parting_impact, impacts_of : last impact at or before the parting, and the label of the run that has it
    band : numerical uncertainty of ``largest``: the sum of the two runs' own
    finer : another number of slices than ``slices``, and ``largest`` of the same two solvers at it
    """

    name: str
    first: str
    second: str
    t: FloatArray
    omega: FloatArray
    largest: float
    largest_time: float
    final: float
    parting_time: float | None
    parting_impact: Impact | None
    impacts_of: str
    band: float | None
    slices: int
    finer: tuple[int, float] | None

    @property
    def moment(self) -> str:
        """The parting in words."""
        if self.parting_time is None:
            return f"stay within {percent(PARTING_BAND)} of ω₀"
        words = f"first differ by more than {percent(PARTING_BAND)} of ω₀ at t = {self.parting_time * 1e3:.1f} ms"
        if self.parting_impact is not None:
            impact = self.parting_impact
            words += (
                f"; the last impact of {self.impacts_of} before that is of slice {impact.slice} on the {impact.end} at "
                f"{impact.time * 1e3:.1f} ms"
            )
        return words


def study_difference(
    name: str,
    first: Trajectory,
    second: Trajectory,
    *,
    impacts_of: Trajectory | None = None,
    band: float | None = None,
    finer: tuple[Trajectory, Trajectory] | None = None,
) -> Difference:
    """Compare two runs of one throw.

    The two are compared on the first run's times, up to where the shorter one ends; the second is interpolated
    linearly if its times differ. ``impacts_of`` is the run whose impacts the parting is set against; ``finer`` are the
    same two solvers at more slices.
    """
    t, omega = difference(first, second)
    size = np.abs(omega)
    k = int(size.argmax())
    parting = first_crossing(t, size, PARTING_BAND)
    impacts = None if impacts_of is None else impacts_of.impacts
    before = 0 if parting is None or impacts is None else int(np.searchsorted(impacts.time, parting, side="right"))
    return Difference(
        name=name,
        first=first.label,
        second=second.label,
        t=t,
        omega=omega,
        largest=float(size[k]),
        largest_time=float(t[k]),
        final=float(omega[-1]),
        parting_time=parting,
        parting_impact=impacts[before - 1] if impacts is not None and before else None,
        impacts_of="" if impacts_of is None else impacts_of.label,
        band=band,
        slices=first.scenario.n_slices,
        finer=None if finer is None else (finer[0].scenario.n_slices, study_difference(name, *finer).largest),
    )
