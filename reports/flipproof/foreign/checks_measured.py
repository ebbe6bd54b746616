"""Checks that measure: order before and across impacts, the floor of precision, and restitution at both ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median_low
from typing import Any, Final

import numpy as np

from flipproof.curves.order import observed_order
from flipproof.foreign import departures, elsewhere
from flipproof.foreign.checking import (
    CALM,
    SMOOTH,
    THROW,
    CheckGenerator,
    NotApplicableError,
    Observation,
    ask_of,
    decimals_of,
    effort_of,
    shift,
)
from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits
from flipproof.foreign.place import curve, name_of, placing, switches_of
from flipproof.foreign.throws import PIECES, RESTLESS, far_from_ends
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

LEVELS: Final = (0, 1, 2, 3)
ORDER_ROOM: Final = 0.3
"""How far the observed order before impacts may fall below the declared one."""

STILL: Final = 0.7
"""A change above this fraction of the previous one counts as no smaller."""

NOISE: Final = 0.5
"""A change by steps a sixteenth shorter that exceeds this fraction of the last change is noise; order 1 makes 0.02."""

ROUNDOFF: Final = 1e-11
"""Changes, as a fraction of a field's scale, below which orders drown in round-off."""

FIELDS: Final = ("omega", "theta", "r", "v")


def check_digits(traits: Traits) -> CheckGenerator:
    """Numbers have the digits of the precision that is declared."""
    (answer,) = yield [ask_of(traits, THROW, points=121)]
    values = {name: getattr(answer, name) for name in FIELDS if getattr(answer, name) is not None}
    values = {name: numbers[1:].ravel() for name, numbers in values.items() if len(np.unique(numbers)) >= 20}
    digits = min((_digits(numbers) for numbers in values.values()), default=17)
    singles = _singles(answer)
    facts: dict[str, Any] = {"digits": digits, "arithmetic": "float32" if singles else None}
    expected = f"numbers of {traits.precision}"
    if digits <= 8:
        decimals = decimals_of(values.values(), range(2, 9))
        few = f", {decimals} decimals of every number: few digits of a small one" if decimals else ""
        required = int(traits.precision[0]) if traits.precision.endswith("digits") else 6
        return Observation(
            holds=digits >= required,
            expected=expected,
            observed=f"printed with {digits} digits{few}",
            advice='print all digits ("%.17g")',
            weak="print all digits (%.17g)" if traits.precision in ("float64", "float32") else "",
            facts=facts | {"precision": f"{max(6, digits)} digits"},
        )
    return Observation(
        holds=not singles or traits.precision != "float64",
        expected=expected,
        observed=f"the numbers of {', '.join(singles)} are those of float32" if singles else "more than 8 digits",
        advice='keep the state in float64, or declare precision = "float32"',
        facts=facts,
    )


def _digits(values: FloatArray) -> int:
    """Return the number of digits of a field, at most 17: the fewest that print all its numbers exactly."""
    numbers = values[values != 0.0].tolist()
    for digits in range(3, 9):
        if all(float(f"{x:.{digits}g}") == x for x in numbers):
            return digits
    return 17


def check_refinement(traits: Traits) -> CheckGenerator:
    """What the solver is told to refine by changes its answer."""
    if traits.refined_by is None:
        raise NotApplicableError("refined_by is not declared")
    levels: tuple[int, ...] = (-6, -2, 0, 2)
    answers = list((yield [ask_of(traits, THROW, level) for level in levels]))
    if traits.refined_by == "rtol" and _change(*answers[-2:]) == 0.0:
        # A step that something else limits meets one tolerance as well as the next, until they are very small.
        levels += (4, 6)
        answers += yield [ask_of(traits, THROW, level) for level in levels[-2:]]
    changes = [_change(a, b) for a, b in pairwise(answers)]
    nonzero = [change for change in changes if change > 0.0]
    stopped = changes[-1] == 0.0 and max(nonzero, default=0.0) > 1000 * traits.epsilon
    holds, weak = bool(nonzero) and not stopped, ""
    if not holds and traits.refined_by == "rtol":
        error = yield from _error(traits, answers[-1])
        if error is None and traits.equation:
            holds, weak = True, "whether it is accurate is told by the check of the equation"
        elif error is not None and error <= max(ACCURATE, 1024 * traits.epsilon):
            holds, weak = True, f"{error:.1g} of omega_0 off, whatever rtol is: something else limits the step"
    observed = f"changes of {', '.join(f'{c:.2g}' for c in changes)} of omega_0 from level to level"
    if not nonzero:
        observed = f"the same answer to the last bit at {len(levels)} levels of {traits.refined_by}"
    advice = f"use ask.effort as {traits.refined_by}, or declare no refined_by"
    if not nonzero and not holds and traits.equation and (yield from placing(traits)).equation == traits.equation:
        cause = yield from elsewhere.simpler_throws_advice(traits, traits.equation)
        advice += f"; if it is used, {cause.removesuffix('; ')}" if cause.startswith("right") else ""
    if not holds:
        observed += (
            ": steps grow no shorter, ask.effort is ignored from there on" if nonzero else ": ask.effort is ignored"
        )
    return Observation(
        holds=holds,
        expected=f"an answer that changes with {traits.refined_by}",
        observed=observed,
        where="0.3 s with impacts",
        advice=advice,
        weak=weak,
    )


