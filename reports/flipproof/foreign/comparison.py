"""How far an answer is from the exact solution of its equation on a throw, beyond the solver's own error.

    abs(answer - reference) <= room(t) = FLOOR + OWN x own error(t) + BAND x band(t)

own error   change of the answer under refinement; it grows with the flight, so its running maximum counts
band        change of the reference with a release that differs by 1e-6 and with another rest speed: no solver's fault

Where the room exceeds ``BLURRED`` nothing is compared.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final

import numpy as np

import ode_reference
from flipproof.foreign.checking import effort_of, rest_speed_of, scales, whole_turns
from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits, started
from flipproof.foreign.place import switches_of
from flipproof.foreign.throws import Knobs
from ode_reference.solver import usual_rest_speed
from ode_reference.switches import Switches
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import BASE, CAP, NO_IMPACTS, FloatArray, Impacts

FLOOR: Final = 1e-4
"""Room of every field, a fraction of its scale (``scales``)."""

OWN: Final = 5.0
BAND: Final = 2.0
BLURRED: Final = 0.1
"""Room of omega, fraction of omega_0, above which a throw tells nothing."""

WEAK: Final = 0.01
"""Own error of omega, fraction of omega_0, above which it hides what the check is looking for."""

STRAY: Final = 0.03
"""Fraction of the values of v that may be off: v jumps at an impact, and an output time may lie close to it."""

LEVELS: Final = ((-1.3, -1.9, -2.6), (1, 0.4, -0.3), (3, 2.4, 1.7))
"""Levels of refinement, finer ones where coarser ones leave an own error that matters, or hide it.

No step is a multiple of another, so that no two share output times by chance.
"""

FINER: Final = tuple(level + 2 for level in LEVELS[-1])
"""Levels at which the errors of a weak solver, or one of order 1, are confirmed: a quarter of the finest steps."""


@lru_cache(maxsize=256)
def _reference_flight(switches: Switches, throw: Scenario, times: bytes, rest_speed: float) -> Trajectory:
    return ode_reference.solve(throw, switches, np.frombuffer(times), rest_speed=rest_speed)


def references(equation: str, ask: Ask) -> list[Trajectory]:
    """Return the exact flight of an equation from the ask's start, and twins in release and in rest speed.

    A solver's rest speed is its own affair: with recoil it may be a fixed one or a fraction of the speeds of the throw.
    """
    switches = switches_of(equation)
    throw, times = started(ask), ask.times.tobytes()
    bottle = replace(throw.bottle, mass=throw.bottle.mass * (1 + 1e-6))
    perturbed = replace(throw, bottle=bottle, omega0=throw.omega0 * (1 + 1e-6))
    fixed, other = rest_speed_of(switches), usual_rest_speed(switches, throw) / 10 if switches.recoil else 1e-3
    return [
        _reference_flight(switches, throw, times, fixed),
        _reference_flight(switches, perturbed, times, fixed),
        _reference_flight(switches, throw, times, other),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What is wrong on one throw: field -> (difference, room, time), fractions of its scale.

    ``own_error`` is the solver's own error of omega where it was compared, ``largest`` the largest difference of omega,
    ``share`` the share of output times that were compared. ``error`` says why there is no answer, ``onset`` after which
    impact it goes wrong, ``impacts_passed`` how many it gets right before, ``listed`` what is wrong with its impacts,
    ``lumped`` which of them share an instant that should not, ``whole_turns`` whether theta is off by whole turns.
    """

    wrong: Mapping[str, tuple[float, float, float]]
    own_error: float = 0.0
    largest: float = 0.0
    share: float = 1.0
    error: str = ""
    onset: str = ""
    impacts_passed: int = 0
    listed: str = ""
    lumped: str = ""
    whole_turns: bool = False

    @property
    def largest_wrong(self) -> float:
        """The largest difference of the wrong fields, 0 if none is wrong."""
        return max((difference for difference, _, _ in self.wrong.values()), default=0.0)

    @property
    def excess(self) -> float:
        """The largest difference over its room."""
        return max((difference / room for difference, room, _ in self.wrong.values()), default=0.0)


