"""What a solver gets wrong on throws that differ from those of the other checks in everything at once.

If a throw is wrong, each knob is turned alone, from the paper's throw or back to it, until one of them separates right
from wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np

from flipproof.foreign.checking import WRAPPED, CheckGenerator, NotApplicableError, Observation, effort_of
from flipproof.foreign.comparison import (
    AT_ONCE,
    FAINT,
    OWN,
    WEAK,
    Comparison,
    ComparisonsGenerator,
    TextGenerator,
    compare,
    comparing,
    confirmed,
)
from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits
from flipproof.foreign.departures import UNEXPLAINED, departing
from flipproof.foreign.place import name_of, placing, switches_of
from flipproof.foreign.throws import (
    FEW_IMPACTS,
    FULL,
    LASTING,
    NARROW,
    PAPER,
    RESTLESS,
    SEED,
    SLOW,
    SMALL,
    STICKY,
    WHOLE,
    Knobs,
    drawn,
    shortened,
)
from flipproof.frame.solvers import solve

UNREFINED: Final = 0.003
"""Own error, fraction of omega_0, granted on ``WHOLE`` to a solver that cannot be refined."""

WORDS: Final[Mapping[str, tuple[str, str]]] = {
    "restitution": ("e = {:.3g}", "take the restitution from the throw, at both ends and also when it is 0 or 1"),
    "slices": ("N = {}", "every slice must move: the ninth, the last of a loop over blocks, and the only one of N = 1"),
    "start": (
        "slices that start {}",
        "begin at ask.start, in the order in which it stands there, which need not be a stack",
    ),
    "times": (
        "output times {}",
        "the flight begins at t = 0; ask.times are answered as they stand, uneven and later than 0",
    ),
    "damping": ("alpha / m = {:.3g} /s", "the drag of a slice is alpha v with alpha of the throw, weak, strong or 0"),
    "gravity": ("g = {:.3g} m/s^2", "take gravity from the throw and scale the weight with it"),
    "theta0": ("theta_0 = {:.3g} rad", "theta begins at theta_0 and is never wrapped; the weight goes with cos(theta)"),
    "omega0": ("omega_0 = {:.3g} rad/s", "the spin is the throw's, fast or slow and in either direction"),
    "angle": ("{:.3g} rad turned", "nothing may depend on how long the flight lasts or how many impacts it has"),
    "filling": ("filling {:.3g}", "water mass and the height of a slice come from the throw"),
    "mass": ("M_b = {:.3g} kg", "take the mass of the bottle from the throw"),
    "length": ("L = {:.3g} m", "take the length of the bottle from the throw, also in its moment of inertia"),
    "radius": ("R = {:.3g} m", "take the radius of the bottle from the throw: I_b = M_b (R^2 / 2 + L^2 / 12)"),
    "capacity": ("M_max = {:.3g} kg", "the height of a slice is water mass / capacity x L / N"),
    "velocity": ("v_0 = {} m/s", "the flight of the centre of mass does not act inside the bottle"),
}
"""Knob -> how it is printed, and what to look at if it separates right from wrong."""


def knob_text(knobs: Knobs, name: str) -> str:
    """Return one knob as text."""
    return WORDS[name][0].format(getattr(knobs, name))


NO_SCALE: Final = "the equation has no scale of its own: look for a constant in "

SIMILAR: Final[Mapping[Knobs, tuple[Knobs, str, str]]] = MappingProxyType(
    {
        SMALL: (
            replace(SMALL, mass=2.7, length=0.24, radius=0.09, capacity=5.4, gravity=60.0),
            "right in a bottle of 0.24 m, wrong in one of 8 mm that moves in proportion",
            f"{NO_SCALE}m, kg, kg/s or m/s, such as a least height, room, mass, drag or speed",
        ),
        SLOW: (
            replace(SLOW, omega0=18.0, gravity=8.0, damping=2.0),
            "right at 18 rad/s, wrong at 0.45 rad/s where everything moves in proportion",
            f"{NO_SCALE}rad/s, m/s, m/s^2, 1/s or s, such as a least spin, speed, weight, drag or a longest flight",
        ),
        NARROW: (
            replace(NARROW, filling=0.5),
            "right in a bottle half full, wrong in one in which water has half a millimetre of room",
            "water moves however little room it has: look for a least room, or for water that is taken for ice",
        ),
    }
)
"""Throws that differ from one of these in its scale or room alone: how wrong is told from right, and the advice."""

MANY: Final = 20
"""Impacts in a tenth of ``LASTING`` of which a third is no chance."""

DENSE: Final = 2000
"""Output times of a throw that is asked once more at many."""


def check_elsewhere(traits: Traits, seed: int = SEED) -> CheckGenerator:
    """Other bottles, fillings, slices, starts, spins and times: every field is that of the equation."""
    long_answer = yield from _long_answer(traits)  # asked at once, to spare answers by files one round
    place = yield from placing(traits)
    equation = traits.equation or place.equation
    if not place.on_lattice or place.equation != name_of(switches_of(equation)):
        raise NotApplicableError("needs an equation that the solver is found to solve")
    unrefined = min(0.01 + 4 * place.distance, 0.018)  # as far off as on the throws that place it, below blurring
    throws = (*drawn(seed), SMALL, SLOW, NARROW)
    flights = list(zip(throws, (yield from comparing(traits, throws, seed, equation, unrefined)), strict=True))
    # Where a solver of low order errs less by luck, it is held to no more than its typical error.
    typical_error = (
        float(np.median([comparison.own_error for knobs, comparison in flights if not knobs.frozen]))
        if traits.refined_by
        else 0.0
    )
    wrong = [
        (knobs, comparison)
        for knobs, comparison in flights
        if comparison.largest_wrong > (0.0 if knobs.frozen else typical_error)
    ]
    wrong = [flight for flight in wrong if not flight[0].frozen] or wrong
    wrong.sort(key=lambda flight: -flight[1].excess)
    while wrong:
        finest = yield from confirmed(traits, *wrong[0], seed, equation, unrefined)
        if finest.wrong:
            break
        wrong = wrong[1:]
    own_error = max((comparison.own_error for _, comparison in flights if not comparison.error), default=0.0)
    facts = {
        "seed": seed,
        "elsewhere": [
            {
                "own": comparison.own_error,
                "largest": comparison.largest,
                "judged": comparison.share,
                "wrong": sorted(comparison.wrong),
            }
            for _, comparison in flights
        ],
    }
    expected = f"{equation} in every field, on {len(flights)} throws of seed {seed}"
    (full,) = yield from comparing(traits, [FULL], seed, equation, unrefined)
    in_turn = bool(full.wrong) and not full.error and switches_of(equation).recoil
    if full.wrong and not in_turn and not wrong:
        wrong = [(FULL, full)]
    if not wrong:
        cut = _where_a_list_ends(long_answer, equation) if long_answer else ""
        if cut:
            return Observation(
                holds=False,
                expected="all impacts listed, to the end of the flight",
                observed=cut,
                where=f"{LASTING.slices} slices, {LASTING.angle:g} rad turned, thrown besides",
                advice="look for a largest number of impacts, in the list or of the flight: neither may have one",
                facts=facts,
            )
        largest = max(comparison.largest for _, comparison in flights)
        blurred = sum(comparison.share < 0.3 for _, comparison in flights)
        weak = own_error > WEAK or blurred > len(flights) // 2
        weak_text = (
            f"its own error, {own_error:.2g} of omega_0, hides mistakes smaller than {OWN * own_error:.2g}"
            if weak
            else ""
        )
        if in_turn:
            weak_text = (
                f"a full bottle with hits on both ends at one instant: {_wrong_text(full)}; in turn, not together?"
            )
        observed = f"at most {largest:.2g} of omega_0 off, its own error {own_error:.2g}"
        return Observation(holds=True, expected=expected, observed=observed, weak=weak_text, facts=facts)
    observed, impacts, advice = yield from bisected(traits, *wrong[0], seed, equation, unrefined)
    if not (wrong[0][0].frozen or wrong[0][1].error or set(wrong[0][1].wrong) == {"v"}):
        with suppress(ForeignError, NotApplicableError):
            departure, cause = yield from departing(traits, equation, [wrong[0][0].ask(seed)])
            if departure:  # more exact than the impact after which the whole flight is first wrong
                together = TOGETHER if wrong[0][0] is FULL else ""
                cause = "" if cause == UNEXPLAINED and "right at " in observed else cause  # the value tells more
                impacts = f"there it departs {departure}; {cause and f'{cause}; '}{together}"
    if traits.refined_by is None and not wrong[0][1].error:
        ask = wrong[0][0].ask(seed)
        times = np.union1d(ask.times, np.linspace(0.0, ask.times[-1], DENSE))
        with suppress(ForeignError):
            (answer,) = yield [replace(ask, times=times)]
            if not compare(traits, replace(ask, times=times), [answer], equation, unrefined).wrong:
                impacts = "right where outputs lie close: look at what goes on within a long step; "
    advice = f"{_shared(wrong, flights)}{impacts}{advice}".removesuffix("; ")
    where = "a full bottle, thrown besides" if wrong[0][0] is FULL else f"{len(wrong)} of {len(flights)} throws"
    return Observation(holds=False, expected=expected, observed=observed, where=where, advice=advice, facts=facts)


def _shared(wrong: Sequence[tuple[Knobs, Comparison]], flights: Sequence[tuple[Knobs, Comparison]]) -> str:
    """Return which value several wrong throws share, and no right one has, if there is one; ice aside."""
    bad = [knobs for knobs, _ in wrong if not knobs.frozen]
    good = [knobs for knobs, comparison in flights if not (knobs.frozen or comparison.wrong)]
    for name in WORDS if len(bad) > 1 else ():
        value = getattr(bad[0], name)
        if all(getattr(knobs, name) == value for knobs in bad) and all(getattr(knobs, name) != value for knobs in good):
            return f"the {len(bad)} wrong throws, and no right one, have {knob_text(bad[0], name)}: {WORDS[name][1]}; "
    return ""


def _long_answer(traits: Traits) -> Generator[Sequence[Ask], Sequence[Answer], Answer | None]:
    """Return the answer to ``LASTING`` at eleven times; None if there is none."""
    ask = LASTING.ask(0)
    times = np.linspace(0.0, ask.scenario.duration, 11)
    try:
        (answer,) = yield [replace(ask, times=times, effort=effort_of(traits, ask.scenario, 0))]
    except ForeignError:  # so many impacts may take it too long
        return None
    return answer


def _where_a_list_ends(answer: Answer, equation: str) -> str:
    """Return from when on a list lacks most of the many impacts of ``LASTING``; empty if it does not, or there is none.

    Such a flight cannot be compared impact by impact, but their number in a tenth of it hardly changes.
    """
    throw = LASTING.ask(0).scenario
    truth = solve(switches_of(equation).name, throw, times=answer.t).impacts
    if answer.impacts is None or truth is None:
        return ""
    fast = FAINT * throw.bottle.length * abs(throw.omega0)
    listed, true = (
        np.histogram(impacts.time[impacts.speed_before > fast], answer.t)[0] for impacts in (answer.impacts, truth)
    )
    lacking = np.flatnonzero((listed < true / 3) & (true >= MANY))
    if not len(lacking):
        return ""
    k = int(lacking[0])
    return (
        f"{len(answer.impacts)} impacts are listed, but {len(truth)} expected: {listed[k]} from t = {answer.t[k]:.3g} "
        f"to {answer.t[k + 1]:.3g} s, about {true[k]} expected"
    )


def bisected(
    traits: Traits, knobs: Knobs, comparison: Comparison, seed: int, equation: str, unrefined: float
) -> Generator[Sequence[Ask], Sequence[Answer], tuple[str, str, str]]:
    """Return a sentence that separates right from wrong by one knob, and what to look at: of impacts, and besides."""
    compare_all: Callable[[Sequence[Knobs]], ComparisonsGenerator] = lambda throws: comparing(  # noqa: E731
        traits, throws, seed, equation, unrefined
    )
    if knobs in SIMILAR:
        similar, text, advice = SIMILAR[knobs]
        (scaled,) = yield from compare_all([similar])
        if not scaled.wrong:
            return f"{text}: {_wrong_text(comparison)}", "", advice
    wrong_text, together = _wrong_text(comparison), TOGETHER if knobs is FULL else ""
    names = [name for name in WORDS if getattr(knobs, name) != getattr(PAPER, name)]
    paper, ice = replace(PAPER, frozen=knobs.frozen), "in ice " if knobs.frozen else ""
    (base,) = yield from compare_all([paper])
    if base.wrong:
        fields = _field_advice(base, ice=knobs.frozen)
        simpler_advice = (
            "" if knobs.frozen or fields else (yield from simpler_throws_advice(traits, equation, unrefined))
        )
        return f"{ice}{_wrong_text(base)} on the paper's throw, too", "", f"{simpler_advice}{fields}"
    single = [shortened(replace(paper, **{name: getattr(knobs, name)}), seed, FEW_IMPACTS) for name in names]
    trials = sorted(zip(names, single, (yield from compare_all(single)), strict=True), key=lambda row: -row[2].excess)
    for name, throw, trial in trials:
        result = (yield from confirmed(traits, throw, trial, seed, equation, unrefined)) if trial.wrong else trial
        if result.wrong:
            fields = _field_advice(result, ice=knobs.frozen)
            smooth = not (knobs.frozen or fields or result.impacts_passed)
            without = (yield from _without_a_force(compare_all, throw, name)) if smooth else ""
            # A slice that never moves is wrong before any impact.
            knob_advice = "" if name == "slices" and result.impacts_passed else WORDS[name][1]
            return (
                f"{ice}right at {knob_text(PAPER, name)}, wrong at {knob_text(knobs, name)}: {_wrong_text(result)}",
                together or ("" if name == "restitution" else _impact_advice(result)),
                fields or without or knob_advice,
            )
    reverted = yield from compare_all([replace(knobs, **{name: getattr(PAPER, name)}) for name in names])
    decisive = [name for name, result in zip(names, reverted, strict=True) if not result.wrong and result.share > 0.3]
    if 0 < len(decisive) <= 4:
        paper_words, throw_words = (
            " or ".join(knob_text(PAPER, name) for name in decisive),
            " and ".join(knob_text(knobs, name) for name in decisive),
        )
        field_advice = _field_advice(comparison, ice=knobs.frozen)
        knobs_advice = "; or ".join(WORDS[name][1] for name in decisive)
        enough = comparison.whole_turns or (field_advice and set(comparison.wrong) == {"impacts"})
        return (
            f"{ice}right at {paper_words}, wrong at {throw_words} where other things are changed, too: {wrong_text}",
            "" if enough else together or _impact_advice(comparison),
            field_advice if enough else f"{knobs_advice}{field_advice and f'; {field_advice}'}",
        )
    return (
        f"{ice}{wrong_text} where {', '.join(knob_text(knobs, name) for name in names)}",
        together or _impact_advice(comparison),
        _field_advice(comparison, ice=knobs.frozen),
    )


def _without_a_force(
    compare_all: Callable[[Sequence[Knobs]], ComparisonsGenerator], throw: Knobs, name: str
) -> TextGenerator:
    """Return that a throw, wrong because of one knob, is right without weight or without drag, if it is."""
    trials = {"drag": replace(throw, damping=0.0), "weight": replace(throw, gravity=0.0)}
    trials = {force: trial for force, trial in trials.items() if trial != throw and name not in ("damping", "gravity")}
    results = yield from compare_all(list(trials.values()))
    right = [force for force, result in zip(trials, results, strict=True) if not result.wrong and result.share > 0.3]
    # Without weight nothing may move that drag could spoil.
    return f"there right without {' and without '.join(right)}: look at {LOOK_AT[right[0]]}" if right else ""


def wrong_on_whole(traits: Traits, equation: str) -> TextGenerator:
    """Return what is wrong on a throw with drag and impacts on both ends, beyond the solver's own error; or empty."""
    (comparison,) = yield from comparing(traits, [WHOLE], 0, equation, UNREFINED)
    if comparison.wrong:
        comparison = yield from confirmed(traits, WHOLE, comparison, 0, equation, UNREFINED)
    return _wrong_text(comparison) if "omega" in comparison.wrong else ""