ACCURATE: Final = 1e-10
"""Error, fraction of omega_0, allowed to a solver whose answer ignores the finest tolerances."""


def _error(traits: Traits, answer: Answer) -> Generator[Sequence[Ask], Sequence[Answer], float | None]:
    """Return the error of omega against the equation that the solver solves; None if that is not known."""
    place = yield from placing(traits)
    return shift(answer, curve(place.equation, THROW, answer.t), THROW.omega0) if place.on_lattice else None


def _change(coarse: Answer, fine: Answer) -> float:
    """Return the largest difference of omega and theta, each as a fraction of its scale."""
    return max(shift(coarse, fine, THROW.omega0), _difference(coarse.theta, fine.theta))


def _difference(coarse: FloatArray, fine: FloatArray) -> float:
    """Return the largest difference of a field's values, fraction of the largest of them."""
    return float(np.max(np.abs(coarse - fine)) / max(float(np.max(np.abs(fine))), 1e-300))


def _order_of(traits: Traits) -> float:
    """Return the declared order of a solver that is refined by its step."""
    if traits.refined_by is None:
        raise NotApplicableError("refined_by is not declared")
    if traits.order is None or traits.refined_by == "rtol":
        raise NotApplicableError("no order is declared" if traits.order is None else "rtol has no order")
    return traits.order


APART: Final = 1000.0
"""Ratio of the changes of two fields between tolerances from which on one is not controlled.

Those of right solvers are within 100.
"""


