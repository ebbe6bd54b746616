"""Checks of single answers: frozen water, theta beside omega, and the definitions of r_cm, v, J and impacts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flipproof.foreign import elsewhere
from flipproof.foreign.causes import STALE_OMEGA, parts_of_inertia, rms
from flipproof.foreign.checking import (
    SMOOTH,
    THROW,
    WRAPPED,
    CheckGenerator,
    NotApplicableError,
    Observation,
    ask_of,
    decimals_of,
    falls_with_step,
    refined_asks,
    refined_text,
    scales,
    time_of_max,
    whole_turns,
)
from flipproof.foreign.comparison import TextGenerator, comparing
from flipproof.foreign.contract import IMPACT, Answer, Ask, ForeignError, Traits
from flipproof.foreign.departures import UNEXPLAINED, departing
from flipproof.foreign.place import placing, switches_of
from flipproof.foreign.throws import PAPER, PIECES, SEED, far_from_ends
from slicemodel import Scenario
from slicemodel.observables import centre_of_mass, moment_of_inertia
from slicemodel.schemes import SCHEMES
from slicemodel.trajectory import FloatArray, Impacts


def check_ice(traits: Traits) -> CheckGenerator:
    """With frozen water omega stays what it was, theta goes with it, and no slice moves."""
    ask = ask_of(traits, replace(THROW, frozen=True))
    (answer,) = yield [ask]
    turned = THROW.omega0 * ask.times
    errors = {
        "omega": np.abs(answer.omega / THROW.omega0 - 1.0),
        "theta": np.abs(answer.theta - THROW.theta0 - turned) / turned[-1],
    }
    if answer.r is not None:
        errors["r"] = np.max(np.abs(answer.r - ask.start), axis=1) / THROW.bottle.length
    # An engine's constraints drift this far; formulas keep omega to 1e-12. In single precision a thousand steps round
    # theta a thousand times, all in the same direction.
    bounds = dict.fromkeys(errors, max(1e-6, 16 * traits.epsilon))
    if traits.precision == "float32":
        bounds["theta"] = 1000 * traits.epsilon / 2
    expected = {"omega": "omega constant", "theta": "theta = theta_0 + omega_0 t", "r": "r constant"}
    worst = next((name for name in errors if not errors[name].max() <= bounds[name]), "omega")
    wrapped = worst == "theta" and whole_turns(answer.theta - THROW.theta0 - turned, bounds["theta"])
    return Observation(
        holds=float(errors[worst].max()) <= bounds[worst],
        expected=f"{expected[worst]} within {bounds[worst]:.1g}",
        observed=f"{worst} off by {errors[worst].max():.2g}",
        where=f"scenario.frozen = True, {time_of_max(ask.times, errors[worst])}",
        advice=(_turning_advice(answer.theta - THROW.theta0, turned) if worst == "theta" and not wrapped else "")
        or _ice_advice(
            worst,
            wrapped,
            right_at_first=float(errors["theta"][0]) <= bounds["theta"],
            still="r" in errors and float(errors["r"].max()) <= bounds["r"],
        ),
        facts={"drift": float(errors["omega"].max())},
    )


def _ice_advice(worst: str, wrapped: bool, *, right_at_first: bool, still: bool) -> str:
    """Return what to look at if ice is wrong in one field: theta wrapped, or right at first and wrong later.

    ``still`` says that no slice moves in the answer.
    """
    if wrapped:
        return WRAPPED
    if worst == "omega" and still:
        return (
            "no slice moves, so that ice is frozen; a rigid bottle turns on evenly: look at how a step advances omega, "
            "and at J"
        )
    if worst != "theta":
        return "hold every slice where it is when scenario.frozen is true"
    if not right_at_first:
        return "let theta go on from theta_0 when scenario.frozen is true"
    return (
        "omega and the slices are right, theta alone is not: theta advances by omega dt over every step, also the last "
        "one before a time asked; look at the clock, and at the inertia by which theta is advanced"
    )


def _turning_advice(theta: FloatArray, turned: FloatArray) -> str:
    """Return that theta of ice advances at another rate, from another angle or unevenly, if it clearly does."""
    errors = (theta - turned)[1:]
    if not np.any(np.diff(theta)):
        return "theta stays what it was: ice turns, too, by omega_0 t"
    excess = float(np.median(errors / turned[1:]))
    if abs(excess) > 1e-9 and float(np.ptp(errors / turned[1:])) < 1e-3 * abs(excess):
        return (
            f"theta advances by {1.0 + excess:.6g} omega dt in every step: look for weights that do not add up to 1, "
            "or at the length of a step, or at the inertia by which theta is advanced"
        )
    offset = float(np.median(errors))
    if float(np.ptp(errors)) < 1e-3 * abs(offset):
        if abs(offset + THROW.theta0) < 1e-6:
            return f"theta is off by {offset:.3g} rad at all later times: let theta go on from theta_0"
        delay = -offset / THROW.omega0
        side = "earlier" if delay > 0 else "later"
        return f"theta is that of {abs(delay):.2g} s {side} throughout: answer that of each time asked"
    growth = np.diff(errors)
    if abs(np.sum(np.sign(growth))) == len(growth) and np.max(np.abs(np.diff(growth))) < 0.2 * np.max(np.abs(growth)):
        return "theta advances unevenly: it is theta_0 + omega_0 t; see that no slice moves within a step of ice"
    early, late = (float(np.mean(np.abs(half))) for half in np.array_split(errors, 2))
    delays = -errors / THROW.omega0
    extent = float(np.max(np.abs(delays)))
    if np.ptp(np.sign(np.where(np.abs(delays) > 1e-6 * extent, delays, 0.0))) < 2 and late < 2.0 * early:
        # It does not add up.
        return (
            f"theta is that of up to {extent:.2g} s {'earlier' if delays.max() == extent else 'later'}, of another "
            "instant each time: answer that of the time asked, not that at an end of the step"
        )
    return ""


def check_angle(traits: Traits) -> CheckGenerator:
    """theta is the integral of omega over time, also late in a long flight."""
    asks = refined_asks(traits, 961)
    slow_ask = ask_of(traits, SLOW, 0, 961)
    slow_level = 2 if traits.refined_by else 0
    slow_end_ask = replace(ask_of(traits, SLOW, slow_level), times=slow_ask.times[-1:])
    *answers, slow, slow_end = yield [*asks, slow_ask, slow_end_ask]
    errors = []
    for a in (*answers, slow):
        turned = np.cumsum(np.diff(a.t) * (a.omega[1:] + a.omega[:-1]) / 2)  # trapezoidal rule
        errors.append(np.abs(np.concatenate([[0.0], turned]) - (a.theta - a.theta[0])))
    *sizes, slow_error = [float(error.max()) for error in errors]
    # With impacts between the times the rule errs by 2e-4 rad per rad of the flight.
    bound = max(2e-4, 64 * traits.epsilon) * max(1.0, float(np.ptp(answers[0].theta)))
    # For order 2 or more: omega has a kink at an impact, theta has none, so a first-order error is lost time.
    min_ratio = 8.0 if (traits.order or 0.0) >= 2.0 and sizes[-1] > bound else 3.0
    holds = sizes[0] <= bound or (falls_with_step(sizes, min_ratio) and sizes[-1] <= 100 * bound)
    hint = "" if holds else _times_advice(answers[0]) or _jump_advice(asks[0].times, answers[0].omega / THROW.omega0)
    last_alone = not (holds or hint) and float(errors[0][:-1].max()) <= bound
    wrapped = not holds and whole_turns(errors[0], 0.01)
    if not (holds or hint or wrapped):
        effort = asks[0].effort or 0.0
        step = {"dt": effort, "steps": THROW.duration / max(effort, 1.0)}.get(traits.refined_by or "", 0.0)
        hint = _lag_advice(asks[0], answers[0]) or _stale_advice(answers[0], step)
    stops = holds and (slow_error > 100 * max(bound, sizes[0]) or slow.theta[-1] == slow.theta[-2])
    end_differs = abs(slow_end.theta[-1] - slow.theta[-1]) > 0.2 * abs(slow.theta[-1] - slow.theta[0])
    stall_advice = _times_advice(slow) if stops and np.any(np.diff(slow.theta[: np.argmax(slow.theta)]) == 0.0) else ""
    if holds and not stops and end_differs:
        calm = [ask_of(traits, replace(SLOW, gravity=0.0), 0, 961)]
        calm += [replace(ask_of(traits, calm[0].scenario, slow_level), times=slow_end_ask.times)]
        two_ask = replace(slow_end_ask, times=slow_ask.times[[len(slow_ask.times) // 2, -1]])
        *ends, two_end = [float(answer.theta[-1]) for answer in (yield [*calm, two_ask])]
        missed = abs(slow_end.theta[-1] - slow.theta[-1])
        weightless = abs(ends[1] - ends[0]) < 0.01 * missed
        return Observation(
            holds=False,
            expected="the same theta, whatever other times are asked",
            observed=f"theta = {slow_end.theta[-1]:.4g} rad instead of {slow.theta[-1]:.4g} rad",
            where=f"flight of {SLOW.duration:g} s, asked at its end alone instead of at 961 times",
            advice=(elsewhere.right_without("weight") if weightless else "")
            + _end_advice(
                slow_ask, slow_end.theta[-1], slow.theta[-1], first_alone=abs(two_end - slow.theta[-1]) < 0.01 * missed
            ),
        )
    return Observation(
        holds=holds and not stops,
        expected=f"theta - theta_0 = integral of omega within {bound:.1g} rad, or a change that falls under refinement",
        observed=f"off by {slow_error:.2g} rad"
        if stops
        else f"off by {sizes[0]:.2g} rad{refined_text(traits, sizes, ' rad')}",
        where=f"flight of {SLOW.duration:g} s" if stops else time_of_max(asks[0].times, errors[0]),
        advice=stall_advice or "fly to the last of ask.times, however late that is"
        if stops
        else "the row at the end of the flight alone is wrong: look at whether the last step is taken, and answered"
        if last_alone
        else WRAPPED
        if wrapped
        else f"{hint}theta is in radians and advances by omega dt, omega of the same instant, also over the rest of a "
        "step with an impact; or the omega answered is not the one by which theta advances",
        facts={"angle": sizes},
    )


def _stale_advice(answer: Answer, step: float) -> str:
    """Return that omega is that of another instant than theta, if it is, by the same time throughout.

    Half a ``step`` [s], 0 if that is not known, is what a theta loses that advances by the omega before the step.
    """
    mean = (answer.omega[1:] + answer.omega[:-1]) / 2
    missing, slope = np.diff(answer.theta) / np.diff(answer.t) - mean, np.diff(answer.omega) / np.diff(answer.t)
    delay = float(np.sum(missing * slope) / max(float(np.sum(slope**2)), 1e-300))
    if rms(missing - delay * slope) < 0.3 * rms(missing):
        side, ways = "earlier", ["answer both, and the inertia, of one instant"]
        if delay < 0.0:
            side = "later"
            ways.append("advance theta by omega of the middle of a step, not of its beginning")
        if step and abs(-delay / step - 0.5) < 0.1:
            side = "later, half a step,"
            ways.reverse()
        return f"omega is that of {abs(delay):.2g} s {side} than theta: {', or '.join(ways)}; "
    clear = np.abs(slope) > 0.1 * np.max(np.abs(slope), initial=0.0)
    delays = missing[clear] / slope[clear]
    if len(delays) > 12 and np.quantile(delays, 0.05) > -0.1 * np.quantile(delays, 0.95):
        return (
            f"omega is that of up to {np.quantile(delays, 0.95):.2g} s earlier than theta: answer both of one instant; "
        )
    return ""


def _end_advice(ask: Ask, theta: float, right: float, *, first_alone: bool) -> str:
    """Return what to look at if theta [rad] at the end of a flight is not ``right`` where no other time is asked.

    ``first_alone`` says that it is right where an earlier time is asked, too.
    """
    turns = (theta - right) / (2 * np.pi)
    if theta == ask.scenario.theta0 and first_alone:
        return "the first answer is that of the release, whatever its time: the first of ask.times may come after 0"
    if theta == ask.scenario.theta0:
        return "theta is still theta_0: the flight begins at t = 0, not at the first of ask.times"
    if abs(turns - round(turns)) < 1e-3:
        return "theta is off by whole turns: count them in every step, not from one of ask.times to the next"
    return (
        "fly from one of ask.times to the next, however far apart they are: look for a largest number of steps, or "
        "what is done once between two of them"
    )


def _times_advice(answer: Answer) -> str:
    """Return that an answer is for times of its own, if theta is constant or linear between them."""
    if np.any(np.diff(answer.theta) == 0.0):
        return "theta stands still between two of the times asked: answer at ask.times themselves; "
    bends = np.abs(np.diff(answer.theta, 2)) > 1e-12 * np.max(np.abs(answer.theta))
    if np.mean(bends) < 0.5 and np.ptp(answer.omega) > 0.01 * abs(THROW.omega0):
        return "theta runs straight from time to time of its own: go to ask.times themselves instead of interpolating; "
    return ""


def _lag_advice(ask: Ask, answer: Answer) -> str:
    """Return that omega belongs to another instant, if it does not follow from the places answered with it."""
    if answer.r is None or float(drift(ask, answer).max()) < 1e-5:
        return ""
    return f"{STALE_OMEGA}; "


def drift(ask: Ask, answer: Answer) -> FloatArray:
    """Return the difference of J omega from its value at release, as a fraction of it, at each time of an answer."""
    throw = ask.scenario
    inertia = answer.inertia if answer.r is None else moment_of_inertia(throw, answer.r)
    assert inertia is not None
    return np.asarray(np.abs(inertia * answer.omega / (moment_of_inertia(throw, ask.start) * throw.omega0) - 1.0))


def _jump_advice(times: FloatArray, omega: FloatArray) -> str:
    """Return where omega [omega_0] jumps, if it does: it must not, since the slices, and so J, change continuously."""
    steps = np.abs(np.diff(omega))
    k = int(np.argmax(steps))
    if steps[k] < max(0.01, 10 * np.quantile(steps, 0.98)):
        return ""
    where = f"omega jumps by {steps[k]:.2g} of omega_0 at t = {times[k]:.3g} s"
    return f"{where}: look at where an impact or the end of a rest puts a slice; "


SLOW: Final = replace(THROW, omega0=THROW.omega0 / 8, duration=8 * THROW.duration)
"""A throw that turns as far as ``THROW`` in eight times the time."""


LISTED: Final = "answer the speeds of an impact in the bottle, just before it and just after it"
"""What to look at if the speeds of impacts are wrong."""

LAW: Final = "look at the rebound: a slice leaves an end at e times its speed, both measured in the bottle"
"""What to look at if the motion after impacts is wrong, too."""

RIGHT_MOTION: Final = "the motion is right from one output to the next"
RIGHT_OMEGA: Final = "omega is right after impacts"


DEFINED: Final = {
    "r_cm": "r_cm is the centre of mass of bottle and water, from the cap: look at the masses, and at where it begins",
    "inertia": "J is that about the common centre of mass, with the bottle's own: look at the masses, at the bottle's "
    "own inertia, and at where the answer is put together",
}
"""What is answered beside r, and what to look at."""


def _rebound_advice(hits: Impacts) -> str:
    """Return by which factor slices leave the ends, if it is one; else nothing."""
    e = THROW.restitution
    powers = {
        ", the root of e": e**0.5,
        ", e squared": e**2,
        ", an elastic impact": 1.0,
        ", 1 / e, as if the speeds before and after were exchanged": 1.0 / e,
    }
    moves = (hits.speed_after > 0.0) & (hits.speed_before > 0.0)
    wrong = []
    for end, name in ((1, "base"), (-1, "cap")):
        factors = hits.speed_after[moves & (hits.end == end)] / hits.speed_before[moves & (hits.end == end)]
        if not len(factors):
            continue
        if np.ptp(factors) > 0.01 * factors.max():
            return ""
        factor = float(np.median(factors))
        if abs(factor / e - 1.0) > 0.01:
            word = next((word for word, value in powers.items() if abs(factor / value - 1.0) < 0.01), "")
            wrong.append(f"slices leave the {name} at {factor:.3g} of their speed{word}")
    return f"{' and '.join(wrong)}: look at the rebound, and at what is answered of it" if wrong else ""


def _departure_advice(traits: Traits, otherwise: str) -> TextGenerator:
    """Return where a solver departs from its equation between two outputs, and by what, if that is known.

    If it departs nowhere return ``otherwise``.
    """
    if traits.equation is None or traits.equation in SCHEMES:
        return ""
    try:
        where, advice = yield from departing(traits, traits.equation, [knobs.ask(0) for knobs in PIECES])
    except (NotApplicableError, ForeignError):
        return ""
    if not where:
        return otherwise
    return (
        f"it departs from {traits.equation} {where}: {advice}" if advice not in ("", UNEXPLAINED, STALE_OMEGA) else ""
    )


def _omega_advice(traits: Traits) -> TextGenerator:
    """Return what to look at where speeds of impacts are wrong, by whether omega is right; empty if not known."""
    equation = traits.equation or (yield from placing(traits)).followed
    if not equation or equation in SCHEMES:
        return ""
    (comparison,) = yield from comparing(traits, [PAPER], SEED, equation, elsewhere.UNREFINED)
    if "omega" in comparison.wrong and comparison.onset:
        return f"omega is wrong, too, {comparison.onset}: {LAW}"
    return f"{RIGHT_OMEGA}: {LISTED}" if comparison.wrong.keys() <= {"impacts"} else ""


def _ends_exchanged(answer: Answer, hits: Impacts) -> bool:
    """Return whether most slices are nearer to the other end than that which they are said to strike."""
    if answer.r is None:
        return False
    inside = hits.time < answer.t[-1]
    rows = np.searchsorted(answer.t, hits.time[inside])
    from_middle = answer.r[rows, hits.slice[inside]] - THROW.bottle.length / 2
    return bool(inside.any() and np.mean(from_middle * hits.end[inside] < 0.0) > 0.8)


def check_definitions(traits: Traits) -> CheckGenerator:
    """r_cm and inertia are those of the slices at the same instant; slices leave an impact at e times their speed.

    Those of a program that lags by a step may differ by an amount that falls with the step.
    """
    lags = _lags(traits) and traits.refined_by is not None
    answer, *finer = yield [ask_of(traits, THROW, level) for level in ((0, 2) if lags else (0,))]
    bound = max(2e-5, 64 * traits.epsilon)  # six printed digits are right
    given = [name for name in DEFINED if name in answer.given]
    if answer.impacts is not None and len(answer.impacts):
        in_time = np.argsort(answer.impacts.time, kind="stable")  # they come in any order
        hits = Impacts(**{name: getattr(answer.impacts, name)[in_time] for name in IMPACT})
        error = np.abs(hits.speed_after - THROW.restitution * hits.speed_before) * (hits.speed_after > 0)
        if traits.equation is None or (traits.equation not in SCHEMES and switches_of(traits.equation).recoil):
            # Of several that strike at one instant, the recoil may send one off faster than its own rebound.
            near = np.diff(hits.time, prepend=-np.inf, append=np.inf) < 1e-9 * THROW.duration
            error[(near[1:] | near[:-1]) & (hits.speed_after > THROW.restitution * hits.speed_before)] = 0.0
        error /= max(float(np.max((hits.speed_before, hits.speed_after))), 1e-300)
        holds = bool(error.max() <= 0.02)  # they may be read off two steps
        if holds and _ends_exchanged(answer, hits):
            return Observation(
                holds=False,
                expected="the end of an impact is 1 for the base and -1 for the cap",
                observed="slices are near the other end when they strike",
                advice="look at the sign of the end in the answered impacts",
            )
        if not (holds and answer.r is not None and given):
            advice = "" if holds else _rebound_advice(hits)
            if not holds:
                motion = yield from _departure_advice(traits, f"{RIGHT_MOTION}: {LISTED}")
                if motion.startswith(RIGHT_MOTION):
                    listed = advice.partition(": look")[0]
                    advice = f"{motion}{listed and f'; by the list {listed}'}"
                advice = advice or motion
                if not advice and answer.r is not None and given:
                    drifts = [n for n, errors in _defined(answer)[1].items() if n in given and errors.max() > bound]
                    advice = (yield from _drift_advice(traits, answer, drifts[0], bound)) if drifts else ""
                advice = advice or (yield from _omega_advice(traits)) or LISTED
            return Observation(
                holds=holds,
                expected="speed_after = e speed_before of each of the impacts, or 0",
                observed=f"off by {error.max():.2g} of the largest speed",
                where=time_of_max(hits.time, error),
                advice=advice,
            )
    if answer.r is None or not given:
        raise NotApplicableError("no r is given" if answer.r is None else "neither r_cm nor inertia is given")
    derived, all_errors = _defined(answer)
    errors = {name: all_errors[name] for name in given}
    by_level = [errors, *(_defined(one)[1] for one in finer)]
    sizes = {name: [float(each[name].max()) for each in by_level] for name in errors}
    wrong = [name for name in sizes if not (sizes[name][0] <= bound or falls_with_step(sizes[name]))]
    worst = max(wrong or sizes, key=lambda name: sizes[name][0])
    centre = _centre_advice(answer.r, answer.r_cm) if "r_cm" in wrong and answer.r_cm is not None else ""
    if centre or (len(wrong) > 1 and _follows(answer, derived)):
        worst = "r_cm"
    values = np.asarray(getattr(answer, worst))
    hint = _decimals_advice(answer) + _delay_advice(values, derived[worst])
    moves = np.ptp(values) > bound * np.max(np.abs(values))
    if not moves and errors[worst][0] <= bound:
        hint += f"{worst} stays what it is at release: answer that of each instant; "
    elif worst == "inertia":
        hint += (
            parts_advice(answer.r, values)
            or _axis_advice(values, derived)
            or _beyond_advice(answer, errors["inertia"] > bound)
        )
    else:
        hint += centre or _release_advice(answer, derived["r_cm"], bound)
    if wrong and not hint and answer.t[0] == 0.0 and errors[worst][0] <= bound and moves:
        hint = yield from _drift_advice(traits, answer, worst, bound)
    return Observation(
        holds=not wrong,
        expected=f"within {bound:.1g} of those that follow from r"
        + (", or a difference that falls with the step" if lags else ""),
        observed=f"{worst} off by {sizes[worst][0]:.2g}{refined_text(traits, sizes[worst])}",
        where=time_of_max(answer.t, errors[worst]),
        advice=hint.removesuffix("; ") or DEFINED[worst],
    )


def _lags(traits: Traits) -> bool:
    """Return whether the program that a solver declares answers its inertia a step late."""
    program = SCHEMES.get(traits.equation or "")
    return program is not None and program.form.lagged


def _defined(answer: Answer) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return r_cm and inertia that follow from r, and by how much those of an answer differ, as fractions."""
    assert answer.r is not None
    derived = {"r_cm": centre_of_mass(THROW, answer.r), "inertia": moment_of_inertia(THROW, answer.r)}
    scale = scales(THROW, derived["inertia"])
    return derived, {name: np.abs(getattr(answer, name) - derived[name]) / scale[name] for name in derived}


