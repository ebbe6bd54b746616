"""Events: the impacts of two flights side by side, and one curve in the tube around the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from flipproof.chapters.alignment.figure import figure_gantt
from flipproof.chapters.alignment.found import Alignment, end_name
from flipproof.chapters.alignment.study import study_alignment
from flipproof.chapters.alignment.tube import Tube, study_tube
from flipproof.frame.chapter import Absent, Ask, Chapter, Claims, Exhibit, Outcome, Study, attempt, observed
from flipproof.output.columns import rows_csv

PAIRS: Final = (("eq8", "midpoint"), ("eq8", "free-flight"))
"""Pairs whose impact sequences are aligned: two ways to the same equation, and two equations."""


@dataclass(frozen=True, slots=True)
class Events:
    """Every pair aligned, and in its tube."""

    alignments: Mapping[tuple[str, str], Outcome[Alignment]]
    tubes: Mapping[tuple[str, str], Outcome[Tube]]

    @property
    def aligned(self) -> list[tuple[tuple[str, str], Alignment]]:
        """The pairs that could be aligned."""
        return [(pair, each.found) for pair, each in self.alignments.items() if each.found is not None]


def study(ask: Ask) -> Study[Events]:
    """Align the impacts of the pairs, and hold their omega in tubes of 2 ms and a hundredth of omega_0."""
    flights = yield [ask.solvers[name] for pair in PAIRS for name in pair]
    dy = 0.01 * abs(ask.throw.omega0)

    def both(pair: tuple[str, str]) -> Any:
        return (flights[ask.solvers[name]].flight for name in pair)

    return Events(
        {pair: attempt(lambda pair: study_alignment(*both(pair)), pair) for pair in PAIRS},
        {pair: attempt(lambda pair: study_tube(*both(pair), dt=2e-3, dy=dy), pair) for pair in PAIRS},
    )


def claims(found: Events) -> Claims:
    """Yield the share of the time that each second curve spends in the tube around the first: early is no failure."""
    for (first, second), tube in found.tubes.items():
        if tube.found is None:
            yield Absent(f"tube-{first}-{second}", f"tube of {first} and {second}", tube.reason, "observation")
        else:
            title = f"{second} in the tube around {first}: share of the time"
            yield observed(f"tube-{first}-{second}", title, tube.found.share, "", tube.found.words)
    for (first, second), each in found.alignments.items():
        if each.found is None:
            title = f"alignment of {first} and {second}"
            yield Absent(f"alignment-{first}-{second}", title, each.reason, "observation")


def figures(found: Events) -> Iterator[Exhibit]:
    """Yield contacts and impacts of every pair."""
    for (first, second), alignment in found.aligned:
        yield Exhibit(
            name=f"gantt-{first}-{second}",
            title=f"Contacts and impacts: {first} and {second}",
            caption="One row per slice. Bars are contacts, triangles are impacts; the upper lane of a row is the first "
            "solver, the lower the second. Where the two lanes of a row look alike, both solvers have the same "
            "contacts and impacts of that slice. At a fork the slice strikes one end in the first flight and the "
            "other end in the second.",
            alt=f"Contacts and impacts of {first} above those of {second}, one row per slice. "
            f"{alignment.words}.".replace("ω₀", "omega_0"),
            maker=figure_gantt,
            data=(alignment,),
            table=rows_csv(
                ("run", "what", "slice [1]", "end", "impact number of its slice there [1]", "from [s]", "to [s]"),
                _rows(alignment),
            ),
        )


def _rows(alignment: Alignment) -> Iterator[tuple[Any, ...]]:
    """Yield every contact and impact of the two runs; of a matched impact the time in the first and in the second."""
    first, second = both = alignment.first, alignment.second
    for name, rests in zip(both, alignment.rests, strict=True):
        for i, end, start, stop in rests:
            yield name, "contact", i, end_name(end), None, start, stop
    kinds = np.where(alignment.shifted, "impact in both, shifted", "impact in both")
    for hit, kind, shift in zip(alignment.matched, kinds, alignment.shift, strict=True):
        yield f"{first}; {second}", str(kind), hit.slice, end_name(hit.end), hit.k, hit.time, hit.time + shift
    for name, what, impacts in (
        (first, f"impact missing in {second}", alignment.missing),
        (second, f"impact missing in {first}", alignment.extra),
        *((name, "impact after a fork", after) for name, after in zip(both, alignment.after_fork, strict=True)),
    ):
        for hit in impacts:
            yield name, what, hit.slice, end_name(hit.end), hit.k, hit.time, hit.time


CHAPTER: Final = Chapter(
    name="alignment",
    title="Contacts and impacts side by side",
    study=study,
    claims=claims,
    figures=figures,
    template=Path(__file__).with_name("part.html.j2"),
)
