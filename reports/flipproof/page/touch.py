"""A figure to be touched: its curves as numbers that the page's script draws."""

from __future__ import annotations

import base64
from typing import Any, Final

import numpy as np

from flipproof.frame.exhibit import Touch
from flipproof.frame.spoken import spoken
from slicemodel.trajectory import FloatArray

POINTS: Final = 500
"""Points of a curve at the most."""

NONE: Final = 65535
"""What stands for a number that there is not; the others count from 0 to one less."""


def touch_data(touch: Touch) -> dict[str, Any]:
    """Return axes and curves of a figure for the script; a number is a part of the range of all, of 65534."""
    longest = max((t for t, _ in touch.curves.values()), key=len)
    t = np.linspace(longest[0], longest[-1], min(POINTS, len(longest)))
    values = {
        name: _drawn(np.interp(t, *curve, left=np.nan, right=np.nan), touch) for name, curve in touch.curves.items()
    }
    finite = np.concatenate([each[np.isfinite(each)] for each in values.values()])
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    room = 0.04 * (high - low) or 1.0
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
                "values": _text(each, low, high),
            }
            for name, each in values.items()
        ],
    }


def _drawn(values: FloatArray, touch: Touch) -> FloatArray:
    """Return values as they are drawn: on a logarithmic axis their logarithms, none below a tenth of its end."""
    return values if touch.limits is None else np.log10(np.maximum(np.abs(values), touch.limits[0] / 10))


def _text(values: FloatArray, low: float, high: float) -> str:
    parts = np.full(len(values), NONE, dtype="<u2")
    there = np.isfinite(values)
    parts[there] = np.rint((values[there] - low) / ((high - low) or 1.0) * (NONE - 1))
    return base64.b64encode(parts.tobytes()).decode("ascii")
