"""What a report finds about a solver of somebody else beside its flight, which stands among those of all solvers.

It is certified in a worker. If it declares no rung of the ladder, its flight is held to the equation on which the
certificate places it, as that of another guest is to the rung that it declares (``chapters.differences``).
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass

from flipproof.chapters.differences.study import Difference, study_difference
from flipproof.chapters.solvers import Guest
from flipproof.foreign.certify import Certificate, certify
from flipproof.foreign.contract import ForeignError
from flipproof.foreign.solving import opened
from flipproof.frame.chapter import Ask, Call, Flights, Missing, Outcome, Run, Study, attempt
from flipproof.frame.twins import omega_band_call
from ode_reference.models import LADDER


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """What a guest showed; ``problems`` maps what is missing to the reason why.

    ``placed`` compares its flight with the equation on which its certificate places it, if it declares no rung.
    ``change`` is that of omega between its two efforts, fraction of omega_0; None if unknown.
    """

    guest: Guest
    certificate: Outcome[Certificate]
    problems: dict[str, str]
    placed: Outcome[Difference]
    change: float | None


def study(ask: Ask) -> Study[tuple[Visit, ...]]:
    """Certify the guests of ``ask.work``, and compare those that declare no rung with the equation that they solve.

    A call made anew is never answered from the store: whether somebody else's code changed is not known.
    """
    loaded = [guest for guest in ask.work if guest.traits is not None]
    calls = {g: Call(certified, (g.spec, g.timeout), f"guest {g.label}", anew=True) for g in loaded}
    flown = {guest: guest.run(ask.throw) for guest in loaded}
    efforts = [run for guest in loaded for run in guest.efforts(ask.throw)]
    flights = yield [*calls.values(), *flown.values(), *efforts]
    certificates = {guest: attempt(flights.answer, call) for guest, call in calls.items()}
    equations = {
        guest: Run(equation, ask.throw, {}, equation)
        for guest, certificate in certificates.items()
        if (equation := placed_on(guest, certificate.result)) and flights.trajectory(flown[guest]) is not None
    }
    bands = {guest: omega_band_call(run) for guest, run in equations.items()}
    flights = yield [*equations.values(), *bands.values()]

    def visit(guest: Guest) -> Visit:
        certificate = certificates.get(guest, Outcome(None))
        reasons = {"solver": guest.problem, "certificate": certificate.reason}
        reasons |= {run.name: flights[run].reason for run in guest.efforts(ask.throw)}
        placed: Outcome[Difference] = Outcome(None)
        if guest in equations:
            placed = attempt(study_flight, guest, equations[guest], bands[guest], flights)
        return Visit(
            guest=guest,
            certificate=certificate,
            problems={name: reason for name, reason in reasons.items() if reason},
            placed=placed,
            change=guest.band(ask.throw, flights),
        )

    return tuple(visit(guest) for guest in ask.work)


def placed_on(guest: Guest, certificate: Certificate | None) -> str:
    """Return the equation on which its certificate places a guest that declares no rung; empty if there is none."""
    place = None if certificate is None else certificate.facts.get("place")
    declares_rung = guest.traits is not None and guest.traits.equation in LADDER
    return "" if declares_rung or place is None or not place["on_lattice"] else str(place["equation"])


def study_flight(guest: Guest, equation: Run, band: Call, flights: Flights) -> Difference:
    """Compare the flight of a guest with that of an equation, whose own band is answered by ``band``."""
    throw = equation.scenario
    known, change = attempt(flights.answer, band).result, guest.band(throw, flights)
    both = None if known is None or change is None else float(known[-1]) + change
    name = f"{equation.name} and {guest.label}"
    return study_difference(name, flights[equation].flight, flights[guest.run(throw)].flight, band=both)


def certified(spec: str, timeout: float | None) -> Certificate:
    """Certify the solver of a spec; one that cannot be certified raises Missing."""
    try:
        with closing(opened(spec, timeout)) as runner:
            return certify(runner)
    except ForeignError as error:
        raise Missing(str(error)) from None