def _beyond_advice(answer: Answer, wrong: NDArray[np.bool_]) -> str:
    """Return that an inertia is wrong only where a slice is answered on an end, if it is and is right elsewhere."""
    assert answer.r is not None
    ends = {"the cap": np.any(answer.r <= THROW.r_min, axis=1), "the base": np.any(answer.r >= THROW.r_max, axis=1)}
    if not wrong.any() or np.mean(wrong) > 0.5 or np.any(wrong & ~np.logical_or(*ends.values())):
        return ""
    end = next((name for name, on_end in ends.items() if not np.any(wrong & ~on_end)), "an end")
    return (
        f"only while a slice is answered on {end}: J may be that of a slice beyond it, whose r is clipped: look at "
        "where slices turn there, at h/2N and L - h/2N, and at impacts that a step misses; "
    )


def _drift_advice(traits: Traits, answer: Answer, name: str, bound: float) -> TextGenerator:
    """Return what may drive r_cm or J off what follows from r: impacts, or a force that a throw without it lacks."""
    assert answer.r is not None
    first = int(np.argmax(_defined(answer)[1][name] > bound))
    at_end = (answer.r < THROW.r_min + 1e-3 * THROW.slice_height) | (answer.r > THROW.r_max - 1e-3 * THROW.slice_height)
    struck = (at_end & ~at_end[0])[: first + 2].any()
    if answer.impacts is not None:
        struck |= np.any(answer.impacts.time < answer.t[first])
    look_at = "inertial forces, and at the launch velocity"
    if struck:
        look_at = "what an impact does to the bottle, and at slices that come to rest or that the recoil lifts off"
    else:
        ask, inside = ask_of(traits, THROW), far_from_ends(THROW)
        rows = slice(max(first, int(np.searchsorted(ask.times, SMOOTH.duration))) + 1)  # before slices may strike
        answers = yield [replace(ask, scenario=replace(THROW, drag=0.0)), replace(ask, start=inside)]
        without_drag, without_rest = (np.all(_defined(each)[1][name][rows] <= bound) for each in answers)
        if without_drag:
            look_at = "the reaction of the drag: without drag it is right"
        elif without_rest:
            look_at = "the forces of slices at rest on the bottle: without a slice at rest it is right"
    return (
        f"{name} is right at release and not from t = {answer.t[first]:.2g} s on: if it follows from the motion, "
        f"bottle and water are not moved by opposite forces: look at {look_at}"
    )


