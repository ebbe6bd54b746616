"""Where a solver departs from its equation: the reference carries on from the solver's own state, output by output.

From the state at each output the reference flies to the next one. Any difference there is not inherited from earlier
outputs: it arises between the two. So departures are counted by what happens there (``CATEGORIES``), and analysed by
what they consist of (``causes``). Needs r and v.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flipproof.foreign.causes import cause_of, delay, rms, time_cause
from flipproof.foreign.checking import NotApplicableError, effort_of, refined_words
from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits
from flipproof.foreign.interval import FLOOR, Interval, intervals_of
from flipproof.foreign.place import switches_of
from slicemodel.trajectory import BASE, CAP, FloatArray

BoolArray = NDArray[np.bool_]

OUTPUTS: Final = 160
"""Outputs of a throw at which the reference is restarted."""

LOCATED: Final = 1e-4
"""``FLOOR`` across an impact, whose time may be located to a tolerance only; of omega as a fraction of omega_0."""

SPOILED: Final = 5e-5
"""Departure at isolated impacts, at a quarter of the step, from which on they spoil an order of 2 or more.

Right solvers of such an order among the benchmarks leave at most 1e-6 there, mistakes 1e-4 and more.
"""

LEVELS: Final = (0, 2, 4)
"""Levels of refinement; the last one only if there are departures at the others."""

LONG: Final = -3
"""Level of steps so long that an impact is overlooked if a part of a step is not searched for it."""

EXACT: Final = 1e-7
OVERLOOKED: Final = 1e-3
"""Departures of most impacts at steps so long if each is located, and of one that is overlooked.

