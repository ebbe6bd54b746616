"""Events: the impacts of two flights side by side, and one curve in the tube around the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from flipproof.chapters.alignment.figure import figure_gantt
from flipproof.chapters.alignment.found import Alignment, Keyed, Rests, end_name
from flipproof.chapters.alignment.study import study_alignment
from flipproof.chapters.alignment.tube import Tube, study_tube
from flipproof.frame.chapter import Absent, Ask, Chapter, Claims, Exhibit, Finding, Outcome, Study, attempt, judged
from flipproof.output.columns import rows_csv

PAIRS: Final = (("eq8", "midpoint"), ("eq8", "free-flight"))
"""Pairs whose impact sequences are aligned: two ways to the same equation, and two equations."""

TUBE_TIME: Final = 2e-3
TUBE_SHARE: Final = 0.01
"""Half-widths of the tube in which two trajectories are compared: seconds, and share of omega_0."""


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
    """Align the impacts of the pairs."""
    flights = yield [ask.solvers[name] for pair in PAIRS for name in pair]
    dy = TUBE_SHARE * abs(ask.throw.omega0)

    def both(pair: tuple[str, str]) -> Any:
        return (flights[ask.solvers[name]].flight for name in pair)

    return Events(
        {pair: attempt(lambda pair: study_alignment(*both(pair)), pair) for pair in PAIRS},
        {pair: attempt(lambda pair: study_tube(*both(pair), dt=TUBE_TIME, dy=dy), pair) for pair in PAIRS},
    )


def claims(found: Events) -> Claims:
    """Yield the share of the time that each second curve spends in the tube around the first."""
    for (first, second), tube in found.tubes.items():
        title = f"tube of {first} and {second}"
        yield judged(claim_tube, first, second, tube, id=f"tube-{first}-{second}", title=title, kind="observation")
    for (first, second), each in found.alignments.items():
        if each.found is None:
            title = f"alignment of {first} and {second}"
            yield Absent(f"alignment-{first}-{second}", title, each.reason, "observation")


def claim_tube(first: str, second: str, tube: Tube) -> Finding:
    """The share of the time that one curve spends in the tolerance tube around another: early is no failure."""
    return Finding(
        id=f"tube-{first}-{second}",
        title=f"{second} in the tube around {first}: share of the time",
        value=tube.share,
        unit="",
        kind="observation",
        note=tube.words,
    )


def figures(found: Events) -> Iterator[Exhibit]:
    """Yield contacts and impacts of every pair."""
    for (first, second), alignment in found.aligned:
        yield Exhibit(
            name=f"gantt-{first}-{second}",
            title=f"Contacts and impacts: {first} and {second}",
            caption=(
                "One row per slice. Bars are contacts, triangles are impacts; the upper lane of a row is the first "
                "solver, the lower the second. Where the two lanes of a row look alike, both solvers have the same "
                "contacts and impacts of that slice. At a fork the slice strikes one end in the first flight and the "
                "other end in the second."
            ),
            alt=f"Contacts and impacts of {first} above those of {second}, one row per slice. "
            f"{alignment.words}.".replace("ω₀", "omega_0"),
            maker=figure_gantt,
            data=(alignment,),
            table=table(alignment),
        )


def table(alignment: Alignment) -> str:
    """Return every contact and impact of the two runs, with what became of each impact."""
    return rows_csv(
        ("run", "what", "slice [1]", "end", "impact number of its slice there [1]", "from [s]", "to [s]"),
        (*_contacts(alignment), *_impacts(alignment)),
    )


def _contacts(alignment: Alignment) -> Iterator[tuple[Any, ...]]:
    for name, rests in zip((alignment.first, alignment.second), alignment.rests, strict=True):
        yield from _rests(name, rests)


def _rests(name: str, rests: Rests) -> Iterator[tuple[Any, ...]]:
    for i, end, start, stop in zip(rests.slice, rests.end, rests.start, rests.stop, strict=True):
        yield name, "contact", i, end_name(int(end)), None, start, stop


def _impacts(alignment: Alignment) -> Iterator[tuple[Any, ...]]:
    """Yield impacts; of a matched one the time in the first and in the second run."""
    first, second, matched = alignment.first, alignment.second, alignment.matched
    kinds = np.where(alignment.shifted, "impact in both, shifted", "impact in both")
    for k, kind in enumerate(kinds):
        ends = (matched.slice[k], end_name(int(matched.end[k])), matched.k[k])
        yield f"{first}; {second}", str(kind), *ends, matched.time[k], matched.time[k] + alignment.shift[k]
    yield from _lone(first, f"impact missing in {second}", alignment.missing)
    yield from _lone(second, f"impact missing in {first}", alignment.extra)
    for name, after in zip((first, second), alignment.after_fork, strict=True):
        yield from _lone(name, "impact after a fork", after)


def _lone(name: str, what: str, impacts: Keyed) -> Iterator[tuple[Any, ...]]:
    for time, i, end, k in zip(impacts.time, impacts.slice, impacts.end, impacts.k, strict=True):
        yield name, what, i, end_name(int(end)), k, time, time


CHAPTER: Final = Chapter(
    name="alignment",
    title="Contacts and impacts side by side",
    study=study,
    claims=claims,
    figures=figures,
    template=Path(__file__).with_name("part.html.j2"),
)
