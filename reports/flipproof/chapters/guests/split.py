"""From a guest to free flight: the difference split over the assumptions that the guest's equation still makes.

    plateau of free flight - plateau of the guest = rest + sum of fair shares

The rest is the plateau of the guest's equation minus that of the guest: its own error, and what is no assumption of the
ladder. A fair share is the mean over all orders of mending the assumptions (``foreign.place``).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from flipproof.chapters.waterfall.study import equation_run
from flipproof.foreign.certify import Certificate
from flipproof.foreign.contract import Traits
from flipproof.foreign.place import changes_of, mean, name_of, switches_of
from flipproof.frame.chapter import Flights, Missing, Run
from ode_reference.models import MODELS
from ode_reference.switches import Switches
from slicemodel import Scenario, Trajectory
from slicemodel.observables import plateau

FREE = MODELS["free-flight"].switches


@dataclass(frozen=True, slots=True, kw_only=True)
class Split:
    """How a guest's plateau ``start`` becomes that of its equation, ``placed``, and that of free flight, ``end``.

    ``bars`` maps each switch to its fair share, ``ranges`` to the least and the largest change by it in a single order.
    """

    equation: str
    start: float
    placed: float
    end: float
    bars: Mapping[str, float]
    ranges: Mapping[str, tuple[float, float]]

    @property
    def rest(self) -> float:
        """What no assumption of the ladder explains."""
        return self.placed - self.start

    def to_mapping(self) -> dict[str, Any]:
        """Return the split as JSON-ready data."""
        ranges = {name: list(each) for name, each in self.ranges.items()}
        parts = {"rest": self.rest, "bars": dict(self.bars), "ranges": ranges}
        return {"equation": self.equation, "guest": self.start, "free-flight": self.end, **parts}


def switches_made(traits: Traits | None, certificate: Certificate | None, nearest: str | None) -> Switches | None:
    """Return the switches of the equation that a guest declares, else of its place, else of the ``nearest`` rung.

    None if nothing is known of it, or if what it declares converges to no equation of the ladder.
    """
    if traits is not None and traits.equation is not None:
        try:
            return switches_of(traits.equation)
        except ValueError:
            return None
    results = () if certificate is None else certificate.results
    places = [r.found.facts["place"] for r in results if r.found is not None and "place" in r.found.facts]
    if places:
        return Switches.from_name(places[0]["switches"])
    return None if nearest is None else switches_of(nearest)


def plan_splits(starts: Iterable[Switches], throw: Scenario) -> list[Run]:
    """Return the runs that the splits need; those of the waterfall of the same throw are among them."""
    asked: dict[Run, None] = {}

    def ask(switches: Switches) -> float:
        asked[equation_run(throw, switches)] = None
        return 0.0

    for start in starts:
        ask(start)
        ask(FREE)
        changes_of(start, FREE, ask)
    return list(asked)


def split(run: Trajectory, start: Switches, flights: Flights) -> Split:
    """Split the difference between a guest's run and free flight on the same throw.

    Raises
    ------
    Missing - if a run is not whole
    ArithmeticError - if rest and bars miss the whole difference by more than round-off
    """

    def read(trajectory: Trajectory) -> float:
        return plateau(trajectory.t, trajectory.omega, trajectory.scenario.omega0)

    def value(switches: Switches) -> float:
        return read(flights[equation_run(run.scenario, switches)].whole)

    if len(run.t) < 2 or run.t[-1] < run.scenario.duration:
        raise Missing("the guest's run does not reach the end of the flight")
    changes = changes_of(start, FREE, value)
    found = Split(
        equation=name_of(start),
        start=read(run),
        placed=value(start),
        end=value(FREE),
        bars={name: mean(each) for name, each in changes.items()},
        ranges={name: (min(c for _, c in each), max(c for _, c in each)) for name, each in changes.items()},
    )
    missed = found.end - found.start - found.rest - sum(found.bars.values())
    if not abs(missed) <= 1e-12 * (1.0 + abs(found.start) + sum(map(abs, found.bars.values()))):
        raise ArithmeticError(f"rest and bars miss the difference to free flight by {missed:.3g}")
    return found
