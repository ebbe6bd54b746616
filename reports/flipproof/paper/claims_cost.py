"""What section 5 says of the cost of the model and its time steps (Supp. Fig. 1)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from flipproof.chapters.errata.erratum import SQUARE
from flipproof.chapters.errata.programs import exponents_of_cost
from flipproof.paper.claim import Claim, Read, states
from flipproof.paper.observe import (
    Flights,
    distance,
    level,
    level_by_points,
)
from flipproof.paper.parameters import numbers, paper_steps
from flipproof.paper.runs import PUBLISHED
from flipproof.paper.statements import OMEGA, Reading

MORE: Final = 0.1
"""By how much one exponent must exceed another to be the larger."""

ENOUGH: Final = 0.01
"""Root-mean-square change of omega / omega_0 that more time steps may still make."""

MANY_STEPS: Final = 10_000
FEWER_STEPS: Final = 100
HALF: Final = 0.5

NO_CLOCK: Final = "it chooses its own time steps and slices cost it otherwise; the sentence is about the programs"
SQUARE_WHY: Final = "An exponent of a square is 2; a tenth of it is allowed either way."


def _of_programs(id_: str, place: str, says: str, means: str, why: str) -> Callable[[Read], Claim]:
    """Return a decorator for the cost of the programs: first MATLAB, which times itself (tic, toc), then Python."""
    return states(
        id_,
        place=f"section 5, {place}",
        says=says,
        means=means,
        throw="any; the count does not depend on it. The MATLAB program is counted: it is the one that times itself",
        why=why,
        judges=(PUBLISHED,),
        silent=NO_CLOCK,
        otherwise={"in the Python program, which copies no history": {"program": "Python"}},
    )


def many_steps_key(filling: float) -> str:
    """Return the key of the flight with ``MANY_STEPS`` steps."""
    return f"filling {filling:g}, P {MANY_STEPS}"


def same_steps_key(filling: float) -> str:
    """Return the key of the flight by the exact step of Eq. 8 at the paper's number of time steps."""
    return f"filling {filling:g}, exact-step"


@_of_programs(
    "cost-slices",
    "Supp. Fig. 1b",
    "Computing time grows roughly as N², N being the number of slices.",
    "The exponent of N in the counted work is 1.8 to 2.2.",
    SQUARE_WHY,
)
def _cost_of_slices(flights: Flights, program: str = "MATLAB") -> tuple[Reading, ...]:
    del flights
    of_n, _ = _exponents(program)
    return (_square("exponent of N in the work", of_n, program),)


@_of_programs(
    "cost-intervals",
    "Supp. Fig. 1c",
    "Computing time grows roughly as N², N being N_t, the number of time intervals of section 5 (the P that the "
    "sentence before calls most critical).",
    "The exponent of P in the counted work is 1.8 to 2.2.",
    SQUARE_WHY,
)
def _cost_of_intervals(flights: Flights, program: str = "MATLAB") -> tuple[Reading, ...]:
    del flights
    _, of_p = _exponents(program)
    return (_square("exponent of P in the work", of_p, program),)


def _square(name: str, exponent: float, program: str) -> Reading:
    note = f"array elements that the {program} program touches, 250 to 1000 of each; no clock"
    return Reading(name=name, value=exponent, unit="", admissible=SQUARE, note=note)


def _exponents(program: str) -> tuple[float, float]:
    return exponents_of_cost(copies_history=program == "MATLAB")


@_of_programs(
    "cost-steps",
    "Supp. Fig. 1b, 1c",
    "Of N and P, P is what limits computing time.",
    "The exponent of P in the counted work exceeds that of N by 0.1 at least.",
    "The sentence is a comparison; 0.1 is what counting from 250 to 1000 leaves open.",
)
def _cost_of_steps(flights: Flights, program: str = "MATLAB") -> tuple[Reading, ...]:
    del flights
    of_n, of_p = _exponents(program)
    return (
        Reading(
            name="exponent of P minus exponent of N in the work",
            value=of_p - of_n,
            unit="",
            admissible=(MORE, math.inf),
            note=f"{of_p:.2f} and {of_n:.2f} in the {program} program",
        ),
    )


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
def _steps_are_enough(flights: Flights) -> tuple[Reading, ...]:
    off = {}
    for filling in numbers("figure-S1-filling"):
        if flights.solver == PUBLISHED:
            off[filling] = distance(flights.at("filling", filling), flights.run(many_steps_key(filling)))
        else:
            off[filling] = distance(flights.run(same_steps_key(filling)), flights.at("filling", filling))
    worst = max(off, key=lambda filling: off[filling])
    against = f"P = {MANY_STEPS}" if flights.solver == PUBLISHED else "the event-driven solution"
    return (
        Reading(
            name=f"distance of P = {paper_steps()} from {against}",
            value=off[worst],
            unit=OMEGA,
            admissible=(-math.inf, ENOUGH),
            note=f"largest at M̃ = {worst:g}; "
            + ", ".join(f"{off[filling]:.2g} at {filling:g}" for filling in off if filling != worst)
            + _fewer_steps(flights),
        ),
    )


def _fewer_steps(flights: Flights) -> str:
    """Return what a tenth of the steps does, and to the paper's plateau: its points then span a fifth of the flight."""
    if flights.solver != PUBLISHED:
        return ""
    fewer = flights.at(f"steps {HALF:g}", FEWER_STEPS)
    apart = distance(fewer, flights.at("filling", HALF))
    return (
        f"; P = {FEWER_STEPS} is {apart:.2g} off at {HALF:g}, and there the average over points is "
        f"{level_by_points(fewer):.3f}, the mean over time {level(fewer):.3f}"
    )


OF_COST: Final = (_cost_of_slices, _cost_of_intervals, _cost_of_steps, _steps_are_enough)
"""Statements on Supp. Fig. 1, in the order of the paper."""
