"""What a check is: a generator that yields asks, is sent the answers, and returns what it found.

Checks are written this way so that whoever drives them decides where the answers come from: a solver that is asked one
ask after the other (``certify``), or a folder of answers that somebody made elsewhere (``files.Folder``).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeVar

import numpy as np

from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits, WaitingError
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

THROW: Final = replace(Scenario(), duration=0.3).with_slices(4)
"""The throw of most checks: the paper's own, cut into four slices; eight impacts and more in 0.3 s."""

SMOOTH: Final = replace(THROW, duration=0.05)
"""The same up to before any equation of the ladder has its first impact."""

CALM: Final[Mapping[str, Scenario]] = {"weight": replace(SMOOTH, gravity=0.0), "drag": replace(SMOOTH, drag=0.0)}
"""The same without one of what acts before an impact."""


class NotApplicableError(Exception):
    """A check cannot be made of this solver; the message says what is missing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a check found.

    ``expected`` and ``came`` are phrases with numbers, ``where`` names throw and time, ``advice`` says what to do if
    the check failed; ``weak`` says what the check could not see although it holds; ``facts`` goes into the passport.
    """

    holds: bool
    expected: str
    came: str
    where: str = ""
    advice: str = ""
    weak: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)


Result = TypeVar("Result")
Making = Generator[Sequence[Ask], Sequence[Answer], Found]
Check = Callable[[Traits], Making]


def times_of(scenario: Scenario, points: int = 61) -> FloatArray:
    """Return uniform times over the flight [s]; a step of the published program divides the distance of 61 of them."""
    return np.linspace(0.0, scenario.duration, points)


def ask_of(traits: Traits, scenario: Scenario, level: float = 0, points: int = 61) -> Ask:
    """Return the ask for a throw at a level of refinement; level 0 is a thousandth of the flight, or rtol 1e-6."""
    return Ask.of(scenario, times_of(scenario, points), effort_of(traits, scenario, level))


def effort_of(traits: Traits, scenario: Scenario, level: float) -> float | None:
    """Return the effort of a level: dt halved or steps doubled a level, rtol a tenth."""
    if traits.refined_by == "dt":
        return scenario.duration / 960.0 / float(2.0**level)
    if traits.refined_by == "steps":
        return float(round(960 * float(2.0**level)))
    if traits.refined_by == "rtol":
        return max(1e-13, 1e-6 / float(10.0**level))
    return None


def shift(one: Answer, other: Answer, scale: float) -> float:
    """Return the largest difference of two curves omega(t), as a fraction of ``scale``."""
    return float(np.max(np.abs(one.omega - other.omega)) / abs(scale))


def when(times: FloatArray, values: FloatArray) -> str:
    """Return at which time the largest of ``values`` lies, as a phrase."""
    return f"t = {times[int(np.argmax(values))]:.4g} s"


def drive(making: Generator[Sequence[Ask], Sequence[Answer], Result], runner: Callable[[Ask], Answer]) -> Result:
    """Drive a generator of asks to its end, asking ``runner`` whatever it yields, and return what it found."""
    try:
        asks = next(making)
        while True:
            try:
                answers = _answers(asks, runner)
            except WaitingError:
                raise
            except ForeignError as error:
                asks = making.throw(error)
                continue
            asks = making.send(answers)
    except StopIteration as end:
        result: Result = end.value
        return result


def _answers(asks: Sequence[Ask], runner: Callable[[Ask], Answer]) -> list[Answer]:
    """Return an answer to each ask; where answers are written by hand, all asks are put before any is waited for."""
    answers, waiting = [], None
    for ask in asks:
        try:
            answers.append(runner(ask))
        except WaitingError as why:
            waiting = waiting or why
    if waiting is not None:
        raise waiting
    return answers
