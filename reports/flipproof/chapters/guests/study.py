r"""What a report finds about a solver of somebody else on its throw.

    study(ask)                        the chapter's: one call a guest, and the ladder with the bands of its equations
    visit(spec, throw, times)         in a worker: the certificate, the throw at four efforts, the throw in ice
    study_guests(visits, ladder)      at home: differences to every equation of the ladder, agreement, energy

Each run is made in the solver's own process with a time limit; what it does wrong costs that run and becomes a reason.
The energy of a run, in the frame of the centre of mass C_M, is that of turning and of sliding (Koenig):

    E = J omega^2 / 2 + sum_i m (v_i - v_CM)^2 / 2 + M_b v_CM^2 / 2

The difference to free flight is split over the assumptions that the guest's equation still makes:

    plateau of free flight - plateau of the guest = rest + sum of fair shares

The rest is the plateau of the guest's equation minus that of the guest: its own error, and what is no assumption of the
ladder. A fair share is the mean over all orders of mending the assumptions (``foreign.place``).
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from flipproof.chapters.agreement.chapter import Agreement, study_agreement
from flipproof.chapters.differences.chapter import band_calls, run_bands
from flipproof.chapters.differences.study import Difference, study_difference
from flipproof.chapters.ice.chapter import Drift, measure
from flipproof.chapters.waterfall.study import equation_run
from flipproof.foreign import contract
from flipproof.foreign.certify import Certificate, certify
from flipproof.foreign.checking import effort_of
from flipproof.foreign.contract import Runner, Traits, trajectory_of
from flipproof.foreign.place import changes_of, name_of, switches_of
from flipproof.foreign.solving import opened
from flipproof.foreign.specs import CSV, content_of, written
from flipproof.frame.chapter import Ask, Call, Flights, Missing, Run, Study, attempt
from flipproof.frame.shapley import mean
from ode_reference.models import LADDER, MODELS
from ode_reference.switches import Switches
from slicemodel import Scenario, Trajectory
from slicemodel.observables import centre_of_mass_velocity, plateau
from slicemodel.trajectory import FloatArray, output_times

LEVELS: Final = (-4, -2, 0, 2)
"""Levels of refinement at which the throw is made; the finest is also the flight that is shown."""

SPARSE: Final = 27
"""Every so many output times are asked for at ``LEVELS``: a solver makes at least one step from each to the next."""

FREE: Final = MODELS["free-flight"].switches


@dataclass(frozen=True, slots=True)
class Effort:
    """One run of the throw: its effort (None: it has none), the seconds it took, and the run."""

    effort: float | None
    seconds: float
    run: Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """What a solver answered; ``problems`` maps what is missing to the reason, ``content`` is of its files."""

    spec: str
    content: str = ""
    traits: Traits | None = None
    certificate: Certificate | None = None
    flight: Trajectory | None = None
    efforts: tuple[Effort, ...] = ()
    ice: Drift | None = None
    problems: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Split:
    """How a guest's plateau ``start`` becomes that of free flight, ``end``; no assumption explains the ``rest``.

    ``bars`` maps each switch to its fair share, ``ranges`` to the least and the largest change by it in a single order.
    """

    equation: str
    start: float
    rest: float
    end: float
    bars: Mapping[str, float]
    ranges: Mapping[str, tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Guest:
    """A solver of somebody else on the report's throw.

    Parameters
    ----------
    label : str - its name; with its spec, if another solver has that name
    slug : str - the name in ids, files and anchors
    differences : mapping rung -> Difference - of the flight, with the sum of both bands
    band : float or None - largest change of omega between its two finest efforts, fraction of omega_0
    errors : tuple of float - largest difference of each effort's run to ``equation``, fraction of omega_0
    equation : str or None - the rung that it declares, else the nearest
    energy : array or None - E(t) / E(0) of the flight; None without r and v
    split : Split or None - of the difference to free flight
    """

    visit: Visit
    label: str
    slug: str
    differences: Mapping[str, Difference]
    band: float | None
    errors: tuple[float, ...]
    equation: str | None
    energy: FloatArray | None
    split: Split | None = None

    @property
    def run(self) -> Trajectory | None:
        """The flight at the finest effort."""
        return self.visit.flight

    @property
    def rise(self) -> float | None:
        """Largest rise of the energy between two output times, fraction of E(0)."""
        return None if self.energy is None else float(max(0.0, np.max(np.diff(self.energy), initial=0.0)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Guests:
    """All guests of a report, the ladder they are held against, and who agrees with whom (None: nobody to compare).

    ``agreement`` is of guests, ladder, schemes and engines on the report's throw.
    """

    guests: tuple[Guest, ...] = ()
    ladder: Mapping[str, Trajectory] = field(default_factory=dict)
    agreement: Agreement | None = None

    @property
    def facts(self) -> dict[str, str]:
        """Which code each guest was, for the provenance."""
        facts = {}
        for guest in self.guests:
            visit = guest.visit
            distribution = visit.traits.distribution if visit.traits is not None else ""
            files = f"files {visit.content:.12}" if visit.content else ""
            facts[guest.label] = ", ".join(part for part in (visit.spec, distribution, files) if part)
        return facts


def study(ask: Ask) -> Study[Guests]:
    """Certify the solvers of ``ask.work``, which is their specs and a time limit a run [s] or None, and fly the throw.

    A call that is timed is never answered from the store: whether somebody else's code changed is not known.
    """
    specs, timeout = ask.work
    times = output_times(ask.throw, None)
    calls = {spec: Call(visit, (spec, ask.throw, times, timeout), f"guest {spec}", timed=True) for spec in specs}
    solvers = {name: run for name, run in ask.solvers.items() if name in LADDER or ask.size != "check"}
    ladder = {rung: solvers[rung] for rung in LADDER}
    bands = band_calls(ladder)
    flights = yield [*calls.values(), *solvers.values(), *bands.values()]
    flown = {name: run for name, run in flights.trajectories(solvers).items() if run.ok}
    rungs = {rung: flown[rung] for rung in LADDER if rung in flown}
    others = {name: run for name, run in flown.items() if name not in rungs}
    found = study_guests(received(calls, flights), rungs, run_bands(ask.solvers, bands, flights), others)
    starts = {g.label: switches_made(g.visit.traits, g.visit.certificate, g.equation) for g in found.guests}
    flights = yield plan_splits([start for start in starts.values() if start is not None], ask.throw)
    guests = tuple(with_split(guest, starts[guest.label], flights) for guest in found.guests)
    return replace(found, guests=guests)


def with_split(guest: Guest, start: Switches | None, flights: Flights) -> Guest:
    """Return a guest with its split from ``start`` to free flight, or with the reason why it has none."""
    if guest.run is None or start is None:
        return guest
    found = attempt(split, guest.run, start, flights)
    if found.found is None:
        problems = {**guest.visit.problems, "waterfall": found.reason}
        return replace(guest, visit=replace(guest.visit, problems=problems))
    return replace(guest, split=found.found)


def received(calls: Mapping[str, Call], flights: Flights) -> tuple[Visit, ...]:
    """Return every visit; one whose worker died says so."""
    answers = {spec: attempt(flights.answer, call) for spec, call in calls.items()}
    return tuple(each.found or Visit(spec=spec, problems={"solver": each.reason}) for spec, each in answers.items())


def visit(spec: str, throw: Scenario, times: FloatArray, timeout: float | None = None) -> Visit:
    """Certify a solver, let it make the throw at each of its efforts, and in ice, at output times of shape (P,) [s].

    ``timeout`` is how many seconds one run may take, instead of what the solver says.
    """
    problems: dict[str, str] = {}

    def tried(name: str, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except (ValueError, ArithmeticError, MemoryError) as error:
            problems[name] = str(error)
            return None

    known: dict[str, Any] = {"spec": spec, "content": tried("content", lambda: content_of(spec)) or ""}
    known["problems"] = problems
    runner = tried("solver", lambda: opened(spec, timeout, curves=True))
    if runner is None:
        return Visit(**known)
    with closing(runner):
        traits = tried("solver", lambda: runner.traits)
        if traits is None:
            return Visit(**known)
        asked = written(spec)[0] != CSV
        if not asked:
            problems["certificate"] = "a curve in a file cannot be asked"
        known["traits"] = traits
        known["certificate"] = tried("certificate", lambda: certify(runner)) if asked else None
        known["flight"] = tried("flight", lambda: _flight(runner, throw, times, LEVELS[-1]).run)
        levels = LEVELS if traits.refined_by is not None else ()
        efforts = [tried(f"flight at level {k}", partial(_flight, runner, throw, times[::SPARSE], k)) for k in levels]
        ice = tried("ice", lambda: _flight(runner, replace(throw, frozen=True), times, 0).run) if asked else None
    drift = None if ice is None else measure(traits.name, ice)
    return Visit(**known, efforts=tuple(one for one in efforts if one is not None), ice=drift)


def _flight(runner: Runner, throw: Scenario, times: FloatArray, level: int) -> Effort:
    effort = effort_of(runner.traits, throw, level)
    ask = contract.Ask.of(throw, np.array(times), effort)
    began = time.perf_counter()
    answer = runner(ask)
    seconds = time.perf_counter() - began
    return Effort(effort, seconds, trajectory_of(ask, answer, runner.traits))


def study_guests(
    visits: Sequence[Visit],
    ladder: Mapping[str, Trajectory],
    bands: Mapping[str, float],
    others: Mapping[str, Trajectory] = MappingProxyType({}),
) -> Guests:
    """Hold every visit against the ladder.

    Parameters
    ----------
    ladder : mapping rung -> Trajectory - of the same throw
    bands : mapping name -> float - how far omega may be off, fraction of omega_0; 0 for one that is missing
    others : mapping name -> Trajectory - schemes and engines on the same throw, for who agrees with whom
    """
    taken = [one.traits.name if one.traits else one.spec for one in visits]
    guests: list[Guest] = []
    for k, (one, name) in enumerate(zip(visits, taken, strict=True)):
        label = name if taken.count(name) == 1 and name not in {**ladder, **others} else f"{name} ({one.spec})"
        slug = re.sub(r"[^a-z0-9]+", "-", label.lower()).strip("-")
        if not 0 < len(slug) <= 60:
            slug = f"solver-{k + 1}"
        while any(guest.slug == slug for guest in guests):
            slug += f"-{k + 1}"
        guests.append(_guest(one, label, slug, ladder, bands))
    runs, known = dict(ladder), {name: bands.get(name, 0.0) for name in ladder}
    first = next(iter(ladder.values()), None)
    flown = {guest.label: (guest.run, guest.band) for guest in guests}
    for name, (run, band) in ({name: (run, bands.get(name)) for name, run in others.items()} | flown).items():
        if run is not None and first is not None and _same_times(run, first):
            runs[name], known[name] = replace(run, t=first.t), band or 0.0
    agreement = study_agreement(runs, known) if guests and len(runs) > 1 else None
    return Guests(guests=tuple(guests), ladder=dict(ladder), agreement=agreement)


def _same_times(one: Trajectory, other: Trajectory) -> bool:
    return len(one.t) == len(other.t) and np.allclose(one.t, other.t, rtol=0.0, atol=1e-12 * other.scenario.duration)


def _guest(one: Visit, label: str, slug: str, ladder: Mapping[str, Trajectory], bands: Mapping[str, float]) -> Guest:
    run = one.flight
    band = _apart(one.efforts[-2].run, one.efforts[-1].run) if len(one.efforts) > 1 else None
    differences = {}
    if run is not None and len(run.t) > 1:
        for rung, reference in ladder.items():
            whole = None if band is None else band + bands.get(rung, 0.0)
            differences[rung] = study_difference(f"{label} and {rung}", reference, run, band=whole)
    declared = one.traits.equation if one.traits is not None else None
    nearest = min(differences, key=lambda rung: differences[rung].largest, default=None)
    equation = declared if declared in ladder else nearest
    errors = [_apart(ladder[equation], effort.run) for effort in one.efforts] if equation else []
    return Guest(
        visit=one,
        label=label,
        slug=slug,
        differences=differences,
        band=band,
        errors=tuple(errors),
        equation=equation,
        energy=None if run is None or len(run.v) != len(run.t) else energy_of(run),
    )


def _apart(one: Trajectory, other: Trajectory) -> float:
    """Return the largest difference of omega at the times of ``other``, which ``one`` has too, fraction of omega_0."""
    _, here, there = np.intersect1d(one.t, other.t, assume_unique=True, return_indices=True)
    if len(there) != len(other.t):
        raise Missing(f"{one.label} has {len(there)} of the {len(other.t)} times of {other.label}; all are needed")
    return float(np.max(np.abs(one.omega[here] - other.omega[there])) / abs(one.scenario.omega0))


def energy_of(run: Trajectory) -> FloatArray:
    """Return E(t) / E(0) in the frame of C_M (module docstring), shape (P,)."""
    scenario, drift = run.scenario, centre_of_mass_velocity(run.scenario, run.v)
    sliding = scenario.slice_mass * ((run.v - drift[:, None]) ** 2).sum(axis=1) + scenario.bottle.mass * drift**2
    energy = (run.inertia * run.omega**2 + sliding) / 2
    return np.asarray(energy / energy[0])


def switches_made(traits: Traits | None, certificate: Certificate | None, nearest: str | None) -> Switches | None:
    """Return the switches of the equation that a guest declares, else of its place, else of the ``nearest`` rung.

    None if nothing is known of it, or if what it declares converges to no equation of the ladder.
    """
    if traits is not None and traits.equation is not None:
        try:
            return switches_of(traits.equation)
        except ValueError:
            return None
    results = () if certificate is None else certificate.results
    places = [r.found.facts["place"] for r in results if r.found is not None and "place" in r.found.facts]
    if places:
        return Switches.from_name(places[0]["switches"])
    return None if nearest is None else switches_of(nearest)


def plan_splits(starts: Iterable[Switches], throw: Scenario) -> list[Run]:
    """Return the runs that the splits need; those of the waterfall of the same throw are among them."""
    asked: dict[Run, None] = {}

    def ask(switches: Switches) -> float:
        asked[equation_run(throw, switches)] = None
        return 0.0

    for start in starts:
        ask(start)
        ask(FREE)
        changes_of(start, FREE, ask)
    return list(asked)


def split(run: Trajectory, start: Switches, flights: Flights) -> Split:
    """Split the difference between a guest's run and free flight on the same throw.

    Raises
    ------
    Missing - if a run is not whole
    ArithmeticError - if rest and bars miss the whole difference by more than round-off
    """

    def read(trajectory: Trajectory) -> float:
        return plateau(trajectory.t, trajectory.omega, trajectory.scenario.omega0)

    def value(switches: Switches) -> float:
        return read(flights[equation_run(run.scenario, switches)].whole)

    if len(run.t) < 2 or run.t[-1] < run.scenario.duration:
        raise Missing("the guest's run does not reach the end of the flight")
    changes = changes_of(start, FREE, value)
    found = Split(
        equation=name_of(start),
        start=read(run),
        rest=value(start) - read(run),
        end=value(FREE),
        bars={name: mean(each) for name, each in changes.items()},
        ranges={name: (min(c for _, c in each), max(c for _, c in each)) for name, each in changes.items()},
    )
    missed = found.end - found.start - found.rest - sum(found.bars.values())
    if not abs(missed) <= 1e-12 * (1.0 + abs(found.start) + sum(map(abs, found.bars.values()))):
        raise ArithmeticError(f"rest and bars miss the difference to free flight by {missed:.3g}")
    return found