def compare(traits: Traits, ask: Ask, answers: Sequence[Answer], equation: str, unrefined: float) -> Comparison:
    """Compare the answer to one throw; ``answers`` holds the finest, then coarser ones if the solver can be refined."""
    truth, *twins = references(equation, ask)
    scale = scales(ask.scenario, truth.inertia)
    reached = min(len(run.t) for run in (truth, *twins))

    def sizes(flight: Any, other: Any, name: str) -> FloatArray:
        difference = np.abs(getattr(flight, name)[:reached] - getattr(other, name)[:reached]) / scale[name]
        return np.asarray(difference)

    def grown(values: FloatArray) -> FloatArray:
        return np.maximum.accumulate(values if values.ndim == 1 else values.max(axis=1))

    finest = answers[0]
    floor = max(FLOOR, 1024 * traits.epsilon)
    names = [name for name in scale if getattr(finest, name) is not None]
    rooms: dict[str, FloatArray] = {}
    own_errors: dict[str, FloatArray] = {}
    for name in names:
        summarize = grown if name != "v" else lambda x: np.full(reached, np.quantile(x, 1 - STRAY))
        own_error = np.max(
            [np.zeros(reached), *(summarize(sizes(finest, coarser, name)) for coarser in answers[1:])], axis=0
        )
        own_errors[name] = own_error if len(answers) > 1 else np.full(reached, unrefined)
        rooms[name] = floor + OWN * own_errors[name] + BAND * sum(summarize(sizes(truth, twin, name)) for twin in twins)
    clear = rooms["omega"] <= BLURRED
    wrong: dict[str, tuple[float, float, float]] = {}
    first_wrong = float(ask.times[-1])
    for name in names:
        errors = sizes(finest, truth, name)[clear]
        room = rooms[name][clear]
        if not errors.size:
            continue
        if name == "v":
            beyond = errors > 10 * room[:, None]
            if np.count_nonzero(beyond) <= max(2, STRAY * errors.size):
                continue
        rows = errors if errors.ndim == 1 else errors.max(axis=1)
        k = int(np.argmax(rows / room))
        if not rows[k] <= room[k]:
            wrong[name] = float(rows[k]), float(room[k]), float(ask.times[k])
            row = int(np.argmax(rows > room))
            first_wrong = min(first_wrong, float(ask.times[:reached][clear][row]))
    impacts_passed, onset = _onset(ask, truth.impacts or NO_IMPACTS, first_wrong) if wrong else (0, "")
    listed = ""
    if finest.impacts is not None and clear.any():
        # Where omega hardly knows of a slice, its impacts depend on the rest speed as its place does.
        band_of_r = BAND * sum(grown(sizes(truth, twin, "r")) for twin in twins)
        room_of_r = rooms.get("r", np.maximum(rooms["omega"], floor + band_of_r))[clear]
        by_rest_speed = [
            _unmatched(ask, finest.impacts, run.impacts or NO_IMPACTS, room_of_r, ask.times[:reached][clear])
            for run in (truth, twins[-1])
        ]
        unmatched = [miss for miss in by_rest_speed if miss is not None]
        if len(unmatched) == len(by_rest_speed):
            wrong["impacts"] = unmatched[0]
            listed = _listed_wrongly(ask, finest.impacts, truth.impacts or NO_IMPACTS)
    return Comparison(
        wrong=wrong,
        own_error=float(np.max(own_errors["omega"][clear])) if clear.any() else float(own_errors["omega"].min()),
        largest=float(np.max(sizes(finest, truth, "omega")[clear], initial=0.0)),
        share=float(np.mean(clear)) * reached / len(ask.times),
        onset=onset,
        impacts_passed=impacts_passed,
        listed=listed,
        lumped=_lumped(finest.impacts, truth.impacts or NO_IMPACTS, first_wrong) if wrong and finest.impacts else "",
        whole_turns="theta" in wrong and whole_turns((finest.theta[:reached] - truth.theta[:reached])[clear], 1e-3),
    )


def _onset(ask: Ask, impacts: Impacts, first_wrong: float) -> tuple[int, str]:
    """Return how many impacts are right before the first wrong time [s], and after which it goes wrong, as a phrase."""
    last_right = np.max(ask.times[ask.times < first_wrong], initial=0.0)
    count = int(np.sum(impacts.time <= last_right))
    between = np.flatnonzero((impacts.time > last_right) & (impacts.time < first_wrong))
    if not between.size:
        return count, f"after {count} impacts that were right" if count else "before the first impact"
    k = int(between[0])
    together = between[np.abs(impacts.time[between] - impacts.time[k]) < 1e-9 * ask.scenario.duration]
    ends = {"base" if end > 0 else "cap" for end in impacts.end[together].tolist()}
    struck = f"slice {impacts.slice[k]} on the {ends.pop()}"
    if len(together) > 1:
        struck = f"slices {', '.join(map(str, impacts.slice[together].tolist()))} {AT_ONCE}"
    so_far = f"{count} impacts that were right, " if count else ""
    return count, f"after {so_far}the impact of {struck} at {impacts.time[k]:.3g} s"


