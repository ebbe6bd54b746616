"""What the text says about the bottles that were really thrown, and which equation comes closest to that.

The measurements themselves are not published as numbers: a statement of the text is all there is to compare with.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from reports.findings import finite_or_none
from reports.paper.cases import ICE
from reports.paper.claim_runs import ClaimRuns
from reports.paper.claims import banded
from reports.paper.observe import FLAT, Flights, MissingFlightError, climb, normalised
from reports.paper.runs import SOLVERS
from reports.paper.statements import OMEGA, Reading, Verdict
from slicemodel import Trajectory
from slicemodel.observables import plateau

CAVEAT: Final = (
    "What is compared here is the text of the paper, not its data: the curves of its Fig. 4 are not available as "
    "numbers, and a statement such as “close to” is given a width that is chosen here."
)

UP_TO_FIVE: Final = 0.05
"""Share of omega_0 by which a lowest mean may miss a fifth."""

CLEAR: Final = 0.8
"""omega / omega_0 below which a bottle is clearly slower."""

Value = Callable[[Flights], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """One statement of the text about the experiment.

    Parameters
    ----------
    id, place, says : as in ``Statement``
    means : str - the number that is compared
    read : flights of one equation -> that number [unit]
    measured : (low, high) - what the text gives for it
    slack : float - by how much it may be missed and still count as met
    """

    id: str
    place: str
    says: str
    means: str
    read: Value
    unit: str
    measured: tuple[float, float]
    slack: float = 0.0

    def miss(self, value: float) -> float:
        """Return by how much a number lies outside what the text gives; 0 inside."""
        low, high = self.measured
        return max(0.0, low - value, value - high)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One statement with the number of every equation.

    Parameters
    ----------
    observation : Observation
    readings : solver -> Reading; a solver without flights has NaN and the reason as its note
    """

    observation: Observation
    readings: Mapping[str, Reading]

    @property
    def closest(self) -> tuple[str, ...]:
        """Return the equations that come closest: several where bands do not tell them apart, none if none flew."""
        misses = {
            solver: (self.observation.miss(reading.value), reading.band)
            for solver, reading in self.readings.items()
            if math.isfinite(reading.value)
        }
        if not misses:
            return ()
        least, band = min(misses.values())
        return tuple(solver for solver, (miss, own) in misses.items() if miss <= least + band + own)

    def verdict(self, solver: str) -> Verdict:
        """Return whether an equation agrees with the text."""
        return self.readings[solver].verdict

    def to_mapping(self) -> dict[str, Any]:
        """Return the comparison as JSON-ready data."""
        return {
            "id": self.observation.id,
            "place": self.observation.place,
            "says": self.observation.says,
            "means": self.observation.means,
            "closest": list(self.closest),
            "equations": {
                solver: {
                    "value": finite_or_none(reading.value),
                    "band": finite_or_none(reading.band),
                    "unit": reading.unit,
                    "verdict": reading.verdict,
                    "note": reading.note,
                }
                for solver, reading in self.readings.items()
            },
        }


def steady_level(run: Trajectory) -> float:
    """Return the mean of omega / omega_0 over the second half of the flight, the average of Fig. 4d."""
    return plateau(run.t, run.omega, run.scenario.omega0)


def ice_drift(flights: Flights) -> float:
    """Return the largest |omega / omega_0 - 1| of the bottle of ice."""
    return float(np.abs(normalised(flights.run(ICE)) - 1.0).max())


def level_of(filling: float) -> Value:
    """Return a reader of the average at one filling."""

    def read(flights: Flights) -> float:
        return steady_level(flights.at("filling", filling))

    return read


def slowest_filling(flights: Flights) -> float:
    """Return the filling with the lowest average."""
    levels = {case.value: steady_level(run) for case, run in flights.members("filling")}
    return min(levels, key=lambda filling: levels[filling])


def lowest_level(flights: Flights) -> float:
    """Return the lowest average of all fillings."""
    return min(steady_level(run) for _, run in flights.members("filling"))


