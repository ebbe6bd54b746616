"""Checks of momentum and symmetries, and of what a solver says it is: a published program, an equation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np

from flipproof.foreign import elsewhere
from flipproof.foreign.checking import (
    SMOOTH,
    THROW,
    WRAPPED,
    CheckGenerator,
    NotApplicableError,
    Observation,
    ask_of,
    falls_with_step,
    refined_asks,
    refined_text,
    scales,
    shift,
    time_of_max,
    times_of,
    whole_turns,
)
from flipproof.foreign.checks_answers import drift, parts_advice
from flipproof.foreign.checks_questions import STARTS
from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits, started
from flipproof.foreign.departures import departing
from flipproof.foreign.place import THROWS, curve, name_of, placing, switches_of
from flipproof.foreign.throws import far_from_ends
from flipproof.frame.equations import DIFFERENCES
from flipproof.frame.solvers import solve
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray
from slicemodel.vectors import Vector, load_all

LOCATED: Final = 10.0
"""A drift of up to this many times its bound is a weakness: slices that had passed an end are put back on it."""


def check_momentum(traits: Traits) -> CheckGenerator:
    """J omega is J_0 omega_0 at all times, with J by its definition from the positions of the slices."""
    asks = refined_asks(traits)
    answers = yield asks
    if answers[0].inertia is None:
        raise NotApplicableError("neither r nor inertia is given")
    changes = [drift(ask, answer) for ask, answer in zip(asks, answers, strict=True)]
    sizes = [float(change.max()) for change in changes]
    bound = max(1e-6, 64 * traits.epsilon)  # what an engine achieves
    falls = falls_with_step(sizes)
    holds, advice, located = sizes[0] <= LOCATED * bound or falls, "", ""
    if not holds:
        simpler = [ask_of(traits, throw) for throw in SIMPLER.values()]
        simpler += [replace(ask_of(traits, replace(THROW, restitution=1.0)), start=far_from_ends(THROW))]
        *drifts, restless = [float(drift(*pair).max()) for pair in zip(simpler, (yield simpler), strict=True)]
        room = max(bound, 0.03 * sizes[0])
        advice = _right_without(drifts, room)
        if answers[0].r is not None and restless <= room:
            located = elsewhere.right_without("rests").removesuffix("; ")
        if answers[0].r is not None and _omega_is_right(traits, asks[0], answers[0], room):
            located = "omega is right, but not J: look at how r is made for the answer"
        if answers[0].r is None and changes[0][0] > bound:
            inertia = [answer.inertia for answer in (yield [replace(asks[0], start=start) for start in STARTS])]
            at_release = [values[0] for values in inertia if values is not None]
            if len(at_release) == len(STARTS):
                advice += parts_advice(STARTS, np.array(at_release))
    return Observation(
        holds=holds,
        weak=f"J omega is kept to {sizes[0]:.1g} only, whatever the step" if sizes[0] > bound and not falls else "",
        expected=f"J omega constant within {bound:.1g}, or a change that falls with refinement",
        observed=f"changed by {sizes[0]:.2g}{refined_text(traits, sizes)}",
        where=time_of_max(asks[0].times, changes[0]),
        advice=located
        or f"{advice}no torque acts about the centre of mass: omega = J_0 omega_0 / J, with J of the same instant, "
        "about the centre of mass, of slices and bottle",
        facts={"momentum": sizes},
    )


def _omega_is_right(traits: Traits, ask: Ask, answer: Answer, room: float) -> bool:
    """Return whether omega is that of the reference within ``room``, a fraction of omega_0."""
    try:
        exact = curve(traits.equation or "", started(ask), answer.t)
    except ValueError:
        return False
    return bool(np.max(np.abs(answer.omega - exact.omega)) <= room * abs(ask.scenario.omega0))


SIMPLER: Final = {"weight": replace(THROW, gravity=0.0), "drag": replace(THROW, drag=0.0), "impacts": SMOOTH}
"""The throw of most checks without weight, without drag, or without impacts."""


def _right_without(sizes: Sequence[float], bound: float) -> str:
    """Return what to leave out to keep a difference within ``bound``, and what to look at; ``sizes`` by ``SIMPLER``."""
    right = [name for name, size in zip(SIMPLER, sizes, strict=True) if size <= bound]
    return elsewhere.right_without(right[0]) if right else ""


def check_mirror(traits: Traits) -> CheckGenerator:
    """A throw mirrored left to right has the mirrored flight: -theta, -omega, the same r."""
    original, mirrored = yield _mirrored(traits, THROW)
    errors = _differences(original, mirrored, sign=-1.0)
    bound = max(1e-9, 1024 * traits.epsilon)  # the launch is not mirrored, and round-off grows with every impact
    wrong = next((name for name in errors if not errors[name].max() <= bound), "")
    advice = ""
    if wrong and (mirrored.theta[1] - mirrored.theta[0]) * mirrored.omega[0] < 0.0:
        advice = "with omega below 0 theta grows: look at the sign of omega where theta is advanced"
    elif wrong == "omega":
        answers = yield [ask for throw in SIMPLER.values() for ask in _mirrored(traits, throw)]
        pairs = zip(answers[::2], answers[1::2], strict=True)
        sizes = [float(_differences(*pair, sign=-1.0)["omega"].max()) for pair in pairs]
        advice = _right_without(sizes, bound) + "look for abs(omega), a sign of theta, another angle than theta in "
        advice += "the weight, or a place that assumes omega > 0"
    elif wrong == "theta" and whole_turns(original.theta + mirrored.theta, 1e-6):
        advice = WRAPPED
    elif wrong:
        advice = f"omega is mirrored, {wrong} is not: look at signs where {wrong} is advanced, and between steps"
    shown = wrong or "omega"
    return Observation(
        holds=not wrong,
        expected=f"omega -> -omega, theta -> -theta, the same r within {bound:.1g} of omega_0, angle turned and L",
        observed=f"{shown} off by {errors[shown].max():.2g}",
        where=time_of_max(original.t, errors[shown]),
        advice=advice,
    )


def _mirrored(traits: Traits, throw: Scenario) -> list[Ask]:
    """Return the ask for a throw and that for its mirror image."""
    return [ask_of(traits, variant) for variant in (throw, replace(throw, theta0=-throw.theta0, omega0=-throw.omega0))]


def _differences(original: Answer, twin: Answer, *, sign: float) -> dict[str, FloatArray]:
    """Return by field how far a flight is from its twin, whose omega and theta have the sign ``sign``.

    Differences are fractions of each field's scale, of shape (P,).
    """
    scale = scales(THROW)
    errors = {name: getattr(original, name) - sign * getattr(twin, name) for name in ("omega", "theta")}
    if original.r is not None and twin.r is not None:
        errors["r"] = np.max(np.abs(original.r - twin.r), axis=1)
    return {name: np.asarray(np.abs(error) / scale[name]) for name, error in errors.items()}


def check_moving_frame(traits: Traits) -> CheckGenerator:
    """A bottle thrown with another velocity, and so seen from a moving frame, turns alike."""
    original, moving = yield [ask_of(traits, THROW), ask_of(traits, replace(THROW, launch_velocity=(3.0, -1.0)))]
    changes = _differences(original, moving, sign=1.0)
    bound = max(1e-7, 1024 * traits.epsilon)
    shown = next((name for name in changes if not changes[name].max() <= bound), "omega")
    return Observation(
        holds=bool(changes[shown].max() <= bound),
        expected=f"no change beyond {bound:.1g} of omega_0, angle turned and L",
        observed=f"{shown} changes by {changes[shown].max():.2g}",
        where="launch_velocity = (3, -1) m/s instead of (0.5, 1.94) m/s",
        advice="nothing inside the bottle may know how fast it flies",
    )


def check_gravity(traits: Traits) -> CheckGenerator:
    """omega(t) changes with half of the weight as much as in the declared equation; in free flight not at all."""
    if traits.equation is None:
        raise NotApplicableError("no equation is declared")
    place = yield from placing(traits)
    if not place.on_lattice or place.equation != name_of(switches_of(traits.equation)):
        raise NotApplicableError("told by the check of the equation")
    light, weightless = (replace(THROW, gravity=g) for g in (THROW.gravity / 2, 0.0))
    for levels in ((1, 0), (3, 2)) if traits.refined_by else ((0,),):
        half, free, *coarser = yield [ask_of(traits, throw, level) for level in levels for throw in (light, weightless)]
        exact = [curve(traits.equation, throw, half.t).omega / THROW.omega0 for throw in (light, weightless)]
        measured, expected = (half.omega - free.omega) / THROW.omega0, exact[0] - exact[1]
        own_error = sum(shift(a, b, THROW.omega0) for a, b in zip((half, free), coarser, strict=False))
        room = max(1e-4, 1024 * traits.epsilon, 4 * own_error) + (0.0 if coarser else place.room)
        errors = np.abs(measured - expected)
        if float(errors.max()) <= room <= 1e-3:
            break
    weightless_error = float(np.max(np.abs(free.omega / THROW.omega0 - exact[1])))
    if float(errors.max()) > room and weightless_error > room:
        raise NotApplicableError("without weight omega is wrong, too: told by the check elsewhere")
    return Observation(
        holds=float(errors.max()) <= room,
        expected=f"omega changes by {np.abs(expected).max():.2g} of omega_0 at most, as in {traits.equation}",
        observed=f"by {np.abs(measured).max():.2g} at most, {errors.max():.2g} off at one time (room {room:.1g})",
        where=f"g = {light.gravity:g} against 0 m/s^2, {time_of_max(half.t, errors)}",
        advice="the weight term is proportional to the throw's gravity: look for a constant or a switch",
        facts={"gravity": float(np.abs(measured).max())},
    )


def check_vectors(traits: Traits) -> CheckGenerator:
    """A solver that claims to be a published program prints its numbers."""
    vectors = [vector for vector in load_all() if vector.scheme == traits.equation]
    if not vectors:
        raise NotApplicableError("no published program is claimed")
    answers = yield [ask_of_vector(vector, traits) for vector in vectors]
    worst, where = 0.0, ""
    for vector, answer in zip(vectors, answers, strict=True):
        for column in ("theta", "omega"):
            printed = vector.columns[column][: len(answer.t)]
            rows = np.isfinite(printed)
            errors = np.abs(getattr(answer, column) - printed)[rows] / np.maximum(np.abs(printed[rows]), 1e-300)
            if not errors.max() <= worst:
                worst, where = float(errors.max()), f"{vector.name}, column {column}"
    advice = ""
    holds = worst <= PRINTED  # flipproof's own schemes keep to 1e-10
    if not holds and traits.refined_by in ("dt", "steps"):
        advice = _leaves_program(traits, (yield [_on_grid(THROW, times_of(THROW, 301), traits)])[0])
    return Observation(
        holds=holds,
        expected=f"{len(vectors)} runs of the paper's programs within {PRINTED:.0e}",
        observed=f"{worst:.2g} off",
        where=where,
        advice=advice or "answer the state of each step of the program: declare refined_by = 'steps' or 'dt'",
        facts={"vectors": worst},
    )


PRINTED: Final = 1e-8
"""Fraction by which a published program's numbers may be missed."""

