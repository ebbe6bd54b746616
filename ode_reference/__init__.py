"""The reference: the slice equations integrated by SciPy, with every rebound, rest and release located as an event.

It shares no formula with the slice model or with the engines: from ``slicemodel`` come only the scenario and
the trajectory. Importing this package does not load SciPy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ode_reference.models import MODELS
    from ode_reference.solver import METHODS, solve

__all__ = ["METHODS", "MODELS", "solve"]

_HOMES = {
    "METHODS": "ode_reference.solver",
    "MODELS": "ode_reference.models",
    "solve": "ode_reference.solver",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for on first use (PEP 562), so that start-up stays light."""
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'ode_reference' has no attribute {name!r}")
