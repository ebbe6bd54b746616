"""Checks of what a caller hands to ``solve``: every message names the argument, its value and what is admissible."""

from __future__ import annotations

import math
import numbers

import numpy as np
from numpy.typing import ArrayLike

from slicemodel.scenario import Scenario
from slicemodel.trajectory import FloatArray


def number_above(name: str, value: object, above: float, maximum: float, unit: str = "") -> float:
    """Return ``value`` as float if it lies in (above, maximum], else raise ValueError; NaN lies in no range."""
    number = _finite(value)
    if not above < number <= maximum:
        raise ValueError(f"{name} = {value!r}{unit} is outside ({above:g}, {maximum:g}]{unit}")
    return number


def number_within(name: str, value: object, minimum: float, maximum: float = math.inf, unit: str = "") -> float:
    """Return ``value`` as float if it is finite and lies in [minimum, maximum], else raise ValueError."""
    number = _finite(value)
    if not minimum <= number <= maximum:
        upper = f"{maximum:g}]" if maximum < math.inf else "inf)"
        raise ValueError(f"{name} = {value!r}{unit} is outside [{minimum:g}, {upper}{unit}")
    return number


def velocities_of(scenario: Scenario, speeds: ArrayLike) -> FloatArray:
    """Return ``speeds`` as an array if they are N finite numbers, of slices that can move; else raise ValueError."""
    try:
        velocities = np.asarray(speeds, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"speeds = {speeds!r} are no numbers") from None
    if velocities.shape != (scenario.n_slices,) or not np.isfinite(velocities).all():
        raise ValueError(f"speeds = {speeds!r} are not {scenario.n_slices} finite numbers [m/s]")
    if scenario.frozen and velocities.any():
        raise ValueError(f"speeds = {speeds!r} m/s of frozen water: it does not move")
    return velocities


def _finite(value: object) -> float:
    """Return ``value`` as float, NaN for whatever is no finite number."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not math.isfinite(value):
        return math.nan
    return float(value)
