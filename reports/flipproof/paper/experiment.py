"""What the text says about the bottles that were really thrown, and which equation comes closest to that.

The measurements themselves are not published as numbers: a statement of the text is all there is to compare with.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any, Final

import numpy as np

from flipproof.paper.cases import ICE, paper_throw
from flipproof.paper.claims_figures_6_7 import (
    CLEAR,
    MAJORITY,
    RANGE_NAME,
    filling_of_slow_down,
    plateau_range_words,
    share_in_range,
)
from flipproof.paper.observe import FLAT, CaseFlights, climb, normalised, steady_level
from flipproof.paper.runs import CONTESTANTS
from flipproof.paper.statements import OMEGA, Reading, judge_sense
from slicemodel.observables import static_toppling_angle

FREEDOM: Final = (
    "Freedom of choice: the paper chose α and β so that its program resembles these bottles, and whatever is cut into "
    "slices is flown with both; column and rods know no β, and nothing of theirs was chosen here."
)

CAVEAT: Final = (
    "What is compared here is the text of the paper, not its data: the curves of its Fig. 4 are not available as "
    "numbers, and a statement such as “close to” is given a width that is chosen here."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """One statement of the text about the experiment, with the number of every equation.

    Parameters
    ----------
    id, place, says : as in ``Statement``
    means : str - the number that is compared
    read : flights of one equation -> that number [unit]
    measured : (low, high) - what the text gives for it
    slack : float - by how much it may be missed and still count as met
    why : str - why the width is what it is
    numbers : flights -> the numbers behind, in words
    remark : str - what else must be known to judge a miss
    ranked : bool - whether a smaller miss comes closer
    readings : solver -> Reading; a solver without flights has NaN and the reason as its note
    """

    id: str
    place: str
    says: str
    means: str
    read: Callable[[CaseFlights], float]
    unit: str
    measured: tuple[float, float]
    why: str
    slack: float = 0.0
    numbers: Callable[[CaseFlights], str] = lambda _: ""
    remark: str = ""
    ranked: bool = True
    readings: Mapping[str, Reading] = field(default_factory=dict)

    @property
    def closest(self) -> tuple[str, ...]:
        """Return the equations that come closest, all that bands do not tell apart; none if misses are no measure."""
        low, high = self.measured
        misses = {
            solver: (max(0.0, low - reading.value, reading.value - high), reading.band)
            for solver, reading in self.readings.items()
            if math.isfinite(reading.value)
        }
        if not misses or not self.ranked:
            return ()
        min_miss, band = min(misses.values())
        # Arithmetic alone explains a difference below 1e-12.
        return tuple(solver for solver, (miss, margin) in misses.items() if miss <= min_miss + band + margin + 1e-12)

    @property
    def discriminates(self) -> bool:
        """Return whether any two of the equations that were read differ in their verdict."""
        return len({reading.verdict for reading in self.readings.values() if math.isfinite(reading.value)}) > 1

    def to_mapping(self) -> dict[str, Any]:
        """Return the statement as JSON-ready data."""
        return {name: getattr(self, name) for name in ("id", "place", "says", "means", "why", "remark")} | {
            "closest": list(self.closest),
            "discriminates": self.discriminates,
            "equations": {solver: reading.to_mapping() for solver, reading in self.readings.items()},
        }


def _landing_angles(flights: CaseFlights) -> dict[float, float]:
    """Return theta at the paper's time of landing, by filling of the bottles that were thrown and filmed [degrees]."""
    filmed = (0.1, 0.25, 0.33, 0.5, 0.75)
    return {filling: math.degrees(float(flights.at("filling", filling).theta[-1])) for filling in filmed}


def landing_angles_words(flights: CaseFlights) -> str:
    """Return theta at the time of landing, and how far that is from the nearest upright, by filling."""
    angles = _landing_angles(flights)
    words = (f"{angle:.0f}° at {fill:g} ({math.remainder(angle, 360.0):+.0f}°)" for fill, angle in angles.items())
    return "θ(T): " + ", ".join(words).replace("-", "\N{MINUS SIGN}")


def worst_landing(flights: CaseFlights) -> float:
    """Return by how much the tilt on landing exceeds the angle at which the bottle topples, the most [degrees]."""
    return max(
        abs(math.remainder(angle, 360.0)) - math.degrees(static_toppling_angle(paper_throw(filling)))
        for filling, angle in _landing_angles(flights).items()
    )


def ice_lands_at() -> float:
    """Return the angle of the bottle of ice after the paper's T, which no model enters [degrees]."""
    throw = paper_throw()
    return math.degrees(throw.theta0 + throw.omega0 * throw.duration)