def check_order_before(traits: Traits) -> CheckGenerator:
    """Before the first impact every field's error falls at the declared order, or faster; with rtol, all alike."""
    if traits.refined_by == "rtol":
        return (yield from _changes_alike(traits))
    declared = _order_of(traits)
    # Few and long steps: at short ones an order of 4 or more drowns in round-off. Low orders show only at short ones.
    # The order is a limit for short steps: the best of the ratios counts, but that of a few times may be chance.
    levels = range(-8, -2) if declared > 2 else range(-4, 0)
    required = declared - ORDER_ROOM
    for fractions, of_ratios in ((FRACTIONS[:1], median_low), (FRACTIONS, max)):
        changes = yield from _changes_before(traits, SMOOTH, levels, fractions)
        orders = _orders(traits, changes, of_ratios)
        if not orders:
            raise NotApplicableError(f"changes under refinement are round-off, {max(changes['omega']):.2g} of omega_0")
        worst = min(orders, key=lambda name: orders[name])
        if orders[worst] >= required:
            break
    low, right = ([name for name, order in orders.items() if (order < required) == below] for below in (True, False))
    where = f"0.05 s in which the equation has no impact, steps of {'13' if declared > 2 else '0.8'} ms and its halves"
    observed, advice, calm = f"{orders[worst]:.2f} ({worst})", "", ""
    if holds := orders[worst] >= required:
        for fractions, of_ratios in ((FRACTIONS[1:2], median_low), (FRACTIONS[1:], max)):
            uneven_changes = yield from _changes_before(traits, SMOOTH, levels, fractions, uneven=True)
            # Output times shorten steps, so that a right answer changes less; where something else limits the step,
            # only they change it, and such levels do not count.
            counted = {
                name: [size if size > 2 * even > 0.0 else 0.0 for even, size in zip(changes[name], sizes, strict=True)]
                for name, sizes in uneven_changes.items()
            }
            uneven = _orders(traits, counted, of_ratios)
            worst_uneven = min(uneven, key=lambda name: uneven[name], default="")
            holds = not worst_uneven or uneven[worst_uneven] >= required
            if holds:
                break
        if not holds:
            observed = (
                f"{uneven[worst_uneven]:.2f} ({worst_uneven}) where output times cut steps unevenly, else {observed}"
            )
            advice = (
                "take the length of each step, and of the one before, as they are where output times cut them; or "
                "answer between two steps at the order of the steps"
            )
    else:
        end_orders = _orders(traits, (yield from _changes_before(traits, SMOOTH, levels, ((1.0,),))))
        if end_orders and min(end_orders.values()) >= required:
            advice = "of that order where the end alone is asked: look at how an answer between two steps is made"
        answered_low = "r" in right  # the motion is of that order
        for name, throw in CALM.items() if not (advice or answered_low) else ():
            orders_without = _orders(traits, (yield from _changes_before(traits, throw, levels)))
            low_without = [field for field, order in orders_without.items() if order < required]
            if name == "weight" and low_without == ["theta"] and sum(order < required for order in orders.values()) > 1:
                advice = "theta is of that order, and the others follow it through the weight: look at how theta is "
                advice += "advanced, with the omega of which instant"
                break
            if orders_without and min(orders_without.values()) >= required:
                calm = name
                break
        if not (advice or answered_low):
            orders_inside = _orders(traits, (yield from _changes_before(traits, SMOOTH, levels, inside=True)))
            flying = bool(orders_inside) and min(orders_inside.values()) >= required
            if flying:
                without = f"without {calm}, and also with it " if calm else ""
                part = f"the {calm}" if calm else "the motion of the others"
                advice = f"of that order {without}where no slice rests: look at the part of slices at rest in {part}"
            elif calm:
                advice = (
                    f"of that order without {calm}: look at the instant of {elsewhere.LOOK_AT[calm]}, and whether an "
                    "iteration with it converges"
                )
    if low and right:
        default_advice = (
            f"{', '.join(right)} of that order: look at how {' and '.join(low)} is advanced in a step, and answered"
        )
    else:
        default_advice = (
            "a coefficient of the step or its Jacobian, an iteration that ends early, slopes that are remembered and "
            "how a step begins without them, the instant at which omega, r_CM or J are taken, or how a step is cut to "
            "a time asked, costs the order"
        )
    low_order = orders[worst] < required  # not only where output times cut steps
    if low_order and 0.0 < changes[worst][0] < SLIGHT and not abs(orders[worst] - 1.0) < 0.15:  # order 1: no digits
        advice = (
            f"already at the longest steps {worst} changes by no more than {changes[worst][0]:.0e}: look for a "
            f"constant of few digits, or for single precision; {advice or default_advice}"
        )
    whole = round(float(np.median(list(orders.values()))))
    if low_order and whole >= CLEAN and all(abs(order - whole) < 0.5 for order in orders.values()):
        advice = (
            f"every field is of order {whole}: declare that, if it is the method's; else {advice or default_advice}"
        )
    return Observation(
        holds=holds,
        expected=f"order {declared:g} or more, within {ORDER_ROOM}",
        observed=observed,
        where=where,
        advice=advice or default_advice,
        facts={"order_before_impacts": orders[worst], "orders": orders},
    )


CLEAN: Final = 4
"""Order from which on no wrong coefficient is likely to leave the same one to every field."""

SLIGHT: Final = 1e-5
"""Change of a field, a fraction of its largest value, below which a wrong order is no gross mistake of the method."""

FRACTIONS: Final = (
    (0.0, 0.5, 1.0),
    (0.37, 0.71, 1.0),
    *((0.2 + 0.35 * first, 0.6 + 0.35 * second, 1.0) for first, second in np.random.default_rng(0).random((16, 2))),
)
"""Fractions of a throw at which answers are compared.

The error of an answer between two steps depends on where it lies between them, which changes from level to level: an
order that is too low at a few times is measured again at all of them.
"""


