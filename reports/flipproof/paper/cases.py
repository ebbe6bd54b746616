"""The throws of every figure of the paper, in families; a throw that several figures share is one case."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import Final

from flipproof.paper.parameters import number, numbers, paper_steps, paper_throw
from slicemodel import Bottle, Scenario
from slicemodel.scenario import unknown_name


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One throw of a family.

    Parameters
    ----------
    key : str
        Names the throw; cases of several families with one key are one throw.
    value : float
        What varies in the family, in the paper's sense and in SI units (beta is negative).
    scenario : Scenario
        With the paper's number of slices.
    steps : int
        P, points in time of the published program and of the output of the other solvers.
    slices_vary : bool
        Whether the number of slices is the subject, so that no solver may take another.
    whole : bool
        Whether slices are looked at, so that all solvers must store them.
    thin : int
        Every how many of its points are kept; a divisor of ``steps`` - 1.
    """

    key: str
    value: float
    scenario: Scenario
    steps: int
    slices_vary: bool = False
    whole: bool = False
    thin: int = 1


HALF_FULL: Final = "filling 0.5"
"""Key of the paper's standard throw, the one that the families of Fig. 6, 7 and 8 share."""

ICE: Final = "ice"

LONG_THIN: Final = 3
"""Every how many points of a long flight are kept: every slice at every step would take hundreds of megabytes."""


def family(name: str) -> tuple[Case, ...]:
    """Return the cases of one family.

    Raises
    ------
    ValueError
        If there is no such family.
    """
    if name not in FAMILIES:
        raise ValueError(unknown_name("family", name, FAMILIES))
    return FAMILIES[name]


def _fillings() -> Iterator[tuple[str, float, Scenario]]:
    for filling in numbers("figure-7-filling"):
        yield f"filling {filling:g}", filling, paper_throw(filling)


def _five(drag: float) -> Scenario:
    return replace(paper_throw(), n_slices=round(number("figure-5-slices")), drag=drag)


def _rebounds(drag: float, suffix: str) -> Iterator[tuple[str, float, Scenario]]:
    for beta in numbers("figure-5-rebound"):
        yield f"beta {beta:g}{suffix}", beta, replace(_five(drag), restitution=abs(beta))


def _slices(drag: float, suffix: str) -> Iterator[tuple[str, float, Scenario]]:
    for count in numbers("figure-5d-slices"):
        yield f"slices {count:g}{suffix}", count, _five(drag).with_slices(round(count))


def _slices_at_one_drag() -> Iterator[tuple[str, float, Scenario]]:
    for count in numbers("figure-5d-slices"):
        scenario = replace(_five(number("figure-5-drag")), n_slices=round(count))
        yield f"slices {count:g}, alpha 1", count, scenario


def _drags() -> Iterator[tuple[str, float, Scenario]]:
    for drag in numbers("figure-6-drag"):
        slices = round(number("figure-6-slices"))
        yield f"drag {drag:g}", drag, replace(paper_throw(), n_slices=slices, drag=drag)


def _spins() -> Iterator[tuple[str, float, Scenario]]:
    for spin in numbers("figure-8a-spin"):
        yield f"spin {spin:g}", spin, replace(paper_throw(), omega0=spin)


def _angles() -> Iterator[tuple[str, float, Scenario]]:
    for angle in numbers("figure-8b-angle"):
        yield f"angle {math.degrees(angle):.0f}", angle, replace(paper_throw(), theta0=angle)


def _aspects() -> Iterator[tuple[str, float, Scenario]]:
    for aspect in numbers("figure-8c-aspect"):
        yield f"aspect {aspect:g}", aspect, replace(paper_throw(), bottle=bottle_of_aspect(aspect))


def bottle_of_aspect(aspect: float) -> Bottle:
    """Return the paper's bottle with L / 2R changed and pi R^2 L kept, capacity and mass too.

    Parameters
    ----------
    aspect : float
        L / 2R, positive.
    """
    bottle = paper_throw().bottle
    own = bottle.length / (2 * bottle.radius)
    if aspect == own:
        return bottle
    stretch = (aspect / own) ** (1 / 3)
    return replace(bottle, length=bottle.length * stretch**2, radius=bottle.radius / stretch)


def _long() -> Iterator[tuple[str, float, Scenario]]:
    for key, filling, scenario in _fillings():
        yield f"{key}, long", filling, replace(scenario, duration=number("figure-9-duration"))


def _long_steps() -> int:
    """Points of a long flight: the step of the short one to 0.1 %."""
    intervals = (paper_steps() - 1) * number("figure-9-duration") / number("duration")
    return 1 + LONG_THIN * round(intervals / LONG_THIN)


def _flights() -> Iterator[tuple[str, float, Scenario]]:
    yield ICE, 0.0, replace(paper_throw(), frozen=True)
    for filling in numbers("figure-3b-filling"):
        yield f"filling {filling:g}", filling, paper_throw(filling)


@cache
def _families() -> dict[str, tuple[Case, ...]]:
    keys: dict[tuple[Scenario, int, bool], str] = {}

    def cases(
        entries: Iterator[tuple[str, float, Scenario]], *, slices_vary: bool = False, whole: bool = False,
        steps: int = paper_steps(), thin: int = 1,
    ) -> tuple[Case, ...]:  # fmt: skip
        found = []
        for key, value, scenario in entries:
            key = keys.setdefault((scenario, steps, slices_vary), key)
            found.append(
                Case(key=key, value=value, scenario=scenario, steps=steps, slices_vary=slices_vary, whole=whole,
                     thin=thin)
            )  # fmt: skip
        return tuple(found)

    caption, later = number("figure-5-drag"), number("figure-5-drag-at-5-per-second")
    made = {
        "filling": cases(_fillings(), whole=True),
        "long": cases(_long(), whole=True, steps=_long_steps(), thin=LONG_THIN),
        "flight": cases(_flights(), whole=True),
        "beta": cases(_rebounds(caption, ""), slices_vary=True, whole=True),
        "beta at 5 /s": cases(_rebounds(later, ", 5 /s"), slices_vary=True, whole=True),
        "slices": cases(_slices(caption, ""), slices_vary=True),
        "slices at 5 /s": cases(_slices(later, ", 5 /s"), slices_vary=True),
        "slices at alpha 1": cases(_slices_at_one_drag(), slices_vary=True),
        "drag": cases(_drags(), whole=True),
        "spin": cases(_spins()),
        "angle": cases(_angles()),
        "aspect": cases(_aspects()),
    }
    for filling in numbers("figure-S1-filling"):
        made[f"steps {filling:g}"] = tuple(
            replace(case, value=steps)
            for steps in numbers("figure-S1-steps")
            for case in cases(iter([(f"filling {filling:g}, P {steps:g}", filling, paper_throw(filling))]),
                              steps=round(steps))
        )  # fmt: skip
    return made


FAMILIES: Final[Mapping[str, tuple[Case, ...]]] = MappingProxyType(_families())
"""Name -> cases: what varies in Fig. 5 to 9 and S1, the figures' own values in their order."""


def all_cases() -> dict[str, Case]:
    """Return every case by its key, once each; one that any family looks into slice by slice is ``whole``."""
    found: dict[str, Case] = {}
    for members in FAMILIES.values():
        for case in members:
            known = found.get(case.key)
            if known is None or (case.whole and not known.whole):
                found[case.key] = case
    return found
