r"""What a report finds about a solver of somebody else beside its flight, which stands among those of all solvers.

It is certified in a worker. Its runs of the throw at four efforts say what refinement buys. The energy of its flight,
in the frame of the centre of mass C_M, is that of turning and of sliding (Koenig):

    E = J omega^2 / 2 + sum_i m (v_i - v_CM)^2 / 2 + M_b v_CM^2 / 2
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from flipproof.chapters.differences.study import Difference, study_difference
from flipproof.chapters.solvers import SPARSE, Guest
from flipproof.foreign.certify import Certificate, certify
from flipproof.foreign.contract import ForeignError
from flipproof.foreign.solving import opened
from flipproof.frame.chapter import Ask, Call, Flights, Missing, Outcome, Run, Study, attempt
from flipproof.frame.twins import omega_band_call
from ode_reference.models import LADDER
from slicemodel import Trajectory
from slicemodel.observables import centre_of_mass_velocity
from slicemodel.trajectory import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """One run of the throw: its effort, the seconds it took, and its largest difference to the guest's equation."""

    effort: float
    seconds: float
    error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """What a guest showed, each or the reason why not; ``efforts`` are by the names of their runs.

    ``equation`` is the rung that it declares, or the nearest; ``band`` the largest change of omega between its two
    finest efforts, fraction of omega_0; ``rise`` the largest of its energy between two output times, fraction of E(0).
    ``placed`` compares its flight with the equation on which its certificate places it, if it declares none.
    """

    guest: Guest
    certificate: Outcome[Certificate]
    equation: str
    band: float | None
    efforts: Mapping[str, Outcome[Effort]]
    rise: float | None
    placed: Outcome[Difference]

    @property
    def problems(self) -> dict[str, str]:
        """What is missing, and why."""
        if self.guest.problem:
            return {"solver": self.guest.problem}
        outcomes: dict[str, Outcome[Any]] = {"certificate": self.certificate, **self.efforts}
        return {name: outcome.reason for name, outcome in outcomes.items() if outcome.reason}

    @property
    def refined(self) -> list[Effort]:
        """The efforts that were made, the coarsest first."""
        return [outcome.result for outcome in self.efforts.values() if outcome.result is not None]


def study(ask: Ask) -> Study[tuple[Visit, ...]]:
    """Certify the guests of ``ask.work``, and read the flights of those that could be loaded.

    A call made anew is never answered from the store: whether somebody else's code changed is not known.
    """
    loaded = [guest for guest in ask.work if guest.traits is not None]
    calls = {g: Call(certified, (g.spec, g.timeout), f"guest {g.label}", anew=True) for g in loaded if not g.curve}
    ladder = {rung: ask.solvers[rung] for rung in LADDER} if loaded else {}
    flown = {guest: guest.run(ask.throw) for guest in loaded}
    efforts = [run for guest in loaded for run in guest.efforts(ask.throw)]
    flights = yield [*calls.values(), *ladder.values(), *flown.values(), *efforts]
    rungs = {rung: run for rung, run in flights.trajectories(ladder).items() if run.ok}
    certificates = {guest: attempt(flights.answer, call) for guest, call in calls.items()}
    equations = {
        guest: Run(equation, ask.throw, {}, equation)
        for guest, certificate in certificates.items()
        if (equation := placed_on(guest, certificate.result)) and flights.trajectory(flown[guest]) is not None
    }
    bands = {guest: omega_band_call(run) for guest, run in equations.items()}
    flights = yield [*equations.values(), *bands.values()]

    def visit(guest: Guest) -> Visit:
        flight = flights.trajectory(flown[guest]) if guest in flown else None
        equation = guest.equation(rungs, flight)
        runs = guest.efforts(ask.throw)
        placed: Outcome[Difference] = Outcome(None)
        if guest in equations:
            placed = attempt(study_flight, guest, equations[guest], bands[guest], flights)
        return Visit(
            guest=guest,
            certificate=certificates.get(guest, Outcome(None, "a curve in a file cannot be asked")),
            equation=equation,
            band=guest.band(ask.throw, flights),
            efforts={run.name: attempt(effort_of, run, rungs.get(equation), flights) for run in runs},
            rise=rise_of(flight) if flight is not None and len(flight.v) == len(flight.t) else None,
            placed=placed,
        )

    return tuple(visit(guest) for guest in ask.work)


def placed_on(guest: Guest, certificate: Certificate | None) -> str:
    """Return the equation on which its certificate places a guest that declares none; empty if there is none."""
    place = None if certificate is None else certificate.facts.get("place")
    declared = guest.traits is not None and guest.traits.equation is not None
    return "" if declared or place is None or not place["on_lattice"] else str(place["equation"])


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


def effort_of(run: Run, reference: Trajectory | None, flights: Flights) -> Effort:
    """Return what one effort costs and how far it is from the guest's equation."""
    flight = flights[run].flight
    if reference is None or len(reference.t[::SPARSE]) != len(flight.t):
        raise Missing(f"{run.name}: there is no equation at its times to hold it against")
    error = float(np.max(np.abs(reference.omega[::SPARSE] - flight.omega)) / abs(flight.scenario.omega0))
    return Effort(effort=flight.settings["effort"], seconds=flight.diagnostics["seconds"], error=error)


def rise_of(run: Trajectory) -> float:
    """Return the largest rise of E(t) between two output times, fraction of E(0)."""
    return float(max(0.0, np.max(np.diff(energy_of(run)), initial=0.0)))


def energy_of(run: Trajectory) -> FloatArray:
    """Return E(t) / E(0) in the frame of C_M (module docstring), shape (P,)."""
    scenario, drift = run.scenario, centre_of_mass_velocity(run.scenario, run.v)
    sliding = scenario.slice_mass * ((run.v - drift[:, None]) ** 2).sum(axis=1) + scenario.bottle.mass * drift**2
    energy = (run.inertia * run.omega**2 + sliding) / 2
    return np.asarray(energy / energy[0])
