"""What section 5 says of the cost of the model and its time steps (Supp. Fig. 1)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from operator import itemgetter
from typing import Final

from flipproof.chapters.errata.erratum import SQUARE
from flipproof.chapters.errata.programs import exponents_of_cost
from flipproof.paper.claim import states
from flipproof.paper.observe import Flights, distance, level, level_by_points
from flipproof.paper.parameters import numbers, paper_steps
from flipproof.paper.runs import MANY_STEPS, PUBLISHED, many_steps_key, same_steps_key
from flipproof.paper.statements import OMEGA, Read, Reading, Statement, at_least, at_most

SQUARE_WHY: Final = "An exponent of a square is 2; a tenth of it is allowed either way."


def _of_programs(id_: str, place: str, says: str, means: str, why: str) -> Callable[[Read], Statement]:
    """Return a decorator for the cost of the programs: first MATLAB, which times itself (tic, toc), then Python."""
    return states(
        id_,
        place=f"section 5, {place}",
        says=says,
        means=means,
        throw="any; the count does not depend on it. The MATLAB program is counted: it is the one that times itself",
        why=why,
        judges=(PUBLISHED,),
        silent="it chooses its own time steps and slices cost it otherwise; the sentence is about the programs",
        otherwise={"in the Python program, which copies no history": {"program": "Python"}},
    )


@_of_programs(
    "cost-slices",
    "Supp. Fig. 1b",
    "Computing time grows roughly as N², N being the number of slices.",
    "The exponent of N in the counted work is 1.8 to 2.2.",
    SQUARE_WHY,
)
def _cost_of_slices(_: Flights, program: str = "MATLAB") -> Iterator[Reading]:
    of_n, _p = _exponents(program)
    yield Reading("exponent of N in the work", of_n, "", SQUARE, note=_counted(program))


@_of_programs(
    "cost-intervals",
    "Supp. Fig. 1c",
    "Computing time grows roughly as N², N being N_t, the number of time intervals of section 5 (the P that the "
    "sentence before calls most critical).",
    "The exponent of P in the counted work is 1.8 to 2.2.",
    SQUARE_WHY,
)
def _cost_of_intervals(_: Flights, program: str = "MATLAB") -> Iterator[Reading]:
    _n, of_p = _exponents(program)
    yield Reading("exponent of P in the work", of_p, "", SQUARE, note=_counted(program))


def _exponents(program: str) -> tuple[float, float]:
    return exponents_of_cost(copies_history=program == "MATLAB")


def _counted(program: str) -> str:
    return f"array elements that the {program} program touches, 250 to 1000 of each; no clock"


@_of_programs(
    "cost-steps",
    "Supp. Fig. 1b, 1c",
    "Of N and P, P is what limits computing time.",
    "The exponent of P in the counted work exceeds that of N by 0.1 at least.",
    "The sentence is a comparison; 0.1 is what counting from 250 to 1000 leaves open.",
)
def _cost_of_steps(_: Flights, program: str = "MATLAB") -> Iterator[Reading]:
    of_n, of_p = _exponents(program)
    note = f"{of_p:.2f} and {of_n:.2f} in the {program} program"
    yield Reading("exponent of P minus exponent of N in the work", of_p - of_n, "", at_least(0.1), note=note)


@states(
    "steps-enough",
    place="section 5, Supp. Fig. 1a",
    says="P = 1000 time steps are enough.",
    means="More steps change ω by at most 0.01 ω₀ (root mean square). For Eq. 8 the exact step at P = 1000 is held "
    "against the solution event by event.",
    throw="M̃ = 0.25, 0.5 and 0.75, α = 0.01 kg/s, β = −0.5",
    why="0.01 ω₀ is a hundredth of the axis: a fifth of “superimposed”.",
    of_steps=True,
    judges=(PUBLISHED, "eq8"),
    silent="it is only solved event by event, with time steps of its own choice",
)
def _steps_are_enough(flights: Flights) -> Iterator[Reading]:
    off, against, fewer = {}, "the event-driven solution", ""
    for filling in numbers("figure-S1-filling"):
        own = flights.at("filling", filling)
        if flights.solver == PUBLISHED:
            off[filling] = distance(own, flights.run(many_steps_key(filling)))
        else:
            off[filling] = distance(flights.run(same_steps_key(filling)), own)
    if flights.solver == PUBLISHED:
        against, fewer = f"P = {MANY_STEPS}", _fewer_steps(flights)
    worst, most = max(off.items(), key=itemgetter(1))
    others = ", ".join(f"{off[filling]:.2g} at {filling:g}" for filling in off if filling != worst)
    note = f"largest at M̃ = {worst:g}; {others}{fewer}"
    yield Reading(f"distance of P = {paper_steps()} from {against}", most, OMEGA, at_most(0.01), note=note)


def _fewer_steps(flights: Flights) -> str:
    """Return what a tenth of the steps does, and to the paper's plateau: its points then span a fifth of the flight."""
    fewer = flights.at("steps 0.5", 100)
    apart = distance(fewer, flights.at("filling", 0.5))
    return (
        f"; P = 100 is {apart:.2g} off at 0.5, and there the average over points is {level_by_points(fewer):.3f}, "
        f"the mean over time {level(fewer):.3f}"
    )


OF_COST: Final = (_cost_of_slices, _cost_of_intervals, _cost_of_steps, _steps_are_enough)
"""Statements on Supp. Fig. 1, in the order of the paper."""
