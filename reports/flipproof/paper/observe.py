"""What the statements of the paper are read off: numbers of one flight, and the flights of one equation by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from flipproof.frame.solvers import Missing, RunResult
from flipproof.paper.cases import family
from slicemodel import Trajectory
from slicemodel.observables import PLATEAU_SHARE, plateau, plateau_of_points, plateau_of_width
from slicemodel.trajectory import BASE, CAP, FloatArray

FLAT: Final = 0.1
FLAT_WHY: Final = "“Flat” is a word of ours for a rise of at most 0.1 ω₀: 2 rad/s of the 20 on the axis."
"""Share of omega_0 by which a flat omega may rise again."""

SUPERIMPOSED: Final = 0.05
SUPERIMPOSED_WHY: Final = (
    "“Superimposed” is a word of ours for at most 0.05 ω₀ apart: 1 rad/s of 20, about the width of a drawn line."
)
"""Root-mean-square difference, as a share of omega_0, up to which two curves count as one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseFlights:
    """The flights of one equation by the key of their case; ``seen`` are those that were looked at.

    ``halved`` are the same flights with half the slices wherever their number is not the subject, ``half_steps`` those
    with half the time steps; None if there are none, or the equation chooses its own steps.
    """

    solver: str
    results: Mapping[str, RunResult]
    halved: CaseFlights | None = None
    half_steps: CaseFlights | None = None
    seen: dict[str, Trajectory] = field(default_factory=dict)

    def run(self, key: str) -> Trajectory:
        """Return one flight; raises Missing if it was not made, or did not reach its end."""
        if key not in self.results:
            raise Missing(f"{key!r} was not flown by {self.solver}")
        run = self.seen[key] = self.results[key].whole
        return run

    def at(self, name: str, value: float) -> Trajectory:
        """Return the flight of a family where what varies has this value; raises Missing if it is not there."""
        for case in family(name):
            if abs(case.value - value) <= 1e-9 * max(1.0, abs(value)):
                return self.run(case.key)
        raise Missing(f"family {name!r} has no case at {value:g}")

    def measured(
        self, name: str, of: Callable[[Trajectory], float], low: float = -math.inf, high: float = math.inf
    ) -> dict[float, float]:
        """Return a number of every flight of a family with ``low`` <= value <= ``high``, in the order of the family.

        Raises Missing if any flight is not there, but for those whose number of slices is too large for this solver.
        """
        cases = [case for case in family(name) if not case.slices_vary or case.key in self.results]
        flown = [(case.value, self.run(case.key)) for case in cases]
        return {value: of(run) for value, run in flown if low <= value <= high}

    @property
    def flown(self) -> str:
        """Slices of the flights looked at, and their time steps where they were chosen; empty if there were none."""
        slices = [run.scenario.n_slices for run in self.seen.values() if not run.scenario.frozen]
        steps = [run.settings["steps"] for run in self.seen.values() if run.settings.get("steps")]
        ends = ((name, min(counts), max(counts)) for name, counts in (("N", slices), ("P", steps)) if counts)
        return ", ".join(f"{name} = {low}" + (f" to {high}" if high > low else "") for name, low, high in ends)


# ---------------------------------------------------------------------- numbers of one flight


def normalised(run: Trajectory) -> FloatArray:
    """Return omega / omega_0, shape (P,)."""
    return run.omega / run.scenario.omega0


def level(run: Trajectory) -> float:
    """Return omega_f / omega_0 without its grid: the lowest mean over 2 % of the flight."""
    width = PLATEAU_SHARE * run.scenario.duration
    return plateau_of_width(run.t, run.omega, run.scenario.omega0, width).level


def level_by_points(run: Trajectory) -> float:
    """Return omega_f / omega_0 by the paper's points around the minimum."""
    return plateau_of_points(run.t, run.omega, run.scenario.omega0).level


def steady_level(run: Trajectory) -> float:
    """Return the mean of omega / omega_0 over the second half of the flight, the average of Fig. 4d."""
    return plateau(run.t, run.omega, run.scenario.omega0)


