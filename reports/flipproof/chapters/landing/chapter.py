"""Does it stand? The study of the landing as a chapter: its waves are calls of workers, many throws to a call."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from itertools import accumulate, groupby
from pathlib import Path
from typing import Final

from flipproof.chapters.landing.claims import claims
from flipproof.chapters.landing.figures import figures
from flipproof.chapters.landing.study import Cases, Found, Size, aiming, counting, read
from flipproof.chapters.landing.tables import page
from flipproof.frame.chapter import Ask, Call, Chapter, Flights, Study
from flipproof.landing.design import Case
from flipproof.landing.upright import make_case
from flipproof.landing.work import Landed


def study(ask: Ask) -> Study[Found]:
    """Solve for the aims, throw about them, and throw about the best of them, a wave each."""
    planned = Call(aiming, (ask.throw, ask.work), "aims of the landing")
    flights = yield [planned]
    aims, unaimed = flights.answer(planned)
    rows = yield from made("aims", aims, ask.work.seed)
    throws = counting(ask.throw, ask.work, aims, rows)
    rows = yield from made("throws", throws, ask.work.seed)
    return read(ask.throw, ask.work, throws, rows, unaimed)


def made(wave: str, cases: Cases, seed: int) -> Generator[list[Call], Flights, list[list[Landed]]]:
    """Ask workers for the throws of some cases, and return their rows, case by case."""
    calls = [Call(make_cases, (some, seed), f"landing, {wave}") for some in chunks(tuple(cases.values()))]
    flights = yield calls
    return [rows for call in calls for rows in flights.answer(call)]


def chunks(cases: Sequence[Case]) -> list[tuple[Case, ...]]:
    """Return the cases in their order, some 300 throws together.

    A call of a few is as soon made again as read from the store, and the laws of one filling, one after the other,
    share their flights.
    """
    starts = accumulate((case.throws for case in cases), initial=0)
    groups = groupby(zip(cases, starts, strict=False), key=lambda pair: pair[1] // 300)
    return [tuple(case for case, _ in some) for _, some in groups]


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
    # Less than a minute of one core.
    work={
        "full": Size(
            families=("B",),
            throws=100,
            aim_throws=20,
            offsets=tuple(math.radians(angle) for angle in (-20, -10, 0, 10, 20)),
            axis_throws=50,
            map_cells=(16, 16),
            engine_throws=0,
        )
    },
)
