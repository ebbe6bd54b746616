"""A chapter: one subject of a report, and what it gives the frame.

    study     asks for runs, is sent what became of them, may ask for more, and returns what it found
    claims    what was found -> findings
    figures   what was found -> figures, each with caption, alternative text and table
    template  what was found -> its part of the page

Evidence is absent in one way only: whatever needs it raises Missing, and the frame says so in the chapter's own place.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

from flipproof.frame.exhibit import Exhibit, Touch
from flipproof.frame.findings import Band, Finding, Kind, observed, regression
from flipproof.frame.flights import Call, Flights, Outcome, attempt, results_of
from flipproof.frame.solvers import REFERENCE, Missing, Run, RunResult
from slicemodel import Scenario

__all__ = [
    "Absent", "Ask", "Band", "Call", "Chapter", "Claims", "Exhibit", "Finding", "Flights", "Kind", "Missing", "Outcome",
    "Part", "Run", "RunResult", "Size", "Study", "Touch", "attempt", "judged", "observed", "regression", "results_of",
]  # fmt: skip
"""All that a chapter is written with."""

F = TypeVar("F")

Size = Literal["check", "quick", "full"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """What a study is asked.

    Parameters
    ----------
    scenario, throw : the throw as given, and the same cut into the slices at which solvers are compared
    reference : the throw of the regression claims, which what is observed on the user's cannot fail
    work : the chapter's own amount of work at this ``size``
    steps : points of a scheme's grid
    solvers : name -> how each solver flies the throw; chapters that look at one flight ask for the same run
    guests : name -> what is known of each of these solvers that is somebody else's (``chapters.solvers.Guest``)
    """

    scenario: Scenario
    throw: Scenario
    size: Size
    work: Any = None
    steps: int = 1000
    reference: Scenario = REFERENCE
    solvers: Mapping[str, Run] = field(default_factory=dict)
    guests: Mapping[str, Any] = field(default_factory=dict)


Study = Generator[Iterable[Run | Call], Flights, F]


@dataclass(frozen=True, slots=True)
class Absent:
    """A claim that cannot be evaluated, and why."""

    id: str
    title: str
    reason: str
    kind: Kind = "regression"

    @property
    def finding(self) -> Finding:
        """The finding that says so; a regression that is not evaluated fails."""
        return Finding(id=self.id, title=self.title, value=None, unit="", kind=self.kind, note=self.reason)


Claims = Iterator[Finding | Absent]


@dataclass(frozen=True, slots=True)
class Chapter(Generic[F]):
    """One subject of a report; its ``name`` is stable and without blanks.

    Parameters
    ----------
    study : generator that yields runs and calls, and returns what was found
    template : file of the chapter's part of the page; None: ``part.html.j2`` beside it, or its figures alone
    work : size of a report -> amount of work that the study is asked for; a size that is missing leaves the chapter out
    ice : whether there is anything to see if nothing moves in the bottle; if not, a report of ice has no such chapter
    kind : what it is if the study cannot be made at all; a regression fails the report
    summary : entries of ``summary.json``
    tables : path in the report folder -> text of a file
    page : what the template is given beside what was found
    """

    name: str
    title: str
    study: Callable[[Ask], Study[F]]
    claims: Callable[[F], Claims] = lambda _: iter(())
    figures: Callable[[F], Iterable[Exhibit]] = lambda _: ()
    _: KW_ONLY
    template: Path | None = None
    work: Mapping[Size, Any] = field(default_factory=lambda: {"quick": None, "full": None})
    ice: bool = True
    kind: Kind = "observation"
    summary: Callable[[F], Mapping[str, Any]] = lambda _: {}
    tables: Callable[[F], Mapping[str, str]] = lambda _: {}
    page: Callable[[F], Mapping[str, Any]] = lambda _: {}


@dataclass(frozen=True, slots=True)
class Part:
    """A section of the page: its anchor, its title, in one sentence what it shows, and the chapters that it holds."""

    id: str
    title: str
    sentence: str
    chapters: tuple[Chapter[Any], ...]


def judged(
    claim: Callable[..., Finding], *arguments: Any, id: str, title: str, kind: Kind = "regression"
) -> Finding | Absent:
    """Return the finding of a claim of these arguments; if its evidence is missing, what says so under the same id.

    Of what was made the claim is given the flight, of an outcome what was found.
    """

    def evaluate() -> Finding:
        evidence = (argument.flight if isinstance(argument, RunResult) else argument for argument in arguments)
        return claim(*(argument.value if isinstance(argument, Outcome) else argument for argument in evidence))

    outcome = attempt(evaluate)
    return outcome.result if outcome.result is not None else Absent(id, title, outcome.reason, kind)