def _slopes(answer: Answer) -> tuple[FloatArray, FloatArray]:
    """Return dr/dt by differences and the mean v between outputs, each (P - 1, N) [m/s]."""
    assert answer.r is not None
    assert answer.v is not None
    return np.diff(answer.r, axis=0) / np.diff(answer.t)[:, None], (answer.v[1:] + answer.v[:-1]) / 2


def _frame_advice(answer: Answer) -> str:
    """Return that v differs from dr/dt by the same for all slices, as if measured in another frame, if it does."""
    slope, mean = _slopes(answer)
    apart = mean - slope
    if not rms(np.ptp(apart, axis=1)) < 0.05 * rms(apart):
        return ""
    drift = THROW.slice_mass * slope.sum(axis=1) / THROW.total_mass
    frame = ", by the velocity of the common centre of mass" if rms(apart[:, 0] + drift) < 0.05 * rms(apart) else ""
    return f"v and dr/dt differ by the same for every slice{frame}: "


def _behind_advice(answer: Answer) -> str:
    """Return that r or v is that of the output before, if the other then goes with it."""
    slope, mean = _slopes(answer)
    together = float(np.quantile(np.abs(slope - mean), 0.9))
    for name, ahead, behind in (("r", mean, slope), ("v", slope, mean)):
        if float(np.quantile(np.abs(behind[1:] - ahead[:-1]), 0.9)) < 0.05 * together:
            return f"{name} is that of the output before: answer r and v of the same instant; "
    return ""


