"""Does it stand? The study of the landing as a chapter: its waves are calls of workers, many throws to a call."""

from __future__ import annotations

import itertools
import math
from collections.abc import Generator, Iterator, Sequence
from itertools import accumulate, groupby
from typing import Final

from flipproof.chapters.landing.figures import figures, page
from flipproof.chapters.landing.study import (
    KINDS,
    OPTIMAL,
    WATER,
    Cases,
    Cell,
    LandingStudy,
    Size,
    aiming,
    counting,
    filled,
    read,
)
from flipproof.chapters.landing.throws import FAMILIES, Case, make_cases
from flipproof.chapters.landing.work import Landed
from flipproof.frame.chapter import Ask, Call, Chapter, Flights, Study
from flipproof.frame.findings import Band, Finding, observed, regression
from flipproof.frame.solvers import REFERENCE, Missing
from ode_reference.landing.flight import FLIGHT_DT
from ode_reference.landing.land import followed
from slicemodel.scenario import ScenarioError

MAX_SHORTER: Final = 5.0
"""Times that drag may shorten the steps of the study of a report, which takes a third of it."""


def study(ask: Ask) -> Study[LandingStudy]:
    """Solve for the aims, throw about them, and throw about the best of them, a wave each.

    Raises Missing where drag makes the steps ``MAX_SHORTER`` times shorter, and the report as much longer.
    """
    water = filled(ask.throw, max(ask.work.fillings), ask.work.slices, frozen=False)
    try:
        shorter = FLIGHT_DT / followed(water, FLIGHT_DT)
    except ScenarioError as error:
        raise Missing(str(error)) from None
    if shorter > MAX_SHORTER:
        raise Missing(
            f"drag stops the water so fast that every step is {shorter:.0f} times shorter than usual: "
            "'flipproof upright' makes the study, however long it takes"
        )
    planned = Call(aiming, (ask.throw, ask.work), "aims of the landing")
    flights = yield [planned]
    aims, unaimed = flights.answer(planned)
    rows = yield from throw_cases("aims", aims, ask.work.seed)
    throws = counting(ask.throw, ask.work, aims, rows)
    rows = yield from throw_cases("throws", throws, ask.work.seed)
    return read(ask.throw, ask.work, throws, rows, unaimed)


def throw_cases(wave: str, cases: Cases, seed: int) -> Generator[list[Call], Flights, list[list[Landed]]]:
    """Ask workers for the throws of some cases, and return their rows, case by case."""
    calls = [Call(make_cases, (chunk, seed), f"landing, {wave}") for chunk in chunks(tuple(cases.values()))]
    flights = yield calls
    return [rows for call in calls for rows in flights.answer(call)]