LOOK_AT: Final[Mapping[str, str]] = {
    "weight": "the weight term, g cos(theta) along the bottle",
    "drag": "the drag, alpha v / m, against what v is measured, and in free flight what it does to the bottle",
    "impacts": "impacts: restitution, recoil, their places, which slices take part",
    "rests": "rests: when a slice begins to rest on base or cap, when it is let go, and its part in the motion "
    "and the impacts of others",
}
"""What to look at if an answer is right without weight, drag, impacts or rests, in the order they are tested."""


HEAVY: Final = 1e4
"""Mass of a bottle that impacts hardly move, though each is answered [kg]."""

RECOIL: Final = (
    "the recoil: the momentum that a slice loses moves the bottle and what rests in it, so that v of all others changes"
)


def right_without(name: str) -> str:
    """Return the advice for an answer that is right without one of ``LOOK_AT``."""
    return f"right {'before the first impact' if name == 'impacts' else f'without {name}'}: look at {LOOK_AT[name]}; "


def simpler_throws_advice(traits: Traits, equation: str, unrefined: float = UNREFINED) -> TextGenerator:
    """Return which of weight, drag, impacts or rests must be left out to be right, if any, and what to look at."""
    for whole in (WHOLE, STICKY):
        (full,) = yield from comparing(traits, [whole], 0, equation, unrefined)
        if full.wrong:
            break
    else:
        return ""
    simpler = {
        "weight": replace(whole, gravity=0.0),
        "drag": replace(whole, damping=0.0),
        "impacts": replace(whole, angle=1.0),
        "rests": RESTLESS,
        "all": replace(whole, gravity=0.0, damping=0.0, angle=1.0),
    }
    comparisons = yield from comparing(traits, list(simpler.values()), 0, equation, unrefined)
    right = {
        name: comparison.largest for name, comparison in zip(simpler, comparisons, strict=True) if not comparison.wrong
    }
    if traits.refined_by is None and right:  # the room is wide: a small error may still be the same one
        right = {name: size for name, size in right.items() if size <= 1e-9 + 100 * min(right.values())}
    onset = f"with all of it first wrong {full.onset}; "
    lumped = [comparison.lumped for comparison in (full, *comparisons) if comparison.lumped]
    if lumped:
        return f"{lumped[0]}; {onset}"
    if {"weight", "impacts"} <= right.keys():
        if "rests" in right:
            return f"right without weight, and without rests: look at {LOOK_AT['rests']}; {onset}"
        if full.impacts_passed:
            return f"right without weight, and through some impacts: look at rests and at {LOOK_AT['impacts']}; {onset}"
        return f"right without weight, and before half a turn: look at {LOOK_AT['weight']}, at every angle; {onset}"
    if {"rests", "impacts"} <= right.keys():
        if not full.impacts_passed:
            (sticking,) = yield from comparing(traits, [replace(whole, restitution=0.0)], 0, equation, unrefined)
            if not sticking.wrong:  # with more rests than any other
                return f"right where e is 0 or 1: look at the speed after an impact, e times that before; {onset}"
        return f"right through impacts as long as no slice rests: look at {LOOK_AT['rests']}; {onset}"
    for name in ("weight", "drag", "impacts"):
        if name in right:
            if name == "impacts" and "impacts" in full.wrong and switches_of(equation).recoil:
                (heavy,) = yield from comparing(traits, [replace(whole, mass=HEAVY)], 0, equation, unrefined)
                if not heavy.wrong:
                    words = f"right before the first impact, and in a bottle of {HEAVY / 1000:g} t"
                    return f"{words}: look at {RECOIL}; {onset}"
            return f"{right_without(name)}{onset}"
    if "all" in right:
        return f"right without weight, drag and impacts together, but wrong if only one of them is removed; {onset}"
    text = "wrong before the first impact without weight and drag, too"
    (centred,) = yield from comparing(traits, [replace(simpler["all"], start="in the middle")], 0, equation, unrefined)
    if not centred.wrong:
        return f"{text}, but right with every slice far from the ends: look at the places of the ends, and at rests; "
    return f"{text}: look at the centrifugal term omega^2 (r - r_cm), the inertia and the masses; "