def climb_at_a_third(flights: Flights) -> float:
    """Return by how much the bottle of 0.33 spins up again after it has slowed down."""
    return climb(flights.at("filling", 0.33))


OBSERVATIONS: Final = (
    Observation(
        id="ice",
        place="section 3, Fig. 4a",
        says="A bottle of ice keeps its angular velocity, about 20 rad/s.",
        means="largest |ω/ω₀ − 1|; every flight is released at 20 rad/s",
        read=ice_drift,
        unit="",
        measured=(0.0, 0.0),
        slack=0.01,
    ),
    Observation(
        id="two-phases",
        place="section 3, Fig. 4b",
        says="At M̃ = 0.33 ω first decays quickly and then stays constant.",
        means="largest climb of ω over its lowest value until then",
        read=climb_at_a_third,
        unit=OMEGA,
        measured=(0.0, 0.0),
        slack=FLAT,
    ),
    Observation(
        id="tenth-like-ice",
        place="section 3, Fig. 4c, 4d",
        says="M̃ = 0.10 behaves very much like ice.",
        means="mean ω over the second half of the flight",
        read=level_of(0.1),
        unit=OMEGA,
        measured=(1.0, 1.0),
        slack=FLAT,
    ),
    Observation(
        id="minimum",
        place="section 3, Fig. 4d",
        says="ω/ω₀ is lowest between M̃ = 0.25 and 0.50.",
        means="filling with the lowest mean ω over the second half of the flight",
        read=slowest_filling,
        unit="",
        measured=(0.25, 0.5),
    ),
    Observation(
        id="three-quarters",
        place="section 3, Fig. 4d",
        says="At M̃ = 0.75 ω is already clearly reduced.",
        means="mean ω over the second half of the flight, at most 0.8",
        read=level_of(0.75),
        unit=OMEGA,
        measured=(0.0, CLEAR),
    ),
    Observation(
        id="five-times",
        place="section 6",
        says="ω becomes up to five times lower than that of a rigid filling.",
        means="lowest mean ω over the second half of the flight, of all fillings",
        read=lowest_level,
        unit=OMEGA,
        measured=(0.2, 0.2),
        slack=UP_TO_FIVE,
    ),
)


def compare(observation: Observation, flights: Flights) -> Reading:
    """Return the number of one equation with its band; NaN with the reason where a flight is missing."""
    low, high = observation.measured
    admissible = (low - observation.slack, high + observation.slack)

    def read(each: Flights) -> tuple[Reading, ...]:
        value = observation.read(each)
        return (Reading(name=observation.means, value=value, unit=observation.unit, admissible=admissible),)

    try:
        return banded(read, flights)[0]
    except MissingFlightError as reason:
        return Reading(
            name=observation.means, value=math.nan, unit=observation.unit, admissible=admissible, note=str(reason)
        )


def compare_all(runs: ClaimRuns) -> tuple[Comparison, ...]:
    """Return every statement about the experiment with the numbers of all equations."""
    flights = {solver: runs.flights(solver) for solver in SOLVERS}
    return tuple(
        Comparison(
            observation=observation,
            readings={solver: compare(observation, each) for solver, each in flights.items()},
        )
        for observation in OBSERVATIONS
    )


def agreement(comparisons: tuple[Comparison, ...]) -> dict[str, int]:
    """Return how many statements each equation agrees with."""
    return {
        solver: sum(comparison.verdict(solver) == "holds" for comparison in comparisons) for solver in SOLVERS
    }  # fmt: skip


def times_closest(comparisons: tuple[Comparison, ...]) -> dict[str, int]:
    """Return for how many statements each equation is the closest, or one of those."""
    return {solver: sum(solver in comparison.closest for comparison in comparisons) for solver in SOLVERS}


def closest_overall(comparisons: tuple[Comparison, ...]) -> tuple[str, ...]:
    """Return the equation that agrees with most statements; among several, those that are most often the closest."""
    agrees, closest = agreement(comparisons), times_closest(comparisons)
    best = max((agrees[solver], closest[solver]) for solver in SOLVERS)
    return tuple(solver for solver in SOLVERS if (agrees[solver], closest[solver]) == best)
