"""A statement before it is judged, and how it is judged: readings of the flights of one equation, with their bands.

The number of slices is cut in half for a second reading, and so is the number of time steps where an equation does not
choose its own; what that changes, and what tolerances change in omega, is the band of a number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Final

from flipproof.paper.observe import Flights, MissingFlightError
from flipproof.paper.runs import BANDS
from flipproof.paper.statements import OMEGA, Judgement, Kind, Reading

Read = Callable[..., tuple[Reading, ...]]
"""Flights of one equation -> what is read off them; options, if it has any, are other senses of the text."""

FLAT_WHY: Final = "“Flat” is a word of ours for a rise of at most 0.1 ω₀: 2 rad/s of the 20 on the axis."
SUPERIMPOSED_WHY: Final = (
    "“Superimposed” is a word of ours for at most 0.05 ω₀ apart: 1 rad/s of 20, about the width of a drawn line."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A statement before it is judged.

    Parameters
    ----------
    id, place, says, means, throw, why, kind : as in ``Statement``
    read : flights of one equation -> readings; raises ``MissingFlightError`` where there is nothing to read
    otherwise : (words, read) of every other sense that the text allows
    of_geometry : whether no motion enters
    of_steps : whether the number of time steps is the subject, so that halving it is no band
    judges : equations that it says something about; all of them if empty
    silent : why it says nothing about the others
    """

    id: str
    place: str
    says: str
    means: str
    throw: str
    why: str
    read: Read
    kind: Kind = "claim"
    otherwise: tuple[tuple[str, Read], ...] = ()
    of_geometry: bool = False
    of_steps: bool = False
    judges: tuple[str, ...] = ()
    silent: str = ""


def states(
    id_: str, *, otherwise: Mapping[str, Mapping[str, Any] | Read] = MappingProxyType({}), **about: Any
) -> Callable[[Read], Claim]:
    """Return a decorator that makes a statement of what reads its numbers.

    Parameters
    ----------
    otherwise : words -> another sense of the text: options of the same function, or another one
    about : as in ``Claim``
    """

    def stated(read: Read) -> Claim:
        senses = (
            (words, partial(read, **sense) if isinstance(sense, Mapping) else sense)
            for words, sense in otherwise.items()
        )
        return Claim(id=id_, read=read, otherwise=tuple(senses), **about)

    return stated


def judge(claim: Claim, flights: Flights) -> Judgement:
    """Return the judgement of one equation; a flight that is missing leaves it undecided and says why."""
    if claim.judges and flights.solver not in claim.judges:
        return Judgement(solver=flights.solver, silent=claim.silent)
    if claim.of_steps:
        flights = replace(flights, half_steps=None)
    judgement = _judge(claim.read, flights)
    return replace(judgement, others=tuple((words, _judge(read, flights)) for words, read in claim.otherwise))


def _judge(read: Read, flights: Flights) -> Judgement:
    watched, seen = flights.watched()
    try:
        return Judgement(solver=flights.solver, readings=banded(read, watched), flown=seen.words)
    except MissingFlightError as reason:
        return Judgement(solver=flights.solver, aside=str(reason))


def banded(read: Read, flights: Flights) -> tuple[Reading, ...]:
    """Return the readings with their bands: tolerances, what half the slices and what half the steps change.

    Raises
    ------
    MissingFlightError
        If a flight is not there.
    """
    readings = read(flights)
    coarser = [read(each) for each in (flights.halved, flights.half_steps) if each is not None]
    return tuple(
        replace(
            reading,
            band=reading.band
            + tolerance_band(flights.solver, reading)
            + sum(abs(reading.value - others[k].value) for others in coarser),
        )
        for k, reading in enumerate(readings)
    )


def tolerance_band(solver: str, reading: Reading) -> float:
    """Return what the tolerances of the solver leave open in a number that is a share of omega_0; else 0."""
    return BANDS.get(solver, 0.0) if reading.unit == OMEGA else 0.0
