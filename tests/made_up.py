"""Flights that were not made: trajectories as told, runs answered from a table, reports some of whose runs failed."""

import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path

import numpy as np

import ode_reference
from flipproof.chapters import chapters_named
from flipproof.chapters.maps.study import read_flight, study_readings
from flipproof.cli import main as cli
from flipproof.figures.style import Drawing
from flipproof.foreign.contract import started
from flipproof.frame.flights import Flights
from flipproof.frame.gather import Gathered, evaluate, gather
from flipproof.frame.pool import SerialExecutor, make_each
from flipproof.frame.provenance import provenance
from flipproof.frame.solvers import Run, RunResult
from flipproof.output.summary import summarise
from flipproof.page.render import render
from flipproof.page.verdict import verdict
from slicemodel import Scenario, Trajectory

PART_MACROS = (
    "{% macro draw(figures) %}{% endmacro %}"
    "{% macro anchor(id, words) %}<a href='#{{ id }}'>{{ words }}</a>{% endmacro %}"
    "{% macro scroll(words) %}<div>{{ caller() }}</div>{% endmacro %}"
)
"""What a chapter's part of the page asks of its page, so that it can be read alone."""


def trajectory_of(scenario: Scenario, t=None, *, keeps_slices=False, **told) -> Trajectory:
    """Return a trajectory that is as told and else constant; ``t`` is an array, or a number of points over the throw.

    Without ``r`` it keeps no slices, unless asked to: then all lie 0.1 m from the cap.
    """
    if t is None or isinstance(t, int):
        t = np.linspace(0.0, scenario.duration, t or 101)
    fields = {"solver": "made-up", "method": "made-up"} | told
    for name, value in {"theta": 0.0, "omega": scenario.omega0, "r_cm": 0.1, "inertia": 1.0}.items():
        fields[name] = np.broadcast_to(np.asarray(fields.get(name, value), dtype=float), np.shape(t))
    r = fields.setdefault("r", np.full((len(t) if keeps_slices else 0, scenario.n_slices), 0.1))
    fields.setdefault("v", np.zeros_like(r))
    return Trajectory(scenario=scenario, t=t, **fields)


def flat(run: Run, level: float, **told) -> RunResult:
    """Return a run whose omega jumps from omega_0 to a level at once, at the times or steps that it was asked for."""
    t = run.settings.get("times", run.settings.get("steps", 201))
    return RunResult(run, trajectory_of(run.scenario, t, omega=level * run.scenario.omega0, **told), 0.0)


def command(capsys, *arguments):
    """Run the command line in this process; return its status, what it printed and what it said of errors."""
    try:
        status = cli.main([str(argument) for argument in arguments])
    except SystemExit as end:
        status = end.code
    printed, said = capsys.readouterr()
    return status, printed, said


def action(*arguments):
    """Run a command as the command line does, but let its exceptions through."""
    options = cli.parse([str(argument) for argument in arguments])
    return options.action(options)


def refused(capsys, words, *arguments):
    """Give the command line what it must refuse: status 2, nothing printed, and one line of error with these words."""
    status, printed, said = command(capsys, *arguments)
    assert (status, printed, said.count("\n")) == (2, "", 1)
    assert "error: " in said
    for each in [words] if isinstance(words, str) else words:
        assert each in said


def wait_for(condition):
    """Wait until a condition holds, for five minutes at most."""
    until = time.monotonic() + 300.0
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.05)


def alive(pid):
    """Whether a process lives, by /proc."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def is_number(cell):
    """Whether a cell of a table holds a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


class Exact:
    """The reference as somebody's solver; a subclass throws another scenario than is asked, or spoils the answer."""

    equation = "eq8"
    refined_by = "dt"

    def thrown(self, throw):
        return throw

    def spoilt(self, _throw, answer):
        return answer

    def solve(self, ask):
        throw = started(ask)
        flight = ode_reference.solve(self.thrown(throw), self.equation, ask.times)
        names = ("t", "theta", "omega", "r", "v", "r_cm", "inertia")
        return self.spoilt(throw, {name: getattr(flight, name).copy() for name in names})


class LastComesFirst(Executor):
    """Answers every call at once but the first, which is answered when the others are."""

    def __init__(self, call=lambda function, *arguments: function(*arguments)) -> None:
        self.call, self.asked = call, 0

    def submit(self, *asked) -> Future:
        answer = Future()

        def make():
            answer.set_result(self.call(*asked))

        self.asked += 1
        if self.asked == 1:
            threading.Timer(0.5, make).start()
        else:
            make()
        return answer


class Answers(Executor):
    """Answers runs by ``of``; other calls are made at once, in this process."""

    def __init__(self, of: Callable[[Run], RunResult]) -> None:
        self.of = of
        self.asked: list[Run] = []

    def submit(self, fn, /, *args, **kwargs) -> Future:
        if fn is not make_each:
            return SerialExecutor().submit(fn, *args, **kwargs)
        self.asked += args[0]
        return SerialExecutor().submit(lambda: [self.of(run) for run in args[0]])


def spoiled(gathered: Gathered, broken: Iterable[Run], reason: str, chapters: Iterable[str]) -> Gathered:
    """Return the same report with some runs failed, and the chapters that look at them studied anew."""
    lost = set(broken)
    made = {run: RunResult(run, None, 0.1, reason) if run in lost else each for run, each in gathered.flights.items()}
    again = gather(chapters_named(*chapters), gathered.ask, Answers(made.__getitem__))
    return replace(gathered, flights=Flights(made), outcomes={**gathered.outcomes, **again.outcomes})


def page_of(gathered: Gathered, picture: Drawing) -> dict[str, str]:
    """Return the pages of a report with one picture in the place of every figure: to draw them takes longer."""
    told = {
        name: replace(each, figures=tuple(replace(figure, drawn=picture) for figure in each.figures))
        for name, each in evaluate(gathered).items()
    }
    made_by = provenance("flipproof report")
    return render(gathered, told, made_by, summarise(gathered, told, made_by, verdict(gathered)))


def study_map(throw, axis, fills, values, made, **how):
    """Make a map of runs that were made; the keywords are those of ``plan_map``."""
    readings = {run: read_flight(each) for run, each in made.items()}
    return study_readings(throw, axis, fills, values, readings, **how)
