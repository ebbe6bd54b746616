"""Where a solver departs from its equation: the reference carries on from the solver's own state, output by output.

From the state at each output the reference flies to the next one. What the solver answers there besides is not handed
down from earlier: it comes from what went on between the two. So a departure is counted by what that was (``SORTS``),
and measured by what it is made of (``causes``). Needs r and v.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from flipproof.foreign.causes import cause_of, rms
from flipproof.foreign.checking import NotApplicableError, effort_of
from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits
from flipproof.foreign.interval import FLOOR, Interval, carried_on
from flipproof.foreign.place import switches_of
from slicemodel.trajectory import BASE, CAP

BoolArray = NDArray[np.bool_]

OUTPUTS: Final = 160
"""Outputs of a throw at which the reference begins anew."""

LOCATED: Final = 1e-4
"""``FLOOR`` across an impact, whose time may be found by a tolerance."""

SPOILED: Final = 5e-5
"""Departure at impacts that come alone, at a quarter of the step, from which on they cost an order of 2 or more.

Right solvers of such an order among the benchmarks leave 1e-6 there at the most, mistakes 1e-4 and more.
"""

LEVELS: Final = (0, 2, 4)
"""Levels of refinement; the last one only of what departs at the others."""

FALLS: Final = 0.4
"""Share of a departure that is left at a quarter of the step, if the step alone makes it."""

NAMES: Final = {BASE: "base", CAP: "cap"}


Sort = tuple[Callable[[Interval], bool], str]


def _of_end(end: int) -> dict[str, Sort]:
    """Return what may go on at one end."""
    here, there = NAMES[end], NAMES[-end]
    return {
        f"with an impact on the {here}": (lambda i: i.strikes(end), "impacts"),
        f"in which slices rest on the {here}": (lambda i: i.rests(end), "rests"),
        f"in which a slice comes to rest on the {here}": (lambda i: i.settles(end), "begin of rests"),
        f"in which a slice is let go from the {here}": (lambda i: i.leaves(end), "end of rests"),
        f"with an impact on the {here} while others rest there": (
            lambda i: i.strikes_beside(end, end),
            "impacts on rests",
        ),
        f"with an impact on the {here} while others rest on the {there}": (
            lambda i: i.strikes_beside(end, -end),
            "impacts on rests",
        ),
    }


ENDS: Final = (BASE, CAP)

SORTS: Final[Mapping[str, Sort]] = {
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
    "where g = 0": (lambda i: i.throw.gravity == 0, "weight"),
    "where there is no drag": (lambda i: i.throw.drag == 0, "drag"),
    "of an odd number of slices": (lambda i: i.throw.n_slices % 2 == 1, "odd"),
    "in which slices rest while there is drag": (lambda i: i.throw.drag > 0 and any(map(i.rests, ENDS)), "rests"),
    **_of_end(BASE),
    **_of_end(CAP),
}
"""What may go on between two outputs, in words, the general before the special, and a key of ``LOOK_AT``."""

LOOK_AT: Final[Mapping[str, str]] = {
    "impacts": "what an impact does",
    "rests": "what holds a slice at rest, and its part in the motion of the others",
    "begin of rests": "when a slice stays on its end instead of rebounding",
    "end of rests": "when a slice at rest is let go",
    "impacts at one instant": "impacts of several slices at one instant",
    "order of impacts in a step": "several impacts close together: each at its own time, the earliest first",
    "weight": "the weight",
    "drag": "the drag, and against what v is measured",
    "odd": "the loop over slices: every slice moves, also the last of an odd number",
    "impacts on rests": "the part of slices at rest in the impact of another",
}
"""By what goes on between two outputs, what to look at."""

FEW: Final = 3
"""Intervals that depart before anything is said: rounding may put one impact before an output or behind it."""

SURE: Final = 0.9
"""Share of the departures that a sort must hold where none holds them all."""


Departing = Generator[Sequence[Ask], Sequence[Answer], tuple[str, str]]


def departing(traits: Traits, equation: str, asks: Sequence[Ask]) -> Departing:
    """Return between which outputs of throws a solver departs from an equation, and by what; nothing if it does not.

    Asks for each throw again, at ``OUTPUTS`` times, at two levels or three if the solver can be refined. Raises
    NotApplicableError if it answers no r or v.
    """
    if traits.refined_by is None:
        intervals = yield from _flown(traits, equation, asks, 0)
        astray = _astray(traits, intervals, None)
        return _told(equation, intervals, astray) if astray.sum() >= FEW else ("", "")
    coarse: list[Interval] = []
    spoiled = ("", "")
    for level in LEVELS:
        try:
            intervals = yield from _flown(traits, equation, asks, level)
        except ForeignError:
            if coarse:  # too slow for so fine steps
                return spoiled
            if level == LEVELS[-1]:
                raise
            continue
        if coarse:
            if came := _passed_over(coarse, intervals):
                words = "the slice goes on as before it: an answer between two steps must know of an impact on its way"
                return came, words
            spoiled = max(spoiled, _spoiled(traits, coarse, intervals))
            astray = _astray(traits, intervals, coarse)
            if astray.sum() < FEW:
                return spoiled
        coarse = intervals
    return _told(equation, intervals, astray)


def _flown(
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
        for interval in carried_on(equation, number, ask, answer)
    ]


def _astray(traits: Traits, fine: Sequence[Interval], coarse: Sequence[Interval] | None) -> BoolArray:
    """Return which intervals depart by more than a step's own error, a faint rest, or a tolerance of event location.

    Intervals of a kind have one error of the step, which falls with refinement. Of a solver that cannot be refined it
    is that of the intervals in which all slices fly, and impacts, which may wait for its next step, are not judged.
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
    astray = np.zeros(len(fine), dtype=bool)
    for kind in set(kinds.tolist()):
        before = [interval.size for interval in coarse if kind_of(interval) == kind]
        size = rms(sizes[kinds == kind])
        if not before or size > FALLS * rms(before):
            astray |= (kinds == kind) & (sizes > np.maximum(floor, 0.03 * size))
    return astray


