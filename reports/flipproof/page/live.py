"""What a reader may touch: sliders that change the throw, and figures whose curves the page's script draws."""

from __future__ import annotations

import base64
import math
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from flipproof.figures.spoken import spoken
from flipproof.frame.exhibit import Touch
from slicemodel import Scenario
from slicemodel.trajectory import FloatArray

MAX_SLICES: Final = 50
"""Slices of a throw that a browser solves while a slider moves."""

POINTS: Final = 500
"""Points of a curve at the most."""

NONE: Final = 65535
"""What stands for a number that there is not; the others count from 0 to one less."""


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
    """Return the sliders of a throw, each wide enough for its value; the spin keeps its sense, and is never zero."""
    slowest, fastest = (5.0, 25.0) if throw.omega0 > 0 else (-25.0, -5.0)
    usual = (
        Slider("g", "gravity g", "m/s²", 0.0, 20.0, 0.01, 2, throw.gravity),
        Slider("theta0", "angle of release θ₀", "°", -180.0, 180.0, 1.0, 0, math.degrees(throw.theta0)),
        Slider("fill", "filling", "%", 10.0, 100.0, 1.0, 0, 100.0 * throw.fill_fraction),
        Slider("gamma", "drag γ", "/s", 0.0, 20.0, 0.1, 1, throw.damping_rate),
        Slider("e", "restitution e", "", 0.0, 0.8, 0.01, 2, throw.restitution),
        Slider("omega0", "spin ω₀", "rad/s", slowest, fastest, 0.1, 1, throw.omega0),
    )
    return [replace(slider, low=min(slider.low, slider.value), high=max(slider.high, slider.value)) for slider in usual]


def live_data(throw: Scenario) -> dict[str, Any]:
    """Return the throw as the script takes it, in SI units."""
    return {
        "bottle": asdict(throw.bottle),
        "slices": min(throw.n_slices, MAX_SLICES),
        "duration": throw.duration,
        "g": throw.gravity,
        "theta0": throw.theta0,
        "fill": throw.fill_fraction,
        "gamma": throw.damping_rate,
        "e": throw.restitution,
        "omega0": throw.omega0,
    }


def touch_data(touch: Touch) -> dict[str, Any]:
    """Return axes and curves of a figure for the script; a number is a part of the range of all, of 65534."""
    longest = max((t for t, _ in touch.curves.values()), key=len)
    t = np.linspace(longest[0], longest[-1], min(POINTS, len(longest)))
    values = {name: np.interp(t, *curve, left=np.nan, right=np.nan) for name, curve in touch.curves.items()}
    if touch.limits is not None:  # logarithms of absolute values, none below a tenth of the axis's end
        floor = touch.limits[0] / 10
        values = {name: np.log10(np.maximum(np.abs(curve), floor)) for name, curve in values.items()}
    finite = np.concatenate([curve[np.isfinite(curve)] for curve in values.values()])
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    size = max(abs(low), abs(high))
    room = 0.04 * (high - low if high - low > 1e-9 * size else size) or 1.0  # what differs by round-off alone is level
    y: dict[str, Any] = {"label": touch.label, "digits": touch.digits, "high": high + room}
    y["low"] = 0.0 if 0.0 <= low < 0.5 * high else low - room
    if touch.limits is not None:
        y |= {"low": touch.limits[0], "high": touch.limits[1], "log": True, "percent": True}
    return {
        "t": {"low": float(t[0]), "high": float(t[-1]), "count": len(t)},
        "x": "time t [s]",
        "y": y,
        "low": low,
        "high": high,
        "lines": [
            {
                "name": name,
                "words": spoken(name),
                "off": bool(touch.shown) and name not in touch.shown,
                "values": _text(curve, low, high),
            }
            for name, curve in values.items()
        ],
    }


def _text(values: FloatArray, low: float, high: float) -> str:
    parts = np.full(len(values), NONE, dtype="<u2")
    finite = np.isfinite(values)
    parts[finite] = np.rint((values[finite] - low) / ((high - low) or 1.0) * (NONE - 1))
    return base64.b64encode(parts.tobytes()).decode("ascii")
