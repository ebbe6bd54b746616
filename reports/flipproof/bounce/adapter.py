"""What an engine's author writes: a function that drops a body on a floor.

    def drop(height, speed, restitution, gravity, dt, duration):
        ...                     # y = height above the floor [m], speed upward [m/s], gravity downward [m/s^2]
        return t, y, v          # at the engine's own steps, from release to duration

An adapter is named as a solver is: file.py:name, package.module:name, or cmd:'program {height} {speed} {restitution}
{gravity} {dt} {duration}', which prints the columns t,y,v as CSV. The name stands for ``drop`` itself, or for a module,
class or object that has it, optionally with ``settings``, a mapping to be printed.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from flipproof.foreign.contract import numbers_of
from slicemodel.scenario import shortened

FloatArray = NDArray[np.float64]
Drop = Callable[[float, float, float, float, float, float], tuple[FloatArray, FloatArray, FloatArray]]

BUILT_IN: Final = ("pymunk", "mujoco", "box2d")
"""Adapters that come with flipproof (``flipproof.bounce.engines``)."""

PARAMETERS: Final = ("height", "speed", "restitution", "gravity", "dt", "duration")
"""What a command may name in braces."""

TIMEOUT: Final = 20.0
"""Seconds that a command may take for one flight."""


class AdapterError(ValueError):
    """An adapter cannot be loaded, or its answer is no flight; the message says in one line what is wrong."""


@dataclass(frozen=True)
class Adapter:
    """An engine, as its author wrote it.

    Parameters
    ----------
    name : str
    settings : mapping - the settings that the engine reports, printed as they are
    """

    name: str
    ask_drop: Callable[..., Any]
    settings: Mapping[str, Any] = field(default_factory=dict)

    def drop(
        self, height: float, speed: float, restitution: float, gravity: float, dt: float, duration: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return t [s], y [m] and v [m/s] of one body, shape (P,) each.

        Raises
        ------
        AdapterError
            If the adapter raises anything, or returns no flight of that duration.
        """
        arguments = map(float, (height, speed, restitution, gravity, dt, duration))
        t, y, v = _arrays(_answer(self.ask_drop, dict(zip(PARAMETERS, arguments, strict=True))))
        _check_times(t, dt, duration)
        return t, y, v


def _answer(call: Callable[..., Any], arguments: Mapping[str, float]) -> Any:
    """Return what an adapter answers; what it raises becomes an AdapterError with the question and the place."""
    try:
        return call(*arguments.values())
    except AdapterError:
        raise
    except Exception as error:  # of somebody else's code
        question = ", ".join(f"{name}={value:.6g}" for name, value in arguments.items())
        place = traceback.extract_tb(error.__traceback__)[-1]
        message = shortened(f"{type(error).__name__}: {error}", 200)
        raise AdapterError(
            f"({question}) raised {message} ({Path(place.filename).name}, line {place.lineno})"
        ) from error


def _arrays(answer: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return t, y and v, all finite and of one length."""
    if not isinstance(answer, Sequence) or len(answer) != 3:
        raise AdapterError("the answer is no triple of t, y, v")
    try:
        rows = np.size(answer[0])
        t, y, v = (numbers_of(name, column, (rows,)) for name, column in zip("tyv", answer, strict=True))
    except ValueError as error:
        raise AdapterError(str(error)) from None
    return t, y, v


def _check_times(t: FloatArray, dt: float, duration: float) -> None:
    if len(t) < 2:
        raise AdapterError(f"t has {len(t)} entries; those from 0 to {duration:.6g} s are needed")
    if not (np.diff(t) > 0).all():
        k = int(np.argmin(np.diff(t) > 0))
        raise AdapterError(f"t does not increase: t[{k}] = {t[k]:.6g} s, t[{k + 1}] = {t[k + 1]:.6g} s")
    if not abs(t[-1] - duration) <= 1.5 * dt:
        raise AdapterError(f"t ends at {t[-1]:.6g} s; {duration:.6g} s were asked")