def chunks(cases: Sequence[Case]) -> list[tuple[Case, ...]]:
    """Return the cases in their order, some 300 throws together.

    A call of a few is as soon made again as read from the store, and the laws of one filling, one after the other,
    share their flights.
    """
    starts = accumulate((case.throws for case in cases), initial=0)
    groups = groupby(zip(cases, starts, strict=False), key=lambda pair: pair[1] // 300)
    return [tuple(case for case, _ in group) for _, group in groups]


def claims(results: LandingStudy) -> Iterator[Finding]:
    """Yield every finding of the subject."""
    yield from _water_and_ice(results)
    yield _best_filling(results)
    yield from _static(results)
    yield _bounces(results)
    yield _model_uncertainty(results)
    yield _undecided(results)


def _water_and_ice(results: LandingStudy) -> Iterator[Finding]:
    """Yield P(water) - P(ice) for every filling, as far as both were thrown."""
    for filling, _ in results.along("filling", WATER[0]):
        ice = results.cell("ice", filling)
        if ice is None:
            continue
        by_law = {KINDS[kind].words: cell.minus(ice) for kind in WATER if (cell := results.cell(kind, filling))}
        if min(low for _, low, _ in by_law.values()) > 0:
            verdict = "by both laws water stands more often"
        elif max(high for *_, high in by_law.values()) < 0:
            verdict = "by both laws ice stands more often"
        elif straddling := [law for law, (_, low, high) in by_law.items() if low <= 0 <= high]:
            verdict = f"undecided by {' and by '.join(straddling)}"
        else:
            verdict = "the laws contradict one another"
        laws = "; ".join(f"{law}, {d:+.3f} ({low:+.3f} to {high:+.3f})" for law, (d, low, high) in by_law.items())
        title = f"P(upright), water minus ice, at filling {filling:g} (abstract, section 3: redistribution helps)"
        note = f"{verdict}; with 95 % intervals: {laws}; the number is of the first; {results.assumed}"
        difference, low, high = by_law[KINDS[WATER[0]].words]
        band = Band((high - low) / 2, "sample")
        yield observed(f"landing-water-minus-ice-{filling:g}", title, difference, "", note, band=band)


def _best_filling(results: LandingStudy) -> Finding:
    """Return where P(water) is largest: the paper's optimum is 0.2 to 0.5 (section 5)."""
    curve = results.along("filling", "together")
    inside = [pair for pair in curve if OPTIMAL[0] <= pair[0] <= OPTIMAL[1]]
    outside = [pair for pair in curve if pair not in inside]
    name, title = "landing-best-filling", "Filling at which water stands most often (section 5: 0.2 to 0.5)"
    if not inside or not outside:
        return observed(name, title, None, note="no filling on one side")

    def share(pair: tuple[float, Cell]) -> float:
        return pair[1].share.value

    best, rival = max(inside, key=share), max(outside, key=share)
    difference, low, high = best[1].minus(rival[1])
    note = (
        f"best inside: {best[0]:g} with {share(best):.3f}, outside: {rival[0]:g} with {share(rival):.3f}; "
        f"difference {difference:+.3f}, {_interval(low, high, ('decided', 'decided', 'not decided'))}; the interval is "
        f"valid for fillings fixed beforehand, but these two were chosen from the same throws; {results.assumed}"
    )
    return observed(name, title, max(curve, key=share)[0], note=note)


def _static(results: LandingStudy) -> Iterator[Finding]:
    """Yield how often the static criterion says the outcome rightly (section 6, Eq. 13a)."""
    title = "Share of throws whose outcome the toppling angle at the touch predicts correctly: "
    for (family, kind), (below, above) in results.static.items():
        if throws := below.throws + above.throws:
            id_ = f"landing-static-{family}-{kind.replace(', ', '-')}"
            words = f"{title}{KINDS[kind].words}, {FAMILIES[family]}"
            note = f"of those with a tilt below it {below.upright} of {below.throws} stand, of those above it "
            note += f"{above.upright} of {above.throws}; {results.assumed}"
            yield observed(id_, words, (below.upright + above.throws - above.upright) / throws, note=note)


def _bounces(results: LandingStudy) -> Finding:
    """Return whether falling water dampens the bounce (section 6)."""
    name, filling = "landing-bounces", results.size.axis_filling
    title = f"Bounces of ice minus bounces of water at filling {filling:g} (section 6: falling water dampens them)"
    water, ice = results.cell("together", filling), results.cell("ice", filling)
    if water is None or ice is None:
        return observed(name, title, None, note="water or ice was not thrown at this filling")
    difference, band = ice.bounces - water.bounces, math.hypot(ice.bounces_band, water.bounces_band)
    words = _interval(difference - band, difference + band, digits=2)
    note = f"until the outcome is certain; ice {ice.bounces:.2f}, water {water.bounces:.2f}; {words}; {results.assumed}"
    return observed(name, title, difference, "bounces", note, band=Band(band, "sample"))


def _model_uncertainty(results: LandingStudy) -> Finding:
    """Return how far the laws of the impact are apart: a band of the model, not of the sample."""
    name, title = "landing-laws", "Largest distance in P(upright) between two laws of the impact, water"
    pairs = [
        (cell.minus(second_cell), f"at filling {filling:g}, {KINDS[first].words} minus {KINDS[second].words}")
        for filling in results.size.fillings
        for first, second in itertools.permutations(WATER, 2)
        if (cell := results.cell(first, filling)) and (second_cell := results.cell(second, filling))
    ]
    if not pairs:
        return observed(name, title, None, note="one law only")
    (widest, low, high), where = max(pairs)
    note = (
        f"{where}; 95 % interval of this pair alone {low:+.3f} to {high:+.3f}; the laws are models of one impact and "
        f"are not averaged; both are thrown about the aims that {KINDS['together'].words}, chose; {results.assumed}"
    )
    return observed(name, title, widest, note=note, band=Band((high - low) / 2, "sample"))


def _undecided(results: LandingStudy) -> Finding:
    """Return how many landings of the reference could not be certified; a regression of the paper's throw alone."""
    name, title = "landing-undecided", "Share of landings of the reference that no certificate decides"
    unknown, throws = results.undecided
    if not throws:
        return observed(name, title, None, note="nothing was thrown")
    note = f"{unknown} of {throws}; every interval allows them to be upright or not"
    if results.throw.with_slices(REFERENCE.n_slices) != REFERENCE:
        return observed(name, title, unknown / throws, note=note)
    return regression(name, title, unknown / throws, "", (0.0, 0.01), note)


def _interval(
    low: float, high: float, words: Sequence[str] = ("holds", "fails", "cannot be decided"), digits: int = 3
) -> str:
    """Return an interval, and the first of the words if it lies above 0, the second if below, the third if neither."""
    verdict = words[0] if low > 0 else words[1] if high < 0 else words[2]
    return f"95 % interval {low:+.{digits}f} to {high:+.{digits}f}: {verdict}"


CHAPTER: Final = Chapter(
    name="landing",
    title="Does it stand?",
    study=study,
    claims=claims,
    figures=figures,
    page=page,
    # About a minute of one core.
    work={
        "full": Size(
            families=("B",),
            throws=100,
            aim_throws=40,
            offsets=tuple(math.radians(angle) for angle in (-20, -10, 0, 10, 20)),
            axis_throws=50,
            map_cells=(16, 16),
        )
    },
)