def _changes_alike(traits: Traits) -> CheckGenerator:
    """Hold the changes of the fields from one tolerance to the next against each other: rtol has no order."""
    changes = yield from _changes_before(traits, SMOOTH, (2, 4), FRACTIONS)
    sizes = {name: values[-1] for name, values in changes.items()}
    least, most = (select(sizes, key=lambda name: sizes[name]) for select in (min, max))
    floor = max(ROUNDOFF, 64 * traits.epsilon)
    if sizes[most] <= APART * floor:
        raise NotApplicableError(f"changes under refinement are round-off, {sizes[most]:.2g} or less")
    coarse, fine = (effort_of(traits, SMOOTH, level) for level in (2, 4))
    return Observation(
        holds=sizes[most] <= APART * max(sizes[least], floor),
        expected=f"fields that change alike, within a factor of {APART:g}",
        observed=f"{most} by {sizes[most]:.2g}, {least} by {sizes[least]:.2g}",
        where=f"0.05 s in which the equation has no impact, rtol from {coarse:.0e} to {fine:.0e}",
        advice=f"look at how {most} is advanced in a step, and answered between two: rtol does not control its error",
    )


def _changes_before(
    traits: Traits,
    throw: Scenario,
    levels: Sequence[int],
    fractions: Sequence[tuple[float, ...]] = FRACTIONS[:1],
    *,
    uneven: bool = False,
    inside: bool = False,
) -> Generator[Sequence[Ask], Sequence[Answer], dict[str, list[float]]]:
    """Return by field how much it changes from level to level, a fraction of its largest value.

    Answers are compared at ``fractions`` of the throw, and the changes are root mean squares over these; with
    ``uneven`` other times are asked, too, 0.4 and 0.8 of a step apart; ``inside`` lets all slices go far from the ends.
    """
    changes: dict[str, list[list[float]]] = {}
    start = far_from_ends(throw) if inside else throw.initial_positions()
    compared = throw.duration * np.array(fractions)
    asks = []
    for common in compared:
        for level in levels:
            times = common
            if uneven:
                times = np.union1d(common, _uneven_times(throw.duration, 960.0 / 1.2 * 2.0**level))
            asks.append(replace(ask_of(traits, throw, level), times=times, start=start))
    all_answers = yield asks
    for k, common in enumerate(compared):
        answers = all_answers[k * len(levels) : (k + 1) * len(levels)]
        for name in FIELDS:
            if getattr(answers[0], name) is not None:
                values = [getattr(answer, name)[np.searchsorted(answer.t, common)] for answer in answers]
                changes.setdefault(name, []).append([_difference(a, b) for a, b in pairwise(values)])
    return {name: np.sqrt(np.mean(np.square(sizes), axis=0)).tolist() for name, sizes in changes.items()}


def _orders(
    traits: Traits, changes: Mapping[str, Sequence[float]], of_ratios: Callable[[Sequence[float]], float] = max
) -> dict[str, float]:
    """Return the best observed order by field, or another of them; omitted where changes are round-off."""
    floor = max(ROUNDOFF, 64 * traits.epsilon)
    ratios = {
        name: [math.log2(a / b) for a, b in pairwise(sizes) if min(a, b) > floor] for name, sizes in changes.items()
    }
    return {name: of_ratios(values) for name, values in ratios.items() if values}


def _uneven_times(end: float, pairs: float) -> FloatArray:
    """Return times up to ``end`` [s], about ``pairs`` pairs of them, the second twice as long after the first."""
    ends = end * np.linspace(0.0, 1.0, max(2, round(pairs) + 1))
    return np.union1d(ends[1:], ends[1:] - np.diff(ends) * 2 / 3)


def check_order_across(traits: Traits) -> CheckGenerator:
    """Across impacts the error falls with the step, at order one half or more, down to where impacts are located."""
    declared = _order_of(traits)
    # Several throws and steps per level: where rebounds wait for the grid, a single one depends on its phase.
    throws = [THROW.with_slices(THROW.n_slices + extra) for extra in (0, 1, 2)]
    levels = [level - 4 + fraction for level in LEVELS for fraction in (0.0, 0.19)]
    answers = yield [ask_of(traits, throw, level, 11) for throw in throws for level in (*levels, 2)]
    squares = []
    for k in range(0, len(answers), len(levels) + 1):
        *coarser, reference = answers[k : k + len(levels) + 1]
        squares.append([shift(answer, reference, THROW.omega0) ** 2 for answer in coarser])
    errors = np.sqrt(np.mean(squares, axis=0).reshape(len(LEVELS), -1).mean(axis=1))
    if errors[-1] < max(ROUNDOFF, 64 * traits.epsilon):
        raise NotApplicableError(f"changes under refinement are round-off, {errors[0]:.2g} of omega_0")
    order, _ = observed_order(np.exp2(-np.array(LEVELS)), np.maximum(errors, 1e-300), floor=0.0)
    low = min(declared, 1.0) - 0.5
    located = order < low and errors[-1] <= departures.LOCATED
    limited = f"; a tolerance of event location limits it at {errors[-1]:.1g}" if located else ""
    return Observation(
        holds=order >= low or located,
        expected=f"order {low:g} or more, or errors below {departures.LOCATED:g} of omega_0",
        observed=f"{order:.2f}, {errors[-1]:.2g} of omega_0 at the finest{limited}",
        where=f"{throws[0].n_slices} to {throws[-1].n_slices} slices, 0.3 s with impacts on both ends, steps of 5 ms "
        "and its halves",
        advice="rebounds answered at the next step give order 1; an order near 0 means that refinement does not help: "
        "look at how exactly the instant of an impact is found, at what is done there, and at whether a second one in "
        "the same step is looked for",
        facts={"order_across_impacts": order},
    )