OBSERVATIONS: Final = (
    Observation(
        id="ice",
        place="section 3, Fig. 4a",
        says="A bottle of ice keeps its angular velocity, about 20 rad/s.",
        means="largest |ω/ω₀ − 1|; every flight is released at 20 rad/s",
        read=lambda flights: float(np.abs(normalised(flights.run(ICE)) - 1.0).max()),
        unit="",
        measured=(0.0, 0.0),
        slack=0.01,
        why="A hundredth of ω₀: less than a film shows.",
    ),
    Observation(
        id="two-phases",
        place="section 3, Fig. 4b",
        says="At M̃ = 0.33 ω first decays quickly and then stays constant.",
        means="largest climb of ω over its lowest value until then",
        read=lambda flights: climb(flights.at("filling", 0.33)),
        unit=OMEGA,
        measured=(0.0, 0.0),
        slack=FLAT,
        why="“Flat” is a word of ours: a rise of at most 0.1 ω₀.",
    ),
    Observation(
        id="tenth-like-ice",
        place="section 3, Fig. 4c, 4d",
        says="M̃ = 0.10 behaves very much like ice.",
        means="mean ω over the second half of the flight",
        read=lambda flights: steady_level(flights.at("filling", 0.1)),
        unit=OMEGA,
        measured=(1.0, 1.0),
        slack=FLAT,
        why="“Very close” is taken as 0.1 ω₀.",
    ),
    Observation(
        id="minimum",
        place="section 3, Fig. 4d",
        says="ω/ω₀ is lowest between M̃ = 0.25 and 0.50.",
        means="filling with the lowest mean ω over the second half of the flight",
        read=lambda flights: min(flights.measured("filling", steady_level).items(), key=itemgetter(1))[0],
        unit="",
        measured=(0.25, 0.5),
        why="The range is the paper's.",
    ),
    Observation(
        id="three-quarters",
        place="section 3, Fig. 4d",
        says="At M̃ = 0.75 ω is already clearly reduced.",
        means="mean ω over the second half of the flight, at most 0.8",
        read=lambda flights: steady_level(flights.at("filling", 0.75)),
        unit=OMEGA,
        measured=(0.0, CLEAR),
        why="“Significant” is taken as a fifth of ω₀.",
    ),
    Observation(
        id="five-times",
        place="section 6",
        says="ω becomes up to five times lower than that of a rigid filling.",
        means="lowest mean ω over the second half of the flight, of all fillings",
        read=lambda flights: min(flights.measured("filling", steady_level).values()),
        unit=OMEGA,
        measured=(0.2, 0.2),
        slack=0.05,
        why="A fifth, with 0.05 ω₀ either way.",
    ),
    Observation(
        id="plateau-range",
        place="section 5, Fig. 7b",
        says="In most cases ω_f/ω₀ is 0.2 to 0.5 at intermediate fillings, “as observed experimentally”.",
        means=RANGE_NAME,
        read=share_in_range,
        unit="",
        measured=(MAJORITY, 1.0),
        why="“Most” is more than half; the range is the paper's, the choice of fillings ours.",
        numbers=plateau_range_words,
        remark="The only interval that the text measures. It stands above among what the paper says of its model, too.",
    ),
    Observation(
        id="change-of-behaviour",
        place="section 5, Fig. 4d",
        says="The bottle begins to slow down at a filling between 0.1 and 0.2.",
        means="filling at which ω_f falls to 0.8 ω₀",
        read=filling_of_slow_down,
        unit="",
        measured=(0.1, 0.2),
        why="The range is the paper's; 0.8 ω₀ is a choice of ours for “slower”.",
        remark="Resting water lies below the centre of mass, and is not thrown towards the cap, up to h/L = ε/(1 + ε), "
        "M̃ = 0.1417: inside the measured range, and where Eq. 13b has its maximum.",
    ),
    Observation(
        id="half-a-turn",
        place="section 3, below Fig. 3",
        says="The bottle spins by more than half a revolution: θ exceeds π.",
        means="smallest θ at T = 0.5 s, of the fillings filmed",
        read=lambda flights: min(_landing_angles(flights).values()),
        unit="°",
        measured=(180.0, math.inf),
        why="The sentence is an inequality.",
    ),
    Observation(
        id="landing-angle",
        place="section 3, Fig. 3 and 4",
        says="Every bottle lands upright: θ ends close to 0 modulo 2π.",
        means="tilt at T = 0.5 s minus the θ_c of that filling at rest (Eq. 13b), the largest of the fillings filmed",
        read=worst_landing,
        unit="°",
        measured=(-math.inf, 0.0),
        why="θ_c is the largest tilt from which a bottle at rest comes back; more than that is no upright landing.",
        numbers=landing_angles_words,
        remark="Two explanations, between which the text does not decide. θ₀ = 90°, ω₀ = 20 rad/s and T = 0.5 s may "
        "not be one throw: each is stated as typical, one set for all fillings, and with them ice, whose ω no model "
        f"changes, would come to {ice_lands_at():.0f}°, {abs(math.remainder(ice_lands_at(), 360.0)):.0f}° from "
        "upright. Or the equation turns the bottle by a wrong angle. Misses modulo a turn are not ranked.",
        ranked=False,
    ),
)


def compare(observation: Observation, flights: CaseFlights) -> Reading:
    """Return the number of one equation with its band; NaN with the reason where a flight is missing."""
    low, high = observation.measured
    bounds = (low - observation.slack, high + observation.slack)

    def read(flown: CaseFlights) -> Iterator[Reading]:
        yield Reading(observation.means, observation.read(flown), observation.unit, bounds)

    judgement = judge_sense(read, flights)
    if judgement.aside:
        return Reading(observation.means, math.nan, observation.unit, bounds, note=judgement.aside)
    note = "; ".join(filter(None, (observation.numbers(flights), judgement.flown)))
    return replace(judgement.readings[0], note=note)


def compare_all(flights: Sequence[CaseFlights]) -> tuple[Observation, ...]:
    """Return every statement about the experiment with the numbers of all equations."""
    return tuple(
        replace(observation, readings={equation.solver: compare(observation, equation) for equation in flights})
        for observation in OBSERVATIONS
    )


def standing(observations: Sequence[Observation]) -> dict[str, tuple[int, int]]:
    """Return with how many statements each equation agrees, and for how many it is the closest, or one of those."""
    return {
        solver: (
            sum(observation.readings[solver].verdict == "holds" for observation in observations),
            sum(solver in observation.closest for observation in observations),
        )
        for solver in CONTESTANTS
        if all(solver in observation.readings for observation in observations)
    }


def closest_overall(observations: Sequence[Observation]) -> tuple[str, ...]:
    """Return the equation that agrees with most statements; among several, those that are most often the closest."""
    counts = standing(observations)
    return tuple(solver for solver in counts if counts[solver] == max(counts.values()))