STEP_OF_PROGRAM: Final[Mapping[str, str]] = {
    "r": "position",
    "v": "velocity",
    "r_cm": "which positions it is taken of",
    "inertia": "which positions it is taken of, and about which centre",
    "theta": "with which omega it goes on",
    "omega": "J_0 omega_0 / J, and which J",
}
"""What is answered -> what to look at in a published program, in the order in which one leads to the next."""


def _leaves_program(traits: Traits, answer: Answer) -> str:
    """Return at which step and in what a solver leaves the program that it declares, and what to look at."""
    program = solve(str(traits.equation), THROW, steps=len(answer.t))
    size = scales(THROW, program.inertia[:1]) | {"theta": 1.0}
    for k, name in product(range(len(answer.t)), STEP_OF_PROGRAM):
        if name not in answer.given:
            continue
        off = np.abs(getattr(answer, name)[k] - getattr(program, name)[k]) > PRINTED * size[name]
        if not off.any():
            continue
        what = STEP_OF_PROGRAM[name]
        if name not in ("r", "v"):
            return f"at step {k} {name} leaves the program: look at {what if k else 'the masses and lengths in it'}"
        assert program.impacts is not None
        struck = program.impacts.slice[np.abs(program.impacts.time - program.t[k]) < program.t[1] / 2]
        flying = np.setdiff1d(np.flatnonzero(off), struck)  # a wrong step is wrong in these, too
        i = int(flying[0] if len(flying) else np.argmax(off))
        if not len(flying):
            look_at = f"the {what} that a slice beyond an end gets, and where the ends are"
        elif answer.v is not None and answer.v[k, i] * program.v[k, i] < 0.0:
            look_at = "where the ends are: the program does not turn it back there"
        else:
            look_at = f"the step of the {what}: it strikes no end there"
        return f"at step {k} {name} of slice {i} leaves the program: look at {look_at}"
    return "it is the program, step by step, on the throw of most checks: look at what is other in that run"