def check_floor(traits: Traits) -> CheckGenerator:
    """Refined until changes stop shrinking, a solver in float64 goes below 2e-8 of omega_0 or is still shrinking."""
    if traits.refined_by is None:
        raise NotApplicableError("refined_by is not declared")
    stride, deepest = (1, 6) if traits.refined_by == "rtol" else (2, 8)  # level 8 is 250 000 steps
    start = -4 if (traits.order or 0.0) > 2 else 0
    coarse, fine = yield [ask_of(traits, SMOOTH, level) for level in (start, start + stride)]
    changes = [shift(coarse, fine, SMOOTH.omega0)]
    noises: list[float] = []
    stopped = changes[0] <= 16 * traits.epsilon
    for level in range(start + 2 * stride, deepest + 1, stride):
        if stopped:
            break
        # If steps a sixteenth shorter change as much as steps a quarter as long, the change is noise. With another
        # tolerance a solver takes entirely different steps: this test then says nothing.
        near_levels = [level + math.log2(17 / 16)] if level < deepest and traits.refined_by != "rtol" else []
        coarse = fine
        try:
            fine, *neighbours = yield [ask_of(traits, SMOOTH, depth) for depth in (level, *near_levels)]
        except ForeignError:  # so many steps may exceed the time limit
            break
        changes.append(shift(coarse, fine, SMOOTH.omega0))
        level_noises = [shift(fine, neighbour, SMOOTH.omega0) for neighbour in neighbours]
        noises += level_noises
        noisy = any(noise > NOISE * changes[-1] for noise in level_noises)
        stopped = changes[-1] <= 16 * traits.epsilon or changes[-1] > STILL * changes[-2] or noisy
    capped = changes[-1] == 0.0 and len(changes) > 1
    floor = changes[-2] if capped else min(changes)
    admissible = 2e-8 if traits.precision == "float64" else 1e-4
    weak = stopped and floor > admissible
    count = len(changes)
    ended = "steps grow no shorter" if capped else "no longer falling" if stopped else "still falling"
    return Observation(
        holds=not weak or floor <= COARSE or capped,
        expected=f"changes fall below {admissible:.0e} of omega_0, or still fall",
        observed=f"{floor:.2g} of omega_0 after {count} refinement{'s' if count > 1 else ''}, {ended}",
        where="0.05 s before any impact",
        advice="look for a tolerance, a cut-off or rounded numbers that do not refine",
        weak=f"refinement ends at {floor:.1g} of omega_0" if weak else "",
        facts={"floor": floor, "floor_reached": stopped, "changes": changes, "noises": noises},
    )


COARSE: Final = 1e-4
"""Floor of refinement, fraction of omega_0, up to which it is a weakness; above it refinement does not help."""


def _singles(answer: Answer) -> list[str]:
    """Return the names of the fields whose numbers, at least 20 different ones, are float32 numbers.

    A float32 number printed with nine digits or more is within a tenth of their spacing.
    """
    names = []
    for name in ("theta", "omega", "r", "v"):
        values = getattr(answer, name)
        if values is None or len(np.unique(values)) < 20:
            continue
        with np.errstate(over="ignore", invalid="ignore"):
            nearest = values.astype(np.float32)
            if np.all(np.abs(values - nearest) <= 0.1 * np.spacing(np.abs(nearest))):
                names.append(name)
    return names


# ---------------------------------------------------------------------- from output to output

CROWDED: Final = replace(RESTLESS, slices=20)
"""A throw of many slices, of which several strike in one long step."""