WEIGHTS: Final = "look at the length of a step, and at weights of the method, which have to add up to 1"


def _factor_advice(answer: Answer) -> str:
    """Return that v is a constant times dr/dt, if it is, with what the constant may be."""
    slope, mean = _slopes(answer)
    factor = float(np.sum(slope * mean) / max(float(np.sum(slope**2)), 1e-300))
    if abs(factor - 1.0) < 0.01 or not rms(mean - factor * slope) < 0.02 * rms(mean):
        return ""
    turned = np.diff(answer.theta) / np.diff(answer.t) / (answer.omega[1:] + answer.omega[:-1]) * 2
    if abs(factor * float(np.median(turned)) - 1.0) < 0.002:
        return f"r and theta both go {1 / factor:.4g} times as far as v and omega say: {WEIGHTS}; "
    spin, length = abs(SMOOTH.omega0), SMOOTH.bottle.length
    constants = {"1 / omega_0": 1 / spin, "omega_0": spin, "1 / L": 1 / length, "L": length}
    name = next((f", {name}," for name, value in constants.items() if abs(factor / value - 1.0) < 0.005), "")
    return f"v is {factor:.4g}{name} times dr/dt throughout: look at its unit and sign; "


def _delay_advice(answered: FloatArray, exact: FloatArray) -> str:
    """Return that the values answered belong to the previous output, if they do."""
    delayed = np.max(np.abs(answered[1:] - exact[:-1])) < 1e-3 * np.ptp(exact)
    return "it is that of the output before: answer what belongs to r of the same instant; " if delayed else ""


