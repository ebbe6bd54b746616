"""Flights that were not made: runs answered from a table, and reports some of whose runs failed."""

from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future
from dataclasses import replace

from flipproof.chapters import chapters_named
from flipproof.chapters.maps.study import read_flight, study_readings
from flipproof.frame.flights import Flights
from flipproof.frame.gather import Gathered, gather
from flipproof.frame.pool import Here, make_each
from flipproof.frame.solvers import Made, Run


class Answers(Executor):
    """Answers runs by ``of``; other calls are made at once, in this process."""

    def __init__(self, of: Callable[[Run], Made]) -> None:
        self.of = of
        self.asked: list[Run] = []

    def submit(self, fn, /, *args, **kwargs) -> Future:
        if fn is not make_each:
            return Here().submit(fn, *args, **kwargs)
        self.asked += args[0]
        return Here().submit(lambda: [self.of(run) for run in args[0]])


def spoiled(gathered: Gathered, broken: Iterable[Run], reason: str, chapters: Iterable[str]) -> Gathered:
    """Return the same report with some runs failed, and the chapters that look at them studied anew."""
    lost = set(broken)
    made = {run: Made(run, None, 0.1, reason) if run in lost else each for run, each in gathered.flights.items()}
    again = gather(chapters_named(*chapters), gathered.ask, Answers(made.__getitem__))
    return replace(gathered, flights=Flights(made), outcomes={**gathered.outcomes, **again.outcomes})


def study_map(throw, axis, fills, values, made, **how):
    """Make a map of runs that were made; the keywords are those of ``plan_map``."""
    readings = {run: read_flight(each) for run, each in made.items()}
    return study_readings(throw, axis, fills, values, readings, **how)