def check_piecewise(traits: Traits) -> CheckGenerator:
    """From the solver's own state at each output the equation leads to the next."""
    place = yield from placing(traits)
    equation = traits.equation or (place.equation if place.on_lattice else place.followed)
    if not equation or (traits.equation is None and not place.on_lattice and place.change is None):
        raise NotApplicableError("no equation is declared")
    declared = name_of(switches_of(equation))
    if place.on_lattice and place.equation != declared:
        raise NotApplicableError("told by the check of the equation")
    which = ", the nearest equation," if place.on_lattice else ", the equation that it follows the longest,"
    asks = [knobs.ask(0) for knobs in PIECES]
    departure, advice = yield from departures.departing(traits, declared, asks, [CROWDED.ask(0)])
    return Observation(
        holds=not departure,
        expected=f"{declared}{'' if traits.equation else which} from one output to the next",
        observed=f"departs {departure}" if departure else "no departure beyond the step's own error",
        where=f"{len(asks)} throws, begun anew from the solver's own state at each of {departures.OUTPUTS} outputs",
        advice=advice,
    )


# ---------------------------------------------------------------------- restitution

RESTITUTION: Final = 0.5
RESTITUTION_ROOM: Final = 0.003
"""The restitution asked for, and how far a measured one may be from it."""


PLACE_ROOM: Final = 0.004
"""How far beyond or before its end a slice may turn, fraction of the bottle's length, if it waits for the grid."""


@dataclass(frozen=True, slots=True)
class Rebound:
    """One measured impact: ``speed`` before it [m/s], ``restitution``, at ``time`` [s].

    ``beyond`` is how far the slice turns beyond its end, as a fraction of the bottle's length.
    """

    end: str
    spin: float
    speed: float
    restitution: float
    time: float
    beyond: float
    room: float = 0.0

    @property
    def holds(self) -> bool:
        """Whether the restitution is the one asked for, and the slice turns at its end."""
        return abs(self.restitution - RESTITUTION) <= self.room and not self.misplaced

    @property
    def misplaced(self) -> bool:
        """Whether the slice turns somewhere other than at its end."""
        return not abs(self.beyond) <= PLACE_ROOM + self.room / 2


def throw_of(spin: float) -> Scenario:
    """Return the throw whose first impacts are measured: no drag, no gravity, so that all equations of motion agree.

    With omega_0 T = 5 the last slice reaches the cap in every one of them.
    """
    return replace(
        Scenario(), n_slices=4, drag=0.0, gravity=0.0, restitution=RESTITUTION, omega0=spin, duration=5.0 / spin
    )


def measure(answer: Answer, scenario: Scenario, end: str) -> Rebound | None:
    """Return the first impact of one slice on ``end``, with or without a rebound; None if it reaches no end.

    The last slice strikes the cap first, the second one the base. A slice that keeps less than 0.6 of its speed from
    one sample to the next has struck. Speeds are the slopes of two parabolas where they meet, each through
    ``samples`` samples before and after the turn; the two next to it are left out.
    """
    assert answer.r is not None
    samples, slowed = 6, 0.6
    side, index = (-1.0, scenario.n_slices - 1) if end == "cap" else (1.0, 1)
    x = side * answer.r[:, index]
    wall = side * (scenario.r_min if end == "cap" else scenario.r_max)
    step = float(answer.t[1] - answer.t[0])
    v = np.diff(x)
    fast_enough = v[:-1] > slowed * np.maximum.accumulate(v)[:-1]
    struck = fast_enough & (v[1:] < slowed * v[:-1]) & (wall - x[1:-1] < 0.1 * scenario.bottle.length)
    turns = np.flatnonzero(struck) + 1
    if not turns.size or turns[0] < samples + 2 or turns[0] + samples + 2 >= len(x):
        return None
    k = int(turns[0])
    before = np.polyfit(np.arange(-samples - 1, -1), x[k - samples - 1 : k - 1], 2)
    after = np.polyfit(np.arange(2, 2 + samples), x[k + 2 : k + 2 + samples], 2)
    crossing = np.roots(np.polysub(before, after))
    crossing = crossing[np.abs(crossing.imag) < 1e-9].real
    s = float(crossing[np.argmin(np.abs(crossing))]) if crossing.size else 0.0
    s = s if abs(s) <= 2.0 else 0.0
    fast, slow = float(np.polyval(np.polyder(before), s)) / step, float(np.polyval(np.polyder(after), s)) / step
    if not fast > 0.0:  # it jumped, or stood still
        return None
    beyond = (float(np.polyval(before, s)) - wall) / scenario.bottle.length
    return Rebound(end, scenario.omega0, fast, -slow / fast, float(answer.t[k]), beyond)


