"""The reference: the slice equations integrated by SciPy, with every rebound, rest and release located as an event.

It shares no formula with the slice model or with the engines: from ``slicemodel`` come only the scenario and
the trajectory. Importing this package does not load SciPy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ode_reference.combinations import model_of
    from ode_reference.impacts import LAWS
    from ode_reference.landing import land
    from ode_reference.landing_flight import fly
    from ode_reference.models import LADDER, MODELS
    from ode_reference.solver import solve
    from ode_reference.steppers import METHODS
    from ode_reference.switches import Switches

__all__ = ["LADDER", "LAWS", "METHODS", "MODELS", "Switches", "fly", "land", "model_of", "solve"]

_HOMES = {
    "LADDER": "ode_reference.models",
    "LAWS": "ode_reference.impacts",
    "METHODS": "ode_reference.steppers",
    "MODELS": "ode_reference.models",
    "Switches": "ode_reference.switches",
    "fly": "ode_reference.landing_flight",
    "land": "ode_reference.landing",
    "model_of": "ode_reference.combinations",
    "solve": "ode_reference.solver",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for on first use (PEP 562), so that start-up stays light."""
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'ode_reference' has no attribute {name!r}")
