"""What became of runs and calls, and studies that may find nothing."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from flipproof.frame.processes import WorkerDiedError
from flipproof.frame.solvers import Missing, Run, RunResult
from slicemodel import Trajectory

T = TypeVar("T")
Key = TypeVar("Key", bound=Hashable)


@dataclass(frozen=True, eq=False)
class Call:
    """A call that a worker makes for a study: a function of a module, and what it is called with.

    ``anew`` says that its answer is of this report alone, and never read from the store.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    label: str = ""
    anew: bool = False


@dataclass(frozen=True, slots=True)
class Outcome(Generic[T]):
    """What was found, or the reason why nothing was."""

    result: T | None
    reason: str = ""

    @property
    def value(self) -> T:
        """What was found; raises Missing with the reason if nothing was."""
        if self.reason or self.result is None:
            raise Missing(self.reason or "nothing was found")
        return self.result


class Flights(dict[Run, RunResult]):
    """What became of runs and calls, by the run or call itself. ``flights[run]`` raises Missing if it was not made."""

    def __init__(self, results: Mapping[Run, RunResult], called: Mapping[Call, Outcome[Any]] | None = None) -> None:
        super().__init__(results)
        self._called = dict(called or {})

    def __missing__(self, run: Run) -> RunResult:
        raise Missing(f"{run.name}: it was not run")

    def answer(self, call: Call) -> Any:
        """Return what a call returned; raises Missing if it failed."""
        return self._called[call].value

    def trajectory(self, run: Run) -> Trajectory | None:
        """Return the trajectory of a run, or None if there is none."""
        return self[run].trajectory if run in self else None

    def trajectories(self, runs: Mapping[Key, Run]) -> dict[Key, Trajectory]:
        """Return the trajectories of those of some runs that have one."""
        return {key: flown for key, run in runs.items() if (flown := self.trajectory(run)) is not None}

    def levels(self, runs: Iterable[Iterable[Run]]) -> list[list[Trajectory]]:
        """Return the flights of levels of runs; raises Missing if one was not made."""
        return [[self[run].flight for run in level] for level in runs]

    def add(self, results: Mapping[Run, RunResult], called: Mapping[Call, Outcome[Any]]) -> None:
        """Add what became of another wave."""
        self.update(results)
        self._called.update(called)


def results_of(outcomes: Mapping[Key, Outcome[T]]) -> dict[Key, T]:
    """Return what was found, without those for whom nothing was."""
    return {key: outcome.result for key, outcome in outcomes.items() if outcome.result is not None}


def attempt(study: Callable[..., T], *arguments: Any) -> Outcome[T]:
    """Return what a study of these arguments found, or the reason why its evidence is missing.

    ``Missing`` alone says that evidence is absent. Every other exception is a mistake in the program and passes.
    """
    try:
        return Outcome(study(*arguments))
    except Missing as why:
        return Outcome(None, str(why))


class ChapterError(RuntimeError):
    """A chapter failed by a mistake of the program, not for want of evidence; the message names chapter and step."""


@contextmanager
def chapter_errors(place: str) -> Iterator[None]:
    """Raise a ChapterError that names the ``place`` for any exception but ``Missing``."""
    try:
        yield
    except (Missing, ChapterError, WorkerDiedError):
        raise
    except Exception as error:
        raise ChapterError(f"{place}: {type(error).__name__}: {error}") from error