def parts_advice(r: FloatArray, inertia: FloatArray) -> str:
    """Return which parts of the definition of J count more or less than once in the inertia answered, if any."""
    parts = parts_of_inertia(THROW, r)
    columns = np.array(list(parts.values())).T
    factors, *_ = np.linalg.lstsq(columns, inertia, rcond=1e-12)
    if np.max(np.abs(columns @ factors - inertia)) > 1e-4 * np.max(inertia):
        return ""
    words = ("the bottle's about its middle", "that of the slices about their mean", "the shift to the common centre")
    if np.ptp(factors) < 1e-3 < abs(factors[0] - 1.0):
        return f"J counts {factors[0]:.4g} times as a whole: look at the mass or the length by which it is scaled; "
    eps = THROW.bottle.mass / THROW.total_mass
    shifts = {
        "M_b (L/2 - r_CM)^2 is missing in J": eps,
        "the slices are taken about mean(r) instead of r_CM": 1.0 - eps,
        "the bottle is taken about mean(r) instead of r_CM": eps + 1.0 / (1.0 - eps),
    }
    if np.max(np.abs(factors[:2] - 1.0)) < 1e-3:
        for mistake, factor in shifts.items():
            if abs(factors[2] - factor) < 1e-3:
                return f"{mistake}; "
    if np.max(np.abs(factors[1:] - 1.0)) < 1e-3:
        excess = (factors[0] - 1.0) * float(columns[0, 0])
        for part, size in _constants(THROW).items():
            if abs(abs(excess) - size) < 0.01 * size:
                return f"J has {part} too {'much' if excess > 0 else 'little'}; "
    wrong = [
        f"{name} counts {f:.3g} times ({meaning})"
        for name, meaning, f in zip(parts, words, factors, strict=True)
        if abs(f - 1.0) > 1e-3
    ]
    return f"in J = {' + '.join(parts)}, {' and '.join(wrong)}; " if wrong else ""


