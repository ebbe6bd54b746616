"""Why a run stopped, in the words that every solver of this room uses."""

from __future__ import annotations

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


def stalled(model: str, why: str, t: float, slices: NDArray[np.int64], rest_speed: float) -> str:
    """Return that the time ceased to pass at ``t`` [s]; ``slices`` are those of the last impacts."""
    who = ", ".join(map(str, np.unique(slices))) or "none"
    return (
        f"{model}: {why.rstrip('.')} at t = {t:.9g} s; slices of the last impacts: {who}; "
        f"if they chatter, raise rest_speed (now {rest_speed:g} m/s), else check omega0, gravity and drag"
    )