def late_mean(run: Trajectory) -> float:
    """Return the mean of omega / omega_0 over the last tenth of the flight."""
    return float(normalised(run)[run.t >= 0.9 * run.scenario.duration].mean())


def late_rise(run: Trajectory) -> float:
    """Return by how much the last tenth of the flight lies over the plateau, as a share of omega_0."""
    return late_mean(run) - level(run)


def climb(run: Trajectory) -> float:
    """Return the most by which omega / omega_0 rises again over its lowest value until then; 0 if it never does."""
    curve = normalised(run)
    return float((curve - np.minimum.accumulate(curve)).max())


def drop_time(run: Trajectory) -> float:
    """Return at which share of the flight omega is half way down to its plateau; NaN if it drops by less than FLAT."""
    curve, low = normalised(run), level(run)
    if 1.0 - low < FLAT:
        return float("nan")
    half = (1.0 + low) / 2
    k = int(np.flatnonzero(curve <= half)[0])
    share = (curve[k - 1] - half) / (curve[k - 1] - curve[k])
    return float(run.t[k - 1] + share * (run.t[k] - run.t[k - 1])) / run.scenario.duration


def distance(run: Trajectory, other: Trajectory, stretch: float = 1.0, delay: float = 0.0) -> float:
    """Return the root-mean-square difference of two omega / omega_0 over s = t / T.

    The other one is stretched in time and put off: it is read at s / stretch - delay. NaN if these are not finite.
    """
    if not math.isfinite(stretch + delay):
        return math.nan
    times = run.t / run.scenario.duration / stretch - delay
    both = (times >= 0.0) & (times <= 1.0)
    curve = np.interp(times[both], other.t / other.scenario.duration, normalised(other))
    return float(np.sqrt(np.mean((normalised(run)[both] - curve) ** 2)))


def shape_distance(run: Trajectory, other: Trajectory) -> float:
    """Return ``distance`` with the time of each flight counted in its own time to half the drop; NaN if one has none.

    What is left is a difference of shape: one curve that takes longer to fall, all along, is the same.
    """
    return distance(run, other, stretch=drop_time(run) / drop_time(other))


def delayed_distance(run: Trajectory, other: Trajectory) -> float:
    """Return ``distance`` with one flight moved in time so that both reach half their drop at once; NaN as above."""
    return distance(run, other, delay=drop_time(run) - drop_time(other))


def largest_share_near_cap(run: Trajectory) -> float:
    """Return the largest share of the water that is in the cap's half of the bottle at any one time."""
    return float((run.r < run.scenario.bottle.length / 2).mean(axis=1).max())


class Departure(NamedTuple):
    """When a slice leaves the end it lay on, and the outward force of Eq. 8 on it by mass [m/s^2].

    ``outward`` is omega^2 (r - r_CM) + g cos(theta), positive where it presses on the end, so that the weight has not
    won; ``step`` is what it changes between two output times.
    """

    time: float
    outward: float
    step: float


def departures(run: Trajectory) -> list[Departure]:
    """Return every departure of a slice from an end, by 1 mm; its time is that at which it began to move away."""
    scenario = run.scenario
    pull = (run.omega**2)[:, np.newaxis] * (run.r - run.r_cm[:, np.newaxis])
    weight = (scenario.gravity * np.cos(run.theta))[:, np.newaxis]
    events = []
    for end, wall in ((BASE, scenario.r_max), (CAP, scenario.r_min)):
        gap, outward = end * (wall - run.r), end * (pull + weight)
        near = gap <= 1e-3
        for k, i in zip(*np.nonzero(near[:-1] & ~near[1:]), strict=True):
            rests = np.flatnonzero(np.diff(gap[: k + 1, i]) <= 0.0)
            began = int(rests[-1]) + 1 if rests.size else 0
            force, later = outward[[began, min(began + 1, len(outward) - 1)], i].tolist()
            events.append(Departure(float(run.t[began]), force, abs(later - force)))
    return sorted(events)