def _follows(answer: Answer, derived: Mapping[str, FloatArray]) -> bool:
    """Return whether J is off by M (r_cm - that which follows from r)^2: taken about the r_cm answered."""
    assert answer.inertia is not None
    assert answer.r_cm is not None
    shift = THROW.total_mass * (answer.r_cm - derived["r_cm"]) ** 2
    return bool(np.max(np.abs(answer.inertia - derived["inertia"] - shift)) < 1e-3 * np.max(shift))


def _release_advice(answer: Answer, expected: FloatArray, bound: float) -> str:
    """Return how r_cm is wrong at release already, if it is."""
    middle = THROW.bottle.length / 2
    if answer.r_cm is None or abs(answer.r_cm[0] - expected[0]) <= bound * THROW.bottle.length:
        return ""
    share = (answer.r_cm[0] - middle) / (expected[0] - middle)
    if share < 0.0:
        return "already at release it is on the other side of the bottle's middle; "
    if abs(share - 1.0) < 0.01:
        return ""
    return (
        f"already at release it is {share:.3g} times as far from the bottle's middle as it should be: look at the sum "
        "over the slices and the masses with which it begins; "
    )


def _axis_advice(inertia: FloatArray, derived: Mapping[str, FloatArray]) -> str:
    """Return about which place of the bottle J is taken instead of the common centre of mass, if it is one of three."""
    length = THROW.bottle.length
    for name, place in {"the cap": 0.0, "the base": length, "the bottle's middle": length / 2}.items():
        shift = THROW.total_mass * (derived["r_cm"] - place) ** 2
        if np.max(np.abs(inertia - derived["inertia"] - shift)) < 1e-3 * np.max(shift):
            return f"J is about {name} instead of the common centre of mass; "
    return ""