def ask_of_vector(vector: Vector, traits: Traits) -> Ask:
    """Return the ask for a published run, up to the last time that is compared; the program takes its own steps."""
    times = np.linspace(0.0, vector.scenario.duration, vector.steps)
    times = times[times <= vector.until]
    return _on_grid(replace(vector.scenario, duration=float(times[-1])), times, traits)


def _on_grid(throw: Scenario, times: FloatArray, traits: Traits) -> Ask:
    """Return the ask for every step of a published program, which takes one from each of ``times`` to the next."""
    effort = {"steps": float(len(times) - 1), "dt": float(times[1])}.get(traits.refined_by or "")
    return Ask.of(throw, times, effort)


WHERE_PLACED: Final = f"{len(THROWS)} throws of {THROWS[0].duration:g} to {THROWS[-1].duration:g} s"
"""What a solver is placed by, in words."""


def check_equation(traits: Traits) -> CheckGenerator:
    """The solver is nearest to the equation it declares, and no farther from it than its own error explains.

    A solver that declares none is near one of the ladder's.
    """
    place = yield from placing(traits)
    if traits.equation is None and place.on_lattice:
        raise NotApplicableError(f"none is declared; {place.text}", {"place": place.to_mapping()})
    if traits.equation is None:
        simpler = (yield from elsewhere.simpler_throws_advice(traits, place.followed)) if place.followed else ""
        return Observation(
            holds=False,
            expected="an equation of the ladder; none is declared",
            observed=place.text,
            where=WHERE_PLACED,
            advice=(f"it follows {place.followed} the longest: {simpler}" if simpler else "")
            + "declare the equation that it is meant to solve (solve.equation, or --equation) to be told where it "
            "departs from it; if it is meant to solve another, declare that as an expected failure",
            facts={"place": place.to_mapping()},
        )
    try:
        declared = name_of(switches_of(traits.equation))
    except ValueError as error:
        raise NotApplicableError(str(error)) from None
    holds = place.equation == declared and place.on_lattice
    deviation = (yield from elsewhere.wrong_on_whole(traits, declared)) if holds else ""
    own_error, limit = place.change or 0.0, place.following_distance / 4
    weak = (
        f"its own error, {own_error:.2g} of omega_0, is too large to tell equations apart" if own_error > limit else ""
    )
    departure = cause = simpler = ""
    if not (place.on_lattice or place.still):
        with suppress(ForeignError, NotApplicableError):
            departure, cause = yield from departing(traits, declared, [ask_of(traits, throw) for throw in THROWS])
    # Of impacts, simpler throws tell more: resting slices take part in them.
    exact = ("besides" in cause and " and " not in cause) or "let go" in cause
    if not (exact or (holds and not deviation)):
        simpler = yield from elsewhere.simpler_throws_advice(traits, declared)
    advice = simpler or (departure and f"there it departs {departure}; {cause and f'{cause}; '}")
    advice = advice or (place.advice and f"{place.advice}; ")
    if (place.on_lattice or place.clear) and place.equation != declared:
        wanted = switches_of(declared)
        differing = [
            words
            for name, words in DIFFERENCES.items()
            if name not in place.inert and getattr(place.switches, name) != getattr(wanted, name)
        ]
        advice += f"{declared} differs from {place.equation} in {' and in '.join(differing)}; "
    return Observation(
        holds=holds and not deviation,
        expected=declared,
        observed=place.text + (f", but {deviation}" if deviation else ""),
        where=WHERE_PLACED,
        advice=advice.removesuffix("; ")
        or "flipproof explain compares it with the declared equation, switch by switch",
        weak=weak,
        facts={"place": place.to_mapping()},
    )