def check_restitution(traits: Traits) -> CheckGenerator:
    """A slice leaves an end with e times the speed at which it struck, at both ends and at every speed."""
    spins = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # first impacts at 0.05 to 4 m/s
    answers = yield [_ask_of_rebounds(traits, spin) for spin in spins]
    if answers[0].r is None:
        raise NotApplicableError("no r is given")
    rebounds = _rebounds(traits, spins, answers)
    if not rebounds:
        raise NotApplicableError("no slice reaches an end")
    if traits.refined_by and any(not r.holds for r in rebounds):
        finer = yield [_ask_of_rebounds(traits, spin, 3) for spin in spins]
        restitutions = {(r.end, r.spin): r.restitution for r in _rebounds(traits, spins, finer)}
        change = {
            key: abs(r.restitution - restitutions[key]) for r in rebounds if (key := (r.end, r.spin)) in restitutions
        }
        rebounds = [replace(r, room=r.room + min(0.05, 3 * change.get((r.end, r.spin), 0.0))) for r in rebounds]
    facts: dict[str, Any] = {"restitution": [(r.end, r.speed, r.restitution) for r in rebounds], "asked": RESTITUTION}
    wrong = [r for r in rebounds if not r.holds]
    worst = max(wrong or rebounds, key=lambda r: abs(r.restitution - RESTITUTION) - r.room)
    expected, observed, advice = f"e = {RESTITUTION} within {worst.room:.2g}", f"e = {worst.restitution:.4f}", ""
    stuck, stuck_advice = ("", "") if wrong else (yield from _stuck(traits))
    if stuck:
        expected += f", for slow impacts, too: a rest begins below omega_0 L / {1 / MAX_REST:.0f}"
        observed, where = f"none where a slice would leave {stuck}", "slices let go near the ends, no weight, no drag"
        advice = stuck_advice
    elif not wrong:
        speeds = [r.speed for r in rebounds]
        observed += f" where it is farthest off, at {min(speeds):.2g} to {max(speeds):.2g} m/s"
        where = f"{len(rebounds)} first impacts"
    elif all(r.misplaced for r in wrong if r.end == wrong[0].end):
        expected = "r = h/2 at the cap, L - h/2 at the base, h the height of a slice"
        observed = f"slices turn {abs(wrong[0].beyond):.2g} of L {'beyond' if wrong[0].beyond > 0 else 'before'} that"
        where = f"{wrong[0].end}, {wrong[0].speed:.3g} m/s"
        advice = "a slice strikes when its surface does: h = water mass / capacity x L / N"
    elif (threshold := (yield from _threshold(traits, rebounds))) is not None:
        low, high = threshold
        facts["threshold"] = [low, high]
        expected += " at every speed"
        observed = f"none below {(low + high) / 2:.3g} +- {(high - low) / 2:.1g} m/s, a velocity threshold"
        where = f"{wrong[0].end}, {wrong[0].speed:.3g} m/s: e = {wrong[0].restitution:.3f}"
        advice = "scale lengths up so that impacts are faster than the threshold, or lower it in the engine"
    else:
        where = f"{worst.end}, struck at {worst.speed:.3g} m/s, t = {worst.time:.4g} s"
        advice = "the speed after an impact, relative to the bottle, is e times the speed before it"
        if {r.end for r in wrong} == {"cap"} and any(r.end == "base" for r in rebounds):
            advice += "; right at the base: look at e at the cap, and at the slices that rest on the base "
            advice += "when one strikes the cap, which take part in that impact"
    return Observation(
        holds=not wrong and not stuck, expected=expected, observed=observed, where=where, advice=advice, facts=facts
    )


MAX_REST: Final = 1e-4
"""Speed after an impact below which a slice may rest on its end, fraction of omega_0 L."""

SLOW: Final = 3e-3 * 2.0 ** np.arange(6)
"""Speeds of slow impacts on the base, fraction of omega_0 L; those on the cap are a third faster."""


