"""How a statement is judged: by readings of the flights of one equation, with their bands.

The number of slices is cut in half for a second reading, and so is the number of time steps where an equation does not
choose its own; what that changes, and what tolerances change in omega, is the band of a number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any, Final

from flipproof.frame.solvers import Missing
from flipproof.paper.observe import Flights
from flipproof.paper.runs import BANDS
from flipproof.paper.statements import OMEGA, Judgement, Read, Reading, Statement

FLAT_WHY: Final = "“Flat” is a word of ours for a rise of at most 0.1 ω₀: 2 rad/s of the 20 on the axis."
SUPERIMPOSED_WHY: Final = (
    "“Superimposed” is a word of ours for at most 0.05 ω₀ apart: 1 rad/s of 20, about the width of a drawn line."
)


def states(
    id_: str, *, otherwise: Mapping[str, Mapping[str, Any] | Read] = MappingProxyType({}), **about: Any
) -> Callable[[Read], Statement]:
    """Return a decorator that makes a statement of what reads its numbers.

    Parameters
    ----------
    otherwise : words -> another sense of the text: options of the same function, or another one
    about : as in ``Statement``
    """

    def stated(read: Read) -> Statement:
        senses = (
            (words, partial(read, **sense) if isinstance(sense, Mapping) else sense)
            for words, sense in otherwise.items()
        )
        return Statement(id=id_, read=read, otherwise=tuple(senses), **about)

    return stated


def judge(statement: Statement, flights: Flights) -> Judgement:
    """Return the judgement of one equation; a flight that is missing leaves it undecided and says why."""
    if statement.judges and flights.solver not in statement.judges:
        return Judgement(solver=flights.solver, silent=statement.silent)
    if statement.of_steps:
        flights = replace(flights, half_steps=None)
    others = tuple((words, judge_sense(read, flights)) for words, read in statement.otherwise)
    return replace(judge_sense(statement.read, flights), others=others)


def judge_sense(read: Read, flights: Flights) -> Judgement:
    """Return the judgement of one equation in one sense of the text."""
    flights = replace(flights, seen={})
    try:
        return Judgement(solver=flights.solver, readings=banded(read, flights), flown=flights.flown)
    except Missing as reason:
        return Judgement(solver=flights.solver, aside=str(reason))


def banded(read: Read, flights: Flights) -> tuple[Reading, ...]:
    """Return the readings with their bands: tolerances, what half the slices and what half the steps change.

    Raises
    ------
    Missing
        If a flight is not there.
    """
    readings = tuple(read(flights))
    coarser = [tuple(read(each)) for each in (flights.halved, flights.half_steps) if each is not None]
    return tuple(
        replace(
            reading,
            band=reading.band
            + (BANDS.get(flights.solver, 0.0) if reading.unit == OMEGA else 0.0)
            + sum(abs(reading.value - others[k].value) for others in coarser),
        )
        for k, reading in enumerate(readings)
    )
