"""The verb ``solve`` for anybody's solver, with the signature of the three packages', so that a run of it is a run."""

from __future__ import annotations

import atexit
from functools import cache
from typing import Any

from flipproof.foreign.answers import trajectory_of
from flipproof.foreign.checking import effort_of
from flipproof.foreign.content import content_of
from flipproof.foreign.contract import Ask
from flipproof.foreign.specs import ForeignError, Runner, opened
from slicemodel import Scenario, Trajectory
from slicemodel.trajectory import FloatArray, output_times


def solve(
    scenario: Scenario, *, spec: str, times: FloatArray | None = None, effort: float | None = None, **options: Any
) -> Trajectory:
    """Run the solver that a spec names, in a process of its own that serves the next run, too.

    Parameters
    ----------
    scenario : Scenario
    spec : str - see ``flipproof.foreign.specs``
    times : array, optional - output times [s]; 1000 uniform ones by default
    effort : float, optional - the number that the solver's ``refined_by`` names; a thousandth of the flight by default
    options : passed to the solver by name

    Raises
    ------
    ForeignError
        If it gives no answer.
    """
    runner = _runner(spec, content_of(spec))
    given = effort_of(runner.traits, scenario, 0) if effort is None else effort
    ask = Ask.of(scenario, output_times(scenario, times), given, **options)
    try:
        return trajectory_of(ask, runner(ask), runner.traits)
    except ForeignError as error:
        raise type(error)(f"{spec}: {error}") from None


@cache
def _runner(spec: str, content: str) -> Runner:
    """Return the process of a solver; one whose files have changed gets another, so that its old code runs no more."""
    del content
    runner = opened(spec, curves=True)
    atexit.register(runner.close)
    return runner