def _wrong_text(comparison: Comparison) -> str:
    """Return what is wrong, the worst first."""
    if comparison.error:
        return f"no answer ({comparison.error})"
    worst = sorted(
        comparison.wrong, key=lambda name: comparison.wrong[name][0] / comparison.wrong[name][1], reverse=True
    )
    error, room, time = comparison.wrong[worst[0]]
    units = {"omega": "omega_0", "theta": "the angle turned", "inertia": "the largest J", "v": "L omega_0"}
    unit = {**units, "impacts": "the flight"}.get(worst[0], "L")
    further = f", and {', '.join(worst[1:])}" if len(worst) > 1 else ""
    error_text = f"{'are' if worst[0] == 'impacts' else 'is'} {error:.2g} of {unit} off (room {room:.1g})"
    onset = f", first {comparison.onset}" if comparison.onset else ""
    return f"{worst[0]} {error_text} at t = {time:.3g} s{further}{onset}"


TOGETHER: Final = "slices strike both ends at one instant there: each keeps its own speed times -e, none is left out; "
"""What to look at where ``FULL`` alone is wrong."""


def _impact_advice(comparison: Comparison) -> str:
    """Return that impacts are the first suspect, if an answer is right through some of them and wrong later."""
    if AT_ONCE in comparison.onset:
        return "several slices strike at one instant there, and each keeps its own speed times -e; "
    after_impacts = comparison.impacts_passed and not _field_advice(comparison)
    return (
        "right through some impacts: look first at impacts, their number and order (of several in a step the earliest "
        "comes first), and at rests and their ends; "
        if after_impacts
        else ""
    )


def _field_advice(comparison: Comparison, *, ice: bool = False) -> str:
    """Return what to look at by the wrong fields, if omega is right; not for a small error after impacts."""
    if comparison.whole_turns:
        return WRAPPED
    if ice and set(comparison.wrong) == {"v"}:
        return "what is frozen does not move in the bottle: its v is 0 and stays 0"
    if (
        comparison.error
        or "omega" in comparison.wrong
        or (
            comparison.impacts_passed
            and (
                comparison.largest_wrong < FAINT / 4
                # Further off than the flight is long, they are answered wrongly, not made wrongly.
                or (set(comparison.wrong) == {"impacts"} and comparison.largest_wrong < 1.0)
            )
        )
    ):
        return ""
    fields = ", ".join(comparison.wrong)
    if set(comparison.wrong) == {"impacts"}:
        listed = comparison.listed or "look at time, slice, end and number of each"
        return f"the motion is right, the impacts listed are not: {listed}"
    closer = ", and at sign, unit and instant of v" if fields == "v" else ""
    return f"omega is right, {fields} not: look at how the answer is put together{closer}"
