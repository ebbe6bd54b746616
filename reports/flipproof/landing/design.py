"""Which throws a study makes, as a sweep numbers them: case by case, one row a throw."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate, groupby
from typing import Any, Final

from flipproof.landing.aim import Aim
from flipproof.landing.scatter import Scatter, scattered
from flipproof.landing.work import LANDING, REFERENCE
from flipproof.sweep.axes import Axis, Choices
from flipproof.sweep.design import Point
from flipproof.sweep.work import LAND

AXES: Final[tuple[Axis, ...]] = (Choices("cell", "whole", ()), Choices("place", "whole", ()))
"""Columns that say which case a row belongs to, and which of its throws it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Throws about one aim onto one table, landed by one program under one law.

    Without ``law`` it is the program's own, or ice; ``program`` is "ode_reference" or an engine of
    ``engine_check.land``. Seeds of different streams have no throw in common.
    """

    aim: Aim
    law: str | None
    program: str = REFERENCE
    restitution: float = 0.3
    friction: float = 0.4
    scatter: Scatter = field(default_factory=Scatter)
    throws: int
    stream: int = 0

    def facts(self) -> dict[str, Any]:
        """Return what tells this case from another."""
        throw, scatter = self.aim.throw.to_mapping(), [self.scatter.spin, self.scatter.angle, self.scatter.speed]
        counted = {"throws": self.throws, "stream": self.stream}
        return {"throw": throw, "scatter": scatter, **counted, **self.settings()}

    def settings(self) -> dict[str, Any]:
        """Return what the landing is called with."""
        table = {"height": self.aim.height, "restitution": self.restitution, "friction": self.friction}
        return {**table, "law": self.law, "program": self.program}


@dataclass(frozen=True, kw_only=True)
class Throws:
    """Every throw of some cases; a ``flipproof.sweep.design.Plan``.

    Throw k of any case of one stream is scattered by the seed (seed, stream, k): water and ice, fillings, laws and
    tables meet the same throwers. Cases of one program stand together: they make one line. ``text`` is the command.
    """

    cases: tuple[Case, ...]
    seed: int
    text: str

    trajectories = False
    curves = 0
    axes = AXES
    readings = LANDING

    @cached_property
    def ends(self) -> tuple[int, ...]:
        """Number of the first point after each case."""
        return tuple(accumulate(case.throws for case in self.cases))

    @property
    def size(self) -> int:
        """Points of all cases."""
        return self.ends[-1] if self.ends else 0

    @property
    def lines(self) -> tuple[range, ...]:
        """Numbers of the points of each program."""
        lines, begin = [], 0
        for _, some in groupby(self.cases, key=lambda case: case.program):
            end = begin + sum(case.throws for case in some)
            lines.append(range(begin, end))
            begin = end
        return tuple(lines)

    def point(self, number: int) -> Point:
        """Return the point of that number in [0, size)."""
        k = bisect_right(self.ends, number)
        case = self.cases[k]
        place = number - (self.ends[k] - case.throws)
        seed = self.seed, case.stream, place
        throw = scattered(case.aim.throw, case.scatter, seed).to_mapping()
        return Point(number, (k, place), throw, LAND, {**case.settings(), "seed": list(seed)})

    def facts(self) -> dict[str, Any]:
        """Return what tells this design from another."""
        return {"study": "landing", "seed": self.seed, "cases": [case.facts() for case in self.cases]}
