"""Checks of whether a solver takes what it is asked: start, inputs, times, and no memory of other questions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from flipproof.foreign import elsewhere
from flipproof.foreign.checking import (
    CALM,
    SMOOTH,
    THROW,
    WRAPPED,
    CheckGenerator,
    Observation,
    ask_of,
    time_of_max,
    whole_turns,
)
from flipproof.foreign.comparison import TextGenerator
from flipproof.foreign.contract import Answer, Ask, Traits
from flipproof.foreign.place import curve, name_of, switches_of
from flipproof.foreign.throws import far_from_ends
from slicemodel.observables import moment_of_inertia
from slicemodel.trajectory import FloatArray


def check_shape(traits: Traits) -> CheckGenerator:
    """The solver answers at the times asked, with real, finite numbers of the right shape."""
    (answer,) = yield [ask_of(traits, THROW)]
    return Observation(
        holds=True,
        expected="t, theta, omega at the times asked",
        observed="; ".join(answer.given),
        facts={"fields": answer.given},
    )


SINGLE: Final = 5e-7
"""Error of omega at the release below which it may be the rounding of single precision: four spacings of it."""

OTHER: Final = replace(SMOOTH, theta0=-0.7, omega0=-7.3)
"""A short throw, released at another angle and spinning slower, the other way round."""


SPREAD: Final = np.array([0.9, 0.7, 0.3, 0.2]) * THROW.bottle.length
"""Starting places from which slices strike both ends."""
SPREAD.setflags(write=False)

STARTS: Final = THROW.bottle.length * np.array(
    [[0.9, 0.7, 0.3, 0.2], [0.8, 0.6, 0.6, 0.5], [0.9, 0.9, 0.8, 0.7], [0.4, 0.3, 0.2, 0.1]]
)
"""Starting places of different means and spreads, shape (4, N)."""
STARTS.setflags(write=False)


def check_start(traits: Traits) -> CheckGenerator:
    """At t = 0 the bottle has the angle and the angular velocity of the throw, and the slices their places."""
    asks = [ask_of(traits, throw) for throw in (THROW, OTHER)]
    asks.append(replace(asks[0], start=SPREAD))  # the same throw from other places
    answers = yield asks
    bound = max(1e-12, 8 * traits.epsilon)
    for ask, answer in zip(asks, answers, strict=True):
        throw = ask.scenario
        errors = {
            "theta": abs(answer.theta[0] - throw.theta0) / max(1.0, abs(throw.theta0)),
            "omega": abs(answer.omega[0] / throw.omega0 - 1.0),
        }
        if answer.r is not None:
            errors["r"] = float(np.max(np.abs(answer.r[0] - ask.start))) / throw.bottle.length
        worst = max(errors, key=lambda name: errors[name])
        if not errors[worst] <= bound:
            break
    delay = (answer.theta[0] - throw.theta0) / throw.omega0
    drifted = worst == "theta" and bound < delay < 0.02  # a step or two; answers may belong to other times
    cached = ask is asks[-1] and (worst == "omega" or np.array_equal(answer.omega, answers[0].omega))
    from_slope = worst == "omega" and not cached and bound < errors[worst] < 0.05
    hint = _places_advice(ask, answer) if worst == "r" and answer.r is not None else ""
    if from_slope:
        (closer,) = yield [replace(ask, times=ask.times / 10)]
        if abs(abs(closer.omega[0] / throw.omega0 - 1.0) / errors["omega"] - 1.0) < 0.1:  # no slope: it would be nearer
            from_slope = False
            wrong = "J_0 in J_0 omega_0 is not the J of the start"
            if (
                answer.inertia is not None
                and not abs(answer.inertia[0] / float(moment_of_inertia(throw, ask.start)) - 1.0) <= bound
            ):
                wrong = "J_0 omega_0 is divided by a J that is not that of the start, as the answered inertia shows"
            hint = f"omega(0) is off by as much at any times asked: {wrong}"
            if traits.precision == "float64" and errors["omega"] < SINGLE:
                hint += "; so small an error is the rounding of single precision: keep places and J in float64"
    if worst == "theta" and whole_turns(answer.theta[0] - throw.theta0, 1e-6):
        hint = WRAPPED
    stacked = answer.r is not None and ask is asks[-1] and np.allclose(answer.r[0], asks[0].start, rtol=0.0, atol=bound)
    initial = {"theta": (throw.theta0, answer.theta), "omega": (throw.omega0, answer.omega)}
    few_digits = _digits_advice(worst, initial[worst][0], float(initial[worst][1][0])) if worst in initial else ""
    if worst in initial and abs(initial[worst][1][0] + initial[worst][0]) <= bound * max(1.0, abs(initial[worst][0])):
        hint = f"{worst}(0) is {initial[worst][1][0]:.3g}, of the other sign: take {worst}_0 with its sign"
    elif worst == "omega" and not (errors[worst] <= bound or cached or from_slope):
        (inside,) = yield [replace(ask, start=far_from_ends(throw))]
        if abs(inside.omega[0] / throw.omega0 - 1.0) <= bound:
            hint = "right from a start far from the ends: look at the places of the ends, h/2N and L - h/2N"
        elif not hint:
            hint = "omega(0) is omega_0: in J_0 omega_0 / J, J_0 and J are to have one definition"
    return Observation(
        holds=errors[worst] <= bound,
        expected=f"theta_0, omega_0 and start within {bound:.1g}",
        observed=f"{worst} off by {errors[worst]:.2g}" + (f", as if it were {delay:.2g} s later" if drifted else ""),
        where=f"t = 0 s, theta_0 = {throw.theta0:.3g} rad, omega_0 = {throw.omega0:g} rad/s",
        advice="r(0) is the stack on the base whatever start is asked: begin at ask.start"
        + ("; cache nothing by throw: the start is part of the question" if worst == "r" else "")
        if stacked
        else few_digits
        + ("answer at ask.times themselves; " if drifted and not few_digits else "")
        + ("omega is that of the instant, not a slope of theta between two times; " if from_slope else "")
        + ("omega(0) is omega_0 from every start: compute J_0 from ask.start; " if cached and worst == "omega" else "")
        + ("cache nothing by throw: the start is part of the question; " if cached else "")
        + (hint or "begin at scenario.theta0, scenario.omega0 and ask.start, with all slices at rest"),
    )


def _digits_advice(name: str, value: float, answered: float) -> str:
    """Return that an answer is the value rounded to few digits, if it is."""
    for digits in range(2, 10):
        if answered == float(f"{value:.{digits}g}"):
            return f"{name}_0 has only {digits} digits: read the throw with all its digits; "
    return ""


def _places_advice(ask: Ask, answer: Answer) -> str:
    """Return what, other than a wrong start, explains initial places that differ from those asked."""
    assert answer.r is not None
    errors = np.abs(answer.r[0] - ask.start)
    if not np.ptp(answer.r, axis=0).any():
        return "r is the same at all times: keep a copy of the slices' places for each"
    if np.allclose(np.sort(answer.r[0]), np.sort(ask.start), rtol=1e-6, atol=0.0):
        return "r holds the places of ask.start in another order: every slice keeps its column"
    for name, dtype in (("single", np.float32), ("half", np.float16)):
        if np.all(errors <= np.finfo(dtype).eps * ask.start):
            return f"r is rounded to {name} precision: declare it, or keep the digits"
    return ""


def check_determinism(traits: Traits) -> CheckGenerator:
    """The same ask has the same answer to the last bit, also with another throw in between."""
    ask, other = ask_of(traits, THROW), ask_of(traits, OTHER)
    # Ice of as many slices as the throw before, and of another number: state kept from the throw before shows.
    ice = [ask_of(traits, replace(THROW.with_slices(n), frozen=True)) for n in (THROW.n_slices, 8)]
    first, _, second, *frozen, last = yield [ask, other, ask, *ice, ask]
    change = max(
        float(np.max(np.abs(getattr(first, name) - getattr(again, name))))
        for name in ("theta", "omega")
        for again in (second, last)
    )
    flows, stays = (float(np.ptp(answer.omega)) / abs(THROW.omega0) for answer in frozen)
    cached = flows > 0.01 > 100 * stays
    observed = "the same numbers" if change == 0.0 else f"numbers that differ by {change:.2g}"
    return Observation(
        holds=change == 0.0 and not cached,
        expected="the same numbers",
        observed=f"ice of {THROW.n_slices} slices flows after such a throw, that of 8 does not" if cached else observed,
        where="one throw asked three times, others and ice between",
        advice="reset all state between asks, keep nothing under a part of the throw, and seed random numbers",
    )


READ: Final = "read it from the question, and keep no answer under a part of the question"

IGNORED: Final[Mapping[str, str]] = {
    "another restitution": f"{READ}; or no slice strikes an end, or each that does stays there at once: look at what "
    "moves them, and at when a slice begins to rest",
    "another capacity of the bottle": "slices turn half their height before the ends, at h/2N and L - h/2N, and the "
    f"capacity gives that height: {READ}",
    "another radius of the bottle": f"the radius acts in J alone, by M_b (R^2/2 + L^2/12): {READ}",
}
"""What to look at if this alone is ignored."""


def check_inputs(traits: Traits) -> CheckGenerator:
    """Whatever part of the question is changed alone, the answer changes."""
    bottle, stacked = THROW.bottle, THROW.initial_positions()
    throws = {
        "another water_mass": replace(THROW, water_mass=0.9 * THROW.water_mass),
        "another theta0": replace(THROW, theta0=THROW.theta0 + 0.3),
        "another omega0": replace(THROW, omega0=1.1 * THROW.omega0),
        "another restitution": replace(THROW, restitution=0.6),
        "another drag": replace(THROW, drag=1.5 * THROW.drag),
        **{
            f"another {name} of the bottle": replace(
                THROW, bottle=replace(bottle, **{name: 1.1 * float(getattr(bottle, name))})
            )
            for name in ("mass", "length", "radius", "capacity")
        },
    }
    ask = replace(ask_of(traits, THROW, -2), start=SPREAD)
    variants = {label: replace(ask_of(traits, throw, -2), start=SPREAD) for label, throw in throws.items()}
    variants["another start"] = replace(ask, start=stacked)
    variants["another start of the same mean"] = replace(ask, start=np.array([0.8, 0.7, 0.4, 0.2]) * bottle.length)
    variants["other times"] = replace(ask, times=ask.times**2 / ask.times[-1])
    variants["another order of the start"] = replace(ask, start=SPREAD[::-1].copy())
    # The first throw is repeated before each variant: a cache of the last throw then holds the first one.
    asks = [question for variant in variants.values() for question in (ask, variant)]
    answers = yield asks
    # The order of the slices does not change how the bottle turns.
    fields = dict.fromkeys(variants, ("theta", "omega")) | {"another order of the start": ("r",)}
    ignored = [
        label
        for (label, names), original, changed in zip(fields.items(), answers[::2], answers[1::2], strict=True)
        if all(
            getattr(original, name) is not None and np.array_equal(getattr(original, name), getattr(changed, name))
            for name in names
        )
    ]
    still = bool(ignored) and np.ptp(answers[0].omega) < 1e-12 * THROW.omega0
    return Observation(
        holds=not ignored,
        expected="other numbers for another question",
        observed=f"the same numbers to the last bit with {' and with '.join(ignored)}"
        if ignored
        else "other numbers each time",
        where=f"{len(variants)} parts of the question, each changed alone after the throw of most checks",
        advice="omega never changes, as if no slice moved: look at what holds slices, and at what is taken for ice"
        if still
        else (
            "slices keep the order of ask.start: sort them neither when they are read nor when they are answered; "
            if "another order of the start" in ignored
            else ""
        )
        + (IGNORED.get(ignored[0], READ) if len(ignored) == 1 else READ),
    )


def check_times(traits: Traits) -> CheckGenerator:
    """The answer is that of the time asked, and does not depend on the other times asked."""
    end, gap = SMOOTH.duration, SMOOTH.duration / 3000  # a third of a step
    sparse_times = end * np.array([0.2507, 0.5013, 0.7519, 1.0])
    dense_times = np.union1d(
        [*sparse_times, *(sparse_times - gap)], end * np.random.default_rng(0).uniform(0.06, 1.0, 40)
    )
    common = np.searchsorted(dense_times, sparse_times)
    levels = (0, -1) if traits.refined_by else (0,)
    asks = [
        replace(ask_of(traits, SMOOTH, level), times=times) for level in levels for times in (sparse_times, dense_times)
    ]
    # The end alone: some solvers take a fixed number of steps between outputs.
    sparse, dense, *coarser, end_alone = yield [*asks, replace(ask_of(traits, SMOOTH), times=sparse_times[-1:])]
    scale = {"omega": abs(SMOOTH.omega0), "theta": 1.0}
    worst, errors, room = "", np.zeros(4), np.ones(4)
    for name in scale:
        a, b = getattr(sparse, name), getattr(dense, name)[common]
        own = np.abs(getattr(coarser[0], name) - a) / scale[name] if coarser else np.full(4, 1e-3)
        change, allowed = np.abs(a - b) / scale[name], max(1e-5, 64 * traits.epsilon) + 5 * np.maximum.accumulate(own)
        change[-1] = max(change[-1], abs(getattr(end_alone, name)[0] - a[-1]) / scale[name])
        if coarser:  # a difference that grows as steps shrink is no error of the step
            before = np.abs(getattr(coarser[0], name) - getattr(coarser[1], name)[common]) / scale[name]
            allowed[change > np.maximum(1e-3, 4 * before)] = max(1e-5, 64 * traits.epsilon)
        if np.max(change / allowed) > np.max(errors / room) or not worst:
            worst, errors, room = name, change, allowed
    observed = f"{worst} differs by {errors.max():.2g}"
    where = f"asked at {len(sparse_times)} times, at {len(dense_times)} uneven ones, and at the end alone"
    if np.all(errors <= room):
        before = np.searchsorted(dense_times, sparse_times - gap)
        turned = gap * (dense.omega[common] + dense.omega[before]) / 2
        drift, bound = np.abs(dense.theta[common] - dense.theta[before] - turned), max(1e-5, 64 * traits.epsilon)
        if not drift.max() <= bound:
            errors, room = drift, np.full(4, bound)
            observed = f"theta advances by {drift.max():.2g} rad more or less than omega says"
            where = f"between two times that are {gap:.2g} s apart"
    holds = bool(np.all(errors <= room))
    advice = "" if holds else (yield from _outputs_advice(traits, sparse, dense.omega[common]))
    return Observation(
        holds=holds,
        expected=f"the same within {room.max():.1g}, its own error",
        observed=observed,
        where=f"{where}, {time_of_max(sparse_times, errors)}",
        advice=(advice or "the flight begins at t = 0, also if that is not asked; ")
        + "go exactly to each of ask.times, uneven as they are: cut the last step short, and leave nothing out; where "
        "an answer between two steps is made, it must not move the state from which the next one goes on",
        facts={"times": float(errors.max())},
    )


def _outputs_advice(traits: Traits, sparse: Answer, dense_omega: FloatArray) -> TextGenerator:
    """Return what to look at if omega is right at dense output times or without weight or drag, and else wrong."""
    try:
        equation = name_of(switches_of(traits.equation or ""))
    except ValueError:
        return ""
    exact = curve(equation, SMOOTH, sparse.t).omega
    (early,) = yield [replace(ask_of(traits, SMOOTH), times=np.concatenate([[0.0], sparse.t]))]
    if 10 * np.max(np.abs(early.omega[1:] - exact)) < np.max(np.abs(sparse.omega - exact)):
        return "right if t = 0 is asked, too: look at what is taken at the first time asked instead of at release; "
    sparse_error, dense_error = (float(np.max(np.abs(omega - exact))) for omega in (sparse.omega, dense_omega))
    if dense_error > 4 * sparse_error:
        return "right where outputs are few: look at what is done where two are closer than a step, or no multiple; "
    close = "right where outputs lie close" if sparse_error >= 4 * dense_error else ""
    answers = yield [replace(ask_of(traits, throw), times=sparse.t) for throw in CALM.values()]
    for (name, throw), answer in zip(CALM.items(), answers, strict=True):
        if np.max(np.abs(answer.omega - curve(equation, throw, sparse.t).omega)) < sparse_error / 10:
            return f"{close and f'{close}, and '}{elsewhere.right_without(name)}"
    return close and f"{close}: look at what goes on between two of them, such as J, omega and theta; "