def _centre_advice(r: FloatArray, r_cm: FloatArray) -> str:
    """Return how r_cm is made of the places of slices and bottle, if the masses or the end are wrong."""
    length, expected = THROW.bottle.length, centre_of_mass(THROW, r)
    if np.max(np.abs(r_cm + expected - length)) < 2e-5 * length:
        return "r_cm is L minus the right one: measure it from the cap; "
    columns = np.column_stack((r.mean(axis=1), np.full(len(r), length / 2)))
    shares, *_ = np.linalg.lstsq(columns, r_cm, rcond=1e-12)
    if np.max(np.abs(columns @ shares - r_cm)) > 1e-4 * length:
        return ""
    water, bottle = (float(share) for share in shares)
    if abs(bottle) < 1e-3 and abs(water - 1.0) < 1e-3:
        return "r_cm is mean(r), that of the water alone; "
    if abs(water + bottle - 1.0) < 1e-3 and bottle > 0.0:
        weight = water / bottle * THROW.bottle.mass / THROW.water_mass
        return f"r_cm is that of water which weighs {weight:.3g} times as much; "
    return f"r_cm is {water:.3g} mean(r) + {bottle:.3g} L/2: these shares are M_w/M and M_b/M; "


def _constants(throw: Scenario) -> dict[str, float]:
    """Return what a moment of inertia may have too much or too little whatever the places of slices are [kg m^2]."""
    bottle, water, height = throw.bottle, throw.water_mass, throw.slice_height
    disc = {"M_w R^2/4": water * bottle.radius**2 / 4, "M_w h^2/12 of slices of height h": water * height**2 / 12}
    return {
        **{f"M_b R^2/{n}": bottle.mass * bottle.radius**2 / n for n in (2, 4)},
        **{f"M_b L^2/{n}": bottle.mass * bottle.length**2 / n for n in (4, 12)},
        **disc,
        "M_w (R^2/4 + h^2/12) of slices of height h": sum(disc.values()),
        "M_w R^2/2": water * bottle.radius**2 / 2,
    }


