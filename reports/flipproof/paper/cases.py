"""The throws of every figure of the paper, in families; a throw that several figures share is one case."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
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
    key : str - names the throw; cases of several families with one key are one throw
    value : float - what varies in the family, in the paper's sense and in SI units (beta is negative)
    scenario : Scenario - with the paper's number of slices
    steps : int - P, points in time of the published program and of the output of the other solvers
    slices_vary : bool - whether the number of slices is the subject, so that no solver may take another
    whole : bool - whether slices are looked at, so that all solvers must store them
    thin : int - every how many of its points are kept; a divisor of ``steps`` - 1
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

Entry = tuple[str, float, Scenario]


def bottle_of_aspect(aspect: float) -> Bottle:
    """Return the paper's bottle with L / 2R changed and pi R^2 L kept, capacity and mass too.

    Parameters
    ----------
    aspect : float - L / 2R, positive
    """
    bottle = paper_throw().bottle
    own = bottle.length / (2 * bottle.radius)
    if aspect == own:
        return bottle
    stretch = (aspect / own) ** (1 / 3)
    return replace(bottle, length=bottle.length * stretch**2, radius=bottle.radius / stretch)


def _entries() -> dict[str, list[Entry]]:
    """Return family -> key, value and throw of each of its members; the key counts unless the throw has one already."""
    throw, long = paper_throw(), number("figure-9-duration")
    ten = replace(throw, n_slices=round(number("figure-5-slices")))
    caption, later = (replace(ten, drag=number(f"figure-5-drag{of}")) for of in ("", "-at-5-per-second"))
    drags = replace(throw, n_slices=round(number("figure-6-slices")))

    def of(parameter: str, key: str, thrown: Callable[[float], Scenario]) -> list[Entry]:
        return [(key.format(value), value, thrown(value)) for value in numbers(parameter)]

    def steps(filling: float) -> list[Entry]:
        return of("figure-S1-steps", f"filling {filling:g}, P {{:g}}", lambda _: paper_throw(filling))

    beta, slices = "figure-5-rebound", "figure-5d-slices"
    angles = of("figure-8b-angle", "", lambda angle: replace(throw, theta0=angle))
    return {
        "filling": of("figure-7-filling", "filling {:g}", paper_throw),
        "long": of("figure-7-filling", "filling {:g}, long", lambda fill: replace(paper_throw(fill), duration=long)),
        "flight": [(ICE, 0.0, replace(throw, frozen=True)), *of("figure-3b-filling", "filling {:g}", paper_throw)],
        "beta": of(beta, "beta {:g}", lambda value: replace(caption, restitution=abs(value))),
        "beta at 5 /s": of(beta, "beta {:g}, 5 /s", lambda value: replace(later, restitution=abs(value))),
        "slices": of(slices, "slices {:g}", lambda count: caption.with_slices(round(count))),
        "slices at 5 /s": of(slices, "slices {:g}, 5 /s", lambda count: later.with_slices(round(count))),
        "slices at alpha 1": of(slices, "slices {:g}, alpha 1", lambda count: replace(caption, n_slices=round(count))),
        "drag": of("figure-6-drag", "drag {:g}", lambda drag: replace(drags, drag=drag)),
        "spin": of("figure-8a-spin", "spin {:g}", lambda spin: replace(throw, omega0=spin)),
        "angle": [(f"angle {math.degrees(angle):.0f}", angle, scenario) for _, angle, scenario in angles],
        "aspect": of("figure-8c-aspect", "aspect {:g}", lambda ratio: replace(throw, bottle=bottle_of_aspect(ratio))),
        **{f"steps {filling:g}": steps(filling) for filling in numbers("figure-S1-filling")},
    }


SLICES_VARY: Final = ("beta", "beta at 5 /s", "slices", "slices at 5 /s", "slices at alpha 1")
"""Families whose subject is the number of slices."""

WHOLE: Final = ("filling", "long", "flight", "beta", "beta at 5 /s", "drag")
"""Families whose slices are looked at."""


def _families() -> dict[str, tuple[Case, ...]]:
    keys: dict[tuple[Scenario, int, bool], str] = {}
    # A long flight has the step of the short one to 0.1 %.
    intervals = (paper_steps() - 1) * number("figure-9-duration") / number("duration")
    long_steps = 1 + LONG_THIN * round(intervals / LONG_THIN)
    steps_vary = {f"steps {filling:g}" for filling in numbers("figure-S1-filling")}

    def case(name: str, key: str, value: float, scenario: Scenario) -> Case:
        steps = long_steps if name == "long" else round(value) if name in steps_vary else paper_steps()
        slices_vary = name in SLICES_VARY
        return Case(
            key=keys.setdefault((scenario, steps, slices_vary), key),
            value=value,
            scenario=scenario,
            steps=steps,
            slices_vary=slices_vary,
            whole=name in WHOLE,
            thin=LONG_THIN if name == "long" else 1,
        )

    return {name: tuple(case(name, *entry) for entry in entries) for name, entries in _entries().items()}


FAMILIES: Final[Mapping[str, tuple[Case, ...]]] = MappingProxyType(_families())
"""Name -> cases: what varies in Fig. 5 to 9 and S1, the figures' own values in their order."""


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


def all_cases() -> dict[str, Case]:
    """Return every case by its key, once each; one that any family looks into slice by slice is ``whole``."""
    found: dict[str, Case] = {}
    for members in FAMILIES.values():
        for case in members:
            if case.key not in found or (case.whole and not found[case.key].whole):
                found[case.key] = case
    return found
