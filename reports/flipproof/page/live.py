"""The sliders: what a reader may change of the throw, and what the script needs to solve it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from slicemodel import Scenario

MOST_SLICES: Final = 50
"""Slices of a throw that a browser solves while a slider moves."""


@dataclass(frozen=True, slots=True)
class Slider:
    """One slider, in the unit that it shows."""

    name: str
    words: str
    unit: str
    low: float
    high: float
    step: float
    digits: int
    value: float

    @property
    def shown(self) -> str:
        """The value with its unit."""
        space = "" if self.unit == "°" else " "
        return f"{self.value:.{self.digits}f}{space}{self.unit}".strip().replace("-", "−")


def sliders(throw: Scenario) -> list[Slider]:
    """Return the sliders of a throw, each wide enough for its value."""
    asked: tuple[tuple[str, str, str, float, float, float, int, float], ...] = (
        ("g", "gravity g", "m/s²", 0.0, 20.0, 0.01, 2, throw.gravity),
        ("theta0", "angle of release θ₀", "°", -180.0, 180.0, 1.0, 0, math.degrees(throw.theta0)),
        ("fill", "filling", "%", 10.0, 100.0, 1.0, 0, 100.0 * throw.fill_fraction),
        ("gamma", "drag γ", "/s", 0.0, 20.0, 0.1, 1, throw.damping_rate),
        ("e", "restitution e", "", 0.0, 0.8, 0.01, 2, throw.restitution),
        ("omega0", "spin ω₀", "rad/s", 5.0, 25.0, 0.1, 1, throw.omega0),
    )
    return [
        Slider(name, words, unit, min(low, value), max(high, value), step, digits, value)
        for name, words, unit, low, high, step, digits, value in asked
    ]


def live_data(throw: Scenario) -> dict[str, Any]:
    """Return the throw as the script takes it, in SI units."""
    bottle = throw.bottle
    return {
        "bottle": {
            "length": bottle.length, "radius": bottle.radius, "mass": bottle.mass, "capacity": bottle.capacity
        },
        "slices": min(throw.n_slices, MOST_SLICES),
        "duration": throw.duration,
        "g": throw.gravity,
        "theta0": throw.theta0,
        "fill": throw.fill_fraction,
        "gamma": throw.damping_rate,
        "e": throw.restitution,
        "omega0": throw.omega0,
    }  # fmt: skip