def _decimals_advice(answer: Answer) -> str:
    """Return that the inertia is printed with few decimals, if it is: in kg m^2 that leaves few digits."""
    if answer.inertia is None or "inertia" in answer.derived:
        return ""
    decimals = decimals_of([answer.inertia], range(3, 10))
    return f"inertia has {decimals} decimals, which are few digits: print all digits (%.17g); " if decimals else ""


SLIGHT: Final = 5e-3
"""Difference of v from dr/dt, fraction of the largest v, that is less than one of unit, frame or instant."""

COEFFICIENTS: Final = "the coefficients of answers between two steps, and of steps"
"""What to look at where v is slightly wrong."""

JUMP: Final = 0.1
"""Ratio of the second to the first differences of r between close times above which r is not smooth."""


def check_velocity(traits: Traits) -> CheckGenerator:
    """v is the rate at which r changes, whatever other times are asked."""
    dense_asks = [ask_of(traits, SMOOTH, level, 961) for level in ((0, 2) if traits.refined_by else (0,))]
    indices = np.array([0, 240, 400, 800, 960])
    times = dense_asks[0].times[indices]
    times.setflags(write=False)
    *answers, sparse = yield [*dense_asks, replace(dense_asks[0], times=times)]
    if answers[0].r is None or answers[0].v is None:
        raise NotApplicableError("no v is given")
    sizes, step = [], float(answers[0].t[1])
    for a in answers:
        assert a.r is not None
        assert a.v is not None
        differences = np.abs(np.diff(a.r, axis=0) / step - (a.v[1:] + a.v[:-1]) / 2)
        inside = np.minimum(a.r - SMOOTH.r_min, SMOOTH.r_max - a.r) > 0.01 * SMOOTH.bottle.length
        between = inside[:-1] & inside[1:]
        if _lags(traits) and between.any():  # on its grid, slices that an end presses turn back in every step
            differences = differences[between]
        sizes.append(float(np.quantile(differences, 0.9) / max(float(np.max(np.abs(a.v))), 1e-300)))
    fastest = max(float(np.max(np.abs(answers[0].v))), 1e-6)
    bound = (1e-4 if traits.refined_by else 1e-2) + 4 * traits.epsilon * THROW.bottle.length / (step * fastest)
    assert sparse.r is not None
    assert sparse.v is not None
    r_change = float(
        np.max(np.abs(sparse.r - answers[0].r[indices])) / max(float(np.ptp(answers[0].r, axis=0).max()), 1e-300)
    )
    v_change = float(np.max(np.abs(sparse.v - answers[0].v[indices]))) / fastest
    if v_change > 100 * max(bound, r_change):
        return Observation(
            holds=False,
            expected="the v of an instant, whatever other times are asked",
            observed=f"v changes by {v_change:.2g} of its largest value and r by {r_change:.2g} of its way",
            where=f"0.05 s, asked at {len(times)} and at {len(answers[0].t)} times",
            advice="v is the state's at each of ask.times, not a slope of r from one of them to the next",
        )
    constant = not np.ptp(answers[0].v, axis=0).any()
    return Observation(
        holds=sizes[0] <= bound or (falls_with_step(sizes) and sizes[-1] < 1e-2),
        expected=f"v = dr/dt within {bound:.1g} of the largest v, or a difference that falls with refinement",
        observed=f"off by {sizes[0]:.2g}{refined_text(traits, sizes)}",
        where="0.05 s",
        advice=factor_advice
        if WEIGHTS in (factor_advice := _factor_advice(answers[0]))
        else _times_advice(answers[0])
        + ("v is the same at all times: answer a copy of each state; " if constant else "")
        + _behind_advice(answers[0])
        + factor_advice
        + (
            "the difference falls with the step: look at how r and v are answered between two steps; "
            if sizes[-1] < 0.7 * sizes[0]
            else "r jumps between times asked: look at how r and v are answered between two steps; "
            if rms(np.diff(answers[0].r, n=2, axis=0)) > JUMP * rms(np.diff(answers[0].r, axis=0))
            else f"so small a difference that does not fall: look at {COEFFICIENTS}; "
            if traits.refined_by and sizes[0] < SLIGHT
            else ""
        )
        + _frame_advice(answers[0])
        + "v is measured in the bottle, from cap to base, at the instant of r and of the same slice",
        facts={"velocity": sizes},
    )