AT_ONCE: Final = "at one instant"


FAINT: Final = 0.02
"""Speed, fraction of L omega_0, below which an impact need not be answered: a slice may rest there."""


def _unmatched(
    ask: Ask, answered: Impacts, truth: Impacts, room_of_r: FloatArray, times: FloatArray
) -> tuple[float, float, float] | None:
    """Return difference, room and time of the impact that most exceeds its room from any in the other list.

    Impacts of one slice on one end are matched by time and number, up to the last of ``times``; a slice that is off by
    ``room_of_r`` is late by that over its speed. Fractions of the flight; None if every impact has its match.
    """
    throw, misses = ask.scenario, []
    faint = FAINT * throw.bottle.length * abs(throw.omega0)
    for listed, counterpart in ((answered, truth), (truth, answered)):
        for k in np.flatnonzero(listed.speed_before > faint):
            time, row = listed.time[k], int(np.searchsorted(times, listed.time[k]))
            if row == len(times):
                continue
            delay = float(room_of_r[row]) * throw.bottle.length / listed.speed_before[k]
            room = FLOOR + delay / throw.duration
            # Faint ones near it need not be answered, either.
            own_distances, distances = (
                np.sort(
                    np.abs(hits.time[(hits.slice == listed.slice[k]) & (hits.end == listed.end[k]) & counted] - time)
                )
                / throw.duration
                for hits, counted in ((listed, listed.speed_before > faint), (counterpart, True))
            )
            count = int(np.sum(own_distances <= room))
            distance = float(distances[count - 1]) if count <= len(distances) else 1.0
            if distance > 2 * room and time + 2 * room * throw.duration < times[-1]:
                misses.append((distance, 2 * room, float(time)))
    return max(misses, key=lambda miss: miss[0] / miss[1], default=None)


LATE: Final = 0.05
"""Fraction of the flight within which an impact of a slice, end and speed answered beside its time is that one."""


def _listed_wrongly(ask: Ask, answered: Impacts, truth: Impacts) -> str:
    """Return which impacts a list lacks, has besides, or gives another slice or end; empty if not clear."""
    throw = ask.scenario
    fast = FAINT * throw.bottle.length * abs(throw.omega0)
    expected = np.flatnonzero((truth.speed_before > fast) & (truth.time < 0.999 * ask.times[-1]))
    near = np.abs(answered.time[:, None] - truth.time) < 1e-3 * throw.duration
    same = {name: getattr(answered, name)[:, None] == getattr(truth, name) for name in ("slice", "end")}
    exact = near & same["slice"] & same["end"]
    odd = ~exact.any(axis=1) & (answered.speed_before > fast)
    lacking = [int(k) for k in expected if not exact[:, k].any()]
    named = {
        name: sum(bool(np.any(near[odd, k] & same[other][odd, k])) for k in lacking)
        for name, other in (("slice", "end"), ("end", "slice"))
    }
    name = max(named, key=lambda field: named[field])
    if named[name]:
        return f"{named[name]} of {len(expected)} name another {name}"
    alike = np.isclose(answered.speed_before[:, None], truth.speed_before, rtol=0.02, atol=0.0)
    apart = answered.time[:, None] - truth.time
    apart = np.where(same["slice"] & same["end"] & alike, apart, np.inf)[:, lacking]
    if apart.size and np.all(np.min(np.abs(apart), axis=0) < LATE * throw.duration):
        shifts = apart[np.argmin(np.abs(apart), axis=0), np.arange(len(lacking))]
        side = "earlier" if np.all(shifts < 0.0) else "later" if np.all(shifts > 0.0) else "earlier or later"
        size = f"{np.max(np.abs(shifts)):.2g} s {side} than they are"
        return f"{len(lacking)} of {len(expected)} are answered up to {size}: answer the instant inside the step"
    if lacking:
        kinds = {
            "on the cap": truth.end == CAP,
            "on the base": truth.end == BASE,
            **{f"of slice {k}": truth.slice == k for k in range(throw.n_slices)},
            "after which a slice rests": truth.speed_after == 0.0,
            "after the first": np.arange(len(truth)) > 0,
        }
        fastest = float(np.max(truth.speed_before[lacking]))
        speed = f"{fastest / fast * FAINT:.2g} omega_0 L"
        if not len(answered):
            return f"none of {len(expected)} is listed, of which the fastest has {speed}"
        kinds[f"not faster than {speed}"] = truth.speed_before <= fastest
        fits = [kind for kind, of_kind in kinds.items() if expected[of_kind[expected]].tolist() == lacking]
        which = fits[0] if fits else f"at {times_text(truth.time[lacking])}"
        return f"{len(lacking)} of {len(expected)} are missing, those {which}"
    if odd.any():
        return f"{np.sum(odd)} are listed where there is none, at {times_text(answered.time[odd])}"
    return f"{len(answered)} are listed, {len(truth)} expected" if len(answered) != len(truth) else ""


