"""What section 5 says about the cost of the model and its time steps (Supp. Fig. 1)."""

from __future__ import annotations

import math
from typing import Final

from reports.paper.claims_model import MANY_SLICES
from reports.paper.observe import Flights, MissingFlightError, distance, level, level_by_points
from reports.paper.parameters import numbers, paper_steps
from reports.paper.runs import PUBLISHED
from reports.paper.statements import OMEGA, Reading
from reports.studies.errata import exponents_of_cost

SQUARE: Final = (1.8, 2.2)
"""Exponents that count as a square."""

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


def claim_cost_of_slices(flights: Flights) -> tuple[Reading, ...]:
    """Work grows as the square of the number of slices."""
    of_n, band, note = _exponent_of_slices(flights)
    return (Reading(name="exponent of N in the work", value=of_n, unit="", admissible=SQUARE, band=band, note=note),)


def _exponent_of_slices(flights: Flights) -> tuple[float, float, str]:
    """Return the exponent, by how much it still changes with N, and what was counted."""
    if flights.solver == PUBLISHED:
        of_n, _ = exponents_of_cost(copies_history=False)
        return of_n, 0.0, "array elements of the Python program counted, no clock; the same for the MATLAB program"
    counts = (MANY_SLICES / 5, MANY_SLICES / 2, MANY_SLICES)
    work = [n * flights.at("slices", n).diagnostics["evaluations"] for n in counts]
    before, last = (
        math.log(work[k + 1] / work[k]) / math.log(counts[k + 1] / counts[k]) for k in range(len(counts) - 1)
    )
    words = " and ".join(f"{n:g}" for n in counts[1:])
    return last, abs(last - before), f"slices times evaluations, N = {words}, no clock"


def claim_cost_of_steps(flights: Flights, copies_history: bool = False) -> tuple[Reading, ...]:
    """Work depends on the number of time steps more than on that of slices.

    ``copies_history`` takes the MATLAB program, each of whose steps copies all steps before, for the Python program.
    """
    if flights.solver != PUBLISHED:
        raise MissingFlightError(f"{flights.solver} chooses its own time steps; there is no P")
    of_n, of_p = exponents_of_cost(copies_history=copies_history)
    return (
        Reading(
            name="exponent of P minus exponent of N in the work",
            value=of_p - of_n,
            unit="",
            admissible=(MORE, math.inf),
            note=f"{of_p:.2f} and {of_n:.2f} in the {'MATLAB' if copies_history else 'Python'} program",
        ),
    )


def claim_steps_are_enough(flights: Flights) -> tuple[Reading, ...]:
    """More than the paper's 1000 time steps change nothing that a figure shows."""
    if flights.solver not in (PUBLISHED, "eq8"):
        raise MissingFlightError(f"{flights.solver} chooses its own time steps; there is no P")
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
