"""Does it stand? The study of the landing as a chapter: its waves are calls of workers, many throws to a call."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from flipproof.chapters.landing import study as landing
from flipproof.chapters.landing.claims import claims
from flipproof.chapters.landing.figures import figures
from flipproof.chapters.landing.study import PAGE, Found
from flipproof.chapters.landing.tables import page
from flipproof.frame.chapter import Ask, Call, Chapter, Study
from flipproof.landing.design import Case
from flipproof.landing.upright import make_case
from flipproof.landing.work import Landed

CHUNK: Final = 300
"""Throws of a call, at the least: a call of a few is as soon made again as read from the store, and the laws of one
filling, one after the other, share their flights."""


def study(ask: Ask) -> Study[Found]:
    """Solve for the aims, throw about them, and throw about the best of them, a wave each."""
    planned = Call(landing.aiming, (ask.throw, ask.work), "aims of the landing")
    flights = yield [planned]
    steps = landing.study(ask.throw, ask.work, flights.answer(planned))
    wave = next(steps)
    while True:
        calls = [Call(make_cases, (some, ask.work.seed), f"landing, {wave.name}") for some in chunks(wave.cases)]
        flights = yield calls
        try:
            wave = steps.send([rows for call in calls for rows in flights.answer(call)])
        except StopIteration as end:
            found: Found = end.value
            return found


def chunks(cases: Sequence[Case]) -> list[tuple[Case, ...]]:
    """Return the cases in their order, CHUNK throws together or more."""
    some: list[Case] = []
    made: list[tuple[Case, ...]] = []
    for case in cases:
        some.append(case)
        if sum(each.throws for each in some) >= CHUNK:
            made.append(tuple(some))
            some = []
    return [*made, tuple(some)] if some else made


def make_cases(cases: Sequence[Case], seed: int) -> list[list[Landed]]:
    """Make the throws of some cases in this process."""
    return [make_case(case, seed) for case in cases]


CHAPTER: Final = Chapter(
    name="landing",
    title="Does it stand?",
    study=study,
    claims=claims,
    figures=figures,
    template=Path(__file__).with_name("part.html.j2"),
    page=page,
    work={"full": PAGE},
)
