"""What a fit with somebody else's solver costs, and which search a given time allows.

flipproof's own equations make a flight in less than a millisecond and a usual search in seconds; a solver in a process
of its own may take a thousand times as long.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from flipproof.film.fit.estimate import USUAL, Effort
from flipproof.film.fit.problem import Problem

COARSE: Final = Effort(grid=(5, 4), starts=2, points=60, again=False)
"""A search of a quarter to a sixth of the flights: the same estimates, and ends of intervals that are less certain."""

MINUTES: Final = 10.0
"""Time that a fit with somebody else's solver may take unless another is given."""

FLIGHTS: Final = MappingProxyType({USUAL: (-2400, 1800), COARSE: (-100, 250)})
"""Search -> flights that it makes at most, about: the first number, and the second for each fitted parameter."""


@dataclass(frozen=True, slots=True)
class Budget:
    """The search that the time allows, the flights it makes at most, and the seconds that one takes."""

    effort: Effort
    flights: int
    seconds: float

    @property
    def time(self) -> str:
        """What the search takes at most, in words."""
        seconds = self.flights * self.seconds
        return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"

    @property
    def words(self) -> str:
        """What the search will take."""
        kind = "" if self.effort == USUAL else "; a coarse search, since --minutes allows no more"
        return f"{self.seconds:.2g} s a flight, at most about {self.flights} flights: {self.time}{kind}"


def affordable(problem: Problem, minutes: float = MINUTES) -> Budget:
    """Time a flight of somebody else's solver and return the best search that ``minutes`` allow.

    Raises
    ------
    ForeignError
        If the solver does not answer the throw from which the search begins.
    ValueError
        If no search can be made in the time; the message says how long the coarse one takes.
    """
    from flipproof.foreign.solving import solve

    took = []
    for _ in range(3):  # the fastest counts, since the first one loads the solver
        began = time.perf_counter()
        solve(problem.throw, spec=problem.solver, times=problem.measured.t)
        took.append(time.perf_counter() - began)
    return chosen(problem, min(took), minutes)


def chosen(problem: Problem, seconds: float, minutes: float) -> Budget:
    """Return the best search that ``minutes`` allow if a flight takes so many ``seconds``; raise as ``affordable``."""
    for effort, (once, each) in FLIGHTS.items():
        budget = Budget(effort, once + each * len(problem.free), seconds)
        if budget.flights * seconds <= 60.0 * minutes:
            return budget
    raise ValueError(
        f"model = {problem.solver!r} takes {seconds:.2g} s a flight; even a coarse fit makes about {budget.flights} of "
        f"them, {budget.time}, more than --minutes {minutes:g}: take fewer --slices, a longer step in the solver, "
        f"or more --minutes; flipproof place says which of flipproof's own equations fits as well in seconds"
    )