def _lumped(answered: Impacts, truth: Impacts, until: float) -> str:
    """Return which impacts, before a time [s], are answered at one instant though they come one after the other.

    Empty if there are none, or if impacts are answered no nearer to their times than these are to each other.
    """
    order = np.argsort(answered.time, kind="stable")
    order = order[answered.time[order] < until]
    apart = np.abs(answered.time[order, None] - truth.time)
    for name in ("slice", "end"):
        apart[getattr(answered, name)[order, None] != getattr(truth, name)] = np.inf
    if len(order) < 2 or not len(truth):
        return ""
    true_times = truth.time[np.argmin(apart, axis=1)]
    at_once = np.diff(answered.time[order]) < 1e-9 * until
    gaps = np.where(at_once, np.abs(np.diff(true_times)), 0.0)
    k = int(np.argmax(gaps))
    if gaps[k] <= max(1e-6 * until, 10 * float(np.median(apart.min(axis=1)))):
        return ""
    first, second = answered.slice[order[k : k + 2]].tolist()
    return (
        f"the impacts of slices {first} and {second}, {gaps[k]:.2g} s apart, are answered at one instant, "
        f"{answered.time[order[k]]:.6g} s: a slice rebounds when it reaches its end, and not before"
    )


def times_text(times: FloatArray) -> str:
    """Return at most three times [s] in words."""
    return f"{', '.join(f'{time:.3g}' for time in times[:3])} s{' ...' if len(times) > 3 else ''}"


ComparisonsGenerator = Generator[Sequence[Ask], Sequence[Answer], list[Comparison]]
TextGenerator = Generator[Sequence[Ask], Sequence[Answer], str]


def comparing(
    traits: Traits,
    throws: Sequence[Knobs],
    seed: int,
    equation: str,
    unrefined: float,
    all_levels: Sequence[Sequence[float]] = LEVELS,
) -> ComparisonsGenerator:
    """Ask for throws, at three levels if the solver can be refined and at finer ones if needed, and compare each.

    For ice the step makes no error: one level is enough.
    """
    asks, comparisons = [knobs.ask(seed) for knobs in throws], {}
    remaining = list(range(len(asks)))
    for levels in all_levels if traits.refined_by else ((0,),):
        asks_by_throw = {
            k: [
                replace(asks[k], effort=effort_of(traits, asks[k].scenario, level))
                for level in (levels[:1] if throws[k].frozen else levels)
            ]
            for k in remaining
        }
        with suppress(ForeignError):
            # All at once, in case somebody writes the answers by hand.
            yield [ask for series in asks_by_throw.values() for ask in series]
        for k, series in asks_by_throw.items():
            try:
                comparisons[k] = compare(
                    traits, asks[k], (yield series), equation, 0.0 if throws[k].frozen else unrefined
                )
            except ForeignError as error:
                comparisons[k] = Comparison(wrong={"answer": (1.0, 1e-3, 0.0)}, error=str(error))
        # What fails at long steps need not fail at short ones.
        remaining = [
            k
            for k in remaining
            if comparisons[k].error
            or OWN * comparisons[k].own_error > FLOOR
            or (throws[k].frozen and comparisons[k].wrong)
        ]
    return [comparisons[k] for k in range(len(asks))]


def confirmed(
    traits: Traits, knobs: Knobs, comparison: Comparison, seed: int, equation: str, unrefined: float
) -> Generator[Sequence[Ask], Sequence[Answer], Comparison]:
    """Return the comparison of a wrong throw at the finest levels.

    A step that something else limits, such as an output time or a longest step, is the same at all coarse levels: its
    error does not show there as a change. Where impacts wait for the grid, or the order is 1, errors fall by leaps, and
    three levels may agree by chance: a solver of order 1, or whose own error is still ``WEAK``, is asked at ``FINER``
    ones, and compared there if it answers.
    """
    if traits.refined_by is None or knobs.frozen or comparison.error:
        return comparison
    (comparison,) = yield from comparing(traits, [knobs], seed, equation, unrefined, LEVELS[-1:])
    if comparison.wrong and (comparison.own_error >= WEAK or (traits.order or math.inf) <= 1.0):
        (finer,) = yield from comparing(traits, [knobs], seed, equation, unrefined, [FINER])
        return comparison if finer.error else finer
    return comparison