def _spoiled(traits: Traits, coarse: Sequence[Interval], fine: Sequence[Interval]) -> tuple[str, str]:
    """Return that impacts cost the order which flights have, as ``_told`` does, unless slices only leave an end late.

    To answer an impact at the end of its step is a choice; its error, too, falls no faster than the step.
    """
    lone = [_lone(intervals) for intervals in (coarse, fine)]
    if (traits.order or 0.0) < 2.0 or min(map(len, lone)) < 2 * FEW:
        return "", ""
    long, short = (float(np.median([interval.size for interval in intervals])) for intervals in lone)
    late = np.mean([(i.due["r"] - i.r[1])[i.hits[0][0]] * i.due["v"][i.hits[0][0]] > 0.0 for i in lone[1]])
    if short < SPOILED or long > 6 * short or late > SURE:
        return "", ""
    return (
        f"at impacts that come alone, by {long:.1g} of a field's scale (median of {len(lone[0])}) and by {short:.1g} "
        "at a quarter of the step",
        "steps without an impact have a higher order: look at the instant of the speed with which a slice strikes, "
        "and at the rest of the step after the impact",
    )


def _passed_over(coarse: Sequence[Interval], fine: Sequence[Interval]) -> str:
    """Return how often a slice still moves towards the end that it struck well before, if seldom with short steps."""
    counts = []
    for intervals in (coarse, fine):
        lone = [
            i
            for before, i in pairwise(intervals)
            if len(i.hits) == 1
            and not (before.hits or i.before.any())
            and 0.05 < i.hits[0][2] / i.throw.duration < 0.95
        ]
        counts.append(sum(i.v[1][i.hits[0][0]] * i.due["v"][i.hits[0][0]] < 0.0 for i in lone))
    if counts[0] < FEW or counts[1] > counts[0] / 2:
        return ""
    return f"after {counts[0]} impacts with none shortly before, and after {counts[1]} at a quarter of the step"


def _lone(intervals: Sequence[Interval]) -> list[Interval]:
    """Return the intervals with one impact while no slice rests, and none in the intervals beside them."""
    hits = [len(interval.hits) for interval in intervals]
    return [
        interval
        for k, interval in enumerate(intervals)
        if hits[k] == sum(hits[max(0, k - 1) : k + 2]) == 1 and not (interval.before.any() or interval.after.any())
    ]


def kind_of(interval: Interval) -> str:
    """Return what tells apart intervals whose own errors differ."""
    if interval.hits:
        return "impact"
    if np.any(interval.before != interval.after):
        return "change"
    return "rest" if interval.before.any() else "flight"


def _told(equation: str, intervals: Sequence[Interval], astray: BoolArray) -> tuple[str, str]:
    """Return the sort of the intervals that depart, and by what they do.

    It is the sort that holds all of them and few others; if none does that well, one that holds nearly all.
    """
    wrong = int(astray.sum())
    words, look_at, members = "", "", np.ones(len(intervals), dtype=bool)
    for least in (1.0, SURE):
        best = 2 * wrong / (len(intervals) + wrong)  # as good as all intervals
        for name, (holds, about) in _sorts_of(intervals).items():
            inside = np.array([holds(interval) for interval in intervals])
            both = int(np.sum(inside & astray))
            score = 2 * both / (int(inside.sum()) + wrong)
            if both >= least * wrong and score > best + 0.02:
                best, words, look_at, members = score, name, about, inside
        if words:
            break
    both, count = int(np.sum(members & astray)), int(members.sum())
    others = f", in {wrong - both or 'none'} of the {len(intervals) - count} others" if words else ""
    came = f"in {both} of {count} intervals between two outputs{words and ' ' + words}{others}"
    departed = [interval for interval, departs in zip(intervals, members & astray, strict=True) if departs]
    what = cause_of(departed, recoil=switches_of(equation).recoil)
    if "look at" in what or (what and look_at in ("weight", "drag", "odd")):  # the terms are named
        look_at = ""
    advice = f"look at {LOOK_AT[look_at]}" if look_at else ""
    return came, "; ".join(part for part in (what, advice) if part)


def _sorts_of(intervals: Sequence[Interval]) -> Mapping[str, Sort]:
    """Return the sorts, also one a restitution if there are several."""
    restitutions = sorted({interval.throw.restitution for interval in intervals})
    return {**SORTS, **{f"with an impact at e = {e:.3g}": _impact_at(e) for e in restitutions if len(restitutions) > 1}}


def _impact_at(restitution: float) -> Sort:
    return lambda i: bool(i.hits) and i.throw.restitution == restitution, "impacts"
