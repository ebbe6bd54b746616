"""Why a run stopped, in the words that every solver of this room uses."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from slicemodel.scenario import Scenario


def overflow(model: str, scenario: Scenario, t: float) -> str:
    """Return that numbers left the floating-point range after ``t`` [s], and which fields of the throw to look at."""
    return (
        f"{model}: a number exceeded the floating-point range after t = {t:.9g} s; "
        f"omega0 = {scenario.omega0:g} rad/s, drag = {scenario.drag:g} kg/s and "
        f"gravity = {scenario.gravity:g} m/s^2 cannot be computed together"
    )


STIFF: Final = "stiff"
"""Reason code of a run that stalled because a rate of its equations is too fast for the duration."""


def stiff(model: str, scenario: Scenario, t: float, rate: float) -> str:
    """Return that a ``rate`` [1/s] of the equations is too fast for the duration, and which fields make it."""
    turns = abs(scenario.omega0) >= rate
    fields = (
        f"omega0 = {scenario.omega0:g} rad/s"
        if turns
        else (
            f"drag = {scenario.drag:g} kg/s on slices of {scenario.slice_mass:g} kg in a bottle of "
            f"{scenario.bottle.mass:g} kg"
        )
    )
    advice = "omega0 or duration" if turns else "drag or duration, or raise bottle.mass"
    return (
        f"{model}: stiff: stopped at t = {t:.9g} s, for {fields} makes a rate of {rate:.3g} /s, too fast to be "
        f"followed over duration = {scenario.duration:g} s; lower {advice}"
    )


MAX_IMPACTS, IMPACTS_A_SLICE = 2_000_000, 20
"""Greatest number of impacts of one run, and how many each slice adds to it; an impact takes 48 bytes of memory."""


def max_impacts(slices: int) -> int:
    """Return the number of impacts after which a run of so many slices ends as exhausted."""
    return MAX_IMPACTS + IMPACTS_A_SLICE * slices


def exhausted(model: str, impacts: int, t: float) -> str:
    """Return that the run has had as many impacts as a run may have."""
    return (
        f"{model}: stopped at t = {t:.9g} s after {impacts} impacts, the greatest number of one run; "
        "lower duration or restitution"
    )


def stalled(model: str, why: str, t: float, slices: NDArray[np.int64], rest_speed: float) -> str:
    """Return that the time ceased to pass at ``t`` [s]; ``slices`` are those of the last impacts."""
    numbers = ", ".join(map(str, np.unique(slices))) or "none"
    return (
        f"{model}: {why.rstrip('.')} at t = {t:.9g} s; slices of the last impacts: {numbers}; "
        f"if they chatter, raise rest_speed (now {rest_speed:g} m/s), else check omega0, gravity and drag"
    )
