"""What a check is: a generator that yields asks, is sent the answers, and returns an observation.

Checks are written this way so that whoever drives them decides where the answers come from: a solver that answers one
ask after the other (``certify``), or a folder of answers computed elsewhere (``files.Folder``).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from flipproof.foreign.contract import Answer, Ask, ForeignError, Traits, WaitingError
from ode_reference.solver import REST_SPEED, REST_SPEED_WITH_RECOIL
from ode_reference.switches import Switches
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

THROW: Final = replace(Scenario(), duration=0.3).with_slices(4)
"""The throw of most checks: the paper's own, cut into four slices; eight impacts and more in 0.3 s."""

SMOOTH: Final = replace(THROW, duration=0.05)
"""The same, ended before the first impact in any equation of the ladder."""

CALM: Final[Mapping[str, Scenario]] = {"weight": replace(SMOOTH, gravity=0.0), "drag": replace(SMOOTH, drag=0.0)}
"""``SMOOTH`` without one of the forces that act before an impact."""


class NotApplicableError(Exception):
    """A check cannot be made of this solver; the message says what is missing, ``facts`` what it found all the same."""

    def __init__(self, message: str, facts: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.facts = dict(facts or {})


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """What a check observed.

    ``expected`` and ``observed`` are phrases with numbers, ``where`` names throw and time, ``advice`` says what to do
    if the check failed; ``weak`` says what the check could not see although it holds; ``facts`` go into the passport.
    """

    holds: bool
    expected: str
    observed: str
    where: str = ""
    advice: str = ""
    weak: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)


Result = TypeVar("Result")
CheckGenerator = Generator[Sequence[Ask], Sequence[Answer], Observation]
Check = Callable[[Traits], CheckGenerator]


def times_of(scenario: Scenario, points: int = 61) -> FloatArray:
    """Return uniform times over the flight [s]; a step of the published program divides the spacing of 61 of them."""
    return np.linspace(0.0, scenario.duration, points)


def ask_of(traits: Traits, scenario: Scenario, level: float = 0, points: int = 61) -> Ask:
    """Return the ask for a throw at a level of refinement; level 0 is a thousandth of the flight, or rtol 1e-6."""
    return Ask.of(scenario, times_of(scenario, points), effort_of(traits, scenario, level))


def effort_of(traits: Traits, scenario: Scenario, level: float) -> float | None:
    """Return the effort of a level: each level halves dt, doubles steps, or divides rtol by ten."""
    if traits.refined_by == "dt":
        return scenario.duration / 960.0 / float(2.0**level)
    if traits.refined_by == "steps":
        return float(round(960 * float(2.0**level)))
    if traits.refined_by == "rtol":
        return max(1e-13, 1e-6 / float(10.0**level))
    return None


def rest_speed_of(switches: Switches) -> float:
    """Return the rest speed of the exact flights that answers are held against: one for all throws [m/s].

    Solvers choose their own, often a fixed one; comparisons allow for what that changes.
    """
    return REST_SPEED_WITH_RECOIL if switches.recoil else REST_SPEED


def refined_words(traits: Traits) -> str:
    """Return what two levels of refinement are, in words."""
    words = {"dt": "a quarter of the step", "steps": "four times the steps", "rtol": "a hundredth of rtol"}
    return words[traits.refined_by or "dt"]


def refined_asks(traits: Traits, points: int = 61) -> list[Ask]:
    """Return the ask for the throw and, if the solver can be refined, the same at a quarter of the step."""
    return [ask_of(traits, THROW, level, points) for level in ((0, 2) if traits.refined_by else (0,))]


def falls_with_step(sizes: Sequence[float], min_ratio: float = 3.0) -> bool:
    """Return whether a change falls by ``min_ratio`` in two levels of refinement: then it is a step's own error."""
    return len(sizes) > 1 and sizes[-1] * min_ratio <= sizes[0]


def refined_text(traits: Traits, sizes: Sequence[float], unit: str = "") -> str:
    """Return the size at the finer level as a phrase that follows the first; empty if there is none."""
    return f", {sizes[-1]:.2g}{unit} at {refined_words(traits)}" if len(sizes) > 1 else ""


def shift(first: Answer, second: Answer, scale: float) -> float:
    """Return the largest difference of two curves omega(t), as a fraction of ``scale``."""
    return float(np.max(np.abs(first.omega - second.omega)) / abs(scale))


WRAPPED: Final = "theta is off by whole turns: do not wrap it"
"""What to do if ``whole_turns`` holds."""


def whole_turns(difference: ArrayLike, room: float) -> bool:
    """Return whether an angle [rad] is off by whole turns, within ``room`` turns, at one time or more."""
    turns = np.asarray(difference) / (2 * np.pi)
    whole = np.rint(turns)
    return bool(np.any(whole)) and float(np.max(np.abs(turns - whole))) <= room


def scales(throw: Scenario, inertia: ArrayLike = ()) -> dict[str, float]:
    """Return the scale of each field, for relative differences; of the inertia it is the largest value."""
    spin, length = abs(throw.omega0), throw.bottle.length
    return {
        "omega": spin,
        "theta": max(1.0, spin * throw.duration),
        "r": length,
        "r_cm": length,
        "inertia": float(np.max(inertia, initial=0.0)) or 1.0,
        "v": length * spin,
    }


def decimals_of(fields: Collection[FloatArray], candidates: Iterable[int]) -> int | None:
    """Return the first of some numbers of decimals with which all fields are printed exactly; None: with none."""
    return next((d for d in candidates if all(np.array_equal(np.round(values, d), values) for values in fields)), None)


def time_of_max(times: FloatArray, values: FloatArray) -> str:
    """Return the time of the largest of ``values``, as a phrase."""
    return f"t = {times[int(np.argmax(values))]:.4g} s"


def drive(generator: Generator[Sequence[Ask], Sequence[Answer], Result], runner: Callable[[Ask], Answer]) -> Result:
    """Drive a generator of asks to its end, send it the answers of ``runner``, and return its result."""
    try:
        asks = next(generator)
        while True:
            try:
                answers = _answers(asks, runner)
            except WaitingError:
                raise
            except ForeignError as error:
                asks = generator.throw(error)
                continue
            asks = generator.send(answers)
    except StopIteration as end:
        result: Result = end.value
        return result


def _answers(asks: Sequence[Ask], runner: Callable[[Ask], Answer]) -> list[Answer]:
    """Return an answer to each ask; where answers are written by hand, all asks are put before any is waited for."""
    answers, waiting = [], None
    for ask in asks:
        try:
            answers.append(runner(ask))
        except WaitingError as error:
            waiting = waiting or error
    if waiting is not None:
        raise waiting
    return answers