def _stuck(traits: Traits) -> Generator[Sequence[Ask], Sequence[Answer], tuple[str, str]]:
    """Return which end a slice does not leave at what speed after a slow impact, and advice; both empty if it leaves.

    Without weight and drag, a slice at x from the centre of light water that fills both ends alike is thrown outward at
    omega^2 x in every equation of the ladder. Let go at d from its end, it strikes with v = omega sqrt(2 x d) after
    v / (omega^2 x), and is e^2 d away at the middle of its rebound. The impact of another slice gives the tube no more
    than a hundredth of its own speed. A rebound twice as fast has to be right within a twentieth: long steps that miss
    one rebound would bend the next.
    """
    shares = np.stack([SLOW, 4 / 3 * SLOW], axis=1)
    throw = replace(throw_of(20.0), n_slices=shares.size, water_mass=0.002)
    ends, half = np.array([throw.r_max, throw.r_min]), throw.r_max - throw.bottle.length / 2
    distance = (shares * throw.bottle.length) ** 2 / (2 * half)
    struck = shares * throw.bottle.length / (throw.omega0 * half)
    phases = np.array([-0.3, 0.0, 0.3])
    aloft = struck + RESTITUTION * struck * (1 + phases[:, None, None])
    heights = RESTITUTION**2 * distance * (1 - phases[:, None, None] ** 2)
    throw = replace(throw, duration=1.1 * float(aloft.max()))
    start = (ends + np.array([-1.0, 1.0]) * distance).ravel()
    falling = struck / 2
    times = np.union1d(falling, aloft)
    (answer,) = yield [replace(ask_of(traits, throw, 2), times=times, start=start)]
    assert answer.r is not None
    rows = np.searchsorted(answer.t, aloft)
    answered = np.abs(answer.r[rows, np.arange(shares.size).reshape(shares.shape)] - ends)
    right = (np.abs(answered - heights) < 0.05 * heights).all(axis=0)
    stuck = (answered < 0.1 * heights).all(axis=0) & (heights[1] > 1000 * traits.epsilon * throw.bottle.length)
    before = np.abs(answer.r[np.searchsorted(answer.t, falling), np.arange(shares.size).reshape(shares.shape)] - ends)
    for rebound, end in np.argwhere(stuck[:-1] & right[1:])[::-1]:
        share = RESTITUTION * shares[rebound, end]
        speed = share * throw.omega0 * throw.bottle.length
        place = f"the {('base', 'cap')[end]} at {share:.2g} omega_0 L, {speed:.2g} m/s"
        if before[rebound, end] < 0.1 * distance[rebound, end]:
            advice = "already before it strikes it is on that end: begin at ask.start, wherever that is"
            return f"{place}: it is there from the release on", advice
        return place, "look at the speed below which a slice rests on its end"
    return "", ""


def _rebounds(traits: Traits, spins: Sequence[float], answers: Sequence[Answer]) -> list[Rebound]:
    """Return the rebounds measured at both ends; few printed digits widen their room."""
    rebounds = []
    for end in ("base", "cap"):
        for spin, answer in zip(spins, answers, strict=True):
            throw = throw_of(spin)
            if (rebound := measure(answer, throw, end)) is not None:
                uncertainty = (
                    4 * traits.epsilon * throw.bottle.length / float(answer.t[1] - answer.t[0]) / rebound.speed
                )
                if uncertainty < RESTITUTION / 4:  # else it is too slow to be measured
                    rebounds.append(replace(rebound, room=RESTITUTION_ROOM + uncertainty))
    return rebounds


def _ask_of_rebounds(traits: Traits, spin: float, level: int = 2) -> Ask:
    return ask_of(traits, throw_of(spin), level, 2401)


def _threshold(
    traits: Traits, measured: Sequence[Rebound]
) -> Generator[Sequence[Ask], Sequence[Answer], tuple[float, float] | None]:
    """Return the speeds [m/s] between which rebounds begin, if slow impacts have none and fast ones are right."""
    for end in ("cap", "base"):
        rebounds = sorted((r for r in measured if r.end == end), key=lambda r: r.speed)
        dead = [r for r in rebounds if abs(r.restitution) < RESTITUTION / 4]
        live = [r for r in rebounds if abs(r.restitution - RESTITUTION) <= 4 * RESTITUTION_ROOM]
        if not dead or not live or dead[-1].speed > live[0].speed or len(dead) + len(live) < len(rebounds):
            continue
        low, high = dead[-1], live[0]
        for _ in range(5):
            spin = float(np.sqrt(low.spin * high.spin))
            (answer,) = yield [_ask_of_rebounds(traits, spin)]
            rebound = measure(answer, throw_of(spin), end)
            if rebound is None:
                break
            low, high = (rebound, high) if abs(rebound.restitution) < RESTITUTION / 4 else (low, rebound)
        return low.speed, high.speed
    return None
