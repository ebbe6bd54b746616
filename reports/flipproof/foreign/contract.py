"""The contract of a foreign solver: what it is asked, and what it says of itself. ``answers`` has what it answers.

def solve(ask):                                       # or an object with this method and the attributes of Traits
    t = ask.times                                     # answer at exactly these times
    theta, omega = integrate(ask.scenario, ask.start, t)
    return {"t": t, "theta": theta, "omega": omega}   # and, if known, r_cm, inertia, r, v, impacts
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

from slicemodel import Scenario
from slicemodel.scenario import shown, unknown_name
from slicemodel.trajectory import FloatArray

PRECISIONS: Final = MappingProxyType({"float64": 2.0**-52, "float32": 2.0**-23})
"""Number formats a solver may compute in, with the spacing of their numbers at 1."""

REFINERS: Final = ("dt", "steps", "rtol")
"""What the effort of a solver may be: a step [s], a number of steps, a relative tolerance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """What a solver is asked.

    Parameters
    ----------
    scenario : Scenario - the throw; units stand in ``slicemodel.scenario``
    times : array, shape (P,) - increasing times in [0, duration] at which to answer [s]
    start : array, shape (N,) - positions of the slices at release, from the cap [m]; they are at rest in the bottle
    effort : float or None - the number that ``Traits.refined_by`` names; None if it names nothing
    options : mapping - what the user gave the solver by name
    """

    scenario: Scenario
    times: FloatArray
    start: FloatArray
    effort: float | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, scenario: Scenario, times: FloatArray, effort: float | None = None, **options: Any) -> Ask:
        """Return the ask for a throw from the start of Eq. 3a, every slice at rest in the water on the base."""
        start = scenario.initial_positions()
        for array in (times, start):
            array.setflags(write=False)
        return cls(scenario=scenario, times=times, start=start, effort=effort, options=MappingProxyType(options))


@dataclass(frozen=True, slots=True, kw_only=True)
class Traits:
    """What a solver says of itself.

    Parameters
    ----------
    name : str - printed on every page; without line breaks
    equation : str or None
        The equation that it solves: a rung of the ladder ("eq8"), a set of switches ("switches:111100"), or a
        published program ("published-python"). None: flipproof is to find out.
    refined_by : {"dt", "steps", "rtol"} or None - what ``Ask.effort`` means to it
    precision : {"float64", "float32"} - of its arithmetic
    order : float or None - order of its error in dt before the first impact
    distribution : str - the installed package it comes from, for the record
    timeout : float - seconds one run may take, in (0, 86400]
    expected_failures : mapping - check -> reason, for failures that its author knows of

    Raises
    ------
    ValueError
        Naming the attribute, its value and the admissible values.
    """

    name: str
    equation: str | None = None
    refined_by: str | None = None
    precision: str = "float64"
    order: float | None = None
    distribution: str = ""
    timeout: float = 60.0
    expected_failures: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip() or not self.name.isprintable():
            raise ValueError(f"name = {shown(self.name)} is not a line of text")
        if self.equation is not None:
            check_equation(self.equation)
        if self.refined_by is not None and self.refined_by not in REFINERS:
            raise ValueError(unknown_name("refined_by =", self.refined_by, REFINERS))
        if self.precision not in PRECISIONS:
            raise ValueError(unknown_name("precision =", self.precision, PRECISIONS))
        if self.order is not None and not _inside(self.order, 0.0, 40.0):
            raise ValueError(f"order = {shown(self.order)} is not a number in (0, 40]")
        if not _inside(self.timeout, 0.0, 86_400.0):
            raise ValueError(f"timeout = {shown(self.timeout)} is not a number of seconds in (0, 86400]")
        failures = self.expected_failures
        if not isinstance(failures, Mapping) or not all(isinstance(x, str) for pair in failures.items() for x in pair):
            raise ValueError(f"expected_failures = {shown(failures)} is not a mapping of checks to reasons")
        object.__setattr__(self, "expected_failures", dict(failures))

    @property
    def epsilon(self) -> float:
        """Spacing of the solver's numbers at 1."""
        return PRECISIONS[self.precision]


def check_equation(name: object) -> None:
    """Refuse by a ValueError what is neither a model of the reference, nor a set of switches, nor a scheme."""
    from ode_reference.models import MODELS
    from ode_reference.switches import PREFIX, Switches
    from slicemodel.schemes import SCHEMES

    if isinstance(name, str) and name.startswith(PREFIX):
        Switches.from_name(name)
    elif name not in MODELS and name not in SCHEMES:
        raise ValueError(unknown_name("equation =", name, [*MODELS, *SCHEMES]))


def traits_of(solver: object, name: str) -> Traits:
    """Return what ``solver`` says of itself; ``name`` serves where it has none.

    Raises ValueError if it cannot be called, has no ``solve``, or an attribute is not admissible.
    """
    solve_of(solver)
    given = {
        f: value
        for f in Traits.__slots__
        if f != "name" and (value := getattr(solver, f, None)) is not None and not callable(value)
    }
    own = getattr(solver, "name", None)
    return Traits(name=own if isinstance(own, str) else name, **given)


def solve_of(solver: object) -> Callable[[Ask], object]:
    """Return the function of one ask that ``solver`` is, or has as ``solve``; raises ValueError if there is none."""
    solve = getattr(solver, "solve", solver)
    if not callable(solve):
        raise ValueError(f"{shown(solver)} is neither callable nor has a method solve(ask)")
    return solve


def _inside(value: object, above: float, most: float) -> bool:
    number = isinstance(value, numbers.Real) and not isinstance(value, bool)
    return number and math.isfinite(float(value)) and above < float(value) <= most  # type: ignore[arg-type]