Right solvers whose median is below ten times the first leave the second at one impact at the most.
"""

FALLS: Final = 0.4
"""Fraction of a departure that remains at a quarter of the step, if only the step causes it."""

NAMES: Final = {BASE: "base", CAP: "cap"}


Category = tuple[Callable[[Interval], bool], str]


def _end_categories(end: int) -> dict[str, Category]:
    """Return what may happen at one end."""
    name, opposite = NAMES[end], NAMES[-end]
    return {
        f"with an impact on the {name}": (lambda i: i.strikes(end), "impacts"),
        f"in which slices rest on the {name}": (lambda i: i.rests(end), "rests"),
        f"in which a slice comes to rest on the {name}": (lambda i: i.settles(end), "begin of rests"),
        f"in which a slice is let go from the {name}": (lambda i: i.leaves(end), "end of rests"),
        f"with an impact on the {name} while others rest there": (
            lambda i: i.strikes_beside(end, end),
            "impacts on rests",
        ),
        f"with an impact on the {name} while others rest on the {opposite}": (
            lambda i: i.strikes_beside(end, -end),
            "impacts on rests",
        ),
    }


ENDS: Final = (BASE, CAP)

CATEGORIES: Final[Mapping[str, Category]] = {
    "": (lambda _: True, ""),
    "in which nothing strikes an end": (lambda i: not i.hits, ""),
    "with an impact": (lambda i: bool(i.hits), "impacts"),
    "in which slices rest": (lambda i: any(map(i.rests, ENDS)), "rests"),
    "without a slice at rest": (lambda i: not (i.before.any() or i.after.any()), ""),
    "in which a slice comes to rest": (lambda i: any(map(i.settles, ENDS)), "begin of rests"),
    "in which a slice is let go": (lambda i: any(map(i.leaves, ENDS)), "end of rests"),
    "with impacts of several slices at one instant": (lambda i: i.together, "impacts at one instant"),
    "with several impacts": (lambda i: len(i.hits) > 1, "order of impacts in a step"),
    "with an impact while others rest": (
        lambda i: any(i.strikes_beside(end, resting) for end in ENDS for resting in ENDS),
        "impacts on rests",
    ),
    "where there is weight": (lambda i: i.throw.gravity > 0, "weight"),
    "where there is drag": (lambda i: i.throw.drag > 0, "drag"),
    "where g = 0": (lambda i: i.throw.gravity == 0, "no weight"),
    "where there is no drag": (lambda i: i.throw.drag == 0, "no drag"),
    "of an odd number of slices": (lambda i: i.throw.n_slices % 2 == 1, "odd"),
    "in which slices rest while there is drag": (lambda i: i.throw.drag > 0 and any(map(i.rests, ENDS)), "rests"),
    **_end_categories(BASE),
    **_end_categories(CAP),
}
"""What may happen between two outputs, the general before the special: phrase -> (test, key of ``LOOK_AT``)."""

LOOK_AT: Final[Mapping[str, str]] = {
    "impacts": "what an impact does",
    "rests": "what holds a slice at rest, and its part in the motion of the others",
    "begin of rests": "when a slice stays on its end instead of rebounding",
    "end of rests": "when a slice at rest is let go",
    "slow rebounds": "the speed below which a slice rests instead of rebounding, at most |omega_0| L / 10 000",
    "impacts at one instant": "impacts of several slices at one instant",
    "order of impacts in a step": "several impacts close together: each at its own time, the earliest first",
    "weight": "the weight, g cos(theta): its size, sign, angle and instant",
    "drag": "the drag, and against what v is measured",
    "no drag": "what is done without drag: is a drag of 0 taken for none given?",
    "no weight": "what is done without weight: is a gravity of 0 taken for none given?",
    "odd": "the loop over slices: every slice moves, also the last of an odd number",
    "impacts on rests": "the part of slices at rest in the impact of another",
}
"""What to look at, by what happens between two outputs."""

OF_FORCES: Final = ("weight", "drag", "no weight", "no drag")
"""Keys that say little where a term is named, or where it happens without them, too."""

LOW: Final = 0.03
"""Speed of an impact that may be overlooked in a long step [L omega_0]."""

MANY: Final = 10
"""Impacts of a throw from which on a limit on their number is thought of."""

SLOW: Final = 0.03
"""Speed of a rebound that a slice may lose by coming to rest too early [L omega_0]."""

FEW: Final = 3
"""Fewest departing intervals that are reported: rounding may move one impact to the other side of an output."""

SURE: Final = 0.9
"""Fraction of the departures that a category must hold if none holds them all."""


UNEXPLAINED: Final = (
    "no term explains it: look at what is held constant within a step, at coefficients of the method, "
    "at iterations that end early, and at tolerances of its own"
)
"""What to look at where nothing is found that explains a departure."""

UNTOLD: Final = 0.15
"""By how much a category that says nothing of the cause must fit better than one that does."""

DepartureGenerator = Generator[Sequence[Ask], Sequence[Answer], tuple[str, str]]


def departing(traits: Traits, equation: str, asks: Sequence[Ask], crowded: Sequence[Ask] = ()) -> DepartureGenerator:
    """Return between which outputs of throws a solver departs from an equation, and by what; empty if it does not.

    Asks for each throw again, at ``OUTPUTS`` times, at two to four levels if the solver can be refined; for ``crowded``
    ones, of many slices, with long steps only. Raises NotApplicableError if the answers lack r or v.
    """
    if traits.refined_by is None:
        intervals = yield from _intervals_at(traits, equation, asks, 0)
        departs = _departs(traits, intervals, None)
        return _describe(equation, intervals, departs) if departs.sum() >= FEW else ("", "")
    departure = yield from _departing(traits, equation, asks)
    if not departure[0]:
        with suppress(ForeignError):
            where, advice = _overlooked((yield from _intervals_at(traits, equation, [*asks, *crowded], LONG)))
            if where:
                effort = effort_of(traits, asks[0].scenario, LONG)
                return f"{where} at {traits.refined_by} = {effort:.2g}", advice
    return departure


def _departing(traits: Traits, equation: str, asks: Sequence[Ask]) -> DepartureGenerator:
    """Return the same for a solver that can be refined, at short steps."""
    coarse: list[Interval] = []
    spoiled = ("", "")
    for level in LEVELS:
        try:
            intervals = yield from _intervals_at(traits, equation, asks, level)
        except ForeignError:
            if coarse:  # too slow for such fine steps
                with suppress(ForeignError):
                    longer = yield from _intervals_at(traits, equation, asks, LONG)
                    departs = _departs(traits, coarse, longer)
                    return _describe(equation, coarse, departs) if departs.sum() >= FEW else spoiled
                return spoiled
            if level == LEVELS[-1]:
                raise
            continue
        if coarse:
            if passed_over := _passed_over(traits, coarse, intervals):
                advice = (
                    "the slice goes on as before it: find each impact inside its step, of both ends the earliest "
                    "first; an answer between two steps must know of an impact on its way"
                )
                return passed_over, advice
            spoiled = max(spoiled, _spoiled(traits, coarse, intervals))
            departs = _departs(traits, intervals, coarse)
            if departs.sum() < FEW:
                return spoiled
        ignored = bool(coarse) and [i.size for i in coarse] == [i.size for i in intervals]
        coarse = intervals
    where, advice = _describe(equation, intervals, departs)
    if ignored and not advice:
        advice = f"another {traits.refined_by} changes nothing: look at how ask.effort is used"
    return where, advice or UNEXPLAINED


def _intervals_at(
    traits: Traits, equation: str, asks: Sequence[Ask], level: float
) -> Generator[Sequence[Ask], Sequence[Answer], list[Interval]]:
    """Ask for throws at one level, and carry on from the state at each output to the next."""
    dense = []
    for ask in asks:
        times = np.linspace(0.0, ask.scenario.duration, OUTPUTS + 1)
        times.setflags(write=False)
        dense.append(replace(ask, times=times, effort=effort_of(traits, ask.scenario, level)))
    answers = yield dense
    if any(answer.r is None or answer.v is None for answer in answers):
        raise NotApplicableError("r or v is not given")
    return [
        interval
        for number, (ask, answer) in enumerate(zip(dense, answers, strict=True))
        for interval in intervals_of(equation, number, ask, answer)
    ]


def _departs(traits: Traits, fine: Sequence[Interval], coarse: Sequence[Interval] | None) -> BoolArray:
    """Return which intervals depart by more than a step's own error, a faint rest, or a tolerance of event location.

    Intervals of one kind share the error of the step, which falls with refinement. If the solver cannot be refined, it
    is taken from the intervals in which all slices fly; impacts, which may wait for its next step, are left out.
    """
    kinds = np.array([kind_of(interval) for interval in fine])
    sizes = np.array([interval.size for interval in fine])
    floor = np.where(kinds == "impact", LOCATED, FLOOR)
    floor = np.maximum(floor, 64 * traits.epsilon)
    if coarse is None:
        flights = sizes[kinds == "flight"]
        floor = np.maximum(floor, 30 * rms(flights)) if len(flights) else np.full(len(fine), np.inf)
        floor[kinds == "impact"] = np.inf
        return np.asarray(sizes > floor)
    departs = np.zeros(len(fine), dtype=bool)
    for kind in set(kinds.tolist()):
        before = [interval.size for interval in coarse if kind_of(interval) == kind]
        size = rms(sizes[kinds == kind])
        if not before or size > FALLS * rms(before):
            departs |= (kinds == kind) & (sizes > np.maximum(floor, 0.03 * size))
    return departs


def _spoiled(traits: Traits, coarse: Sequence[Interval], fine: Sequence[Interval]) -> tuple[str, str]:
    """Return, as ``_describe`` does, that impacts spoil the order of flights, unless slices only leave an end late.

    Applying an impact at the end of its step is a legitimate choice, though its error falls no faster than the step.
    """
    lone = [_lone(intervals) for intervals in (coarse, fine)]
    if (traits.order or 0.0) < 2.0 or min(map(len, lone)) < 2 * FEW:
        return "", ""
    coarse_size, fine_size = (float(np.median([interval.size for interval in intervals])) for intervals in lone)
    delays = np.array([delay(i, i.hits[0][0]) for i in lone[1]])
    stale, clock = _same_share(lone[1], delays), time_cause(lone[1])
    excused = np.mean(delays > 0.0) > 0.5 and not (stale or clock)
    if fine_size < SPOILED or coarse_size > 6 * fine_size or excused:
        return "", ""
    if clock:
        advice = clock
    elif stale:
        advice = (
            "slices go on for the same share of a step as if they had not struck: look at what the first step after an "
            "impact takes from before it, such as a rate or a slope"
        )
    elif np.mean(delays < 0.0) > 0.5:
        advice = "slices are ahead: look at the rest of a step with an impact, and what is kept over it"
    else:
        advice = (
            "look at the instant of the speed with which a slice strikes, and at the rest of the step after the impact"
        )
    quiet, fine_quiet = (np.median([i.size for i in intervals if not i.hits] or [0.0]) for intervals in (coarse, fine))
    if fine_quiet > SPOILED and quiet < 6 * fine_quiet:
        fields = sorted({max(i.departure, key=lambda name: i.departure[name]) for i in fine if not i.hits})
        also = f"so it is without an impact: look at how {' and '.join(fields)} is advanced in a step, and answered"
    else:
        also = f"steps without an impact have a higher order: {advice}"
    return (
        f"at impacts that come alone, by {coarse_size:.1g} of a field's scale (median of {len(lone[0])}) and by "
        f"{fine_size:.1g} at {refined_words(traits)}",
        also,
    )


def _same_share(lone: Sequence[Interval], delays: FloatArray) -> bool:
    """Return whether slices leave late by what they go too far in equal times with the speed before the impact.

    One that waits for the next step goes too far for a time anywhere between 0 and a step.
    """
    e = np.array([interval.throw.restitution for interval in lone])
    shares = (delays * e / (1.0 + e))[delays > 0.0]
    if len(shares) < 2 * FEW:
        return False
    low, median, high = np.quantile(shares, (0.2, 0.5, 0.8))
    return bool(high - low < 0.2 * median)


def _overlooked(intervals: Sequence[Interval]) -> tuple[str, str]:
    """Return at how many impacts a solver departs that locates most of them exactly, and what to look at.

    The low bounces of a slice that comes to rest may be lost in a long step.
    """
    struck = [i for i in intervals if i.hits and max(i.speeds) > LOW * i.throw.bottle.length * abs(i.throw.omega0)]
    sizes = np.array([interval.size for interval in struck])
    count = int(np.sum(sizes > OVERLOOKED))
    if count < FEW or np.median(sizes) > EXACT:
        return "", ""
    before = np.array([sum(len(o.hits) for o in intervals if _precedes(o, i)) for i in struck])
    fewest = int(before[sizes > OVERLOOKED].min())
    if fewest >= MANY and np.mean(sizes[before > fewest] > OVERLOOKED) > SURE:
        advice = f"all are right until {fewest} impacts of a throw are over: look for a limit on their number"
    else:
        advice = (
            "impacts in a part of a long step are overlooked: look at where in a step they are searched for, and "
            "whether the earliest of several comes first"
        )
    return f"in {count} of {len(sizes)} intervals with an impact", advice


def _precedes(first: Interval, second: Interval) -> bool:
    return first.number == second.number and first.time < second.time


def _passed_over(traits: Traits, coarse: Sequence[Interval], fine: Sequence[Interval]) -> str:
    """Return how often a slice still moves towards the end that it struck well before, if rarely with short steps."""
    counts = []
    for intervals in (coarse, fine):
        lone = [
            i
            for before, i in pairwise(intervals)
            if len(i.hits) == 1
            and not (before.hits or i.before.any())
            and 0.05 < i.hits[0][2] / i.throw.duration < 0.95
        ]
        counts.append(sum(i.v[1][i.hits[0][0]] * i.expected["v"][i.hits[0][0]] < 0.0 for i in lone))
    if counts[0] < FEW or counts[1] > counts[0] / 2:
        return ""
    return f"after {counts[0]} impacts with none shortly before, and after {counts[1]} at {refined_words(traits)}"


def _lone(intervals: Sequence[Interval]) -> list[Interval]:
    """Return the intervals with one impact, no slice at rest, and no impact in the neighbouring intervals."""
    hits = [len(interval.hits) for interval in intervals]
    return [
        interval
        for k, interval in enumerate(intervals)
        if hits[k] == sum(hits[max(0, k - 1) : k + 2]) == 1 and not (interval.before.any() or interval.after.any())
    ]


def kind_of(interval: Interval) -> str:
    """Return the kind of an interval; intervals of one kind have similar errors of their own."""
    if interval.hits:
        return "impact"
    if np.any(interval.before != interval.after):
        return "change"
    return "rest" if interval.before.any() else "flight"


def _describe(equation: str, intervals: Sequence[Interval], departs: BoolArray) -> tuple[str, str]:
    """Return the category of the intervals that depart, and by what they depart.

    It is the category that holds all of them and few others; if none does so well, one that holds nearly all.
    """
    total = int(departs.sum())
    category, look_at, members = "", "", np.ones(len(intervals), dtype=bool)
    categories = _categories_of(intervals) | _slow_rebounds(intervals, departs)
    for min_share in (1.0, SURE):
        best = 2 * total / (len(intervals) + total)  # as good as all intervals
        for name, (holds, key) in categories.items():
            inside = np.array([holds(interval) for interval in intervals])
            common = int(np.sum(inside & departs))
            score = 2 * common / (int(inside.sum()) + total) - (0.0 if key else UNTOLD)
            if common >= min_share * total and score > best + 0.02:
                best, category, look_at, members = score, name, key, inside
        if category:
            break
    common, count = int(np.sum(members & departs)), int(members.sum())
    outside = f", in {total - common or 'none'} of the {len(intervals) - count} others" if category else ""
    where = f"in {common} of {count} intervals between two outputs{category and ' ' + category}{outside}"
    departed = [interval for interval, chosen in zip(intervals, members & departs, strict=True) if chosen]
    seldom = 3 * common < count  # a wrong term would show wherever it acts
    cause = cause_of(departed, recoil=switches_of(equation).recoil, seldom=seldom and look_at == "drag")
    if look_at == "slow rebounds" or (look_at == "impacts on rests" and "recoil" in cause):
        cause = ""  # other impacts rebound and recoil rightly
    if "look at" in cause or (cause and look_at in (*OF_FORCES, "odd")):  # the terms are named
        look_at = ""
    if look_at in OF_FORCES and (
        (outside and 5 * (total - common) * count > common * (len(intervals) - count))  # it happens without it, too
        or seldom
    ):
        look_at = ""
    advice = f"look at {LOOK_AT[look_at]}" if look_at else ""
    return where, "; ".join(part for part in (cause, advice) if part)


def _categories_of(intervals: Sequence[Interval]) -> dict[str, Category]:
    """Return the categories, with one for each restitution if there are several."""
    restitutions = sorted({interval.throw.restitution for interval in intervals})
    return {
        **CATEGORIES,
        **{f"with an impact at e = {e:.3g}": _impact_at(e) for e in restitutions if len(restitutions) > 1},
    }


def _slow_rebounds(intervals: Sequence[Interval], departs: BoolArray) -> dict[str, Category]:
    """Return the category of intervals with rebounds as slow as in those that depart, if it leaves out faster ones."""
    slowest = [i.slowest_rebound for i, chosen in zip(intervals, departs, strict=True) if chosen]
    limit = max(slowest, default=np.inf)
    if not limit < SLOW:
        return {}
    name = f"with a rebound slower than {limit:.1g} omega_0 L"
    return {name: (lambda i: i.slowest_rebound <= limit, "slow rebounds")}


def _impact_at(restitution: float) -> Category:
    return lambda i: bool(i.hits) and i.throw.restitution == restitution, "impacts"
