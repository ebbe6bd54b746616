"""What section 5 says about the cost of the model and its time steps (Supp. Fig. 1)."""

from __future__ import annotations

import math
from typing import Final

from flipproof.chapters.errata.erratum import SQUARE
from flipproof.chapters.errata.programs import exponents_of_cost
from flipproof.paper.observe import Flights, distance, level, level_by_points
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


def many_steps_key(filling: float) -> str:
    """Return the key of the flight with ``MANY_STEPS`` steps."""
    return f"filling {filling:g}, P {MANY_STEPS}"


def same_steps_key(filling: float) -> str:
    """Return the key of the flight by the exact step of Eq. 8 at the paper's number of time steps."""
    return f"filling {filling:g}, exact-step"


def claim_cost_of_slices(flights: Flights, program: str = "MATLAB") -> tuple[Reading, ...]:
    """Work grows as the square of the number of slices."""
    del flights
    of_n, _ = _exponents(program)
    return (_square("exponent of N in the work", of_n, program),)


def claim_cost_of_intervals(flights: Flights, program: str = "MATLAB") -> tuple[Reading, ...]:
    """Work grows as the square of the number of time intervals, N_t or P."""
    del flights
    _, of_p = _exponents(program)
    return (_square("exponent of P in the work", of_p, program),)


def _square(name: str, exponent: float, program: str) -> Reading:
    note = f"array elements that the {program} program touches, 250 to 1000 of each; no clock"
    return Reading(name=name, value=exponent, unit="", admissible=SQUARE, note=note)


def _exponents(program: str) -> tuple[float, float]:
    return exponents_of_cost(copies_history=program == "MATLAB")


def claim_cost_of_steps(flights: Flights, program: str = "MATLAB") -> tuple[Reading, ...]:
    """Work depends on the number of time steps more than on that of slices."""
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


def claim_steps_are_enough(flights: Flights) -> tuple[Reading, ...]:
    """More than the paper's 1000 time steps change nothing that a figure shows."""
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
